//! What a diagnosis says, in the shape of the contract.

use serde::Serialize;
use trical_ident::HeldOut;
use trical_ident::dataset::{Dataset, Rejected};
use trical_ident::fit::identify::ErrorSummary;
use trical_ident::fit::noise::Noise;
use trical_ident::fit::priors::PriorKnowledge;
use trical_ident::model_file::{ModelFile, Uncertainty};
use trical_model::{Model, Place, Scope};

use crate::candidate::Candidate;
use crate::effect_id::EffectId;
use crate::effects::Family;
use crate::probability::Replicated;

/// A coefficient in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Coefficient {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Standard deviation.
    pub sd: Option<f64>,
    /// Of a sine or cosine: its cycles per turn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<f64>,
}

/// What speaks for a finding.
#[derive(Clone, Debug, Serialize)]
pub struct Evidence {
    /// BIC without it minus BIC with it.
    pub delta_bic: f64,
    /// F-test of its coefficients.
    pub p_value: f64,
    /// Held-out error with the more important findings, without this one.
    pub holdout_rms_before_mm: f64,
    /// And with it.
    pub holdout_rms_after_mm: f64,
    /// Error at the last quarter of the poses by a fit to those before, without this one.
    pub forward_rms_before_mm: f64,
    /// And with it.
    pub forward_rms_after_mm: f64,
}

/// Another explanation that the data cannot exclude.
#[derive(Clone, Debug, Serialize)]
pub struct Rival {
    /// Effect.
    pub effect: EffectId,
    /// Where.
    pub site: Place,
    /// By how much its BIC is worse.
    pub delta_bic: f64,
}

/// An effect that the data asks for.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Name in the catalogue.
    pub effect: EffectId,
    /// Where.
    pub site: Place,
    /// In words.
    pub located: String,
    /// What is sure where the name is not.
    pub family: Family,
    /// What of it goes to other sessions.
    pub scope: Scope,
    /// The session (from 1) in whose course it happened, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<u32>,
    /// Whether it is how two sessions differ: in which of them it is nobody knows.
    #[serde(skip)]
    pub between_two: bool,
    /// Probability that effect and site are right.
    pub confidence: f64,
    /// Probability that the place is right.
    pub place_confidence: f64,
    /// Probability that place and family are right.
    pub family_confidence: f64,
    /// How much it takes of the squared error that can be explained.
    pub share: f64,
    /// Whether parts of the data that have nothing in common say the same.
    pub replicated: Replicated,
    /// In a plain sentence.
    pub summary: String,
    /// What the owner of the arm can do.
    pub action: &'static str,
    /// Whether the model corrects it in other sessions: what belongs to the arm, and what goes with a temperature that can be stated.
    #[serde(skip)]
    pub corrected: bool,
    /// Length of its signature after projection, in units of the noise.
    pub lambda: f64,
    /// Coefficients.
    pub coefficients: Vec<Coefficient>,
    /// What speaks for it.
    pub evidence: Evidence,
    /// What else could look the same.
    pub rivals: Vec<Rival>,
    /// What to measure next to be surer.
    pub next_measurements: Option<String>,
}

/// What a diagnosis comes to. Nothing that is less than half sure is said as a fact.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// In plain sentences.
    pub summary: String,
    /// Share of the squared error that can be explained, of findings whose effect is more likely right than not.
    pub named_share: f64,
    /// And of the rest.
    pub unnamed_share: f64,
    /// What the owner of the arm can do.
    pub actions: Vec<String>,
    /// The same as a table: first the plain model, then one row for each claim, last the whole model.
    pub rows: Vec<VerdictRow>,
}

/// What a row of the verdict is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RowKind {
    /// The plain model, before anything was added.
    Plain,
    /// The model with everything that was found.
    Whole,
    /// A finding, or alike ones at several places.
    Finding,
    /// Curves without a name that the model has.
    Curves,
    /// What is too small or not sure enough for a row of its own.
    Rest,
    /// What is left and has no name.
    Unexplained,
}

/// A row of the verdict. Its errors are at poses that the fit did not see, mm rms. A row begins where the one before it ends: the
/// squared error is divided among the rows by what each finding took when it was added, the most important first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerdictRow {
    /// What it is about.
    pub kind: RowKind,
    /// The claim, at the finest level that is more likely right than not.
    pub text: String,
    /// What it may be in particular, or instead: "perhaps" a name that is less sure, "if not" the strongest rival.
    pub perhaps: Option<String>,
    /// The lowest and the highest probability of what the row says; `None` where it claims nothing.
    pub confidence: Option<[f64; 2]>,
    /// Error without it.
    pub before_mm: f64,
    /// And with it.
    pub after_mm: f64,
    /// What the owner of the arm can do.
    pub action: Option<&'static str>,
    /// Whether the extended model has it and programs are corrected for it.
    pub corrected: bool,
    /// Numbers of the findings that it sums up, counted from 1.
    pub findings: Vec<usize>,
}

/// An effect that this data set could not show at a typical size.
#[derive(Clone, Debug, Serialize)]
pub struct Blind {
    /// Effect.
    pub effect: EffectId,
    /// Where.
    pub site: Place,
    /// lambda of a typical size; 0 where the recordings lack what the effect depends on.
    pub lambda: f64,
    /// Why, where it cannot be tested at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lacks: Option<String>,
}

/// A mismatch for which the catalogue has no name.
#[derive(Clone, Debug, Serialize)]
pub struct Unexplained {
    /// Where.
    pub site: Place,
    /// On what it depends.
    pub variable: String,
    /// For which values.
    pub region: String,
    /// Size of the fitted curve at the tool, mm.
    pub rms_mm: f64,
    /// Held-out error without it.
    pub holdout_rms_before_mm: f64,
    /// And with it.
    pub holdout_rms_after_mm: f64,
    /// The free-form curve: pairs of variable and value.
    pub curve: Vec<(f64, f64)>,
    /// Units of the curve's two columns.
    pub curve_units: (String, String),
    /// Whether the extended model has this curve; if not, it only says where a mismatch is.
    pub modelled: bool,
}

/// The fit before anything was added.
#[derive(Clone, Debug, Serialize)]
pub struct Baseline {
    /// Arm parameters (base and tool included; measuring frames and targets of optical recordings are not counted).
    pub parameters: usize,
    /// Root of the mean square position error.
    pub rms_mm: f64,
    /// Noise that remains when everything that was found is modelled.
    pub noise_mm: f64,
    /// Probability of a residual structure as strong as the strongest found, were there none.
    pub lack_of_fit_p: f64,
    /// Held-out error.
    pub holdout_rms_mm: f64,
    /// Of several sessions, the errors of each by the arm that the others say.
    pub by_session: Option<ErrorSummary>,
    /// The same of each unknown place of the balls.
    pub by_place: Option<ErrorSummary>,
    /// What the readings' own noise made the fit do, in words.
    pub reading_noise: Vec<String>,
}

/// The fit with everything that was found.
#[derive(Clone, Debug, Serialize)]
pub struct Final {
    /// Arm parameters.
    pub parameters: usize,
    /// Root of the mean square position error.
    pub rms_mm: f64,
    /// Those of them that the data determine rather than their priors: effective degrees of freedom.
    pub effective_parameters: f64,
    /// Poses, and blocks of neighbouring ones: so many independent poses of the arm were measured.
    pub poses: usize,
    /// See [`trical_ident::fit::folds::Folds::blocks`].
    pub blocks: usize,
    /// Errors at poses that the fit did not see, each way that the data allow.
    pub held_out: HeldOut,
    /// Held-out error, in four folds that cut no block of neighbouring poses.
    pub holdout_rms_mm: f64,
    /// Mean held-out error.
    pub holdout_mean_mm: f64,
    /// Mean error of the last quarter of the poses, fitted on the first three.
    pub forward_mean_mm: f64,
    /// As in [`Baseline`], for what is left.
    pub lack_of_fit_p: f64,
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// What it comes to.
    pub verdict: Verdict,
    /// Before.
    pub baseline: Baseline,
    /// What was found, most important first.
    pub findings: Vec<Finding>,
    /// What this data could not show.
    pub blind_to: Vec<Blind>,
    /// Where a mismatch remains without a name.
    pub unexplained: Option<Unexplained>,
    /// Further ones.
    pub more_unexplained: Vec<Unexplained>,
    /// After.
    #[serde(rename = "final")]
    pub after: Final,
    /// What should make one look twice.
    pub cautions: Vec<String>,
    /// Rows that were rejected.
    pub rejected: Vec<Rejected>,
    /// The extended model.
    #[serde(skip)]
    pub model: Model,
    /// The data without them.
    #[serde(skip)]
    pub data: Dataset,
    /// How uncertain its terms are together.
    #[serde(skip)]
    pub uncertainty: Option<Uncertainty>,
    /// The baseline fit.
    #[serde(skip)]
    pub before: Model,
    /// For [`Diagnosis::undecided`].
    #[serde(skip)]
    pub grounds: Grounds,
}

impl Diagnosis {
    /// The extended model as a file.
    #[must_use]
    pub fn model_file(&self) -> ModelFile {
        ModelFile { uncertainty: self.uncertainty.clone(), ..ModelFile::of(self.model.clone(), &self.data) }
    }
}

/// What later questions about a diagnosis need to know, and nobody reads.
#[derive(Clone, Debug)]
pub struct Grounds {
    pub(crate) noise: Noise,
    /// Of the model's terms, in their order.
    pub(crate) known: Vec<PriorKnowledge>,
    /// For every finding, the candidates that it consists of, and the best candidate of each of its rivals.
    pub(crate) findings: Vec<(Vec<Candidate>, Vec<Candidate>)>,
    /// Standard deviation of a touch's scalar residual, m.
    pub(crate) sigma: f64,
}
