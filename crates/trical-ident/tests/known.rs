//! Priors and limits: what is known of parameters before they are measured.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::{Choice, Dataset, Identified, JointSource, KnownParameters, ParameterSet, identify};
use trical_model::{Basis, Cell, Forward, Measured, Model, Recording, Robot, Row, Shape, Site, State, Term};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

fn nominal() -> Model {
    Model::nominal(Robot::parse(ROBOT, "arm.toml").unwrap(), Cell::parse(CELL, "cell.toml").unwrap())
}

/// Points of a nominal arm but for the compliance of joint 2 (rad/Nm), with noise.
fn data(n: usize, compliance: f64) -> Dataset {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut model = nominal();
    let basis = Basis::torque(2, Shape::Linear);
    let soft = Term { value: compliance, ..Term::new("c_2", "compliance", Site::Joint { joint: 2 }, basis) };
    model.terms.push(soft);
    let forward = Forward::new(model, Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let rows = (0..n)
        .map(|k| {
            let q: [f64; 6] = std::array::from_fn(|_| rng.random_range(-1.2..1.2));
            let state = State::at(&q);
            let mut position: [f64; 3] = forward.world_from_tool(&state, &mut ws).translation.into();
            for v in &mut position {
                *v += rng.random_range(-2e-5..2e-5);
            }
            Row { state, measured: Measured::Point { target: 0, position }, seq: None, line: k + 2 }
        })
        .collect();
    let recording = Recording { name: "made".into(), joints: 6, rows, ..Recording::default() };
    Dataset::build(&[recording], JointSource::Read, None).unwrap()
}

fn fitted(data: &Dataset, known: &str) -> Identified {
    let choice = Choice::from(ParameterSet::Compliance).knowing(KnownParameters::parse(known, "known.toml").unwrap());
    let model = nominal();
    identify(&model.robot, &model.cell, data, choice).unwrap()
}

fn term(f: &Identified, name: &str) -> (f64, Option<f64>) {
    let t = f.model.terms.iter().find(|t| t.name == name).unwrap();
    (t.value, t.sd)
}

/// Sum of squared position errors, m^2.
fn square(f: &Identified) -> f64 {
    f.errors().unwrap().iter().map(|e| e * e).sum()
}

fn refused(known: &str) -> String {
    match KnownParameters::parse(known, "known.toml") {
        Err(e) => e.to_string(),
        Ok(known) => {
            let model = nominal();
            let choice = Choice::from(ParameterSet::Compliance).knowing(known);
            identify(&model.robot, &model.cell, &data(60, 0.0), choice).unwrap_err().to_string()
        }
    }
}

#[test]
fn what_is_known_of_parameters_may_be_more_than_what_is_measured() {
    // lengths to 0.05 mm, angles to 0.02 deg
    let of = |t: &Term| {
        let shown = trical_ident::shown(&nominal(), t);
        let sd = if shown.unit == "mm" { 0.05 } else { 0.02 };
        format!("[[parameter]]\nname = '{}'\nvalue = {}\nsd = {sd}\n", t.name, shown.nominal.unwrap())
    };
    let whole = fitted(&data(60, 0.0), "[[parameter]]\nname = 'c_2'\nmin = -100");
    let geometry = whole.model.terms.iter().filter(|t| t.effect == "geometry");
    let f = fitted(&data(6, 0.0), &geometry.map(of).collect::<String>());
    assert!(f.model.terms.len() > 18, "{} parameters of 18 numbers", f.model.terms.len());
    assert!(f.model.terms.iter().all(|t| t.sd.is_some_and(f64::is_finite)));
    // 20 um where 6 points were measured
    assert!(f.errors().unwrap().iter().all(|e| *e < 1e-4));
}

#[test]
fn a_limit_holds_and_the_others_are_as_if_it_were_fixed_there() {
    let data = data(60, -2e-5);
    let free = fitted(&data, "[[parameter]]\nname = 'c_2'\nmin = -100");
    assert!(free.at_limit.is_empty());
    let (value, sd) = term(&free, "c_2");
    assert!((value + 2e-5).abs() < 4.0 * sd.unwrap() && sd.unwrap() > 0.0, "{value} {sd:?}");

    let held = fitted(&data, "[[parameter]]\nname = 'c_2'\nmin = 0");
    assert_eq!(term(&held, "c_2"), (0.0, None));
    let names: Vec<&str> = held.at_limit.iter().map(|k| held.model.terms[*k].name.as_str()).collect();
    assert_eq!(names, ["c_2"]);
    // in units of the noise that each is left with, both cost the same
    assert!(square(&held) > 2.0 * square(&free));
    // the same as if joint 2 were not among the compliant ones
    let others = Choice::new(ParameterSet::Compliance, &[3, 4, 5, 6], 6).unwrap();
    let model = nominal();
    let without = identify(&model.robot, &model.cell, &data, others).unwrap();
    for t in without.model.terms.iter().filter(|t| t.effect != "compliance") {
        let (value, sd) = term(&held, &t.name);
        assert!((value - t.value).abs() < 1e-3 * t.sd.unwrap(), "{}: {value} {}", t.name, t.value);
        assert!((sd.unwrap() / t.sd.unwrap() - 1.0).abs() < 0.1, "{}", t.name);
    }
}

#[test]
fn many_limits_end_at_a_minimum_within_them() {
    let data = data(60, 2e-5);
    let free = fitted(&data, "[[parameter]]\nname = 'c_2'\nmin = -100");
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut stopped = 0;
    for _ in 0..20 {
        // limits about values that are wrong by some standard deviations
        let mut known = String::new();
        for t in free.model.terms.iter().filter(|t| t.effect == "geometry" || t.effect == "compliance") {
            if rng.random_bool(0.3) {
                let s = trical_ident::shown(&nominal(), t);
                let low = rng.random_range(-8.0..2.0);
                let high = low + rng.random_range(1.0..8.0);
                let (a, b) = (s.value + low * s.sd.unwrap(), s.value + high * s.sd.unwrap());
                known += &format!("[[parameter]]\nname = '{}'\nmin = {a}\nmax = {b}\n", t.name);
            }
        }
        if known.is_empty() {
            continue;
        }
        let f = fitted(&data, &known);
        stopped += f.at_limit.len();
        // what is not held is at a minimum, what is held would have to pass its limit: Karush, Kuhn and Tucker
        assert!(f.report.gradient < 1e-4, "{:?}", f.report);
        assert!(square(&f) >= square(&free) * (1.0 - 1e-6));
        let limits: toml::Table = known.parse().unwrap();
        for k in limits["parameter"].as_array().unwrap() {
            let name = k["name"].as_str().unwrap();
            let t = f.model.terms.iter().find(|t| t.name == name).unwrap();
            let (value, [a, b]) = (
                trical_ident::shown(&nominal(), t).value,
                [k["min"].as_float().unwrap(), k["max"].as_float().unwrap()],
            );
            let slack = 1e-9 * (b - a);
            assert!(value >= a - slack && value <= b + slack, "{name}: {value} outside {a} to {b}");
            assert_eq!(t.sd.is_none(), value < a + slack || value > b - slack, "{name}");
        }
    }
    assert!(stopped > 20, "{stopped}");
}

#[test]
fn a_prior_weighs_as_much_as_it_says() {
    let data = data(60, 2e-5);
    let shown = |f: &Identified| f.model.terms.iter().find(|t| t.name == "a_2").unwrap().clone();
    let free = shown(&fitted(&data, "[[parameter]]\nname = 'c_2'\nmin = -100"));
    let said = trical_ident::shown(&nominal(), &free);
    let (at, sd) = (said.value, said.sd.unwrap());
    // as sure as the measurement and two of its standard deviations away: half way between, and 1/sqrt(2) as unsure
    let known = format!("[[parameter]]\nname = 'a_2'\nvalue = {}\nsd = {sd}", at + 2.0 * sd);
    let both = trical_ident::shown(&nominal(), &shown(&fitted(&data, &known)));
    assert!((both.value - (at + sd)).abs() < 0.1 * sd, "{} between {at} and {}", both.value, at + 2.0 * sd);
    assert!((both.sd.unwrap() / sd - 0.5_f64.sqrt()).abs() < 0.05);
    // a sure one decides
    let known = format!("[[parameter]]\nname = 'a_2'\nvalue = {}\nsd = {}", at + 2.0 * sd, 1e-3 * sd);
    let sure = trical_ident::shown(&nominal(), &shown(&fitted(&data, &known)));
    assert!((sure.value - (at + 2.0 * sd)).abs() < 1e-3 * sd);
}

#[test]
fn what_a_file_may_not_say() {
    for (text, word) in [
        ("", "expected tables [[parameter]]"),
        ("[[parameter]]\nname = 'a_2'", "neither value nor min nor max"),
        ("[[parameter]]\nname = 'a_2'\nvalue = 1", "no sd"),
        ("[[parameter]]\nname = 'a_2'\nsd = 1", "no value"),
        ("[[parameter]]\nname = 'a_2'\nvalue = 1\nsd = 0", "expected more than 0"),
        ("[[parameter]]\nname = 'a_2'\nmin = 1\nmax = 1", "is not below max"),
        ("[[parameter]]\nname = 'a_2'\nmin = inf", "expected a finite number"),
        ("[[parameter]]\nname = 'a_2'\nmin = 1\n[[parameter]]\nname = 'a_2'\nmin = 1", "twice"),
        ("[[parameter]]\nname = 'a_2'\nleast = 1", "line 3"),
        ("[[parameter]]\nname = 'a_9'\nmin = 1", "not among those that are identified here: "),
        ("[[parameter]]\nname = 'frame_x'\nmin = 1", "comes from the measurements alone"),
    ] {
        let said = refused(text);
        assert!(said.starts_with("known.toml") && said.contains(word), "{text:?}: {said}");
    }
}

#[test]
fn limits_of_a_gap_are_those_of_what_is_lost() {
    let mut model = nominal();
    model.terms = vec![Term::new("half_gap_2", "lost_motion_direction", Site::Joint { joint: 2 }, Basis::direction(2))];
    let known = KnownParameters::parse("[[parameter]]\nname = \"half_gap_2\"\nmin = 0.0\n", "known.toml").unwrap();
    // in the angle, against the sense of motion
    assert_eq!(known.of(&model).unwrap()[0].limits, [f64::NEG_INFINITY, -0.0]);
}
