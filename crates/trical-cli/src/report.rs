//! Reports: one self-contained HTML file each.

use minijinja::value::Serde;
use minijinja::{Environment, context};
use serde::Serialize;
use trical_ident::ErrorSummary;

use crate::error::{CliError, Result};

/// A figure.
#[derive(Serialize)]
pub struct Figure {
    /// What one sees.
    pub caption: String,
    /// The picture.
    pub svg: String,
}

/// A section.
#[derive(Default, Serialize)]
pub struct Section {
    /// Heading.
    pub heading: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Tables; the first row is the header.
    pub tables: Vec<Vec<Vec<String>>>,
    /// Figures.
    pub figures: Vec<Figure>,
}

/// Puts a report together.
pub fn render(title: &str, verdict: &str, sections: &[Section], footer: &[String]) -> Result<String> {
    let mut env = Environment::new();
    // the name ends in .html, so that text is escaped
    env.add_template("report.html", include_str!("../assets/report.html"))
        .and_then(|()| env.get_template("report.html"))
        .and_then(|t| {
            let (sections, footer) = (Serde(sections), Serde(footer));
            t.render(context! { title, verdict, sections, footer })
        })
        .map_err(|e| CliError::Failed(format!("the report could not be written: {e}")))
}

/// The lines that end every report.
pub fn footer(inputs: &[String]) -> Vec<String> {
    vec![
        format!("TriCal {}; inputs: {}", env!("CARGO_PKG_VERSION"), inputs.join(", ")),
        format!("made by: trical {}", std::env::args().skip(1).collect::<Vec<_>>().join(" ")),
    ]
}

/// Rows of a before and after table.
pub fn error_table(rows: &[(&str, &ErrorSummary)]) -> Vec<Vec<String>> {
    let mut out = vec![["position error, mm", "mean", "max", "sd", "median", "rms"].map(String::from).to_vec()];
    for (name, e) in rows {
        let mut row = vec![(*name).to_owned()];
        row.extend([e.mean_mm, e.max_mm, e.sd_mm, e.median_mm, e.rms_mm].map(|v| format!("{v:.3}")));
        out.push(row);
    }
    out
}
