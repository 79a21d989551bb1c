//! Small programs in FANUC listings.

use super::{Case, case};

pub(super) const FANUC: &[Case] = &[
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
        "places of a pallet, a position at which the arm stands",
        "/PROG A\n/MN\n   1:  PALLETIZING-B_1 ;\n   2:J PAL_1[A_1] 100% FINE ;\n   3:L PAL_1[BTM] 100mm/sec FINE ;\n   4:L @P[1] 100mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[11],
        &[(4, "'PAL_1[A_1]'"), (5, "'PAL_1[BTM]'")],
    ),
    case(
        "a second arm and a positioner",
        "/PROG A\n/MN\n   1:L P[1] 100mm/sec FINE ;\n   2:L P[2] 100mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n GP2:\n\tUF : 0, UT : 0,\n\tJ1= 5.000 deg\n};\nP[2]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n GP2:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\n/END\n",
        &[9, 17],
        &[(14, "another arm too")],
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
        "outputs of a German listing",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sek FEIN    ;\n   2:  A[23]=(AUS) ;\n   3:  A[26:x]=PULS,0.5sek ;\n   4:A P[2]\n    :  P[1] 200mm/sek FEIN ;\n   5:A PR[3] 200mm/sek FEIN ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0,\t\tKONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : 0,\t\tKONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\n/END\n",
        &[13, 18],
        &[(8, "register")],
    ),
    case(
        "positions that nothing uses",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:PR[4]=P[2] ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\nP[3]{\n GP1:\n\tUF : 0, UT : 7, CONFIG : 'N U T, 0, 0, 0',\n\tX = 0 mm, Y = 0 mm, Z = 0 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\nP[4]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\tX = ********  mm, Y = ********  mm, Z = ********  mm,\n\tW = ******** deg, P = ******** deg, R = ******** deg\n};\n/END\n",
        &[9, 14],
        &[],
    ),
    case(
        "a position whose number a register gives: it may be any",
        "/PROG A\n/MN\n   1:L P[R[1]] 200mm/sec FINE ;\n   2:L P[1] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\n/END\n",
        &[9, 14],
        &[],
    ),
    case(
        "a configuration that is not understood",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L P[2] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'Q W E, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[14],
        &[(6, "'Q W E, 0, 0, 0'")],
    ),
    case(
        "words in comments and names of programs; registers of the first group, and what a skip keeps in one",
        "/PROG A\n/MN\n   1:L P[1:rtcp inc] R[15:speed INC]mm/sec FINE DB 50mm,DO[12:INC]=ON ;\n   2:L P[2:coord offset] 20mm/sec FINE TB .1sec,CALL INC ;\n   3:L P[3] 20mm/sec FINE Skip,LBL[1],PR[5]=LPOS ;\n   4:L PR[5] 20mm/sec FINE ;\n   5:PR[GP1:1]=P[3] ;\n   6:L PR[GP1:1] 20mm/sec FINE ;\n   7:PR[GP1:1,3:up]=500 ;\n   8:L PR[1:[x] 20mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\nP[3]{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n\t@2\n};\n/END\n",
        &[15, 20, 25],
        &[(9, "calculated")],
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
        "an increment by a register says nothing of the position of the same number",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE ;\n   2:L PR[2:over] 200mm/sec FINE INC ;\n   3:L P[R[1]] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@1\n};\n/END\n",
        &[10, 15],
        &[],
    ),
    case(
        "positions that are only increments and offsets, by way of a register",
        "/PROG A\n/MN\n   1:PR[2]=P[2] ;\n   2:L P[1] 200mm/sec FINE ;\n   3:L PR[2:over] 200mm/sec FINE INC ;\n   4:PR[4]=P[3] ;\n   5:L P[1] 200mm/sec FINE Offset,PR[4] ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tX = 0 mm, Y = 0 mm, Z = 50 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\nP[3]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tX = 0 mm, Y = 0 mm, Z = 50 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\n/END\n",
        &[12],
        &[],
    ),
    case(
        "several active frames",
        "/PROG A\n/MN\n   1:UFRAME_NUM=1 ;\n   2:L P[1] 200mm/sec FINE ;\n   3:UFRAME_NUM=2 ;\n   4:L P[2] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[16],
        &[(8, "UFRAME_NUM")],
    ),
    case(
        "frames of motion groups",
        "/PROG A\n/MN\n   1:  UFRAME_NUM[GP1]=3 ;\n   2:  UTOOL_NUM[GP1]=0 ;\n   3:  UTOOL_NUM[GP2]=5 ;\n   4:L P[1] 100mm/sec FINE ;\n   5:L P[2] 100mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : 0, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[17],
        &[(12, "'3'")],
    ),
    case(
        "motions of several groups",
        "/PROG A\n/MN\n   1:  Independent GP\n    :  GP1 J P[1] 100% FINE INC\n    :  GP2 J P[1] 100% FINE ;\n   2:  Simultaneous GP\n    :  GP1 L PR[4] 100mm/sec FINE\n    :  GP2 J P[1] 100% FINE ;\n   3:  Independent GP\n    :  GP2 J P[1] 100% FINE\n    :  GP1 L P[2] 100mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : 0, UT : F,\n\tJ1= 5.0 deg, J2= 3.0 deg, J3=4.0 deg,\n\tJ4= 5.0 deg, J5=-6.0 deg, J6=7.0 deg\n};\nP[2]{\n GP1:\n\tUF : 0, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[22],
        &[(7, "register")],
    ),
    case(
        "lines that go on in the next",
        "/PROG A\n/MN\n   1:L P[1] 200mm/sec FINE\n    :  Offset,PR[1] ;\n   2:L P[2] 200mm/sec FINE\n    :  INC ;\n   3:C PR[2]\n    :  PR[3] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\nP[2]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\tX = 0 mm, Y = 0 mm, Z = 50 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\n/END\n",
        &[13],
        &[(7, "register"), (8, "register")],
    ),
    case(
        "frames that are set as system variables",
        "/PROG A\n/MN\n   1:$MNUFRAME[1,1]=PR[4] ;\n   2:$MNUTOOL[1,2]=PR[5] ;\n   3:L P[1] 200mm/sec FINE ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[10],
        &[(3, "user frame"), (4, "user frame")],
    ),
    case(
        "frames that are set, and a tool that stands still",
        "/PROG A\n/MN\n   1:UFRAME[1]=PR[4] ;\n   2:L P[1] 200mm/sec FINE RTCP ;\n/POS\nP[1]{\n GP1:\n\tUF : F, UT : F, CONFIG : 'N U T, 0, 0, 0',\n\t@0\n};\n/END\n",
        &[],
        &[(3, "user frame"), (4, "RTCP")],
    ),
];
