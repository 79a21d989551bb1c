//! Identification and identifiability.

use trical_ident::fit::identifiability::{independent_terms, observability, r_factor};
use trical_ident::fit::identify::prepared;
use trical_ident::{Choice, Dataset, Identified, JointSource, Noise, ParameterSet, fit_model, identify, load_csv};
use trical_model::{Forward, Measured, Model, State};

use crate::{Task, report, time};

pub fn load(task: &Task, name: &str) -> Dataset {
    let recording = load_csv(&task.path(name), 6).unwrap();
    Dataset::build(&[recording], JointSource::Read, None).unwrap()
}

/// Root of the mean square of the position errors at the poses that no fit has seen, in words.
fn held_out(task: &Task, kind: &str, model: &Model) -> String {
    let data = load(task, &format!("{kind}_heldout.csv"));
    let forward = Forward::new(model.clone(), Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut sum = 0.0;
    for o in &data.observations {
        let Measured::Point { target, position } = o.measured else { continue };
        let miss = if model.frames.is_empty() {
            // fitted to touches: {w} is where the held-out points were measured
            let pose = forward.world_from_tool(&State::at(&o.state.q[..6]), &mut ws);
            (pose.translation - vector(position)).norm_squared()
        } else {
            forward.residual(&o.state, &Measured::Point { target, position }, 0, &mut ws);
            ws.residual()[..3].iter().map(|x| x * x).sum()
        };
        sum += miss;
    }
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let rms = (sum / data.observations.len() as f64).sqrt();
    format!("{:.2} um", 1e6 * rms)
}

fn vector(v: [f64; 3]) -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::from(v)
}

pub fn run(task: &Task) {
    let nominal = task.nominal("cell.toml");
    for (kind, set, parameters) in
        [("rigid", ParameterSet::Geometry, "26 parameters"), ("elastic", ParameterSet::Compliance, "31 parameters")]
    {
        for (file, what) in [("touches", "45 touches"), ("points", "1000 poses")] {
            let row = format!("identification, {what}, {parameters}");
            if !task.wants(&row) {
                continue;
            }
            let data = load(task, &format!("{kind}_{file}.csv"));
            let fit = || identify(&nominal.robot, &nominal.cell, &data, set).unwrap();
            let words = held_out(task, kind, &fit().model);
            let t = time(9, |_| fit().covariance[0]);
            report(&row, "TriCal, Rust: choice of parameters, fit, covariance", t, &words);
            let start = prepared(&nominal.robot, &nominal.cell, &data, &Choice::from(set)).unwrap().0;
            let only = || -> Identified { fit_model(start.clone(), &data, &Noise::usual(1), Vec::new()).unwrap() };
            let words = held_out(task, kind, &only().model);
            let t = time(9, |_| only().covariance[0]);
            report(&row, "TriCal, Rust: fit and covariance alone", t, &words);
        }
    }
    if task.wants("identification, 1000000 poses, 31 parameters") && task.path("elastic_big.csv").exists() {
        let data = load(task, "elastic_big.csv");
        let fit = || identify(&nominal.robot, &nominal.cell, &data, ParameterSet::Compliance).unwrap();
        let words = held_out(task, "elastic", &fit().model);
        let t = time(3, |_| fit().covariance[0]);
        report("identification, 1000000 poses, 31 parameters", "TriCal, Rust, in memory", t, &words);
    }
    if task.wants("identifiability") {
        let data = load(task, "rigid_points.csv");
        let mut model = nominal.clone();
        model.frames = vec![trical_model::Pose::identity()];
        let choice = Choice::from(ParameterSet::Complete);
        let rank = independent_terms(&model, &data, &choice).unwrap().0.len();
        let t = time(9, |_| independent_terms(&model, &data, &choice).unwrap().0.len());
        report(
            "identifiability",
            "TriCal, Rust, independent set and what depends on what",
            t,
            &format!("{rank} of 45"),
        );
    }
    if task.wants("observability") {
        let data = load(task, "rigid_touches.csv");
        let found = identify(&nominal.robot, &nominal.cell, &data, ParameterSet::Geometry).unwrap();
        let forward = Forward::new(found.model, found.free).unwrap();
        let figure = || {
            let r = r_factor(&forward, &data, &found.noise, &[]);
            observability(&r, 3 * data.observations.len()).0
        };
        let words = format!("condition {:.4}", figure().condition);
        report("observability", "TriCal, Rust", time(9, |_| figure().condition), &words);
    }
}
