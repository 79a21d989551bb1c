//! What the errors depend on beside the joints: temperature, time, loads.

use trical_model::{Axis, Basis, Motion, Shape, Site, Term, Variable};
use trical_program::{Dialect, Frames, Options, Program, compensate};

use crate::fixtures::{IRB, KR6, nominal, real};
use crate::options;

#[test]
fn a_model_that_needs_a_temperature_asks_for_it() {
    let n = nominal(IRB);
    let options = Options::default();
    let e = compensate(
        Program::of_file(b"q1_deg\n1\n", "p", Dialect::Csv, &mut Vec::new()),
        &n,
        &real(&n),
        &Frames::default(),
        &options,
    );
    assert!(e.unwrap_err().to_string().contains("temp_c says"));
}

#[test]
fn a_program_runs_long_after_the_recording_unless_it_is_said_when() {
    let n = nominal(IRB);
    let moved = |shape: Shape, value: f64, seq: Option<f64>| {
        let mut model = n.clone();
        let basis = Basis::new(Variable::Seq, shape);
        model.terms.push(Term { value, ..Term::new("expansion", "thermal_growth", Site::Links, basis) });
        let options = Options { seq, ..Options::default() };
        let program = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,30,0\n";
        let frames = Frames::default();
        compensate(Program::of_file(program, "p", Dialect::Csv, &mut Vec::new()), &n, &model, &frames, &options)
            .map(|report| report.largest_move)
            .map_err(|e| e.to_string())
    };
    let warm_up = Shape::WarmUp { constant: 100.0 };
    let [cold, half, warm] = [0.0, 69.3, 1e6].map(|seq| moved(warm_up, 2e-4, Some(seq)).unwrap());
    assert!(cold < 1e-9 && warm > 5e-5 && (half / warm - 0.5).abs() < 0.01, "{cold} {half} {warm}");
    assert!((moved(warm_up, 2e-4, None).unwrap() - warm).abs() < 1e-9);
    assert!(moved(Shape::Linear, 2e-7, None).unwrap_err().contains("seq says"));
    assert!(moved(Shape::Linear, 2e-7, Some(1000.0)).is_ok());
}

#[test]
fn a_moment_is_one_of_the_session_that_is_said_and_else_of_the_first_in_which_something_happened() {
    let n = nominal(IRB);
    let mut model = n.clone();
    for (session, value) in [(2, 1e-3), (3, 3e-3)] {
        let basis = Basis::new(Variable::Time, Shape::Step { at: 10.0 }).in_session(session);
        let site = Site::Tool(Motion::Along(Axis::Z));
        model.terms.push(Term { value, ..Term::new(format!("slip_{session}"), "tool_slip", site, basis) });
    }
    let of = |session: Option<&str>, time_s: Option<f64>| {
        let sessions = ["mon.csv", "tue.csv", "wed.csv", "mon.csv"].map(String::from).to_vec();
        let options = Options { time_s, session: session.map(Into::into), sessions, ..Options::default() };
        let program = b"q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,30,0\n";
        let frames = Frames::default();
        compensate(Program::of_file(program, "p", Dialect::Csv, &mut Vec::new()), &n, &model, &frames, &options)
            .map(|report| ((report.before[1] * 1e6).round(), report.cautions.join(" ")))
            .map_err(|e| e.to_string())
    };
    for (session, error) in [("tue.csv", 1000.0), ("2", 1000.0), ("wed.csv", 3000.0), ("1", 0.0)] {
        assert_eq!(of(Some(session), Some(60.0)).unwrap(), (error, String::new()), "{session}");
    }
    let (error, said) = of(None, Some(60.0)).unwrap();
    assert!(error == 1000.0 && said.contains("sessions 2 (tue.csv), 3 (wed.csv)"), "{said}");
    assert!(said.contains("in session 2 (session says another)"), "{said}");
    for wrong in ["thu.csv", "5", "0", "mon.csv"] {
        let e = of(Some(wrong), Some(60.0)).unwrap_err();
        assert!(e.contains(&format!("session: found '{wrong}'")) && e.contains("1 (mon.csv), 2 (tue.csv), 3"), "{e}");
    }
    assert!(of(Some("tue.csv"), None).unwrap_err().contains("expected with one of them"));
}

#[test]
fn loads_that_nobody_has_read_are_named_where_the_arm_sags() {
    let n = nominal(IRB);
    let of = |d: Dialect, text: &str, options: &Options| {
        let report = compensate(
            Program::of_file(text.as_bytes(), "p", d, &mut Vec::new()),
            &n,
            &real(&n),
            &Frames::default(),
            options,
        )
        .unwrap();
        report.cautions.into_iter().filter(|c| c.contains("carries") || c.contains("weighs")).collect::<Vec<_>>()
    };
    let rapid = |tool: &str, mass: f64, load: &str| {
        format!(
            "PERS tooldata tGrip:=[TRUE,[[0,0,80],[1,0,0,0]],[{mass},[0,0,40],[1,0,0,0],0,0,0]];\nMoveAbsJ \
             [[10,12,-8,20,40,-30],[9E9,9E9,9E9,9E9,9E9,9E9]]{load},v1,fine,{tool};\n"
        )
    };
    let lines = "GripLoad load0;\nGripLoad piece;\n";
    let said = of(Dialect::Rapid, &(lines.to_owned() + &rapid("tGrip", 1.0, "\\TLoad:=piece")), &options());
    assert!(said.len() == 1 && said[0].contains("(line 2, line 4)"), "{said:?}");
    let said = of(Dialect::Rapid, &rapid("tGrip", 0.001, "\\TLoad:=load0"), &options());
    assert!(said.len() == 1 && said[0].contains("what tool 'tgrip' weighs"), "{said:?}");
    for (tool, mass) in [("tGrip", 1.0), ("tool0", 0.001)] {
        assert_eq!(of(Dialect::Rapid, &rapid(tool, mass, ""), &options()), [""; 0]);
    }
    let stated = Options { payload_kg: Some(2.0), ..options() };
    assert_eq!(of(Dialect::Rapid, &(lines.to_owned() + &rapid("tGrip", 0.001, "")), &stated), [""; 0]);
    let ur = "def p():\n  set_payload(1.5)\n  set_tcp(p[0,0,0.1,0,0,0])\n  movej([0.1,0.2,-0.1,0.3,0.6,-0.4])\nend\n";
    let said = of(Dialect::UrScript, ur, &options());
    assert!(
        said.len() == 2
            && said[0].contains("(line 2)")
            && said[1].contains("what tool 'set_tcp(0.000, 0.000, 100.000 mm)' weighs")
            && said[1].contains("(payload_kg says it)"),
        "{said:?}"
    );
    let krl = "$TOOL={X 0,Y 0,Z 80,A 0,B 0,C 0}\n$LOAD.M=3\nPTP {A1 10,A2 12,A3 -8,A4 20,A5 40,A6 -30}\n";
    let said = of(Dialect::Krl, krl, &options());
    assert!(said.len() == 2 && said[0].contains("(line 2)") && said[1].contains("'$tool'"), "{said:?}");
    // an arm that does not sag
    let stiff = nominal(KR6);
    let report = compensate(
        Program::of_file(krl.replace("A2 12,A3 -8", "A2 -70,A3 85").as_bytes(), "p", Dialect::Krl, &mut Vec::new()),
        &stiff,
        &real(&stiff),
        &Frames::default(),
        &options(),
    )
    .unwrap();
    assert_eq!(report.cautions, [""; 0]);
    assert_eq!(report.setups[0].0, "tool '$tool in line 1' in the robot's base");
}
