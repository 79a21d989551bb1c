//! Diagnoses of arms whose truth is known.

use crate::arm::{build, touch, touch_in_sockets, truth};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use trical_diagnose::{Diagnosis, EffectId, Options, diagnose};
use trical_ident::{
    Aim, Dataset, ErrorSummary, JointSource, KnownParameters, ParameterSet, Scatter, identify, simulate,
};
use trical_model::{
    Basis, Cell, Forward, Measured, Model, Place, Pose, Recording, Shape, Site, State, Task, Term, Variable,
};

/// The truth with one more term, which the baseline does not have.
fn with_effect(site: Site, basis: Basis, value: f64) -> Model {
    let mut model = truth(ParameterSet::Compliance, 20);
    let mut term = Term::new("hidden", "hidden", site, basis);
    term.value = value;
    model.terms.push(term);
    model
}

fn diagnosed(model: &Model, seed: u64) -> Diagnosis {
    let data = build(touch(model, 150, 8e-6, seed));
    diagnose(&model.robot, &model.cell, &data, &Options::default(), &Task::silent()).unwrap()
}

#[test]
fn hidden_backlash_is_found_at_its_joint() {
    let half_gap = 0.01_f64.to_radians();
    let d = diagnosed(&with_effect(Site::Joint { joint: 4 }, Basis::direction(4), -half_gap), 21);
    assert_eq!(d.findings.len(), 1, "{:?}", d.findings);
    let f = &d.findings[0];
    assert_eq!((f.effect, f.site), (EffectId::LostMotionDirection, Place::Joint(4)));
    assert!((f.coefficients[0].value - 0.01).abs() < 5.0 * f.coefficients[0].sd.unwrap());
    assert!(f.evidence.holdout_rms_after_mm < 0.7 * f.evidence.holdout_rms_before_mm);
    assert!(f.evidence.forward_rms_after_mm < 0.7 * f.evidence.forward_rms_before_mm);
    assert!(d.unexplained.is_none());
}

#[test]
fn growth_with_a_recorded_temperature_is_named_with_its_coefficient() {
    let basis = Basis::new(Variable::Temperature { reference_c: 20.0 }, Shape::Linear);
    let model = with_effect(Site::Links, basis, 24e-6);
    let mut recording = touch(&model, 150, 8e-6, 25);
    // up and down again: what only tells earlier from later does not do the same
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    for (k, row) in recording.rows.iter_mut().enumerate() {
        let Measured::Touch { ball, reading } = &mut row.measured else { continue };
        let seen = |state: &State, ws: &mut _| {
            let pose = forward.world_from_tool(state, ws);
            pose.rotation.transpose() * (model.cell.balls[*ball] - pose.translation)
        };
        let before = seen(&row.state, &mut ws);
        row.state.temp_c = Some(20.0 + 12.0 * (k as f64 / 12.0).sin().abs());
        let by = seen(&row.state, &mut ws) - before;
        *reading = std::array::from_fn(|a| reading[a] + by[a]);
    }
    let d = diagnose(&model.robot, &model.cell, &build(recording), &Options::default(), &Task::silent()).unwrap();
    assert_eq!(d.findings.len(), 1, "{:?}", d.findings);
    let (f, c) = (&d.findings[0], &d.findings[0].coefficients[0]);
    assert_eq!(
        (f.effect, f.site, f.located.as_str()),
        (EffectId::ThermalGrowth, Place::Links, "all lengths grow with temperature")
    );
    assert_eq!(c.unit, "1/K");
    assert!((c.value - 24e-6).abs() < 4.0 * c.sd.unwrap() && c.sd.unwrap() < 3e-6, "{c:?}");
}

#[test]
fn a_threshold_that_has_no_name_is_located_and_not_named() {
    let at = 0.3;
    let basis = Basis::new(Variable::Joint { joint: 4 }, Shape::Step { at });
    let d = diagnosed(&with_effect(Site::Joint { joint: 5 }, basis, 0.03_f64.to_radians()), 22);
    let u = d.unexplained.expect("something is left without a name");
    assert_eq!((u.site, u.variable.as_str()), (Place::Joint(5), "q4"));
    assert!(d.findings.is_empty(), "{:?}", d.findings);
    assert!(u.holdout_rms_after_mm < 0.7 * u.holdout_rms_before_mm);
}

#[test]
fn where_nothing_is_hidden_nothing_is_named() {
    let mut alarms = 0;
    for seed in 0..20 {
        let d = diagnosed(&truth(ParameterSet::Compliance, 30 + seed), 60 + seed);
        alarms += u32::from(!d.findings.is_empty() || d.unexplained.is_some());
        assert!(d.baseline.lack_of_fit_p > 1e-4);
    }
    assert!(alarms <= 1, "{alarms} false alarms in 20");
}

#[test]
fn the_noise_of_nulled_readings_is_no_gain_error() {
    // the arm stands exactly on the ball, and the reading is nothing but noise
    let model = truth(ParameterSet::Compliance, 40);
    let mut recording = touch(&model, 150, 0.0, 41);
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(42);
    let normal = rand_distr::Normal::new(0.0, 8e-6).unwrap();
    for row in &mut recording.rows {
        let Measured::Touch { ball, reading } = &mut row.measured else { continue };
        let pose = forward.world_from_tool(&row.state, &mut ws);
        let on = Pose { rotation: pose.rotation, translation: model.cell.balls[*ball] };
        row.state.q = trical_model::ik::continue_from(&forward, &on, &row.state, &mut ws).unwrap();
        *reading = std::array::from_fn(|_| rand_distr::Distribution::sample(&normal, &mut rng));
    }
    let d = diagnose(&model.robot, &model.cell, &build(recording), &Options::default(), &Task::silent()).unwrap();
    assert!(d.findings.is_empty(), "{:?}", d.findings);
    assert_eq!(d.baseline.reading_noise.len(), 1);
    assert!(d.blind_to.iter().any(|b| b.effect == EffectId::IndicatorGain && b.lacks.is_some()));
}

#[test]
fn readings_at_poses_as_they_were_planned_are_not_made_smaller_to_fit() {
    // where the nominal arm touches its balls, readings and errors that are all smaller by one share fit as well, with less noise
    let model = truth(ParameterSet::Compliance, 40);
    let planned = Forward::new(Model::nominal(model.robot.clone(), model.cell.clone()), Vec::new()).unwrap();
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let (mut there, mut ws) = (planned.workspace(), forward.workspace());
    let mut rng = Pcg64Mcg::seed_from_u64(45);
    let normal = rand_distr::Normal::new(0.0, 8e-6).unwrap();
    let mut diagnosed = |gain: f64, seed: u64| {
        let mut recording = touch(&model, 150, 0.0, seed);
        recording.rows.retain_mut(|row| {
            let Measured::Touch { ball, reading } = &mut row.measured else { return false };
            let rotation = planned.world_from_tool(&row.state, &mut there).rotation;
            let on = Pose { rotation, translation: model.cell.balls[*ball] };
            // near a joint's limit it may not get there
            let Ok(q) = trical_model::ik::continue_from(&planned, &on, &row.state, &mut there) else { return false };
            row.state.q = q;
            let pose = forward.world_from_tool(&row.state, &mut ws);
            let y = pose.rotation.transpose() * (model.cell.balls[*ball] - pose.translation);
            *reading = [y.x / (1.0 + gain), y.y, y.z].map(|y| y + rand_distr::Distribution::sample(&normal, &mut rng));
            true
        });
        diagnose(&model.robot, &model.cell, &build(recording), &Options::default(), &Task::silent()).unwrap()
    };
    let plain = diagnosed(0.0, 46);
    assert!(plain.findings.is_empty(), "{:?}", plain.findings);
    for seed in 46..52 {
        let off = diagnosed(0.035, seed);
        let said: Vec<(EffectId, Place)> = off.findings.iter().map(|f| (f.effect, f.site)).collect();
        assert_eq!(said, [(EffectId::IndicatorGain, Place::Axis(trical_model::Axis::X))], "{seed}");
        assert!([&plain, &off].iter().all(|d| d.cautions.iter().all(|c| !c.contains("the device moved"))));
    }
}

#[test]
fn a_gain_shows_beside_errors_of_the_arm_that_are_as_large_as_the_readings() {
    // readings spread by 0.2 mm; the arm's backlash is as large, so that they look nulled until it is found
    let model = truth(ParameterSet::Compliance, 40);
    let mut recording = touch(&model, 200, 0.0, 43);
    let mut real = model.clone();
    let gap = Term::new("hidden", "hidden", Site::Joint { joint: 2 }, Basis::direction(2));
    real.terms.push(Term { value: -1e-3, ..gap });
    let forward = Forward::new(real.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(44);
    let normal =
        |sd: f64, rng: &mut Pcg64Mcg| rand_distr::Distribution::sample(&rand_distr::Normal::new(0.0, sd).unwrap(), rng);
    for row in &mut recording.rows {
        let Measured::Touch { ball, reading } = &mut row.measured else { continue };
        row.state.dir = Some(std::array::from_fn(|_| if normal(1.0, &mut rng) > 0.0 { 1 } else { -1 }));
        let pose = forward.world_from_tool(&row.state, &mut ws);
        let off = nalgebra::Vector3::from_fn(|_, _| normal(2e-4, &mut rng));
        let near = Pose { rotation: pose.rotation, translation: real.cell.balls[*ball] + off };
        row.state.q = trical_model::ik::continue_from(&forward, &near, &row.state, &mut ws).unwrap();
        let pose = forward.world_from_tool(&row.state, &mut ws);
        let y = pose.rotation.transpose() * (real.cell.balls[*ball] - pose.translation);
        *reading = [y.x / 1.08, y.y, y.z].map(|y| y + normal(8e-6, &mut rng));
    }
    let d = diagnose(&model.robot, &model.cell, &build(recording), &Options::default(), &Task::silent()).unwrap();
    let named: Vec<EffectId> = d.findings.iter().map(|f| f.effect).collect();
    assert_eq!(named, [EffectId::LostMotionDirection, EffectId::IndicatorGain]);
    assert!((d.findings[1].coefficients[0].value - 0.08).abs() < 0.01, "{:?}", d.findings[1].coefficients);
    assert!(d.baseline.reading_noise.is_empty(), "{:?}", d.baseline.reading_noise);
}

#[test]
fn a_joint_whose_zero_differs_between_sessions_is_told_as_of_one_of_them_and_of_two_not_of_which() {
    let model = truth(ParameterSet::Compliance, 45);
    let mut other = model.clone();
    let off = Term::new("hidden", "hidden", Site::Joint { joint: 3 }, Basis::CONSTANT);
    other.terms.push(Term { value: 1e-3, ..off });
    let sessions = |arms: &[&Model]| {
        let all: Vec<Recording> = (0..).zip(arms).map(|(k, arm)| touch(arm, 100, 8e-6, 46 + k)).collect();
        let data = Dataset::build(&all, JointSource::Read, None).unwrap();
        let d = diagnose(&model.robot, &model.cell, &data, &Options::default(), &Task::silent()).unwrap();
        assert_eq!(d.findings.len(), 1, "{:?}", d.findings);
        let f = &d.findings[0];
        assert_eq!((f.effect, f.site), (EffectId::JointZeroShift, Place::Joint(3)));
        let undecided = d.cautions.iter().any(|c| c.contains("two sessions cannot show"));
        (f.session, f.coefficients[0].value, undecided, d.rejected.len())
    };
    let (session, size, undecided, rejected) = sessions(&[&model, &other]);
    assert!(session.is_some() && undecided && rejected == 0);
    assert!((size.abs() - 1e-3_f64.to_degrees()).abs() < 2e-3, "{size}");
    let (session, size, undecided, _) = sessions(&[&model, &other, &model]);
    assert!(session == Some(2) && !undecided && (size - 1e-3_f64.to_degrees()).abs() < 2e-3, "{session:?} {size}");
}

#[test]
fn touches_and_full_poses_of_one_arm_are_diagnosed_together() {
    let mut model = truth(ParameterSet::Compliance, 47);
    let touched = touch(&model, 80, 8e-6, 48);
    model.frames = vec![Pose::identity()];
    let poses: Vec<_> = touch(&model, 80, 0.0, 49).rows.iter().map(|r| (r.state, Aim::Pose)).collect();
    let seen = simulate(&model, &poses, &Scatter { length: 1e-5, angle: 5e-5, seed: 50 }, None).unwrap();
    let data = Dataset::build(&[touched, seen], JointSource::Read, None).unwrap();
    let d = diagnose(&model.robot, &model.cell, &data, &Options::default(), &Task::silent()).unwrap();
    assert!(d.findings.is_empty() && d.after.holdout_rms_mm < 0.03, "{:?} {}", d.findings, d.after.holdout_rms_mm);
}

/// Three targets on the hand of an arm that stands on a rail of 6 m, seen by a tracker at 200 places.
fn on_rail(bend: f64, turn: f64) -> (Model, Dataset) {
    use rand::RngExt;
    use trical_ident::simulate::{Aim, Scatter, simulate};
    use trical_model::{Axis, JointKind, Parameter, Shape, State, Variable};
    let mut model = truth(ParameterSet::Geometry, 70);
    model.terms.clear();
    let mut rail = model.robot.joints[0].clone();
    rail.kind = JointKind::Prismatic;
    (rail.alpha, rail.a, rail.d, rail.theta_offset) = (-std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0);
    rail.limits = [0.0, 6.0];
    model.robot.joints[0].alpha += std::f64::consts::FRAC_PI_2;
    model.robot.joints.insert(0, rail);
    let tip = model.cell.tool.tcp;
    model.cell.tool.targets =
        [[0.0, 0.0, 0.0], [0.15, 0.0, -0.03], [0.0, 0.15, -0.03]].map(|d| tip + nalgebra::Vector3::from(d)).to_vec();
    let mut real = model.clone();
    // a bow that no straight pieces follow wholly, and a yaw
    let along = |shape| Basis::new(Variable::Joint { joint: 1 }, shape);
    let bow = along(Shape::Sine { cycles: std::f64::consts::PI / 6.0 });
    let site = Site::Link { link: 1, parameter: Parameter::A };
    real.terms.push(Term { value: bend, ..Term::new("bow", "hidden", site, bow) });
    let yaw = Site::Tilt { joint: 1, axis: Axis::X };
    real.terms.push(Term { value: turn / 6.0, ..Term::new("yaw", "hidden", yaw, along(Shape::Linear)) });
    let mut rng = Pcg64Mcg::seed_from_u64(71);
    let rows: Vec<(State, Aim)> = (0..200)
        .flat_map(|_| {
            let q: [f64; 7] =
                std::array::from_fn(|k| if k == 0 { rng.random_range(0.2..5.8) } else { rng.random_range(-1.5..1.5) });
            [0, 1, 2].map(|target| (State::at(&q), Aim::Target(target)))
        })
        .collect();
    let seen = simulate(&real, &rows, &Scatter { length: 3e-5, angle: 0.0, seed: 72 }, None).unwrap();
    (model, build(seen))
}

#[test]
fn a_bent_rail_and_a_carriage_that_turns_are_named_and_a_straight_rail_is_not() {
    let asked = |bend, turn| {
        let (model, data) = on_rail(bend, turn);
        let d = diagnose(&model.robot, &model.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let found: Vec<_> = d.findings.iter().map(|f| (f.effect, f.site)).collect();
        (d, found)
    };
    let (bent, found) = asked(4e-4, 0.0);
    assert_eq!(found, [(EffectId::RailError, Place::Joint(1))]);
    let evidence = &bent.findings[0].evidence;
    assert!(evidence.holdout_rms_after_mm < 0.5 * evidence.holdout_rms_before_mm);
    assert_eq!(asked(0.0, 5e-4).1, [(EffectId::RailError, Place::Joint(1))]);
    assert_eq!(asked(0.0, 0.0).1, []);
}

#[test]
fn what_is_known_beforehand_stays_known_in_a_diagnosis() {
    let model = truth(ParameterSet::Compliance, 30);
    let data = build(touch(&model, 90, 8e-6, 60));
    let with = |known| {
        let options = Options { known, ..Options::default() };
        diagnose(&model.robot, &model.cell, &data, &options, &Task::silent())
    };
    let known = |name: &str, value: f64, sd: f64| {
        let text = format!("[[parameter]]\nname = \"{name}\"\nvalue = {value}\nsd = {sd}\n");
        KnownParameters::parse(&text, "known.toml").unwrap()
    };
    let a_2 = |d: &Diagnosis| d.model.terms.iter().find(|t| t.name == "a_2").map(|t| (t.value, t.sd.unwrap())).unwrap();
    let term = model.terms.iter().find(|t| t.name == "a_2").unwrap();
    let at = trical_ident::shown(&model, term).value;
    let plain = with(KnownParameters::default()).unwrap();
    // to 0.1 um, as from a coordinate measuring machine
    let right = with(known("a_2", at, 1e-4)).unwrap();
    assert!(right.findings.is_empty() && right.unexplained.is_none());
    assert!((a_2(&right).0 - term.value).abs() < 1e-6 && a_2(&right).1 < 1.1e-7, "{:?}", a_2(&right));
    assert!(a_2(&plain).1 > 10.0 * a_2(&right).1, "{:?}", a_2(&plain));
    // half a millimetre wrong: the diagnosis does not fit it away, and says that the plain model does not hold
    let wrong = with(known("a_2", at + 0.5, 1e-4)).unwrap();
    assert!((a_2(&wrong).0 - term.value - 5e-4).abs() < 1e-6, "{:?}", a_2(&wrong));
    assert!(wrong.baseline.rms_mm > 2.0 * plain.baseline.rms_mm);
    // what says nothing changes nothing
    let weak = with(known("a_2", at, 1e3)).unwrap();
    assert!((a_2(&weak).0 - a_2(&plain).0).abs() < 1e-9 && weak.findings.is_empty());
    let e = with(known("a_9", 1.0, 1.0)).unwrap_err().to_string();
    assert!(e.starts_with("known.toml: parameter a_9 is not among those that are identified here"), "{e}");
}

#[test]
fn the_plain_model_of_an_arm_without_masses_has_its_sag_as_identify_has() {
    let model = truth(ParameterSet::Compliance, 80);
    let data = build(touch(&model, 150, 8e-6, 81));
    let mut robot = model.robot.clone();
    robot.joints.iter_mut().for_each(|joint| joint.mass = None);
    let d = diagnose(&robot, &model.cell, &data, &Options::default(), &Task::silent()).unwrap();
    let rms = |set| {
        let errors = identify(&robot, &model.cell, &data, set).unwrap().errors().unwrap();
        ErrorSummary::of(&errors).rms_mm
    };
    assert!((d.baseline.rms_mm / rms(ParameterSet::Compliance) - 1.0).abs() < 0.02, "{}", d.baseline.rms_mm);
    assert!(
        d.baseline.rms_mm < 0.7 * rms(ParameterSet::Geometry),
        "{} {}",
        d.baseline.rms_mm,
        rms(ParameterSet::Geometry)
    );
    assert!(!d.findings.iter().any(|f| matches!(f.site, Place::Joint(2 | 3))), "{:?}", d.findings);
    assert!(d.cautions.iter().any(|c| c.contains("way to gravity")), "{:?}", d.cautions);
}

#[test]
fn in_sockets_at_unknown_places_a_gap_is_named_and_nothing_where_nothing_is() {
    let text = "[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [15, -10, 120]\n[balls]\ndistances_mm = { d12 = 50.0 }";
    let cell = Cell::parse(text, "cell.toml").unwrap();
    let of = |half_gap: f64| {
        let mut model = truth(ParameterSet::Compliance, 3);
        let gap = Term::new("hidden", "hidden", Site::Joint { joint: 2 }, Basis::direction(2));
        model.terms.push(Term { value: -half_gap, ..gap });
        let recording = touch_in_sockets(&mut model, &cell, &[0, 1, 2, 3, 4], 5e-5, 5);
        let mut d = diagnose(&model.robot, &cell, &build(recording), &Options::default(), &Task::silent()).unwrap();
        d.findings.retain(|f| f.confidence >= 0.5);
        (d.findings.iter().map(|f| (f.effect, f.site)).collect::<Vec<_>>(), d)
    };
    let (found, d) = of(0.03_f64.to_radians());
    assert_eq!(found, [(EffectId::LostMotionDirection, Place::Joint(2))]);
    assert!((d.findings[0].coefficients[0].value - 0.03).abs() < 5.0 * d.findings[0].coefficients[0].sd.unwrap());
    let [plain, whole] = [d.baseline.by_place, d.after.held_out.by_place].map(Option::unwrap);
    assert!(whole.mean_mm < 0.8 * plain.mean_mm, "{plain:?} {whole:?}");
    assert_eq!(d.after.held_out.forward, None, "the last quarter is a place that was not seen before");
    assert_eq!(of(0.0).0, []);
}
