//! The joint fit of everything that was chosen, in parts: what the fit to the others says of each, in errors and in log scores of blocks of
//! neighbouring poses.

use trical_ident::fit::folds::{FOLDS, Folds};
use trical_ident::fit::identify::ErrorSummary;

use crate::candidate::Candidate;
use crate::effect_id::Cause;
use crate::findings::Group;
use crate::linear::{Design, Foreseen, Partition, Predictive};
use crate::settings::{HARMS_ERRORS, LAST_PERCENT, PAYS_ERRORS, UNNAMED_PRICE_NATS};

/// Log score of each block where the fit fails: as bad as can be.
const FAILED: f64 = -1e6;

/// The joint fit of a set of candidates in parts.
pub(crate) struct Parts<'a> {
    partition: Partition<'a>,
    predictive: Predictive,
    /// The only part that is scored, if not all are.
    scored: Option<usize>,
    blocks: usize,
    temper: f64,
}

impl<'a> Parts<'a> {
    /// Four parts that cut no block.
    pub(crate) fn by_block(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let fold_of_block = folds.fold_of_blocks(FOLDS);
        let part_of = |pose: usize| fold_of_block.get(folds.block_of(pose)).copied().unwrap_or(0);
        Self::new(design, set, folds, temper, (FOLDS, None, &part_of))
    }

    /// Four parts, every fourth pose in each.
    pub(crate) fn by_pose(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let part_of = |pose: usize| folds.poses().binary_search(&pose).unwrap_or(0) % FOLDS;
        Self::new(design, set, folds, temper, (FOLDS, None, &part_of))
    }

    /// The last quarter of each session's poses, by those before.
    pub(crate) fn forward(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let split = folds.forward(LAST_PERCENT)?;
        Self::new(design, set, folds, temper, (2, Some(0), &|pose| usize::from(!split(pose))))
    }

    fn new(
        design: &'a Design,
        set: &[usize],
        folds: &Folds,
        temper: f64,
        (count, scored, part_of): (usize, Option<usize>, &dyn Fn(usize) -> usize),
    ) -> Option<Self> {
        let partition = Partition::new(design, set, count, part_of)?;
        let is_scored = |pose: usize| scored.is_none_or(|part| part_of(pose) % count == part);
        let block_of = |pose: usize| is_scored(pose).then(|| folds.block_of(pose));
        let predictive = partition.predictive(folds.blocks(), &block_of)?;
        predictive.of_blocks(&partition, &[], &[None]).remove(0)?;
        Some(Self { partition, predictive, scored, blocks: folds.blocks(), temper })
    }

    /// Log score of each block without the candidates `out`, once with each of `adds` in their place; the noise is what is left of all of them,
    /// so that a set that foresees badly does not set its own measure. A fit that fails predicts nothing.
    pub(crate) fn scores(&self, out: &[usize], adds: &[Option<usize>]) -> Vec<Vec<f64>> {
        self.predictive.of_blocks(&self.partition, out, adds).into_iter().map(|blocks| self.scores_of(blocks)).collect()
    }

    fn scores_of(&self, blocks: Option<Vec<Foreseen>>) -> Vec<f64> {
        let Some(blocks) = blocks else { return vec![FAILED; self.blocks] };
        let (rows, squares) = blocks.iter().fold((0.0, 0.0), |(n, sum), b| (n + b.rows, sum + b.square));
        let variance: f64 = squares / rows;
        let score =
            |b: &Foreseen| -0.5 * self.temper * (b.square / variance + b.rows * libm::log(variance) + b.log_covariance);
        blocks.iter().map(|b| if b.rows > 0.0 { score(b) } else { 0.0 }).collect()
    }

    /// Position errors without the candidates `out` and with `add` in their place, each by the fit to the other parts.
    pub(crate) fn errors(&self, out: &[usize], add: Option<usize>) -> ErrorSummary {
        ErrorSummary::of(&self.partition.position_errors(&self.partition.instead(out, add), self.scored))
    }
}

/// Members of the groups that do not better the log scores of what `proofs` did not see beside those that stay, by more than chance, or harm
/// those of one proof by more than chance: what each block gains is one draw of the gain, and their scatter says how well the sum is known
/// (Vehtari, Gelman & Gabry 2017). Errors at the blocks of the first proof have to fall, too. What has no name has to gain its price besides, so
/// that of two that say the same the name stays. A group that is worth no more than one of those that `instead` has for it goes as well. Groups
/// and `instead` are indices into `candidates`, which are those of the design.
pub(crate) fn what_does_not_pay(
    proofs: &[Parts<'_>],
    candidates: &[Candidate],
    mut groups: Vec<Group>,
    instead: &dyn Fn(&Group) -> Vec<usize>,
) -> Vec<usize> {
    // once for each of `adds`, of each proof
    let scores = |out: &[usize], adds: &[Option<usize>]| -> Vec<Vec<Vec<f64>>> {
        let of_proofs: Vec<Vec<Vec<f64>>> = proofs.iter().map(|p| p.scores(out, adds)).collect();
        (0..adds.len()).map(|k| of_proofs.iter().map(|of| of[k].clone()).collect()).collect()
    };
    let mut out: Vec<usize> = Vec::new();
    let mut now = scores(&out, &[None]).remove(0);
    let errors = |out: &[usize]| proofs.first().map(|p| p.errors(out, None));
    while !groups.is_empty() {
        let with = errors(&out);
        let pays = |g: &Group| {
            let without = [&out[..], &g.members[..]].concat();
            let adds: Vec<Option<usize>> = std::iter::once(None).chain(instead(g).into_iter().map(Some)).collect();
            let gains: Vec<f64> = scores(&without, &adds).iter().map(|other| surely(&now, other)).collect();
            let nameless = candidates[g.members[0]].cause == Cause::Unexplained;
            let price = if nameless { UNNAMED_PRICE_NATS } else { 0.0 };
            let pays = gains[1..].iter().copied().fold(gains[0] - price, f64::min);
            unless_errors_rise(pays, errors(&without), with)
        };
        let worst = groups.iter().map(pays).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((worst, _)) = worst.filter(|(_, least)| *least <= 0.0) else { break };
        out.extend(groups.swap_remove(worst).members);
        now = scores(&out, &[None]).remove(0);
    }
    out
}

/// A gain in log scores, none where the errors themselves do not fall: a density that is wide where it is wrong loses little. They fall if
/// their mean falls by a larger factor than their root mean square rises.
fn unless_errors_rise(gain: f64, without: Option<ErrorSummary>, with: Option<ErrorSummary>) -> f64 {
    let size = |e: Option<ErrorSummary>| e.map_or(0.0, error_size);
    if size(with) < size(without) { gain } else { gain.min(0.0) }
}

/// How large errors are, by their mean and by their root mean square, mm^2.
pub(crate) fn error_size(e: ErrorSummary) -> f64 {
    e.mean_mm * e.rms_mm
}

/// By how much the log scores of the blocks of all proofs are better than others, less what may be chance; negative where one of the proofs
/// says that they are worse, by more than chance.
fn surely(better: &[Vec<f64>], than: &[Vec<f64>]) -> f64 {
    let gains = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
    let gains: Vec<Vec<f64>> = better.iter().zip(than).map(gains).collect();
    let sum = |gains: &[f64]| gains.iter().sum::<f64>();
    let error = |gains: &[f64]| gains.iter().map(|g| g * g).sum::<f64>().sqrt();
    let all = gains.concat();
    let worst = gains.iter().map(|own| sum(own) + HARMS_ERRORS * error(own)).fold(f64::INFINITY, f64::min);
    let pays = sum(&all) - PAYS_ERRORS * error(&all);
    if worst < 0.0 { pays.min(worst) } else { pays }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use trical_ident::{Choice, Dataset, ParameterSet, identify};
    use trical_model::{Basis, Place, Shape, Site, Term, Variable};

    use crate::covariates::Covariates;
    use crate::effect_id::EffectId;
    use crate::findings::grouped;
    use crate::locators::locators;
    use crate::test_data::with_joint_2;

    /// What does not pay of the candidates that `set` makes for an arm with a hidden error of joint 2, each alone in its group but for those
    /// from `groups` on, which are what could stand instead.
    fn not_paying(
        hidden: Shape,
        size: f64,
        set: &dyn Fn(&Covariates<'_>, &Dataset) -> Vec<Candidate>,
        groups: usize,
    ) -> Vec<usize> {
        let (truth, data) = with_joint_2(&[(Basis::new(Variable::Joint { joint: 2 }, hidden), size)]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let candidates = set(&Covariates::new(&fitted.model, &data, 1e-5), &data);
        let design = Design::new(&fitted.model, &candidates, &data, &fitted.noise).unwrap();
        let all: Vec<usize> = (0..groups).collect();
        let parts = Parts::by_block(&design, &all, &Folds::of(&data), 1.0).unwrap();
        let instead: Vec<usize> = (groups..candidates.len()).collect();
        what_does_not_pay(&[parts], &candidates, grouped(&candidates[..groups], &all), &|_| instead.clone())
    }

    fn of_joint_2(effect: EffectId, r: &Covariates<'_>) -> Vec<Candidate> {
        let asked = (effect.effect().ask)(r).candidates;
        asked.into_iter().filter(|c| c.site == Place::Joint(2)).collect()
    }

    #[test]
    fn a_curve_of_many_waves_does_not_pay_where_one_of_them_says_it_all() {
        let curve_and_waves = |r: &Covariates<'_>, _: &Dataset| {
            [of_joint_2(EffectId::EncoderError, r), of_joint_2(EffectId::JointHarmonic, r)].concat()
        };
        assert_eq!(not_paying(Shape::Sine { cycles: 5.0 }, 5e-4, &curve_and_waves, 1), [0]);
        // one wave alone is no rival of a curve with waves that are not of the joint's first ones
        assert!(not_paying(Shape::Sine { cycles: 9.0 }, 5e-4, &curve_and_waves, 1).is_empty());
    }

    #[test]
    fn of_a_name_and_a_curve_that_say_the_same_the_name_stays() {
        let ratio_and_curve = |r: &Covariates<'_>, data: &Dataset| {
            let mut both = of_joint_2(EffectId::GearRatio, r);
            let curves = locators(r.model, data);
            let own = |c: &&Candidate| c.site == Place::Joint(2) && c.curve() == Some(Variable::Joint { joint: 2 });
            both.extend(curves.iter().find(own).cloned());
            both
        };
        assert_eq!(not_paying(Shape::Linear, 5e-4, &ratio_and_curve, 2), [1]);
    }

    /// What harms the last quarter of a recording, of a drift with the order of the rows that was fitted to all of it; joint 2 is off by
    /// `hidden` of that order (0 to 199).
    fn harming(hidden: Shape, size: f64) -> Vec<usize> {
        let order = |shape| Basis::new(Variable::Seq, shape);
        let (truth, data) = with_joint_2(&[(order(hidden), size)]);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let drift = Candidate {
            cause: Cause::Unexplained,
            site: Place::Joint(2),
            behaviour: "drift".into(),
            terms: vec![Term::new("drift", "drift", Site::Joint { joint: 2 }, order(Shape::Linear))],
            signs: vec![0],
            physical: crate::candidate::Physical::default(),
            typical: 0.0,
            scales: vec![1e-4],
            log_prior: 0.0,
        };
        let candidates = [drift];
        let design = Design::new(&fitted.model, &candidates, &data, &fitted.noise).unwrap();
        let folds = Folds::of(&data);
        let by_block = Parts::by_block(&design, &[0], &folds, 1.0).unwrap();
        let forward = Parts::forward(&design, &[0], &folds, 1.0).unwrap();
        what_does_not_pay(&[by_block, forward], &candidates, grouped(&candidates, &[0]), &|_| Vec::new())
    }

    #[test]
    fn what_gains_in_log_scores_pays_where_the_mean_error_falls_by_more_than_a_few_far_poses_raise_the_rms() {
        let errors = |mean_mm, rms_mm| Some(ErrorSummary { mean_mm, rms_mm, ..ErrorSummary::of(&[1e-3]) });
        let pays = |gain: f64, mean, rms| unless_errors_rise(gain, errors(1.0, 1.0), errors(mean, rms));
        assert_eq!([pays(5.0, 0.9, 0.95), pays(5.0, 0.9, 1.05), pays(5.0, 1.05, 0.9)], [5.0; 3]);
        assert_eq!([pays(5.0, 0.95, 1.1), pays(5.0, 1.0, 1.0), pays(5.0, 1.1, 0.95)], [0.0; 3]);
        assert_eq!(pays(-3.0, 1.1, 1.1), -3.0);
    }

    #[test]
    fn a_gain_over_all_blocks_does_not_make_up_for_a_sure_loss_in_one_of_the_proofs() {
        let gains = |first: &[f64], second: &[f64]| {
            let nothing = [vec![0.0; first.len()], vec![0.0; second.len()]];
            surely(&[first.to_vec(), second.to_vec()], &nothing)
        };
        assert!((gains(&[5.0; 20], &[1.0; 4]) - (104.0 - 504.0_f64.sqrt())).abs() < 1e-9);
        assert!((gains(&[5.0; 20], &[-1.0; 16]) + 8.0).abs() < 1e-9, "16 less what may be chance, twice 4");
        assert!(gains(&[5.0; 20], &[-3.0, -2.0, -1.0, 1.0]) > 0.0, "a loss of 5 known to 4 is none");
    }

    #[test]
    fn a_drift_that_turns_back_harms_what_comes_later_and_one_that_goes_on_does_not() {
        assert_eq!(harming(Shape::Tent { left: 0.0, centre: 150.0, right: 200.0 }, 1e-3), [0]);
        assert!(harming(Shape::Linear, 5e-6).is_empty());
    }
}
