//! Whether the waves of a joint's curve have phases that know nothing of each other, as those of an encoder's error. What happens at one
//! angle only (a damaged tooth, a step) or jumps between two levels has waves too, but in phase: beside the same waves with phases drawn by
//! chance (surrogate data: Theiler et al. 1992) its tails are too long, or too short.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::dense::{Mat, dot};
use trical_model::{Shape, Term, trig};

use crate::candidate::cycles_of;
use crate::settings::{PHASE_ANGLES, PHASE_DRAWS};

/// How probable it is that waves of these sizes (fitted terms of one joint's own angle) with phases by chance have tails as unusual as theirs at the
/// `angles` that were visited. 1 where there is nothing to tell.
pub(crate) fn p_value(waves: &[&Term], angles: &[f64]) -> f64 {
    let mut parts: Vec<(f64, [f64; 2])> = Vec::new();
    for t in waves {
        let Some(cycles) = cycles_of(t) else { continue };
        let part = usize::from(matches!(t.basis.shape, Shape::Cosine { .. }));
        match parts.iter_mut().find(|(of, _)| *of == cycles) {
            Some((_, sizes)) => sizes[part] = t.value,
            None => parts.push((cycles, if part == 0 { [t.value, 0.0] } else { [0.0, t.value] })),
        }
    }
    let every = angles.len().div_ceil(PHASE_ANGLES).max(1);
    let angles: Vec<f64> = angles.iter().step_by(every).copied().collect();
    if parts.len() < 2 || angles.len() < 4 {
        return 1.0;
    }
    // what a joint's zero and its gear ratio take up is no part of the curve
    let constant = vec![1.0; angles.len()];
    let slope = without(&[&constant], angles.clone());
    let column = |of: &dyn Fn(f64) -> f64| without(&[&constant, &slope], angles.iter().map(|q| of(*q)).collect());
    let columns: Vec<[Vec<f64>; 2]> =
        parts.iter().map(|(n, _)| [column(&|q| trig::sin(n * q)), column(&|q| trig::cos(n * q))]).collect();
    let n = 2 * parts.len();
    let shown = Mat::from_fn(angles.len(), n, |i, j| columns[j / 2][j % 2][i]);
    let mut rng = Pcg64Mcg::seed_from_u64(20_261_126);
    // the first column is the curve itself
    let mut sizes = Mat::zeros(n, 1 + PHASE_DRAWS);
    for (k, (_, own)) in parts.iter().enumerate() {
        let amplitude = libm::hypot(own[0], own[1]);
        for draw in 0..=PHASE_DRAWS {
            let (sin, cos) = trig::sin_cos(rng.random_range(0.0..std::f64::consts::TAU));
            let [a, b] = if draw == 0 { *own } else { [amplitude * sin, amplitude * cos] };
            (sizes[(2 * k, draw)], sizes[(2 * k + 1, draw)]) = (a, b);
        }
    }
    let curves = &shown * &sizes;
    let tails: Vec<f64> = (0..curves.ncols()).map(|k| kurtosis(curves.col(k))).collect();
    let longer = tails[1..].iter().filter(|t| **t >= tails[0]).count();
    let shorter = tails[1..].iter().filter(|t| **t <= tails[0]).count();
    (2.0 * (1 + longer.min(shorter)) as f64 / (1 + PHASE_DRAWS) as f64).min(1.0)
}

/// What is left of values beside some that are orthogonal to each other.
fn without(known: &[&Vec<f64>], mut values: Vec<f64>) -> Vec<f64> {
    for own in known {
        let share = dot(own, &values) / dot(own, own).max(f64::MIN_POSITIVE);
        values.iter_mut().zip(own.iter()).for_each(|(v, x)| *v -= share * x);
    }
    values
}

/// Fourth moment in units of the squared second one, of values whose mean is zero.
fn kurtosis(values: &[f64]) -> f64 {
    let moment = |power: i32| values.iter().map(|v| v.powi(power)).sum::<f64>() / values.len() as f64;
    moment(4) / moment(2).powi(2).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use trical_model::{Basis, Site, Variable};

    use super::*;

    /// The first 24 waves of a curve over one turn, at angles over most of it.
    fn asked(curve: impl Fn(f64) -> f64) -> f64 {
        let turn: Vec<f64> = (0..720).map(|k| f64::from(k).to_radians() / 2.0).collect();
        let mean = |of: &dyn Fn(f64) -> f64| turn.iter().map(|q| 2.0 * curve(*q) * of(*q)).sum::<f64>() / 720.0;
        let term = |value: f64, shape| {
            let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
            Term { value, ..Term::new("wave", "encoder_error", Site::Joint { joint: 2 }, basis) }
        };
        let waves: Vec<Term> = (1..=24)
            .map(f64::from)
            .flat_map(|cycles| {
                let sine = term(mean(&|q| (cycles * q).sin()), Shape::Sine { cycles });
                [sine, term(mean(&|q| (cycles * q).cos()), Shape::Cosine { cycles })]
            })
            .collect();
        p_value(&waves.iter().collect::<Vec<_>>(), &turn[60..600])
    }

    #[test]
    fn a_bump_and_a_square_wave_have_their_waves_in_phase_and_an_encoders_error_has_not() {
        let bump = asked(|q| 1e-4 * (-0.5 * ((q - 2.0) / 0.12).powi(2)).exp());
        let square = asked(|q| 1e-4 * (2.0 * q + 0.3).sin().signum());
        assert!(bump < 1e-3 && square < 1e-2, "{bump} {square}");
        // phases of no order
        let phase = |n: f64| 1000.0 * (12.9898 * n).sin();
        let encoder = asked(|q| (1..=20).map(f64::from).map(|n| 1e-4 / n.sqrt() * (n * q + phase(n)).sin()).sum());
        assert!(encoder > 0.05, "{encoder}");
    }

    #[test]
    fn one_wave_tells_nothing() {
        assert_eq!(p_value(&[], &[0.0, 1.0, 2.0, 3.0]), 1.0);
    }
}
