//! Reports: one self-contained HTML file each.

use minijinja::value::Serde;
use minijinja::{Environment, context};
use serde::Serialize;
use trical_ident::{Diagnosis, ErrorSummary, JointSource};
use trical_model::Forward;

use crate::commands::diagnose::site_words;
use crate::error::{CliError, Result};
use crate::plots::{self, AFTER, BEFORE, Series};

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

/// The variable that reveals an effect at a site, for the before and after figure.
fn revealing(effect: &str, site: &serde_json::Value, d: &Diagnosis) -> (String, Vec<f64>) {
    let joint =
        site.get("joint").and_then(serde_json::Value::as_u64).and_then(|j| usize::try_from(j).ok()).unwrap_or(1);
    let o = &d.data.observations;
    let time = || o.iter().map(|o| o.state.t.unwrap_or(0.0) / 60.0).collect();
    match effect {
        "lost_motion_direction" | "load_friction" => (
            format!("sense of joint {joint}'s last motion (scattered a little)"),
            o.iter()
                .enumerate()
                .map(|(k, o)| {
                    let spread = f64::from(u32::try_from(k * 37 % 100).unwrap_or(0)) / 400.0 - 0.125;
                    o.state.dir.map_or(0.0, |d| f64::from(d[joint - 1])) + spread
                })
                .collect(),
        ),
        "joint_zero_shift" | "fixture_shift" | "fixture_drift" | "tool_shift" | "tool_drift" | "frame_drift"
        | "indicator_drift" => ("time, min".into(), time()),
        "thermal_growth" | "thermal_zero_drift" => {
            ("temperature, degC".into(), o.iter().map(|o| o.state.temp_c.unwrap_or(0.0)).collect())
        }
        "nonlinear_stiffness" | "lost_motion_gravity" | "cross_axis_compliance" => {
            let torque = Forward::new(d.model.clone(), Vec::new()).map(|f| {
                let mut ws = f.workspace();
                o.iter()
                    .map(|o| f.gravity_torques(&o.state, &mut ws).map_or(0.0, |t| t[joint - 1]))
                    .collect::<Vec<f64>>()
            });
            (format!("gravity torque about joint {joint}, Nm"), torque.unwrap_or_default())
        }
        "late_joint_reading" => (
            format!("commanded minus read angle of joint {joint}, deg"),
            o.iter()
                .map(|o| o.state.q_commanded.map_or(0.0, |c| (c[joint - 1] - o.state.q[joint - 1]).to_degrees()))
                .collect(),
        ),
        _ => (format!("angle of joint {joint}, deg"), o.iter().map(|o| o.state.q[joint - 1].to_degrees()).collect()),
    }
}

/// The report of a diagnosis.
pub fn diagnosis(d: &Diagnosis, source: JointSource) -> Result<String> {
    let before = Forward::new(d.before.clone(), Vec::new())?;
    let after = Forward::new(d.model.clone(), Vec::new())?;
    let mm = |f: &Forward| -> Vec<f64> {
        trical_ident::fit::position_errors(f, &d.data).into_iter().map(|e| e * 1e3).collect()
    };
    let (errors_before, errors_after) = (mm(&before), mm(&after));
    let verdict = if d.findings.is_empty() && d.unexplained.is_none() {
        format!(
            "The model explains the data: {} parameters leave {:.4} mm, and nothing else earns its place.",
            d.baseline.parameters, d.baseline.rms_mm
        )
    } else {
        let names: Vec<String> =
            d.findings.iter().take(4).map(|f| format!("{} at {}", f.effect, site_words(&f.site))).collect();
        format!(
            "The model lacked {}{}. Modelled, the error on poses that the fit did not see falls from {:.4} to {:.4} mm rms.",
            if names.is_empty() { "something without a name".to_owned() } else { names.join(", ") },
            if d.findings.len() > 4 { format!(" and {} more", d.findings.len() - 4) } else { String::new() },
            d.baseline.holdout_rms_mm,
            d.after.holdout_rms_mm
        )
    };
    let mut stairs = vec![d.baseline.holdout_rms_mm];
    stairs.extend(d.findings.iter().map(|f| f.evidence.holdout_rms_after_mm));
    let mut table = vec![
        ["", "effect", "site", "sure", "lambda", "held out before", "after, mm", "could also be"]
            .map(String::from)
            .to_vec(),
    ];
    for (k, f) in d.findings.iter().enumerate() {
        table.push(vec![
            format!("{}", k + 1),
            f.effect.clone(),
            site_words(&f.site),
            format!("{:.0} %", f.confidence * 100.0),
            format!("{:.1}", f.lambda),
            format!("{:.4}", f.evidence.holdout_rms_before_mm),
            format!("{:.4}", f.evidence.holdout_rms_after_mm),
            f.rivals.iter().map(|r| format!("{} at {}", r.effect, site_words(&r.site))).collect::<Vec<_>>().join(", "),
        ]);
    }
    let mut overview = Section {
        heading: "What was found".into(),
        text: d.baseline.reading_noise.iter().map(|r| format!("Note on the readings: {r}.")).collect(),
        ..Section::default()
    };
    if d.findings.is_empty() {
        overview.text.push("No effect of the catalogue earns its place.".into());
    } else {
        overview.tables.push(table);
        overview.figures.push(Figure {
            caption: "Error on held-out poses as the findings are added one by one.".into(),
            svg: plots::staircase("held-out error, mm rms", &stairs)?,
        });
    }
    let mut sections = vec![overview];
    for f in d.findings.iter().take(12) {
        let (label, x) = revealing(&f.effect, &f.site, d);
        let points = |e: &[f64]| x.iter().copied().zip(e.iter().copied()).collect();
        let series = [
            Series { name: "before", color: BEFORE, points: points(&errors_before) },
            Series { name: "after", color: AFTER, points: points(&errors_after) },
        ];
        let values: Vec<String> = f
            .coefficients
            .iter()
            .map(|c| {
                format!(
                    "{} = {:.3e} {}{}",
                    c.name,
                    c.value,
                    c.unit,
                    c.sd.map_or_else(String::new, |s| format!(" (sd {s:.1e})"))
                )
            })
            .collect();
        sections.push(Section {
            heading: format!("{} at {}", f.effect, site_words(&f.site)),
            text: vec![format!("{}. {}.", f.located, values.join("; "))],
            figures: vec![Figure {
                caption:
                    "Each point is one measurement: before, with the baseline; after, with everything that was found."
                        .into(),
                svg: plots::scatter(&label, "position error, mm", true, false, &series)?,
            }],
            ..Section::default()
        });
    }
    for u in d.unexplained.iter().chain(&d.more_unexplained).take(4) {
        sections.push(Section {
            heading: format!("Without a name: {}", site_words(&u.site)),
            text: vec![format!(
                "{} is off for {}, and no effect of the catalogue says why. A free curve takes the held-out error from {:.4} to {:.4} mm.",
                site_words(&u.site), u.region, u.holdout_rms_before_mm, u.holdout_rms_after_mm
            )],
            figures: vec![Figure {
                caption: "The curve that was fitted.".into(),
                svg: plots::scatter(
                    &format!("{}, {}", u.variable, u.curve_units.0),
                    &format!("correction, {}", u.curve_units.1),
                    false,
                    true,
                    &[Series { name: "curve", color: AFTER, points: u.curve.clone() }],
                )?,
            }],
            ..Section::default()
        });
    }
    let mut blind = vec![["effect", "site", "lambda of a typical size", "lacks"].map(String::from).to_vec()];
    for b in &d.blind_to {
        blind.push(vec![
            b.effect.clone(),
            site_words(&b.site),
            format!("{:.2}", b.lambda),
            b.lacks.clone().unwrap_or_default(),
        ]);
    }
    sections.push(Section {
        heading: "What this data could not show".into(),
        text: vec![
            "An effect of typical size at these sites would leave less than three standard deviations in this data \
             (lambda below 3): that it was not found says nothing."
                .into(),
            "On one arm a scale error of the measuring frame (all lengths together) cannot be told from the arm's own size."
                .into(),
        ],
        tables: vec![blind],
        ..Section::default()
    });
    if !d.rejected.is_empty() {
        let mut rows = vec![["recording", "line", "why"].map(String::from).to_vec()];
        rows.extend(
            d.rejected.iter().take(200).map(|r| vec![r.recording.clone(), r.line.to_string(), r.reason.clone()]),
        );
        sections.push(Section {
            heading: "Rows that were not believed".into(),
            tables: vec![rows],
            ..Section::default()
        });
    }
    let mut foot = footer(&d.data.names);
    foot.push(format!("joints: {source:?}").to_lowercase());
    render("TriCal: diagnosis", &verdict, &sections, &foot)
}
