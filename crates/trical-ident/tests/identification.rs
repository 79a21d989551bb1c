//! Identification on arms whose truth is known, and on the real recordings where they are present.

use std::path::{Path, PathBuf};

use crate::arm::{build, nominal, paper_terms, touch, truth};
use trical_ident::fit::identify::fit_model_knowing;
use trical_ident::fit::priors::PriorKnowledge;
use trical_ident::{
    Choice, JointSource, ModelFile, Noise, Options, ParameterSet, calibrate, clean, identify, load_csv,
    reject_gross_errors, write_csv,
};
use trical_model::{Basis, Cell, Forward, Measured, Model, Recording, Robot, Shape, Site, Task, Term, Variable};

fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.is_dir() {
        println!("skipped: {} is missing", path.display());
        return None;
    }
    Some(path)
}

#[test]
fn a_six_joint_arm_has_the_papers_31_parameters_and_one_more_geometric_one() {
    let names = |set| paper_terms(set).into_iter().map(|t| t.name).collect::<Vec<_>>();
    assert_eq!(names(ParameterSet::Geometry).len(), 27);
    let mut paper = names(ParameterSet::Compliance);
    let mut expected: Vec<String> = ["x", "y", "z", "rx", "ry", "rz"].iter().map(|m| format!("base_{m}")).collect();
    expected.extend(["tool_x", "tool_y", "tool_z"].map(String::from));
    for k in 1..=5 {
        expected.extend([format!("alpha_{k}"), format!("a_{k}")]);
    }
    expected.extend(["d_3", "d_4", "d_5", "theta_2", "theta_3", "theta_4", "theta_5"].map(String::from));
    expected.extend((2..=6).map(|k| format!("c_{k}")));
    paper.sort();
    expected.sort();
    assert_eq!(paper, expected);
    let complete = names(ParameterSet::Complete);
    assert_eq!(complete.len(), 32);
    assert!(complete.contains(&"beta_2".to_owned()));
}

/// Left to the data, those joints are taken that the arm explains better, and commanded ones only where every row has them.
#[test]
fn the_joints_that_fit_better_are_taken() {
    let model = truth(ParameterSet::Geometry, 8);
    let seen = touch(&model, 60, 8e-6, 9);
    let q1 = |recording: &Recording, joints| {
        let recordings = std::slice::from_ref(recording);
        let data = clean(&model.robot, &model.cell, recordings, joints, ParameterSet::Geometry, false).unwrap();
        data.observations[0].state.q[0]
    };
    let (right, off) = (seen.rows[0].state.q[0], 3e-4);
    // read wrong by some 0.02 deg at every pose, and commanded right; and the other way round
    let mut read_late = seen;
    for (k, row) in read_late.rows.iter_mut().enumerate() {
        row.state.q_commanded = Some(row.state.q);
        row.state.q.iter_mut().for_each(|q| *q += if k % 2 == 0 { off } else { -off });
    }
    assert_eq!(q1(&read_late, None), right);
    assert_eq!(q1(&read_late, Some(JointSource::Read)), right + off);
    let mut read_well = read_late.clone();
    for row in &mut read_well.rows {
        let wrong = std::mem::replace(&mut row.state.q, row.state.q_commanded.unwrap());
        row.state.q_commanded = Some(wrong);
    }
    assert_eq!(q1(&read_well, None), right);
    read_late.rows[1].state.q_commanded = None;
    assert_eq!(q1(&read_late, None), right + off);
}

#[test]
fn without_noise_the_31_parameters_come_back() {
    let truth = truth(ParameterSet::Compliance, 5);
    let data = build(touch(&truth, 45, 0.0, 6));
    let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
    assert_eq!(found.free.len(), 31);
    for t in &truth.terms {
        let f = found.model.terms.iter().find(|f| f.name == t.name).unwrap();
        assert!((f.value - t.value).abs() < 1e-9, "{}: {} instead of {}", t.name, f.value, t.value);
    }
}

#[test]
fn standard_deviations_say_how_far_parameters_are_off() {
    let truth = truth(ParameterSet::Compliance, 7);
    let (mut inside, mut all) = (0, 0);
    for seed in 0..40 {
        let data = build(touch(&truth, 60, 1e-5, 100 + seed));
        let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Compliance).unwrap();
        for t in &truth.terms {
            let f = found.model.terms.iter().find(|f| f.name == t.name).unwrap();
            all += 1;
            inside += u32::from((f.value - t.value).abs() < 1.96 * f.sd.unwrap());
        }
    }
    let share = f64::from(inside) / f64::from(all);
    assert!((0.92..0.975).contains(&share), "95 % intervals cover {share}");
}

#[test]
fn gross_errors_are_rejected_and_named() {
    let truth = truth(ParameterSet::Compliance, 8);
    let mut recording = touch(&truth, 60, 1e-5, 9);
    for k in [7, 33] {
        if let Measured::Touch { reading, .. } = &mut recording.rows[k].measured {
            reading[1] += 0.5e-3;
        }
    }
    let clean = reject_gross_errors(&truth.robot, &truth.cell, &build(recording)).unwrap();
    let lines: Vec<usize> = clean.rejected.iter().map(|r| r.line).collect();
    assert_eq!(lines, [9, 35]);
    assert!(clean.rejected.iter().all(|r| !r.reason.contains("wrong ball")));
}

#[test]
fn of_few_touches_none_is_a_gross_error_because_a_model_goes_through_the_others() {
    // 33 numbers and somewhat more for some 30 parameters
    for (n, seed) in [11, 12, 13, 15, 20].into_iter().flat_map(|n| (0..6).map(move |seed| (n, seed))) {
        let truth = truth(ParameterSet::Compliance, seed);
        let clean = reject_gross_errors(&truth.robot, &truth.cell, &build(touch(&truth, n, 1e-5, 9 + seed))).unwrap();
        assert!(clean.rejected.is_empty(), "{n} touches, seed {seed}: {:?}", clean.rejected);
    }
}

#[test]
fn what_a_fifth_of_the_rows_has_is_no_gross_error_and_what_is_farther_off_is() {
    let truth = truth(ParameterSet::Compliance, 8);
    let mut slipped = truth.clone();
    slipped.cell.tool.tcp.y += 1e-3;
    let mut recording = touch(&truth, 96, 1e-5, 9);
    recording.rows.extend(touch(&slipped, 24, 1e-5, 10).rows);
    let wrong = [7, 33, 90];
    for (k, row) in recording.rows.iter_mut().enumerate() {
        row.line = k + 2;
        if let Measured::Touch { reading, .. } = &mut row.measured
            && wrong.contains(&k)
        {
            reading[1] += 20e-3;
        }
    }
    let clean = reject_gross_errors(&truth.robot, &truth.cell, &build(recording)).unwrap();
    let lines: Vec<usize> = clean.rejected.iter().map(|r| r.line).collect();
    assert_eq!(lines, wrong.map(|k| k + 2));
}

#[test]
fn a_touch_of_another_ball_than_noted_is_called_so() {
    let truth = truth(ParameterSet::Compliance, 8);
    let mut recording = touch(&truth, 60, 1e-5, 9);
    let Measured::Touch { ball, .. } = &mut recording.rows[20].measured else { panic!("no touch") };
    let right = *ball;
    *ball = (right + 1) % 3;
    let clean = reject_gross_errors(&truth.robot, &truth.cell, &build(recording)).unwrap();
    let said: Vec<(usize, bool)> = clean
        .rejected
        .iter()
        .map(|r| {
            (r.line, r.reason.contains(&format!("it fits ball {}: the wrong ball number was recorded", right + 1)))
        })
        .collect();
    assert_eq!(said, [(22, true)]);
}

#[test]
fn without_masses_compliance_is_left_out_and_said_and_refused_where_joints_are_named() {
    let truth = truth(ParameterSet::Geometry, 10);
    let mut robot = truth.robot.clone();
    robot.joints.iter_mut().for_each(|j| j.mass = None);
    let recording = touch(&truth, 60, 1e-5, 11);
    let with = |choice: Choice| {
        let options = Options { choice, ..Options::new(ParameterSet::Complete) };
        calibrate(&robot, &truth.cell, std::slice::from_ref(&recording), &options, &Task::silent())
    };
    let c = with(ParameterSet::Complete.into()).unwrap();
    assert_eq!(c.fitted.model.terms.len(), with(ParameterSet::Geometry.into()).unwrap().fitted.model.terms.len());
    assert!(c.cautions().iter().any(|c| c.contains("no masses")), "{:?}", c.cautions());
    let named = Choice::new(ParameterSet::Compliance, &[2], 6).unwrap();
    assert!(with(named).unwrap_err().to_string().contains("no mass_kg"));
}

#[test]
fn a_model_file_predicts_what_the_model_did() {
    let truth = truth(ParameterSet::Complete, 10);
    let data = build(touch(&truth, 60, 1e-5, 11));
    let found = identify(&truth.robot, &truth.cell, &data, ParameterSet::Complete).unwrap();
    let file = ModelFile::of(found.model.clone(), &data);
    let again = ModelFile::parse(&file.to_toml().unwrap(), "m.toml").unwrap();
    assert_eq!(again.sessions, file.sessions);
    assert_eq!(again.session_of(&data.fingerprints[0]), Some(1));
    let errors =
        |m: &Model| trical_ident::fit::residuals::position_errors(&Forward::new(m.clone(), Vec::new()).unwrap(), &data);
    for (a, b) in errors(&found.model).iter().zip(errors(&again.model)) {
        assert!((a - b).abs() < 1e-12);
    }
    let mut other = nominal().robot;
    other.joints[2].a += 1e-3;
    let refused = again.require_robot(&other, "m.toml").unwrap_err().to_string();
    assert!(refused.contains("joint 3"), "{refused}");
}

#[test]
fn recordings_survive_the_way_to_csv_and_back() {
    let recording = touch(&truth(ParameterSet::Compliance, 12), 20, 1e-5, 13);
    let mut text = Vec::new();
    write_csv(&recording, &mut text).unwrap();
    let again = trical_ident::parse_csv(&text, "r.csv", 6).unwrap();
    for (a, b) in recording.rows.iter().zip(&again.rows) {
        for k in 0..6 {
            assert!((a.state.q[k] - b.state.q[k]).abs() < 1e-13);
        }
        assert_eq!(a.state.dir.unwrap()[..6], b.state.dir.unwrap()[..6]);
        assert_eq!((a.state.t, a.state.temp_c), (b.state.t, b.state.temp_c));
        match (a.measured, b.measured) {
            (Measured::Touch { ball: x, reading: r }, Measured::Touch { ball: y, reading: s }) => {
                assert_eq!(x, y);
                assert!(r.iter().zip(&s).all(|(r, s)| (r - s).abs() < 1e-14));
            }
            _ => panic!("a touch became something else"),
        }
    }
}

#[test]
fn the_real_irb_120_reads_as_in_the_literature() {
    let Some(dir) = shared("irb120") else { return };
    let robot = Robot::load(&dir.join("robot.toml")).unwrap();
    let cell = Cell::load(&dir.join("cell.toml")).unwrap();
    let recording = load_csv(&dir.join("tracker.csv"), robot.dof()).unwrap();
    // by pose, as in the literature; blocks of neighbouring poses are a little harder
    let held_out = |set: ParameterSet| {
        let options = Options { joints: Some(JointSource::Commanded), ..Options::new(set) };
        let recordings = std::slice::from_ref(&recording);
        let c = calibrate(&robot, &cell, recordings, &options, &Task::silent()).unwrap();
        assert_eq!(c.poses, 765);
        let (pose, block) = (c.held_out.by_pose.unwrap(), c.held_out.by_block.unwrap());
        assert!(block.mean_mm < 1.15 * pose.mean_mm, "{set:?}: {block:?} {pose:?}");
        pose
    };
    let nominal = held_out(ParameterSet::Nominal).mean_mm;
    assert!((nominal / 0.708 - 1.0).abs() < 0.03, "{nominal}");
    let geometry = held_out(ParameterSet::Geometry).mean_mm;
    // the literature has 0.227 without the twist of axis 3, which belongs to the geometry here
    assert!((geometry / 0.211 - 1.0).abs() < 0.03, "{geometry}");
    let compliance = held_out(ParameterSet::Compliance);
    assert!(compliance.mean_mm < 0.129 && compliance.rms_mm < 0.147 && compliance.max_mm < 0.70, "{compliance:?}");
    assert!(held_out(ParameterSet::Complete).mean_mm < 0.092);
}

/// Of many coefficients the products of the Jacobian are kept from one step to the next: the minimum is the same wherever it starts.
#[test]
fn a_fit_of_many_coefficients_ends_at_one_minimum_from_anywhere() {
    let mut truth = truth(ParameterSet::Compliance, 9);
    let size = |n: f64| 1e-4 / n.sqrt();
    for joint in 2..=6 {
        for n in 2..=20 {
            let cycles = f64::from(n);
            for (name, shape) in [("sine", Shape::Sine { cycles }), ("cosine", Shape::Cosine { cycles })] {
                let basis = Basis::new(Variable::Joint { joint }, shape);
                let term = Term::new(format!("{name}_{n}_{joint}"), "made", Site::Joint { joint }, basis);
                truth.terms.push(Term { value: size(cycles) * (7.0 * cycles).sin(), ..term });
            }
        }
    }
    let data = build(touch(&truth, 300, 1e-5, 10));
    let of = |t: &Term| match t.basis.shape {
        Shape::Sine { cycles } | Shape::Cosine { cycles } => PriorKnowledge::about_zero(size(cycles)),
        _ => PriorKnowledge::NOTHING,
    };
    let known: Vec<PriorKnowledge> = truth.terms.iter().map(of).collect();
    let from = |factor: f64| {
        let mut model = truth.clone();
        model.terms.iter_mut().for_each(|t| t.value *= factor);
        fit_model_knowing(model, &data, &Noise::usual(1), &known, Vec::new()).unwrap().model.terms
    };
    let (near, far) = (from(1.01), from(0.0));
    assert!(near.len() > 200);
    for (a, b) in near.iter().zip(&far) {
        let sd = a.sd.unwrap();
        assert!((a.value - b.value).abs() < 1e-3 * sd, "{}: {} and {}, sd {sd}", a.name, a.value, b.value);
    }
}

#[test]
fn a_fit_from_far_away_ends_where_another_one_from_there_moves_nothing() {
    let data = build(touch(&truth(ParameterSet::Compliance, 3), 45, 1e-5, 3));
    let model = nominal();
    let mut far = identify(&model.robot, &model.cell, &data, ParameterSet::Compliance).unwrap().model;
    far.terms.iter_mut().for_each(|t| t.value = 0.0);
    let fit = |from: &Model| fit_model_knowing(from.clone(), &data, &Noise::usual(1), &[], Vec::new()).unwrap().model;
    let found = fit(&far);
    for (a, b) in found.terms.iter().zip(&fit(&found).terms) {
        let sd = a.sd.unwrap();
        assert!((a.value - b.value).abs() < 1e-5 * sd, "{}: {} and {}, sd {sd}", a.name, a.value, b.value);
    }
}
