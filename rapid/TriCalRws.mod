MODULE TriCalRws
    !**************************************************************************
    ! TriCalRws: drives the arm for "trical measure" by variables that the
    ! computer sets over Robot Web Services 1.0 (RobotWare 6). No option is
    ! needed. Where Socket Messaging is at hand, TriCal.mod is faster.
    !
    ! Load it into the motion task T_ROB1, set the values under "Settings" for
    ! your cell, then call TriCalRwsLoop from main. See rapid/README.md.
    !
    ! Not tried on a real controller yet: first run it in RobotStudio, then in
    ! manual mode with reduced speed and the device well away from the balls.
    !
    ! The computer writes nReq, as one: a number that was not used before, the
    ! code, seven numbers, and the first number again. The loop does it, writes
    ! nOk (1, or 0 with the reason in sReply) and then the number into nAck.
    ! Each program knows its request by its number. mm and degrees; codes of
    ! TriCal.mod:
    !   02 MoveAbsJ j1..j6    08 speed mm/s deg/s     20 correction dx dy dz
    !   06 tool x y z q1..q4  24 who are you         28 serial number
    !**************************************************************************

    !--------------------------------------------------------------- Settings
    ! Limits of this side, whatever the computer asks for.
    LOCAL CONST num MAX_CORRECTION:=5;     ! mm, each correction
    LOCAL CONST num MAX_SUM:=10;           ! mm, all corrections since a MoveAbsJ
    LOCAL CONST num MAX_TCP_SPEED:=100;    ! mm/s
    LOCAL CONST num MAX_ORI_SPEED:=30;     ! deg/s
    LOCAL CONST num MAX_TURN:=10;          ! deg, each joint by a correction
    LOCAL CONST num MAX_TOOL:=500;         ! mm, TCP from the flange, each axis
    ! deg; here those of the IRB 120-3/0.6. Narrow them to what your cell allows.
    LOCAL CONST num JOINT_LOW{6}:=[-165,-110,-110,-160,-120,-400];
    LOCAL CONST num JOINT_HIGH{6}:=[165,110,70,160,120,400];

    ! The measuring device: TCP (told by the computer), mass in kg, centre of
    ! gravity in mm. Its axes are those of the flange: leave the rotation alone.
    PERS tooldata tTriCal:=[TRUE,[[18,-12,118],[1,0,0,0]],
        [1.7,[5,-4,55],[1,0,0,0],0,0,0]];
    !----------------------------------------------------------------------

    LOCAL CONST num VERSION:=1;

    ! Written by the computer.
    PERS num nReq{10}:=[0,0,0,0,0,0,0,0,0,0];
    ! Written here.
    PERS num nAck:=0;
    PERS num nOk:=1;
    PERS string sReply:="";

    ! The request that is being done.
    LOCAL VAR num nDo{10};
    LOCAL VAR speeddata vMove:=[20,10,200,20];
    LOCAL VAR num nSum:=0;

    ! Waits for a request, does it, and waits for the next.
    PROC TriCalRwsLoop()
        ! A correction is short: the nearest configuration is the right one.
        ConfL\Off;
        ConfJ\Off;
        SingArea\Off;
        ! What was asked before the start is not done.
        nAck:=nReq{1};
        WHILE TRUE DO
            ! The number is the same at both ends once all is written.
            WaitUntil nReq{1}<>nAck AND nReq{10}=nReq{1}\PollRate:=0.05;
            nDo:=nReq;
            IF nDo{1}=nDo{10} THEN
                nOk:=1;
                sReply:="";
                DoRequest;
                nAck:=nDo{1};
            ENDIF
        ENDWHILE
    ENDPROC

    LOCAL PROC DoRequest()
        TEST nDo{2}
        CASE 2:
            MoveJoints;
        CASE 6:
            SetTool;
        CASE 8:
            SetSpeed;
        CASE 20:
            Correct;
        CASE 24:
            sReply:="TriCal "+NumToStr(VERSION,0)+" 6 "+NumToStr(MAX_CORRECTION,3);
        CASE 28:
            sReply:=GetSysInfo(\SerialNo);
        DEFAULT:
            Refuse "unknown code";
        ENDTEST
    ENDPROC

    LOCAL PROC Refuse(string sReason)
        nOk:=0;
        sReply:=sReason;
    ENDPROC

    LOCAL PROC MoveJoints()
        VAR jointtarget jTo;
        ! External axes stay where they are.
        jTo:=CJointT();
        jTo.robax:=[nDo{3},nDo{4},nDo{5},nDo{6},nDo{7},nDo{8}];
        IF NOT WithinLimits(jTo) RETURN;
        nSum:=0;
        MoveAbsJ jTo\NoEOffs,vMove,fine,tTriCal\WObj:=wobj0;
        WaitRob\ZeroSpeed;
    ENDPROC

    ! Displaces the TCP in the axes of the tool, orientation kept.
    LOCAL PROC Correct()
        VAR robtarget pTo;
        VAR jointtarget jTo;
        VAR num nLength;
        nLength:=Sqrt(nDo{3}*nDo{3}+nDo{4}*nDo{4}+nDo{5}*nDo{5});
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
        pTo:=RelTool(CRobT(\Tool:=tTriCal\WObj:=wobj0),nDo{3},nDo{4},nDo{5});
        ! Raises ERR_ROBLIMIT where the arm cannot get there.
        jTo:=CalcJointT(pTo,tTriCal\WObj:=wobj0);
        IF NOT WithinLimits(jTo) RETURN;
        IF NOT TurnsLittle(jTo) RETURN;
        nSum:=nSum+nLength;
        MoveL pTo,vMove,fine,tTriCal\WObj:=wobj0;
        WaitRob\ZeroSpeed;
    ERROR
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
        nNorm:=nDo{6}*nDo{6}+nDo{7}*nDo{7}+nDo{8}*nDo{8}+nDo{9}*nDo{9};
        IF Abs(nNorm-1)>0.001 THEN
            Refuse "no unit quaternion";
            RETURN;
        ENDIF
        ! The speed limit is one of the TCP: a tool that is far out, or not
        ! there, must not make the arm faster than it means.
        FOR i FROM 3 TO 5 DO
            IF Abs(nDo{i})>MAX_TOOL THEN
                Refuse "tool over "+NumToStr(MAX_TOOL,0)+" mm";
                RETURN;
            ENDIF
        ENDFOR
        tTriCal.tframe.trans:=[nDo{3},nDo{4},nDo{5}];
        tTriCal.tframe.rot:=NOrient([nDo{6},nDo{7},nDo{8},nDo{9}]);
    ENDPROC

    ! A wish for more than the limit gets the limit.
    LOCAL PROC SetSpeed()
        IF nDo{3}<=0 OR nDo{4}<=0 THEN
            Refuse "two positive numbers expected";
            RETURN;
        ENDIF
        vMove.v_tcp:=nDo{3};
        IF vMove.v_tcp>MAX_TCP_SPEED vMove.v_tcp:=MAX_TCP_SPEED;
        vMove.v_ori:=nDo{4};
        IF vMove.v_ori>MAX_ORI_SPEED vMove.v_ori:=MAX_ORI_SPEED;
    ENDPROC
ENDMODULE
