//! An arm on a rail that programs move as an external axis.

use trical_model::{Basis, Forward, Model, Parameter, Robot, Shape, Site, State, Term, Variable};
use trical_program::{Dialect, Frames};

use crate::fixtures::{IRB, device, joints, mm, nominal, numbers, quadrant, quaternion};
use crate::{run, unmarked};

/// The IRB 120 on a rail of 6 m along y.
fn on_rail() -> Model {
    let rail = "[[joint]]\nkind = \"prismatic\"\nalpha_deg = -90.0\na_mm = 0.0\nd_mm = 0.0\ntheta_offset_deg = 0.0\n\
                limits_mm = [0.0, 6000.0]\nmass_kg = 80.0\ncog_mm = [0.0, 0.0, 0.0]\n\n";
    let (head, arm) = IRB.split_once("[[joint]]").unwrap();
    let arm = arm.replacen("alpha_deg = 0.0", "alpha_deg = 90.0", 1);
    let robot = Robot::parse(&format!("{head}{rail}[[joint]]{arm}"), "rail.toml").unwrap();
    Model { robot, ..nominal(IRB) }
}

#[test]
fn targets_of_an_arm_on_a_rail_are_corrected_where_the_rail_stands_and_others_are_listed() {
    let nominal = on_rail();
    let term = |name: &str, site, basis, value| Term { value, ..Term::new(name, "test", site, basis) };
    let along = Basis::new(Variable::Joint { joint: 1 }, Shape::Linear);
    let terms = vec![
        term("scale", Site::Joint { joint: 1 }, along, 2e-4),
        term("yaw", Site::Joint { joint: 2 }, along, 1e-4),
        term("alpha_1", Site::Link { link: 1, parameter: Parameter::Alpha }, Basis::CONSTANT, 5e-4),
        term("a_3", Site::Link { link: 3, parameter: Parameter::A }, Basis::CONSTANT, 3e-4),
        term("c_3", Site::Joint { joint: 3 }, Basis::torque(3, Shape::Linear), 2e-5),
    ];
    let model = Model { terms, ..nominal.clone() };
    let whole = |model: &Model, at: f64, q: &[f64]| {
        let forward = Forward::new(model.clone(), vec![]).unwrap();
        let all: Vec<f64> = std::iter::once(at * 1e-3).chain(q.iter().copied().take(6)).collect();
        forward.world_from_tool(&State::at(&all), &mut forward.workspace())
    };
    let rails = [0.0, 1200.0, 1200.0, 4321.5, 5999.0];
    let mut text = format!(
        "MODULE M\nPERS tooldata tDevice:=[TRUE,[[{}],[{}]],[1.7,[0,0,0],[1,0,0,0],0,0,0]];\n",
        numbers(&mm(&device())),
        quaternion(&device())
    );
    let mut motions = String::new();
    let mut target = |name: &str, at: f64, q: &[f64; 6], external: &str| {
        let radians: Vec<f64> = q.iter().map(|q| q.to_radians()).collect();
        let p = nominal.cell.world_from_base.inverse().compose(&whole(&nominal, at, &radians));
        let cf = format!("[{},{},{},0]", quadrant(q[0]), quadrant(q[3]), quadrant(q[5]));
        text += &format!(
            "CONST robtarget {name}:=[[{}],[{}],{cf},[{external},9E9,9E9,9E9,9E9,9E9]];\n",
            numbers(&mm(&p)),
            quaternion(&p)
        );
        motions += &format!("MoveL {name},v100,fine,tDevice;\n");
    };
    for (k, (q, at)) in joints([0.0; 6]).iter().zip(rails).enumerate() {
        target(&format!("p{k}"), at, q, &at.to_string());
    }
    target("nowhere", 0.0, &joints([0.0; 6])[0], "9E9");
    target("beyond", 7000.0, &joints([0.0; 6])[0], "7000");
    let text = format!("{text}PROC main()\n{motions}ENDPROC\nENDMODULE\n").into_bytes();
    let (out, report) = run(&text, Dialect::Rapid, &nominal, &model, &Frames::default());
    let said = format!("{:?}", report.problems);
    assert_eq!((report.rewritten, report.problems.len()), (5, 2), "{said}");
    assert!(
        said.contains("does not say where the rail stands") && said.contains("beyond its limits 0 to 6000 mm"),
        "{said}"
    );
    assert!(report.before[0] > 0.3e-3, "{:?}", report.before);
    let (_, again) = run(&unmarked(&out), Dialect::Rapid, &nominal, &nominal, &Frames::default());
    for ((row, read), at) in report.rows.iter().zip(&again.rows).zip(rails) {
        // what the controller makes of the new numbers, on the whole arm, the rail where the text has it
        assert!((read.joints[0] - at * 1e-3).abs() < 1e-12);
        let reached = whole(&model, at, &read.joints[1..7]);
        let off = (reached.translation - row.wanted.translation).norm();
        assert!(off < 0.5e-6, "at {at}: {off}");
    }
}

#[test]
fn joint_values_of_a_rail_are_in_mm_and_other_units_are_refused() {
    let nominal = on_rail();
    let along = Basis::new(Variable::Joint { joint: 1 }, Shape::Linear);
    let scale = Term { value: 2e-4, ..Term::new("scale", "test", Site::Joint { joint: 1 }, along) };
    let model = Model { terms: vec![scale], ..nominal.clone() };
    let row = "q1_mm,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,q7_deg\n3000,10,20,10,5,60,-7\n";
    let (out, report) = run(row.as_bytes(), Dialect::Csv, &nominal, &model, &Frames::default());
    assert_eq!(report.rewritten, 1, "{:?}", report.problems);
    assert!((report.before[0] - 0.6e-3).abs() < 1e-6 && report.after[0] < 1e-7);
    let text = String::from_utf8(unmarked(&out)).unwrap();
    let first: f64 = text.lines().nth(1).unwrap().split(',').next().unwrap().parse().unwrap();
    // seven joints reach a pose in many ways: here the rail and the arm share the 0.6 mm
    assert!(first < 3000.0 && first > 2999.0, "{text}");
    let wrong = row.replace("q1_mm", "q1_deg");
    let refused = trical_program::compensate(
        trical_program::Program::of_file(wrong.as_bytes(), "p.csv", Dialect::Csv, &mut Vec::new()),
        &nominal,
        &model,
        &Frames::default(),
        &crate::options(),
    );
    assert!(refused.unwrap_err().to_string().contains("joint 1 of the robot slides: expected a column q1_mm"));
}
