//! Waves of an encoder's curve: how large they are, and which single lines beyond them are the encoder's too.

use std::collections::BTreeMap;

use trical_ident::error::Result;
use trical_model::Place;

use super::Rounds;
use crate::candidate::Candidate;
use crate::correlated_noise::CorrelatedNoise;
use crate::effect_id::EffectId;
use crate::effects::{further_wave, ripple_log_prior};
use crate::settings::{
    FEWEST_TEETH, GEAR_CYCLES, GEAR_MULTIPLES, GEAR_MULTIPLES_OF_FEW, GEAR_SIDEBANDS, GEAR_SIDEBANDS_SHARE,
    LINES_OF_NO_GEAR, SMALLEST_GEAR,
};

impl Rounds {
    /// Gives the waves of `curves`, which are in the fit but not among what was chosen, the sizes that the data say they have.
    pub(super) fn learn_sizes(&mut self, curves: &[usize]) -> Result<()> {
        let members = self.members(&[curves, &self.chosen].concat());
        let design = self.design_at(&self.fitted.model, &members, &[], CorrelatedNoise::WHITE)?;
        let sizes = design.wave_sizes(&members, curves.len());
        for (c, scales) in curves.iter().zip(sizes.into_iter().flatten()) {
            self.candidates[*c].scales = scales;
        }
        Ok(())
    }

    /// Lines at joints that have an encoder's curve are waves of it, unless they are those of a gear; and so are lines alone that are of no
    /// one gear, where they are many.
    pub(crate) fn name_waves(&mut self) {
        let of = |id: EffectId| -> Vec<usize> {
            self.chosen.iter().copied().filter(|c| self.candidates[*c].cause == id.into()).collect()
        };
        let mut waves: Vec<usize> = Vec::new();
        let curves: Vec<Place> = of(EffectId::EncoderError).into_iter().map(|c| self.candidates[c].site).collect();
        let mut sites: Vec<Place> = of(EffectId::GearRipple).into_iter().map(|c| self.candidates[c].site).collect();
        sites.sort_unstable();
        sites.dedup();
        for site in sites {
            let mut here = of(EffectId::GearRipple);
            here.retain(|c| self.candidates[*c].site == site);
            let line = |c: &usize| (self.candidates[*c].cycles().unwrap_or(0.0), self.power(&self.candidates[*c]));
            let lines: Vec<(f64, f64)> = here.iter().map(line).collect();
            let of_none = of_gear(&lines, FEWEST_TEETH).into_iter().filter(|gear| !gear).count();
            if curves.contains(&site) || of_none >= LINES_OF_NO_GEAR {
                let of_gear = of_gear(&lines, SMALLEST_GEAR);
                waves.extend(here.into_iter().zip(of_gear).filter(|(_, gear)| !gear).map(|(c, _)| c));
            }
        }
        for wave in waves {
            let own = &mut self.candidates[wave];
            for t in &mut own.terms {
                let fitted = self.fitted.model.terms.iter_mut().find(|m| m.does_as(t));
                further_wave(t);
                if let Some(fitted) = fitted {
                    (fitted.name, fitted.effect) = (t.name.clone(), t.effect.clone());
                }
            }
            own.cause = EffectId::EncoderError.into();
        }
    }

    /// What is expected of a chosen candidate beside the others. An arm's gears are often of one make: half of what is expected of the strongest line of
    /// a joint's gear are the numbers of the strongest lines at other joints, their halves and their doubles.
    pub(crate) fn log_prior_beside_others(&self, chosen: usize) -> f64 {
        let own = &self.candidates[chosen];
        let mut strongest: BTreeMap<Place, usize> = BTreeMap::new();
        for c in self.chosen.iter().filter(|c| self.candidates[**c].cause == EffectId::GearRipple.into()) {
            let at = strongest.entry(self.candidates[*c].site).or_insert(*c);
            if self.power(&self.candidates[*c]) > self.power(&self.candidates[*at]) {
                *at = *c;
            }
        }
        let (Some(cycles), Some(true)) = (own.cycles(), strongest.remove(&own.site).map(|c| c == chosen)) else {
            return own.log_prior;
        };
        let others = strongest.into_values().filter_map(|c| self.candidates[c].cycles());
        let mut likely: Vec<f64> = others.flat_map(|n| [0.5 * n, n, 2.0 * n]).collect();
        likely.retain(|n| n.fract() == 0.0 && (f64::from(GEAR_CYCLES.0)..=f64::from(GEAR_CYCLES.1)).contains(n));
        likely.sort_unstable_by(f64::total_cmp);
        likely.dedup();
        ripple_log_prior(cycles, self.fitted.model.robot.dof(), &likely)
    }

    /// Squared amplitude of a wave in the fit, SI.
    fn power(&self, wave: &Candidate) -> f64 {
        let fitted = |t| self.fitted.model.terms.iter().find(|m| m.does_as(t)).map(|m| m.value.powi(2));
        wave.terms.iter().filter_map(fitted).sum()
    }
}

/// Which of the lines of a joint (cycles per turn, power) are a gear's, where the joint's encoder has a curve. A gear's are at one number
/// of at least `smallest` and its multiples, and at neighbours that modulate them; they have most of the power of the lines, but for those at powers of two, which are
/// the encoder's own poles.
fn of_gear(lines: &[(f64, f64)], smallest: f64) -> Vec<bool> {
    let is_pole = |n: f64| (n - libm::exp2(libm::log2(n).round())).abs() <= 1.0 && n > SMALLEST_GEAR;
    let others = || lines.iter().filter(|(n, _)| !is_pole(*n));
    let Some((strongest, _)) = others().max_by(|a, b| a.1.total_cmp(&b.1)) else { return vec![false; lines.len()] };
    let sidebands = |gear: f64| GEAR_SIDEBANDS.min(GEAR_SIDEBANDS_SHARE * gear);
    let belongs = |n: f64, gear: f64| (n - (n / gear).round().max(1.0) * gear).abs() <= sidebands(gear);
    let power = |gear: f64| others().filter(|(n, _)| belongs(*n, gear)).map(|(_, p)| p).sum::<f64>();
    let multiples = if smallest < SMALLEST_GEAR { GEAR_MULTIPLES_OF_FEW } else { GEAR_MULTIPLES };
    let gears = (1..=multiples).map(|k| strongest / f64::from(k)).filter(|gear| *gear >= smallest);
    let best = gears.max_by(|a, b| power(*a).total_cmp(&power(*b)).then(a.total_cmp(b)));
    let all: f64 = others().map(|(_, p)| p).sum();
    let of = best.filter(|gear| power(*gear) > 0.5 * all);
    lines.iter().map(|(n, _)| of.is_some_and(|gear| belongs(*n, gear) && !is_pole(*n))).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Shape, Term, Variable};

    use super::*;
    use crate::effects::ripple;
    use crate::options::Options;
    use crate::test_data::with_joint_2;

    #[test]
    fn lines_of_one_number_with_neighbours_and_multiples_are_a_gears_and_scattered_ones_are_not() {
        let asked = |lines: &[(f64, f64)]| of_gear(lines, SMALLEST_GEAR);
        assert_eq!(asked(&[(101.0, 1.0)]), [true]);
        assert_eq!(asked(&[(99.0, 0.5), (101.0, 2.0), (202.0, 1.0), (73.0, 0.4)]), [true, true, true, false]);
        // the second harmonic is the strongest
        assert_eq!(asked(&[(100.0, 1.0), (200.0, 2.0), (300.0, 1.0), (61.0, 1.0)]), [true, true, true, false]);
        assert_eq!(asked(&[(59.0, 1.0), (67.0, 1.2), (88.0, 1.0), (155.0, 0.8)]), [false; 4]);
        // an encoder's poles, however strong
        assert_eq!(asked(&[(128.0, 9.0), (100.0, 1.0), (256.0, 3.0)]), [false, true, false]);
        assert_eq!(asked(&[]), [false; 0]);
    }

    #[test]
    fn many_lines_of_no_one_gear_are_an_encoders_without_a_curve_too() {
        let few = |lines: &[f64]| {
            let lines: Vec<(f64, f64)> = lines.iter().map(|n| (*n, 1.0)).collect();
            of_gear(&lines, FEWEST_TEETH).iter().filter(|gear| !**gear).count()
        };
        assert_eq!((few(&[20.0, 40.0, 60.0]), few(&[14.0, 24.0, 31.0, 39.0, 47.0])), (0, 5));
        let causes = |cycles: &[f64]| {
            let (_, mut rounds) = named(cycles);
            rounds.chosen.remove(0);
            for c in rounds.chosen.clone() {
                rounds.candidates[c].cause = EffectId::GearRipple.into();
            }
            rounds.name_waves();
            rounds.chosen.iter().filter_map(|c| rounds.candidates[*c].cause.effect()).collect::<Vec<_>>()
        };
        assert_eq!(causes(&[5.0, 14.0, 24.0, 31.0]), [EffectId::EncoderError; 3]);
        assert_eq!(causes(&[5.0, 20.0, 40.0, 60.0]), [EffectId::GearRipple; 3]);
        assert_eq!(causes(&[5.0, 24.0, 31.0]), [EffectId::GearRipple; 2]);
    }

    /// Curve and lines of joint 2 of an arm with an error of `cycles` there, chosen and fitted, as they are named.
    fn named(cycles: &[f64]) -> (Vec<EffectId>, Rounds) {
        let wave = |n: &f64| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles: *n }), 3e-4);
        let (truth, data) = with_joint_2(&cycles.iter().map(wave).collect::<Vec<_>>());
        let mut rounds = Rounds::begin(&truth.robot, &truth.cell, &data, &Options::default()).unwrap();
        let curve = rounds.curves.iter().position(|c| c.site == Place::Joint(2)).unwrap();
        let curve = rounds.curves.swap_remove(curve);
        let first = rounds.candidates.len();
        rounds.candidates.push(curve);
        rounds.candidates.extend(cycles[1..].iter().map(|n| ripple(2, *n, 6)));
        rounds.chosen = (first..rounds.candidates.len()).collect();
        rounds.refit().unwrap();
        rounds.name_waves();
        let causes = rounds.chosen.iter().filter_map(|c| rounds.candidates[*c].cause.effect()).collect();
        (causes, rounds)
    }

    #[test]
    fn the_number_of_a_gear_makes_it_likelier_at_other_joints() {
        let (_, mut rounds) = named(&[5.0]);
        rounds.chosen.clear();
        // what is expected of all lines more than of each by itself, with one more line, as strong as its number is large
        let mut with = |joint: usize, cycles: f64| -> Vec<f64> {
            let line = ripple(joint, cycles, 6);
            rounds.fitted.model.terms.extend(line.terms.iter().map(|t| Term { value: 1e-6 * cycles, ..t.clone() }));
            rounds.chosen.push(rounds.candidates.len());
            rounds.candidates.push(line);
            let more = |c: &usize| rounds.log_prior_beside_others(*c) - rounds.candidates[*c].log_prior;
            rounds.chosen.iter().map(more).collect()
        };
        let one_of = |n: f64| libm::log(0.5 + 0.5 * 291.0 / n);
        let none = libm::log(0.5);
        let lines = [
            with(3, 80.0),
            // 80 and 160 are likely at joint 3, and 40, 80 and 160 at joint 4
            with(4, 160.0),
            // a weaker line of joint 4 tells nothing, and is told nothing
            with(4, 53.0),
            // 50, 100 and 200 are likely as well, but not at joint 5 itself
            with(5, 100.0),
        ];
        let expected: [&[f64]; 4] = [
            &[0.0],
            &[one_of(2.0), one_of(3.0)],
            &[one_of(2.0), one_of(3.0), 0.0],
            &[one_of(5.0), one_of(6.0), 0.0, none],
        ];
        for (more, expected) in lines.iter().zip(expected) {
            assert!(more.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{more:?} {expected:?}");
        }
    }

    #[test]
    fn lines_beyond_an_encoders_curve_become_its_waves_in_the_model_too() {
        let (causes, rounds) = named(&[5.0, 61.0, 88.0, 131.0]);
        assert_eq!(causes, [EffectId::EncoderError; 4]);
        let wave = rounds.fitted.model.terms.iter().find(|t| t.name == "encoder_sine_61_2").unwrap();
        assert!(wave.effect == "encoder_error" && (wave.value - 3e-4).abs() < 3e-5, "{}", wave.value);
        assert_eq!(named(&[5.0, 101.0]).0, [EffectId::EncoderError, EffectId::GearRipple]);
    }

    #[test]
    fn waves_get_the_size_that_all_of_their_octave_have() {
        let (_, mut rounds) = named(&[5.0, 7.0]);
        let curve = rounds.chosen[0];
        let before = rounds.candidates[curve].scales.clone();
        rounds.chosen.remove(0);
        rounds.learn_sizes(&[curve]).unwrap();
        let after = &rounds.candidates[curve].scales;
        let factor = |n: usize| after[2 * n] / before[2 * n];
        // waves 4 to 7 are there, larger than usual, 8 and more are not
        assert!(
            factor(4) == 1.0 && factor(8) < 0.6 && (factor(4) - factor(6)).abs() < 1e-12,
            "{} {}",
            factor(4),
            factor(8)
        );
    }
}
