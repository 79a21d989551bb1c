//! What evidence is, and where the search stops: claims that deliberate errors in the code (see docs/hardening.md) went against
//! unnoticed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_diagnose::candidate::{Candidate, Physical};
use trical_diagnose::catalogue::catalogue;
use trical_diagnose::covariates::Covariates;
use trical_diagnose::linear::Design;
use trical_diagnose::locators::{describe, locators};
use trical_diagnose::selection::Search;
use trical_diagnose::{Cause, EffectId};
use trical_ident::{Dataset, JointSource, Noise};
use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Place, Recording, Robot, Row, Shape, Site, State, Term,
    Variable,
};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

/// A model whose tool is to be fitted, and 60 touches with noise.
fn made() -> (Model, Dataset) {
    made_of(60)
}

fn made_of(touches: usize) -> (Model, Dataset) {
    let mut model = Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap());
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let rows = (0..touches)
        .map(|k| {
            let q: [f64; 6] = std::array::from_fn(|_| rng.random_range(-1.2..1.2));
            let state = State::at(&q);
            let pose = forward.world_from_tool(&state, &mut ws);
            let i = pose.rotation.transpose() * (model.cell.balls[k % 3] - pose.translation);
            let reading = std::array::from_fn(|a| i[a] + 3e-5 * rng.random_range(-1.0..1.0));
            Row { state, measured: Measured::Touch { ball: k % 3, reading }, seq: None, line: k + 2 }
        })
        .collect();
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    for (name, axis) in [("tool_x", Axis::X), ("tool_y", Axis::Y), ("tool_z", Axis::Z)] {
        model.terms.push(Term::new(name, "tool", Site::Tool(Motion::Along(axis)), Basis::CONSTANT));
    }
    (model, Dataset::build(&[recording], JointSource::Read, None).unwrap())
}

/// Something at joint 2, a function of its angle.
fn candidate(shape: Shape, scale: f64) -> Candidate {
    let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
    Candidate {
        cause: Cause::Unexplained,
        site: Place::Joint(2),
        behaviour: String::new(),
        terms: vec![Term::new("made", "made", Site::Joint { joint: 2 }, basis)],
        signs: vec![0],
        physical: Physical::default(),
        typical: scale,
        scales: vec![scale],
        log_prior: 0.0,
    }
}

/// What a search with this candidate alone says of it, nats, and whether it chooses it.
fn judged(candidate: Candidate) -> (f64, bool) {
    let (model, data) = made();
    let candidates = [candidate];
    let design = Design::new(&model, &candidates, &data, &Noise::usual(1)).unwrap();
    let mut search = Search::new(&design, &candidates, 1.0);
    let start = design.start();
    let evidence = search.evidence(&start, 0).unwrap().evidence;
    (evidence, !search.choose(&start, &[]).is_empty())
}

#[test]
fn two_nats_are_asked_for() {
    let wave = candidate(Shape::Sine { cycles: 2.0 }, 1e-3);
    let (plain, _) = judged(wave.clone());
    for (evidence, chosen) in [(1.9, false), (2.1, true)] {
        let told = judged(Candidate { log_prior: evidence - plain, ..wave.clone() });
        assert!((told.0 - evidence).abs() < 1e-9 && told.1 == chosen, "{told:?}");
    }
}

#[test]
fn a_coefficient_pays_for_the_range_in_which_it_could_have_been() {
    // well determined in either range: e^2 times as wide costs 2 nats
    let (narrow, _) = judged(candidate(Shape::Sine { cycles: 2.0 }, 1e-2));
    let (wide, _) = judged(candidate(Shape::Sine { cycles: 2.0 }, 1e-2 * 2.0_f64.exp()));
    assert!((narrow - wide - 2.0).abs() < 0.01, "{narrow} {wide}");
}

#[test]
fn a_step_is_told_by_its_smaller_side() {
    let (model, data) = made();
    for (at, region) in [(-0.9, "q2 < -51.6 deg"), (0.9, "q2 > 51.6 deg")] {
        let step = candidate(Shape::Step { at }, 1e-3);
        assert_eq!(describe(&step, std::iter::once(&step), &model, &data).region, region);
    }
}

#[test]
fn an_arm_that_carries_more_gives_way_less() {
    let (mut model, data) = made();
    let of = |model: &Model| {
        let recorded = Covariates::new(model, &data, 1e-5);
        let all = catalogue(&recorded, &[]).0;
        let is_it = |c: &&Candidate| c.cause == EffectId::CrossAxisCompliance.into() && c.site == Place::Joint(2);
        (recorded.strength(), all.iter().find(is_it).unwrap().scales[0])
    };
    let (weak, soft) = of(&model);
    for joint in &mut model.robot.joints {
        joint.mass = joint.mass.map(|m| 100.0 * m);
    }
    let (strong, stiff) = of(&model);
    assert!((weak - 1.0).abs() < 1e-12 && strong > 4.0, "{weak} {strong}");
    assert!((soft / stiff - strong).abs() < 1e-9 * strong, "{soft} {stiff}");
}

#[test]
fn a_curve_is_fine_where_there_are_values_for_it() {
    let most = |touches| {
        let (model, data) = made_of(touches);
        locators(&model, &data).iter().map(|c| c.terms.len()).max().unwrap()
    };
    // the first knot is the joint's own constant
    assert_eq!([most(60), most(639), most(640)], [15, 15, 31]);
}

#[test]
fn the_softest_gap_is_the_curve_of_a_soft_joint() {
    let (model, data) = made();
    let all = catalogue(&Covariates::new(&model, &data, 1e-5), &[]).0;
    for joint in 2..=3 {
        let of = |effect: EffectId| -> Vec<Basis> {
            let here = |c: &&Candidate| c.cause == effect.into() && c.site == Place::Joint(joint);
            all.iter().filter(here).map(|c| c.terms[0].basis).collect()
        };
        let soft = of(EffectId::NonlinearStiffness);
        assert!(of(EffectId::LostMotionGravity).iter().any(|gap| soft.contains(gap)), "joint {joint} shares no curve");
    }
}

#[test]
fn a_joint_gives_way_about_any_point_of_its_axis() {
    let (model, data) = made();
    let all = catalogue(&Covariates::new(&model, &data, 1e-5), &[]).0;
    let points = |joint| {
        let here = |c: &&Candidate| c.cause == EffectId::CrossAxisCompliance.into() && c.site == Place::Joint(joint);
        all.iter().filter(here).map(|c| (c.share(), c.located())).collect::<Vec<_>>()
    };
    // base and table at their foot only, a joint without an offset at its origin only
    assert_eq!((points(1).len(), points(2).len()), (1, 1));
    let shares: Vec<Option<f64>> = points(4).iter().map(|p| p.0).collect();
    assert_eq!(shares, [None, None, Some(0.25), Some(0.5), Some(0.75)]);
    assert!(
        points(4)[2].1.ends_with("about a point 25 % of the way from its origin to its foot"),
        "{}",
        points(4)[2].1
    );
}

/// A cable that pulls joint 5 by the angles of joints 5 and 4 is found, and told by both.
#[test]
fn what_two_angles_tell_together_is_one_curve() {
    let (mut model, data) = made();
    let cable = locators(&model, &data)
        .into_iter()
        .find(|c| c.site == Place::Joint(5) && c.terms.iter().any(|t| t.basis.beside.is_some_and(|b| b.joint == 4)));
    let cable = cable.unwrap();
    assert_eq!(cable.terms.len(), 4);
    let sizes = [2e-4, -1e-4, 3e-4, -2e-4];
    model.terms.extend(cable.terms.iter().zip(sizes).map(|(t, value)| Term { value, ..t.clone() }));
    let told = describe(&cable, std::iter::once(&cable), &model, &data);
    assert_eq!((told.variable.as_str(), told.region.as_str()), ("q4", "all of q4, with q5"));
    let (middle, at) = {
        let mut own: Vec<f64> = data.observations.iter().map(|o| o.state.q[4]).collect();
        own.sort_by(f64::total_cmp);
        (own[own.len() / 2], told.curve[7])
    };
    let ([s, c], [u, v]) = ([middle.sin(), middle.cos()], [at.0.to_radians().sin(), at.0.to_radians().cos()]);
    let [a, b, d, e] = sizes;
    let expected = s * (a * u + b * v) + c * (d * u + e * v);
    assert!((at.1.to_radians() - expected).abs() < 1e-12, "{at:?} {expected}");
}
