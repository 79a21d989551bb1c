//! Pictures of what was found at a joint: the fitted curve over the data, and the spectrum of what a ripple leaves.

use nalgebra::Vector6;
use plotters::style::RGBColor;
use trical_diagnose::effect_id::UNEXPLAINED;
use trical_diagnose::{Diagnosis, EffectId, Finding, Unexplained};
use trical_ident::{Dataset, Noise};
use trical_model::{Basis, JointKind, Measured, Model, Place, Site, State, Term, Variable};

use crate::error::Result;
use crate::evidence::six;
use crate::figures::plots::{self, BEFORE, Band, Series, span};
use crate::page::Figure;

/// Colours of sessions.
const SESSIONS: [(&str, RGBColor); 4] = [
    ("session 1", RGBColor(38, 102, 165)),
    ("session 2", RGBColor(46, 139, 87)),
    ("session 3", RGBColor(148, 103, 189)),
    ("session 4", RGBColor(120, 120, 120)),
];

/// Measurements whose lever arm is shorter than this share of the longest say little about an angle.
const SHORT_LEVER: f64 = 0.25;

/// Points of a fitted curve.
const CURVE: u32 = 400;

/// Most cycles a turn of a spectrum: more than any gear that is named has.
const CYCLES: u32 = 320;

/// How a joint is off at each measurement, without a curve of one variable and all else modelled. SI.
struct Off {
    joint: usize,
    /// Index of the observation, the variable, how far the joint is off.
    points: Vec<(usize, f64, f64)>,
    /// The curve's terms.
    terms: Vec<Term>,
}

impl Off {
    /// Of terms at one joint that depend on one variable alone, whatever the sense of motion; `None` of others.
    fn of(terms: Vec<Term>, model: &Model, data: &Dataset) -> Result<Option<Self>> {
        let Some((Site::Joint { joint }, of)) = terms.first().map(|t| (t.site, t.basis.of)) else { return Ok(None) };
        let alike = |t: &Term| {
            let alone = t.basis.sense.is_none() && t.basis.beside.is_none();
            t.site == Site::Joint { joint } && t.basis.of == of && alone
        };
        let value = |s: &State| match of {
            Variable::Joint { joint } => Some(s.q[joint - 1]),
            Variable::Seq => s.seq,
            Variable::Time => s.t,
            _ => None,
        };
        let there = |s: &State| terms.iter().any(|t| !t.basis.is_elsewhere(s));
        if !terms.iter().all(alike) || data.observations.iter().any(|o| value(&o.state).is_none()) {
            return Ok(None);
        }
        let mut without: Model = model.clone();
        without.terms.retain(|t| terms.iter().all(|own| own.name != t.name));
        let state = |k: usize| &data.observations[k].state;
        let off = how_far_off(joint, &without, data)?.into_iter();
        let points = off.filter(|(k, _)| there(state(*k))).filter_map(|(k, off)| Some((k, value(state(k))?, off)));
        Ok(Some(Self { joint, points: points.collect(), terms }))
    }
}

/// Residuals in units of the usual noise: at the last joint it is the orientation that tells its angle.
fn in_noise(model: &Model, data: &Dataset) -> Result<Vec<Vector6<f64>>> {
    let usual = Noise::usual(data.names.len());
    let mut all = six(model, data)?;
    for (r, o) in all.iter_mut().zip(&data.observations) {
        let rows = if matches!(o.measured, Measured::Pose { .. }) { 6 } else { 3 };
        r.iter_mut().enumerate().take(rows).for_each(|(k, x)| *x /= usual.sigma(o.recording, &o.measured, k));
    }
    Ok(all)
}

/// By how much a joint would have to be off to explain what the model leaves, by the index of the observation.
fn how_far_off(joint: usize, without: &Model, data: &Dataset) -> Result<Vec<(usize, f64)>> {
    const TINY: f64 = 1e-5;
    let mut turned = without.clone();
    let mut probe = Term::new("turned", "turned", Site::Joint { joint }, Basis::CONSTANT);
    probe.value = TINY;
    turned.terms.push(probe);
    let (left, turned) = (in_noise(without, data)?, in_noise(&turned, data)?);
    let levers: Vec<Vector6<f64>> = left.iter().zip(&turned).map(|(a, b)| (b - a) / TINY).collect();
    let longest = levers.iter().map(Vector6::norm).fold(0.0, f64::max);
    let points = left.iter().zip(&levers).enumerate().filter_map(|(k, (left, lever))| {
        let far = lever.norm() > SHORT_LEVER * longest;
        far.then(|| (k, -lever.dot(left) / lever.norm_squared()))
    });
    Ok(points.collect())
}

/// How the coefficients of a curve go together: their covariance, row by row, and the mean of each basis over the measurements.
struct Spread {
    covariance: Vec<f64>,
    middle: Vec<f64>,
}

impl Spread {
    /// Coefficients are taken as independent where the fit has too many to keep their correlation.
    fn of(a: &Off, d: &Diagnosis) -> Self {
        let terms = &a.terms;
        let place = |t: &Term| d.uncertainty.as_ref().and_then(|u| u.names.iter().position(|name| *name == t.name));
        let places: Vec<Option<usize>> = terms.iter().map(place).collect();
        let sd = |k: usize| terms[k].sd.unwrap_or(0.0);
        let correlation = |i: usize, j: usize| match (&d.uncertainty, places[i], places[j]) {
            _ if i == j => 1.0,
            (Some(u), Some(a), Some(b)) => u.correlation[a * u.names.len() + b],
            _ => 0.0,
        };
        let n = terms.len();
        let covariance = (0..n * n).map(|k| correlation(k / n, k % n) * sd(k / n) * sd(k % n)).collect();
        let count = a.points.len().max(1) as f64;
        let mean = |t: &Term| a.points.iter().map(|p| t.basis.shape.at(p.1).0).sum::<f64>() / count;
        Self { covariance, middle: terms.iter().map(mean).collect() }
    }

    /// Value of the fitted curve, and the standard deviation of how far it is from its mean, which cannot be told from the joint's zero.
    fn curve_at(&self, terms: &[Term], x: f64) -> (f64, f64) {
        let b: Vec<f64> = terms.iter().map(|t| t.basis.shape.at(x).0).collect();
        let value: f64 = terms.iter().zip(&b).map(|(t, b)| t.value * b).sum();
        let off: Vec<f64> = b.iter().zip(&self.middle).map(|(b, m)| b - m).collect();
        let row = |(row, x): (&[f64], &f64)| x * row.iter().zip(&off).map(|(c, y)| c * y).sum::<f64>();
        let variance: f64 = self.covariance.chunks(off.len().max(1)).zip(&off).map(row).sum();
        (value, variance.max(0.0).sqrt())
    }
}

/// The curve over what the measurements show; `x` says of what it is one, and how many of its units one of SI is.
fn fitted_curve(a: &Off, (x_label, per_si): (&str, f64), d: &Diagnosis) -> Result<Figure> {
    let (low, high) = span(a.points.iter().map(|p| p.1));
    let several = d.data.names.len() > 1;
    // thousandths of a degree
    let (unit, per_off) = match d.model.robot.kind(a.joint) {
        JointKind::Revolute => ("mdeg", 1e3_f64.to_degrees()),
        slides @ JointKind::Prismatic => (slides.unit().1, slides.unit().0),
    };
    let series: Vec<Series> = SESSIONS
        .iter()
        .take(d.data.names.len())
        .enumerate()
        .map(|(k, (name, color))| {
            let last = k + 1 == SESSIONS.len();
            let of = |i: usize| d.data.observations[i].recording == k || last && d.data.observations[i].recording > k;
            Series {
                name: if several { name } else { "measurements" },
                color: *color,
                points: a.points.iter().filter(|p| of(p.0)).map(|p| (p.1 * per_si, p.2 * per_off)).collect(),
            }
        })
        .collect();
    let spread = Spread::of(a, d);
    let curve = (0..=CURVE).map(|k| {
        let x = low + (high - low) * f64::from(k) / f64::from(CURVE);
        let (value, sd) = spread.curve_at(&a.terms, x);
        (x * per_si, value * per_off, (value - 1.96 * sd) * per_off, (value + 1.96 * sd) * per_off)
    });
    let band = Band { name: "fitted, 95 %".into(), color: BEFORE, points: curve.collect() };
    let joint = a.joint;
    Ok(Figure::new(
        format!(
            "Error of joint {joint}: what each measurement shows with everything else modelled, and the fitted curve \
                 with its 95 % band. The curve's mean is part of the joint's zero."
        ),
        plots::curve_over_data(x_label, &format!("error of the joint, {unit}"), &series, &band)?,
    ))
}

/// Amplitude (mdeg) of the sine and cosine that fit best, for each whole number of cycles a turn; points are angles in rad.
fn amplitudes(points: &[(usize, f64, f64)], most: u32) -> Vec<(f64, f64)> {
    (1..=most)
        .filter_map(|n| {
            let n = f64::from(n);
            let (mut ss, mut cc, mut sc, mut sy, mut cy) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (_, q, y) in points {
                let (s, c) = (n * q).sin_cos();
                ss += s * s;
                cc += c * c;
                sc += s * c;
                sy += s * y;
                cy += c * y;
            }
            let det = ss * cc - sc * sc;
            // waves longer than what the joint moved through cannot be told from a line
            (det > 0.05 * (ss * cc).max(1e-12)).then(|| {
                let (a, b) = ((cc * sy - sc * cy) / det, (ss * cy - sc * sy) / det);
                (n, a.hypot(b) * 1e3_f64.to_degrees())
            })
        })
        .collect()
}

/// Figures of a finding that is a curve of a joint's angle at a joint: the curve over the data, and for gear ripples the spectrum, in which the
/// gear's numbers are marked. None of any other finding.
///
/// # Errors
/// A model that cannot be evaluated, or a figure that cannot be drawn.
pub fn figures(f: &Finding, d: &Diagnosis) -> Result<Vec<Figure>> {
    let terms = d.model.terms.iter().filter(|t| f.coefficients.iter().any(|c| c.name == t.name));
    let with_angle = |off: Off| match off.terms.first()?.basis.of {
        Variable::Joint { joint } if d.model.robot.kind(joint) == JointKind::Revolute => Some((off, joint)),
        _ => None,
    };
    let Some((off, angle)) = Off::of(terms.cloned().collect(), &d.model, &d.data)?.and_then(with_angle) else {
        return Ok(Vec::new());
    };
    let mut cycles: Vec<f64> = off.terms.iter().filter_map(|t| t.basis.shape.cycles()).collect();
    if f.effect != EffectId::GearRipple {
        return Ok(vec![fitted_curve(&off, (&format!("angle of joint {angle}, deg"), 1.0_f64.to_degrees()), d)?]);
    }
    let joint = off.joint;
    cycles.sort_by(f64::total_cmp);
    cycles.dedup();
    let spectrum = amplitudes(&off.points, CYCLES);
    Ok(vec![Figure::new(
        format!(
            "How strongly joint {joint} is off with each number of cycles a turn, each number fitted alone; the \
                 amplitudes above were fitted together. Red: the numbers that the finding names."
        ),
        plots::spectrum(&format!("cycles per turn of joint {joint}"), "amplitude, mdeg", &spectrum, &cycles)?,
    )])
}

/// The curve without a known cause over the measurements; `None` of one that is no curve of a single variable at a joint.
///
/// # Errors
/// As [`figures`].
pub fn of_no_cause(u: &Unexplained, x_label: &str, d: &Diagnosis) -> Result<Option<Figure>> {
    let Place::Joint(joint) = u.site else { return Ok(None) };
    let is_own = |t: &&Term| {
        let of = match t.basis.of {
            Variable::Joint { joint } => format!("q{joint}"),
            Variable::Seq => "seq".into(),
            Variable::Time => "time".into(),
            _ => return false,
        };
        t.effect == UNEXPLAINED && t.site == Site::Joint { joint } && of == u.variable && t.basis.beside.is_none()
    };
    let terms: Vec<Term> = d.model.terms.iter().filter(is_own).cloned().collect();
    let per_si = match terms.first().map(|t| t.basis.of) {
        Some(Variable::Joint { joint }) => d.model.robot.kind(joint).unit().0,
        _ => 1.0,
    };
    // with another joint's angle it is drawn in the middle of that
    let alone = !u.region.contains(", with ");
    let off = if alone { Off::of(terms, &d.model, &d.data)? } else { None };
    off.map(|off| fitted_curve(&off, (x_label, per_si), d)).transpose()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::{arm, data, diagnosis, pose};
    use nalgebra::{Rotation3, UnitQuaternion};
    use trical_model::{Forward, Shape};

    /// A tool on the axis of the last joint is not moved by it, only turned.
    #[test]
    fn the_last_joints_angle_is_read_from_the_orientation() {
        let mut model = arm();
        (model.cell.tool.tcp.x, model.cell.tool.tcp.y) = (0.0, 0.0);
        let wave = Basis::new(Variable::Joint { joint: 6 }, Shape::Sine { cycles: 1.0 });
        let mut term = Term::new("sine_6", "joint_harmonic", Site::Joint { joint: 6 }, wave);
        term.value = 0.05_f64.to_radians();
        let mut truth = model.clone();
        truth.terms.push(term);
        let forward = Forward::new(truth, Vec::new()).unwrap();
        let mut ws = forward.workspace();
        let mut measured = |k: u8| {
            let seen = forward.world_from_tool(&pose(k), &mut ws);
            let rotation = Rotation3::from_matrix_unchecked(seen.rotation);
            let q = UnitQuaternion::from_rotation_matrix(&rotation);
            (pose(k), Measured::Pose { position: seen.translation.into(), quaternion: [q.w, q.i, q.j, q.k] })
        };
        let data = data(&[(0..12).map(&mut measured).collect()]);
        let off = how_far_off(6, &model, &data).unwrap();
        assert_eq!(off.len(), 12);
        for (k, off) in off {
            let q = data.observations[k].state.q[5];
            let expected = 0.05_f64.to_radians() * q.sin();
            assert!((off - expected).abs() < 1e-7, "{q}: {off} {expected}");
        }
    }

    /// A curve without a known cause is drawn over another joint's angle, where it is: in its own session.
    #[test]
    fn what_measurements_show_of_a_curve_is_over_what_it_is_one_of() {
        let mut model = arm();
        let on = Basis::new(Variable::Joint { joint: 5 }, Shape::Sine { cycles: 1.0 });
        let mut term = Term::new("c", UNEXPLAINED, Site::Joint { joint: 6 }, Basis { session: Some(2), ..on });
        term.value = 0.05_f64.to_radians();
        model.terms.push(term.clone());
        let forward = Forward::new(model.clone(), Vec::new()).unwrap();
        let mut ws = forward.workspace();
        let mut measured = |k: u8, session: u32| {
            let state = State { session: Some(session), ..pose(k) };
            let seen = forward.world_from_tool(&state, &mut ws);
            let rotation = Rotation3::from_matrix_unchecked(seen.rotation);
            let q = UnitQuaternion::from_rotation_matrix(&rotation);
            (state, Measured::Pose { position: seen.translation.into(), quaternion: [q.w, q.i, q.j, q.k] })
        };
        let sessions = [1, 2].map(|session| (0..6).map(|k| measured(k, session)).collect());
        let data = data(&sessions);
        let off = Off::of(vec![term.clone()], &model, &data).unwrap().unwrap();
        assert_eq!(off.points.iter().map(|p| p.0).collect::<Vec<_>>(), [6, 7, 8, 9, 10, 11]);
        for (k, x, off) in off.points {
            assert_eq!(x, data.observations[k].state.q[4]);
            assert!((off - term.value * x.sin()).abs() < 1e-7, "{x}: {off}");
        }
        // with the sense of motion it is no curve of one variable, and without a clock there is no time
        term.basis.sense = Some(6);
        assert!(Off::of(vec![term.clone()], &model, &data).unwrap().is_none());
        (term.basis.sense, term.basis.of) = (None, Variable::Time);
        assert!(Off::of(vec![term], &model, &data).unwrap().is_none());
    }

    #[test]
    fn a_joint_that_follows_another_is_drawn_over_the_others_angle() {
        let mut d = diagnosis();
        let mut f = d.findings[0].clone();
        // a gap follows the sense of motion and no angle
        assert!(figures(&f, &d).unwrap().is_empty());
        let basis = Basis::new(Variable::Joint { joint: 4 }, Shape::Linear);
        d.model.terms.push(Term::new("coupling_5_from_4", "joint_coupling", Site::Joint { joint: 5 }, basis));
        f.effect = EffectId::JointCoupling;
        f.coefficients[0].name = "coupling_5_from_4".into();
        let drawn = figures(&f, &d).unwrap();
        assert_eq!(drawn.len(), 1);
        assert!(drawn[0].svg.contains("angle of joint 4, deg"));
    }

    #[test]
    fn the_spectrum_of_a_ripple_has_its_number_and_its_size() {
        let points: Vec<(usize, f64, f64)> = (0..300_u32)
            .map(|k| {
                let q = 3.0 * (f64::from(k) * 0.7).sin();
                (0, q, 0.008_f64.to_radians() * (80.0 * q).sin())
            })
            .collect();
        let spectrum = amplitudes(&points, 120);
        let (n, size) = spectrum.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        assert!((n - 80.0).abs() < 0.1 && (size - 8.0).abs() < 0.01, "{n} {size}");
    }

    #[test]
    fn the_band_of_a_curve_is_that_of_its_coefficients_together() {
        let basis = Basis::new(Variable::Joint { joint: 1 }, Shape::Sine { cycles: 1.0 });
        let mut term = Term::new("sine_1", "joint_harmonic", Site::Joint { joint: 1 }, basis);
        (term.value, term.sd) = (0.01_f64.to_radians(), Some(0.001_f64.to_radians()));
        let variance = 0.001_f64.to_radians().powi(2);
        let band = |covariance: &[f64], terms: &[Term], middle: f64| {
            let spread = Spread { covariance: covariance.to_vec(), middle: vec![middle; terms.len()] };
            let (value, sd) = spread.curve_at(terms, std::f64::consts::FRAC_PI_2);
            (value.to_degrees(), sd.to_degrees())
        };
        let (value, sd) = band(&[variance], &[term.clone()], 0.0);
        assert!((value - 0.01).abs() < 1e-12 && (sd - 0.001).abs() < 1e-12);
        // a mean that the zero of the joint takes up is not in doubt; nor is a sum of which only the parts are
        assert!((band(&[variance], &[term.clone()], 0.75).1 - 0.00025).abs() < 1e-12);
        let (value, sd) = band(&[variance, -variance, -variance, variance], &[term.clone(), term], 0.0);
        assert!((value - 0.02).abs() < 1e-12 && sd < 1e-12);
    }
}
