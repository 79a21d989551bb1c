//! How probable a name is: by what it predicts of poses that it was not learnt on, beside everything else that could be said there, and by
//! whether it says the same on parts of the data that have nothing in common.
//!
//! *Shares.* The finding, its rivals, what has no name at its place and nothing at all are each put in its place in the joint fit, and
//! predict blocks of poses that the fit did not see. The sum of their log scores over the blocks, with the blocks drawn again by the
//! Bayesian bootstrap (Rubin 1981), makes weights: pseudo-BMA+ (Yao, Vehtari, Simpson & Gelman 2018). What only the noise model or a
//! misspecified background prefers varies from block to block, and is not preferred after the draw.
//!
//! *Replication.* Coefficients estimated on disjoint parts of the poses are compared: each part with what the others say together, in the
//! metric of its covariance. With nothing there the statistic is standard normal.
//!
//! *Recalibration.* Both go into one logistic curve whose coefficients were learnt on drawn cases and on real recordings with known
//! additions (`proof/`), never on the case at hand.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::linear::Apart;
use crate::settings::{AGREES_SIGMAS, BOOTSTRAP_DRAWS, LARGEST_CONFIDENCE, RECALIBRATION};

/// What could stand in the place of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Says {
    /// The finding's own effect at its place.
    Same,
    /// Another effect of its family at its place.
    Family,
    /// Something else at its place, with a name or without.
    Place,
    /// Something elsewhere.
    Elsewhere,
    /// Nothing.
    Nothing,
}

/// An alternative: what it says, logarithm of its prior, and its log score for every block.
pub struct Alternative {
    /// What it says.
    pub says: Says,
    /// Logarithm of its prior.
    pub log_prior: f64,
    /// Log score of each block.
    pub scores: Vec<f64>,
}

/// Probabilities of place, of place and family, of place and effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shares {
    /// Something is wrong at this place.
    pub place: f64,
    /// And it is of this family.
    pub family: f64,
    /// And it is this effect.
    pub effect: f64,
}

/// Shares of the alternatives by pseudo-BMA+ over blocks.
#[must_use]
pub fn shares(alternatives: &[Alternative]) -> Shares {
    let blocks = alternatives.first().map_or(0, |a| a.scores.len());
    let mut rng = Pcg64Mcg::seed_from_u64(20_261_122);
    let mut mean = vec![0.0; alternatives.len()];
    for _ in 0..BOOTSTRAP_DRAWS {
        // Dirichlet(1, ..., 1) by exponentials
        let mut weights: Vec<f64> = (0..blocks).map(|_| -rng.random_range(f64::MIN_POSITIVE..1.0).ln()).collect();
        let sum: f64 = weights.iter().sum();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let factor = blocks as f64 / sum.max(f64::MIN_POSITIVE);
        weights.iter_mut().for_each(|w| *w *= factor);
        let score = |a: &Alternative| a.log_prior + weights.iter().zip(&a.scores).map(|(w, s)| w * s).sum::<f64>();
        let scores: Vec<f64> = alternatives.iter().map(score).collect();
        let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = scores.iter().map(|s| (s - most).exp()).collect();
        let total: f64 = shares.iter().sum();
        for (m, s) in mean.iter_mut().zip(shares) {
            *m += s / total;
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let draws = BOOTSTRAP_DRAWS as f64;
    let of = |says: &[Says]| -> f64 {
        alternatives.iter().zip(&mean).filter(|(a, _)| says.contains(&a.says)).map(|(_, m)| m / draws).sum()
    };
    Shares {
        place: of(&[Says::Same, Says::Family, Says::Place]),
        family: of(&[Says::Same, Says::Family]),
        effect: of(&[Says::Same]),
    }
}

/// How well parts agree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Replication {
    /// Parts that determine the coefficients.
    pub parts: usize,
    /// Those of them that say the same as the others together: sign, and size to within what the part can tell.
    pub agree: usize,
    /// Sum over the parts of their standard normal statistics, over the root of their number.
    pub z: f64,
}

/// Compares coefficients from disjoint parts; `variance` is that of a row.
#[must_use]
pub fn replication(parts: &[Apart], variance: f64) -> Replication {
    let k = parts.first().map_or(0, |p| p.value.len());
    let mut out = Replication { parts: parts.len(), ..Replication::default() };
    if parts.len() < 2 || k == 0 {
        return Replication::default();
    }
    // precision of each part, and precision times coefficients
    let mut weights: Vec<(Mat<f64>, Mat<f64>)> = Vec::with_capacity(parts.len());
    for p in parts {
        let Ok(factor) = p.covariance.llt(Side::Lower) else { return Replication::default() };
        let precision = factor.solve(&Mat::<f64>::identity(k, k));
        let value = Mat::from_fn(k, 1, |i, _| p.value[i]);
        let push = &precision * &value;
        weights.push((precision, push));
    }
    for (own, (precision, push)) in weights.iter().enumerate() {
        let (mut all, mut pushes) = (Mat::<f64>::zeros(k, k), Mat::<f64>::zeros(k, 1));
        for (_, (p, b)) in weights.iter().enumerate().filter(|(i, _)| *i != own) {
            all += p;
            pushes += b;
        }
        let Ok(factor) = all.llt(Side::Lower) else { return Replication::default() };
        let others = factor.solve(&pushes);
        let along = |m: &Mat<f64>| (0..k).map(|i| others[(i, 0)] * m[(i, 0)]).sum::<f64>();
        // length of what the others say in this part's metric, and of this part along it
        let square = along(&(precision * &others));
        let length = square.sqrt().max(1e-300);
        let t = along(push) / (length * variance.sqrt());
        // size of this part beside the others', and how well the two know it
        let ratio = along(push) / square.max(1e-300);
        let of_others = along(&(&all * &others)).max(1e-300);
        let sd = (variance * (1.0 / square.max(1e-300) + 1.0 / of_others)).sqrt();
        out.z += t;
        if t > AGREES_SIGMAS && ((ratio - 1.0).abs() < 3.0 * sd || (ratio - 1.0).abs() < 0.5) {
            out.agree += 1;
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    {
        out.z /= (parts.len() as f64).sqrt();
    }
    out
}

fn logit(p: f64) -> f64 {
    let p = p.clamp(1e-4, 1.0 - 1e-4);
    (p / (1.0 - p)).ln()
}

/// A probability from a share and how well parts agree.
#[must_use]
pub fn recalibrated(share: f64, replication: &Replication, curve: &[f64; 3]) -> f64 {
    let [constant, by_share, by_replication] = curve;
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let agree = if replication.parts == 0 { 0.5 } else { replication.agree as f64 / replication.parts as f64 };
    let x = constant + by_share * logit(share) + by_replication * agree;
    (1.0 / (1.0 + (-x).exp())).min(LARGEST_CONFIDENCE)
}

/// All three, none larger than the one before it.
#[must_use]
pub fn probabilities(shares: &Shares, replication: &Replication) -> Shares {
    let place = recalibrated(shares.place, replication, &RECALIBRATION[0]);
    let family = recalibrated(shares.family, replication, &RECALIBRATION[1]).min(place);
    let effect = recalibrated(shares.effect, replication, &RECALIBRATION[2]).min(family);
    Shares { place, family, effect }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alternative(says: Says, scores: Vec<f64>) -> Alternative {
        Alternative { says, log_prior: 0.0, scores }
    }

    #[test]
    fn a_name_that_predicts_every_block_better_takes_all() {
        let s = shares(&[
            alternative(Says::Same, vec![1.0; 30]),
            alternative(Says::Place, vec![0.0; 30]),
            alternative(Says::Nothing, vec![-1.0; 30]),
        ]);
        assert!(s.effect > 0.999, "{s:?}");
    }

    #[test]
    fn what_one_block_alone_prefers_is_not_sure() {
        let mut one = vec![0.0; 30];
        one[3] = 8.0;
        let s = shares(&[alternative(Says::Same, one), alternative(Says::Place, vec![0.0; 30])]);
        // the evidence of the sum would say exp(8); without that block there is none
        assert!(s.effect > 0.6 && s.effect < 0.98, "{s:?}");
        assert!((s.place - 1.0).abs() < 1e-9);
    }

    fn part(value: f64, sd: f64) -> Apart {
        Apart { value: vec![value], covariance: Mat::from_fn(1, 1, |_, _| sd * sd) }
    }

    #[test]
    fn parts_that_say_the_same_agree_and_those_that_do_not_do_not() {
        let same = replication(&[part(1.0, 0.1), part(1.1, 0.1), part(0.9, 0.1)], 1.0);
        assert_eq!((same.parts, same.agree), (3, 3));
        assert!(same.z > 10.0);
        let other = replication(&[part(1.0, 0.1), part(-1.0, 0.1), part(0.05, 0.1)], 1.0);
        assert_eq!(other.agree, 0);
        // noise alone: the statistic is small
        let noise = replication(&[part(0.1, 0.1), part(-0.05, 0.1), part(0.02, 0.1)], 1.0);
        assert!(noise.z.abs() < 2.0 && noise.agree == 0, "{noise:?}");
    }

    #[test]
    fn probabilities_fall_from_place_to_effect() {
        let r = Replication { parts: 4, agree: 4, z: 9.0 };
        let p = probabilities(&Shares { place: 0.9, family: 0.95, effect: 0.99 }, &r);
        assert!(p.place >= p.family && p.family >= p.effect);
    }
}
