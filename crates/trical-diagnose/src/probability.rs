//! How probable a name is: by what it predicts of poses that it was not learnt on, beside everything else that could be said there, and by
//! whether it says the same on parts of the data that have nothing in common.
//!
//! *Shares.* The finding, its rivals, what has no name at its place and nothing at all are each put in its place in the joint fit, and
//! predict blocks of poses that the fit did not see. The sum of their log scores over the blocks, with the blocks drawn again by the
//! Bayesian bootstrap (Rubin 1981), makes weights: pseudo-BMA+ (Yao, Vehtari, Simpson & Gelman 2018). What only the noise model or a
//! misspecified background prefers varies from block to block, and is not preferred after the draw.
//!
//! *Replication.* Halves of the poses are searched by themselves (`halves`): a name that was chosen because of how the whole recording
//! happened to be searched is not found in them.
//!
//! *Twins.* What two places explain alike has the probability that one of the two would have, divided among them.
//!
//! *Recalibration.* Both, with how much of the error the finding takes, go into one logistic curve whose coefficients were learnt on drawn
//! cases and on real recordings with known additions (`proof/`), never on the case at hand.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use crate::settings::{BOOTSTRAP_DRAWS, LARGEST_ALONE, LARGEST_CONFIDENCE, RECALIBRATION, TWIN_NATS};

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
    /// The part of all three that belongs to other places, which the data cannot tell from this one.
    pub twins: f64,
}

/// Shares of the alternatives by pseudo-BMA+ over blocks.
#[must_use]
pub fn shares(alternatives: &[Alternative]) -> Shares {
    let blocks = alternatives.first().map_or(0, |a| a.scores.len());
    let mut rng = Pcg64Mcg::seed_from_u64(20_261_122);
    let mut mean = vec![0.0; alternatives.len()];
    for _ in 0..BOOTSTRAP_DRAWS {
        // Dirichlet(1, ..., 1) by exponentials
        let mut weights: Vec<f64> = (0..blocks).map(|_| -libm::log(rng.random_range(f64::MIN_POSITIVE..1.0))).collect();
        let sum: f64 = weights.iter().sum();
        let factor = blocks as f64 / sum.max(f64::MIN_POSITIVE);
        weights.iter_mut().for_each(|w| *w *= factor);
        let score = |a: &Alternative| a.log_prior + weights.iter().zip(&a.scores).map(|(w, s)| w * s).sum::<f64>();
        let scores: Vec<f64> = alternatives.iter().map(score).collect();
        let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = scores.iter().map(|s| libm::exp(s - most)).collect();
        let total: f64 = shares.iter().sum();
        for (m, s) in mean.iter_mut().zip(shares) {
            *m += s / total;
        }
    }
    let draws = BOOTSTRAP_DRAWS as f64;
    let of = |said: &dyn Fn(&Alternative) -> bool| -> f64 {
        alternatives.iter().zip(&mean).filter(|(a, _)| said(a)).map(|(_, m)| m / draws).sum()
    };
    let is_twin = |a: &Alternative| alternatives.first().is_some_and(|finding| is_twin(a, finding));
    let twins = of(&is_twin);
    let with_twins = |says: &[Says]| of(&|a| says.contains(&a.says)) + twins;
    Shares {
        place: with_twins(&[Says::Same, Says::Family, Says::Place]),
        family: with_twins(&[Says::Same, Says::Family]),
        effect: with_twins(&[Says::Same]),
        twins: if twins > 0.0 { twins / with_twins(&[Says::Same]) } else { 0.0 },
    }
}

/// Whether an alternative elsewhere predicts what the finding predicts: halves, which take one of the two by chance, do not tell them
/// apart either.
fn is_twin(a: &Alternative, finding: &Alternative) -> bool {
    let sum = |a: &Alternative| a.log_prior + a.scores.iter().sum::<f64>();
    a.says == Says::Elsewhere && (sum(a) - sum(finding)).abs() < TWIN_NATS
}

/// What halves of the data say, each searched by itself: none where there are few rows beside the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Replicated {
    /// Halves that were searched.
    pub parts: usize,
    /// Those that name the same effect at the same place, with the same sign.
    pub agree: usize,
    /// Those that name its family at the place.
    pub family: usize,
    /// Those that find something at the place, with a name or without.
    pub place: usize,
}

/// Smaller shares are all the same, and so are larger ones than one less this.
const LEAST_SHARE: f64 = 0.01;

fn logit(p: f64) -> f64 {
    let p = p.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
    libm::log(p / (1.0 - p))
}

/// A probability from the share `evidence` of the alternatives; where halves were searched, also from how many of them found the same, and from
/// the number of `findings`: what halves do not find is the less probable the more findings there are, since what the models of many effects
/// leave looks like further ones.
#[must_use]
pub fn recalibrated(evidence: f64, (found, halves): (usize, usize), findings: usize, curve: &[f64; 5]) -> f64 {
    let [constant, by_evidence, by_found, by_findings, by_evidence_alone] = curve;
    let (found, halves, findings) = (found as f64, halves as f64, findings.max(1) as f64);
    let x = if halves > 0.0 {
        let of_found = libm::log((found + 0.5) / (halves - found + 0.5));
        let among_many = libm::log(findings) * (1.0 - found / halves);
        by_evidence * logit(evidence) + by_found * of_found + by_findings * among_many
    } else {
        by_evidence_alone * logit(evidence)
    };
    (1.0 / (1.0 + libm::exp(-(constant + x)))).min(LARGEST_CONFIDENCE)
}

/// All three, none larger than the one before it; `findings` is how many the recording has.
#[must_use]
pub fn probabilities(shares: &Shares, found: &Replicated, findings: usize) -> Shares {
    let of =
        |evidence, some, curve| (1.0 - shares.twins) * recalibrated(evidence, (some, found.parts), findings, curve);
    let place = of(shares.place, found.place, &RECALIBRATION[0]);
    let family = of(shares.family, found.family, &RECALIBRATION[1]).min(place);
    let most = if found.parts == 0 { LARGEST_ALONE } else { 1.0 };
    let effect = of(shares.effect, found.agree, &RECALIBRATION[2]).min(family).min(most);
    Shares { place, family, effect, ..*shares }
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

    #[test]
    fn places_that_say_the_same_have_the_probability_of_one_divided_among_them() {
        let r = Replicated { parts: 8, agree: 8, family: 8, place: 8 };
        let of = |elsewhere: &[f64]| {
            let others = elsewhere.iter().map(|s| alternative(Says::Elsewhere, vec![*s; 30]));
            let nothing = [alternative(Says::Same, vec![1.0; 30]), alternative(Says::Nothing, vec![-1.0; 30])];
            probabilities(&shares(&nothing.into_iter().chain(others).collect::<Vec<_>>()), &r, 3).effect
        };
        let one = of(&[]);
        assert!((of(&[1.0, 1.0]) - one / 3.0).abs() < 1e-3 && one > 0.9, "{one} {}", of(&[1.0, 1.0]));
        // and so have those that nearly say the same
        assert!((0.5 * one..0.65 * one).contains(&of(&[0.99])), "{}", of(&[0.99]));
        // of one that predicts worse the halves tell it
        assert!((of(&[0.9]) - one).abs() < 0.05, "{}", of(&[0.9]));
    }

    #[test]
    fn probabilities_fall_from_place_to_effect() {
        let r = Replicated { parts: 8, agree: 8, family: 8, place: 8 };
        let p = probabilities(&Shares { place: 0.9, family: 0.95, effect: 0.99, twins: 0.0 }, &r, 3);
        assert!(p.place >= p.family && p.family >= p.effect);
    }

    #[test]
    fn what_halves_do_not_find_is_less_probable_and_the_less_the_more_there_is() {
        let shares = Shares { place: 0.95, family: 0.95, effect: 0.95, twins: 0.0 };
        let of = |agree, findings| {
            probabilities(&shares, &Replicated { parts: 8, agree, family: 8, place: 8 }, findings).effect
        };
        assert!(of(8, 5) > of(4, 5) && of(4, 5) > of(0, 5));
        assert!(of(0, 1) > of(0, 20));
        // what every half finds is believed among many too
        assert_eq!(of(8, 1), of(8, 20));
        // and what none finds is no fact, below one half
        assert!(of(8, 20) > 0.9 && of(0, 20) < 0.5, "{} {}", of(8, 20), of(0, 20));
        // where no halves were searched the shares count for more
        let alone = |effect| probabilities(&Shares { effect, ..shares }, &Replicated::default(), 5).effect;
        assert!(alone(0.95) > of(4, 5) && alone(0.05) < 0.2, "{} {}", alone(0.95), alone(0.05));
        // but no name is surer than one that every half finds
        let sure = Shares { place: 1.0, family: 1.0, effect: 1.0, twins: 0.0 };
        let p = probabilities(&sure, &Replicated::default(), 1);
        assert!(p.effect == LARGEST_ALONE && p.family > p.effect, "{p:?}");
    }
}
