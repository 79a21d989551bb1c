//! What is asked of a diagnosis.

use trical_ident::calibration::ToolSharing;
use trical_ident::dataset::JointSource;
use trical_ident::fit::priors::KnownParameters;

/// What is asked of a diagnosis.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which joint angles to use; `None`: as read and as commanded, and what leaves less, held out.
    pub joints: Option<JointSource>,
    /// What has no name is told but not modelled.
    pub names_only: bool,
    /// Which sessions share a tool.
    pub tool: ToolSharing,
    /// What is known of the plain model's parameters beforehand. Where it is surer than the measurements are, the search takes a parameter
    /// as known; in the exact fits it is a prior.
    pub known: KnownParameters,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            joints: Some(JointSource::Read),
            names_only: false,
            tool: ToolSharing::FromData,
            known: KnownParameters::default(),
        }
    }
}
