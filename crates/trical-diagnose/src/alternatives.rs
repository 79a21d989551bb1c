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
