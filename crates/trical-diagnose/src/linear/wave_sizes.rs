//! How large the waves of curves are, octave by octave, by what the data say of all curves together (evidence, MacKay 1992).
//!
//! A wave's coefficients are normal about zero. For each octave of cycles per turn one factor on the standard deviations that the effect
//! has for its waves is learnt: `f^2 = (n0 + sum x^2 / s^2) / (n0 + gamma)`, where `x` are the coefficients as fitted with the factors so
//! far, `s` the effect's own standard deviations, and `gamma = sum (1 - var(x) / (f s)^2)` counts the coefficients that the data
//! determine. `n0` coefficients of the effect's own size are added, so that few coefficients cannot decide. No factor is larger than one: where
//! little of a turn was visited, a wave that may be larger than encoders usually show takes the place of a parameter of the arm. Curves of all
//! joints have one factor: the joints of an arm are of one maker.

use trical_ident::dense::{Cholesky, Mat};

use super::design::Design;
use crate::candidate::{Candidate, cycles_of};
use crate::settings::{OWN_SIZE_WEIGHT, SIZE_ROUNDS, SIZE_SETTLED};

/// Octave of a wave: 1, 2 and 3, 4 to 7, ... cycles a turn.
fn octave(cycles: f64) -> usize {
    (cycles.max(1.0) as u32).ilog2() as usize
}

impl Design {
    /// Standard deviations of the waves of the first `curves` of the candidates (which are those of the design), beside the others, as the data say
    /// they are: for each curve one for each of its coefficients. The noise must be that of a fit with all of them. `None` where they do not
    /// determine a fit.
    #[must_use]
    pub fn wave_sizes(&self, candidates: &[Candidate], curves: usize) -> Option<Vec<Vec<f64>>> {
        self.prepare(&(0..candidates.len()).collect::<Vec<_>>());
        let grams = (0..candidates.len()).map(|c| self.gram(c));
        let columns: Vec<&[f64]> = grams.flat_map(|own| (0..own.ncols()).map(|j| own.col(j))).collect();
        let gram = Mat::from_fn(self.width, columns.len(), |i, j| columns[j][i]);
        let push = Mat::from_fn(self.width, 1, |i, _| -self.b[i]);
        let waves: Vec<Option<usize>> =
            candidates[..curves].iter().flat_map(|c| c.terms.iter().map(|t| cycles_of(t).map(octave))).collect();
        let octaves = waves.iter().flatten().max()? + 1;
        let own = &self.precision;
        // f^2 of each octave, and of a column
        let mut squares = vec![1.0; octaves];
        let square = |squares: &[f64], k: usize| waves.get(k).copied().flatten().map_or(1.0, |o: usize| squares[o]);
        for _ in 0..SIZE_ROUNDS {
            let mut normal = gram.clone();
            for (k, precision) in own.iter().enumerate() {
                normal[(k, k)] += precision / square(&squares, k);
            }
            let factor = Cholesky::of(&normal)?;
            let (x, variance) = (factor.solve(&push), factor.inverse());
            let (mut sizes, mut counts) = (vec![OWN_SIZE_WEIGHT; octaves], vec![OWN_SIZE_WEIGHT; octaves]);
            for (k, octave) in waves.iter().enumerate() {
                let Some(octave) = *octave else { continue };
                sizes[octave] += x[(k, 0)].powi(2) * own[k];
                counts[octave] += 1.0 - (variance[(k, k)] * own[k] / squares[octave]).min(1.0);
            }
            let new: Vec<f64> = sizes.iter().zip(&counts).map(|(s, n)| (s / n).min(1.0)).collect();
            let change = new.iter().zip(&squares).map(|(a, b)| libm::log(a / b).abs()).fold(0.0, f64::max);
            squares = new;
            if change < SIZE_SETTLED {
                break;
            }
        }
        let mut at = 0..;
        let scaled = |c: &Candidate| {
            let scales = c.scales.iter().zip(&mut at);
            scales.map(|(s, k)| s * square(&squares, k).sqrt()).collect()
        };
        Some(candidates[..curves].iter().map(scaled).collect())
    }
}
