//! Reports: one self-contained HTML file each.

use trical_ident::{Diagnosis, JointSource};

use crate::error::Result;

/// The report of a diagnosis.
pub fn diagnosis(d: &Diagnosis, source: JointSource) -> Result<String> {
    let _ = source;
    Ok(format!("<html><body><pre>{}</pre></body></html>", serde_json::to_string_pretty(d)?))
}
