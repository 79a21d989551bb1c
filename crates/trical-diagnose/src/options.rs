//! What is asked of a diagnosis.

use trical_ident::calibration::ToolSharing;
use trical_ident::dataset::JointSource;

/// What is asked of a diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Which joint angles to use; `None`: as read and as commanded, and what leaves less, held out.
    pub joints: Option<JointSource>,
    /// What has no name is told but not modelled.
    pub names_only: bool,
    /// Which sessions share a tool.
    pub tool: ToolSharing,
}

impl Default for Options {
    fn default() -> Self {
        Self { joints: Some(JointSource::Read), names_only: false, tool: ToolSharing::FromData }
    }
}
