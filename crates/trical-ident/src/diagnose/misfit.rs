//! Does a name explain what happens at its place, or only most of it? After everything that was found is modelled, each place
//! is asked once more by probes that know nothing of the catalogue: is a joint still off in a way that goes with an angle, with
//! time, with its load, with where it came from? What a probe finds there speaks against the name that was given.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use trical_model::{Axis, Basis, Forward, Model, Motion, Shape, Site, Term, Variable};

use super::catalogue::Candidate;
use super::design::Design;
use super::explain::held_out;
use super::locators::{UNEXPLAINED, knots, name, tents, value};
use crate::dataset::Dataset;
use crate::error::Result;
use crate::fit::position_errors;
use crate::identify::ErrorSummary;
use crate::noise::Noise;

/// Prior odds that what happens at a place is not in the catalogue.
const OUTSIDE: f64 = 0.03;

/// Knots of a probe's curve.
const KNOTS: usize = 7;

/// What the most telling probe of a place says.
#[derive(Clone, Debug)]
pub struct Misfit {
    /// Place, as the contract writes sites.
    pub site: serde_json::Value,
    /// On what the rest depends.
    pub variable: String,
    /// Probability of so strong a rest were there none, all probes of this place considered.
    pub p_value: f64,
    /// Size of the rest at the tool, mm.
    pub rms_mm: f64,
    /// Held-out error without and with the probe, mm; computed only where the p-value is below [`LEFT`].
    pub holdout_rms_mm: Option<(f64, f64)>,
}

/// A place whose probes have a smaller p-value than this is not explained.
pub const LEFT: f64 = 1e-3;

impl Misfit {
    /// Odds that the place does something that its name does not say: prior odds times the largest Bayes factor that the
    /// p-value allows, `1 / (-e p ln p)` (Sellke, Bayarri & Berger 2001).
    #[must_use]
    pub fn odds(&self) -> f64 {
        let p = self.p_value.max(1e-300);
        if p < (-1.0_f64).exp() { OUTSIDE / (-1.0_f64.exp() * p * p.ln()) } else { OUTSIDE }
    }
}

/// A scalar for every observation that no basis knows: of a joint's last move (rad) and the one before.
struct Memory {
    name: &'static str,
    of: fn(f64, f64) -> f64,
}

const MEMORIES: [Memory; 3] = [
    Memory { name: "travel", of: |last, _| last.clamp(-0.5, 0.5) },
    Memory { name: "travel", of: |last, _| last.abs() },
    Memory { name: "dir", of: |_, before| before.clamp(-0.5, 0.5) },
];

/// Asks every joint, the tool, the fixture and the links.
///
/// # Errors
/// None for a model that was fitted.
pub fn misfits(model: &Model, data: &Dataset, noise: &Noise, temper: f64) -> Result<Vec<Misfit>> {
    let mut probes: Vec<Candidate> = Vec::new();
    let has_time = data.observations.iter().all(|o| o.state.t.is_some());
    let has_direction = data.observations.iter().all(|o| o.state.dir.is_some());
    let has_masses = model.robot.require_masses().is_ok();
    let n = model.robot.dof();
    for joint in 1..=n {
        let site = serde_json::json!({ "joint": joint });
        let at = Site::Joint { joint };
        let mut variables: Vec<Variable> = (1..=n).map(|joint| Variable::Joint { joint }).collect();
        if has_time {
            variables.push(Variable::Time);
        }
        for variable in variables {
            let Some(knots) = knots(&value_of(data, variable), KNOTS) else { continue };
            probes.push(probe(&site, name(variable), tents(at, variable, None, &knots)));
            if has_direction && (variable == Variable::Time || variable == (Variable::Joint { joint })) {
                let named = if variable == Variable::Time { name(variable) } else { format!("dir{joint}") };
                probes.push(probe(&site, named, tents(at, variable, Some(joint), &knots)));
            }
        }
        if has_masses {
            let bases = [Shape::SignedSquare, Shape::Cube, Shape::SoftSign { scale: 0.3 }]
                .map(|shape| Basis::torque(joint, shape))
                .map(|basis| Term::new("probe", UNEXPLAINED, at, basis));
            probes.push(probe(&site, format!("tau{joint}"), bases.to_vec()));
        }
    }
    if has_time && let Some(knots) = knots(&value_of(data, Variable::Time), KNOTS) {
        let along = |of: fn(Motion) -> Site| {
            Axis::ALL
                .iter()
                .flat_map(|a| tents(of(Motion::Along(*a)), Variable::Time, None, &knots))
                .collect::<Vec<_>>()
        };
        probes.push(probe(&serde_json::json!({ "tool": true }), "time".into(), along(Site::Tool)));
        if data.observations.iter().any(|o| matches!(o.measured, trical_model::Measured::Touch { .. })) {
            probes.push(probe(&serde_json::json!({ "fixture": true }), "time".into(), along(Site::Fixture)));
        }
        let growth = tents(Site::Links, Variable::Time, None, &knots);
        probes.push(probe(&serde_json::json!({ "links": true }), "time".into(), growth));
    }
    // what came before, and two angles at once, are no basis: such probes borrow a joint's constant column and weigh it row
    // by row
    let mut weights: Vec<Vec<Vec<f64>>> = vec![Vec::new(); probes.len()];
    for joint in 1..=n {
        let constant = Term::new("probe", UNEXPLAINED, Site::Joint { joint }, Basis::CONSTANT);
        let site = serde_json::json!({ "joint": joint });
        for memory in &MEMORIES {
            probes.push(probe(&site, format!("{}{joint}", memory.name), vec![constant.clone()]));
            weights.push(vec![before(data, joint, memory)]);
        }
        for other in (1..=n).filter(|k| *k != joint) {
            let product = |of: fn(f64, f64) -> f64| {
                data.observations.iter().map(|o| of(o.state.q[joint - 1], o.state.q[other - 1])).collect::<Vec<f64>>()
            };
            probes.push(probe(&site, format!("q{other}"), vec![constant.clone(); 4]));
            weights.push(vec![
                product(|a, b| a.sin() * b.sin()),
                product(|a, b| a.sin() * b.cos()),
                product(|a, b| a.cos() * b.sin()),
                product(|a, b| a.cos() * b.cos()),
            ]);
        }
    }
    let design = Design::weighted(model, &probes, &weights, data, noise)?;
    let stage = design.stage();
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let freedom = design.rows as f64 * temper - stage.parameters;
    struct Place {
        site: serde_json::Value,
        asked: f64,
        probe: usize,
        p: f64,
        dss: f64,
    }
    let mut places: Vec<Place> = Vec::new();
    for (index, probe) in probes.iter().enumerate() {
        let (dss, rank) = design.plain_gain(&stage, index);
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        let k = rank as f64;
        if rank == 0 || freedom <= 2.0 * k {
            continue;
        }
        let f = (dss / k) / ((stage.ss - dss).max(1e-300) / (freedom - k));
        let p = FisherSnedecor::new(k, freedom - k).map_or(1.0, |d| d.sf(f));
        match places.iter_mut().find(|m| m.site == probe.site) {
            Some(place) => {
                place.asked += 1.0;
                if p < place.p {
                    (place.p, place.probe, place.dss) = (p, index, dss);
                }
            }
            None => places.push(Place { site: probe.site.clone(), asked: 1.0, probe: index, p, dss }),
        }
    }
    let forward = Forward::new(model.clone(), Vec::new())?;
    let rms_mm = ErrorSummary::of(&position_errors(&forward, data)).rms_mm;
    let poses = data.used_poses();
    Ok(places
        .into_iter()
        .map(|place| {
            let p_value = (place.p * place.asked).min(1.0);
            let held_out = |set: &[usize]| ErrorSummary::of(&held_out(&design, set, &poses)).rms_mm;
            Misfit {
                variable: probes[place.probe].located.clone(),
                site: place.site,
                p_value,
                rms_mm: rms_mm * (place.dss / stage.ss).clamp(0.0, 1.0).sqrt(),
                holdout_rms_mm: (p_value < LEFT).then(|| (held_out(&[]), held_out(&[place.probe]))),
            }
        })
        .collect())
}

fn value_of(data: &Dataset, variable: Variable) -> Vec<f64> {
    data.observations.iter().map(|o| value(variable, &o.state)).collect()
}

fn probe(site: &serde_json::Value, variable: String, terms: Vec<Term>) -> Candidate {
    Candidate {
        effect: UNEXPLAINED,
        site: site.clone(),
        located: variable,
        signs: vec![0; terms.len()],
        scales: vec![1.0; terms.len()],
        terms,
        typical: 0.0,
        log_prior: 0.0,
    }
}

/// What a memory says at every observation; moves that are not known (the first of a recording) count as none.
fn before(data: &Dataset, joint: usize, memory: &Memory) -> Vec<f64> {
    struct Last {
        recording: usize,
        pose: usize,
        q: f64,
        moves: (f64, f64),
    }
    let mut last: Option<Last> = None;
    data.observations
        .iter()
        .map(|o| {
            let q = o.state.q[joint - 1];
            let moves = match &last {
                Some(l) if l.recording == o.recording && l.pose == o.pose => l.moves,
                Some(l) if l.recording == o.recording => (q - l.q, l.moves.0),
                _ => (0.0, 0.0),
            };
            last = Some(Last { recording: o.recording, pose: o.pose, q, moves });
            (memory.of)(moves.0, moves.1)
        })
        .collect()
}
