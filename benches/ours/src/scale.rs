//! How time and memory grow: one process a point, so that the peak of memory is its own. `trical-bench FOLDER scale WHAT N`.

use std::time::Instant;

use rayon::prelude::*;
use serde_json::json;
use trical_diagnose::catalogue::catalogue;
use trical_diagnose::covariates::Covariates;
use trical_diagnose::linear::Design;
use trical_ident::{Dataset, Noise, ParameterSet, fit_model, identify};
use trical_model::{Basis, Shape, Site, Term, Variable};

use crate::identification::load;
use crate::{Task, cpu};

/// Most memory that the process has had, MB.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default().to_owned();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

/// Runs `f` as often as fits into a fifth of a second, and reports the mean.
fn measured(what: &str, n: usize, mut f: impl FnMut()) {
    f();
    let (start, begun, mut count) = (cpu(), Instant::now(), 0_u32);
    while count == 0 || begun.elapsed().as_secs_f64() < 0.2 {
        f();
        count += 1;
    }
    let (seconds, wall) = ((cpu() - start) / f64::from(count), begun.elapsed().as_secs_f64() / f64::from(count));
    println!("{}", json!({ "scale": what, "n": n, "seconds": seconds, "wall": wall, "peak_mb": peak_mb() }));
}

pub fn run(task: &Task, what: &str, n: usize) {
    match what {
        "parameters" => parameters(task, n),
        "candidates" => candidates(task, n),
        _ => fleet(task, n),
    }
}

/// A fit of `n` parameters to 1000 poses: the paper's 31, then sines and cosines of 2, 4, 6 ... periods a turn of every joint
/// (even ones, since joint 3 covers half a turn only).
fn parameters(task: &Task, n: usize) {
    let (nominal, data) = (task.nominal("cell.toml"), load(task, "elastic_points.csv"));
    let mut model = identify(&nominal.robot, &nominal.cell, &data, ParameterSet::Compliance).unwrap().model;
    let mut k = 0_u32;
    while model.terms.len() < n {
        let (joint, cycles) = (1 + k as usize % 6, f64::from(2 + 2 * (k / 12)));
        let shape = if (k / 6).is_multiple_of(2) { Shape::Sine { cycles } } else { Shape::Cosine { cycles } };
        let basis = Basis::new(Variable::Joint { joint }, shape);
        model.terms.push(Term::new(format!("ripple_{k}"), "ripple", Site::Joint { joint }, basis));
        k += 1;
    }
    measured("parameters", n, || {
        fit_model(model.clone(), &data, &Noise::usual(1), Vec::new()).unwrap();
    });
}

/// What a search step of the diagnosis looks at: all candidates linearized at 1000 poses, and each one's evidence. The
/// catalogue of this recording over and over.
fn candidates(task: &Task, n: usize) {
    let (nominal, data) = (task.nominal("cell.toml"), load(task, "elastic_points.csv"));
    let found = identify(&nominal.robot, &nominal.cell, &data, ParameterSet::Compliance).unwrap();
    let (all, _) = catalogue(&Covariates::new(&found.model, &data, 2e-5), &[]);
    let list: Vec<_> = all.iter().cycle().take(n).cloned().collect();
    measured("candidates", n, || {
        let design = Design::new(&found.model, &list, &data, &found.noise).unwrap();
        let state = design.start();
        let best = (0..n).map(|c| design.gain(&state, c).dss).fold(0.0, f64::max);
        assert!(best.is_finite(), "a gain is a number");
    });
}

/// Identification of `n` arms with 45 touches each, spread over the threads there are.
fn fleet(task: &Task, n: usize) {
    let (nominal, data) = (task.nominal("cell.toml"), load(task, "elastic_touches.csv"));
    let arms: Vec<Dataset> = vec![data; n];
    measured("fleet", n, || {
        let done = arms.par_iter().map(|d| identify(&nominal.robot, &nominal.cell, d, ParameterSet::Compliance));
        assert!(done.filter(Result::is_ok).count() == n, "every arm is identified");
    });
}
