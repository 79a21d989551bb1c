//! What a finding does to the measurements, against the variable that reveals it.

use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use trical_diagnose::{Diagnosis, Finding};
use trical_ident::Noise;
use trical_ident::dataset::Dataset;
use trical_ident::model_file::Uncertainty;
use trical_model::{Basis, Forward, JointKind, Measured, Model, Shape, Site, State, Term, Variable};

use crate::error::Result;
use crate::evidence::six;

/// How much larger an effect has to be in orientation than in position, each in units of the usual noise, to be drawn there.
const TURNS: f64 = 5.0;

/// What one finding does to every measurement, seen along the direction in which it acts.
struct Seen {
    /// What is drawn, with its unit.
    label: &'static str,
    /// The unit of what is drawn.
    unit: &'static str,
    /// Error without the finding, all else fitted anew.
    before: Vec<f64>,
    /// Error with the finding.
    after: Vec<f64>,
    /// The finding's own part of the error.
    part: Vec<f64>,
}

/// The model without some of its terms, the others fitted anew, in the linear picture: with their covariance `C` of those left out, `o`, the
/// others change by `-C[., o] C[o, o]^-1 x[o]`. Where that covariance was not kept, or has no inverse, the others stay as they are.
fn without(own: &dyn Fn(&Term) -> bool, fitted: &Model, uncertainty: Option<&Uncertainty>) -> Model {
    let mut model = fitted.clone();
    if let Some(u) = uncertainty {
        let n = u.names.len();
        let sd_of = |name: &String| fitted.terms.iter().find(|t| t.name == *name).and_then(|t| t.sd).unwrap_or(0.0);
        let sd: Vec<f64> = u.names.iter().map(sd_of).collect();
        let named = |t: &Term| u.names.iter().position(|name| *name == t.name).filter(|k| sd[*k] > 0.0);
        let out: Vec<(usize, f64)> =
            fitted.terms.iter().filter(|t| own(t)).filter_map(|t| Some((named(t)?, t.value))).collect();
        let among = DMatrix::from_fn(out.len(), out.len(), |i, j| u.correlation[out[i].0 * n + out[j].0]);
        let sizes = DVector::from_fn(out.len(), |i, _| out[i].1 / sd[out[i].0]);
        if let Some(share) = among.cholesky().map(|factor| factor.solve(&sizes)) {
            for t in &mut model.terms {
                let Some(k) = named(t) else { continue };
                let by: f64 = out.iter().zip(share.iter()).map(|((o, _), s)| u.correlation[k * n + o] * s).sum();
                t.value -= sd[k] * by;
            }
        }
    }
    model.terms.iter_mut().filter(|t| own(t)).for_each(|t| t.value = 0.0);
    model
}

/// Residuals of another model in the linear picture about a model with residuals `own`: a load and a soft joint, each as large as without the
/// other, would otherwise not stand in for each other.
fn linear(of: &Model, other: &Model, data: &Dataset, own: &[Vector6<f64>]) -> Result<Vec<Vector6<f64>>> {
    const STEP: f64 = 1e-4;
    let mut near = of.clone();
    near.terms.iter_mut().zip(&other.terms).for_each(|(t, o)| t.value += STEP * (o.value - t.value));
    Ok(six(&near, data)?.iter().zip(own).map(|(near, own)| own + (near - own) / STEP).collect())
}

fn seen(f: &Finding, d: &Diagnosis) -> Result<Seen> {
    let own = |t: &Term| f.coefficients.iter().any(|c| c.name == t.name);
    // the direction in which it acts, whatever its variables say
    let [mut none, mut always] = [d.model.clone(), d.model.clone()];
    none.terms.iter_mut().filter(|t| own(t)).for_each(|t| t.value = 0.0);
    always.terms.iter_mut().filter(|t| own(t)).for_each(|t| t.basis = Basis::CONSTANT);
    let along = six(&none, &d.data)
        .and_then(|none| Ok(six(&always, &d.data)?.iter().zip(none).map(|(a, b)| a - b).collect::<Vec<_>>()))
        .ok();
    let with = six(&d.model, &d.data)?;
    let without = linear(&d.model, &without(&own, &d.model, d.uncertainty.as_ref()), &d.data, &with)?;
    // what only turns the tool is seen in its orientation alone
    let size = |first: usize| {
        let parts = with.iter().zip(&without).map(|(a, b)| (a - b).fixed_rows::<3>(first).norm_squared());
        parts.sum::<f64>().sqrt()
    };
    let noise = Noise::usual(1);
    let pose = Measured::Pose { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0] };
    let [mm, rad] = [0, 3].map(|k| noise.sigma(0, &pose, k));
    let turns = size(3) / rad > TURNS * size(0) / mm;
    let (first, scale, label, unit) =
        if turns { (3, 1.0_f64.to_degrees(), "orientation error, deg", "deg") } else { (0, 1e3, "error, mm", "mm") };
    let of = |all: &[Vector6<f64>]| all.iter().map(|r| r.fixed_rows::<3>(first) * scale).collect::<Vec<Vector3<f64>>>();
    let (with, without, along) = (of(&with), of(&without), along.map(|a| of(&a)));
    let mut out = Seen { label, unit, before: Vec::new(), after: Vec::new(), part: Vec::new() };
    for k in 0..with.len() {
        let part = with[k] - without[k];
        let along = along
            .as_ref()
            .and_then(|a| a[k].try_normalize(1e-9))
            .or_else(|| part.try_normalize(1e-9))
            .unwrap_or_else(Vector3::zeros);
        out.before.push(without[k].dot(&along));
        out.after.push(with[k].dot(&along));
        out.part.push(-part.dot(&along));
    }
    Ok(out)
}

/// The variable that reveals a finding, at every observation; `None` where only what it does itself tells.
fn revealing(f: &Finding, d: &Diagnosis) -> Option<(String, Vec<f64>)> {
    let own: Vec<&Term> = d.model.terms.iter().filter(|t| f.coefficients.iter().any(|c| c.name == t.name)).collect();
    // of waves, the one that is largest
    let size = |t: &Term| {
        let same = own.iter().filter(|o| o.basis.of == t.basis.of && o.basis.shape.cycles() == t.basis.shape.cycles());
        t.basis.shape.cycles().map_or(0.0, |_| same.map(|o| o.value).fold(0.0, f64::hypot))
    };
    let term = own.iter().copied().reduce(|a, b| if size(b) > size(a) { b } else { a })?;
    if term.site == Site::AllJoints {
        return None;
    }
    let o = &d.data.observations;
    let of = |value: &dyn Fn(&State) -> f64| o.iter().map(|o| value(&o.state)).collect::<Vec<f64>>();
    if let Some(joint) = term.basis.sense {
        let sense = of(&|s| s.dir.map_or(0.0, |d| f64::from(d[joint - 1])));
        return Some((format!("last move of joint {joint}: -1 down, 1 up"), sense));
    }
    match (term.basis.of, term.basis.shape) {
        (Variable::Joint { joint }, Shape::Sine { cycles } | Shape::Cosine { cycles }) if cycles > 6.5 => {
            let turn = 360.0 / cycles;
            Some((
                format!("joint {joint} within a {turn:.2} deg cycle, deg"),
                of(&|s| s.q[joint - 1].to_degrees().rem_euclid(turn)),
            ))
        }
        (Variable::Joint { joint }, _) => {
            let kind = d.model.robot.joints.get(joint - 1).map_or(JointKind::Revolute, |j| j.kind);
            let (what, (per_si, unit)) = (if kind == JointKind::Prismatic { "position" } else { "angle" }, kind.unit());
            Some((format!("{what} of joint {joint}, {unit}"), of(&|s| s.q[joint - 1] * per_si)))
        }
        (Variable::Moment { joint, .. }, _) if !matches!(term.site, Site::Across { .. }) => {
            let forward = Forward::new(d.model.clone(), Vec::new()).ok()?;
            let mut ws = forward.workspace();
            let torque =
                o.iter().map(|o| forward.gravity_torques(&o.state, &mut ws).map_or(0.0, |t| t[joint - 1])).collect();
            Some((format!("gravity torque about joint {joint}, Nm"), torque))
        }
        (Variable::Lag { joint }, _) => Some((
            format!("commanded minus read angle of joint {joint}, deg"),
            of(&|s| s.q_commanded.map_or(0.0, |c| (c[joint - 1] - s.q[joint - 1]).to_degrees())),
        )),
        (Variable::Seq, _) => Some(("number of the pose (seq)".into(), of(&|s| s.seq.unwrap_or(0.0)))),
        (Variable::Time, _) => Some(("time, min".into(), of(&|s| s.t.unwrap_or(0.0) / 60.0))),
        (Variable::Temperature { .. }, _) => Some(("temperature, degC".into(), of(&|s| s.temp_c.unwrap_or(0.0)))),
        (Variable::Reading { axis }, _) => {
            let reading = |m: &Measured| match m {
                Measured::Touch { reading, .. } => reading[axis as usize] * 1e3,
                _ => 0.0,
            };
            Some((
                format!("reading {}, mm", format!("{axis:?}").to_lowercase()),
                o.iter().map(|o| reading(&o.measured)).collect(),
            ))
        }
        _ => None,
    }
}

/// A finding against the variable that reveals it, one value for each observation (of its session).
pub struct Against {
    /// What `x` is, with its unit.
    pub label: String,
    /// The variable.
    pub x: Vec<f64>,
    /// What the errors are, with their unit: "error, mm", or of what only turns the tool "orientation error, deg".
    pub error: &'static str,
    /// Error along the direction in which the finding acts without it, everything else fitted anew.
    pub without: Vec<f64>,
    /// Error with the finding.
    pub with: Vec<f64>,
}

/// What a finding does, against the variable that reveals it.
///
/// # Errors
/// A model that cannot be evaluated.
pub fn against(f: &Finding, d: &Diagnosis) -> Result<Against> {
    let Seen { label: error, unit, before: mut without, after: mut with, part } = seen(f, d)?;
    let (label, mut x) = revealing(f, d).unwrap_or_else(|| (format!("error that this finding predicts, {unit}"), part));
    if let Some(session) = f.session {
        // others were not there
        let there = |k: usize| d.data.observations[k].recording + 1 == session as usize;
        for values in [&mut x, &mut without, &mut with] {
            let mut at = 0..;
            values.retain(|_| at.next().is_some_and(there));
        }
    }
    Ok(Against { label, x, error, without, with })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_diagnose::Coefficient;

    use super::*;

    #[test]
    fn what_others_say_of_a_finding_is_theirs_where_it_is_left_out() {
        let mut model = crate::test_data::arm();
        let term = |name: &str, value| {
            let site = Site::Joint { joint: 2 };
            Term { value, sd: Some(1e-3), ..Term::new(name, "effect", site, Basis::CONSTANT) }
        };
        model.terms.extend([term("own", 2e-3), term("other", 1e-3), term("apart", 1e-3)]);
        let names = ["own", "other", "apart"].map(str::to_owned).to_vec();
        let correlation = vec![1.0, -0.8, 0.0, -0.8, 1.0, 0.0, 0.0, 0.0, 1.0];
        let known = Uncertainty { names, correlation, noise: 1e-5, rotation_noise: None, course: 0.0, effects: 0.0 };
        let left = |known: Option<&Uncertainty>| {
            let without = without(&|t| t.name == "own", &model, known);
            without.terms[without.terms.len() - 3..].iter().map(|t| (t.value * 1e6).round()).collect::<Vec<_>>()
        };
        assert_eq!(left(Some(&known)), [0.0, 2600.0, 1000.0]);
        assert_eq!(left(None), [0.0, 1000.0, 1000.0]);
    }

    #[test]
    fn errors_without_a_finding_go_on_in_proportion_to_its_size() {
        let mut model = crate::test_data::arm();
        let own = Term::new("own", "effect", Site::Joint { joint: 2 }, Basis::CONSTANT);
        model.terms.push(Term { value: 0.5, ..own });
        let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
        let data = crate::test_data::data(&[(0..3).map(|k| (crate::test_data::pose(k), touch)).collect()]);
        let off_by = |value: f64| {
            let mut other = model.clone();
            other.terms.iter_mut().filter(|t| t.name == "own").for_each(|t| t.value = value);
            other
        };
        let with = six(&model, &data).unwrap();
        let gone = linear(&model, &off_by(0.0), &data, &with).unwrap();
        let tenth = linear(&model, &off_by(0.45), &data, &with).unwrap();
        let exact = six(&off_by(0.0), &data).unwrap();
        for k in 0..3 {
            let [gone, tenth, exact] = [gone[k], tenth[k], exact[k]].map(|r| r - with[k]);
            assert!((gone - tenth * 10.0).norm() < 1e-4 * gone.norm());
            assert!((gone - exact).norm() > 0.1 * gone.norm(), "half a radian is far");
        }
    }

    #[test]
    fn a_finding_of_several_waves_is_drawn_over_the_cycle_of_the_largest() {
        let mut d = crate::test_data::diagnosis();
        let mut f = d.findings[0].clone();
        let wave = |name: &str, shape, value| {
            let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
            Term { value, ..Term::new(name, "gear_ripple", Site::Joint { joint: 2 }, basis) }
        };
        let mut over = |[sine, cosine]: [f64; 2], other: f64| {
            let waves = [
                wave("a", Shape::Sine { cycles: 20.0 }, other),
                wave("b", Shape::Cosine { cycles: 20.0 }, 0.0),
                wave("c", Shape::Sine { cycles: 10.0 }, sine),
                wave("d", Shape::Cosine { cycles: 10.0 }, cosine),
            ];
            f.coefficients =
                waves.iter().map(|t| Coefficient { name: t.name.clone(), ..f.coefficients[0].clone() }).collect();
            d.model.terms.retain(|t| t.effect != "gear_ripple");
            d.model.terms.extend(waves);
            revealing(&f, &d).unwrap()
        };
        // the amplitude counts, not the larger of the two coefficients
        let (label, x) = over([3e-4, -3e-4], 4e-4);
        assert_eq!(label, "joint 2 within a 36.00 deg cycle, deg");
        assert!(x.iter().all(|x| (0.0..36.0).contains(x)) && x.iter().any(|x| *x > 18.0));
        assert_eq!(over([3e-4, 0.0], 4e-4).0, "joint 2 within a 18.00 deg cycle, deg");
    }
}
