//! What halves of the data say when each is searched by itself, from nothing: a name that only the whole recording finds, because of how
//! its effects happened to be chosen one beside the other, is not found again in halves (stability selection, Meinshausen & Buehlmann
//! 2010, in the complementary halves of Shah & Samworth 2013). Halves cut no block of poses.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::folds::Folds;
use trical_ident::fit::noise::Noise;
use trical_model::Term;

use crate::candidate::{Candidate, said_by};
use crate::correlated_noise::CorrelatedNoise;
use crate::linear::{Design, Fitted};
use crate::probability::Replicated;
use crate::selection::Search;
use crate::settings::{HALF_ROWS, HALVED, TRIED_WITH_CURVES};

/// What was found in each half: effects with their coefficients.
pub(crate) struct Halves(Vec<Vec<Candidate>>);

impl Halves {
    /// Searches halves of `data` among `candidates`, beside what is fitted of the baseline.
    /// None are searched where a half has few rows beside the parameters.
    pub(crate) fn search(
        fitted: Fitted<'_>,
        candidates: &[Candidate],
        data: &Dataset,
        noise: &Noise,
        temper: f64,
    ) -> Result<Self> {
        let folds = Folds::of(data);
        let mut sizes = vec![0; folds.blocks()];
        folds.poses().iter().for_each(|pose| sizes[folds.block_of(*pose)] += 1);
        let one = |half: &Vec<bool>| {
            let part = data.filtered(|o| half[folds.block_of(o.pose)]);
            if part.scalars() < fitted.parameters {
                return Ok(None);
            }
            let design = Design::weighted(fitted, candidates, &[], &part, noise, CorrelatedNoise::WHITE)?;
            if (design.rows as f64) < HALF_ROWS * design.parameters {
                return Ok(None);
            }
            let search = Search::new(&design, candidates, temper);
            let start = design.start();
            // as in the search of all rows: long curves first, and then what is lean beside them
            let mut chosen = search.first(&start, &[], TRIED_WITH_CURVES);
            chosen.retain(|c| candidates[*c].is_long_curve());
            let beside = design.absorbing(&search.with(&start, &chosen));
            let curves: Vec<&Candidate> = chosen.iter().map(|c| &candidates[*c]).collect();
            let said = said_by(&curves, candidates);
            let leaner =
                Search::new(&beside, candidates, temper).without_candidates(&said).choose(&beside.start(), &[]);
            chosen.extend(leaner);
            let found = search.each_beside_others(&start, &chosen).into_iter().map(|(own, coefficients)| {
                let mut c = candidates[own].clone();
                c.terms.iter_mut().zip(coefficients).for_each(|(t, v)| t.value = v);
                c
            });
            Ok(Some(found.collect()))
        };
        let all: Vec<Option<Vec<Candidate>>> = halves(&sizes).par_iter().map(one).collect::<Result<_>>()?;
        Ok(Self(all.into_iter().flatten().collect()))
    }

    /// In how many halves the effect of `members`, one finding's, was found; `fitted` has their coefficients in the joint fit.
    pub(crate) fn found(&self, members: &[&Candidate], fitted: &[Term]) -> Replicated {
        let mut out = Replicated { parts: self.0.len(), ..Replicated::default() };
        let Some(first) = members.first() else { return out };
        let family = |c: &Candidate| c.cause.effect().map(|id| id.effect().family);
        let same_sign = |c: &Candidate| {
            let product = |t: &Term| fitted.iter().find(|m| m.does_as(t)).map(|m| m.value * t.value);
            c.terms.iter().filter_map(product).sum::<f64>() >= 0.0
        };
        for half in &self.0 {
            let here: Vec<&Candidate> =
                half.iter().filter(|c| c.site == first.site || c.site.is_same_part(first.site)).collect();
            out.place += usize::from(!here.is_empty());
            out.family += usize::from(here.iter().any(|c| family(c) == family(first)));
            out.agree += usize::from(here.iter().any(|c| c.is_alike(first) && same_sign(c)));
        }
        out
    }
}

/// Which blocks of so many poses are in each half: two halves of each draw, with as many poses each as blocks allow.
fn halves(sizes: &[usize]) -> Vec<Vec<bool>> {
    let mut rng = Pcg64Mcg::seed_from_u64(20_261_122);
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    (0..HALVED)
        .flat_map(|_| {
            order.shuffle(&mut rng);
            let mut half = vec![false; sizes.len()];
            let mut filled = [0, 0];
            for block in &order {
                let first = filled[0] <= filled[1];
                half[*block] = first;
                filled[usize::from(!first)] += sizes[*block];
            }
            let other = half.iter().map(|h| !h).collect();
            [half, other]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_ident::{Choice, ParameterSet, identify};
    use trical_model::{Basis, Place, Site};

    use super::*;
    use crate::candidate::Physical;
    use crate::effect_id::{Cause, EffectId};
    use crate::test_data::with_joint_2;

    fn candidate(cause: Cause, joint: usize, value: f64) -> Candidate {
        let mut term = Term::new(format!("of_{joint}"), cause.name(), Site::Joint { joint }, Basis::CONSTANT);
        term.value = value;
        Candidate {
            cause,
            site: Place::Joint(joint),
            behaviour: String::new(),
            terms: vec![term],
            signs: vec![0],
            physical: Physical::default(),
            typical: 0.0,
            scales: vec![1.0],
            log_prior: 0.0,
        }
    }

    #[test]
    fn what_a_half_says_counts_for_place_family_and_effect_by_itself() {
        let gap = Cause::Effect(EffectId::LostMotionDirection);
        let own = candidate(gap, 3, 0.5);
        let found = Halves(vec![
            vec![candidate(gap, 3, 0.4)],
            // the other sign is another effect
            vec![candidate(gap, 3, -0.4)],
            vec![candidate(Cause::Effect(EffectId::LoadFriction), 3, 0.1)],
            vec![candidate(Cause::Unexplained, 3, 0.1)],
            vec![candidate(gap, 2, 0.4)],
            vec![],
        ])
        .found(&[&own], &own.terms);
        assert_eq!(found, Replicated { parts: 6, agree: 1, family: 3, place: 4 });
    }

    #[test]
    fn a_half_with_fewer_rows_than_parameters_is_not_searched() {
        let (truth, data) = with_joint_2(&[]);
        let data = data.filtered(|o| o.pose < 16);
        let fitted = identify(&truth.robot, &truth.cell, &data, Choice::from(ParameterSet::Compliance)).unwrap();
        let halves = Halves::search(Fitted::all(&fitted.model), &[], &data, &fitted.noise, 1.0).unwrap();
        assert_eq!(halves.0.len(), 0);
    }

    #[test]
    fn halves_have_nothing_in_common_and_are_of_a_size() {
        let sizes: Vec<usize> = (0..30).map(|block| 1 + block % 3).collect();
        let all = halves(&sizes);
        assert_eq!(all.len(), 2 * HALVED);
        for pair in all.chunks(2) {
            assert!(pair[0].iter().zip(&pair[1]).all(|(a, b)| a != b));
            let poses = |half: &[bool]| half.iter().zip(&sizes).filter(|(h, _)| **h).map(|(_, n)| n).sum::<usize>();
            assert!(poses(&pair[0]).abs_diff(poses(&pair[1])) <= 3);
        }
        assert_ne!(all[0], all[2]);
    }
}
