//! Programs of every dialect, written here from joint values as a controller would teach them, compensated, read again as the
//! controller reads them, and driven on the arm of the full model.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use nalgebra::Vector3;
use proptest::prelude::*;
use trical_device::program::{Dialect, Frames, Options, ProgramError, Report, compensate};
use trical_model::pose::{angles_zyx, quaternion_from_rotation, rotation_vector, rotation_zyx};
use trical_model::{
    Basis, Cell, Forward, MAX_JOINTS, Model, Motion, Parameter, Pose, Robot, Shape, Site, State, Term, Tool, Variable,
};

const IRB: &str = include_str!("../../../cells/irb120/robot.toml");
const KR6: &str = include_str!("../../../robots/kr6_r700.toml");
const LR: &str = include_str!("../../../robots/lrmate_200id.toml");
const UR5E: &str = include_str!("../../../robots/ur5e.toml");

fn pose(x: f64, y: f64, z: f64, a: f64, b: f64, c: f64) -> Pose {
    Pose {
        rotation: rotation_zyx(a.to_radians(), b.to_radians(), c.to_radians()),
        translation: Vector3::new(x, y, z) * 1e-3,
    }
}

fn device() -> Pose {
    pose(18.0, -12.0, 118.0, 0.0, 0.0, 0.0)
}

fn gripper() -> Pose {
    pose(-20.0, 5.0, 140.0, 30.0, 20.0, -10.0)
}

fn table() -> Pose {
    pose(250.0, -100.0, 50.0, 20.0, 5.0, -3.0)
}

fn nominal(robot: &str) -> Model {
    let mut cell = Cell::bare();
    cell.world_from_base = pose(150.0, -330.0, -150.0, 90.0, 0.0, 0.0);
    cell.tool = Tool { tcp: device().translation, targets: vec![device().translation], mass: 1.7, ..cell.tool };
    Model::nominal(Robot::parse(robot, "robot.toml").unwrap(), cell)
}

/// Geometry, compliance where the masses are known, backlash, heat, base and tool.
fn real(nominal: &Model) -> Model {
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

fn options() -> Options {
    Options { temp_c: Some(32.0), details: true, model_name: "m.toml".into(), ..Options::default() }
}

fn run(text: &[u8], d: Dialect, nominal: &Model, model: &Model, frames: &Frames) -> (Vec<u8>, Report) {
    let mut out = Vec::new();
    let report = compensate(text, "p", d, nominal, model, frames, &options(), &mut out).unwrap();
    (out, report)
}

fn refused(text: &[u8], d: Dialect) -> String {
    let n = nominal(IRB);
    match compensate(text, "p", d, &n, &n, &Frames::default(), &options(), &mut Vec::new()) {
        Err(ProgramError::Input(e)) => e,
        other => panic!("{other:?}"),
    }
}

/// The line with the mark, taken away.
fn unmarked(text: &[u8]) -> Vec<u8> {
    let bom = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let is_mark = |l: &&[u8]| l.windows(21).any(|w| w == b"compensated by TriCal");
    let lines: Vec<&[u8]> = text[bom..].split_inclusive(|b| *b == b'\n').collect();
    assert_eq!(lines.iter().filter(|l| is_mark(l)).count(), 1);
    [&text[..bom], &lines.into_iter().filter(|l| !is_mark(l)).collect::<Vec<_>>().concat()].concat()
}

/// Where the flange of an arm is, in its foot, at joint values in deg.
fn flange(model: &Model, q_deg: &[f64]) -> Pose {
    let mut bare = Model::nominal(model.robot.clone(), Cell::bare());
    bare.cell.world_from_base = Pose::identity();
    let f = Forward::new(bare, vec![]).unwrap();
    let q: Vec<f64> = q_deg.iter().map(|q| q.to_radians()).collect();
    f.world_from_flange(&State::at(&q), &mut f.workspace())
}

/// Joint values of five targets that suit all arms here, by signs and zeros of the arm.
fn joints(zero: [f64; 6]) -> Vec<[f64; 6]> {
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

fn quadrant(q: f64) -> i32 {
    (q / 90.0).floor() as i32
}

/// Even targets with the device in the base, odd ones with the gripper on the table.
fn in_frame(model: &Model, q: &[f64; 6], k: usize) -> Pose {
    let base_from_flange = flange(model, q);
    if k.is_multiple_of(2) {
        base_from_flange.compose(&device())
    } else {
        table().inverse().compose(&base_from_flange).compose(&gripper())
    }
}

fn numbers(v: &[f64]) -> String {
    v.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(",")
}

fn quaternion(p: &Pose) -> String {
    quaternion_from_rotation(&p.rotation).map(|x| format!("{x:.9}")).join(",")
}

fn mm(p: &Pose) -> [f64; 3] {
    [p.translation.x, p.translation.y, p.translation.z].map(|x| x * 1e3)
}

fn rapid(model: &Model) -> Vec<u8> {
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

fn krl(model: &Model) -> Vec<u8> {
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

fn fanuc(model: &Model) -> (Vec<u8>, Frames) {
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
    let tool = |p: Pose| Ok(trical_device::program::ToolFrame::massless(p));
    frames.tools.insert("1".into(), tool(device()));
    frames.tools.insert("2".into(), tool(gripper()));
    // the table in the controller's world
    frames.frames.insert("3".into(), Ok(lifted.inverse().compose(&table())));
    (text, frames)
}

fn urscript(model: &Model) -> Vec<u8> {
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

fn csv(model: &Model) -> (Vec<u8>, Frames) {
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
    frames.tools.insert("grip".into(), Ok(trical_device::program::ToolFrame::massless(gripper())));
    frames.frames.insert("table".into(), Ok(table()));
    (text, frames)
}

/// All five, with the number of their targets.
fn programs() -> Vec<(Dialect, Vec<u8>, Frames, Model, usize)> {
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

#[test]
fn an_identity_model_changes_no_byte() {
    for (d, text, frames, nominal, targets) in programs() {
        let (out, report) = run(&text, d, &nominal, &nominal, &frames);
        assert!(report.problems.is_empty(), "{d:?}: {:?}", report.problems);
        assert_eq!(report.rewritten, targets, "{d:?}");
        assert_eq!(String::from_utf8_lossy(&unmarked(&out)), String::from_utf8_lossy(&text), "{d:?}");
        assert!(unmarked(&out) == text, "{d:?}");
        assert!(report.largest_move < 1e-9);
    }
}

#[test]
fn the_arm_of_the_full_model_goes_where_each_program_says() {
    for (d, text, frames, nominal, targets) in programs() {
        let real = real(&nominal);
        let (out, report) = run(&text, d, &nominal, &real, &frames);
        assert!(report.problems.is_empty(), "{d:?}: {:?}", report.problems);
        assert_eq!(report.rewritten, targets);
        assert!(report.before[0] > 0.4e-3 && report.after[1] < 0.5e-6, "{d:?}: {:?} {:?}", report.before, report.after);
        // as the controller reads the two files
        let (_, was) = run(&text, d, &nominal, &nominal, &frames);
        let (_, again) = run(&unmarked(&out), d, &nominal, &nominal, &frames);
        assert!(again.problems.is_empty(), "{d:?}: {:?}", again.problems);
        for ((was, again), row) in was.rows.iter().zip(&again.rows).zip(&report.rows) {
            for (a, b) in again.joints.iter().zip(&row.joints) {
                assert!((a - b).abs() < 1e-6, "{d:?} {}: {:?} {:?}", row.name, again.joints, row.joints);
            }
            assert!((was.wanted.translation - row.wanted.translation).norm() < 1e-12);
        }
        // only numbers changed
        let rest = |t: &[u8]| -> Vec<u8> {
            t.iter().copied().filter(|b| !b.is_ascii_digit() && !matches!(b, b'.' | b'-' | b'+' | b' ')).collect()
        };
        assert_eq!(rest(&unmarked(&out)), rest(&text), "{d:?}");
        assert_ne!(unmarked(&out), text);
    }
}

/// The joints to which the controller is sent are driven on an arm that is put together here: senses from the path, tool and
/// frame by hand.
#[test]
fn frames_senses_and_heat_are_those_of_the_program() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    let (_, report) = run(&rapid(&nominal), Dialect::Rapid, &nominal, &real, &Frames::default());
    let all = joints([0.0; 6]);
    // in the order of the file: p0, P1, path{1}, path{2}, jHome, inline
    let taught = [0, 1, 2, 4, 9, 3];
    // driven: home, p0, over P1, P1, path{1}, path{2}, inline
    let world_from_base = nominal.cell.world_from_base;
    for (row, k) in report.rows.iter().zip(taught) {
        if k == 9 {
            continue;
        }
        let wanted = world_from_base.compose(&flange(&nominal, &all[k])).compose(&if k.is_multiple_of(2) {
            device()
        } else {
            gripper()
        });
        assert!((row.wanted.translation - wanted.translation).norm() < 2e-8, "{k}");
        let mut arm = real.clone();
        if !k.is_multiple_of(2) {
            arm.cell.tool =
                Tool { tcp: gripper().translation, rotation: gripper().rotation, mass: 0.5, ..arm.cell.tool };
            arm.terms.retain(|t| !matches!(t.site, Site::Tool(_)));
        }
        let arm = Forward::new(arm, vec![]).unwrap();
        let mut ws = arm.workspace();
        let best = [-1, 1]
            .iter()
            .flat_map(|a| [-1, 1].map(|b| (*a, b)))
            .map(|(two, three)| {
                let mut dir = [0; MAX_JOINTS];
                (dir[1], dir[2]) = (two, three);
                let state = State { dir: Some(dir), temp_c: Some(32.0), ..State::at(&row.joints) };
                ((arm.world_from_tool(&state, &mut ws).translation - wanted.translation).norm(), two, three)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        assert!(best.0 < 3e-7, "{k}: {best:?}");
        // joints 2 and 3 from home (20, 10) to p0 (12, -8); p0 to path is by P1 (20, 5)
        let senses = match k {
            0 => (-1, -1),
            2 => (-1, 1),
            4 => (1, -1),
            _ => continue,
        };
        assert_eq!((best.1, best.2), senses, "{k}");
    }
}

#[test]
fn senses_matter_and_unknown_ones_are_zero() {
    let nominal = nominal(IRB);
    let real = real(&nominal);
    let text = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,10,5,60,-7\n10,30,10,5,60,-7\n10,20,10,5,60,-7\n";
    let (out, _) = run(text, Dialect::Csv, &nominal, &real, &Frames::default());
    let lines: Vec<String> = String::from_utf8(unmarked(&out)).unwrap().lines().map(str::to_owned).collect();
    // the first is approached from nowhere, the third downwards: half the gap apart
    let q2 = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
    assert!((q2(&lines[3]) - q2(&lines[1]) - 0.4e-3_f64.to_degrees()).abs() < 2e-4, "{lines:?}");
}

#[test]
fn twice_is_refused_and_so_is_what_is_no_program() {
    for (d, text, frames, nominal, _) in programs() {
        let (out, _) = run(&text, d, &nominal, &nominal, &frames);
        assert!(refused(&out, d).contains("compensated already"), "{d:?}");
        assert!(refused(b"nothing here\n", d).contains("expected"), "{d:?}");
        assert!(refused(b"\xff\xfea\0b\0", d).contains("UTF-16"), "{d:?}");
    }
}

const TARGET: &str = "[[350,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

fn problems(body: &str) -> Vec<String> {
    let n = nominal(IRB);
    let mut out = Vec::new();
    let options = Options { configuration_off: true, ..options() };
    let text = body.replace("TARGET", TARGET);
    let report =
        compensate(text.as_bytes(), "p", Dialect::Rapid, &n, &n, &Frames::default(), &options, &mut out).unwrap();
    report.problems.iter().map(ToString::to_string).collect()
}

#[test]
fn what_cannot_be_right_is_listed_with_line_and_name() {
    let one = |body: &str, words: &[&str]| {
        let found = problems(body);
        assert_eq!(found.len(), 1, "{body}: {found:?}");
        for w in words {
            assert!(found[0].contains(w), "'{w}' is missing in {found:?}");
        }
    };
    let declare = "\nCONST robtarget p:=TARGET;\n";
    one(&format!("{declare}MoveL p,v1,fine,tOther;"), &["line 2 (p)", "'tother'", "--frames"]);
    one(&format!("{declare}MoveL p,v1,fine,tool0\\WObj:=w;"), &["'w'", "--frames"]);
    one(
        &format!(
            "{declare}MoveL p,v1,fine,tool0;PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];MoveL p,v1,fine,t;"
        ),
        &["tool 'tool0' in 'wobj0'", "tool 't'"],
    );
    one(
        &format!(
            "{declare}PERS tooldata t:=[FALSE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];MoveL p,v1,fine,t;"
        ),
        &["robhold"],
    );
    one(
        &format!(
            "{declare}PERS wobjdata w:=[TRUE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];MoveL p,v1,fine,tool0\\WObj:=w;"
        ),
        &["robhold"],
    );
    one("CONST robtarget p:=[[3500,50,320],[0,0.6,0.8,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", &["out of reach"]);
    one("CONST robtarget p:=[[350,50,320],[0,0.6,0.9,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", &["quaternion"]);
    one("CONST jointtarget p:=[[0,0,0,0,150,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", &["limits"]);
}

#[test]
fn a_singular_target_is_listed_and_a_wrong_configuration_too() {
    let n = nominal(IRB);
    let real = real(&n);
    let text = b"CONST jointtarget j:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];";
    let (out, report) = run(text, Dialect::Rapid, &n, &real, &Frames::default());
    assert!(report.problems[0].what.contains("singular"), "{:?}", report.problems);
    assert_eq!(unmarked(&out), text);
    let text = format!("CONST robtarget p:={};", TARGET.replace("[0,0,0,0],[9", "[1,0,0,0],[9"));
    let (_, report) = run(text.as_bytes(), Dialect::Rapid, &n, &real, &Frames::default());
    assert!(report.problems[0].what.contains("[1,0,0,0]"), "{:?}", report.problems);
}

#[test]
fn the_configuration_in_the_text_chooses_the_branch() {
    let n = nominal(IRB);
    // the same pose with the wrist flipped: joint 4 half a turn on, joint 5 negative, joint 6 half a turn back
    for q in [[10.0, 12.0, -8.0, 20.0, 40.0, -30.0], [10.0, 12.0, -8.0, -160.0, -40.0, 150.0]] {
        let p = flange(&n, &q).compose(&device());
        let text = format!(
            "CONST robtarget p:=[[{}],[{}],[{},{},{},{}],[9E9,9E9,9E9,9E9,9E9,9E9]];",
            numbers(&mm(&p)),
            quaternion(&p),
            quadrant(q[0]),
            quadrant(q[3]),
            quadrant(q[5]),
            i32::from(q[4] < 0.0)
        );
        let (_, report) = run(text.as_bytes(), Dialect::Rapid, &n, &n, &Frames::default());
        for (a, b) in report.rows[0].joints.iter().zip(q) {
            assert!((a.to_degrees() - b).abs() < 1e-3, "{:?} {q:?}", report.rows[0].joints);
        }
    }
}

#[test]
fn a_quadrant_that_the_correction_crosses_is_rewritten() {
    let n = nominal(IRB);
    let real = real(&n);
    let q = [0.0, 20.0, 5.0, 0.0, 45.0, 0.0];
    let p = flange(&n, &q).compose(&device());
    let text = format!(
        "CONST robtarget p:=[[{}],[{}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
        numbers(&mm(&p)),
        quaternion(&p)
    );
    let (out, report) = run(text.as_bytes(), Dialect::Rapid, &n, &real, &Frames::default());
    let j = report.rows[0].joints;
    let cf = [j[0], j[3], j[5]].map(|q| quadrant(q.to_degrees()));
    assert!(cf != [0, 0, 0], "{j:?}");
    let text = String::from_utf8(out).unwrap();
    assert!(text.contains(&format!("[{},{},{},0]", cf[0], cf[1], cf[2])), "{text} {j:?}");
}

#[test]
fn targets_that_no_motion_names_need_a_tool_where_there_are_several() {
    let tools = "PERS tooldata t:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nCONST robtarget a:=TARGET;\nCONST robtarget b:=TARGET;\nCONST robtarget c:=TARGET;\nMoveL a,v1,fine,t;\n";
    assert!(problems(tools).is_empty());
    let found = problems(&format!("{tools}MoveL b,v1,fine,tool0;"));
    assert!(found.len() == 1 && found[0].contains("line 4 (c)") && found[0].contains("--tool"), "{found:?}");
}

#[test]
fn a_model_that_needs_a_temperature_asks_for_it() {
    let n = nominal(IRB);
    let options = Options::default();
    let e = compensate(b"q1_deg\n1\n", "p", Dialect::Csv, &n, &real(&n), &Frames::default(), &options, &mut Vec::new());
    assert!(e.unwrap_err().to_string().contains("--temp-c"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    /// Bytes changed, taken out, doubled: a report or a sentence, never a panic, and what is kept is kept.
    #[test]
    fn damaged_programs_never_panic(which in 0usize..5, cuts in proptest::collection::vec((any::<prop::sample::Index>(), 0u8..5, any::<u8>()), 1..12)) {
        let (d, mut text, frames, nominal, _) = programs().swap_remove(which);
        for (at, kind, byte) in cuts {
            let k = at.index(text.len());
            match kind {
                0 => text[k] = byte,
                1 => { text.remove(k); }
                2 => text.insert(k, b"[]{},;:\"'!\\(=pP"[usize::from(byte) % 15]),
                3 => text.truncate(k.max(text.len() / 2)),
                _ => { let end = (k + usize::from(byte)).min(text.len()); text.drain(k..end); }
            }
            if text.is_empty() { text.push(b'x'); }
        }
        let mut out = Vec::new();
        if compensate(&text, "p", d, &nominal, &nominal, &frames, &options(), &mut out).is_ok() {
            prop_assert!(out.len() >= text.len());
        }
    }

    #[test]
    fn random_bytes_never_panic(which in 0usize..5, text in "[\\[\\]{}(),;:=!#pPXYZABCEMoveL0-9. \n&\"'/\\\\]{0,400}") {
        let d = Dialect::ALL[which];
        let n = nominal(IRB);
        let _ = compensate(text.as_bytes(), "p", d, &n, &n, &Frames::default(), &options(), &mut Vec::new());
    }
}
