//! Small programs after the shapes that are found in the field, one construction each: which lines are rewritten, and which
//! are listed and why.
//!
//! `@k` stands for the coordinates of a pose that the arm reaches, as the dialect writes them; `@Xk`, `@Yk`, `@Zk` for one, `@Rk`
//! for its orientation.

use trical_model::Model;
use trical_model::pose::{angles_zyx, rotation_vector};
use trical_program::{Dialect, Frames, Options, compensate};

use crate::fixtures::{IRB, KR6, LR, UR5E, device, flange, joints, mm, nominal, pose, quadrant, quaternion, real};

struct Case {
    name: &'static str,
    text: &'static str,
    /// Lines of targets that are rewritten.
    rewritten: &'static [usize],
    /// Lines that are listed, with words of the reason.
    listed: &'static [(usize, &'static str)],
}

const fn case(
    name: &'static str,
    text: &'static str,
    rewritten: &'static [usize],
    listed: &'static [(usize, &'static str)],
) -> Case {
    Case { name, text, rewritten, listed }
}

const RAPID: &[Case] = &[
    case(
        "constants",
        "CONST num h:=20;\nCONST robtarget p:=[[@X0+h-20,(@Y0),@Z0*1],[@R0],@C0,[9E9,9E9,9E9,9E9,9E9,9E9]];\nMoveL p,v100,fine,tool0;\n",
        &[2],
        &[],
    ),
    case(
        "a constant of an expression",
        "CONST num a:=10;\nLOCAL CONST num b:=2*a;\nMoveL [[@X0+b-20,@Y0,@Z0],[@R0],@C0,[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;\n",
        &[3],
        &[],
    ),
    case(
        "a variable",
        "VAR num h:=20;\nPERS robtarget p:=[[400,100,h],[@R0],@C0,[9E9,9E9,9E9,9E9,9E9,9E9]];\nCONST robtarget q:=@0;\nMoveL p,v1,fine,tool0;\nMoveL q,v1,fine,tool0;\n",
        &[3],
        &[(2, "'h'")],
    ),
    case(
        "a function in a target",
        "MoveL [[400,100,Round(h,2)],[@R0],@C0,[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;\nMoveL @0,v1,fine,tool0;\n",
        &[2],
        &[(1, "Round")],
    ),
    case(
        "of another module",
        "CONST robtarget q:=@0;\nPROC main()\nMoveJ pHome,v1,fine,tool0;\nMoveL q,v1,fine,tool0;\nMoveAbsJ jHome\\NoEOffs,v1,fine,tool0;\nENDPROC\n",
        &[1],
        &[(3, "'pHome'"), (5, "'jHome'")],
    ),
    case(
        "what a function returns",
        "MoveL CalcPos(3),v1,fine,tool0;\nMoveL @0,v1,fine,tool0;\n",
        &[2],
        &[(1, "calculates")],
    ),
    case(
        "set from a function",
        "VAR robtarget p;\nCONST robtarget q:=@0;\np:=CalcPos(q);\nMoveL p,v1,fine,tool0;\n",
        &[2],
        &[(3, "calculated")],
    ),
    case(
        "a circle with a signal",
        "CONST robtarget p:=@0;\nCONST robtarget q:=@1;\nMoveL p,v1,fine,tool0;\nMoveCDO p,q,v1,z10,tool0,doIt,1;\nMoveCSync p,q,v1,z10,tool0,\"Beep\";\n",
        &[1, 2],
        &[],
    ),
    case(
        "shifted",
        "CONST robtarget q:=@0;\nMoveL Offs(q,0,0,50),v1,fine,tool0;\nMoveL RelTool(q,0,0,-50\\Rz:=5),v1,fine,tool0;\nMoveL q,v1,fine,tool0;\n",
        &[1],
        &[],
    ),
    case(
        "shifted by a constant",
        "CONST num h:=50;\nCONST robtarget q:=@0;\nMoveL Offs(q,0,0,h),v1,fine,tool0;\n",
        &[2],
        &[],
    ),
    case(
        "chains of Offs",
        "CONST robtarget q:=@0;\nMoveL Offs(Offs(q,0,0,50),10,0,0),v1,fine,tool0;\nMoveL RelTool(Offs(q,0,0,5),0,0,-5),v1,fine,tool0;\nMoveL Offs(Offs(pOther,0,0,50),10,0,0),v1,fine,tool0;\n",
        &[1],
        &[(4, "'pOther'")],
    ),
    case(
        "a copy of what is shifted",
        "VAR robtarget above;\nCONST robtarget q:=@0;\nabove:=Offs(q,0,0,h);\nMoveL above,v1,fine,tool0;\n",
        &[2],
        &[],
    ),
    case(
        "where the arm is",
        "VAR robtarget here;\nhere:=CRobT(\\Tool:=tool0);\nMoveL Offs(here,0,0,50),v1,fine,tool0;\nMoveL Offs(CRobT(),0,0,50),v1,fine,tool0;\nMoveL @0,v1,fine,tool0;\n",
        &[5],
        &[],
    ),
    case(
        "a coordinate that is set",
        "PERS robtarget p:=@0;\nPROC main()\np.trans.z:=reg1;\nMoveL p,v1,fine,tool0;\nENDPROC\n",
        &[1],
        &[(3, "calculated")],
    ),
    case(
        "a coordinate that is shifted",
        "PERS robtarget p:=@0;\np.trans.z:=p.trans.z+50;\nMoveL p,v1,fine,tool0;\n",
        &[1],
        &[],
    ),
    case(
        "put together",
        "CONST robtarget q:=@0;\nVAR robtarget p;\np:=[[x,y,z],q.rot,q.robconf,q.extax];\nMoveL q,v1,fine,tool0;\nMoveL p,v1,fine,tool0;\n",
        &[1],
        &[(3, "calculated")],
    ),
    case(
        "an array by index",
        "CONST robtarget p{2}:=[@0,\n@1];\nFOR i FROM 1 TO 2 DO\nMoveL p{i},v1,fine,tool0;\nENDFOR\nMoveL other{i},v1,fine,tool0;\n",
        &[1, 2],
        &[(6, "'other'")],
    ),
    case("a circle", "MoveC @0,pEnd,v1,fine,tool0;\n", &[1], &[(1, "'pEnd'")]),
    case(
        "a search",
        "VAR robtarget found;\nSearchL\\Stop,di1,found,@0,v10,tool0;\nSearchL di1,found,pEnd,v10,tool0;\n",
        &[2],
        &[(3, "'pEnd'")],
    ),
    case(
        "triggers and routines of the user",
        "TriggIO gun,5\\DOp:=do1,1;\nTriggL @0,v1,gun,fine,tool0;\nMoveToPallet nPart,v1;\nDispenseOn 3;\n",
        &[2],
        &[],
    ),
    case(
        "a module with the beginning of a motion for a name",
        "MODULE SearchPart\nPERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nMoveL @0,v1,fine,t;\nENDMODULE\n",
        &[3],
        &[],
    ),
    case(
        "signals and routines behind the tool",
        "CONST robtarget q:=@0;\nMoveL q,v1,fine,tool0;\nMoveLDO q,v1,fine,tool0,do1,1;\nMoveJSync q,v1,fine,tool0,\"Blow\";\n",
        &[1],
        &[],
    ),
    case(
        "displacement",
        "CONST robtarget q:=@0;\nPDispSet shift;\nMoveL q,v1,fine,tool0;\nPDispOff;\n",
        &[1],
        &[(2, "displaces")],
    ),
    case(
        "an external axis",
        "CONST robtarget p:=[[@X0,@Y0,@Z0],[@R0],@C0,[1200,9E9,9E9,9E9,9E9,9E9]];\nCONST robtarget q:=[[@X0,@Y0,@Z0],[@R0],@C0,[0,9E9,9E+09,9E9,9E9,9E9]];\nMoveL p,v1,fine,tool0;\nMoveL q,v1,fine,tool0;\n",
        &[2],
        &[(1, "external axis")],
    ),
    case(
        "joints beside an external axis",
        "CONST jointtarget j:=[[10,20,10,5,60,-7],[500,9E9,9E9,9E9,9E9,9E9]];\nCONST jointtarget k:=[[10,20,10,5,60,-7],[9E9,9E9,9E9,9E9,9E9,9E9]];\nMoveAbsJ j,v1,fine,tool0;\nMoveAbsJ k,v1,fine,tool0;\n",
        &[2],
        &[(1, "external axis")],
    ),
    case(
        "MoveExtJ is no motion of the arm",
        "CONST jointtarget track:=[[0,0,0,0,0,0],[1200,9E9,9E9,9E9,9E9,9E9]];\nMoveExtJ track,v1,fine;\nMoveL @0,v1,fine,tool0;\nMoveExtJ [[0,0,0,0,0,0],[10,0,0,0,0,0]],v1,fine;\n",
        &[3],
        &[],
    ),
    case(
        "home at a singularity",
        "CONST jointtarget jHome:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nMoveAbsJ jHome,v1,fine,tool0;\nMoveL @0,v1,fine,tool0;\n",
        &[3],
        &[(1, "singularity")],
    ),
    case(
        "elements of an array that are set",
        "CONST robtarget q:=@0;\nPERS robtarget a{2}:=[@1,@2];\nVAR robtarget b{2};\na{i}.trans.z:=reg1;\nb{i,j} := Offs(q,50*i,0,0);\nMoveL a{i},v1,fine,tool0;\nMoveL b{i,j},v1,fine,tool0;\nPERS robtarget c{2}:=[@3,@3];\nc{2}:=Measured(2);\nMoveL c{1},v1,fine,tool0;\n",
        &[1, 2, 2, 8, 8],
        &[(4, "calculated"), (9, "calculated")],
    ),
    case(
        "a target in a list of records",
        "PERS targetdata w{2}:=[[@0,5],[@1,6]];\nArcL w{i}.position,v1,seam1,weld1,fine,tool0;\nw{n}.position:=pNew;\n",
        &[1, 1],
        &[(3, "calculated")],
    ),
    case(
        "a target that is set from elsewhere",
        "PERS robtarget p:=@0;\nPERS robtarget q:=@1;\np:=pOther;\nq:=p;\nMoveL q,v1,fine,tool0;\nVAR robtarget r:=pOther;\nMoveL r,v1,fine,tool0;\n",
        &[1, 2],
        &[(3, "set here"), (7, "'r'")],
    ),
    case(
        "routines that get targets",
        "CONST robtarget p:=@0;\nCONST robtarget q:=@1;\nPROC main()\nPick q,5;\nPick(Offs(q,0,0,h)),5;\nIF b Pick @2,5;\nVia 3\\over:=p;\nPick pOther,5;\nENDPROC\nPROC Pick(robtarget p,num n)\nMoveL p,v1,fine,tool0;\nENDPROC\nPROC Via(num n\\robtarget over|switch off)\nMoveL Offs(over,0,0,5),v1,fine,tool0;\nENDPROC\nPROC Unused(robtarget p)\nMoveL p,v1,fine,tool0;\nENDPROC\n",
        &[1, 2, 6],
        &[(11, "'p'"), (17, "'p'")],
    ),
    case(
        "a routine that changes what it gets",
        "PERS robtarget p:=@0;\nPERS robtarget q:=@1;\nPROC main()\nLift grid,p;\nKeep q;\nMoveL p,v1,fine,tool0;\nMoveL q,v1,fine,tool0;\nENDPROC\nPROC Lift(robtarget all{*,*},INOUT robtarget x)\nx.trans.z:=reg1;\nENDPROC\nPROC Keep(robtarget x)\nx.trans.z:=reg1;\nENDPROC\n",
        &[1, 2],
        &[(10, "calculated")],
    ),
    case(
        "guided by another computer",
        "MoveL @0,v1,fine,tool0;\nEGMActPose id1\\WObj:=wobj0,frame1,EGM_FRAME_BASE,frame2,EGM_FRAME_BASE;\nEGMRunPose id1,EGM_STOP_HOLD\\x\\y\\z;\nCorrCon id2;\nMoveL @1,v1,fine,tool0\\Corr;\n",
        &[1, 5],
        &[(3, "EGM"), (4, "sensor")],
    ),
    case(
        "a tool and a work object that are copied",
        "PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPERS wobjdata w:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nt:=tOther;\nw:=wOther;\nMoveL @0,v1,fine,t\\WObj:=w;\nMoveL @1,v1,fine,t\\WObj:=w;\n",
        &[5, 6],
        &[(3, "tool 't'"), (4, "work object 'w'")],
    ),
    case(
        "copies in a circle",
        "VAR robtarget p;\nVAR robtarget q;\np:=q;\nq:=Offs(p,0,0,5);\nMoveL p,v1,fine,tool0;\nMoveL @0,v1,fine,tool0;\n",
        &[6],
        &[(5, "'p'")],
    ),
    case(
        "copies by several ways",
        "CONST robtarget s:=@0;\nVAR robtarget p;\nq:=s;\nr:=q;\nr:=s;\nr:=Offs(p,0,0,5);\np:=q;\np:=r;\nMoveL p,v1,fine,tool0;\n",
        &[1],
        &[],
    ),
    case(
        "a variable with the name of a constant",
        "PROC a()\nCONST num h:=10;\nMoveL [[@X0+h-10,@Y0,@Z0],[@R0],@C0,[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;\nENDPROC\nPROC b(num h)\nMoveL [[@X0+h,@Y0,@Z0],[@R0],@C0,[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tool0;\nENDPROC\n",
        &[3],
        &[(6, "+h'")],
    ),
    case(
        "offsets of external axes",
        "EOffsSet [100,0,0,0,0,0];\nMoveL @0,v1,fine,tool0;\nEOffsOff;\n",
        &[2],
        &[(1, "external axes")],
    ),
    case(
        "a work object that is changed",
        "PERS wobjdata w:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nw.oframe.trans.x:=camera;\nMoveL @0,v1,fine,tool0\\WObj:=w;\n",
        &[3],
        &[(2, "work object 'w'")],
    ),
    case(
        "a work object that is shifted against itself",
        "PERS wobjdata w:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nw.oframe.trans.x:=w.oframe.trans.x+5;\nMoveL @0,v1,fine,tool0\\WObj:=w;\n",
        &[3],
        &[(2, "work object 'w'")],
    ),
    case(
        "a tool that a function returns, or of a list",
        "MoveL @0,v1,fine,Held(2);\nMoveL @1,v1,fine,tools{2};\nMoveL @2,v1,zones{1},tool0;\n",
        &[3],
        &[(1, "'held'"), (2, "'tools'")],
    ),
];

const KRL: &[Case] = &[
    case(
        "inline forms of splines",
        "DECL E6POS XP1={@0,S 2,T @T0}\nDECL FDAT FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \"}\nDECL E6POS XP2={@1,S 2,T @T1}\nDECL FDAT FP2={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE}\nDECL E6POS XP3={@2,S 2,T @T2}\nDECL FDAT FP3={TOOL_NO 1,BASE_NO 0,IPO_FRAME #TCP}\nTOOL_DATA[1]={X 18,Y -12,Z 118,A 0,B 0,C 0}\nSPTP XP1 WITH $VEL_AXIS[1]=SVEL_JOINT(100.0), $TOOL=STOOL2( FP1), $BASE=SBASE( FP1.BASE_NO), $IPO_MODE=SIPO_MODE(FP1.IPO_FRAME)\nSLIN XP2 WITH $VEL=SVEL_CP(0.1, ,LL), $TOOL=STOOL2(FP2), $BASE=EK(K_ROOT(FP2.BASE_NO),K_TYPE(FP2.BASE_NO),K_OFFS(FP2.BASE_NO)) C_SPL\nSLIN XP3 WITH $TOOL=STOOL2(FP3), $BASE=SBASE(FP3.BASE_NO)\nSPTP XHOME WITH $TOOL=STOOL2(FHOME), $BASE=SBASE(FHOME.BASE_NO)\n",
        &[1],
        &[(3, "#ex_base"), (5, "#TCP"), (11, "'XHOME'")],
    ),
    case(
        "elements of an array that are set by themselves",
        "DECL E6POS P[2]\nP[1]={@0}\nP[2]={@1}\nFOR i=1 TO 2\nP[i].Z=P[i].Z+10\nPTP P[i]\nENDFOR\nP[2].X=SEEN()\nP[i]=OTHER\nPTP P[2]\n",
        &[2, 3],
        &[(8, "calculated"), (9, "set here")],
    ),
    case(
        "a point that is set from elsewhere",
        "E6POS P1={@0}\nP1=P2\nPTP P1\nP1=P1:{X 0,Y 0,Z 5,A 0,B 0,C 0}\nPTP P1\n",
        &[1],
        &[(2, "set here")],
    ),
    case(
        "what routines may change of their arguments",
        "DEF A()\nDECL E6POS XP1={@0}\nDECL E6POS XP2={@1}\nLIN XP1\nSHIFT(XP1,10)\nLIN XP1\nLOOK(XP2)\nLIN XP2\nEND\nDEF LOOK(P:IN)\nEND\n",
        &[2, 3],
        &[(5, "calculated")],
    ),
    case(
        "targets and bases from a network",
        "DEF A()\nDECL E6POS XP1={@0}\nRET=EKI_GETFRAME(\"Srv\",\"Pos\",XP1)\nLIN XP1\nEKI_GETREAL(\"Srv\",\"X\",XP1.X)\nRET=EKI_GETFRAME(\"Srv\",\"Base\",$BASE)\nPTP {@1}\nEND\n",
        &[2],
        &[(3, "calculated"), (5, "calculated"), (7, "set by a routine")],
    ),
    case(
        "moved by a sensor, in the world",
        "$BASE=$WORLD\nPTP {@0}\nret=RSI_ON(#RELATIVE)\nRSI_MOVECORR()\nSET_CD_PARAMS (0)\nPTP {@1}\n",
        &[2, 6],
        &[(3, "RSI"), (4, "RSI")],
    ),
    case(
        "inline forms",
        "DECL E6POS XP1={@0,S 2,T @T0,E1 0.0}\nDECL FDAT FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \"}\nDECL PDAT PPDAT1={VEL 100.000,ACC 100.000}\nDECL LDAT LCPDAT1={VEL 2.0,ACC 100.0}\nTOOL_DATA[1]={X 18.0,Y -12.0,Z 118.0,A 0.0,B 0.0,C 0.0}\nFDAT_ACT=FP1\nPTP XP1\n",
        &[1],
        &[],
    ),
    case(
        "motion data in place",
        "TOOL_DATA[4]={X 18.0,Y -12.0,Z 118.0,A 0.0,B 0.0,C 0.0}\nFDAT_ACT={TOOL_NO 4,BASE_NO 0,IPO_FRAME #BASE}\nBAS(#FRAMES)\nPTP {@0}\nFDAT_ACT={TOOL_NO 5,BASE_NO 0,IPO_FRAME #BASE}\nPTP {@1}\n",
        &[4],
        &[(6, "tool '5'")],
    ),
    case("what is declared elsewhere", "PTP XHOME\nPTP {@0}\nLIN XP7 C_DIS\n", &[2], &[(1, "'XHOME'"), (3, "'XP7'")]),
    case("constants", "DECL CONST REAL H=50.0\nLIN {X @X0+H-50,Y @Y0,Z @Z0,@R0}\n", &[2], &[]),
    case("a variable", "DECL REAL H\nLIN {X @X0,Y @Y0,Z H,@R0}\nLIN {@0}\n", &[3], &[(2, "'H'")]),
    case(
        "tools, bases and work spaces are no targets",
        "$WORKSPACE[1]={X 400,Y -100,Z 0,A 0,B 0,C 0,X1 250,Y1 250,Z1 250,X2 -250,Y2 -250,Z2 -250,MODE #OUTSIDE}\n$LOAD={M 2,CM {X 0,Y 0,Z 50,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}\nLOAD_DATA[1]={M 5,CM {X 0,Y 0,Z 50,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}\nDECL E6POS MYBASE={X 0,Y 0,Z 0,A 0,B 0,C 0,S 0,T 0}\nDECL FRAME SHIFT={X 5,Y 0,Z 0,A 0,B 0,C 0}\n$BASE=MYBASE\nLIN {@0}\n",
        &[7],
        &[],
    ),
    case(
        "what nobody goes to",
        "DECL AXIS HOME={A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0}\nCORNER={X 1,Y 2,Z 3,A 0,B 0,C 0}\nLIN {@0}\n",
        &[1, 3],
        &[],
    ),
    case(
        "external axes",
        "DECL E6POS XP1={@0,E1 1200.0,E2 0.0}\nDECL E6AXIS XP2={A1 5,A2 -80,A3 95.5,A4 3,A5 40,A6 -7,E1 -300}\nDECL E6POS XP3={@0,E1 0.0,E2 0.0}\nPTP XP1\nPTP XP2\nPTP XP3\n",
        &[3],
        &[(1, "external axis"), (2, "external axis")],
    ),
    case(
        "copies",
        "DECL E6POS XP1={@0}\nDECL E6POS XP2\nXP2=XP1\nXP2.Z=XP2.Z+50\nLIN XP2\nLIN XP1:{X 0,Y 0,Z -50,A 0,B 0,C 0}\n",
        &[1],
        &[],
    ),
    case("a coordinate that is set", "DECL E6POS XP1={@0}\nXP1.Z=SENSOR\nLIN XP1\n", &[1], &[(2, "calculated")]),
    case(
        "some coordinates",
        "LIN {@0}\nLIN {Z 100}\nPTP {A1 10}\n",
        &[1],
        &[(2, "some of its coordinates"), (3, "some of its coordinates")],
    ),
    case(
        "where the arm is",
        "PTP $AXIS_ACT\nDECL E6POS NOW\nNOW=$POS_ACT\nLIN NOW\nLIN_REL {Z 50}\nLIN {@0}\n",
        &[6],
        &[],
    ),
    case("a spline", "SPLINE\nSPL {@0}\nSPL XP9\nENDSPLINE\n", &[2], &[(3, "'XP9'")]),
    case("a function", "LIN GETPOS(3)\nLIN {@0}\n", &[2], &[(1, "calculates")]),
    case("an array", "DECL E6POS P[2]\nP[1]={@0}\nP[2]={@1}\nFOR I=1 TO 2\nLIN P[I]\nENDFOR\n", &[2, 3], &[]),
    case(
        "home at a singularity",
        "DECL AXIS HOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nPTP HOME\nLIN {@0}\n",
        &[3],
        &[(1, "singularity")],
    ),
    case(
        "a part of the base or the tool that is set",
        "$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\nLIN {@0}\n$BASE.X=$BASE.X+5\nLIN {@1}\n$BASE=$NULLFRAME\n$TOOL.Z=100\nLIN {@2}\n",
        &[2],
        &[(4, "$base"), (7, "$tool")],
    ),
    case(
        "data of a base that are set",
        "BASE_DATA[1]={X 0,Y 0,Z 0,A 0,B 0,C 0}\nBASE_DATA[1].X=5\nBASE_DATA[1]=SEEN\n$BASE=BASE_DATA[1]\nLIN {@0}\nBASE_DATA[N]={X 0,Y 0,Z 0,A 0,B 0,C 0}\nIF BASE_DATA[1].X>=5 THEN\nENDIF\nIF BASE_DATA[1].X==5 THEN\nENDIF\n",
        &[5],
        &[(2, "changed"), (3, "changed"), (6, "changed")],
    ),
    case(
        "a tool that stands still",
        "LIN {@0}\n$IPO_MODE=#TCP\nLIN {@1}\nFDAT_ACT={TOOL_NO 0,BASE_NO 0,IPO_FRAME #TCP}\nLIN {@2}\n",
        &[1],
        &[(3, "stands still"), (5, "stands still")],
    ),
    case(
        "work on an external axis",
        "LIN {@0}\nBAS(#EX_BASE,17)\nLIN {@1}\nBAS(#BASE,0)\nLIN {@2}\n",
        &[1, 5],
        &[(3, "external axis")],
    ),
    case(
        "a tool or base that a branch sets",
        "TOOL_DATA[1]={X 18.0,Y -12.0,Z 118.0,A 0.0,B 0.0,C 0.0}\nLIN {@0}\nIF A==1 THEN\nBAS(#TOOL,1)\nLIN {@1}\nELSE\nBAS(#TOOL,0)\nENDIF\nLIN {@2}\nBAS(#TOOL,1)\nSWITCH B\nCASE 1\n$BASE=$NULLFRAME\nENDSWITCH\nLIN {@3}\n",
        &[2, 5],
        &[(9, "branch"), (15, "branch")],
    ),
    case(
        "a base that another branch sets",
        "LIN {@0}\nIF A==1 THEN\n$BASE=B1:B2\nELSE\nLIN {@1}\nENDIF\nSWITCH B\nCASE 1\n$BASE=$NULLFRAME\nDEFAULT\n$BASE=$NULLFRAME\nENDSWITCH\nLIN {@2}\n",
        &[1, 5, 13],
        &[],
    ),
    case(
        "a tool that a loop sets",
        "BAS(#TOOL,0)\nWAIT FOR $IN[1]\nLIN {@0}\nLOOP\nLIN {@1}\nBAS(#TOOL,7)\nBAS(#TOOL,0)\nENDLOOP\nFOR I=1 TO 3\nLIN {@2}\nBAS(#BASE,0)\nLIN {@3}\nENDFOR\nLIN {@4}\n",
        &[3, 5, 12],
        &[(10, "loop"), (14, "loop")],
    ),
    case(
        "routines that leave another tool",
        "TOOL_DATA[1]={X 18.0,Y -12.0,Z 118.0,A 0.0,B 0.0,C 0.0}\nDEF MAIN( )\nBAS(#TOOL,0)\nLIN {@0}\nGRIP( )\nLIN {@1}\nDROP( )\nLIN {@2}\nBAS(#TOOL,1)\nNONE( )\nLIN {@3}\nEND\nDEF GRIP( )\nIF A THEN\nBAS(#TOOL,1)\nENDIF\nEND\nDEF DROP( )\nBAS(#TOOL,0)\nEND\nDEF NONE( )\nEND\n",
        &[4, 8, 11],
        &[(6, "branch")],
    ),
    case(
        "routines that find the tool of their callers",
        "TOOL_DATA[1]={X 18.0,Y -12.0,Z 118.0,A 0.0,B 0.0,C 0.0}\nDEF MAIN( )\nBAS(#TOOL,0)\nTWICE( )\nONCE( )\nBAS(#TOOL,7)\nTWICE( )\nEND\nDEF TWICE( )\nLIN {@0}\nEND\nDEF ONCE( )\nLIN {@1}\nINNER( )\nEND\nDEF INNER( )\nLIN {@2}\nIF A THEN\nRETURN\nENDIF\nEND\nDEFFCT INT NEVER(I:IN)\nLIN {@3}\nENDFCT\n",
        &[13, 17, 23],
        &[(10, "called")],
    ),
    case(
        "tools of one motion and of a spline",
        "TOOL_DATA[1]={X 18.0,Y -12.0,Z 118.0,A 0.0,B 0.0,C 0.0}\nBAS(#TOOL,7)\nSLIN {@0} WITH $VEL.CP=0.2, $TOOL=TOOL_DATA[1]\nSLIN {@1}\nSPLINE WITH $TOOL=TOOL_DATA[1]\nSPL {@2}\nENDSPLINE\nLIN {@3}\nBAS(#TOOL,1)\nSLIN {@4} WITH $TOOL=TOOL_DATA[7]\n",
        &[3, 6],
        &[(4, "7"), (8, "7"), (10, "7")],
    ),
    case(
        "a base that is set to other numbers",
        "BASE_DATA[1]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n$BASE=BASE_DATA[1]\nLIN {@0}\nBASE_DATA[1]={X 100.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n$BASE=BASE_DATA[1]\nLIN {@1}\nBASE_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nBASE_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n$BASE=BASE_DATA[2]\nLIN {@2}\n",
        &[10],
        &[(3, "several places"), (6, "several places")],
    ),
    case(
        "the same tool given twice",
        "$TOOL={X 0,Y 0,Z 80,A 0,B 0,C 0}\n$BASE={FRAME: X 5,Y 0,Z 0,A 0,B 0,C 0}\nDECL E6POS P={X 430,Y 0,Z 430,A 0,B 90,C 0}\nLIN P\n$TOOL={X 0,Y 0,Z 80.0,A 0,B 0,C 0}\n$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}\nLIN P\n",
        &[3],
        &[],
    ),
];

const FANUC: &[Case] = &[
    case(
        "along a conveyor",
        "/PROG A\n/APPL\n\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : 1;\n  LINE_TRACK_BOUNDARY_NUMBER      : 0;\n/MN\n   1:L P[1] 100mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[],
        &[(5, "conveyor")],
    ),
    case(
        "no conveyor, a seam that a sensor follows, an offset by touching",
        "/PROG A\n/APPL\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : 0;\n/MN\n   1:  Track TAST[R[21]] ;\n   2:L P[1] 100mm/sec FINE ;\n   3:  Track End ;\n   4:  Touch Offset PR[5] ;\n   5:  Touch Offset End ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[15],
        &[(6, "sensor"), (9, "sensor")],
    ),
    case(
        "lines without numbers",
        "/PROG A\n/MN\n  :  !remark ;\n  :J P[1] 100% FINE ;\n:SR[1]=5 ;\n  :L PR[2:cache] R[4]mm/sec CR5 ACC R[6] Skip,LBL[1] ;\nL PR[3] 100mm/sec FINE ;\n  PR[3,1:x]=5 ;\n  PR[3]=P[1] ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[14],
        &[(6, "register"), (8, "calculated")],
    ),
    case(
        "a register whose number a register gives, a position that is set, an output that a motion sets",
        "/PROG A\n/MN\n   1:  PR[R[1]]=P[1] ;\n   2:L PR[R[1]] 100mm/sec FINE ;\n   3:L P[1] 100mm/sec FINE DB 10mm,DO[1]=ON ;\n   4:  P[2]=PR[1] ;\n   5:L P[2] 100mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\n/END\n",
        &[12, 17],
        &[(4, "R[...]"), (6, "is set here")],
    ),
    case(
        "a position that is not taught",
        "/PROG A\n/MN\n   1:J P[...] 100% FINE ;\n   2:J P[1] 100% FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[9],
        &[(3, "not taught")],
    ),
    case(
        "German",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sek FEIN    ;\n/POS\nP[1]{\n   GP1:\n\tUF : F, UT : F,\t\tKONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[8],
        &[],
    ),
    case(
        "a configuration that is not understood",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L P[2] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'Q W E, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[14],
        &[(6, "'Q W E, 0, 0, 0'")],
    ),
    case(
        "registers",
        "/PROG A\n/MN\n   1:L PR[5] 200mm/sec FINE ;\n   2:PR[6]=P[1] ;\n   3:PR[6,3]=PR[6,3]+50 ;\n   4:L PR[6] 200mm/sec FINE ;\n   5:PR[7]=LPOS ;\n   6:L PR[7] 200mm/sec FINE ;\n   7:PR[8]=R[3] ;\n   8:L PR[8] 200mm/sec FINE ;\n   9:L P[1] 200mm/sec FINE Offset,PR[5] ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[16],
        &[(3, "register"), (9, "calculated")],
    ),
    case(
        "a position that is missing",
        "/PROG A\n/MN\n   1:J P[2] 100% FINE ;\n   2:J P[1] 100% FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[9],
        &[(3, "/POS")],
    ),
    case(
        "untaught",
        "/PROG A\n/MN\n   1:J P[1] 100% FINE ;\n   2:J P[2] 100% FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tX = ********  mm, Y = ********  mm, Z = ********  mm,\n\tW = ******** deg, P = ******** deg, R = ******** deg\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[15],
        &[(6, "taught")],
    ),
    case(
        "an extended axis",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L P[2] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0,\n\tE1 = 1500.000 mm\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0,\n\tE1 = 0.000 mm\n};\n/END\n",
        &[15],
        &[(9, "external axis")],
    ),
    case(
        "another group",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L P[1] 200mm/sec FINE COORD ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n GP2:\n\tUF : 0, UT : 1,\n\tJ1 = 100.000 deg\n};\n/END\n",
        &[9],
        &[(4, "COORD")],
    ),
    case(
        "relative to another group",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L P[2] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tRX = 1 mm, RY = 2 mm, RZ = 3 mm,\n\tRW = 0 deg, RP = 0 deg, RR = 0 deg\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[15],
        &[(6, "relative")],
    ),
    case(
        "an increment is no target",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L P[2] 200mm/sec FINE INC ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tX = 0 mm, Y = 0 mm, Z = 50 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\n/END\n",
        &[9],
        &[],
    ),
    case(
        "several active frames",
        "/PROG A\n/MN\n   1:UFRAME_NUM=1 ;\n   2:L P[1] 200mm/sec FINE ;\n   3:UFRAME_NUM=2 ;\n   4:L P[2] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[16],
        &[(8, "UFRAME_NUM")],
    ),
    case(
        "lines that go on in the next",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE\n    :  Offset,PR[1] ;\n   2:L P[2] 200mm/sec FINE\n    :  INC ;\n   3:C PR[2]\n    :  PR[3] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tX = 0 mm, Y = 0 mm, Z = 50 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\n/END\n",
        &[13],
        &[(7, "register"), (8, "register")],
    ),
    case(
        "frames that are set, and a tool that stands still",
        "/PROG A\n/MN\n   1:UFRAME[1]=PR[4] ;\n   2:L P[1] 200mm/sec FINE RTCP ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[],
        &[(3, "user frame"), (4, "RTCP")],
    ),
];

const URSCRIPT: &[Case] = &[
    case(
        "a frame that is set anew along the way",
        "def a():\nref=p[0,0,0,0,0,0]\nref=p[0.1,0.2,0,0,0,0]\nmovel(pose_trans(ref,p[@0]))\nref=p[0,0,0,0,0,0]\nmovel(pose_trans(ref,p[@0]))\nplane=p[0,0,0,0,0,0]\nwhile b:\nmovel(pose_trans(plane,p[@0]))\nplane=p[0.1,0.2,0,0,0,0]\nend\ntable=p[0,0,0,0,0,0]\ntable=p[0.1,0.2,0,0,0,0]\ndef go():\nmovel(pose_trans(table,p[@0]))\nend\nend\n",
        &[4, 6],
        &[(9, "'plane'"), (15, "'table'")],
    ),
    case(
        "on a conveyor and beside the path",
        "movel(p[@0])\ntrack_conveyor_linear(p[1,0,0,0,0,0], 1000.0)\nmovel(p[@1])\nstop_conveyor_tracking()\npath_offset_set(p[0,0,0.01,0,0,0], 1)\nmovel(p[@2])\n",
        &[1, 3, 6],
        &[(2, "displaces"), (5, "displaces")],
    ),
    case(
        "a pose that is set from elsewhere",
        "wp=p[@0]\nwp=other\nmovel(wp)\nwp=pose_add(wp,p[0,0,0.1,0,0,0])\nmovel(wp)\n",
        &[1],
        &[(2, "set here")],
    ),
    case(
        "MoveJ of PolyScope",
        "def a():\n  global Waypoint_1_p=p[@0]\n  global Waypoint_1_q=[0.1,-1.5,1.2,-1.0,0.5,.3]\n  movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q), a=1.3962634015954636, v=1.0471975511965976)\n  movel(Waypoint_1_p, a=1.2, v=0.25)\nend\n",
        &[2],
        &[],
    ),
    case(
        "constants",
        "h = 0.05\nmovel(p[@X0+h-0.05,@Y0,@Z0,@R0], a=1)\nmovej([d2r(5),-pi/2,1.2,-1.0,0.5,.3])\n",
        &[2, 3],
        &[],
    ),
    case("a variable", "h = 0.05\nh = h + 0.01\nmovel(p[@X0,@Y0,h,@R0], a=1)\nmovel(p[@0])\n", &[4], &[(3, "'h'")]),
    case(
        "an argument",
        "def go(where, h):\n  movel(where, a=1)\n  movel(p[@X0,@Y0,h,@R0])\nend\nmovel(p[@0])\n",
        &[5],
        &[(2, "'where'"), (3, "'h'")],
    ),
    case(
        "a feature plane",
        "Plane_1=p[0,0,0,0,0,0]\nmovel(pose_trans(Plane_1, p[@0]), a=1)\nwp=p[@1]\nmovej(get_inverse_kin(pose_trans(Plane_1, p[@2])))\nmovel(wp)\n",
        &[2, 3, 4],
        &[],
    ),
    case(
        "relative to a target",
        "wp=p[@0]\nmovel(pose_trans(wp, p[0,0,-0.05,0,0,0]))\nabove=pose_trans(wp, p[0,0,-0.05,0,0,0])\nmovel(above)\nmovel(wp)\n",
        &[1],
        &[],
    ),
    case(
        "a plane that is calculated",
        "movel(pose_trans(find_part(), p[@0]))\nmovel(p[@0])\n",
        &[2],
        &[(1, "calculates")],
    ),
    case(
        "where the arm is",
        "movel(pose_add(get_actual_tcp_pose(), p[0,0,0.1,0,0,0]))\nq=get_actual_joint_positions()\nmovej(q)\nmovel(p[@0])\n",
        &[4],
        &[],
    ),
    case("a coordinate that is set", "wp=p[@0]\nwp[2]=sensor\nmovel(wp)\n", &[1], &[(2, "calculated")]),
    case(
        "under force",
        "movel(p[@0])\nforce_mode(p[0,0,0,0,0,0],[0,0,1,0,0,0],[0,0,-10,0,0,0],2,[0.1,0.1,0.05,0.3,0.3,0.3])\nmovel(p[@1])\nend_force_mode()\nmovel(p[@2])\n",
        &[1, 3, 5],
        &[(2, "displaces")],
    ),
    case("copies", "wp=p[@0]\nnext=wp\nmovel(next)\nmovel(nowhere)\n", &[1], &[(4, "'nowhere'")]),
    case("a circle", "movec(p[@0], over)\n", &[1], &[(1, "'over'")]),
    case(
        "options of a motion assign nothing",
        "a=p[@0]\nv = 0.05\nmovej([0.1,-1.5,1.2,-1.0,0.5,.3], a=1.4, v=0.5)\nmovel(a, a=1.2, v=0.25)\nmovel(p[@X1+v-0.05,@Y1,@Z1,@R1], v=1)\n",
        &[1, 3, 5],
        &[],
    ),
    case(
        "joints of a function",
        "movej(interpolate(3))\noptimovej(get_inverse_kin(p[@0]))\n",
        &[2],
        &[(1, "calculates")],
    ),
    case(
        "tools that the motion names itself",
        "movel(p[@0])\nmovej(get_inverse_kin(p[@1], [0.1,-1.5,1.2,-1.0,0.5,.3], tcp=p[0,0,0.1,0,0,0]))\nmc_add_linear(p[@2], 1.2, 0.25, 0)\nw=p[@3]\nmovej(get_inverse_kin(w, tcp=p[0,0,0.1,0,0,0]))\nv=p[@4]\nmc_add_linear(v, 1.2, 0.25, 0)\n",
        &[1],
        &[(2, "tcp="), (3, "mc_initialize"), (5, "tcp="), (7, "mc_initialize")],
    ),
    case(
        "a tool that a branch sets",
        "def a():\nmovel(p[@0])\nif big:\nset_tcp(p[0.018,-0.012,0.118,0,0,0])\nwhile True:\nmovel(p[@1])\nend\nend\nmovel(p[@2])\nend\n",
        &[2, 6],
        &[(9, "branch")],
    ),
    case(
        "functions and loops that set the tool",
        "def a():\ndef grip():\nset_tcp(p[0.018,-0.012,0.118,0,0,0])\nend\ndef go():\nmovel(p[@0])\nend\nmovel(p[@1])\ngo()\nif big:\ngrip()\nend\nmovel(p[@2])\ngrip()\nmovel(p[@3])\nwhile True:\nmovel(p[@4])\nset_tcp(tool())\nend\nend\n",
        &[6, 8, 15],
        &[(13, "branch"), (17, "loop")],
    ),
    case(
        "a function that is called with several tools",
        "def a():\ndef go():\nmovel(p[@0])\nend\ngo()\nset_tcp(p[0.018,-0.012,0.118,0,0,0])\ngo()\nend\n",
        &[],
        &[(3, "called")],
    ),
];

const CSV: &[Case] = &[case(
    "rows",
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,5,60,-7\n10,20,10,5,x,-7\n",
    &[2],
    &[(3, "'x'")],
)];

/// The text with the coordinates of poses in it.
fn filled(text: &str, d: Dialect, model: &Model) -> String {
    let zero = match d {
        Dialect::Krl => [0.0, -90.0, 90.0, 0.0, 0.0, 0.0],
        Dialect::Fanuc => [0.0, 0.0, 0.0, 0.0, -90.0, 0.0],
        Dialect::UrScript => [0.0, -90.0, 70.0, -60.0, 20.0, 0.0],
        _ => [0.0; 6],
    };
    let mut out = text.to_owned();
    for (k, q) in joints(zero).iter().enumerate() {
        let mut p = flange(model, q);
        if d != Dialect::Rapid {
            p = p.compose(&device());
        }
        if d == Dialect::Fanuc {
            p = pose(0.0, 0.0, 330.0, 0.0, 0.0, 0.0).inverse().compose(&p);
        }
        let [x, y, z] = mm(&p).map(|x| format!("{x:.5}"));
        let [a, b, c] = angles_zyx(&p.rotation).map(|a| format!("{:.7}", a.to_degrees()));
        let v = rotation_vector(&p.rotation);
        let metres = [p.translation.x, p.translation.y, p.translation.z].map(|x| format!("{x:.8}"));
        let [x, y, z] = if d == Dialect::UrScript { metres } else { [x, y, z] };
        let below: u32 = q.iter().enumerate().map(|(i, q)| u32::from(*q < 0.0) << i).sum();
        let (all, turn) = match d {
            Dialect::Krl => (format!("X {x},Y {y},Z {z},A {a},B {b},C {c}"), format!("A {a},B {b},C {c}")),
            Dialect::Fanuc => {
                (format!("X = {x} mm, Y = {y} mm, Z = {z} mm, W = {c} deg, P = {b} deg, R = {a} deg"), String::new())
            }
            Dialect::UrScript => {
                let v = format!("{:.9},{:.9},{:.9}", v.x, v.y, v.z);
                (format!("{x},{y},{z},{v}"), v)
            }
            _ => {
                let cf = [0, 3, 5].map(|j| f64::from(quadrant(q[j])));
                out = out.replace(&format!("@C{k}"), &format!("[{},{},{},0]", cf[0], cf[1], cf[2]));
                let all = format!(
                    "[[{x},{y},{z}],[{}],[{},{},{},0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
                    quaternion(&p),
                    cf[0],
                    cf[1],
                    cf[2]
                );
                (all, quaternion(&p))
            }
        };
        for (what, value) in [("X", x), ("Y", y), ("Z", z), ("R", turn), ("T", below.to_string()), ("", all)] {
            out = out.replace(&format!("@{what}{k}"), &value);
        }
    }
    out
}

#[test]
fn each_construction_is_rewritten_or_listed() {
    let mut wrong = Vec::new();
    for (d, robot, cases) in [
        (Dialect::Rapid, IRB, RAPID),
        (Dialect::Krl, KR6, KRL),
        (Dialect::Fanuc, LR, FANUC),
        (Dialect::UrScript, UR5E, URSCRIPT),
        (Dialect::Csv, IRB, CSV),
    ] {
        let nominal = nominal(robot);
        let real = real(&nominal);
        for case in cases {
            let text = filled(case.text, d, &nominal);
            let options = Options { temp_c: Some(32.0), details: true, ..Options::default() };
            let run = |text: &[u8], model: &Model, out: &mut Vec<u8>| {
                compensate(text, "p", d, &nominal, model, &Frames::default(), &options, out).unwrap()
            };
            let mut out = Vec::new();
            let report = run(text.as_bytes(), &real, &mut out);
            let mut lines: Vec<usize> = report.rows.iter().map(|r| r.line).collect();
            lines.sort_unstable();
            let listed: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
            let as_listed = report.problems.len() == case.listed.len()
                && report
                    .problems
                    .iter()
                    .zip(case.listed)
                    .all(|(p, (line, words))| p.line == *line && p.what.contains(words));
            if lines != case.rewritten || !as_listed || report.after[1] > 1e-6 {
                wrong.push(format!(
                    "{d:?}, {}: rewritten {lines:?}, listed {listed:#?}, after {:?}",
                    case.name, report.after
                ));
            }
            // the nominal arm's own program: nothing moves, and no expression is replaced
            let mut same = Vec::new();
            run(text.as_bytes(), &nominal, &mut same);
            let same = String::from_utf8(same).unwrap();
            let kept = same.lines().filter(|l| !l.contains("compensated by TriCal")).eq(text.lines());
            if !kept {
                wrong.push(format!("{d:?}, {}: the nominal arm changes\n{same}", case.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
