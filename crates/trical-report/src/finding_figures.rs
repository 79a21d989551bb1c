//! Pictures of what was found at a joint: the fitted curve over the data, and the spectrum of what a ripple leaves.

use nalgebra::Vector6;
use plotters::style::RGBColor;
use trical_diagnose::{Diagnosis, EffectId, Finding};
use trical_ident::{Dataset, Noise};
use trical_model::{Basis, JointKind, Measured, Model, Site, Term, Variable};

use crate::error::Result;
use crate::evidence::six;
use crate::page::Figure;
use crate::plots::{self, BEFORE, Band, Series, span};

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

/// How a joint is off at each measurement, without a finding and all else modelled.
struct Angles {
    joint: usize,
    /// Index of the observation, joint angle in deg, how far it is off in deg.
    points: Vec<(usize, f64, f64)>,
    /// The finding's terms.
    terms: Vec<Term>,
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

/// The angle by which the joint would have to be off to explain what is left without the finding; `None` where the finding is no curve of
/// one revolute joint's own angle.
fn angles(f: &Finding, d: &Diagnosis) -> Result<Option<Angles>> {
    let own = |t: &&Term| f.coefficients.iter().any(|c| c.name == t.name);
    let terms: Vec<Term> = d.model.terms.iter().filter(own).cloned().collect();
    let Some(Site::Joint { joint }) = terms.first().map(|t| t.site) else { return Ok(None) };
    let of_its_angle = |t: &Term| {
        t.site == Site::Joint { joint } && t.basis.of == Variable::Joint { joint } && t.basis.sense.is_none()
    };
    let turns = d.model.robot.joints.get(joint - 1).is_some_and(|j| j.kind == JointKind::Revolute);
    if !turns || !terms.iter().all(of_its_angle) {
        return Ok(None);
    }
    let mut without: Model = d.model.clone();
    without.terms.retain(|t| !own(&t));
    Ok(Some(Angles { joint, points: how_far_off(joint, &without, &d.data)?, terms }))
}

/// By which angle a joint would have to be off to explain what the model leaves: index of the observation, joint angle and that angle, deg.
fn how_far_off(joint: usize, without: &Model, data: &Dataset) -> Result<Vec<(usize, f64, f64)>> {
    const TINY: f64 = 1e-5;
    let mut turned = without.clone();
    let mut probe = Term::new("turned", "turned", Site::Joint { joint }, Basis::CONSTANT);
    probe.value = TINY;
    turned.terms.push(probe);
    let (left, turned) = (in_noise(without, data)?, in_noise(&turned, data)?);
    let levers: Vec<Vector6<f64>> = left.iter().zip(&turned).map(|(a, b)| (b - a) / TINY).collect();
    let longest = levers.iter().map(Vector6::norm).fold(0.0, f64::max);
    let points = left.iter().zip(&levers).zip(&data.observations).enumerate().filter_map(|(k, ((left, lever), o))| {
        let far = lever.norm() > SHORT_LEVER * longest;
        let off = -lever.dot(left) / lever.norm_squared();
        far.then(|| (k, o.state.q[joint - 1].to_degrees(), off.to_degrees()))
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
    fn of(a: &Angles, d: &Diagnosis) -> Self {
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
        let mean = |t: &Term| a.points.iter().map(|p| t.basis.shape.at(p.1.to_radians()).0).sum::<f64>() / count;
        Self { covariance, middle: terms.iter().map(mean).collect() }
    }

    /// Value of the fitted curve at an angle, and the standard deviation of how far it is from its mean, which cannot be told from the
    /// joint's zero, deg.
    fn curve_at(&self, terms: &[Term], deg: f64) -> (f64, f64) {
        let b: Vec<f64> = terms.iter().map(|t| t.basis.shape.at(deg.to_radians()).0).collect();
        let value: f64 = terms.iter().zip(&b).map(|(t, b)| t.value * b).sum();
        let off: Vec<f64> = b.iter().zip(&self.middle).map(|(b, m)| b - m).collect();
        let row = |(row, x): (&[f64], &f64)| x * row.iter().zip(&off).map(|(c, y)| c * y).sum::<f64>();
        let variance: f64 = self.covariance.chunks(off.len().max(1)).zip(&off).map(row).sum();
        (value.to_degrees(), variance.max(0.0).sqrt().to_degrees())
    }
}

fn fitted_curve(a: &Angles, d: &Diagnosis) -> Result<Figure> {
    let (low, high) = span(a.points.iter().map(|p| p.1));
    let several = d.data.names.len() > 1;
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
                points: a.points.iter().filter(|p| of(p.0)).map(|p| (p.1, p.2 * 1e3)).collect(),
            }
        })
        .collect();
    let spread = Spread::of(a, d);
    let curve = (0..=CURVE).map(|k| {
        let deg = low + (high - low) * f64::from(k) / f64::from(CURVE);
        let (value, sd) = spread.curve_at(&a.terms, deg);
        (deg, value * 1e3, (value - 1.96 * sd) * 1e3, (value + 1.96 * sd) * 1e3)
    });
    let band = Band { name: "fitted, 95 %".into(), color: BEFORE, points: curve.collect() };
    let joint = a.joint;
    Ok(Figure::new(
        format!(
            "Error of joint {joint} in thousandths of a degree: what each measurement shows with \
                 everything else modelled, and the fitted curve with its 95 % band. The curve's mean is \
                 part of the joint's zero."
        ),
        plots::curve_over_data(&format!("angle of joint {joint}, deg"), "error of the joint, mdeg", &series, &band)?,
    ))
}

/// Amplitude (mdeg) of the sine and cosine that fit best, for each whole number of cycles a turn.
fn amplitudes(points: &[(usize, f64, f64)], most: u32) -> Vec<(f64, f64)> {
    (1..=most)
        .filter_map(|n| {
            let n = f64::from(n);
            let (mut ss, mut cc, mut sc, mut sy, mut cy) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (_, q, y) in points {
                let (s, c) = (n * q.to_radians()).sin_cos();
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
                (n, a.hypot(b) * 1e3)
            })
        })
        .collect()
}

/// Figures of a finding that is a curve of a joint's own angle: the curve over the data, and for gear ripples the spectrum, in which the
/// gear's numbers are marked. None of any other finding.
///
/// # Errors
/// A model that cannot be evaluated, or a figure that cannot be drawn.
pub fn figures(f: &Finding, d: &Diagnosis) -> Result<Vec<Figure>> {
    let Some(angles) = angles(f, d)? else { return Ok(Vec::new()) };
    let mut cycles: Vec<f64> = angles.terms.iter().filter_map(|t| t.basis.shape.cycles()).collect();
    if f.effect != EffectId::GearRipple {
        return Ok(vec![fitted_curve(&angles, d)?]);
    }
    cycles.sort_by(f64::total_cmp);
    cycles.dedup();
    let spectrum = amplitudes(&angles.points, CYCLES);
    let joint = angles.joint;
    Ok(vec![Figure::new(
        format!(
            "How strongly joint {joint} is off with each number of cycles a turn, each number fitted alone; the \
                 amplitudes above were fitted together. Red: the numbers that the finding names."
        ),
        plots::spectrum(&format!("cycles per turn of joint {joint}"), "amplitude, mdeg", &spectrum, &cycles)?,
    )])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::{arm, data, pose};
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
        for (_, q, off) in off {
            let expected = 0.05 * q.to_radians().sin();
            assert!((off - expected).abs() < 1e-5, "{q}: {off} {expected}");
        }
    }

    #[test]
    fn the_spectrum_of_a_ripple_has_its_number_and_its_size() {
        let points: Vec<(usize, f64, f64)> = (0..300_u32)
            .map(|k| {
                let q = 170.0 * (f64::from(k) * 0.7).sin();
                (0, q, 0.008 * (80.0 * q.to_radians()).sin())
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
            spread.curve_at(terms, 90.0)
        };
        let (value, sd) = band(&[variance], &[term.clone()], 0.0);
        assert!((value - 0.01).abs() < 1e-12 && (sd - 0.001).abs() < 1e-12);
        // a mean that the zero of the joint takes up is not in doubt; nor is a sum of which only the parts are
        assert!((band(&[variance], &[term.clone()], 0.75).1 - 0.00025).abs() < 1e-12);
        let (value, sd) = band(&[variance, -variance, -variance, variance], &[term.clone(), term], 0.0);
        assert!((value - 0.02).abs() < 1e-12 && sd < 1e-12);
    }
}
