//! Programs that say the same in two ways, the second of them plainly: every target is meant at the same place, and comes out with the
//! same numbers where it had the same.

use trical_program::Dialect::{self, Krl, UrScript};

/// Dialect, what is said, how, and plainly.
pub(super) const SAME: &[(Dialect, &str, &str, &str)] = &[
    (
        Krl,
        "bases with the geometric operator",
        "BASE_DATA[1]={X 10,Y 0,Z 0,A 90,B 0,C 0}\n$BASE=BASE_DATA[1]:{X 5,Y 0,Z 0,A 0,B 0,C 0}\nLIN {@0}\n$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}:BASE_DATA[1]\nLIN {@1}\n$BASE=$WORLD : BASE_DATA[1]\nSLIN {@2}\nSLIN {@3} WITH $BASE=BASE_DATA[1]:{X 5,Y 0,Z 0,A 0,B 0,C 0}\n",
        "BASE_DATA[1]={X 10,Y 0,Z 0,A 90,B 0,C 0}\n$BASE={X 10,Y 5,Z 0,A 90,B 0,C 0}\nLIN {@0}\n$BASE={X 15,Y 0,Z 0,A 90,B 0,C 0}\nLIN {@1}\n$BASE=BASE_DATA[1]\nSLIN {@2}\nSLIN {@3} WITH $BASE={X 10,Y 5,Z 0,A 90,B 0,C 0}\n",
    ),
    (
        Krl,
        "status and turn of motions along a path, which the controller does not take",
        "PTP {@0,S 2,T @T0}\nLIN {@1,S 6,T 63}\nCIRC {@2,S 0,T 0},{@3,S 2,T 10}\nSPLINE\nSPL {@1,S 5,T 10}\nENDSPLINE\nPTP {@2,S 2,T @T2}\n",
        "PTP {@0,S 2,T @T0}\nLIN {@1}\nCIRC {@2},{@3}\nSPLINE\nSPL {@1}\nENDSPLINE\nPTP {@2,S 2,T @T2}\n",
    ),
    (
        Krl,
        "a tool with the geometric operator",
        "TOOL_DATA[2]={X 18,Y -12,Z 18,A 90,B 0,C 0}\n$TOOL=TOOL_DATA[2]:{X 5,Y 0,Z 100,A 0,B 0,C 0}\nLIN {@0}\n",
        "$TOOL={X 18,Y -7,Z 118,A 90,B 0,C 0}\nLIN {@0}\n",
    ),
    (
        Krl,
        "places in frames of the program",
        "DECL FRAME PAL,ROWS[2]\nDECL E6POS XP1\nPAL={X 10,Y 0,Z 0,A 90,B 0,C 0}\nROWS[2]={X 5,Y 0,Z 0,A 0,B 0,C 0}\nXP1={@0}\n$BASE=$NULLFRAME\nLIN PAL:XP1\nLIN {@1}\nCIRC {X 10,Y 0,Z 0,A 90,B 0,C 0}:{@2},PAL:ROWS[2]:{@3},CA 90\n",
        "DECL E6POS XP1\nXP1={@0}\n$BASE={X 10,Y 0,Z 0,A 90,B 0,C 0}\nLIN XP1\n$BASE=$NULLFRAME\nLIN {@1}\n$BASE={X 10,Y 0,Z 0,A 90,B 0,C 0}\nLIN {@2}\n$BASE={X 10,Y 5,Z 0,A 90,B 0,C 0}\nLIN {@3}\n",
    ),
    (
        Krl,
        "frames that are set once",
        "DECL FRAME MYB,T[2]\nMYB={X 10,Y 0,Z 0,A 90,B 0,C 0}\nT[1]={X 18,Y -7,Z 118,A 90,B 0,C 0}\n$BASE=MYB\n$TOOL=T[1]\nLIN {@0}\n",
        "$BASE={X 10,Y 0,Z 0,A 90,B 0,C 0}\n$TOOL={X 18,Y -7,Z 118,A 90,B 0,C 0}\nLIN {@0}\n",
    ),
    (
        Krl,
        "a base and a tool that are multiplied further",
        "BASE_DATA[1]={X 10,Y 0,Z 0,A 90,B 0,C 0}\nBAS(#BASE,1)\n$TOOL={X 18,Y -12,Z 18,A 90,B 0,C 0}\n$BASE=$BASE:{X 5,Y 0,Z 0,A 0,B 0,C 0}\nLIN {@0}\n$TOOL=$TOOL:{X 5,Y 0,Z 100,A 0,B 0,C 0}\nLIN {@1}\n",
        "$BASE={X 10,Y 5,Z 0,A 90,B 0,C 0}\n$TOOL={X 18,Y -12,Z 18,A 90,B 0,C 0}\nLIN {@0}\n$TOOL={X 18,Y -7,Z 118,A 90,B 0,C 0}\nLIN {@1}\n",
    ),
    (
        Krl,
        "a tool that stands still for a while",
        "TOOL_DATA[1]={X 18,Y -7,Z 118,A 90,B 0,C 0}\nBAS(#TOOL,0)\n$IPO_MODE=#TCP\nBAS(#TOOL,1)\n$IPO_MODE=#BASE\nLIN {@0}\n",
        "$TOOL={X 18,Y -7,Z 118,A 90,B 0,C 0}\nLIN {@0}\n",
    ),
    (
        Krl,
        "routines that leave the tool alone, one behind the other, in each other, and again",
        "TOOL_DATA[1]={X 18,Y -7,Z 118,A 90,B 0,C 0}\nDEF MAIN( )\n$TOOL=TOOL_DATA[1]\nLIN {@0}\nA1( )\nA2( )\nA3( )\nA4( )\nA5( )\nA1( )\nLIN {@1}\nA5( )\nLIN {@2}\nEND\nDEF A1( )\nWAIT SEC 1\nEND\nDEF A2( )\nA1( )\nEND\nDEF A3( )\nA2( )\nA1( )\nEND\nDEF A4( )\nA3( )\nEND\nDEF A5( )\nA4( )\nEND\n",
        "$TOOL={X 18,Y -7,Z 118,A 90,B 0,C 0}\nLIN {@0}\nLIN {@1}\nLIN {@2}\n",
    ),
    (
        UrScript,
        "a gripper that is closed and opened again",
        "def grip():\nset_tool_digital_out(0,True)\nend\ndef release():\nset_tool_digital_out(0,False)\nend\nset_tcp(p[0.018,-0.012,0.118,0,0,0])\nmovel(p[@0])\ngrip()\nmovel(p[@1])\nrelease()\nmovel(p[@2])\ngrip()\nmovel(p[@3])\n",
        "set_tcp(p[0.018,-0.012,0.118,0,0,0])\nmovel(p[@0])\nmovel(p[@1])\nmovel(p[@2])\nmovel(p[@3])\n",
    ),
    (
        UrScript,
        "names of places in frames",
        "grid=p[0.01,0,0,0,0,1.5]\nrel=p[@0]\nmovel(pose_trans(grid, rel), a=1)\nto=pose_trans(grid,p[@1])\nmovel(to)\nover=p[@2]\nnext=pose_trans(grid,over)\nagain=next\nmovel(again)\nmovel(pose_trans(to,p[0,0,0.05,0,0,0]))\nto=p[@3]\nmovel(to)\n",
        "grid=p[0.01,0,0,0,0,1.5]\nmovel(pose_trans(grid,p[@0]))\nmovel(pose_trans(grid,p[@1]))\nmovel(pose_trans(grid,p[@2]))\nmovel(p[@3])\n",
    ),
    (
        UrScript,
        "coordinates of a tool, a plane and joints that are set",
        "h=0.1\ntip=p[0.018,-0.012,0,0,0,0]\ntip[2]=h + 0.018 # m\nset_tcp(tip)\nqn=[0.1,-1.5,1.2,-1.0,0.5,0]\nqn[5]=.3\nmovej(get_inverse_kin(p[@0],qnear=qn))\nplane=p[0,0,0,0,0,0]\nplane[0]=0.01\nplane [5] = 0.2\nmovel(pose_trans(plane,p[@1]))\n",
        "set_tcp(p[0.018,-0.012,0.118,0,0,0])\nmovej(get_inverse_kin(p[@0],qnear=[0.1,-1.5,1.2,-1.0,0.5,.3]))\nmovel(pose_trans(p[0.01,0,0,0,0,0.2],p[@1]))\n",
    ),
    (
        UrScript,
        "joints of a place",
        "qn=[0.1,-1.5,1.2,-1.0,0.5,.3]\nq=get_inverse_kin(p[@0], qnear=qn)\nr=get_inverse_kin(p[@1],[1.5,-2.5,2.0,-1.0,-0.5,.3])\nmovej([0.1,-1.4,1.2,-1.0,0.5,.3])\nmovej(r)\nmovej(q)\n",
        "qn=[0.1,-1.5,1.2,-1.0,0.5,.3]\nq=p[@0]\nr=p[@1]\nmovej([0.1,-1.4,1.2,-1.0,0.5,.3])\nmovej(get_inverse_kin(r,[1.5,-2.5,2.0,-1.0,-0.5,.3]))\nmovej(get_inverse_kin(q,qnear=qn))\n",
    ),
    (
        UrScript,
        "the place of joints",
        "q=[0.1,-1.5,1.2,-1.0,0.5,.3]\nmovel(get_forward_kin(q))\nto=get_forward_kin([0.2,-1.5,1.2,-1.0,0.5,.3])\nmovel(to)\n",
        "movej([0.1,-1.5,1.2,-1.0,0.5,.3])\nmovej([0.2,-1.5,1.2,-1.0,0.5,.3])\n",
    ),
];
