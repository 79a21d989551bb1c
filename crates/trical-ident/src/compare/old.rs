//! Is this arm still what it was? A few touches against an earlier calibration: unchanged, or what changed, by how much and how surely.
//!
//! The residuals `r` of the new touches by the old model scatter by the old session's noise and by what the old parameters may be off:
//! `cov r = s^2 I + J C J'`. What is new in any case (a measuring frame, places of sockets) is projected out. Each explanation (tool, base,
//! the zero of one joint, one wrong touch) has columns `H`; the length of the projection of the whitened residual on them, squared, is
//! chi-squared with as many degrees of freedom as columns, if nothing changed. The best explanation is taken if its p-value, times the
//! number of explanations, is below [`FALSE_ALARMS`]; then the next one is sought beside it.

use faer::linalg::solvers::Llt;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Mat, Par, Side};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use trical_model::{Axis, Basis, Cell, Forward, Measured, Model, Motion, Recording, Scope, Site, Term};

use crate::dataset::{Dataset, JointSource, Rejected};
use crate::date::by_date;
use crate::error::{IdentError, Result};
use crate::fit::check_observations;
use crate::model_file::{ModelFile, Uncertainty};
use crate::noise::Noise;
use crate::predicted::covariance;
use crate::rigid::{mean, moved};
use crate::triangle::dot;
use crate::units::unit;
use crate::validate::{Refit, adapted};

/// So often may something be said to have changed where nothing has.
pub const FALSE_ALARMS: f64 = 0.02;

/// Chance that a change of the size that is called visible is seen.
const SEEN: f64 = 0.9;

/// A claim moves the tool by at least this share of the old model's own errors, root mean square: what an old model does not know of the
/// arm differs from poses to poses, and among many measurements passes for a change.
const SHARE: f64 = 0.35;

/// Of more measurements than this some stand for all: they tell more than enough.
const MEASUREMENTS: usize = 240;

/// One touch among more than this is not tried as a wrong one: many small ones would be.
const FEW: usize = 60;

/// Where nothing that one place of the arm can do brings a coordinate closer than this, m, and than so many times the old session's noise,
/// the arm is another one, or the recording is in other units: a bent link leaves some millimetres.
const ANOTHER_ARM: (f64, f64) = (1e-2, 100.0);

/// A change that would have to be larger than this to be seen is not called visible: only its share that something else does not take up
/// is seen at all.
const LARGEST_MM: f64 = 20.0;
const LARGEST_DEG: f64 = 2.0;

/// A calibration that leaves so many times the usual noise of the instrument lacks something.
const UNUSUAL: f64 = 3.0;

/// A mean error of the new touches beyond so many times what the calibration left is no such lack.
const BEYOND: f64 = 10.0;

/// Most changes that are looked for.
const CHANGES: usize = 4;

/// One number of a change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changed {
    /// "joint 3", "tool x", "base rz".
    pub name: String,
    /// By how much it changed, in `unit`.
    pub value: f64,
    /// Standard deviation.
    pub sd: f64,
    /// "deg" or "mm".
    pub unit: String,
}

/// Something that changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// "tool", "base", "joint 3", "the touch of line 7".
    pub what: String,
    /// [`Scope::Arm`] for a joint, [`Scope::Setup`] for tool and base, [`Scope::Reading`] for one wrong touch.
    pub scope: Scope,
    /// How probable this explanation is among all that were tried, 0 to 1.
    pub probability: f64,
    /// How often chance alone would give as much, for this explanation.
    pub p_value: f64,
    /// By how much.
    pub by: Vec<Changed>,
    /// Explanations that the touches do not exclude (more than a tenth as probable).
    pub rivals: Vec<String>,
}

impl Change {
    /// Whether it is at least as probable as all other explanations together.
    #[must_use]
    pub fn is_likely(&self) -> bool {
        self.probability >= 0.5
    }
}

/// The smallest change that these poses would show nine times in ten; of a tool or base that of its place, and then
/// that of its direction, whichever way it goes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Visible {
    /// "joint 3", "tool", "base".
    pub what: String,
    /// In `unit`; `null` where no size would be seen.
    pub smallest: Option<f64>,
    /// "deg" or "mm".
    pub unit: String,
}

/// An arm beside its earlier calibration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The new recording.
    pub recording: String,
    /// What tells it from others.
    pub hash: String,
    /// Measurements that were compared.
    pub measurements: usize,
    /// Rows that were not used.
    pub rejected: Vec<Rejected>,
    /// Recording whose tool and balls the calibration has here, its newest; `null` where all that it was fitted to
    /// share theirs.
    pub setup_of: Option<String>,
    /// "tool", "base": what the calibration does not know and was identified on this recording, so that no change of it
    /// can be seen.
    pub anew: Vec<&'static str>,
    /// "unchanged", "setup changed" (tool or base only), "arm changed", "wrong touches" (only those), "nothing visible"
    /// (these measurements would show no change); "perhaps arm changed" and the like where no change is as sure as one half.
    pub verdict: &'static str,
    /// In plain sentences.
    pub summary: String,
    /// That an error which the calibration left may look like the change, where that is so; the summary ends with it.
    #[serde(skip)]
    pub doubt: Option<String>,
    /// What changed, the surest first.
    pub changes: Vec<Change>,
    /// What would have been seen.
    pub visible: Vec<Visible>,
    /// Mean position error by the old model as it is, mm; what is new in any case identified.
    pub mean_mm: f64,
    /// Standard deviation of each coordinate in the old session, mm.
    pub noise_mm: f64,
    /// By how much more the touches scatter than that, whatever changed; 1 where they do not.
    pub more_noise: f64,
    /// Mean temperature of the recording, degC, where it was recorded.
    pub temp_c: Option<f64>,
    /// Every explanation's own numbers, each fitted alone, where the measurements determine them.
    pub alone: Vec<Changed>,
}

/// What may have changed: its name, and which of the terms tell it.
struct Explanation {
    what: String,
    scope: Scope,
    terms: Vec<usize>,
    /// Row of one wrong touch instead.
    touch: Option<usize>,
}

/// Compares a new recording with the model of `file`, which has to know how uncertain it is ([`ModelFile::of_fit`]).
///
/// # Errors
/// A model that does not know its uncertainty, or was learnt on this very recording; data that the model cannot predict, or that are of
/// another arm.
pub fn compare(
    cell: &Cell,
    file: &ModelFile,
    recording: &Recording,
    joints: Option<JointSource>,
) -> Result<Comparison> {
    let uncertainty = file.uncertainty.as_ref().ok_or_else(|| {
        IdentError::WrongModel(
            "the model file does not say how uncertain it is ([uncertainty]); expected one that this version identified from at most 1000 \
             parameters"
                .into(),
        )
    })?;
    let framed = recording.rows.iter().any(|r| r.measured.is_framed());
    let refit = Refit { frame: framed, targets: false };
    let newest = newest(file);
    let adapted = adapted(file, cell, std::slice::from_ref(recording), joints, framed.then_some(refit), Some(newest))?;
    if adapted.is_known() {
        return Err(IdentError::WrongModel(format!(
            "{}: the model was fitted to this recording; expected a later one",
            recording.name
        )));
    }
    let model = adapted.identified()?;
    let data = thinned(&adapted.data);
    let errors = crate::fit::position_errors(&Forward::new(model.clone(), Vec::new())?, &adapted.data);
    let own_setup = |t: &Term| t.basis.session.is_some() && t.basis.place.is_none() && t.scope() == Scope::Setup;
    let setup_of =
        file.model.terms.iter().any(own_setup).then(|| Some(file.sessions.get(newest as usize - 1)?.recording.clone()));
    let (model, explanations, free) = with_explanations(model, &data, uncertainty);
    let is_new = |such: &dyn Fn(&Site) -> bool| free.new.iter().any(|k| such(&model.terms[*k].site));
    let tool = is_new(&|s| matches!(s, Site::Tool(_) | Site::Target { .. }));
    // of sockets the place is new by their nature
    let placed = recording.places.is_empty() && cell.balls_fix_base(|_| true);
    let base = placed && is_new(&|s| matches!(s, Site::Fixture(_)));
    let whitened = Whitened::of(&model, &free, &explanations, &data, uncertainty)?;
    let mut out = whitened.compare(&model, &explanations);
    out.recording.clone_from(&recording.name);
    out.hash = crate::repeated::fingerprint(recording);
    out.measurements = adapted.data.observations.len();
    out.rejected.clone_from(&adapted.data.rejected);
    out.setup_of = setup_of.flatten();
    out.anew = [("tool", tool), ("base", base)].into_iter().filter(|a| a.1).map(|a| a.0).collect();
    out.mean_mm = mean(&errors) * 1e3;
    out.noise_mm = uncertainty.noise * 1e3;
    out.temp_c = adapted.data.mean_temp_c();
    out.summary = in_words(&out);
    if let Some(doubt) = doubt(&out, usual_mm(&adapted.data)) {
        out.summary += &format!(" {doubt}");
        out.doubt = Some(doubt);
    }
    let left = out.more_noise * uncertainty.noise;
    if left > ANOTHER_ARM.0 && out.more_noise > ANOTHER_ARM.1 {
        return Err(IdentError::WrongModel(format!(
            "{}: the model misses these measurements by {:.0} mm on average, and no change of one joint, the tool or the base explains more \
             than a part of it; expected a recording of the arm that the model is of, '{}'",
            recording.name, out.mean_mm, file.model.robot.name
        )));
    }
    Ok(out)
}

/// The newest session (from 1) that a model was fitted to: by the dates in the names of its recordings, or the last
/// one.
fn newest(file: &ModelFile) -> u32 {
    let by_date = by_date(file.sessions.iter().map(|s| s.recording.as_str())).and_then(|order| order.last().copied());
    u32::try_from(by_date.map_or(file.sessions.len(), |k| k + 1)).unwrap_or(u32::MAX).max(1)
}

/// Some of many measurements, evenly.
fn thinned(data: &Dataset) -> Dataset {
    let every = data.observations.len().div_ceil(MEASUREMENTS).max(1);
    let mut some = data.filtered(|_| true);
    some.observations = data.observations.iter().step_by(every).copied().collect();
    some
}

/// Terms whose columns are wanted, in the model's order.
struct Free {
    /// Those of the old calibration, with their places in its covariance.
    old: Vec<(usize, usize)>,
    /// What is new in any case.
    new: Vec<usize>,
}

/// The model with a term for each thing that may have changed.
fn with_explanations(mut model: Model, data: &Dataset, old: &Uncertainty) -> (Model, Vec<Explanation>, Free) {
    let known = |t: &Term| old.names.iter().position(|n| *n == t.name);
    let here = |t: &Term| {
        t.basis.session.is_some_and(|s| data.observations.iter().any(|o| o.state.session == Some(s)))
            || matches!(t.site, Site::Frame { frame, .. } if data.observations.iter().any(|o| o.frame + 1 == frame))
    };
    let mut free = Free { old: Vec::new(), new: Vec::new() };
    for (k, t) in model.terms.iter().enumerate() {
        match known(t) {
            Some(place) => free.old.push((k, place)),
            None if here(t) && t.scope() == Scope::Setup => free.new.push(k),
            None => {}
        }
    }
    let mut out = Vec::new();
    let mut add = |model: &mut Model, what: String, scope: Scope, sites: Vec<(String, Site)>| {
        let first = model.terms.len();
        model.terms.extend(sites.into_iter().map(|(name, site)| Term::new(name, "change", site, Basis::CONSTANT)));
        out.push(Explanation { what, scope, terms: (first..model.terms.len()).collect(), touch: None });
    };
    for joint in 1..=model.robot.dof() {
        let name = format!("joint {joint}");
        add(&mut model, name.clone(), Scope::Arm, vec![(name, Site::Joint { joint })]);
    }
    let mut tool: Vec<(String, Site)> = Vec::new();
    if data.has(|m| !matches!(m, Measured::Point { .. })) {
        let pose = data.has(|m| matches!(m, Measured::Pose { .. }));
        let motions = &Motion::ALL[..if pose { 6 } else { 3 }];
        tool.extend(motions.iter().map(|m| (format!("tool {}", m.name()), Site::Tool(*m))));
    }
    for target in 1..=model.cell.tool.targets.len() {
        if data.has(|m| matches!(m, Measured::Point { target: t, .. } if *t + 1 == target)) {
            let site = |axis: Axis| (format!("target {target} {}", axis.name()), Site::Target { target, axis });
            tool.extend(Axis::ALL.map(site));
        }
    }
    add(&mut model, "tool".into(), Scope::Setup, tool);
    // where the frame or the balls' places are new, they take up whatever the base did
    if free.new.iter().all(|k| matches!(model.terms[*k].site, Site::Tool(_) | Site::Target { .. })) {
        let base =
            |motions: &[Motion]| motions.iter().map(|m| (format!("base {}", m.name()), Site::Base(*m))).collect();
        add(&mut model, "base".into(), Scope::Setup, base(&Motion::ALL[..3]));
        add(&mut model, "base (place and direction)".into(), Scope::Setup, base(&Motion::ALL));
    }
    if data.observations.len() <= FEW {
        out.extend(data.observations.iter().enumerate().map(|(row, o)| Explanation {
            what: format!("the measurement of line {}", o.line),
            scope: Scope::Reading,
            terms: Vec::new(),
            touch: Some(row),
        }));
    }
    (model, out, free)
}

/// Residuals and columns in units of what is usual: independent, with standard deviation 1, what is new projected out.
struct Whitened {
    residual: Vec<f64>,
    /// Of each explanation.
    columns: Vec<Vec<Vec<f64>>>,
    /// Scalars, and how many of them what is new has taken up.
    rows: usize,
    new: usize,
}

/// Takes out of `v` what lies along the orthonormal `basis`, twice for the digits.
fn project_out(v: &mut [f64], basis: &[Vec<f64>]) {
    for _ in 0..2 {
        for q in basis {
            let d = dot(v, q);
            v.iter_mut().zip(q).for_each(|(x, y)| *x -= d * y);
        }
    }
}

/// Adds directions of `columns` that `basis` does not have; how many.
fn extend(basis: &mut Vec<Vec<f64>>, columns: &[Vec<f64>]) -> usize {
    let before = basis.len();
    for c in columns {
        let whole = dot(c, c).sqrt();
        let mut v = c.clone();
        project_out(&mut v, basis);
        let left = dot(&v, &v).sqrt();
        if left > 1e-6 * whole && whole > 0.0 {
            v.iter_mut().for_each(|x| *x /= left);
            basis.push(v);
        }
    }
    basis.len() - before
}

/// What changed, in two words; of what is less sure than one half, that it did so perhaps.
fn verdict(changes: &[Change]) -> &'static str {
    let sure = changes.iter().any(Change::is_likely);
    let has = |scope| changes.iter().any(|c| c.scope == scope && c.is_likely() == sure);
    match (has(Scope::Arm), has(Scope::Setup), changes.is_empty()) {
        (true, ..) if sure => "arm changed",
        (true, ..) => "perhaps arm changed",
        (_, true, _) if sure => "setup changed",
        (_, true, _) => "perhaps setup changed",
        (.., true) => "unchanged",
        _ if sure => "wrong touches",
        _ => "perhaps wrong touches",
    }
}

impl Whitened {
    fn of(model: &Model, free: &Free, explanations: &[Explanation], data: &Dataset, old: &Uncertainty) -> Result<Self> {
        let asked = explanations.iter().flat_map(|e| e.terms.iter().copied());
        let all: Vec<usize> = free.old.iter().map(|o| o.0).chain(free.new.iter().copied()).chain(asked).collect();
        let p = all.len();
        let forward = Forward::new(model.clone(), all.clone())?;
        check_observations(&forward, data)?;
        let rows = data.scalars();
        let (mut jacobian, mut residual) = (Mat::<f64>::zeros(rows, p), vec![0.0; rows]);
        let (mut ws, mut buffer, mut at) = (forward.workspace(), vec![0.0; 6 * p], 0);
        let mut spans = Vec::new();
        for o in &data.observations {
            let n = forward.linearize(&o.state, &o.measured, o.frame, &mut ws, &mut buffer);
            for k in 0..n {
                // a pose's rotation is as uncertain as the position a quarter of a metre away
                let sigma = if k < 3 { old.noise } else { 4.0 * old.noise };
                residual[at + k] = ws.residual()[k] / sigma;
                (0..p).for_each(|c| jacobian[(at + k, c)] = buffer[k * p + c] / sigma);
            }
            spans.push((at, n));
            at += n;
        }
        let m = free.old.len();
        let of_old = jacobian.submatrix(0, 0, rows, m);
        let mut sigma = of_old * &covariance(model, old, &free.old) * of_old.transpose();
        (0..rows).for_each(|i| sigma[(i, i)] += 1.0);
        // rounded correlations may be a hair from positive
        let llt = Llt::new(sigma.as_ref(), Side::Lower).map_err(|_| {
            IdentError::WrongModel("[uncertainty] of the model file: its correlations are of no real fit".into())
        })?;
        let lower = llt.L();
        let white = |v: Vec<f64>| {
            let mut column = Mat::from_fn(rows, 1, |i, _| v[i]);
            solve_lower_triangular_in_place(lower, column.as_mut(), Par::Seq);
            column.col_as_slice(0).to_vec()
        };
        let column = |c: usize| white((0..rows).map(|i| jacobian[(i, c)]).collect());
        let mut nuisance = Vec::new();
        let taken: Vec<Vec<f64>> = (0..free.new.len()).map(|k| column(m + k)).collect();
        let new = extend(&mut nuisance, &taken);
        let freed = |mut v: Vec<f64>| {
            let whole = dot(&v, &v);
            project_out(&mut v, &nuisance);
            // digits that are left of what is taken up are nothing
            if dot(&v, &v) < 1e-12 * whole {
                v.fill(0.0);
            }
            v
        };
        let mut next = m + free.new.len();
        let columns = explanations
            .iter()
            .map(|e| match e.touch {
                Some(row) => {
                    let (from, n) = spans[row];
                    let unit = |k: usize| (0..rows).map(|i| f64::from(u8::from(i == from + k))).collect();
                    (0..n).map(|k| freed(white(unit(k)))).collect()
                }
                None => {
                    let own = (next..next + e.terms.len()).map(|c| freed(column(c))).collect();
                    next += e.terms.len();
                    own
                }
            })
            .collect();
        Ok(Self { residual: freed(white(residual)), columns, rows, new })
    }

    /// The search for what changed.
    fn compare(&self, model: &Model, explanations: &[Explanation]) -> Comparison {
        let machine = |k: usize| explanations[k].touch.is_none();
        let more_noise = self.more_noise(explanations);
        let families = explanations.len();
        let limit = FALSE_ALARMS / families as f64;
        let rows = self.rows as f64;
        let mut taken: Vec<usize> = Vec::new();
        let mut found: Vec<(usize, f64, f64, Vec<String>)> = Vec::new();
        let mut basis: Vec<Vec<f64>> = Vec::new();
        while found.len() < CHANGES {
            let tried = self.tried(&basis, &taken, more_noise);
            let significant = |k: &usize| {
                let (t, rank, _) = tried[*k];
                rank > 0 && tail(t, rank) < limit && (!machine(*k) || (t / rows).sqrt() > SHARE)
            };
            let Some(best) = (0..families).filter(significant).max_by(|a, b| tried[*a].2.total_cmp(&tried[*b].2))
            else {
                break;
            };
            let weight = |k: usize| if tried[k].1 > 0 { (tried[k].2 - tried[best].2).exp() } else { 0.0 };
            let nothing = (-tried[best].2).exp();
            let total: f64 = (0..families).map(weight).sum::<f64>() + nothing;
            let rivals = (0..families).filter(|k| *k != best && weight(*k) > 0.1).map(|k| explanations[k].what.clone());
            found.push((best, weight(best) / total, tail(tried[best].0, tried[best].1), rivals.collect()));
            taken.push(best);
            extend(&mut basis, &self.columns[best]);
        }
        let chosen: Vec<usize> = found.iter().map(|f| f.0).collect();
        let sizes = self.sizes(model, explanations, &chosen, more_noise);
        let changes: Vec<Change> = found
            .into_iter()
            .zip(sizes)
            .map(|((k, probability, p_value, rivals), by)| {
                let e = &explanations[k];
                Change { what: e.what.clone(), scope: e.scope, probability, p_value, by, rivals }
            })
            .collect();
        let visible = self.visible(model, explanations, more_noise);
        let whole = |k: usize| explanations[k].what != "base"; // its turned form has the same numbers
        let alone = (0..families)
            .filter(|k| machine(*k) && whole(*k))
            .flat_map(|k| self.sizes(model, explanations, &[k], more_noise).concat())
            .filter(|c| c.sd < largest(&c.unit)); // what the session's own frame takes up has no size
        Comparison {
            recording: String::new(),
            hash: String::new(),
            measurements: 0,
            rejected: Vec::new(),
            setup_of: None,
            anew: Vec::new(),
            verdict: if changes.is_empty() && visible.iter().all(|v| v.smallest.is_none()) {
                "nothing visible"
            } else {
                verdict(&changes)
            },
            summary: String::new(),
            doubt: None,
            changes,
            visible,
            mean_mm: 0.0,
            noise_mm: 0.0,
            more_noise: more_noise.sqrt(),
            temp_c: None,
            alone: alone.collect(),
        }
    }

    /// What each family explains beside `basis`: statistic, rank, evidence in nats.
    fn tried(&self, basis: &[Vec<f64>], taken: &[usize], more_noise: f64) -> Vec<(f64, usize, f64)> {
        let mut left = self.residual.clone();
        project_out(&mut left, basis);
        (0..self.columns.len())
            .map(|k| {
                let mut with = basis.to_vec();
                let rank = if taken.contains(&k) { 0 } else { extend(&mut with, &self.columns[k]) };
                let t: f64 = with[basis.len()..].iter().map(|q| dot(q, &left).powi(2)).sum::<f64>() / more_noise;
                (t, rank, evidence(t, rank))
            })
            .collect()
    }

    /// By how much the variance of what nothing explains is larger than it was, at least 1.
    fn more_noise(&self, explanations: &[Explanation]) -> f64 {
        let mut basis = Vec::new();
        for (e, columns) in explanations.iter().zip(&self.columns) {
            if e.touch.is_none() {
                extend(&mut basis, columns);
            }
        }
        let mut left = self.residual.clone();
        project_out(&mut left, &basis);
        let freedom = self.rows.saturating_sub(self.new + basis.len());
        if freedom < 6 {
            return 1.0;
        }
        // by the median, which one wrong touch does not move
        let mut squares: Vec<f64> = left.iter().map(|x| x * x).collect();
        squares.sort_by(f64::total_cmp);
        let share = self.rows as f64 / freedom as f64;
        (squares[squares.len() / 2] / 0.4549 * share).max(1.0)
    }

    /// By how much each of `chosen` changed, fitted together.
    fn sizes(
        &self,
        model: &Model,
        explanations: &[Explanation],
        chosen: &[usize],
        more_noise: f64,
    ) -> Vec<Vec<Changed>> {
        let columns: Vec<&Vec<f64>> = chosen.iter().flat_map(|k| &self.columns[*k]).collect();
        let p = columns.len();
        let lengths: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt().max(1e-100)).collect();
        // a hair of damping where two explanations are one
        let normal = Mat::from_fn(p, p, |i, j| {
            dot(columns[i], columns[j]) / (lengths[i] * lengths[j]) + if i == j { 1e-9 } else { 0.0 }
        });
        let right = Mat::from_fn(p, 1 + p, |i, j| match j {
            0 => -dot(columns[i], &self.residual) / lengths[i],
            _ => f64::from(u8::from(i + 1 == j)),
        });
        let solved = Llt::new(normal.as_ref(), Side::Lower).map(|l| faer::linalg::solvers::Solve::solve(&l, &right));
        let Ok(solved) = solved else { return vec![Vec::new(); chosen.len()] };
        let mut next = 0;
        chosen
            .iter()
            .map(|k| {
                let e = &explanations[*k];
                let first = next;
                next += self.columns[*k].len();
                let number = |(i, term): (usize, &usize)| {
                    let (t, at) = (&model.terms[*term], first + i);
                    let u = unit(&model.robot, t);
                    let sd = (solved[(at, at + 1)] * more_noise).max(0.0).sqrt() / lengths[at] * u.per_si.abs();
                    Changed { name: t.name.clone(), value: solved[(at, 0)] / lengths[at] * u.per_si, sd, unit: u.name }
                };
                e.terms.iter().enumerate().map(number).collect()
            })
            .collect()
    }

    /// The smallest change of each explanation that would be seen.
    fn visible(&self, model: &Model, explanations: &[Explanation], more_noise: f64) -> Vec<Visible> {
        let limit = FALSE_ALARMS / explanations.len() as f64;
        let share = SHARE * (self.rows as f64).sqrt();
        let machine = explanations.iter().zip(&self.columns).filter(|(e, _)| e.touch.is_none());
        let sizes = |(e, columns): (&Explanation, &Vec<Vec<f64>>)| {
            let rank = extend(&mut Vec::new(), columns);
            let needed = lambda(limit, rank.max(1), share) * more_noise.sqrt();
            // a joint that slides has a length, one that turns an angle
            ["mm", "deg"].map(|of| {
                let mut per_si = None;
                let mut axes: Vec<(&str, Vec<f64>)> = Vec::new();
                for (t, c) in e.terms.iter().map(|t| &model.terms[*t]).zip(columns) {
                    let u = unit(&model.robot, t);
                    if u.name != of {
                        continue;
                    }
                    per_si = Some(u.per_si.abs());
                    // all targets together along one axis: the tool is rigid
                    let axis = point_and_axis(&t.name).1;
                    match axes.iter_mut().find(|a| a.0 == axis) {
                        Some((_, sum)) => sum.iter_mut().zip(c).for_each(|(s, c)| *s += c),
                        None => axes.push((axis, c.clone())),
                    }
                }
                let smallest = needed / shortest(&axes) * per_si?;
                Some(Visible {
                    what: e.what.clone(),
                    smallest: (smallest < largest(of)).then_some(smallest),
                    unit: of.into(),
                })
            })
        };
        machine.flat_map(sizes).flatten().collect()
    }
}

/// "target 2" and "x" of "target 2 x".
fn point_and_axis(name: &str) -> (&str, &str) {
    name.rsplit_once(' ').unwrap_or((name, ""))
}

/// Length of the combination of columns with unit coefficients that is shortest: their smallest singular value.
fn shortest(columns: &[(&str, Vec<f64>)]) -> f64 {
    let rows = columns.first().map_or(0, |c| c.1.len());
    let all = Mat::from_fn(rows, columns.len(), |i, j| columns[j].1[i]);
    all.singular_values().map_or(0.0, |s| s.into_iter().fold(f64::INFINITY, f64::min))
}

/// Evidence in nats of `rank` numbers that take up `t`: their prior is as wide as what was found (George & Foster 2000), so that more
/// numbers pay for being more.
fn evidence(t: f64, rank: usize) -> f64 {
    let k = rank.max(1) as f64;
    if t > k { 0.5 * (t - k - k * (t / k).ln()) } else { 0.0 }
}

/// Upper tail of chi-squared.
fn tail(t: f64, rank: usize) -> f64 {
    ChiSquared::new(rank as f64).map_or(1.0, |d| d.sf(t))
}

/// Most that is called visible, in mm or deg.
fn largest(unit: &str) -> f64 {
    if unit == "mm" { LARGEST_MM } else { LARGEST_DEG }
}

/// Length (in standard deviations) of a change that passes `limit`, and is at least `share`, with the chance [`SEEN`].
fn lambda(limit: f64, rank: usize, share: f64) -> f64 {
    let threshold = ChiSquared::new(rank as f64).map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - limit)).sqrt();
    // the length of a vector with mean lambda in one of its directions is about normal above it
    let above = statrs::distribution::Normal::standard().inverse_cdf(SEEN);
    threshold.max(share) + above
}

/// Standard deviation of each coordinate, mm, that the instrument usually has; `None` for balls in sockets, whose play depends on the print.
fn usual_mm(data: &Dataset) -> Option<f64> {
    let usual = Noise::usual(data.names.len());
    let each =
        data.observations.iter().map(|o| (o.state.place.is_none()).then(|| usual.sigma(o.recording, &o.measured, 0)));
    each.collect::<Option<Vec<f64>>>().map(|all| all.into_iter().fold(0.0, f64::max) * 1e3)
}

/// What makes a change less sure than its number says: errors of the arm that the calibration lacks differ from pose to pose.
fn doubt(c: &Comparison, usual_mm: Option<f64>) -> Option<String> {
    let left = c.noise_mm;
    let much = usual_mm.is_some_and(|usual| left > UNUSUAL * usual) && c.mean_mm < BEYOND * left;
    (much && !c.changes.is_empty()).then(|| {
        format!(
            "But the calibration itself left {left:.3} mm in each coordinate, more than the instrument's noise: an error of the arm that it \
             lacks can look like such a change at other poses. Compare with a diagnosed model of the same recording, too."
        )
    })
}

/// The verdict in sentences.
fn in_words(c: &Comparison) -> String {
    let size = |change: &Change| {
        let of = |unit: &'static str| {
            let mut parts = change.by.iter().filter(move |b| b.unit == unit).peekable();
            parts.peek().is_some().then(|| moved(parts.map(|b| (point_and_axis(&b.name).0, b.value))))
        };
        match (&change.by[..], of("mm"), of("deg")) {
            ([one], ..) => format!(" by {:.4} +- {:.4} {}", one.value, one.sd, one.unit),
            (_, Some(mm), Some(deg)) => format!(" by {mm:.3} mm and {deg:.3} deg"),
            (_, Some(mm), None) => format!(" by {mm:.3} mm"),
            _ => String::new(),
        }
    };
    let joint_seen = c.visible.iter().any(|v| v.what.starts_with("joint") && v.smallest.is_some());
    let mut words = Vec::new();
    if c.verdict == "nothing visible" {
        words.push(format!("Nothing can be seen in these {} measurements: they would show no change.", c.measurements));
    } else if c.changes.is_empty() && joint_seen {
        words.push(format!("No change was found in these {} measurements.", c.measurements));
    } else if c.changes.is_empty() {
        let of = c.measurements;
        words.push(format!("No change was found in these {of} measurements, which would not show one of any joint."));
    }
    let sentence = |change: &Change| {
        let sure = (change.probability * 100.0).floor().min(99.0);
        let or = if change.rivals.is_empty() { String::new() } else { format!(" (or {})", change.rivals.join(", ")) };
        let what = capital(&if change.is_likely() { change.what.clone() } else { format!("perhaps {}", change.what) });
        if change.scope == Scope::Reading {
            format!("{what}{or} is wrong, {sure:.0} % sure.")
        } else {
            format!("{what}{or} changed{}, {sure:.0} % sure.", size(change))
        }
    };
    words.extend(c.changes.iter().map(sentence));
    if c.changes.len() == CHANGES && c.changes.iter().filter(|c| c.scope == Scope::Arm).count() > 1 {
        words.push("So much is different that this may be another arm of the same kind.".into());
    }
    if !c.anew.is_empty() {
        let it = if c.anew.len() > 1 { "them" } else { "it" };
        words.push(format!(
            "A change of the {} cannot be seen: the calibration does not know {it}, and this recording's own fit finds \
             {it}.",
            c.anew.join(" and ")
        ));
    }
    if let Some(of) = &c.setup_of {
        words.push(format!(
            "Compared with the tool and the balls at the end of {of}, the newest recording that the calibration was \
             fitted to."
        ));
    }
    words.join(" ")
}

/// A text that begins with a capital letter.
#[must_use]
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_less_sure_than_one_half_is_no_fact_in_verdict_and_summary() {
        let change = |scope, probability| Change {
            what: "joint 3".into(),
            scope,
            probability,
            p_value: 0.01,
            by: Vec::new(),
            rivals: vec!["joint 2".into()],
        };
        let verdict_of = |all: &[(Scope, f64)]| verdict(&all.iter().map(|c| change(c.0, c.1)).collect::<Vec<_>>());
        assert_eq!(verdict_of(&[(Scope::Arm, 0.37)]), "perhaps arm changed");
        assert_eq!(verdict_of(&[(Scope::Arm, 0.5)]), "arm changed");
        assert_eq!(verdict_of(&[(Scope::Setup, 0.9), (Scope::Arm, 0.37)]), "setup changed");
        assert_eq!(verdict_of(&[(Scope::Reading, 0.4)]), "perhaps wrong touches");
        let told = in_words(&Comparison {
            recording: String::new(),
            hash: String::new(),
            measurements: 10,
            rejected: Vec::new(),
            setup_of: None,
            anew: Vec::new(),
            verdict: "perhaps arm changed",
            summary: String::new(),
            doubt: None,
            changes: vec![change(Scope::Arm, 0.37)],
            visible: Vec::new(),
            mean_mm: 0.1,
            noise_mm: 0.01,
            more_noise: 1.0,
            temp_c: None,
            alone: Vec::new(),
        });
        assert_eq!(told, "Perhaps joint 3 (or joint 2) changed, 37 % sure.");
    }
}
