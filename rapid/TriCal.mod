MODULE TriCal
    !**************************************************************************
    ! TriCal: drives the arm for "trical measure", by commands over a TCP socket.
    !
    ! Needs RobotWare 5 or 6 with option 616-1 PC Interface (or 672-1 Socket
    ! Messaging). Load it into the motion task, set the values under "Settings"
    ! for your cell, then call TriCalServer from main, or set the program pointer
    ! to it. See rapid/README.md.
    !
    ! Not tried on a real controller yet: first run it in RobotStudio, then in
    ! manual mode with reduced speed and the device well away from the balls.
    !
    ! Request "<code> <p1> <p2> ... #", reply "<code> <ok> <data>#"; ok is 1, or 0
    ! with the reason as data. mm and degrees. Framing and the codes below 20 are
    ! those of open_abb.
    !   00 ping                      09 zone (only fine = 1)    22 joint samples
    !   02 MoveAbsJ j1..j6           20 correction dx dy dz        every p1 ms, 0 = off
    !   03 pose x y z q1..q4         21 clock, s                23 temperature
    !   04 joints j1..j6             24 who are you             99 close
    !   06 tool x y z q1..q4         30 (sent only) joint sample: s j1..j6
    !   08 speed mm/s deg/s          25, 26 (while the arm moves) stop, alive?
    !   27 SECRET, the first message of each client        28 serial number
    ! A client that sends anything else is disconnected.
    ! A RAPID string holds 80 characters: longer replies are sent in pieces.
    !**************************************************************************

    !--------------------------------------------------------------- Settings
    ! Address of the controller's own port (service port: 192.168.125.1).
    LOCAL CONST string ADDRESS:="192.168.125.1";
    LOCAL CONST num PORT:=5000;

    ! Who may command. SECRET: 8 to 40 letters and digits, the same as secret=
    ! in the computer's URL; "none" for no secret. CLIENT: the address of the
    ! computer, for instance "192.168.125.20"; "any" for whoever is connected.
    ! The server does not start before both are set.
    LOCAL CONST string SECRET:="";
    LOCAL CONST string CLIENT:="";

    ! Limits of this side, whatever the computer asks for.
    LOCAL CONST num MAX_CORRECTION:=5;     ! mm, each correction
    LOCAL CONST num MAX_SUM:=10;           ! mm, all corrections since a MoveAbsJ
    LOCAL CONST num MAX_TCP_SPEED:=100;    ! mm/s
    LOCAL CONST num MAX_ORI_SPEED:=30;     ! deg/s
    LOCAL CONST num MAX_TURN:=10;          ! deg, each joint by a correction
    LOCAL CONST num MAX_TOOL:=500;         ! mm, TCP from the flange, each axis
    ! While the arm moves, a client that is not heard for so long is gone, and
    ! the arm stops.
    LOCAL CONST num WATCHDOG:=5;           ! s
    ! deg; here those of the IRB 120-3/0.6. Narrow them to what your cell allows.
    LOCAL CONST num JOINT_LOW{6}:=[-165,-110,-110,-160,-120,-400];
    LOCAL CONST num JOINT_HIGH{6}:=[165,110,70,160,120,400];

    ! The measuring device: TCP (told by the computer), mass in kg, centre of
    ! gravity in mm. Its axes are those of the flange: leave the rotation alone.
    PERS tooldata tTriCal:=[TRUE,[[18,-12,118],[1,0,0,0]],
        [1.7,[5,-4,55],[1,0,0,0],0,0,0]];
    !----------------------------------------------------------------------

    LOCAL CONST num VERSION:=1;

    LOCAL VAR socketdev skServer;
    LOCAL VAR socketdev skClient;
    LOCAL VAR bool bConnected:=FALSE;
    LOCAL VAR bool bKnown:=FALSE;
    LOCAL VAR string sBuffer:="";
    LOCAL VAR num nCode:=0;
    LOCAL VAR num nCount:=0;
    LOCAL VAR num nPar{7};
    LOCAL VAR speeddata vMove:=[20,10,200,20];
    LOCAL VAR num nSum:=0;
    LOCAL VAR clock ckTime;
    LOCAL VAR intnum iWatch;
    LOCAL VAR num nSampleTime:=0;
    LOCAL VAR clock ckHeard;
    LOCAL VAR bool bStop:=FALSE;
    LOCAL VAR errnum ERR_TRICAL:=-1;

    ! Waits for a client, does what it asks, and waits for the next.
    PROC TriCalServer()
        IF CLIENT="" OR (StrLen(SECRET)<8 AND SECRET<>"none") THEN
            TPWrite "TriCal: set SECRET and CLIENT in its module";
            EXIT;
        ENDIF
        ClkReset ckTime;
        ClkStart ckTime;
        BookErrNo ERR_TRICAL;
        ! A correction is short: the nearest configuration is the right one.
        ConfL\Off;
        ConfJ\Off;
        SingArea\Off;
        WHILE TRUE DO
            WaitForClient;
            WHILE bConnected DO
                IF ReceiveMessage() DoMessage;
            ENDWHILE
        ENDWHILE
    ENDPROC

    LOCAL PROC WaitForClient()
        VAR string sClient;
        SocketClose skClient;
        SocketClose skServer;
        SocketCreate skServer;
        SocketBind skServer,ADDRESS,PORT;
        SocketListen skServer;
        TPWrite "TriCal: waiting for a client";
        SocketAccept skServer,skClient\ClientAddress:=sClient\Time:=WAIT_MAX;
        IF CLIENT<>"any" AND sClient<>CLIENT THEN
            TPWrite "TriCal: turned away "+sClient;
            RETURN;
        ENDIF
        TPWrite "TriCal: connected to "+sClient;
        sBuffer:="";
        nSampleTime:=0;
        nSum:=0;
        bKnown:=(SECRET="none");
        bConnected:=TRUE;
    ERROR
        IF ERRNO=ERR_SOCK_TIMEOUT THEN
            ResetRetryCount;
            RETRY;
        ENDIF
        ! The server loop tries again: there is nobody to tell.
        WaitTime 1;
        RETURN;
    ENDPROC

    ! Takes the next message; FALSE if the client is gone or sends nonsense.
    LOCAL FUNC bool ReceiveMessage()
        VAR string sPart;
        VAR num nEnd;
        VAR string sMessage;
        VAR num nWait:=WAIT_MAX;
        ! Who does not say the secret soon is not waited for.
        IF NOT bKnown nWait:=10;
        nEnd:=StrMatch(sBuffer,1,"#");
        WHILE nEnd>StrLen(sBuffer) DO
            SocketReceive skClient\Str:=sPart\Time:=nWait;
            IF StrLen(sBuffer)+StrLen(sPart)>80 THEN
                ! No request is that long: it is another language, and may have
                ! a command in what follows.
                bConnected:=FALSE;
                RETURN FALSE;
            ENDIF
            sBuffer:=sBuffer+sPart;
            nEnd:=StrMatch(sBuffer,1,"#");
        ENDWHILE
        IF nEnd>1 sMessage:=StrPart(sBuffer,1,nEnd-1);
        IF nEnd<StrLen(sBuffer) THEN
            sBuffer:=StrPart(sBuffer,nEnd+1,StrLen(sBuffer)-nEnd);
        ELSE
            sBuffer:="";
        ENDIF
        IF NOT bKnown OR StrMatch(sMessage,1,"27 ")=1 THEN
            Login sMessage;
            RETURN FALSE;
        ENDIF
        IF NOT Parse(sMessage) THEN
            TPWrite "TriCal: not a client of TriCal, disconnected";
            bConnected:=FALSE;
            RETURN FALSE;
        ENDIF
        RETURN TRUE;
    ERROR
        IF ERRNO=ERR_SOCK_TIMEOUT AND bKnown THEN
            ResetRetryCount;
            RETRY;
        ENDIF
        TPWrite "TriCal: the client is gone";
        bConnected:=FALSE;
        RETURN FALSE;
    ENDFUNC

    ! The first message has to be the secret, as a whole; nothing in another
    ! one is done.
    LOCAL PROC Login(string sMessage)
        nCode:=27;
        IF SECRET<>"none" AND sMessage="27 "+SECRET+" " THEN
            bKnown:=TRUE;
            Reply "";
            RETURN;
        ENDIF
        TPWrite "TriCal: wrong secret, disconnected";
        ! Slow for who guesses.
        WaitTime 1;
        IF SECRET="none" THEN
            Refuse "no secret is set here";
        ELSEIF StrMatch(sMessage,1,"27 ")=1 THEN
            Refuse "wrong secret";
        ELSE
            Refuse "secret expected";
        ENDIF
        bConnected:=FALSE;
    ENDPROC

    ! Splits a message into its code and up to seven numbers.
    LOCAL FUNC bool Parse(string sMessage)
        VAR num nFrom:=1;
        VAR num nTo;
        VAR num nValue;
        nCode:=-1;
        nCount:=0;
        WHILE nFrom<=StrLen(sMessage) DO
            nTo:=StrMatch(sMessage,nFrom," ");
            IF nTo>nFrom THEN
                IF NOT StrToVal(StrPart(sMessage,nFrom,nTo-nFrom),nValue) THEN
                    nCode:=0;
                    RETURN FALSE;
                ENDIF
                IF nCode<0 THEN
                    nCode:=nValue;
                ELSE
                    IF nCount>=7 RETURN FALSE;
                    nCount:=nCount+1;
                    nPar{nCount}:=nValue;
                ENDIF
            ENDIF
            nFrom:=nTo+1;
        ENDWHILE
        IF nCode<0 THEN
            nCode:=0;
            RETURN FALSE;
        ENDIF
        RETURN TRUE;
    ENDFUNC

    LOCAL PROC DoMessage()
        VAR string sData:="";
        VAR jointtarget jNow;
        TEST nCode
        CASE 0:
            Reply "";
        CASE 2:
            MoveJoints;
        CASE 3:
            SendPose;
        CASE 4:
            ! Read before the arm has settled, joints are off in the sense of
            ! motion; every motion here ends with WaitRob already.
            WaitRob\ZeroSpeed;
            jNow:=CJointT();
            sData:=JointsText(jNow);
            Reply sData;
        CASE 6:
            SetTool;
        CASE 8:
            SetSpeed;
        CASE 9:
            IF nCount=1 AND nPar{1}=1 THEN
                Reply "";
            ELSE
                Refuse "only fine (1)";
            ENDIF
        CASE 20:
            Correct;
        CASE 21:
            Reply NumToStr(ClkRead(ckTime),3);
        CASE 22:
            ! ITimer takes no less than 0.1 s.
            IF nCount<>1 OR nPar{1}<0 THEN
                Refuse "wrong parameters";
            ELSEIF nPar{1}=0 THEN
                nSampleTime:=0;
                Reply "";
            ELSE
                nSampleTime:=nPar{1}/1000;
                IF nSampleTime<0.1 nSampleTime:=0.1;
                Reply "";
            ENDIF
        CASE 23:
            ! With a sensor on an analog input: Reply NumToStr(aiTemp,2);
            Reply "";
        CASE 24:
            sData:="TriCal "+NumToStr(VERSION,0)+" 6 ";
            Reply sData+NumToStr(MAX_CORRECTION,3);
        CASE 25,26:
            ! Nothing moves any more.
            Reply "";
        CASE 28:
            Reply GetSysInfo(\SerialNo);
        CASE 99:
            Reply "";
            bConnected:=FALSE;
        DEFAULT:
            Refuse "unknown code";
        ENDTEST
    ENDPROC

    LOCAL PROC MoveJoints()
        VAR jointtarget jTo;
        IF nCount<>6 THEN
            Refuse "six joints expected";
            RETURN;
        ENDIF
        ! External axes stay where they are.
        jTo:=CJointT();
        jTo.robax:=[nPar{1},nPar{2},nPar{3},nPar{4},nPar{5},nPar{6}];
        IF NOT WithinLimits(jTo) RETURN;
        nSum:=0;
        StartWatch;
        MoveAbsJ jTo\NoEOffs,vMove,fine,tTriCal\WObj:=wobj0;
        WaitRob\ZeroSpeed;
        StopWatch;
        Reply "";
    ERROR
        IF ERRNO=ERR_TRICAL THEN
            Stopped;
            RETURN;
        ENDIF
    ENDPROC

    ! Displaces the TCP in the axes of the tool, orientation kept.
    LOCAL PROC Correct()
        VAR robtarget pTo;
        VAR jointtarget jTo;
        VAR num nLength;
        IF nCount<>3 THEN
            Refuse "dx dy dz expected";
            RETURN;
        ENDIF
        nLength:=Sqrt(nPar{1}*nPar{1}+nPar{2}*nPar{2}+nPar{3}*nPar{3});
        IF nLength>MAX_CORRECTION THEN
            Refuse "correction "+NumToStr(nLength,3)+" mm is over the limit of "
                +NumToStr(MAX_CORRECTION,3)+" mm";
            RETURN;
        ENDIF
        IF nSum+nLength>MAX_SUM THEN
            Refuse "corrections since the last MoveAbsJ are over "
                +NumToStr(MAX_SUM,3)+" mm";
            RETURN;
        ENDIF
        WaitRob\ZeroSpeed;
        pTo:=RelTool(CRobT(\Tool:=tTriCal\WObj:=wobj0),nPar{1},nPar{2},nPar{3});
        ! Raises ERR_ROBLIMIT where the arm cannot get there.
        jTo:=CalcJointT(pTo,tTriCal\WObj:=wobj0);
        IF NOT WithinLimits(jTo) RETURN;
        IF NOT TurnsLittle(jTo) RETURN;
        nSum:=nSum+nLength;
        StartWatch;
        MoveL pTo,vMove,fine,tTriCal\WObj:=wobj0;
        WaitRob\ZeroSpeed;
        StopWatch;
        Reply "";
    ERROR
        IF ERRNO=ERR_TRICAL THEN
            Stopped;
            RETURN;
        ENDIF
        IF ERRNO=ERR_ROBLIMIT THEN
            Refuse "position cannot be reached";
            RETURN;
        ENDIF
    ENDPROC

    LOCAL FUNC bool WithinLimits(jointtarget jTo)
        VAR num nJoint{6};
        nJoint{1}:=jTo.robax.rax_1;
        nJoint{2}:=jTo.robax.rax_2;
        nJoint{3}:=jTo.robax.rax_3;
        nJoint{4}:=jTo.robax.rax_4;
        nJoint{5}:=jTo.robax.rax_5;
        nJoint{6}:=jTo.robax.rax_6;
        FOR i FROM 1 TO 6 DO
            IF nJoint{i}<JOINT_LOW{i} OR nJoint{i}>JOINT_HIGH{i} THEN
                Refuse "joint "+NumToStr(i,0)+" out of limits at "
                    +NumToStr(nJoint{i},3)+" deg";
                RETURN FALSE;
            ENDIF
        ENDFOR
        RETURN TRUE;
    ENDFUNC

    ! Near a singular pose a short correction would turn a joint far.
    LOCAL FUNC bool TurnsLittle(jointtarget jTo)
        VAR jointtarget jNow;
        VAR num nTurn{6};
        jNow:=CJointT();
        nTurn{1}:=Abs(jTo.robax.rax_1-jNow.robax.rax_1);
        nTurn{2}:=Abs(jTo.robax.rax_2-jNow.robax.rax_2);
        nTurn{3}:=Abs(jTo.robax.rax_3-jNow.robax.rax_3);
        nTurn{4}:=Abs(jTo.robax.rax_4-jNow.robax.rax_4);
        nTurn{5}:=Abs(jTo.robax.rax_5-jNow.robax.rax_5);
        nTurn{6}:=Abs(jTo.robax.rax_6-jNow.robax.rax_6);
        FOR i FROM 1 TO 6 DO
            IF nTurn{i}>MAX_TURN THEN
                Refuse "joint "+NumToStr(i,0)+" would turn by "
                    +NumToStr(nTurn{i},3)+" deg by a correction";
                RETURN FALSE;
            ENDIF
        ENDFOR
        RETURN TRUE;
    ENDFUNC

    LOCAL PROC SetTool()
        VAR num nNorm;
        IF nCount<>7 THEN
            Refuse "x y z q1 q2 q3 q4 expected";
            RETURN;
        ENDIF
        nNorm:=nPar{4}*nPar{4}+nPar{5}*nPar{5}+nPar{6}*nPar{6}+nPar{7}*nPar{7};
        IF Abs(nNorm-1)>0.001 THEN
            Refuse "no unit quaternion";
            RETURN;
        ENDIF
        ! The speed limit is one of the TCP: a tool that is far out, or not
        ! there, must not make the arm faster than it means.
        FOR i FROM 1 TO 3 DO
            IF Abs(nPar{i})>MAX_TOOL THEN
                Refuse "tool over "+NumToStr(MAX_TOOL,0)+" mm";
                RETURN;
            ENDIF
        ENDFOR
        tTriCal.tframe.trans:=[nPar{1},nPar{2},nPar{3}];
        tTriCal.tframe.rot:=NOrient([nPar{4},nPar{5},nPar{6},nPar{7}]);
        Reply "";
    ENDPROC

    ! A wish for more than the limit gets the limit.
    LOCAL PROC SetSpeed()
        IF nCount<>2 OR nPar{1}<=0 OR nPar{2}<=0 THEN
            Refuse "two positive numbers expected";
            RETURN;
        ENDIF
        vMove.v_tcp:=nPar{1};
        IF vMove.v_tcp>MAX_TCP_SPEED vMove.v_tcp:=MAX_TCP_SPEED;
        vMove.v_ori:=nPar{2};
        IF vMove.v_ori>MAX_ORI_SPEED vMove.v_ori:=MAX_ORI_SPEED;
        Reply "";
    ENDPROC

    LOCAL PROC SendPose()
        VAR robtarget pNow;
        WaitRob\ZeroSpeed;
        pNow:=CRobT(\Tool:=tTriCal\WObj:=wobj0);
        SendText "03 1 "+NumToStr(pNow.trans.x,4)+" "+NumToStr(pNow.trans.y,4)
            +" "+NumToStr(pNow.trans.z,4)+" ";
        SendText NumToStr(pNow.rot.q1,7)+" "+NumToStr(pNow.rot.q2,7)
            +" "+NumToStr(pNow.rot.q3,7)+" "+NumToStr(pNow.rot.q4,7)+"#";
    ENDPROC

    ! Six joints with five decimals: at most 65 characters.
    LOCAL FUNC string JointsText(jointtarget jNow)
        VAR string sText;
        sText:=NumToStr(jNow.robax.rax_1,5)+" "+NumToStr(jNow.robax.rax_2,5);
        sText:=sText+" "+NumToStr(jNow.robax.rax_3,5);
        sText:=sText+" "+NumToStr(jNow.robax.rax_4,5);
        sText:=sText+" "+NumToStr(jNow.robax.rax_5,5);
        RETURN sText+" "+NumToStr(jNow.robax.rax_6,5);
    ENDFUNC

    !------------------------------------------------------ while the arm moves
    ! Ten times a second: is the client there, does it want a stop; samples.
    ! Whether a trap may receive and send while a motion waits, and whether its
    ! RAISE reaches the routine that moves, is settled on hardware only.
    LOCAL PROC StartWatch()
        VAR num nEvery:=0.1;
        IF nSampleTime>nEvery nEvery:=nSampleTime;
        IF nEvery>1 nEvery:=1;
        bStop:=FALSE;
        ClkStop ckHeard;
        ClkReset ckHeard;
        ClkStart ckHeard;
        IDelete iWatch;
        CONNECT iWatch WITH trWatch;
        ITimer nEvery,iWatch;
    ENDPROC

    ! Ends the samples before the reply: the two never mix.
    LOCAL PROC StopWatch()
        IDelete iWatch;
    ENDPROC

    ! What the client says meanwhile.
    LOCAL PROC HearClient()
        VAR string sPart;
        VAR num nEnd;
        IF SocketPeek(skClient)=0 RETURN;
        SocketReceive skClient\Str:=sPart\Time:=0.1;
        ClkReset ckHeard;
        ClkStart ckHeard;
        IF StrLen(sBuffer)+StrLen(sPart)>80 THEN
            bStop:=TRUE;
            RETURN;
        ENDIF
        sBuffer:=sBuffer+sPart;
        nEnd:=StrMatch(sBuffer,1,"#");
        WHILE nEnd<=StrLen(sBuffer) DO
            IF StrMatch(sBuffer,1,"25")=1 THEN
                bStop:=TRUE;
            ELSEIF StrMatch(sBuffer,1,"26")=1 THEN
                SendText "26 1 #";
            ELSE
                ! Its turn comes when the arm stands.
                RETURN;
            ENDIF
            IF nEnd<StrLen(sBuffer) THEN
                sBuffer:=StrPart(sBuffer,nEnd+1,StrLen(sBuffer)-nEnd);
            ELSE
                sBuffer:="";
            ENDIF
            nEnd:=StrMatch(sBuffer,1,"#");
        ENDWHILE
    ERROR
        ! The client is gone.
        bStop:=TRUE;
        RETURN;
    ENDPROC

    LOCAL TRAP trWatch
        VAR jointtarget jNow;
        HearClient;
        IF bStop OR ClkRead(ckHeard)>WATCHDOG THEN
            IDelete iWatch;
            StopMove\Quick;
            ClearPath;
            StartMove;
            RAISE ERR_TRICAL;
        ENDIF
        IF nSampleTime<=0 RETURN;
        jNow:=CJointT();
        SocketSend skClient\Str:="30 1 "+NumToStr(ClkRead(ckTime),3)+" ";
        SocketSend skClient\Str:=JointsText(jNow)+"#";
    ERROR
        IF ERRNO=ERR_TRICAL RAISE;
        ! The motion goes on; the client is missed by the watch.
        RETURN;
    ENDTRAP

    ! The motion was stopped, and its path is gone.
    LOCAL PROC Stopped()
        StopWatch;
        WaitRob\ZeroSpeed;
        Refuse "stopped";
        IF bStop SendText "25 1 #";
        bStop:=FALSE;
    ENDPROC

    !---------------------------------------------------------------- replies
    LOCAL PROC Reply(string sData)
        SendText CodeText()+" 1 "+sData+"#";
    ENDPROC

    LOCAL PROC Refuse(string sReason)
        SendText CodeText()+" 0 "+sReason+"#";
    ENDPROC

    LOCAL FUNC string CodeText()
        IF nCode<10 RETURN "0"+NumToStr(nCode,0);
        RETURN NumToStr(nCode,0);
    ENDFUNC

    LOCAL PROC SendText(string sText)
        SocketSend skClient\Str:=sText;
    ERROR
        TPWrite "TriCal: the client is gone";
        bConnected:=FALSE;
        RETURN;
    ENDPROC
ENDMODULE
