//! Small programs in URScript.

use super::{Case, case};

pub(super) const URSCRIPT: &[Case] = &[
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
