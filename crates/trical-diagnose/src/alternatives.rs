//! Between which explanations the data cannot decide, and what each of them says of measurements that were not made yet.

use trical_ident::error::{IdentError, Result};
use trical_ident::fit::identifiability::r_factor;
use trical_ident::fit::identify::fit_model_knowing;
use trical_ident::fit::priors::PriorKnowledge;
use trical_model::{Forward, MAX_JOINTS, Model, State, Term};

use crate::candidate::Candidate;
use crate::diagnosis::{Diagnosis, Finding};
use crate::settings::{RIVALS_COMPARED, SURE_ENOUGH};
use crate::verdict::named;
use crate::words::small;

/// A finding that could as well be something else.
pub struct Undecided<'a> {
    /// The finding.
    pub finding: &'a Finding,
    /// It and its rivals in words; "nothing" where no other effect comes near.
    pub names: Vec<String>,
    /// Models in the same order, each fitted to all of the data.
    pub models: Vec<Model>,
    /// Terms of the first model that all share.
    pub shared: Vec<usize>,
    /// J'J of the shared terms over the data, in units of the noise, with what is known beforehand.
    pub information: Vec<f64>,
    /// Standard deviation of a touch's scalar residual, m.
    pub sigma: f64,
    /// What is known of a measurement that comes next, but for its joints: time, temperature, load.
    pub state: State,
}

impl Diagnosis {
    /// The least sure finding that has rivals (or is not sure in itself), each explanation fitted anew; `None` where nothing is
    /// undecided.
    ///
    /// # Errors
    /// A rival that cannot be fitted.
    pub fn undecided(&self) -> Result<Option<Undecided<'_>>> {
        let open = |f: &Finding| !f.rivals.is_empty() || f.confidence < SURE_ENOUGH;
        let least = (0..self.findings.len())
            .filter(|k| open(&self.findings[*k]))
            .min_by(|a, b| self.findings[*a].confidence.total_cmp(&self.findings[*b].confidence));
        let Some(k) = least else { return Ok(None) };
        let finding = &self.findings[k];
        let (members, rivals) = &self.grounds.findings[k];
        let own: Vec<usize> = members.iter().flat_map(|c| self.places(c)).collect();
        let shared: Vec<usize> = (0..self.model.terms.len()).filter(|t| !own.contains(t)).collect();
        let session = finding.session.map_or_else(String::new, |s| format!(" in session {s}"));
        let mut names = vec![small(&named(finding.effect, finding.site)) + &session];
        let mut models = vec![self.model.clone()];
        let mut add = |name: String, candidate: Option<&Candidate>| -> Result<()> {
            let mut model = self.model.clone();
            model.terms = shared.iter().map(|t| self.model.terms[*t].clone()).collect();
            let mut known: Vec<PriorKnowledge> = shared.iter().map(|t| self.grounds.known[*t]).collect();
            for (t, sd) in candidate.iter().flat_map(|c| c.terms.iter().zip(&c.scales)) {
                let name = format!("rival_{}", t.name);
                model.terms.push(Term { name, ..t.clone() });
                known.push(PriorKnowledge::about_zero(*sd));
            }
            let fitted = fit_model_knowing(model, &self.data, &self.grounds.noise, &known, Vec::new());
            models.push(fitted?.model);
            names.push(name);
            Ok(())
        };
        for (rival, candidate) in finding.rivals.iter().zip(rivals).take(RIVALS_COMPARED) {
            add(small(&named(rival.effect, rival.site)), Some(candidate))?;
        }
        if rivals.is_empty() {
            add("nothing".into(), None)?;
        }
        let forward = Forward::new(self.model.clone(), shared.clone())?;
        let known: Vec<PriorKnowledge> = shared.iter().map(|t| self.grounds.known[*t]).collect();
        let r = r_factor(&forward, &self.data, &self.grounds.noise, &known);
        let p = shared.len();
        let information =
            (0..p * p).map(|k| (0..r.nrows()).map(|row| r[(row, k / p)] * r[(row, k % p)]).sum()).collect();
        Ok(Some(Undecided {
            finding,
            names,
            models,
            shared,
            information,
            sigma: self.grounds.sigma,
            state: self.next_state(),
        }))
    }

    /// Where in the model a candidate's terms are.
    fn places(&self, c: &Candidate) -> Vec<usize> {
        let terms = self.model.terms.iter().enumerate();
        terms.filter(|(_, m)| c.terms.iter().any(|t| t.does_as(m))).map(|(k, _)| k).collect()
    }

    /// After the last measurement, at its temperature and load.
    fn next_state(&self) -> State {
        let last = self.data.observations.last().map(|o| &o.state);
        let of = |f: fn(&State) -> Option<f64>| last.and_then(f);
        State {
            t: of(|s| s.t),
            seq: of(|s| s.seq),
            temp_c: of(|s| s.temp_c),
            payload_kg: of(|s| s.payload_kg),
            ..State::at(&[0.0; MAX_JOINTS])
        }
    }
}

impl Undecided<'_> {
    /// The models as forward models, the first with the shared terms free.
    ///
    /// # Errors
    /// None for models that were fitted.
    pub fn forwards(&self) -> Result<Vec<Forward>> {
        let of = |(k, m): (usize, &Model)| {
            let free = if k == 0 { self.shared.clone() } else { Vec::new() };
            Forward::new(m.clone(), free).map_err(IdentError::from)
        };
        self.models.iter().enumerate().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::sync::LazyLock;

    use trical_ident::ErrorSummary;
    use trical_ident::fit::residuals::position_errors;
    use trical_model::{Axis, Basis, Motion, Place, Shape, Site, Task};

    use super::*;
    use crate::diagnosis::Rival;
    use crate::effect_id::EffectId;
    use crate::options::Options;
    use crate::procedure::diagnose;
    use crate::test_data::{off, with_joints};

    /// A diagnosis that is sure of gaps in joints 3 and 5, and of nothing else; it is made once.
    fn diagnosis() -> Diagnosis {
        static MADE: LazyLock<Diagnosis> = LazyLock::new(|| {
            let gap = |joint, size| (joint, Basis::direction(joint), size);
            let (truth, data) = with_joints(&[gap(3, -4e-4), gap(5, -2e-4)]);
            diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap()
        });
        let mut d = MADE.clone();
        let sites: Vec<Place> = d.findings.iter().map(|f| f.site).collect();
        assert_eq!(sites, [Place::Joint(3), Place::Joint(5)]);
        for (f, grounds) in d.findings.iter_mut().zip(&mut d.grounds.findings) {
            f.confidence = 0.99;
            f.rivals.clear();
            grounds.1.clear();
        }
        d
    }

    /// One more rival of the first finding, whose coefficient is zero to within `scale`.
    fn rival(d: &mut Diagnosis, effect: EffectId, scale: f64) {
        d.findings[0].rivals.push(Rival { effect, site: Place::Joint(3), delta_bic: 1.0 });
        let candidate = off(effect.into(), 3, Shape::Linear);
        d.grounds.findings[0].1.push(Candidate { scales: vec![scale], ..candidate });
    }

    fn rms_mm(model: &Model, d: &Diagnosis) -> f64 {
        ErrorSummary::of(&position_errors(&Forward::new(model.clone(), Vec::new()).unwrap(), &d.data)).rms_mm
    }

    #[test]
    fn the_least_sure_finding_is_undecided_and_what_is_sure_only_if_it_has_a_rival() {
        let asked = |d: &Diagnosis| d.undecided().unwrap().map(|u| u.finding.site);
        let mut d = diagnosis();
        assert_eq!(asked(&d), None);
        (d.findings[0].confidence, d.findings[1].confidence) = (0.8, 0.6);
        assert_eq!(asked(&d), Some(Place::Joint(5)));
        let mut d = diagnosis();
        d.findings[1].confidence = 0.995;
        rival(&mut d, EffectId::GearRatio, 1e-3);
        assert_eq!(asked(&d), Some(Place::Joint(3)));
    }

    #[test]
    fn without_a_rival_a_finding_stands_against_an_arm_without_it() {
        let mut d = diagnosis();
        d.findings[0].confidence = 0.8;
        d.findings[0].session = Some(2);
        let u = d.undecided().unwrap().unwrap();
        assert_eq!(u.names, ["backlash or friction wind-up at joint 3 in session 2", "nothing"]);
        // one number less, and what was found elsewhere stays
        assert_eq!((u.shared.len(), u.models[1].terms.len()), (d.model.terms.len() - 1, d.model.terms.len() - 1));
        let gaps = |m: &Model| m.terms.iter().filter(|t| t.effect == "lost_motion_direction").count();
        assert_eq!([gaps(&u.models[0]), gaps(&u.models[1])], [2, 1]);
        assert!(rms_mm(&u.models[1], &d) > 2.0 * rms_mm(&u.models[0], &d));
        let free: Vec<usize> = u.forwards().unwrap().iter().map(|f| f.free().len()).collect();
        assert_eq!(free, [u.shared.len(), 0]);
    }

    #[test]
    fn a_rival_stands_in_the_place_of_the_finding_at_sizes_that_are_usual() {
        let mut d = diagnosis();
        rival(&mut d, EffectId::GearRatio, 1e-12);
        [(); 5].iter().for_each(|()| rival(&mut d, EffectId::JointHarmonic, 1e-3));
        let u = d.undecided().unwrap().unwrap();
        assert_eq!(u.names.len(), 1 + RIVALS_COMPARED);
        assert!(u.names[1].ends_with(" at joint 3") && u.names[1] != u.names[0], "{:?}", u.names);
        let own = u.models[1].terms.last().unwrap();
        assert_eq!((own.name.as_str(), u.models[1].terms.len()), ("rival_t", d.model.terms.len()));
        assert!(own.value.abs() < 1e-11 && u.models[2].terms.last().unwrap().value.abs() > 1e-7, "{}", own.value);
    }

    /// Three numbers of each of 200 touches follow a shift of the tool as a whole, each axis at right angles to the others.
    #[test]
    fn what_is_known_of_shared_terms_is_in_units_of_the_noise() {
        let mut d = diagnosis();
        d.findings[0].confidence = 0.8;
        let u = d.undecided().unwrap().unwrap();
        let at = |axis| {
            let is_it = |t: &usize| d.model.terms[*t].site == Site::Tool(Motion::Along(axis));
            u.shared.iter().position(is_it).unwrap()
        };
        let [x, y] = [Axis::X, Axis::Y].map(at);
        let p = u.shared.len();
        let expected = d.data.observations.len() as f64 / u.sigma.powi(2);
        assert!((u.information[x * p + x] / expected - 1.0).abs() < 1e-3, "{} {expected}", u.information[x * p + x]);
        assert!(u.information[x * p + y].abs() < 1e-3 * expected);
        assert!((u.sigma / 1e-5 - 1.0).abs() < 0.1, "{}", u.sigma);
    }

    #[test]
    fn what_comes_next_comes_after_the_last_measurement_with_its_temperature_and_load() {
        let mut d = diagnosis();
        let last = &mut d.data.observations.last_mut().unwrap().state;
        (last.t, last.temp_c, last.payload_kg) = (Some(900.0), Some(27.0), Some(5.0));
        let next = d.next_state();
        assert_eq!([next.t, next.seq, next.temp_c, next.payload_kg], [900.0, 199.0, 27.0, 5.0].map(Some));
        assert_eq!((next.q, next.dir), ([0.0; MAX_JOINTS], None));
    }
}
