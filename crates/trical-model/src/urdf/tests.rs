//! Arms drawn at random, written as URDF and read back; and URDFs that must be refused.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fmt::Write;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::{in_utf8, parse};
use crate::cell::Cell;
use crate::forward::{Forward, Model};
use crate::pose::{Pose, rotation_zyx};
use crate::recording::State;
use crate::robot::{JointKind, Robot};

type V3 = Vector3<f64>;

const CELL: &str = "[base]\nxyz_mm = [0.0, 0.0, 0.0]\nzyx_deg = [0.0, 0.0, 0.0]\n[tool]\ntcp_mm = [0.0, 0.0, 0.0]\n";

struct Step {
    kind: &'static str,
    xyz: V3,
    rpy: V3,
    axis: V3,
    mass: f64,
    cog: V3,
}

/// A chain as the test knows it, and its text.
struct Chain {
    steps: Vec<Step>,
    text: String,
}

fn three(v: &V3) -> String {
    format!("{:e} {:e} {:e}", v.x, v.y, v.z)
}

impl Chain {
    fn of(steps: Vec<Step>) -> Self {
        let mut text = String::from("<?xml version='1.0'?>\n<robot name='drawn'>\n<link name='l0'/>\n");
        for (k, s) in steps.iter().enumerate() {
            let (name, parent) = (format!("l{}", k + 1), format!("l{k}"));
            writeln!(
                text,
                "<link name='{name}'><inertial><origin xyz='{}'/><mass value='{:e}'/></inertial></link>",
                three(&s.cog),
                s.mass
            )
            .unwrap();
            writeln!(
                text,
                "<joint name='j{k}' type='{}'><parent link='{parent}'/><child link='{name}'/><origin xyz='{}' rpy='{}'/>\
                 <axis xyz='{}'/><limit lower='-2' upper='2'/></joint>",
                s.kind,
                three(&s.xyz),
                three(&s.rpy),
                three(&s.axis)
            )
            .unwrap();
        }
        text.push_str("</robot>\n");
        Self { steps, text }
    }

    /// Pose of the last link, and height of the centre of gravity of all times their mass, the plain way.
    fn at(&self, q: &[f64]) -> (Pose, V3) {
        let (mut pose, mut moment, mut q) = (Pose::identity(), V3::zeros(), q.iter());
        for s in &self.steps {
            pose = pose.compose(&Pose { rotation: rotation_zyx(s.rpy.z, s.rpy.y, s.rpy.x), translation: s.xyz });
            let axis = s.axis.normalize();
            match s.kind {
                "fixed" => {}
                "prismatic" => pose.translation += pose.rotation * axis * *q.next().unwrap(),
                _ => {
                    let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), *q.next().unwrap());
                    pose.rotation *= turn.matrix();
                }
            }
            moment += pose.apply(&s.cog) * s.mass;
        }
        (pose, moment)
    }

    fn moving(&self) -> usize {
        self.steps.iter().filter(|s| s.kind != "fixed").count()
    }
}

struct Draw(StdRng);

impl Draw {
    fn n(&mut self, s: f64) -> f64 {
        self.0.random_range(-s..s)
    }
    fn v(&mut self, s: f64) -> V3 {
        V3::new(self.n(s), self.n(s), self.n(s))
    }
    fn one_of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.0.random_range(0..list.len())]
    }

    /// Chains with all that arms do: axes parallel, antiparallel, nearly so, intersecting, the same; turned by right angles.
    fn chain(&mut self) -> Chain {
        use std::f64::consts::{FRAC_PI_2, PI};
        let n = self.0.random_range(1..10);
        let mut steps = Vec::new();
        while steps.iter().filter(|s: &&Step| s.kind != "fixed").count() < n {
            let kind = self.one_of(&["revolute", "revolute", "continuous", "prismatic", "fixed"]);
            let nearly = [1e-2, 1e-3, 3e-4, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15][self.0.random_range(0..9)];
            let rpy = match self.0.random_range(0..6) {
                0 => self.v(3.0),
                1 => V3::new(self.one_of(&[0.0, FRAC_PI_2, -FRAC_PI_2, PI]), 0.0, self.one_of(&[0.0, FRAC_PI_2, PI])),
                // as files that were typed by hand have it: 1.5708, 3.1416
                2 => {
                    let typed = |x: f64| (x * 1e4).round() / 1e4;
                    V3::new(typed(FRAC_PI_2), 0.0, self.one_of(&[0.0, typed(FRAC_PI_2), typed(PI)]))
                }
                3 => self.v(nearly),
                4 => V3::new(PI, 0.0, 0.0) + self.v(nearly),
                _ => V3::zeros(),
            };
            let xyz = match self.0.random_range(0..4) {
                0 => V3::zeros(),
                1 => V3::new(0.0, 0.0, self.n(0.5)),
                2 => V3::new(self.n(0.5), 0.0, 0.0),
                _ => self.v(0.5),
            };
            let axis = match self.0.random_range(0..6) {
                0 => self.v(1.0),
                1 => V3::x(),
                2 => -V3::y(),
                3 => -V3::z(),
                _ => V3::z(),
            };
            steps.push(Step { kind, xyz, rpy, axis, mass: 1.0 + self.n(0.9), cog: self.v(0.2) });
        }
        for _ in 0..self.0.random_range(0..3) {
            steps.push(Step {
                kind: "fixed",
                xyz: self.v(0.2),
                rpy: self.v(3.0),
                axis: V3::x(),
                mass: 0.3,
                cog: self.v(0.1),
            });
        }
        Chain::of(steps)
    }
}

fn check(chain: &Chain, robot: &Robot, draw: &mut Draw, tolerance: f64) {
    let cell = Cell::parse(CELL, "cell.toml").unwrap();
    let forward = Forward::new(Model::nominal(robot.clone(), cell), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let n = chain.moving();
    for _ in 0..5 {
        let q: Vec<f64> = (0..n).map(|_| draw.n(2.0)).collect();
        let (pose, _) = chain.at(&q);
        let found = forward.world_from_tool(&State::at(&q), &mut ws);
        let off = (found.translation - pose.translation).amax().max((found.rotation - pose.rotation).amax());
        assert!(off < tolerance, "{off:e}\n{}", chain.text);
        let tau = forward.gravity_torques(&State::at(&q), &mut ws).unwrap();
        for k in 0..n {
            let h = 1e-4;
            let height = |h: f64| {
                let mut q = q.clone();
                q[k] += h;
                chain.at(&q).1.z
            };
            let slope = (8.0 * (height(h) - height(-h)) - height(2.0 * h) + height(-2.0 * h)) / (12.0 * h);
            let wanted = -slope * crate::forward::GRAVITY;
            assert!((tau[k] - wanted).abs() < 1e-8, "torque {} instead of {wanted}", tau[k]);
        }
    }
}

#[test]
fn a_file_in_the_encoding_that_it_declares_is_read_as_utf_8() {
    let latin = |encoding: &str| {
        let text = format!("<?xml version='1.0' encoding='{encoding}'?>\n<robot name='Gr");
        in_utf8([text.as_bytes(), b"\xf6\xdfe'/>"].concat())
    };
    let read = latin("ISO-8859-1").unwrap();
    assert_eq!(read, "<?xml version='1.0' encoding='UTF-8'?>\n<robot name='Gr\u{f6}\u{df}e'/>");
    assert_eq!(in_utf8(read.clone().into_bytes()), Some(read));
    // another encoding has other letters
    assert_eq!((latin("ISO-8859-15"), latin("windows-1250")), (None, None));
    assert_eq!(in_utf8(b"<robot name='\xf6'/>".to_vec()), None);
}

#[test]
fn any_chain_keeps_its_flange_poses_and_its_weight() {
    let mut draw = Draw(StdRng::seed_from_u64(1));
    for _ in 0..3000 {
        let chain = draw.chain();
        let robot = parse(&chain.text, "drawn.urdf", None, None).unwrap().robot;
        assert_eq!(robot.dof(), chain.moving());
        check(&chain, &robot, &mut draw, 2e-11);
        // through robot.toml: degrees and millimetres cost a few units in the last place
        let again = Robot::parse(&robot.to_toml(), "robot.toml").unwrap();
        check(&chain, &again, &mut draw, 2e-11);
    }
}

#[test]
fn no_frame_stands_far_away_whatever_the_angle_between_axes() {
    let mut draw = Draw(StdRng::seed_from_u64(2));
    for _ in 0..20_000 {
        let chain = draw.chain();
        let robot = parse(&chain.text, "drawn.urdf", None, None).unwrap().robot;
        let length: f64 = chain.steps.iter().map(|s| s.xyz.norm()).sum::<f64>().max(1e-3);
        let mut pose = robot.root_from_zero;
        let mut own = chain.steps.iter();
        let mut urdf = Pose::identity();
        for j in &robot.joints {
            let r = crate::pose::rotation_x(j.alpha) * crate::pose::rotation_y(j.beta);
            pose = pose.compose(&Pose {
                rotation: r * crate::pose::rotation_z(j.theta_offset),
                translation: V3::new(j.a, 0.0, 0.0) + r * V3::new(0.0, 0.0, j.d),
            });
            for s in own.by_ref() {
                urdf = urdf.compose(&Pose { rotation: rotation_zyx(s.rpy.z, s.rpy.y, s.rpy.x), translation: s.xyz });
                if s.kind != "fixed" {
                    break;
                }
            }
            let far = (pose.translation - urdf.translation).norm();
            assert!(far < 3.0 * length, "{far} m, and the arm has {length} m\n{}", chain.text);
        }
    }
}

#[test]
fn a_familiar_arm_gets_its_familiar_table() {
    // the IRB 120 as URDFs of industrial arms are written: all origins parallel, axes by name
    let j = |name: &str, parent: &str, xyz: &str, axis: &str| {
        format!(
            "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{name}_link'/><origin xyz='{xyz}'/>\
             <axis xyz='{axis}'/><limit lower='-3' upper='3'/></joint><link name='{name}_link'/>"
        )
    };
    let text = format!(
        "<robot name='irb'><link name='base'/>{}{}{}{}{}{}\
         <joint name='flange' type='fixed'><parent link='f_link'/><child link='tool0'/><origin xyz='0.072 0 0' rpy='0 1.5707963267948966 0'/></joint>\
         <link name='tool0'/></robot>",
        j("a", "base", "0 0 0.290", "0 0 1"),
        j("b", "a_link", "0 0 0", "0 1 0"),
        j("c", "b_link", "0 0 0.270", "0 1 0"),
        j("d", "c_link", "0 0 0.070", "1 0 0"),
        j("e", "d_link", "0.302 0 0", "0 1 0"),
        j("f", "e_link", "0 0 0", "1 0 0"),
    );
    let robot = parse(&text, "irb.urdf", None, None).unwrap().robot;
    let table: Vec<[f64; 4]> = robot
        .joints
        .iter()
        .map(|j| {
            [j.alpha.to_degrees(), j.a * 1e3, j.d * 1e3, j.theta_offset.to_degrees()].map(|x| (x * 1e6).round() / 1e6)
        })
        .collect();
    let expected = [
        [0.0, 0.0, 290.0, 0.0],
        [-90.0, 0.0, 0.0, -90.0],
        [0.0, 270.0, 0.0, 0.0],
        [-90.0, 70.0, 302.0, 0.0],
        [90.0, 0.0, 0.0, 0.0],
        [-90.0, 0.0, 72.0, 180.0],
    ];
    assert_eq!(table, expected);
    assert_eq!(robot.root_from_zero, Pose::identity());
    assert!((robot.last_from_flange.rotation - Matrix3::identity()).amax() < 1e-15);
    assert!(robot.joints.iter().all(|j| j.mass.is_none() && j.beta == 0.0 && j.kind == JointKind::Revolute));
}

/// Two joints, to be broken in many ways.
const GOOD: &str = "<robot name='r'>
<link name='a'/>
<link name='b'><inertial><mass value='2'/><origin xyz='0 0 0.1'/></inertial></link>
<link name='c'/>
<joint name='j1' type='revolute'>
 <parent link='a'/><child link='b'/><origin xyz='0 0 0.3' rpy='0 0 0'/><axis xyz='0 0 1'/>
 <limit lower='-1' upper='1'/>
</joint>
<joint name='j2' type='prismatic'>
 <parent link='b'/><child link='c'/><origin xyz='0 0 0.3'/><axis xyz='1 0 0'/>
 <limit lower='-0.1' upper='0.2'/>
</joint>
</robot>
";

fn refused(text: &str, root: Option<&str>, tip: Option<&str>) -> String {
    let e = parse(text, "r.urdf", root, tip).expect_err("refused").to_string();
    assert!(e.starts_with("r.urdf") && !e.contains('\n'), "{e}");
    e
}

/// Fixed joints with an axis of no length (Kinova, Sawyer, TIAGo), and joints of a gripper with odd limits: nothing of the arm needs them.
#[test]
fn only_what_the_chain_needs_may_refuse() {
    let odd = "<link name='d'/><link name='f'/>
<joint name='mount' type='fixed'><parent link='c'/><child link='d'/><axis xyz='0 0 0'/></joint>
<joint name='finger' type='revolute'><parent link='d'/><child link='f'/><axis xyz='0 0 0'/><limit lower='none' upper='2'/></joint>
</robot>";
    let text = GOOD.replacen("</robot>", odd, 1);
    let [whole, part] =
        [(GOOD, None), (&text[..], Some("d"))].map(|(text, tip)| parse(text, "r.urdf", None, tip).unwrap());
    assert_eq!(whole.robot, part.robot);
    // where the finger moves the chain it is needed
    let e = refused(&text, None, Some("f"));
    assert!(e.contains("finger") && e.contains("no length"), "{e}");
}

#[test]
fn limits_of_kilometres_are_those_that_a_robot_file_may_have() {
    let text = r#"<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="prismatic"><parent link="a"/><child link="b"/>
        <axis xyz="0 0 1"/><limit lower="0" upper="5000" effort="1" velocity="1"/></joint></robot>"#;
    let robot = parse(text, "r.urdf", None, None).unwrap().robot;
    let again = Robot::parse(&robot.to_toml(), "robot.toml").unwrap().joints[0].limits;
    assert!(again[0] == 0.0 && (again[1] - 1000.0).abs() < 1e-6, "{again:?}");
}

#[test]
fn limits_of_joints_that_have_none_in_sdf_are_a_turn_to_either_side() {
    let text = r#"<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
        <axis xyz="0 0 1"/><limit lower="-1e+16" upper="1e+16" effort="-1" velocity="-1"/></joint></robot>"#;
    let limits = parse(text, "r.urdf", None, None).unwrap().robot.joints[0].limits;
    assert_eq!(limits, [-std::f64::consts::TAU, std::f64::consts::TAU]);
    let e = refused(&text.replace("-1e+16", "-1e+17"), None, None);
    assert!(e.contains("<limit> lower: found '-1e+17', expected a number between"), "{e}");
}

/// An arm with a camera and a tool: the end that is proposed is the tool.
#[test]
fn of_several_ends_the_likeliest_is_proposed() {
    let more = "<link name='camera'/><link name='tool0'/>
<joint name='j3' type='fixed'><parent link='c'/><child link='camera'/></joint>
<joint name='j4' type='fixed'><parent link='c'/><child link='tool0'/></joint>
</robot>";
    let e = refused(&GOOD.replacen("</robot>", more, 1), None, None);
    assert!(e.contains("camera, tool0") && e.ends_with(":tool0"), "{e}");
}

#[test]
fn every_broken_urdf_gets_a_sentence_of_its_own() {
    assert!(parse(GOOD, "r.urdf", None, None).is_ok());
    let cases: &[(&str, &str, &[&str])] = &[
        ("<child link='c'/>", "<child link='a'/>", &["closed loop"]),
        (
            "<parent link='b'/><child link='c'/>",
            "<parent link='a'/><child link='b'/>",
            &["line 9", "'b'", "'j1'", "'j2'", "closes"],
        ),
        ("<child link='c'/>", "<child link='d'/>", &["line 9", "child link 'd' is not in the file"]),
        ("<child link='c'/>", "", &["line 9", "j2", "<child> is missing"]),
        ("<link name='c'/>", "<link name='c'/><link name='d'/>", &["line 4", "'d'", "hangs in the air"]),
        ("<link name='c'/>", "<link name='b'/>", &["line 4", "'b'", "twice", "line 3"]),
        ("<joint name='j2'", "<joint name='j1'", &["line 9", "joint 'j1'", "twice", "line 5"]),
        (" <limit lower='-1' upper='1'/>\n", "", &["line 5", "j1", "<limit> is missing"]),
        ("lower='-1' upper='1'", "upper='1'", &["line 7", "j1", "no lower"]),
        ("lower='-1' upper='1'", "lower='1' upper='1'", &["line 7", "j1", "lower 1 and upper 1"]),
        ("xyz='0 0 0.3' rpy", "xyz='0 nan 0.3' rpy", &["line 6", "j1", "'nan'"]),
        ("xyz='0 0 0.3' rpy", "xyz='0 300 0.3' rpy", &["line 6", "j1", "'300'", "100 m"]),
        ("rpy='0 0 0'", "rpy='0 30 0'", &["line 6", "j1", "rpy: found '30'", "12.6 rad"]),
        ("xyz='0 0 0.3' rpy", "xyz='0 0.3' rpy", &["line 6", "j1", "'0 0.3'", "three numbers"]),
        ("<axis xyz='0 0 1'/>", "<axis xyz='0 0 0'/>", &["line 6", "j1", "no length"]),
        ("type='prismatic'", "type='floating'", &["line 9", "j2", "floating"]),
        ("type='prismatic'", "type='planar'", &["line 9", "j2", "planar"]),
        ("type='prismatic'", "type='screw'", &["line 9", "j2", "'screw'"]),
        ("<mass value='2'/>", "<mass value='-2'/>", &["line 3", "link 'b'", "-2"]),
        ("<mass value='2'/>", "<mass value='inf'/>", &["line 3", "link 'b'", "inf"]),
        ("<axis xyz='1 0 0'/>", "<axis xyz='1 0 0'/><mimic joint='j1'/>", &["line 9", "mimics joint 'j1'"]),
        ("<robot name='r'>", "<robot name='r'><xacro:include filename='x'/>", &["line 1", "xacro"]),
        ("<robot name='r'>", "<!DOCTYPE r [<!ENTITY a 'b'>]><robot name='r'>", &["line 1", "DOCTYPE"]),
        ("<robot name='r'>", "<sdf name='r'>", &["line 1", "<sdf>"]),
        ("</joint>\n</robot>", "</robot>", &["line 12", "well-formed"]),
        ("</robot>", "", &["ends within <robot>"]),
    ];
    let mut seen = std::collections::BTreeSet::new();
    for (from, to, words) in cases {
        let text = GOOD.replacen(from, to, 1);
        assert_ne!(text, GOOD, "{from}");
        let e = refused(&text, None, None);
        for w in *words {
            assert!(e.contains(w), "'{w}' is missing in: {e}");
        }
        assert!(seen.insert(e.clone()), "said twice: {e}");
    }
    assert!(refused("", None, None).contains("no <robot>"));
    assert!(refused("<robot name='r'/>", None, None).contains("no <link>"));
    assert!(refused("<robot><link name='a'/></robot>", None, None).contains("no joint moves"));
    assert!(refused("name = 'arm'", None, None).contains("no <robot>"));
    let e = refused(GOOD, Some("x"), None);
    assert!(e.contains("'x'") && e.contains("no such link") && e.contains("a, b, c"), "{e}");
    assert!(refused(GOOD, Some("c"), Some("a")).contains("does not descend"));
    assert!(refused(GOOD, Some("a"), Some("a")).contains("no joint moves between"));
    let branch = GOOD.replace(
        "</robot>",
        "<link name='d'/><joint name='j3' type='continuous'><parent link='b'/><child link='d'/></joint></robot>",
    );
    let e = refused(&branch, None, None);
    assert!(e.contains("several ends, c, d") && e.contains("r.urdf#a:c"), "{e}");
    assert_eq!(parse(&branch, "r.urdf", None, Some("d")).unwrap().robot.joint_names, ["j1", "j3"]);
    // a gripper's finger has one joint more than the flange, and is none
    let finger = "<link name='left_finger'/><joint name='f' type='prismatic'><parent link='d'/><child link='left_finger'/>\
                  <limit lower='0' upper='0.04'/></joint></robot>";
    let e = refused(&branch.replace("</robot>", finger), None, None);
    assert!(e.contains("several ends, c, left_finger") && e.contains("r.urdf#a:c"), "{e}");
    // a hand with two fingers at the arm's end: the hand, where they part
    let hand_of = |names: [&str; 2]| {
        let links = names.map(|n| {
            format!(
                "<link name='{n}'/><joint name='j_{n}' type='prismatic'><parent link='c'/><child link='{n}'/>\
                 <limit lower='0' upper='0.04'/></joint>"
            )
        });
        format!("{}</robot>", links.concat())
    };
    let hand = |names| refused(&GOOD.replace("</robot>", &hand_of(names)), None, None);
    let e = hand(["left_finger", "right_finger"]);
    assert!(e.contains("several ends, left_finger, right_finger") && e.contains("r.urdf#a:c"), "{e}");
    // and a ball that somebody put at the same place goes before it
    let ball = "<link name='ball'/><joint name='j' type='fixed'><parent link='c'/><child link='ball'/></joint></robot>";
    let fingers = GOOD.replace("</robot>", &hand_of(["left_finger", "right_finger"]));
    let e = refused(&fingers.replace("</robot>", ball), None, None);
    assert!(e.contains("r.urdf#a:ball"), "{e}");
    // of a whole arm with two grippers' joints of any names at its end: the link that carries both
    let link = |k: usize| {
        format!(
            "<link name='l{k}'/><joint name='j{k}' type='continuous'><parent link='{}'/><child link='l{k}'/></joint>",
            if k == 4 { "c".to_owned() } else { format!("l{}", k - 1) }
        )
    };
    let arm = GOOD.replace("</robot>", &format!("{}</robot>", (4..=7).map(link).collect::<String>()));
    let two = hand_of(["f1", "f2"]).replace("parent link='c'", "parent link='l7'");
    let e = refused(&arm.replace("</robot>", &two), None, None);
    assert!(e.contains("several ends, f1, f2") && e.contains("r.urdf#a:l7"), "{e}");
    // but two wheels' names hold no 'ee' of an end effector
    let e = hand(["wheel", "tcp"]);
    assert!(e.contains("r.urdf#a:tcp"), "{e}");
}

#[test]
fn absurd_sizes_are_refused_quickly() {
    let start = std::time::Instant::now();
    let deep = format!("<robot>{}", "<a>".repeat(1_000_000));
    assert!(refused(&deep, None, None).contains("nested"));
    let mut many = String::from("<robot name='r'><link name='l0'/>");
    for k in 1..200_000 {
        write!(many, "<link name='l{k}'/>").unwrap();
    }
    assert!(refused(&many, None, None).contains("more than 10000 links"));
    let mut long = String::from("<robot name='r'><link name='l0'/>");
    for k in 1..9000 {
        write!(
            long,
            "<link name='l{k}'/><joint name='j{k}' type='continuous'><parent link='l{}'/><child link='l{k}'/></joint>",
            k - 1
        )
        .unwrap();
    }
    long.push_str("</robot>");
    let e = refused(&long, None, None);
    assert!(e.contains("one too many") && e.contains("r.urdf#l8990:l8999"), "{e}");
    assert!(refused(&" ".repeat(30_000_000), None, None).contains("bytes"));
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn a_chain_of_thousands_of_fixed_links_is_one_body() {
    let mut text = String::from(
        "<robot name='r'><link name='l0'/><link name='l1'/><joint name='j' type='revolute'><parent link='l0'/>\
         <child link='l1'/><limit lower='-1' upper='1'/></joint>",
    );
    for k in 2..9000 {
        write!(
            text,
            "<link name='l{k}'><inertial><mass value='0.001'/></inertial></link><joint name='j{k}' type='fixed'>\
             <parent link='l{}'/><child link='l{k}'/><origin xyz='0.0001 0 0'/></joint>",
            k - 1
        )
        .unwrap();
    }
    text.push_str("</robot>");
    let arm = parse(&text, "long.urdf", None, None).unwrap();
    assert_eq!((arm.root.as_str(), arm.tip.as_str()), ("l0", "l8999"));
    assert!((arm.robot.joints[0].mass.unwrap() - 8.998).abs() < 1e-9);
}

/// Largest difference of the TCP's poses of two models at random joint values.
fn apart(a: &Model, b: &Model, draw: &mut Draw) -> f64 {
    let (a, b) = [a, b].map(|m| Forward::new(m.clone(), Vec::new()).unwrap()).into();
    let (mut wa, mut wb) = (a.workspace(), b.workspace());
    (0..10)
        .map(|_| {
            let q: Vec<f64> = (0..a.model().robot.dof()).map(|_| draw.n(2.0)).collect();
            let (p, r) = (a.world_from_tool(&State::at(&q), &mut wa), b.world_from_tool(&State::at(&q), &mut wb));
            (p.translation - r.translation).amax().max((p.rotation - r.rotation).amax())
        })
        .fold(0.0, f64::max)
}

#[test]
fn the_rigid_part_of_a_model_goes_where_the_model_goes_and_comes_back_from_a_urdf() {
    use crate::axis::Axis;
    use crate::basis::Basis;
    use crate::term::{Motion, Parameter, Payload, Site, Term};
    let mut draw = Draw(StdRng::seed_from_u64(3));
    for round in 0..300 {
        let robot = parse(&draw.chain().text, "drawn.urdf", None, None).unwrap().robot;
        let n = robot.dof();
        let mut cell = Cell::bare();
        cell.world_from_base =
            Pose { rotation: rotation_zyx(draw.n(3.0), draw.n(1.5), draw.n(3.0)), translation: draw.v(1.0) };
        (cell.tool.tcp, cell.tool.mass) = (draw.v(0.3), 1.5);
        let mut model = Model::nominal(robot, cell);
        let mut sites = Vec::new();
        for k in 0..n {
            sites.extend(
                [Parameter::Alpha, Parameter::A, Parameter::Beta].map(|parameter| Site::Link { link: k, parameter }),
            );
            sites.extend([Parameter::Theta, Parameter::D].map(|parameter| Site::Link { link: k + 1, parameter }));
            sites.push(Site::Joint { joint: k + 1 });
            if round % 2 == 1 {
                sites.extend([Axis::X, Axis::Y].map(|axis| Site::Tilt { joint: k + 1, axis }));
            }
        }
        sites.extend(Motion::ALL.map(Site::Base));
        sites.extend(Motion::ALL.map(Site::Tool));
        sites.push(Site::Payload(Payload::Mass));
        for site in sites {
            let mut term = Term::new(format!("{site:?}"), "geometry", site, Basis::CONSTANT);
            term.value = draw.n(0.02);
            model.terms.push(term);
        }
        let rigid = model.rigid().unwrap();
        assert!(rigid.left_out.is_empty());
        assert_eq!(rigid.same_frames, round % 2 == 0);
        let off = apart(&model, &Model::nominal(rigid.robot.clone(), rigid.cell.clone()), &mut draw);
        assert!(off < 2e-11, "{off:e}");
        // the URDF begins in {w} and ends in the TCP
        let text = super::write(&rigid.robot, &rigid.cell, &["a remark -- and <more>".into()]);
        let again = parse(&text, "written.urdf", None, None).unwrap();
        assert_eq!((again.root.as_str(), again.tip.as_str()), ("world", "tcp"));
        let off = apart(&model, &Model::nominal(again.robot, Cell::bare()), &mut draw);
        assert!(off < 2e-11, "{off:e}");
    }
}

#[test]
fn no_zero_is_written_with_a_sign() {
    let mut cell = Cell::bare();
    cell.tool.tcp = V3::new(-0.0, 0.0, -0.0);
    let text = super::write(&Robot::empty("none"), &cell, &[]);
    assert!(text.contains("<origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>") && !text.contains("-0"), "{text}");
}

/// What a tool changer moves beyond the flange is not the arm, though nothing calls it a finger.
#[test]
fn an_end_with_the_name_of_a_flange_comes_before_one_that_moves_more() {
    let joint = |k: usize, kind: &str, child: &str| {
        format!(
            "<link name='{child}'/><joint name='j{k}' type='{kind}'><parent link='l{}'/><child link='{child}'/>\
             <origin xyz='0.1 0 0.1'/><axis xyz='0 {} {}'/><limit lower='-1' upper='1'/></joint>",
            k.min(7) - 1,
            k % 2,
            (k + 1) % 2
        )
    };
    let arm: String = (1..=6).map(|k| joint(k, "revolute", &format!("l{k}"))).collect();
    let ends = joint(7, "fixed", "flange") + &joint(8, "prismatic", "slider");
    let e = refused(&format!("<robot name='r'><link name='l0'/>{arm}{ends}</robot>"), None, None);
    assert!(e.contains("flange") && e.contains("slider") && e.ends_with(":flange"), "{e}");
}
