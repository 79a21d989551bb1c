//! How much the noise of measurements that follow each other remembers itself.

use trical_model::Forward;

use crate::dataset::Dataset;
use crate::error::Result;
use crate::fit::weighted_residuals;
use crate::identify::Identified;

/// Correlation of the residuals of measurements that follow each other, as far as it is more than chance.
pub(super) fn memory(fitted: &Identified, data: &Dataset) -> Result<f64> {
    let forward = Forward::new(fitted.model.clone(), Vec::new())?;
    let residuals = weighted_residuals(&forward, data, &fitted.noise);
    let values = |k: usize| &residuals[k].0[..residuals[k].1];
    let follow = |k: &usize| {
        let [a, b] = [&data.observations[k - 1], &data.observations[*k]];
        a.recording == b.recording && a.pose != b.pose && values(k - 1).len() == values(*k).len()
    };
    Ok(correlation((1..residuals.len()).filter(follow).map(|k| [values(k - 1), values(k)])))
}

/// Of pairs of residuals, the one after the other.
#[expect(clippy::cast_precision_loss, reason = "counts")]
fn correlation<'a>(pairs: impl Iterator<Item = [&'a [f64]; 2]>) -> f64 {
    let (mut product, mut square, mut n) = (0.0, 0.0, 0.0_f64);
    for [a, b] in pairs {
        product += a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        square += 0.5 * a.iter().chain(b).map(|v| v * v).sum::<f64>();
        n += a.len() as f64;
    }
    let chance = 2.0 / n.max(1.0).sqrt();
    let correlation = product / square.max(1e-300);
    if correlation > chance { correlation.min(0.95) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::correlation;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Of 600 residuals that keep `m` of the one before.
    fn told(m: f64) -> f64 {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        let mut noise = [0.0; 3];
        let mut next = |_| {
            noise = noise.map(|v| m * v + (1.0 - m * m).sqrt() * rng.random_range(-1.7..1.7));
            noise
        };
        let sequence: Vec<[f64; 3]> = (0..600).map(&mut next).collect();
        correlation(sequence.windows(2).map(|w| [&w[0][..], &w[1][..]]))
    }

    #[test]
    fn noise_that_remembers_itself_is_told_from_noise_that_does_not() {
        assert!(told(0.0) == 0.0 && (told(0.5) - 0.5).abs() < 0.08, "{} {}", told(0.0), told(0.5));
    }
}
