//! What is known of parameters before they are measured: priors and limits, from a file of the user's.

use std::path::Path;

use trical_model::{Model, Site};

use crate::error::{IdentError, Result};
use crate::units::shown;

/// A coefficient's expected value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Expected value, SI.
    pub value: f64,
    /// Standard deviation about it, SI.
    pub sd: f64,
}

/// What is known of a coefficient before it is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PriorKnowledge {
    /// Where it should be, and how surely.
    pub prior: Option<Prior>,
    /// Between which values it must be, SI.
    pub limits: [f64; 2],
}

impl PriorKnowledge {
    /// No limits.
    pub const UNLIMITED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
    /// Nothing is known.
    pub const NOTHING: Self = Self { prior: None, limits: Self::UNLIMITED };

    /// A prior about zero.
    #[must_use]
    pub fn about_zero(sd: f64) -> Self {
        Self { prior: Some(Prior { value: 0.0, sd }), ..Self::NOTHING }
    }

    /// Whether this says nothing.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        *self == Self::NOTHING
    }
}

/// What a file says of parameters, by name.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownParameters {
    /// Where it was read, for messages.
    #[serde(skip)]
    file: String,
    #[serde(default)]
    parameter: Vec<KnownParameter>,
}

/// One parameter, in the unit and as absolute as `identify` shows it.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct KnownParameter {
    name: String,
    value: Option<f64>,
    sd: Option<f64>,
    min: Option<f64>,
    max: Option<f64>,
}

impl KnownParameters {
    /// Reads a file of `[[parameter]]` tables: `name`, `value` and `sd` of a prior, `min` and `max`.
    ///
    /// # Errors
    /// A file that cannot be read or says something else, a value without `sd`, limits the wrong way round.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&trical_model::error::read_text(path)?, &path.display().to_string())
    }

    /// As [`Self::load`], of text; `file` is for messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self> {
        let error = |problem: String| IdentError::of_file(file, problem);
        let mut known: Self = trical_model::error::parse_toml(text, file)?;
        file.clone_into(&mut known.file);
        if known.parameter.is_empty() {
            return Err(error("says nothing; expected tables [[parameter]] with name and value, sd, min, max".into()));
        }
        for (i, k) in known.parameter.iter().enumerate() {
            let wrong = |problem: String| Err(error(format!("parameter {}: {problem}", k.name)));
            if known.parameter[..i].iter().any(|o| o.name == k.name) {
                return wrong("is given twice".into());
            }
            let all = [("value", k.value), ("sd", k.sd), ("min", k.min), ("max", k.max)];
            if let Some((field, Some(v))) = all.into_iter().find(|(_, v)| v.is_some_and(|v| !v.is_finite())) {
                return wrong(format!("{field} is {v}; expected a finite number"));
            }
            match (k.value, k.sd) {
                (Some(_), None) => return wrong("has a value but no sd; expected how surely it is known".into()),
                (None, Some(_)) => return wrong("has an sd but no value; expected what it is about".into()),
                (_, Some(sd)) if sd <= 0.0 => return wrong(format!("sd is {sd}; expected more than 0")),
                _ => {}
            }
            match (k.min, k.max) {
                (Some(min), Some(max)) if min >= max => return wrong(format!("min {min} is not below max {max}")),
                (None, None) if k.value.is_none() => return wrong("has neither value nor min nor max".into()),
                _ => {}
            }
        }
        Ok(known)
    }

    /// What is known of each of the model's terms, in their order.
    ///
    /// # Errors
    /// A parameter that the model does not have.
    pub fn of(&self, model: &Model) -> Result<Vec<PriorKnowledge>> {
        let mut out = vec![PriorKnowledge::NOTHING; model.terms.len()];
        for k in &self.parameter {
            let error = |problem: String| IdentError::of_file(&self.file, problem);
            let Some(i) = model.terms.iter().position(|t| t.name == k.name) else {
                let names: Vec<&str> = model.terms.iter().map(|t| t.name.as_str()).collect();
                return Err(error(format!(
                    "parameter {} is not among those that are identified here: {}",
                    k.name,
                    names.join(", ")
                )));
            };
            let mut term = model.terms[i].clone();
            if matches!(term.site, Site::Frame { .. }) {
                return Err(error(format!(
                    "parameter {}: a measuring frame comes from the measurements alone; expected another parameter",
                    k.name
                )));
            }
            // shown = offset + factor * value
            term.value = 0.0;
            let offset = shown(model, &term).value;
            let factor = crate::units::unit(&model.robot, &term).per_si;
            let si = |v: f64| (v - offset) / factor;
            let prior = k.value.zip(k.sd).map(|(value, sd)| Prior { value: si(value), sd: sd / factor.abs() });
            let [min, max] = if factor < 0.0 { [k.max, k.min] } else { [k.min, k.max] };
            out[i] =
                PriorKnowledge { prior, limits: [min.map_or(f64::NEG_INFINITY, si), max.map_or(f64::INFINITY, si)] };
        }
        Ok(out)
    }
}
