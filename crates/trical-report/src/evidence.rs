//! What the reports of identify and validate share: errors one by one, the arm with what was measured, rejected rows, parameters
//! with intervals.

use std::collections::BTreeSet;

use nalgebra::{Vector3, Vector6};
use statrs::distribution::{ContinuousCDF, StudentsT};
use trical_ident::{Dataset, ErrorSummary, JointSource, Noise, Observation, Rejected, shown};
use trical_model::{Forward, Joint, Joints, MAX_JOINTS, Measured, Model, Robot, Term};
use trical_plan::{CollisionModel, PlanEntry};

use crate::error::Result;
use crate::figures::picture::{self, Mark, Scene, View};
use crate::figures::plots::{self, AFTER, BEFORE, Series, span};
use crate::figures::turning_scene;
use crate::heat_map;
use crate::page::{Figure, Section};
use crate::table;

/// So many marks and arms in the picture of the cell.
const MARKS: usize = 250;
const ARMS: usize = 45;

/// So many rejected rows are listed.
const ROWS: usize = 500;

/// Errors at some data, one by one.
pub struct Errors<'a> {
    /// The model whose errors `after` are.
    pub model: &'a Model,
    /// Where.
    pub data: &'a Dataset,
    /// What came before it, "the nominal arm".
    pub was: &'a str,
    /// The errors of that, m; none where nothing came before.
    pub before: &'a [f64],
    /// Of the model, m.
    pub after: &'a [f64],
}

/// Cells of a row.
pub fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(String::from).to_vec()
}

/// Residuals of an observation: up to three lengths in m, and of a pose three angles in rad.
pub fn six(model: &Model, data: &Dataset) -> Result<Vec<Vector6<f64>>> {
    let forward = Forward::new(model.clone(), Vec::new())?;
    let mut ws = forward.workspace();
    let of = |o: &Observation| {
        let rows = forward.residual(&o.state, &o.measured, o.frame, &mut ws);
        Vector6::from_fn(|k, _| if k < rows { ws.residual()[k] } else { 0.0 })
    };
    Ok(data.observations.iter().map(of).collect())
}

/// Residuals of positions and lengths, mm.
pub fn residuals(model: &Model, data: &Dataset) -> Result<Vec<Vector3<f64>>> {
    Ok(six(model, data)?.iter().map(|r| r.fixed_rows::<3>(0) * 1e3).collect())
}

/// Where a row is: its line in a file of lines, its number in any other.
fn line_or_row(line: usize, row: usize) -> String {
    if line > 0 { format!("line {line}") } else { format!("row {row}") }
}

/// "run.csv, line 12, ball 2" for an observation; of one recording alone "line 12, ball 2".
pub fn where_measured(data: &Dataset, k: usize) -> String {
    let Some(o) = data.observations.get(k) else { return String::new() };
    let what = o.measured.of_which().map_or_else(String::new, |(what, k)| format!(", {what} {}", k + 1));
    // one recording need not be named at each of its points
    let recording = data.names.get(o.recording).filter(|_| data.names.len() > 1);
    format!("{}{}{what}", recording.map_or_else(String::new, |r| format!("{r}, ")), line_or_row(o.line, o.row))
}

/// The pose nearest to the middle of them all.
pub fn typical(poses: &[Joints]) -> Joints {
    let middle = poses.iter().fold([0.0; MAX_JOINTS], |mut sum, q| {
        for (s, q) in sum.iter_mut().zip(q) {
            *s += q / poses.len() as f64;
        }
        sum
    });
    let off = |q: &Joints| q.iter().zip(&middle).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    poses.iter().min_by(|a, b| off(a).total_cmp(&off(b))).copied().unwrap_or(middle)
}

impl Errors<'_> {
    fn name(&self, k: usize) -> String {
        where_measured(self.data, k)
    }

    /// Errors against `x`, before and after.
    fn against(&self, label: &str, x: impl Fn(usize) -> f64) -> Result<String> {
        let points = |e: &[f64]| e.iter().enumerate().map(|(k, e)| (x(k), e * 1e3)).collect();
        let mut series = vec![Series { name: "after", color: AFTER, points: points(self.after) }];
        if !self.before.is_empty() {
            series.insert(0, Series { name: "before", color: BEFORE, points: points(self.before) });
        }
        let names: Vec<String> = (0..self.after.len()).map(|k| self.name(k)).collect();
        plots::scatter_named(label, "position error, mm", true, false, &series, &names)
    }

    /// Error of every measurement, their distribution, and the residuals along each axis.
    pub fn section(&self) -> Result<Section> {
        let number = |k: usize| (k + 1) as f64;
        let names: Vec<String> = (0..self.after.len()).map(|k| self.name(k)).collect();
        let only: Vec<(f64, f64)> = self.after.iter().enumerate().map(|(k, e)| (number(k), e * 1e3)).collect();
        let mm: Vec<f64> = self.after.iter().map(|e| e * 1e3).collect();
        let label = "measurement, in the order of recording";
        let one = |name, points| [Series { name, color: AFTER, points }];
        let mut figures = vec![
            Figure::new(
                format!("Each measurement before ({}) and after calibration.", self.was),
                self.against(label, number)?,
            ),
            Figure::new(
                "After calibration only. A trend or a step within a recording says that something changed while measuring.",
                plots::scatter_named(label, "position error, mm", true, false, &one("after", only), &names)?,
            ),
            Figure::new(
                "Histogram of the errors after calibration. A second peak or a long tail is not noise.",
                plots::histogram("position error, mm", &mm)?,
            ),
        ];
        if self.before.is_empty() {
            figures.remove(0);
        }
        let residuals = residuals(self.model, self.data)?;
        let lengths_only = self.data.observations.iter().all(|o| matches!(o.measured, Measured::Distance { .. }));
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate().take(if lengths_only { 1 } else { 3 }) {
            let points = residuals.iter().enumerate().map(|(k, r)| (number(k), r[axis])).collect();
            let along = if lengths_only { "residual, mm".to_owned() } else { format!("residual along {name}, mm") };
            let axes = if lengths_only { "" } else { " (axes of the cell for touches, of the instrument for points)" };
            figures.push(Figure::new(
                format!("{}{axes}, after.", along.replacen('r', "R", 1)),
                plots::scatter_named(label, &along, false, false, &one("after", points), &names)?,
            ));
        }
        Ok(Section::new("Errors one by one").with_figures(figures))
    }

    /// Errors against each joint.
    pub fn by_joint(&self) -> Result<Section> {
        let o = &self.data.observations;
        let figure = |(joint, j): (usize, &Joint)| -> Result<Figure> {
            let (per_si, unit) = j.kind.unit();
            let label = format!("joint {}, {unit}", joint + 1);
            Ok(Figure::new(
                format!("Against joint {}.", joint + 1),
                self.against(&label, |k| o[k].state.q[joint] * per_si)?,
            ))
        };
        let figures = self.model.robot.joints.iter().enumerate().map(figure).collect::<Result<Vec<_>>>()?;
        Ok(Section::new("Errors against the joints").with_figures(figures))
    }

    /// The arm, the balls, and where the tool was at each measurement.
    pub fn pictures(&self) -> Result<Vec<Section>> {
        let heading = "Where it was measured".to_owned();
        let mut cell = self.model.cell.clone();
        if !cell.balls_fix_base(|_| true) {
            // such as sockets, which stood anywhere
            cell.balls.clear();
        }
        let solids = match CollisionModel::new(&self.model.robot, &cell) {
            Ok(solids) => solids,
            Err(e) => {
                return Ok(vec![Section::new(heading).with_text([format!("No picture: {e}.")])]);
            }
        };
        let o = &self.data.observations;
        let forward = Forward::new(self.model.clone(), Vec::new())?;
        let mut ws = forward.workspace();
        let largest = self.after.iter().copied().fold(1e-12, f64::max);
        let step = o.len().div_ceil(MARKS).max(1);
        // the largest error lies on top
        let mut shown: Vec<usize> = (0..o.len()).step_by(step).collect();
        shown.sort_by(|a, b| self.after[*a].total_cmp(&self.after[*b]));
        let marks: Vec<Mark> = shown
            .into_iter()
            .map(|k| Mark {
                place: forward.world_from_tool(&o[k].state, &mut ws).translation,
                color: shade(self.after[k] / largest),
                title: format!("{}: {:.4} mm", self.name(k), self.after[k] * 1e3),
            })
            .collect();
        let touched: Vec<usize> = (0..o.len()).filter(|k| matches!(o[*k].measured, Measured::Touch { .. })).collect();
        let arms: Vec<PlanEntry> = touched
            .iter()
            .step_by(touched.len().div_ceil(ARMS).max(1))
            .map(|k| PlanEntry {
                index: *k,
                ball: if let Measured::Touch { ball, .. } = o[*k].measured { ball } else { 0 },
                joints: o[*k].state.q,
                approach: o[*k].state.q,
                via: Vec::new(),
            })
            .collect();
        let poses: Vec<Joints> = o.iter().map(|o| o.state.q).collect();
        let scene = Scene { model: &solids, touches: &arms, marks: &marks, shown: typical(&poses), sphere: None };
        let mut caption = format!(
            "The arm at one of the measured poses. Each dot is where the tool was at a measurement, blue for a small error after \
             calibration to red for the largest ({:.3} mm); where several lie on each other, {} is on top.",
            largest * 1e3,
            // touches all end at a ball
            if touched.len() == o.len() { "as at each ball, the largest" } else { "the largest" }
        );
        if !arms.is_empty() {
            caption += " Thin lines are the arm at the touches, each in the colour of its ball.";
        }
        if step > 1 {
            caption += &format!(" One in {step} of {} measurements is drawn.", o.len());
        }
        Ok(vec![
            Section::new(heading)
                .with_text(["The model was tested only between the lowest and the highest angle of each joint \
                 below; beyond them it extrapolates."])
                .with_tables([coverage(&self.model.robot, &poses)])
                .with_figures([Figure::new(caption, turning_scene::draw_turning(&scene, 900.0)?)]),
            other_views(&scene).folded(true),
            heat_map::section(self.model)?,
        ])
    }
}

/// The cell from above and from the side.
pub fn other_views(scene: &Scene<'_>) -> Section {
    let view = |caption, view| Figure::new(caption, picture::draw(scene, view, 620.0));
    Section::new("From above and from the side")
        .with_figures([view("From above.", View::Above), view("From the side.", View::Side)])
}

/// From blue over grey to red.
fn shade(part: f64) -> String {
    let [low, high] = [[38.0, 102.0, 165.0], [200.0, 70.0, 50.0]];
    let mix = |k: usize| low[k] + (high[k] - low[k]) * part.clamp(0.0, 1.0);
    format!("rgb({:.0},{:.0},{:.0})", mix(0), mix(1), mix(2))
}

/// How much of each joint's range was used.
fn coverage(robot: &Robot, poses: &[Joints]) -> Vec<Vec<String>> {
    let mut rows = vec![row(["joint", "lowest", "highest", "limits", "part of the range"])];
    for (k, joint) in robot.joints.iter().enumerate() {
        let (low, high) = span(poses.iter().map(|q| q[k]));
        let part = (high - low) / (joint.limits[1] - joint.limits[0]) * 100.0;
        let mut cells = used(robot, k, (low, high));
        cells.push(if part.is_finite() { format!("{part:.0} %") } else { "-".into() });
        rows.push(cells);
    }
    rows
}

/// Cells of a joint: its number, the lowest and highest position, its limits.
pub fn used(robot: &Robot, joint: usize, (low, high): (f64, f64)) -> Vec<String> {
    let Joint { kind, limits, .. } = &robot.joints[joint];
    let (per_si, unit) = kind.unit();
    let show = |x: f64| format!("{} {unit}", table::fixed(x * per_si, 0));
    vec![(joint + 1).to_string(), show(low), show(high), format!("{} to {}", show(limits[0]), show(limits[1]))]
}

/// Rejected rows that follow each other for one reason are told together: where they are, how many they are, and the first of them.
pub fn rejected_together(named: &[Rejected]) -> Vec<(String, usize, &Rejected)> {
    let follows = |a: &Rejected, b: &Rejected| {
        let next = if a.line > 0 { a.line + 1 == b.line } else { a.row + 1 == b.row };
        next && a.recording == b.recording && a.reason == b.reason
    };
    let place = |rows: &[Rejected], first: &Rejected| match rows.last() {
        Some(last) if rows.len() > 1 && last.line > 0 => format!("lines {} to {}", first.line, last.line),
        Some(last) if rows.len() > 1 => format!("rows {} to {}", first.row, last.row),
        _ => line_or_row(first.line, first.row),
    };
    let each = named.chunk_by(follows).filter_map(|rows| rows.first().map(|first| (rows, first)));
    each.map(|(rows, first)| (place(rows, first), rows.len(), first)).collect()
}

/// More lines of rejected rows are folded.
const OPEN_ROWS: usize = 10;

/// Rows that were rejected, and why; `named` may be the first of `all`.
pub fn rejected(named: &[Rejected], all: usize) -> Section {
    let heading = "What was rejected, and why".to_owned();
    if all == 0 {
        return Section::new(heading).with_text(["No row was rejected."]);
    }
    let mut rows = vec![row(["recording", "where", "why"])];
    let listed = &named[..named.len().min(ROWS)];
    rows.extend(
        rejected_together(listed).into_iter().map(|(place, _, r)| vec![r.recording.clone(), place, r.reason.clone()]),
    );
    let more = all - listed.len();
    let text = if more > 0 { vec![format!("{more} more are not listed.")] } else { Vec::new() };
    let folded = rows.len() > 1 + OPEN_ROWS;
    Section::new(heading).with_text(text).with_tables([rows]).folded(folded)
}

/// Noise alike along all axes passes 3 times the rms of positions once in 170 000 (Maxwell's distribution).
const TAIL: f64 = 3.0;

/// A largest error that noise would hardly make; lengths alone have a longer tail and are left out.
pub fn long_tail(e: &ErrorSummary, data: &Dataset) -> Option<String> {
    let lengths = data.observations.iter().any(|o| matches!(o.measured, Measured::Distance { .. }));
    (!lengths && e.max_mm > TAIL * e.rms_mm).then(|| {
        format!(
            "The largest error is {:.1} times the rms, more than random noise would give: `trical diagnose` looks for what the model lacks.",
            e.max_mm / e.rms_mm
        )
    })
}

/// What is left of the residuals beyond this multiple of the usual noise is worth a word.
const UNUSUAL: f64 = 3.0;

/// The section of concerns, and what else was looked at.
pub fn to_be_looked_at(concerns: Vec<String>, also: &str) -> Section {
    let (heading, found) = match concerns.len() {
        0 => ("What was checked", "All is in order."),
        _ => ("To check before signing", "What is left to be checked by you:"),
    };
    let checked = Section::new(heading).with_text([format!(
        "The program checked rejected rows, the largest error compared with the rms, the residuals compared with the usual noise, {also}. {found}"
    )]);
    Section { list: concerns, ..checked }
}

/// What a verdict ends with, where so many points are to be checked.
pub fn signing(points: usize) -> String {
    match points {
        0 => " All checks passed for the region that was measured.".to_owned(),
        1 => " Check one point before signing.".to_owned(),
        n => format!(" Check {n} points before signing."),
    }
}

/// Which joint angles a model was fitted to.
pub fn joints_used(source: JointSource) -> String {
    format!("Joint angles that were used: {}.", format!("{source:?}").to_lowercase())
}

/// Play of a ball in a printed socket, mm along each axis.
const SOCKET_MM: f64 = 0.1;

/// Whether a touch is a ball laid into a socket: it has no indicators, and stood at a place.
pub fn in_socket(o: &Observation) -> bool {
    matches!(o.measured, Measured::Touch { reading: [0.0, 0.0, 0.0], .. }) && o.state.place.is_some()
}

/// Recordings of which more is left than the usual noise of their kind.
pub fn beyond_noise(model: &Model, data: &Dataset) -> Result<Vec<String>> {
    let usual = Noise::usual(data.names.len());
    let mut sums = vec![(0.0, 0.0, BTreeSet::new()); data.names.len()];
    for (o, r) in data.observations.iter().zip(residuals(model, data)?) {
        let (sigma, what) = match in_socket(o) {
            true => (SOCKET_MM, "a ball in a printed socket"),
            false => (usual.sigma(o.recording, &o.measured, 0) * 1e3, o.measured.instrument()),
        };
        let (square, n, kinds) = &mut sums[o.recording];
        *square += (r / sigma).norm_squared();
        let length = matches!(o.measured, Measured::Distance { .. });
        *n += if length { 1.0 } else { 3.0 };
        kinds.insert(format!("{sigma:.2} mm{} for {what}", if length { "" } else { " along each axis" }));
    }
    let factor = |square: f64, n: f64| if n > 0.0 { (square / n).sqrt() } else { 0.0 };
    let of = data.names.iter().zip(sums).map(|(name, (square, n, kinds))| (name, factor(square, n), kinds));
    Ok(of
        .filter(|(_, f, _)| *f > UNUSUAL)
        .map(|(name, f, kinds)| {
            format!(
                "The residuals of {name} are {f:.0} times the usual noise ({}): either the measurement is that much worse, or the model \
                 lacks something; `trical diagnose` looks for it.",
                kinds.into_iter().collect::<Vec<_>>().join(", ")
            )
        })
        .collect())
}

/// How many standard deviations to each side hold 95 %, when so many numbers were measured beyond what the parameters need.
pub fn half_width(spare: Option<usize>) -> f64 {
    spare.and_then(|n| StudentsT::new(0.0, 1.0, n as f64).ok()).map_or(1.959_964, |t| t.inverse_cdf(0.975))
}

/// What parameters are, by the beginnings of their names.
const PARAMETERS: [(&[&str], &str); 11] = [
    (&["base_"], "base: where the arm's base stands"),
    (&["frame"], "frame: where the measuring frame is"),
    (&["tool_", "target"], "tool, target: the TCP and the targets on the flange"),
    (&["balls_", "place"], "balls, place: where the balls stood"),
    (&["a_", "d_"], "a_k, d_k: lengths of link k (Denavit and Hartenberg, modified)"),
    (&["alpha_", "beta_"], "alpha_k, beta_k: twist of axis k+1 against axis k, about x and y"),
    (&["theta_"], "theta_k: zero of joint k"),
    (&["c_"], "c_k: compliance of joint k"),
    (&["sag_"], "sag_k: how joint k gives way with the inclination of the links"),
    (&["zero_"], "zero_k: where the length from anchor k begins"),
    (&["reading_noise"], "reading_noise: how much of the small readings is noise of the gauge (-100 %: all of it)"),
];

/// A sentence that says what these parameters are.
pub fn legend<'a>(terms: impl Iterator<Item = &'a Term>) -> Option<String> {
    let names: Vec<&str> = terms.map(|t| t.name.as_str()).collect();
    let there = |begins: &&[&str]| begins.iter().any(|b| names.iter().any(|name| name.starts_with(b)));
    let told: Vec<&str> = PARAMETERS.iter().filter(|(begins, _)| there(begins)).map(|(_, what)| *what).collect();
    (!told.is_empty()).then(|| format!("Names: {}.", told.join("; ")))
}

/// Parameters beside nominal, with intervals.
pub fn parameters<'a>(
    model: &Model,
    terms: impl Iterator<Item = &'a Term>,
    sds: f64,
    remark: impl Fn(&str) -> String,
) -> Vec<Vec<String>> {
    let mut rows = vec![row(["parameter", "nominal", "identified", "95 % from", "to", "unit", "remark"])];
    for t in terms {
        let s = shown(model, t);
        let (factor, unit) = table::unit_told(&s.unit);
        let d = table::decimals_for(s.sd.map_or(f64::NAN, |sd| factor * sd));
        let end =
            |sign: f64| s.sd.map_or_else(|| "-".into(), |sd| table::fixed(factor * (s.value + sign * sds * sd), d));
        let mut remarks = vec![remark(&s.name)];
        if s.nominal.zip(s.sd).is_some_and(|(n, sd)| (s.value - n).abs() <= sds * sd) {
            remarks.push("nominal lies within".into());
        }
        remarks.retain(|r| !r.is_empty());
        rows.push(vec![
            s.name.clone(),
            s.nominal.map_or_else(|| "-".into(), |n| table::fixed(factor * n, 3)),
            table::fixed(factor * s.value, d),
            end(-1.0),
            end(1.0),
            unit.to_owned(),
            remarks.join("; "),
        ]);
    }
    rows
}

#[cfg(test)]
mod tests;
