//! What a program does not say, and whoever compensates it does.

use trical_model::Support;

/// What whoever asks calls a setting in messages, and the value that it takes (`NAME`, or nothing): an option of the command line, a keyword of
/// Python. Settings are named as here and in [`crate::Job`]; by default messages have these names.
#[derive(Clone, Copy, Debug)]
pub struct Spelling(pub fn(setting: &str, value: &str) -> String);

impl Default for Spelling {
    fn default() -> Self {
        Self(|setting, _| setting.to_owned())
    }
}

impl Spelling {
    /// A setting that is named alone.
    #[must_use]
    pub fn of(self, setting: &str) -> String {
        (self.0)(setting, "")
    }

    /// A setting with a word for its value.
    #[must_use]
    pub fn with(self, setting: &str, value: &str) -> String {
        (self.0)(setting, value)
    }
}

/// What a program does not say.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the model file, for the mark.
    pub model_name: String,
    /// Tool of targets for which the program names none; without it, the cell's.
    pub tool: Option<String>,
    /// Frame of targets for which the program names none; without it, the robot's base.
    pub frame: Option<String>,
    /// Temperature at which the program runs, degC.
    pub temp_c: Option<f64>,
    /// Time at which it runs, s since the recording began; not given, what happened in the course of a session is left out.
    pub time_s: Option<f64>,
    /// When the program runs, in poses, for models of recordings without times.
    pub seq: Option<f64>,
    /// In which session of the model it runs, by its recording or its number (from 1), where `time_s` or `seq` says when; not given, the first in which
    /// something happened.
    pub session: Option<String>,
    /// Recordings that the model came from, one for each of its sessions.
    pub sessions: Vec<String>,
    /// Mass on the flange beyond the tool, kg.
    pub payload_kg: Option<f64>,
    /// Take the solution nearest to the target before where the arm has none in the configuration that the text demands; of ABB's targets always, as
    /// with the controller's check switched off.
    pub any_configuration: bool,
    /// Targets are meant in the arm's own base, wherever it stands: what was identified of the base is left out.
    pub own_base: bool,
    /// Keep a row for each target in the report.
    pub details: bool,
    /// What messages call these.
    pub spelling: Spelling,
    /// Joint angles at which the model was learnt; empty where nobody knows.
    pub visited: Support,
}
