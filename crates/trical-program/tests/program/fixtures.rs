//! An arm with everything wrong, and programs of every dialect, written from joint values as a controller would teach them.

use nalgebra::Vector3;
use trical_model::pose::{angles_zyx, quaternion_from_rotation, rotation_vector, rotation_zyx};
use trical_model::{
    Basis, Cell, Forward, Model, Motion, Parameter, Pose, Robot, Shape, Site, State, Term, Tool, Variable,
};
use trical_program::{Dialect, Frame, Frames};

pub const IRB: &str = include_str!("../../../../cells/irb120/robot.toml");
pub const KR6: &str = include_str!("../../../../robots/kr6_r700.toml");
pub const LR: &str = include_str!("../../../../robots/lrmate_200id.toml");
pub const UR5E: &str = include_str!("../../../../robots/ur5e.toml");

pub fn pose(x: f64, y: f64, z: f64, a: f64, b: f64, c: f64) -> Pose {
    Pose {
        rotation: rotation_zyx(a.to_radians(), b.to_radians(), c.to_radians()),
        translation: Vector3::new(x, y, z) * 1e-3,
    }
}

pub fn device() -> Pose {
    pose(18.0, -12.0, 118.0, 0.0, 0.0, 0.0)
}

pub fn gripper() -> Pose {
    pose(-20.0, 5.0, 140.0, 30.0, 20.0, -10.0)
}

pub fn table() -> Pose {
    pose(250.0, -100.0, 50.0, 20.0, 5.0, -3.0)
}

pub fn nominal(robot: &str) -> Model {
    let mut cell = Cell::bare();
    cell.world_from_base = pose(150.0, -330.0, -150.0, 90.0, 0.0, 0.0);
    cell.tool = Tool { tcp: device().translation, targets: vec![device().translation], mass: 1.7, ..cell.tool };
    Model::nominal(Robot::parse(robot, "robot.toml").unwrap(), cell)
}

/// Geometry, compliance where the masses are known, backlash, heat, base and tool.
pub fn real(nominal: &Model) -> Model {
    let term = |name: &str, site, basis, value| Term { value, ..Term::new(name, "test", site, basis) };
    let link = |link, parameter| Site::Link { link, parameter };
    let heat = Basis::new(Variable::Temperature { reference_c: 20.0 }, Shape::Linear);
    let mut terms = vec![
        term("a_2", link(2, Parameter::A), Basis::CONSTANT, 0.4e-3),
        term("d_4", link(4, Parameter::D), Basis::CONSTANT, -0.3e-3),
        term("alpha_1", link(1, Parameter::Alpha), Basis::CONSTANT, 0.6e-3),
        term("theta_3", link(3, Parameter::Theta), Basis::CONSTANT, 2e-3),
        term("theta_5", link(5, Parameter::Theta), Basis::CONSTANT, -1e-3),
        term("base_z", Site::Base(Motion::ALL[2]), Basis::CONSTANT, 1e-3),
        term("tool_x", Site::Tool(Motion::ALL[0]), Basis::CONSTANT, -0.5e-3),
        term("gap_2", Site::Joint { joint: 2 }, Basis::direction(2), 0.4e-3),
        term("gap_3", Site::Joint { joint: 3 }, Basis::direction(3), -0.3e-3),
        term("heat", Site::Links, heat, 12e-6),
    ];
    if nominal.robot.require_masses().is_ok() {
        terms.push(term("c_2", Site::Joint { joint: 2 }, Basis::torque(2, Shape::Linear), 2e-5));
        terms.push(term("c_3", Site::Joint { joint: 3 }, Basis::torque(3, Shape::Linear), 3e-5));
    }
    Model { terms, ..nominal.clone() }
}

/// Where the flange of an arm is, in its foot, at joint values in deg.
pub fn flange(model: &Model, q_deg: &[f64]) -> Pose {
    let mut bare = Model::nominal(model.robot.clone(), Cell::bare());
    bare.cell.world_from_base = Pose::identity();
    let f = Forward::new(bare, vec![]).unwrap();
    let q: Vec<f64> = q_deg.iter().map(|q| q.to_radians()).collect();
    f.world_from_flange(&State::at(&q), &mut f.workspace())
}

/// Joint values of five targets that suit all arms here, by signs and zeros of the arm.
pub fn joints(zero: [f64; 6]) -> Vec<[f64; 6]> {
    [
        [10.0, 12.0, -8.0, 20.0, 40.0, -30.0],
        [-25.0, 20.0, 5.0, -15.0, 35.0, 60.0],
        [30.0, 5.0, 12.0, 40.0, 55.0, 10.0],
        [12.0, 25.0, -15.0, -50.0, 30.0, 110.0],
        [-40.0, 15.0, 2.0, 10.0, 65.0, -100.0],
    ]
    .map(|q| std::array::from_fn(|k| q[k] + zero[k]))
    .to_vec()
}

pub fn quadrant(q: f64) -> i32 {
    (q / 90.0).floor() as i32
}

/// Even targets with the device in the base, odd ones with the gripper on the table.
pub fn in_frame(model: &Model, q: &[f64; 6], k: usize) -> Pose {
    let base_from_flange = flange(model, q);
    if k.is_multiple_of(2) {
        base_from_flange.compose(&device())
    } else {
        table().inverse().compose(&base_from_flange).compose(&gripper())
    }
}

pub fn numbers(v: &[f64]) -> String {
    v.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(",")
}

pub fn quaternion(p: &Pose) -> String {
    quaternion_from_rotation(&p.rotation).map(|x| format!("{x:.9}")).join(",")
}

pub fn mm(p: &Pose) -> [f64; 3] {
    [p.translation.x, p.translation.y, p.translation.z].map(|x| x * 1e3)
}

pub fn rapid(model: &Model) -> Vec<u8> {
    let mut text = b"%%%\r\n  VERSION:1\r\n%%%\r\nMODULE M\r\n  ! gr\xfc\xdfe aus M\xfcnchen [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\n".to_vec();
    let tool = |name: &str, p: &Pose, mass: f64| {
        format!(
            "  PERS tooldata {name}:=[TRUE,[[{}],[{}]],[{mass},[0,0,0],[1,0,0,0],0,0,0]];\r\n",
            numbers(&mm(p)),
            quaternion(p)
        )
    };
    let mut say = |s: String| text.extend(s.into_bytes());
    say(tool("tDevice", &device(), 1.7));
    say(tool("tGripper", &gripper(), 0.5));
    // the table in two steps
    let user = pose(100.0, 20.0, 30.0, 15.0, -3.0, 2.0);
    let object = user.inverse().compose(&table());
    say(format!(
        "  TASK PERS wobjdata wTable:=[FALSE,TRUE,\"\",[[{}],[{}]],[[{}],[{}]]];\n",
        numbers(&mm(&user)),
        quaternion(&user),
        numbers(&mm(&object)),
        quaternion(&object)
    ));
    let all = joints([0.0; 6]);
    let target = |k: usize, q: &[f64; 6]| {
        let p = in_frame(model, q, k);
        let cf = format!("[{},{},{},0]", quadrant(q[0]), quadrant(q[3]), quadrant(q[5]));
        format!("[[{}],[{}],{cf},[9E+09,9E9,9E9,9E9,9E9,9E9]]", numbers(&mm(&p)), quaternion(&p))
    };
    say(format!("  LOCAL CONST robtarget p0:={};\n", target(0, &all[0])));
    say(format!("  pers RobTarget P1 :=\r\n    {};\r\n", target(1, &all[1])));
    say(format!("  CONST robtarget path{{2}}:=[{},\n   {}];\n", target(2, &all[2]), target(4, &all[4])));
    say("  CONST jointtarget jHome:=[[10,20,10,5,60,-7],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n".into());
    say("  PROC main()\r\n    MoveAbsJ jHome\\NoEOffs,v200,fine,tGripper\\WObj:=wTable;\r\n".into());
    say("    MoveJ p0,v100,fine,tDevice;\r\n    MoveL offs(P1,0,0,-40),v100,z10,tGripper\\WObj:=wtable; ! over it\n"
        .into());
    say("    MoveL p1,[100,500,5000,1000],fine,tGripper \\WObj:=wTable;\r\n".into());
    say("    FOR i FROM 1 TO 2 DO\r\n      MoveL path{i},v100,z1,tDevice\\WObj:=wobj0;\r\n    ENDFOR\r\n".into());
    say(format!("    MoveL {},v100,fine,tGripper\\WObj:=wTable;", target(3, &all[3])));
    text.extend(b"\r\n  ENDPROC\r\nENDMODULE");
    text
}

pub fn krl(model: &Model) -> Vec<u8> {
    let mut text = b"&ACCESS RVP\r\n&REL 1\r\nDEF weld( )\r\n;FOLD gr\xfc\xdfe {X 1,Y 2,Z 3,A 4,B 5,C 6}\r\n".to_vec();
    let six = |p: &Pose| {
        let [a, b, c] = angles_zyx(&p.rotation).map(f64::to_degrees);
        let [x, y, z] = mm(p);
        format!("X {x:.5},Y {y:.5},Z {z:.5},A {a:.7},B {b:.7},C {c:.7}")
    };
    let mut say = |s: String| text.extend(s.into_bytes());
    say(format!("TOOL_DATA[1]={{{}}}\n", six(&device())));
    say(format!("$TOOL = {{FRAME: {}}}\r\n", six(&gripper())));
    say(format!("BASE_DATA[7]={{{}}}\r\n", six(&table())));
    let all = joints([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]);
    let target = |k: usize| {
        let turn: u32 = all[k].iter().enumerate().map(|(i, q)| u32::from(*q < 0.0) << i).sum();
        format!("{{{},S 2,T {turn},E1 0.0,E2 0.0}}", six(&in_frame(model, &all[k], k)))
    };
    say(format!(
        "DECL E6POS XP0={}\r\nDECL FDAT FP0={{TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \"}}\n",
        target(0)
    ));
    say(format!("DECL GLOBAL POS XP1={}\n", target(1)));
    say("DECL E6AXIS XHOME={A1 5,A2 -80,A3 95.5,A4 3,A5 40,A6 -7,E1 0}\r\n".into());
    say("BAS(#BASE,7)\r\nPTP XHOME C_PTP\r\nLIN XP1 ; there\n".into());
    say("LIN_REL {Z 10}\r\nFDAT_ACT=FP0\r\nPTP XP0\r\n$TOOL=TOOL_DATA[ 1 ]\n$BASE=$NULLFRAME\r\n".into());
    say(format!("CIRC {},{} C_DIS\r\n", target(2), target(4)));
    say(format!(
        "$TOOL = {{FRAME: {}}}\r\n$BASE=BASE_DATA[7]\nSLIN {{E6POS: {}\r\nEND\r\n",
        six(&gripper()),
        &target(3)[1..]
    ));
    text
}

pub fn fanuc(model: &Model) -> (Vec<u8>, Frames) {
    let mut text = b"/PROG  PICK\r\n/ATTR\r\nCOMMENT = \"gr\xfc\xdfe\";\r\n/MN\r\n   1:  !P[9] ;\r\n   2:J P[5:home] 100% FINE    ;\r\n   3:L P[1] 100mm/sec FINE    ;\r\n   4:L P[2] 100mm/sec FINE Offset,PR[1] ;\r\n   5:L P[2] 10mm/sec FINE ;\r\n   6:C P[3]\n    :  P[4] 10mm/sec FINE ;\n/POS\r\n".to_vec();
    let all = joints([0.0, 0.0, 0.0, 0.0, -90.0, 0.0]);
    // the controller's world stands 330 mm above the foot
    let lifted = pose(0.0, 0.0, 330.0, 0.0, 0.0, 0.0);
    for (k, q) in all.iter().take(4).enumerate() {
        let mut p = in_frame(model, q, k);
        if k % 2 == 0 {
            p = lifted.inverse().compose(&p);
        }
        let [r, pitch, w] = angles_zyx(&p.rotation).map(f64::to_degrees);
        let [x, y, z] = mm(&p);
        let (uf, ut) = if k % 2 == 0 { (0, 1) } else { (3, 2) };
        text.extend(
            format!(
                "P[{}:\"p{k}\"]{{\r\n   GP1:\r\n\tUF : {uf}, UT : {ut},\t\tCONFIG : 'N U T, 0, 0, 0',\r\n\tX = {x:9.5}  mm,\tY = {y:9.5}  mm,\n\tZ = {z:9.5}  mm,\r\n\tW = {w:.6} deg,\tP = {pitch:.6} deg,\tR = {r:.6} deg\r\n}};\r\n",
                k + 1
            )
            .into_bytes(),
        );
    }
    text.extend(b"P[5:\"home\"]{\r\n   GP1:\r\n\tUF : 0, UT : 2,\r\n\tJ1= 5.000 deg,\tJ2= 10.000 deg,\tJ3= -20.000 deg,\r\n\tJ4= 3.000 deg,\tJ5= -60.000 deg,\tJ6= 10.000 deg\r\n};\r\n/END\r\n");
    let mut frames = Frames::default();
    let frame = |p: Pose| Ok(Frame::massless(p));
    frames.tools.insert("1".into(), frame(device()));
    frames.tools.insert("2".into(), frame(gripper()));
    // the table in the controller's world
    frames.frames.insert("3".into(), frame(lifted.inverse().compose(&table())));
    (text, frames)
}

pub fn urscript(model: &Model) -> Vec<u8> {
    let p6 = |p: &Pose| {
        let (t, v) = (p.translation, rotation_vector(&p.rotation));
        format!("p[{:.8}, {:.8}, {:.8}, {:.9}, {:.9}, {:.9}]", t.x, t.y, t.z, v.x, v.y, v.z)
    };
    let all = joints([0.0, -90.0, 70.0, -60.0, 20.0, 0.0]);
    let with = |tool: Pose, q: &[f64; 6]| p6(&flange(model, q).compose(&tool));
    let mut text = b"def pick():\n  # gr\xfc\xdfe p[1,2,3,4,5,6]\n".to_vec();
    text.extend(
        format!("  set_tcp({})\n  global home = [0.1, -1.5, 1.2, -1.0, 0.5, .3]\r\n", p6(&device())).into_bytes(),
    );
    text.extend(
        format!("  wp_1={}\n  movej(home, a=1.2)\n  movel(wp_1, a=1.2, v=0.25)\n", with(device(), &all[0]))
            .into_bytes(),
    );
    text.extend(
        format!("  movel(pose_trans(wp_1, p[0,0,-0.05,0,0,0]), a=1)\n  movel({}, a=1)\n", with(device(), &all[2]))
            .into_bytes(),
    );
    text.extend(
        format!(
            "  set_tcp({})\n  movep({}, r=0.01)\n  movej(get_inverse_kin({}), a=1)\nend\n",
            p6(&gripper()),
            with(gripper(), &all[1]),
            with(gripper(), &all[3])
        )
        .into_bytes(),
    );
    text
}

pub fn csv(model: &Model) -> (Vec<u8>, Frames) {
    let mut text = b"\xef\xbb\xbf# poses\r\nname, x_mm,y_mm,z_mm,qw,qx,qy,qz,tool,frame\r\n".to_vec();
    for (k, q) in joints([0.0; 6]).iter().enumerate() {
        let p = in_frame(model, q, k);
        let names = if k % 2 == 0 { "," } else { "grip, table" };
        text.extend(
            format!("p{k}, {} ,{},{names}{}", numbers(&mm(&p)), quaternion(&p), ["\n", "\r\n"][k % 2]).into_bytes(),
        );
        text.extend(b"# between\n\n");
    }
    let mut frames = Frames::default();
    frames.tools.insert("grip".into(), Ok(Frame::massless(gripper())));
    frames.frames.insert("table".into(), Ok(Frame::massless(table())));
    (text, frames)
}

/// All five, with the number of their targets.
pub fn programs() -> Vec<(Dialect, Vec<u8>, Frames, Model, usize)> {
    let (irb, kr6, lr, ur) = (nominal(IRB), nominal(KR6), nominal(LR), nominal(UR5E));
    let ((ls, ls_frames), (table, csv_frames)) = (fanuc(&lr), csv(&irb));
    vec![
        (Dialect::Rapid, rapid(&irb), Frames::default(), irb.clone(), 6),
        (Dialect::Krl, krl(&kr6), Frames::default(), kr6, 6),
        (Dialect::Fanuc, ls, ls_frames, lr, 5),
        (Dialect::UrScript, urscript(&ur), Frames::default(), ur, 5),
        (Dialect::Csv, table, csv_frames, irb, 5),
    ]
}
