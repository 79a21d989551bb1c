//! Readings left on the gauge: noise of their own, or deflections that a gain shows in.

use trical_ident::error::Result;
use trical_ident::fit::identify::Identified;
use trical_model::{Axis, Term, Variable};

use super::{Rounds, temper};
use crate::catalogue::{catalogue, device_orientation};
use crate::correlated_noise::CorrelatedNoise;
use crate::covariates::{Covariates, reading_spread, spreads_beyond};
use crate::effect_id::Cause;
use crate::linear::{Design, Fitted};
use crate::selection::Search;
use crate::settings::{EVIDENCE_NATS, READING_SPREAD};

impl Rounds {
    /// Readings that looked nulled beside what the baseline left may spread far beyond the noise: then their gains are asked for, and how the
    /// device is turned, and what is read is no noise. Whether the baseline became another one.
    pub(super) fn ask_readings(&mut self) -> Result<bool> {
        let (sigma, bare) = (self.touch_sigma(), self.bare());
        let mut spread = spreads_beyond(&self.all, sigma);
        for axis in Axis::ALL {
            let of = Variable::Reading { axis };
            let taken = bare.terms.iter().find(|t| t.basis.of == of && t.effect == Cause::ReadingNoise.name());
            let share = taken.map_or(0.0, |t| -t.value);
            spread[axis.index()] &= !may_be_noise(share, reading_spread(&self.all, axis.index()), sigma);
        }
        if !spread.iter().zip(self.spread).any(|(now, before)| *now && !before) {
            return Ok(false);
        }
        let mut recorded = Covariates::new(&bare, &self.all, sigma);
        recorded.spread = spread;
        recorded.nulled = false;
        self.spread = recorded.spread;
        let mut of_sessions = Covariates::of_sessions(&bare, &self.all, sigma);
        of_sessions.iter_mut().for_each(|(_, own)| own.spread = recorded.spread);
        let (candidates, untestable) = catalogue(&recorded, &of_sessions);
        self.untestable = untestable;
        self.add(candidates.into_iter().filter(|c| !c.is_long_curve()).collect());
        let known = |t: &Term| bare.terms.iter().any(|o| o.does_as(t));
        let turned = device_orientation(&recorded).filter(|t| !known(t));
        let is_noise = |t: &Term| t.effect == Cause::ReadingNoise.name();
        let changed = turned.is_some() || bare.terms.iter().any(is_noise);
        for k in (0..self.baseline_terms).rev().filter(|k| is_noise(&bare.terms[*k])) {
            self.fitted.model.terms.remove(k);
            self.known.remove(k);
            self.baseline_terms -= 1;
        }
        let fitted = std::mem::take(&mut self.fitted_nuisances);
        let others = std::mem::take(&mut self.nuisances).into_iter().zip(fitted);
        (self.nuisances, self.fitted_nuisances) = others.filter(|(n, _)| n.cause != Cause::ReadingNoise).unzip();
        if changed {
            self.add_to_baseline(turned.into_iter().collect())?;
        }
        Ok(changed)
    }

    /// Adds those terms about the readings' own noise that pay to the baseline, and fits again. Whether there were any.
    pub(super) fn fit_reading_noise(&mut self) -> Result<bool> {
        let mut any = false;
        for k in 0..self.nuisances.len() {
            if self.fitted_nuisances[k] {
                continue;
            }
            let one = std::slice::from_ref(&self.nuisances[k]);
            let all = Fitted { known: &self.known, ..Fitted::all(&self.fitted.model) };
            let Identified { data, noise, .. } = &self.fitted;
            let design = Design::weighted(all, one, &[], data, noise, CorrelatedNoise::WHITE)?;
            let temper = temper(&self.fitted.data);
            let search = Search::new(&design, one, temper);
            if search.rank(&design.start()).first().is_some_and(|r| r.evidence > EVIDENCE_NATS) {
                self.add_to_baseline(self.nuisances[k].terms.clone())?;
                self.fitted_nuisances[k] = true;
                any = true;
            }
        }
        Ok(any)
    }
}

/// Whether a reading that spreads by `spread` (m), of which the fit took `share` for noise, may be noise beside what is left, `sigma`. The share of a
/// reading's variance that is noise is the best one to take, and leaves the rest of that noise in the residual: a gauge that reads too much has the
/// share without the rest. And noise is no more than all of a reading: one that is read with the other sign has twice that.
fn may_be_noise(share: f64, spread: f64, sigma: f64) -> bool {
    let left = (share * (1.0 - share)).max(0.0).sqrt() * spread;
    (READING_SPREAD.powi(-2)..1.5).contains(&share) && left < 2.0 * sigma
}

#[cfg(test)]
mod tests {
    use super::may_be_noise;

    #[test]
    fn nearly_all_of_a_reading_may_be_noise_a_twentieth_of_a_large_one_or_twice_of_one_is_none() {
        assert!(may_be_noise(0.95, 2e-5, 1e-5));
        assert!(!may_be_noise(0.05, 1e-3, 1e-5), "a gain leaves nothing of it in the residual");
        assert!(!may_be_noise(2.0, 2e-5, 1e-5), "read with the other sign");
    }
}
