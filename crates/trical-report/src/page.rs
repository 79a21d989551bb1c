//! Reports: one self-contained HTML file each.

use std::path::Path;

use minijinja::value::Serde;
use minijinja::{Environment, context};
use serde::Serialize;
use sha2::{Digest, Sha256};
use trical_ident::ErrorSummary;

use crate::error::{Error, Result};
use crate::{plots, turn};

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
    /// Points of a list.
    pub list: Vec<String>,
    /// Tables; the first row is the header.
    pub tables: Vec<Vec<Vec<String>>>,
    /// Figures.
    pub figures: Vec<Figure>,
    /// Whether it is closed until somebody opens it; on paper it is open.
    pub folded: bool,
}

/// A file that a report was made from.
#[derive(Serialize)]
pub struct Input {
    /// As it was named on the command line.
    name: String,
    /// Its size.
    bytes: String,
    /// Hash of its bytes; why there is none, where it cannot be read twice.
    sha256: String,
}

/// What ends every report: version, command, inputs. No clock: the same inputs give the same bytes.
#[derive(Serialize)]
pub struct Made {
    version: &'static str,
    command: String,
    /// Further sentences.
    pub notes: Vec<String>,
    inputs: Vec<Input>,
}

impl Made {
    /// By this command, from these files, with their hashes.
    pub fn by(command: String, inputs: &[&Path]) -> Self {
        let inputs = inputs.iter().map(|p| input(p)).collect();
        Self { version: env!("CARGO_PKG_VERSION"), command, notes: Vec::new(), inputs }
    }

    /// The command.
    #[must_use]
    pub fn command(&self) -> &str {
        &self.command
    }

    /// Names of the inputs, and the SHA-256 of their bytes.
    pub fn hashes(&self) -> impl Iterator<Item = (&str, &str)> {
        self.inputs.iter().map(|i| (i.name.as_str(), i.sha256.as_str()))
    }
}

fn input(path: &Path) -> Input {
    // a URDF may carry its two links behind a #
    let named = path.to_string_lossy();
    let file = named.split_once('#').filter(|_| !path.exists()).map_or(path, |(file, _)| Path::new(file));
    let hashed = || -> std::io::Result<(u64, String)> {
        if !file.metadata()?.is_file() {
            return Err(std::io::Error::other("not a file"));
        }
        let mut hash = Sha256::new();
        let bytes = std::io::copy(&mut std::fs::File::open(file)?, &mut hash)?;
        Ok((bytes, hash.finalize().iter().map(|b| format!("{b:02x}")).collect()))
    };
    let (bytes, sha256) =
        hashed().map_or_else(|e| ("-".to_owned(), format!("not read again: {e}")), |(n, h)| (n.to_string(), h));
    Input { name: named.into_owned(), bytes, sha256 }
}

/// Puts a report together.
pub fn render(title: &str, verdict: &str, sections: &[Section], made: &Made) -> Result<String> {
    // the library is carried by those who have something to draw with it
    let live = sections.iter().flat_map(|s| &s.figures).any(|f| f.svg.contains(plots::LIVE));
    let turning = sections.iter().flat_map(|s| &s.figures).any(|f| f.svg.contains(turn::OPEN));
    let mut env = Environment::new();
    // the name ends in .html, so that text is escaped
    env.add_template("report.html", include_str!("../assets/report.html"))
        .and_then(|()| env.get_template("report.html"))
        .and_then(|t| {
            let (sections, made) = (Serde(sections), Serde(made));
            let uplot_css = if live { include_str!("../assets/uPlot.min.css") } else { "" };
            let (uplot_js, report_js) =
                (include_str!("../assets/uPlot.iife.min.js"), include_str!("../assets/report.js"));
            let turn_js = include_str!("../assets/turn.js");
            let uplot_license = include_str!("../assets/uPlot.LICENSE");
            t.render(context! { title, verdict, sections, made, live, turning, turn_js, uplot_css, uplot_license, uplot_js, report_js })
        })
        .map_err(|e| Error::Failed(format!("the report could not be written: {e}")))
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
