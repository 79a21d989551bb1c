//! RAPID's routines that get targets: `PROC Pick(robtarget p,\robtarget via)`, and which arguments their calls give.

use std::collections::{HashMap, HashSet};

use crate::scan::hashed;
use crate::text::{Cursor, begins_line, lower};

/// Instructions of the language, and words that begin other statements: no routines of others.
const INSTRUCTIONS: &str = "
    AccSet ActEventBuffer ActUnit Add AliasIO AliasIOReset ArcRefresh BitClear BitSet BookErrNo Break CallByVar CancelLoad CheckProgRef
    CirPathMode Clear ClearIOBuff ClearPath ClearRawBytes ClkReset ClkStart ClkStop Close CloseDir Compact ConfJ ConfL CONNECT CopyFile
    CopyRawBytes CorrClear CorrDiscon CorrWrite DeactEventBuffer DeactUnit Decr DitherAct DitherDeact DropSensor DropWObj EGMActJoint
    EGMActMove EGMActPose EGMGetId EGMReset EGMSetupAI EGMSetupAO EGMSetupGI EGMSetupLTAPP EGMSetupUC EGMStop EGMStreamStart EGMStreamStop
    EOffsOff EraseModule ErrLog ErrRaise ErrWrite EXIT ExitCycle FitCircle FricIdInit GetDataVal GetGroupSignalInfo GetJointData GetSysData
    GetTorqueMargin GetTrapData GOTO GripLoad HollowWristReset IDelete IDisable IEnable IError Incr IndReset InvertDO IOBusStart IOBusState
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
    loaddata speeddata zonedata confdata extjoint robjoint intnum socketdev iodev errnum signaldi signaldo triggdata stoppointdata";

/// Whether a word begins a statement of the language, and no call.
#[must_use]
pub(super) fn is_instruction(word: &[u8]) -> bool {
    static KNOWN: std::sync::OnceLock<HashSet<u64>> = std::sync::OnceLock::new();
    KNOWN
        .get_or_init(|| INSTRUCTIONS.split_ascii_whitespace().map(|w| hashed(w.as_bytes())).collect())
        .contains(&hashed(word))
}

/// Whether a statement begins with the word at `at`: it is the first of its line, and the line above is none that goes on.
#[must_use]
pub(super) fn begins_statement(bytes: &[u8], at: usize) -> bool {
    let near = at.saturating_sub(FARTHEST);
    let above = bytes[near..at].split(|b| *b == b'\n').rev().skip(1);
    let code = above.map(|line| line.split(|b| *b == b'!').next().unwrap_or(line).trim_ascii()).find(|l| !l.is_empty());
    begins_line(bytes, at) && !code.and_then(<[u8]>::last).is_some_and(|b| b",\\([+-*/=".contains(b))
}

/// What a routine does to those that call it.
#[derive(Clone, Debug, Default)]
pub struct Effects {
    /// Whether it moves the arm.
    pub moves: bool,
    /// Whether it displaces the motions that follow.
    pub displaces: bool,
    /// Data that it sets, by their hashed names.
    pub sets: Vec<u64>,
    /// What it calls, in lower case.
    pub calls: Vec<String>,
    /// Of a module: data that it declares.
    pub(super) own: HashSet<u64>,
}

/// Data that a routine sets and routines that it calls, at most.
const MOST: usize = 1000;

impl Effects {
    /// Sets these data.
    pub(super) fn set(&mut self, name: u64) {
        if self.sets.len() < MOST && !self.sets.contains(&name) {
            self.sets.push(name);
        }
    }

    /// Calls this routine.
    pub(super) fn call(&mut self, word: &[u8]) {
        let name = lower(word);
        if self.calls.len() < MOST && !self.calls.contains(&name) {
            self.calls.push(name);
        }
    }
}

/// An argument that is a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    /// Its hashed name.
    pub name: u64,
    /// What it is called outside its routine: the same name in another routine is another one.
    pub scoped: u64,
    /// Which argument it is, not counting those that are named where they are given (`\via:=`); `None` is one of these.
    pub place: Option<usize>,
    /// Whether the routine may change what it gets.
    pub by_reference: bool,
}

/// Bytes before the bracket of a routine's head that are looked at.
const FARTHEST: usize = 300;

/// The routines of a module by their hashed names, and which targets they get.
#[must_use]
pub(super) fn routines(bytes: &[u8]) -> HashMap<u64, Vec<Parameter>> {
    let mut found = HashMap::new();
    let mut at = 0;
    while let Some(k) = bytes[at..].iter().position(|b| *b == b'(') {
        at += k + 1;
        // the head of a routine is short, however long the line is
        let near = at.saturating_sub(FARTHEST);
        let line = bytes[near..at].iter().rposition(|b| *b == b'\n').map_or(near, |k| near + k + 1);
        let mut words = bytes[line..at - 1].split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        let is_routine = words.any(|w| [&b"proc"[..], b"func"].iter().any(|kind| w.eq_ignore_ascii_case(kind)));
        if let (true, Some(name)) = (is_routine, words.next_back()) {
            let routine = hashed(name);
            found.insert(routine, parameters(bytes, at, routine));
        }
    }
    found
}

/// What a name is called among all names: arguments of a routine are its own.
#[must_use]
pub(super) fn key(parameters: &[Parameter], name: &[u8]) -> u64 {
    let name = hashed(name);
    parameters.iter().find(|p| p.name == name).map_or(name, |p| p.scoped)
}

/// Those that are targets, from behind the bracket on.
fn parameters(bytes: &[u8], at: usize, routine: u64) -> Vec<Parameter> {
    let mut c = Cursor::new(bytes, b'!');
    c.at = at;
    let mut found = Vec::new();
    let mut places = 0..;
    loop {
        let place = if c.eat(b'\\') { None } else { places.next() };
        c.skip_space();
        let mut kind = c.word();
        let is = |kind: &[u8], names: &[&[u8]]| names.iter().any(|n| kind.eq_ignore_ascii_case(n));
        let by_reference = is(kind, &[b"inout", b"var", b"pers", b"ref"]);
        if by_reference {
            c.skip_space();
            kind = c.word();
        }
        c.skip_space();
        let name = hashed(c.word());
        if is(kind, &[b"robtarget", b"jointtarget"]) {
            let scoped = hashed(&[routine.to_le_bytes(), name.to_le_bytes()].concat());
            found.push(Parameter { name, scoped, place, by_reference });
        }
        while !c.done() && !matches!(c.peek(), b',' | b'|' | b'\\' | b')' | b'\n') {
            c.at += 1;
        }
        // what may be given instead of the one before counts as it does
        if !matches!(c.peek(), b',' | b'|' | b'\\' | b'\n') {
            return found;
        }
        c.at += usize::from(c.peek() != b'\\');
    }
}
