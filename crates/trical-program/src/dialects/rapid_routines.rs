//! RAPID's routines that get targets: `PROC Pick(robtarget p,\robtarget via)`, and which arguments their calls give.

use std::collections::HashSet;

use super::rapid_reader::{FARTHEST, Parameter, Reader};
use crate::names::Origin;
use crate::scan::{Call, hashed};
use crate::text::{begins_line, lower};

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

impl Reader<'_> {
    /// Perhaps a call: what it gives to a routine of this file that gets targets.
    pub(super) fn call(&mut self, from: usize, word: &[u8]) {
        let routine = hashed(word);
        let Some(parameters) = self.routines.get(&routine).cloned() else {
            return self.call_elsewhere(from, word, routine);
        };
        self.note(|routine| routine.call(word));
        self.names.called(routine, false);
        if parameters.is_empty() {
            return;
        }
        let mut places = 0..;
        // a call may be put in brackets, as an argument may
        while !self.c.done() && self.c.peek() != b';' {
            self.c.skip_space();
            let mut parameter = None;
            if self.c.eat(b'\\') {
                let name = hashed(self.c.word());
                if self.c.eat(b':') && self.c.eat(b'=') {
                    parameter = parameters.iter().find(|p| p.place.is_none() && p.name == name).copied();
                }
            } else {
                let place = places.next();
                parameter = parameters.iter().find(|p| p.place == place).copied();
            }
            while self.c.eat(b'(') {}
            if let Some(parameter) = parameter {
                self.argument(parameter);
            }
            // to the next one
            let mut depth = 0;
            while !self.c.done() {
                match self.c.peek() {
                    b'(' | b'[' | b'{' => depth += 1,
                    b')' | b']' | b'}' => depth -= 1,
                    b'"' => {
                        self.c.skip_string();
                        continue;
                    }
                    b';' => break,
                    b',' | b'\\' if depth <= 0 => break,
                    _ => {}
                }
                self.c.at += 1;
            }
            if self.c.peek() == b',' {
                self.c.at += 1;
            }
        }
    }

    /// Perhaps a call of a routine that this file does not have.
    fn call_elsewhere(&mut self, from: usize, word: &[u8], routine: u64) {
        if is_instruction(word) || !begins_statement(self.c.bytes, from) {
            return;
        }
        self.note(|routine| routine.call(word));
        let Self { elsewhere, outside, .. } = self;
        let first = !outside.contains_key(&routine);
        let found = outside.entry(routine).or_insert_with(|| elsewhere.routine(&lower(word))).clone();
        self.names.called(routine, found.as_ref().is_none_or(|f| f.moves));
        match found {
            Some(found) => {
                if found.displaces {
                    let what = format!(
                        "calls '{}', which displaces the motions that follow; they are corrected for where the text has them",
                        String::from_utf8_lossy(word)
                    );
                    self.scan.problem(from, what);
                }
                found.sets.iter().for_each(|name| self.names.set_from(*name, Origin::Computed(from as u32)));
            }
            None if first => self.scan.calls.push(Call { name: lower(word), at: from, is_statement: true }),
            None => {}
        }
    }

    /// What a call gives as this argument.
    fn argument(&mut self, parameter: Parameter) {
        self.c.skip_space();
        let from = self.c.at;
        let at = from as u32;
        if self.c.peek() == b'[' {
            let (first, problems) = (self.scan.spots.len(), self.scan.problems.len());
            self.list(0);
            let own = hashed(&[&b"\0at"[..], &at.to_le_bytes()].concat());
            self.names.define(own, first, self.scan.spots.len());
            let origin = match self.scan.problems.len() > problems || self.scan.spots.len() == first {
                true => Origin::Computed(at),
                false => Origin::Name { name: own, at },
            };
            return self.names.set_from(parameter.scoped, origin);
        }
        let word = self.c.word();
        let origin = self.source(from, word, b";{,\\)").filter(|_| !word.is_empty()).unwrap_or(Origin::Computed(at));
        self.names.set_from(parameter.scoped, origin);
        if let (true, Origin::Name { name, .. }) = (parameter.by_reference, origin) {
            self.names.set_from(name, Origin::Name { name: parameter.scoped, at });
        }
    }
}
