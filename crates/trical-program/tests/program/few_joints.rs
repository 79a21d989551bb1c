//! Arms of four and five joints: the tool's point is brought to its place, its axes as near as the joints allow. And of seven, whose poses do not say
//! how the arm stands.

use trical_model::pose::{angles_zyx, rotation_vector};
use trical_model::{Basis, Forward, Joints, Model, Parameter, Pose, Robot, Site, State, Term};
use trical_program::{Dialect, Frames};

use crate::fixtures::{IRB, device, joints, mm, nominal, numbers, pose, quaternion, real};
use crate::{refused, run, unmarked};

fn with_five_joints() -> Model {
    let (arm, _) = IRB.rsplit_once("[[joint]]").unwrap();
    Model { robot: Robot::parse(arm, "five.toml").unwrap(), ..nominal(IRB) }
}

fn tool(model: &Model, q: &[f64]) -> Pose {
    let forward = Forward::new(model.clone(), vec![]).unwrap();
    // as it comes from nowhere, at the temperature of the options
    let state = State { dir: Some([0; 9]), temp_c: Some(32.0), ..State::at(q) };
    forward.world_from_tool(&state, &mut forward.workspace())
}

fn radians(q: &[f64]) -> Vec<f64> {
    q.iter().map(|q| q.to_radians()).collect()
}

/// Rows of a CSV with these joints (deg), and with the poses of an arm there.
fn rows(arm: &Model, places: &[Vec<f64>]) -> [String; 2] {
    let base_from_world = arm.cell.world_from_base.inverse();
    let pose = |q: &Vec<f64>| {
        let p = base_from_world.compose(&tool(arm, &radians(q)));
        format!("{},{}\n", numbers(&mm(&p)), quaternion(&p))
    };
    [places.iter().map(|q| numbers(q) + "\n").collect(), places.iter().map(pose).collect()]
}

#[test]
fn joints_and_poses_of_an_arm_of_five_joints_bring_its_point_where_it_is_wanted() {
    let nominal = with_five_joints();
    let model = real(&nominal);
    let places: Vec<Vec<f64>> = joints([0.0; 6]).iter().map(|q| q[..5].to_vec()).collect();
    let [by_joints, by_poses] = rows(&nominal, &places);
    assert_ne!(device(), Pose::identity());
    for (head, rows) in
        [("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg\n", by_joints), ("x_mm,y_mm,z_mm,qw,qx,qy,qz\n", by_poses)]
    {
        let text = format!("{head}{rows}");
        let (_, report) = run(text.as_bytes(), Dialect::Csv, &nominal, &model, &Frames::default());
        assert!(report.problems.is_empty(), "{:?}", report.problems);
        assert_eq!(report.rows.len(), places.len());
        assert!(report.before[1] > 5e-4 && report.after[1] < 2e-7, "{:?} {:?}", report.before, report.after);
        for (row, q) in report.rows.iter().zip(&places) {
            let (wanted, was) = (tool(&nominal, &radians(q)), tool(&model, &radians(q)));
            let off = |p: &Pose| rotation_vector(&(p.rotation.transpose() * wanted.rotation)).norm();
            let new: Joints = row.joints;
            let reached = tool(&model, &new[..5]);
            // of what is left of its axes no joint could take more
            assert!(off(&reached) < off(&was) + 2e-3, "{} {}", off(&reached), off(&was));
        }
    }
}

/// Two joints that turn, one that slides, and one that turns: the nominal arm, and a real one whose second link is longer.
fn scara() -> (Model, Model) {
    let joint = |kind: &str, a: f64, d: f64, limits: &str| {
        format!("[[joint]]\nkind = \"{kind}\"\nalpha_deg = 0\na_mm = {a}\nd_mm = {d}\ntheta_offset_deg = 0\n{limits}\n")
    };
    let turns = |a: f64, d: f64| joint("revolute", a, d, "limits_deg = [-150, 150]");
    let slide = joint("prismatic", 250.0, 0.0, "limits_mm = [-200, 0]");
    let arm = ["name = \"SCARA\"\n", &turns(0.0, 300.0), &turns(300.0, 0.0), &slide, &turns(0.0, 0.0)].concat();
    let nominal = Model { robot: Robot::parse(&arm, "scara.toml").unwrap(), ..nominal(IRB) };
    let mut model = nominal.clone();
    let link = Site::Link { link: 2, parameter: Parameter::A };
    model.terms.push(Term { value: 0.4e-3, ..Term::new("a_2", "test", link, Basis::CONSTANT) });
    (nominal, model)
}

#[test]
fn joints_and_poses_of_an_arm_whose_third_joint_slides_are_read() {
    let (nominal, model) = scara();
    let q = [0.3, 0.7, -0.08, 0.2];
    let p = nominal.cell.world_from_base.inverse().compose(&tool(&nominal, &q));
    let by_poses = format!("x_mm,y_mm,z_mm,qw,qx,qy,qz\n{},{}\n", numbers(&mm(&p)), quaternion(&p));
    let deg = q.map(f64::to_degrees);
    let by_joints = format!("q1_deg,q2_deg,q3_mm,q4_deg\n{},{},-80,{}\n", deg[0], deg[1], deg[3]);
    // a joint that slides is not counted from the horizontal, as joint 3 of FANUC's other arms is
    let listing = format!(
        "/PROG A\n/MN\n   1:J P[1] 100% FINE ;\n/POS\nP[1]{{\n GP1:\n\tUF : F, UT : F,\n\tJ1= {} deg, J2= {} deg, J3= -80 mm, J4= {} deg\n}};\n/END\n",
        deg[0], deg[1], deg[3]
    );
    let mut reached = Vec::new();
    for (text, d) in [(by_poses, Dialect::Csv), (by_joints, Dialect::Csv), (listing, Dialect::Fanuc)] {
        let (_, report) = run(text.as_bytes(), d, &nominal, &model, &Frames::default());
        assert!(report.problems.is_empty(), "{:?}", report.problems);
        assert!(report.before[1] > 3e-4 && report.after[1] < 2e-7, "{:?} {:?}", report.before, report.after);
        reached.extend(report.rows.iter().map(|row| row.wanted.translation));
    }
    assert!(reached.iter().all(|x| (x - reached[0]).norm() < 1e-7), "{reached:?}");
}

#[test]
fn to_which_side_a_scara_elbow_points_is_as_at_the_joint_values_before() {
    let (nominal, model) = scara();
    let position = |k: usize, letter: &str, q: [f64; 4]| {
        // the controller's world stands where axis 2 passes axis 1
        let world_from_base = pose(0.0, 0.0, -300.0, 0.0, 0.0, 0.0).compose(&nominal.cell.world_from_base.inverse());
        let p = world_from_base.compose(&tool(&nominal, &q));
        let [z, y, x] = angles_zyx(&p.rotation).map(f64::to_degrees);
        let at = mm(&p);
        format!(
            "P[{k}]{{\n GP1:\n\tUF : F, UT : F, CONFIG : '{letter}, 0, 0, 0',\n\tX = {:.5} mm, Y = {:.5} mm, Z = {:.5} mm, W = {x:.7} deg, P = {y:.7} deg, R = {z:.7} deg\n}};\n",
            at[0], at[1], at[2]
        )
    };
    let listing = |elbow: f64, other: &str| {
        let [one, two] = [[0.3, elbow, -0.08, 0.2], [0.4, elbow * 0.9, -0.06, 0.1]];
        let home = format!(
            "P[1]{{\n GP1:\n\tUF : F, UT : F,\n\tJ1= 5 deg, J2= {} deg, J3= -80 mm, J4= 3 deg\n}};\n",
            elbow * 50.0
        );
        let motions =
            "/PROG A\n/MN\n   1:J P[1] 100% FINE ;\n   2:L P[2] 100mm/sec FINE ;\n   3:L P[3] 100mm/sec FINE ;\n/POS\n";
        format!("{motions}{home}{}{}/END\n", position(2, "L", one), position(3, other, two))
    };
    for elbow in [0.7, -0.7] {
        let (_, report) = run(listing(elbow, "L").as_bytes(), Dialect::Fanuc, &nominal, &model, &Frames::default());
        assert!(report.problems.is_empty() && report.rewritten == 3, "{:?}", report.problems);
        assert!(report.rows.iter().all(|row| row.joints[1] * elbow > 0.0));
    }
    let (_, report) = run(listing(0.7, "R").as_bytes(), Dialect::Fanuc, &nominal, &model, &Frames::default());
    let said: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
    assert!(said.len() == 1 && said[0].contains("to which side the elbow points"), "{said:?}");
    let said = refused(listing(0.7, "L").as_bytes(), Dialect::Fanuc);
    assert!(said.contains("configuration 'L', as SCARA arms of 4 joints have; the robot has 6 joints"), "{said}");
}

/// A Panda's lengths.
const SEVEN: [[f64; 3]; 7] = [
    [0.0, 0.0, 333.0],
    [-90.0, 0.0, 0.0],
    [90.0, 0.0, 316.0],
    [90.0, 82.5, 0.0],
    [-90.0, -82.5, 384.0],
    [90.0, 0.0, 0.0],
    [90.0, 88.0, 107.0],
];

#[test]
fn of_an_arm_of_seven_joints_joint_values_are_corrected_and_poses_are_listed() {
    let joint = |[alpha, a, d]: &[f64; 3]| {
        format!(
            "[[joint]]\nalpha_deg = {alpha}\na_mm = {a}\nd_mm = {d}\ntheta_offset_deg = 0\nlimits_deg = [-175, 175]\n"
        )
    };
    let arm = format!("name = \"seven\"\n{}", SEVEN.iter().map(joint).collect::<String>());
    let nominal = Model { robot: Robot::parse(&arm, "seven.toml").unwrap(), ..nominal(IRB) };
    let mut model = nominal.clone();
    for (link, parameter, value) in
        [(2, Parameter::Alpha, 1e-3), (3, Parameter::A, 0.8e-3), (4, Parameter::Theta, 2e-3)]
    {
        let site = Site::Link { link, parameter };
        model.terms.push(Term { value, ..Term::new(format!("{parameter:?}"), "test", site, Basis::CONSTANT) });
    }
    let places = [[10.0, 20.0, -15.0, -100.0, 30.0, 110.0, 40.0], [-30.0, 35.0, 10.0, -80.0, -20.0, 90.0, 10.0]];
    let [by_joints, by_poses] = rows(&nominal, &places.map(Vec::from));
    let text = format!("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,q7_deg\n{by_joints}");
    let (_, report) = run(text.as_bytes(), Dialect::Csv, &nominal, &model, &Frames::default());
    assert!(report.problems.is_empty() && report.rewritten == 2, "{:?}", report.problems);
    assert!(report.before[1] > 5e-4 && report.after[1] < 2e-7, "{:?} {:?}", report.before, report.after);
    let text = format!("x_mm,y_mm,z_mm,qw,qx,qy,qz\n{by_poses}");
    let (out, report) = run(text.as_bytes(), Dialect::Csv, &nominal, &model, &Frames::default());
    let said: Vec<String> = report.problems.iter().map(ToString::to_string).collect();
    assert!(said.len() == 2 && report.rewritten == 0 && unmarked(&out) == text.as_bytes(), "{said:?}");
    assert!(said[0].contains("an arm of 7 joints reaches in infinitely many ways; expected joint values"), "{said:?}");
}
