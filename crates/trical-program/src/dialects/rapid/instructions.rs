//! Words of RAPID that are no routines of its users.

use std::collections::HashSet;

use crate::scan::hashed;

/// Instructions of the language, and words that begin other statements: no routines of others.
const INSTRUCTIONS: &str = "
    AccSet ActEventBuffer ActUnit Add AliasIO AliasIOReset ArcRefresh BitClear BitSet BookErrNo Break CallByVar CancelLoad CheckProgRef
    CirPathMode Clear ClearIOBuff ClearPath ClearRawBytes ClkReset ClkStart ClkStop Close CloseDir Compact ConfJ ConfL CONNECT CopyFile
    CopyRawBytes CorrClear CorrDiscon CorrWrite DeactEventBuffer DeactUnit Decr DitherAct DitherDeact DropSensor DropWObj EGMActJoint
    EGMActMove EGMActPose EGMGetId EGMReset EGMSetupAI EGMSetupAO EGMSetupGI EGMSetupLTAPP EGMSetupUC EGMStop EGMStreamStart EGMStreamStop
    EOffsOff EraseModule ErrLog ErrRaise ErrWrite EXIT ExitCycle FitCircle FricIdInit GetDataVal GetGroupSignalInfo GetJointData GetSysData
    GetTorqueMargin GetTrapData GOTO GripLoad HollowWristReset IDelete IDisable IEnable IError Incr IndAMove IndCMove IndDMove IndReset IndRMove InvertDO IOBusStart IOBusState
    IODisable IOEnable IPers IRMQMessage ISignalAI ISignalAO ISignalDI ISignalDO ISignalGI ISignalGO ISleep ITimer IVarValue IWatch Load
    LoadId MakeDir ManLoadIdProc MechUnitLoad MotionPlannerSwitch MotionProcessModeSet MotionSup MToolRotCalib MToolTCPCalib Open OpenDir
    PackDNHeader PackRawBytes PathAccLim PathLengthReset PathLengthStart PathLengthStop PathRecStart PathRecStop PathResol PDispOff
    PFRestart PinRule ProcerrRecovery ProcCall PulseDO RAISE RaiseToUser ReadAnyBin ReadBlock ReadCfgData ReadErrData ReadRawBytes ReadVarArr
    RemoveAllCyclicBool RemoveCyclicBool RemoveDir RemoveFile RenameFile Reset ResetAxisDistance ResetPPMoved ResetRetryCount
    ResetTorqueMargin RestoPath RETRY RETURN Rewind RMQEmptyQueue RMQFindSlot RMQGetMessage RMQGetMsgData RMQGetMsgHeader RMQReadWait
    RMQSendMessage RMQSendWait SafetyControllerSyncRequest Save SaveCfgData SCWrite SenDevice Set SetAllDataVal SetAO SetDataSearch
    SetDataVal SetDO SetGO SetLeadThrough SetSysData SetupCyclicBool SiConnect SiClose SiGetCyclic SingArea SiSetCyclic SkipWarn
    SocketAccept SocketBind SocketClose SocketConnect SocketCreate SocketListen SocketReceive SocketReceiveFrom SocketSend SocketSendTo
    SoftAct SoftDeact SoftElbow SpeedLimAxis SpeedLimCheckPoint SpeedRefresh SpyStart SpyStop StartLoad StartMove StartMoveRetry STCalib
    STClose STIndGun STIndGunReset Stop StopMove StopMoveReset StorePath STOpen STTune STTuneReset SupSyncSensorOff SupSyncSensorOn
    SyncMoveOff SyncMoveOn SyncMoveResume SyncMoveSuspend SyncMoveUndo SyncToSensor SystemStopAction TestSignDefine TestSignReset
    TextTabInstall TPErase TPReadDnum TPReadFK TPReadNum TPShow TPWrite TriggCheckIO TriggDataCopy TriggDataReset TriggEquip TriggInt
    TriggIO TriggRampAO TriggSpeed TriggStopProc TryInt TRYNEXT TuneReset TuneServo UIMsgBox UIMsgWrite UIMsgWriteAbort UIShow UnLoad
    UnpackRawBytes VelSet WaitAI WaitAO WaitDI WaitDO WaitGI WaitGO WaitLoad WaitRob WaitSensor WaitSyncTask WaitTestAndSet WaitTime
    WaitUntil WaitWObj WarmStart WorldAccLim Write WriteAnyBin WriteBin WriteBlock WriteCfgData WriteRawBytes WriteStrBin WriteVar
    WriteVarArr WZBoxDef WZCylDef WZDisable WZDOSet WZEnable WZFree WZHomeJointDef WZLimJointDef WZLimSup WZSphDef
    ALIAS AND CONST DIV ENDMODULE ENDRECORD FALSE LOCAL MOD MODULE NOT OR PERS RECORD SYSMODULE TASK THEN TO TRUE VAR XOR NOSTEPIN NOVIEW
    VIEWONLY READONLY STEP FROM DO WITH INOUT bool byte clock dnum num string pos pose orient robtarget jointtarget tooldata wobjdata
    loaddata speeddata zonedata confdata extjoint robjoint intnum socketdev iodev errnum signaldi signaldo triggdata stoppointdata
    switch signalai signalao signalgi signalgo shapedata rawbytes identno wzstationary wztemporary trapdata taskid tunetype welddata seamdata weavedata";

/// Whether a word begins a statement of the language, and no call.
#[must_use]
pub(super) fn is_instruction(word: &[u8]) -> bool {
    static KNOWN: std::sync::OnceLock<HashSet<u64>> = std::sync::OnceLock::new();
    KNOWN
        .get_or_init(|| INSTRUCTIONS.split_ascii_whitespace().map(|w| hashed(w.as_bytes())).collect())
        .contains(&hashed(word))
}
