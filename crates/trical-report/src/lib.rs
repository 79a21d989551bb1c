//! What TriCal tells people: reports, pictures, plans in words, maps of errors, simulated studies.
//!
//! The command line and the Python package both end here, so that they say the same. Nothing here knows of either: no arguments,
//! no terminal, no interpreter.
//!
//! | module | holds |
//! |---|---|
//! | [`page`] | a report as one HTML file: sections, tables, figures, how it was made |
//! | [`identify_report`], [`validate_report`], [`diagnosis_report`], [`plan_report`], [`history_report`] | what each says |
//! | [`certificate`] | one page to sign: accuracy and repeatability before and after |
//! | [`evidence`] | what reports of fits share: errors one by one, where it was measured, rejected rows, parameters |
//! | [`finding_figures`], [`heat_map`] | the curve or the spectrum of a finding; the error map as pictures |
//! | [`figures`] | figures as SVG: plots, the cell with arm, poses and marks, where on the arm findings are |
//! | [`verdict_summary`], [`effect_names`] | a diagnosis in a few lines; which effect someone means |
//! | [`plan_summary`], [`detectability`], [`deciding`] | a plan in words and JSON; what it would not show; touches that decide |
//! | [`error_map`], [`export`] | how far an arm misses all over its workspace; the calibrated arm for other programs |
//! | [`study`] | whole calibrations by simulation; what places of sockets are worth |
//! | [`table`] | tables and paragraphs for a terminal |

#![allow(clippy::disallowed_methods, reason = "what is drawn and told needs no more digits than anybody sees")]

pub mod certificate;
pub mod deciding;
pub mod detectability;
pub mod diagnosis_report;
pub mod effect_names;
pub mod error;
pub mod error_map;
pub mod evidence;
pub mod export;
pub mod figures;
pub mod finding_figures;
pub mod heat_map;
pub mod history_report;
pub mod identify_report;
pub mod page;
pub mod plan_report;
pub mod plan_summary;
pub mod study;
pub mod table;
#[cfg(test)]
mod test_data;
pub mod validate_report;
pub mod verdict_summary;

pub use error::{Error, Result};
pub use error_map::ErrorMap;
pub use export::{Export, Outputs};
pub use page::Made;
