//! The one report of the demo: what was concealed, what was found, and how far each model misses.

use nalgebra::Vector3;
use trical_diagnose::Diagnosis;
use trical_ident::{ErrorSummary, Identified};
use trical_model::{Joints, Model};
use trical_report::figures::plots::{self, AFTER, BEFORE, Series};
use trical_report::page::{Figure, Section, error_table, render as page};
use trical_report::plan_summary::PlanSummary;
use trical_report::{Made, diagnosis_report, plan_report};

use crate::commands::identify::parameter_rows;
use crate::error::Result;

/// Models that were made from the touches.
pub struct Models {
    /// The nominal arm, base and tool identified.
    pub nominal: Model,
    /// Plain calibration.
    pub plain: Identified,
    /// With what the diagnosis found; the plain one where it found nothing.
    pub best: Model,
    /// What it says.
    pub diagnosis: Diagnosis,
}

impl Models {
    /// Whether the diagnosis added anything.
    pub fn found(&self) -> bool {
        !(self.diagnosis.findings.is_empty() && self.diagnosis.unexplained.is_none())
    }
}

/// Errors of the TCP at some poses, m: nominal arm, plain calibration, best model, against the true arm.
pub struct Scored {
    /// Where.
    pub name: &'static str,
    /// Joints.
    pub poses: Vec<Joints>,
    /// Where the true arm's TCP is, m.
    pub places: Vec<Vector3<f64>>,
    /// Of the three models.
    pub errors: [Vec<f64>; 3],
}

/// What was concealed, from the sealed file, and what the diagnosis said, in one sentence each.
pub struct Seal {
    /// The truth.
    pub sealed: String,
    /// The claim.
    pub said: String,
}

/// A table of the models' errors.
pub fn error_rows(models: &Models, scores: &[Scored]) -> Vec<Vec<String>> {
    let names = ["nominal arm", "plain model", "with what was found"];
    let shown = if models.found() { 3 } else { 2 };
    let mut rows: Vec<(String, ErrorSummary)> = Vec::new();
    for s in scores {
        let each = names.iter().zip(&s.errors).take(shown);
        rows.extend(each.map(|(model, e)| (format!("{}, {model}", s.name), ErrorSummary::of(e))));
    }
    error_table(&rows.iter().map(|(name, e)| (name.as_str(), e)).collect::<Vec<_>>())
}

/// Errors of two models against `x`, or of the second alone.
fn against(label: &str, x: &[f64], s: &Scored, models: &[(&'static str, usize)]) -> Result<String> {
    let colors = if models.len() > 1 { &[BEFORE, AFTER][..] } else { &[AFTER] };
    let series: Vec<Series> = models
        .iter()
        .zip(colors)
        .map(|((name, model), color)| Series {
            name,
            color: *color,
            points: x.iter().zip(&s.errors[*model]).map(|(x, e)| (*x, e * 1e3)).collect(),
        })
        .collect();
    Ok(plots::scatter(label, "position error, mm", true, false, &series)?)
}

fn errors(models: &Models, scores: &[Scored; 2]) -> Result<Section> {
    let [sphere, whole] = scores;
    let q2: Vec<f64> = whole.poses.iter().map(|q| q[1].to_degrees()).collect();
    let count = f64::from(u32::try_from(sphere.places.len().max(1)).unwrap_or(1));
    let middle = sphere.places.iter().sum::<Vector3<f64>>() / count;
    let distance: Vec<f64> = whole.places.iter().map(|p| (p - middle).norm() * 1e3).collect();
    let lowest = models.plain.data.observations.iter().map(|o| o.state.q[1].to_degrees()).fold(f64::INFINITY, f64::min);
    let (pair, last) = if models.found() {
        ([("plain model", 1), ("with what was found", 2)], ("with what was found", 2))
    } else {
        ([("nominal arm", 0), ("plain model", 1)], ("plain model", 1))
    };
    let (by_q2, by_distance) = ("angle of joint 2, deg", "distance from the sphere's centre, mm");
    Ok(Section::new("Position error at poses that were never measured")
        .with_text([
            "At 100 poses in a sphere of 400 mm diameter and at 500 in the whole workspace, against the true arm. The nominal arm has base and \
             tool identified.",
        ])
        .with_tables([error_rows(models, scores)])
        .with_figures([
            Figure::new("Error against joint 2, whole workspace.", against(by_q2, &q2, whole, &pair)?),
            Figure::new(
                "Error against the distance from the sphere's centre, whole workspace.",
                against(by_distance, &distance, whole, &pair)?,
            ),
            Figure::new(
                format!(
                    "The best model alone, against joint 2. The touches reached down to {lowest:.0} deg: below, the model extrapolates."
                ),
                against(by_q2, &q2, whole, &[last])?,
            ),
            Figure::new(
                "The best model alone, against the distance from the centre.",
                against(by_distance, &distance, whole, &[last])?,
            ),
        ]))
}

fn touches(models: &Models, summary: &PlanSummary) -> Result<Section> {
    let fitted = &models.plain;
    let residuals: Vec<(f64, f64)> = fitted
        .errors()?
        .iter()
        .enumerate()
        .map(|(k, e)| (f64::from(u32::try_from(k + 1).unwrap_or(0)), e * 1e3))
        .collect();
    let mut figures = plan_report::pictures(&fitted.model.robot, &fitted.model.cell, summary)?;
    figures.truncate(1);
    let series = [Series { name: "residual", color: AFTER, points: residuals }];
    let plot = plots::scatter("touch", "residual, mm", true, false, &series)?;
    figures.push(Figure::new("What the plain model leaves of each touch.", plot));
    Ok(Section::new("The touches")
        .with_text([format!("{} touches, in the order of measurement.", fitted.data.observations.len())])
        .with_figures(figures))
}

/// The whole report; `driven` has the errors of the program's targets as written and as compensated.
pub fn render(
    models: &Models,
    seal: &Seal,
    scores: &[Scored; 2],
    driven: &[ErrorSummary; 2],
    summary: &PlanSummary,
    made: &Made,
) -> Result<String> {
    let best = if models.found() { 2 } else { 1 };
    let mean = |model: usize| ErrorSummary::of(&scores[1].errors[model]).mean_mm;
    let steps = if models.found() { format!(", with what was found {:.3} mm", mean(best)) } else { String::new() };
    let said = format!(
        "Concealed in the arm: {}. Found by the diagnosis: {}. Mean position error in the whole workspace, after {} touches of three \
         balls: nominal arm {:.3} mm, plain model {:.3} mm{steps}.",
        seal.sealed,
        seal.said,
        models.plain.data.observations.len(),
        mean(0),
        mean(1),
    );
    let mut sections = vec![diagnosis_report::verdict_section(&models.diagnosis)];
    for (k, f) in models.diagnosis.findings.iter().take(2).enumerate() {
        sections.push(diagnosis_report::finding_section(k + 1, f, &models.diagnosis)?);
    }
    sections.push(errors(models, scores)?);
    sections.push(
        Section::new("A program, rewritten")
            .with_text([
                "The targets of sample.mod, driven on the virtual arm as they were written, and as compensated.",
            ])
            .with_tables([error_table(&[("as written", &driven[0]), ("compensated", &driven[1])])]),
    );
    sections.push(touches(models, summary)?);
    sections.push(
        Section::new("Parameters of the plain model")
            .with_text([
                "Nominal, identified, and standard deviation. alpha_k and a_k lie between axes k and k+1; rotations of the base are what is \
                 added to cell.toml.",
            ])
            .with_tables([parameter_rows(&models.plain)]),
    );
    Ok(page("TriCal: calibration and diagnosis of a virtual cell", &said, &sections, made)?)
}
