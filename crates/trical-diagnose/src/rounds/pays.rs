//! What pays: curves with many coefficients, which are chosen first and held, and everything that was chosen, at poses that the fit did
//! not see.

use std::collections::BTreeMap;

use trical_ident::error::Result;
use trical_ident::fit::folds::{FOLDS, Folds};
use trical_ident::fit::identify::ErrorSummary;
use trical_model::Term;

use super::Rounds;
use crate::candidate::{Candidate, cycles_of, said_by};
use crate::correlated_noise::CorrelatedNoise;
use crate::effects::ripple;
use crate::findings::{Group, grouped};
use crate::linear::Partition;
use crate::parts::{Parts, error_size, what_does_not_pay};
use crate::periodogram;
use crate::refine::parts_of_curve;
use crate::selection::Search;
use crate::settings::{CURVE_SHARES, CURVES_ASKED, GEAR_CYCLES, PEAKS_PER_JOINT, TRIED_WITH_CURVES};

impl Rounds {
    /// Curves with many coefficients (an encoder's) that the residual asks for beside everything else: they come first, since they are
    /// worth most where they are, and stay in the fit while leaner candidates are searched, which then costs what these cost.
    pub(crate) fn hold_curves(&mut self) -> Result<bool> {
        if self.curves.is_empty() {
            return Ok(false);
        }
        // a line that a curve would hide is asked about too
        self.add(periodogram::ripples(&self.fitted, &self.kept)?);
        let first = self.candidates.len();
        let all = [self.searched(), self.curves.clone()].concat();
        // a curve that is held, and a shorter one of the same joint, would be fitted twice
        let held = self.held_curves();
        let is_held = |c: &usize| self.held.contains(c) || *c >= first && held.iter().any(|h| all[*c].is_part_of(h));
        let out: Vec<usize> = (0..all.len()).filter(is_held).collect();
        let chosen = {
            let design = self.design(&all, &[], CorrelatedNoise::WHITE)?;
            let search = Search::new(&design, &all, self.temper()).without_candidates(&out);
            search.first(&design.start(), &self.chosen, TRIED_WITH_CURVES)
        };
        let mut new: Vec<usize> = chosen.into_iter().filter(|c| *c >= first).map(|c| c - first).collect();
        // of two curves of one joint the one with more waves says all that both say
        let curves = new.clone();
        let is_said = |c: &Candidate| {
            curves.iter().map(|n| &all[first + n]).any(|o| c.terms.len() < o.terms.len() && c.is_part_of(o))
        };
        new.retain(|c| !is_said(&all[first + c]));
        if new.is_empty() {
            return Ok(false);
        }
        let mut at = 0..;
        let (held, left): (Vec<Candidate>, Vec<Candidate>) =
            std::mem::take(&mut self.curves).into_iter().partition(|_| at.next().is_some_and(|k| new.contains(&k)));
        self.curves = left;
        let before = self.held.clone();
        let candidates = &self.candidates;
        self.held.retain(|h| !is_said(&candidates[*h]));
        self.held.extend(first..first + held.len());
        self.candidates.extend(held);
        if self.refit_with(true).is_err() {
            // the exact fit does not follow the linear picture: they stay out
            self.held = before;
            self.refit()?;
            return Ok(false);
        }
        Ok(true)
    }

    /// Held curves, and what says the same in other words.
    pub(super) fn said_by_curves(&self) -> Vec<usize> {
        said_by(&self.held_curves(), &self.candidates)
    }

    /// Held curves with their columns, which [`Self::searched`] has not.
    fn held_curves(&self) -> Vec<&Candidate> {
        self.held.iter().map(|h| &self.candidates[*h]).collect()
    }

    /// Lets go of held curves that do not pay at unseen blocks beside what was chosen since, or no more than one of their own waves does: what
    /// looked like an encoder's error before the large effects were found need not be one. Whether there were any.
    pub(crate) fn let_go_of_curves(&mut self) -> Result<bool> {
        if self.held.is_empty() {
            return Ok(false);
        }
        let held = std::mem::take(&mut self.held);
        let waves: Vec<usize> = (0..self.candidates.len())
            .filter(|c| !held.contains(c) && held.iter().any(|h| self.candidates[*c].is_part_of(&self.candidates[*h])))
            .collect();
        let members = self.members(&[&held[..], &self.chosen[..], &waves[..]].concat());
        let dropped = {
            let design = self.design_at(&self.fitted.model, &members, &[], CorrelatedNoise::WHITE)?;
            let all: Vec<usize> = (0..held.len() + self.chosen.len()).collect();
            let parts = Parts::by_block(&design, &all, &Folds::of(&self.kept), self.temper());
            parts.map_or_else(Vec::new, |parts| {
                let groups = grouped(&members[..held.len()], &all[..held.len()]);
                let leaner = |curve: usize, wave: &usize| members[*wave].is_part_of(&members[curve]);
                let instead = |g: &Group| (all.len()..members.len()).filter(|w| leaner(g.members[0], w)).collect();
                what_does_not_pay(&[parts], &members, groups, &instead)
            })
        };
        let (let_go, held): (Vec<_>, Vec<_>) = held.into_iter().enumerate().partition(|(k, _)| dropped.contains(k));
        self.held = held.into_iter().map(|(_, c)| c).collect();
        if let_go.is_empty() {
            return Ok(false);
        }
        self.let_go.extend(let_go.into_iter().map(|(_, c)| c));
        // what was chosen beside them need not be what is chosen without
        (self.chosen, self.correlation) = (Vec::new(), CorrelatedNoise::WHITE);
        self.refit()?;
        Ok(true)
    }

    /// Held curves become as every other effect, their waves as large as the data say beside everything that was chosen since.
    pub(crate) fn release_curves(&mut self) -> Result<()> {
        let held = std::mem::take(&mut self.held);
        if held.is_empty() {
            return Ok(());
        }
        self.learn_sizes(&held)?;
        self.choose_beside(&held)
    }

    /// Chooses what is lean once more beside free curves: a curve that was fitted before another effect was known has taken its part, and gives it
    /// back only where both are free.
    fn choose_beside(&mut self, curves: &[usize]) -> Result<()> {
        let before = [curves, &self.chosen[..]].concat();
        let lean = std::mem::replace(&mut self.chosen, before.clone());
        self.refit()?;
        let chosen = {
            let design = self.design(&self.searched(), &[], self.correlation)?;
            let beside = design.absorbing(&self.searcher(&design).with(&design.start(), curves));
            let long: Vec<&Candidate> = curves.iter().map(|c| &self.candidates[*c]).collect();
            let said = said_by(&long, &self.candidates);
            let mut search = Search::new(&beside, &self.candidates, self.temper()).without_candidates(&said);
            search.choose(&beside.start(), &lean)
        };
        if chosen != lean {
            self.chosen = [curves, &chosen[..]].concat();
            if self.refit().is_err() {
                self.chosen = before;
                return self.refit();
            }
        }
        Ok(())
    }

    /// Takes something leaner in the place of a long curve, if it says more and foretells unseen blocks as well: effects with a name, or what
    /// happens near one angle.
    pub(crate) fn trade_curves(&mut self) -> Result<()> {
        let is_long = |c: &usize| self.candidates[*c].is_long_curve();
        let curves: Vec<usize> = self.chosen.iter().copied().filter(is_long).collect();
        if curves.is_empty() {
            return Ok(());
        }
        let parts = |c: &usize| parts_of_curve(&self.candidates[*c], &self.fitted.model, &self.candidates, &self.kept);
        self.add(curves.iter().flat_map(|c| [self.strongest_lines(*c), parts(c)].concat()).collect());
        let mut chosen = self.chosen.clone();
        {
            let design = self.design(&self.searched(), &[], self.correlation)?;
            let is_rich =
                |c: &usize| self.candidates[*c].cause.effect().is_none() && self.candidates[*c].terms.len() > 1;
            let rich: Vec<usize> = (0..self.candidates.len()).filter(is_rich).collect();
            let search = Search::new(&design, &self.candidates, self.temper()).without_candidates(&rich);
            search.swap(&design.start(), &mut chosen, &|c| curves.contains(&c));
        }
        if chosen == self.chosen {
            return Ok(());
        }
        let (before, unseen) = (self.round(), self.unseen()?);
        let (left, lean): (Vec<usize>, Vec<usize>) = chosen.into_iter().partition(|c| curves.contains(c));
        self.chosen = lean;
        self.choose_beside(&left)?;
        self.keep_what_pays()?;
        if self.unseen()? > unseen {
            self.go_back(before);
        }
        Ok(())
    }

    /// How large the errors at unseen blocks are: their mean times their root mean square.
    fn unseen(&self) -> Result<f64> {
        let members = self.members(&self.chosen);
        let design = self.design_at(&self.fitted.model, &members, &[], CorrelatedNoise::WHITE)?;
        let all: Vec<usize> = (0..members.len()).collect();
        let parts = Parts::by_block(&design, &all, &Folds::of(&self.kept), self.temper());
        Ok(parts.map_or(f64::INFINITY, |parts| error_size(parts.errors(&[], None))))
    }

    /// The strongest waves of a fitted curve that a gear could have, as its ripples: beside the curve the residual does not show them.
    fn strongest_lines(&self, curve: usize) -> Vec<Candidate> {
        let (own, dof) = (&self.candidates[curve], self.fitted.model.robot.dof());
        let Some(joint) = own.site.joint() else { return Vec::new() };
        let mut powers: BTreeMap<u32, f64> = BTreeMap::new();
        for m in self.fitted.model.terms.iter().filter(|m| own.terms.iter().any(|t| t.does_as(m))) {
            let cycles = cycles_of(m).map_or(0, |n| n as u32);
            *powers.entry(cycles).or_default() += m.value.powi(2);
        }
        let mut lines: Vec<(u32, f64)> = powers.into_iter().filter(|(cycles, _)| *cycles >= GEAR_CYCLES.0).collect();
        lines.sort_by(|a, b| b.1.total_cmp(&a.1));
        lines.into_iter().take(PEAKS_PER_JOINT).map(|(cycles, _)| ripple(joint, f64::from(cycles), dof)).collect()
    }

    /// Fits once more with narrower priors of the waves of long curves: those that best predict the errors at angles that a fit did not visit.
    /// A joint's other errors look like waves of its curve, and make the curve swing where no measurement holds it. All errors that are stated
    /// afterwards are those of such fits. Standard deviations stay those of the wider priors: where nothing was visited, the joint may be off by
    /// as much as the likelihood says. If the exact fit fails, everything stays as it was.
    pub(crate) fn shrink_curves(&mut self) -> Result<()> {
        let share = self.curve_share()?;
        if share == 1.0 {
            return Ok(());
        }
        let (wide, candidates) = (self.fitted.clone(), self.candidates.clone());
        for curve in self.candidates.iter_mut().filter(|c| c.is_long_curve()) {
            curve.scales.iter_mut().for_each(|sd| *sd *= share);
        }
        let kept = std::mem::replace(&mut self.kept, self.fitted.data.clone());
        let followed = self.refit().is_ok();
        self.kept = kept;
        if !followed {
            self.candidates = candidates;
            return Ok(());
        }
        self.determined = Some(self.effective_parameters());
        for (t, wide) in self.fitted.model.terms.iter_mut().zip(wide.model.terms) {
            t.sd = wide.sd;
        }
        (self.fitted.covariance, self.fitted.known) = (wide.covariance, wide.known);
        Ok(())
    }

    /// The share of the size that the likelihood says of waves of long curves with which errors at angles that a fit did not visit are least.
    fn curve_share(&self) -> Result<f64> {
        let members = self.members(&self.chosen);
        let joints: Vec<usize> =
            members.iter().filter(|c| c.is_long_curve()).filter_map(|c| c.site.joint()).take(CURVES_ASKED).collect();
        let mut best = (1.0, f64::INFINITY);
        if joints.is_empty() {
            return Ok(best.0);
        }
        let design = self.design_at(&self.fitted.model, &members, &[], CorrelatedNoise::WHITE)?;
        let all: Vec<usize> = (0..members.len()).collect();
        let folds = Folds::of(&self.kept);
        let parts = |joint: &usize| {
            let own = folds.by_angle(&self.kept, joint - 1);
            Partition::unfitted(&design, &all, FOLDS, &|pose| own.block_of(pose) % FOLDS)
        };
        let parts: Vec<Partition<'_>> = joints.iter().filter_map(parts).collect();
        for share in CURVE_SHARES {
            let factor = |c: usize| if members[c].is_long_curve() { share } else { 1.0 };
            let unseen = |own: &Partition<'_>| {
                let left = own.with_priors(&factor);
                let failed = left.iter().any(|r| r.is_infinite());
                if failed { f64::INFINITY } else { ErrorSummary::of(&own.position_errors(&left, None)).mean_mm }
            };
            let new = parts.iter().map(unseen).sum();
            if new >= best.1 {
                break;
            }
            best = (share, new);
        }
        Ok(best.0)
    }

    /// Drops findings that do not lower the error where a fit did not see: at blocks of poses, in the last quarter of each session (by a fit to
    /// what came before), and at places of the balls. The worst goes first, one after the other. Of two nested effects it takes the simpler one
    /// if the difference between them is zero.
    pub(crate) fn keep_what_pays(&mut self) -> Result<()> {
        let before = self.chosen.clone();
        self.simplify();
        let members = self.members(&self.chosen);
        let dropped: Vec<usize> = {
            let design = self.design_at(&self.fitted.model, &members, &[], CorrelatedNoise::WHITE)?;
            let all: Vec<usize> = (0..members.len()).collect();
            let folds = Folds::of(&self.kept);
            let of = [Parts::by_block, Parts::forward].map(|of| of(&design, &all, &folds, self.temper()));
            // where the balls stand need not be known for it: what a fit says of a new place it says with that uncertainty
            let places = folds.at_places(&self.fitted.model.cell, &self.kept);
            let of_places = places.and_then(|places| Parts::by_block(&design, &all, &places, self.temper()));
            let proofs: Vec<Parts<'_>> = of.into_iter().flatten().chain(of_places).collect();
            what_does_not_pay(&proofs, &members, grouped(&members, &all), &|_| Vec::new())
        };
        let dropped: Vec<usize> = dropped.into_iter().map(|k| self.chosen[k]).collect();
        self.chosen.retain(|c| !dropped.contains(c));
        // curves that were held are fitted with everything else now
        let curves = self.chosen.iter().any(|c| self.candidates[*c].is_long_curve());
        if curves || self.chosen != before { self.refit() } else { Ok(()) }
    }

    /// Nested effects (a gap within friction that grows with the load): where all that the larger one adds is within two standard
    /// deviations of nothing, or of a sign that physics forbids, the smaller one takes its place.
    fn simplify(&mut self) {
        for k in 0..self.chosen.len() {
            let own = &self.candidates[self.chosen[k]];
            if own.is_long_curve() {
                continue; // over part of a turn each wave is uncertain where the curve is not
            }
            let is_part =
                |o: &Candidate| o.terms.len() < own.terms.len() && o.cause.effect().is_some() && o.is_part_of(own);
            let nothing = |(t, sign): (&Term, &i8)| {
                let fitted = self.fitted.model.terms.iter().find(|m| m.does_as(t));
                fitted.is_some_and(|m| {
                    m.sd.is_some_and(|sd| m.value.abs() < 2.0 * sd) || f64::from(*sign) * m.value < 0.0
                })
            };
            let simpler = self.candidates.iter().position(|o| {
                let beside = |t: &Term| !o.terms.iter().any(|u| u.site == t.site && u.basis == t.basis);
                is_part(o) && own.terms.iter().zip(&own.signs).filter(|(t, _)| beside(t)).all(nothing)
            });
            if let Some(simpler) = simpler.filter(|s| !self.chosen.contains(s)) {
                self.chosen[k] = simpler;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Place, Shape, Variable};

    use super::*;
    use crate::effect_id::{Cause, EffectId};
    use crate::options::Options;
    use crate::test_data::{with_joint_2, with_joints};

    /// What stands after release for joint 2, whose error is `hidden`, where an encoder's curve of it was held.
    fn released(hidden: &[(Shape, f64)]) -> Vec<Cause> {
        let of = |(shape, size): &(Shape, f64)| (Basis::new(Variable::Joint { joint: 2 }, *shape), *size);
        let (truth, data) = with_joint_2(&hidden.iter().map(of).collect::<Vec<_>>());
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        let curve = rounds.curves.iter().position(|c| c.site == Place::Joint(2)).unwrap();
        rounds.held = vec![rounds.candidates.len()];
        let curve = rounds.curves.swap_remove(curve);
        rounds.candidates.push(curve);
        rounds.refit().unwrap();
        rounds.release_curves().unwrap();
        rounds.trade_curves().unwrap();
        let chosen = rounds.chosen.iter().map(|c| &rounds.candidates[*c]);
        chosen.filter(|c| c.site == Place::Joint(2)).map(|c| c.cause).collect()
    }

    #[test]
    fn a_held_curve_goes_where_something_leaner_says_as_much() {
        assert_eq!(released(&[(Shape::Linear, 1e-3)]), [Cause::Effect(EffectId::GearRatio)]);
        let gear = [12.0, 13.0, 14.0].map(|cycles| (Shape::Sine { cycles }, 3e-4));
        assert_eq!(released(&gear), [Cause::Effect(EffectId::GearRipple); 3]);
        let curve = [3.0, 7.0, 11.0, 13.0].map(|cycles| (Shape::Sine { cycles }, 2e-4));
        assert_eq!(released(&curve), [Cause::Effect(EffectId::EncoderError)]);
    }

    #[test]
    fn waves_that_are_taken_to_be_too_large_swing_less_and_those_that_are_too_small_stay_and_both_are_as_uncertain_as_before()
     {
        let of = |cycles: f64| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles }), 2e-4);
        let (truth, data) = with_joint_2(&[2.0, 3.0, 5.0, 7.0].map(of));
        let waves = |rounds: &Rounds| -> Vec<(f64, Option<f64>)> {
            let own = rounds.fitted.model.terms.iter().filter(|t| t.effect == "encoder_error");
            own.map(|t| (t.value, t.sd)).collect()
        };
        let fitted = |factor: f64| {
            let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
            let curve = rounds.curves.iter().position(|c| c.site == Place::Joint(2)).unwrap();
            let mut curve = rounds.curves.swap_remove(curve);
            curve.scales.iter_mut().for_each(|s| *s *= factor);
            rounds.chosen = vec![rounds.candidates.len()];
            rounds.candidates.push(curve);
            rounds.refit().unwrap();
            let state = |rounds: &Rounds| {
                // with what is known beforehand in such a fit, and in one to other poses
                let sizes =
                    [rounds.candidates[rounds.chosen[0]].scales[0], rounds.known.last().unwrap().prior.unwrap().sd];
                (waves(rounds), rounds.effective_parameters(), sizes)
            };
            let before = state(&rounds);
            rounds.shrink_curves().unwrap();
            (before, state(&rounds))
        };
        let size = |waves: &[(f64, Option<f64>)]| waves.iter().map(|w| w.0.powi(2)).sum::<f64>();
        let ((before, many, wide), (after, fewer, lean)) = fitted(100.0);
        assert!(fewer < many, "{many} {fewer}");
        let shares = [lean[0] / wide[0], lean[1] / wide[1]];
        assert!(shares[0] < 1.0 && (shares[0] - shares[1]).abs() < 1e-12, "{shares:?}");
        assert!(size(&after) < size(&before), "{} {}", size(&before), size(&after));
        assert!(before.iter().zip(&after).all(|(a, b)| a.1 == b.1));
        let (before, after) = fitted(0.1);
        assert_eq!(before, after);
    }

    /// Waves of the curves that are held first for an arm whose joint 2 is off by these waves.
    fn held(waves: &[f64]) -> Vec<usize> {
        let of = |cycles: &f64| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles: *cycles }), 2e-4);
        let (truth, data) = with_joint_2(&waves.iter().map(of).collect::<Vec<_>>());
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        assert_eq!(rounds.hold_curves().unwrap(), !rounds.held.is_empty());
        rounds.held.iter().map(|h| rounds.candidates[*h].terms.len() / 2).collect()
    }

    #[test]
    fn a_curve_has_as_many_waves_as_the_data_ask_for_and_a_line_is_none() {
        assert_eq!(held(&[2.0, 3.0, 5.0, 7.0]), [12]);
        assert_eq!(held(&[3.0, 7.0, 11.0, 13.0, 15.0, 16.0]), [16]);
        assert!(held(&[12.0]).is_empty());
    }

    #[test]
    fn a_curve_that_is_held_stays_when_another_joints_curve_is_held_later() {
        let waves = |joint: usize, cycles: &[f64]| -> Vec<(usize, Basis, f64)> {
            let wave =
                |cycles: &f64| (joint, Basis::new(Variable::Joint { joint }, Shape::Sine { cycles: *cycles }), 2e-4);
            cycles.iter().map(wave).collect()
        };
        let hidden = [waves(2, &[3.0, 7.0, 11.0, 13.0, 15.0, 16.0]), waves(3, &[2.0, 3.0, 5.0, 7.0])].concat();
        let (truth, data) = with_joints(&hidden);
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        let is_of_3 = |c: &Candidate| c.site == Place::Joint(3);
        let (of_3, others) = std::mem::take(&mut rounds.curves).into_iter().partition(is_of_3);
        rounds.curves = others;
        assert!(rounds.hold_curves().unwrap());
        rounds.curves.extend::<Vec<Candidate>>(of_3);
        assert!(rounds.hold_curves().unwrap());
        // and no shorter one beside the one of its joint
        let held: Vec<Place> = rounds.held_curves().into_iter().map(|c| c.site).collect();
        assert_eq!(held, [Place::Joint(2), Place::Joint(3)]);
    }

    #[test]
    fn of_nested_effects_the_simpler_stands_where_what_tells_them_apart_is_nothing_or_of_the_wrong_sign() {
        let simplified = |by_load: f64| {
            let load = Basis { sense: Some(2), ..Basis::torque(2, Shape::Absolute) };
            let (truth, data) = with_joint_2(&[(Basis::direction(2), -2e-4), (load, by_load)]);
            let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
            let friction = |c: &Candidate| c.cause == EffectId::LoadFriction.into() && c.site == Place::Joint(2);
            rounds.chosen = vec![rounds.candidates.iter().position(friction).unwrap()];
            rounds.refit().unwrap();
            rounds.simplify();
            rounds.candidates[rounds.chosen[0]].cause
        };
        // rad/Nm: friction that grows with the load, that does not, and that would fall with it
        let [grows, same, falls] = [-5e-5, 0.0, 5e-5].map(simplified);
        assert_eq!(grows, EffectId::LoadFriction.into());
        assert_eq!([same, falls], [EffectId::LostMotionDirection.into(); 2]);
    }
}
