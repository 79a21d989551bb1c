//! Platforms of balls compared: how many, how far apart, how high.

use std::fmt::Write;

use nalgebra::Vector3;
use serde_json::{Value, json};
use trical_ident::{ParameterSet, model_of_touches};
use trical_model::{Cell, Robot, Task};
use trical_plan::{choose_touches, nominal_forward};

use super::simulation::{Nature, Outcome, Poses, calibrate, draw_arm, touch};
use super::{
    CURVES, Checked, Common, SPHERE, Spread, Study, WORKSPACE, drawn, pool, poses, region, share, trials, wrong,
};
use crate::error::Result;
use crate::figures::plots::Band;
use crate::page::Section;
use crate::table::csv;

/// Which platforms are tried: every combination.
#[derive(Clone, Debug)]
pub struct Platforms {
    /// Touches of all balls together.
    pub touches: usize,
    /// Numbers of balls (3 or more: {w} is theirs), evenly on a circle.
    pub balls: Vec<usize>,
    /// Sizes: the side of the triangle that three balls on that circle make.
    pub side_mm: Vec<f64>,
    /// Heights above the balls of the cell.
    pub height_mm: Vec<f64>,
    /// How much higher every second ball is (a second plate).
    pub raise_mm: Vec<f64>,
}

impl Default for Platforms {
    fn default() -> Self {
        Self {
            touches: 45,
            balls: vec![3, 6],
            side_mm: vec![100.0, 200.0, 300.0, 400.0],
            height_mm: vec![0.0, 150.0],
            raise_mm: vec![0.0, 250.0],
        }
    }
}

impl Platforms {
    /// Whether these numbers make sense.
    ///
    /// # Errors
    /// Where they do not.
    pub fn check(&self) -> Checked {
        if let Some(n) = self.balls.iter().find(|n| **n < 3 || **n > self.touches) {
            let most = self.touches;
            let expected = "3 (the least that say where {w} is)";
            return wrong("balls", format!("found {n}, expected {expected} to {most}, the number of touches"));
        }
        match self.side_mm.iter().find(|s| !(s.is_finite() && **s > 20.0)) {
            Some(side) => wrong("side_mm", format!("found {side}, expected more than 20")),
            None => Ok(()),
        }
    }
}

/// Where the balls of a platform are.
#[derive(Clone, Copy, Debug)]
struct Layout {
    balls: usize,
    side: f64,
    height: f64,
    raise: f64,
}

impl Layout {
    /// Evenly on a circle about the middle of the cell's own balls, every second one raised.
    fn cell(&self, cell: &Cell) -> Cell {
        let (n, own) = (self.balls as f64, cell.balls.len() as f64);
        let middle = cell.balls.iter().sum::<Vector3<f64>>() / own;
        // the first ball lies as the cell's own first ball does
        let first = cell.balls.first().map_or(0.0, |b| (b.y - middle.y).atan2(b.x - middle.x));
        let radius = self.side / 3.0_f64.sqrt();
        let balls = (0..self.balls)
            .map(|k| {
                let angle = first + std::f64::consts::TAU * k as f64 / n;
                let up = self.height + if k % 2 == 1 { self.raise } else { 0.0 };
                middle + Vector3::new(radius * angle.cos(), radius * angle.sin(), up)
            })
            .collect();
        let mut out = Cell { balls, ..cell.clone() };
        // the drawn platform belongs to the drawn balls: another is derived
        if let Some(geometry) = &mut out.geometry {
            geometry.remove("obstacle");
        }
        out
    }

    fn name(&self) -> String {
        let mut name = format!("{} balls", self.balls);
        if self.height != 0.0 {
            let _ = write!(name, ", {:.0} mm higher", self.height * 1e3);
        }
        if self.raise != 0.0 {
            let _ = write!(name, ", every second {:.0} mm up", self.raise * 1e3);
        }
        name
    }

    fn name_and_side(&self) -> String {
        format!("{}, side {:.0} mm", self.name(), self.side * 1e3)
    }
}

/// Errors in the sphere and in the workspace, and how many fits failed.
type Errors = (Spread, Spread, usize);

/// How a layout did; a reason where it could not be used.
struct Platform {
    layout: Layout,
    result: std::result::Result<Errors, String>,
}

impl Platform {
    /// The row of the CSV.
    fn trial(&self) -> Vec<String> {
        let l = &self.layout;
        let mut row = vec![l.balls.to_string()];
        row.extend([l.side, l.height, l.raise].map(|x| format!("{:.1}", x * 1e3)));
        match &self.result {
            Ok((s, w, failed)) => {
                row.extend([s.mean, s.low, s.high, w.mean, w.low, w.high].map(|x| format!("{x:e}")));
                row.extend([failed.to_string(), String::new()]);
            }
            Err(problem) => {
                row.extend(vec![String::new(); 7]);
                row.push(problem.clone());
            }
        }
        row
    }

    /// The row of the table.
    fn row(&self) -> Vec<String> {
        let mut row = vec![self.layout.name(), format!("{:.0}", self.layout.side * 1e3)];
        match &self.result {
            Ok((s, w, _)) => {
                for x in [s, w] {
                    row.extend([format!("{:.4}", x.mean), format!("{:.4} to {:.4}", x.low, x.high)]);
                }
            }
            Err(_) => row.extend(vec!["-".into(); 4]),
        }
        row
    }

    fn problem(&self) -> Option<String> {
        let problem = self.result.as_ref().err()?;
        Some(format!("{}, cannot be used: {problem}.", self.layout.name_and_side()))
    }

    fn mean(&self, of: fn(&Errors) -> Spread) -> Option<f64> {
        self.result.as_ref().ok().map(|r| of(r).mean)
    }

    fn json(&self) -> Value {
        let l = &self.layout;
        json!({
            "balls": l.balls, "side_mm": l.side * 1e3, "height_mm": l.height * 1e3, "raise_mm": l.raise * 1e3,
            "sphere_mean_mm": self.mean(IN_SPHERE), "workspace_mean_mm": self.mean(IN_WORKSPACE),
            "problem": self.result.as_ref().err(),
        })
    }
}

const IN_SPHERE: fn(&Errors) -> Spread = |e| e.0;
const IN_WORKSPACE: fn(&Errors) -> Spread = |e| e.1;

/// Compares platforms.
///
/// # Errors
/// Numbers that make no sense; a cell whose balls have no middle. A platform that cannot be used is a result.
pub fn platforms(robot: &Robot, cell: &Cell, common: &Common, args: &Platforms, task: &Task<'_>) -> Result<Study> {
    let nature = &common.nature()?;
    args.check()?;
    let poses = &poses(robot, cell, common.seed)?;
    let same = Same { common, touches: args.touches, robot, cell, nature, set: common.set(robot), poses };
    let mut layouts = Vec::new();
    for balls in &args.balls {
        for height in &args.height_mm {
            for raise in &args.raise_mm {
                for side in &args.side_mm {
                    layouts.push(Layout {
                        balls: *balls,
                        side: side * 1e-3,
                        height: height * 1e-3,
                        raise: raise * 1e-3,
                    });
                }
            }
        }
    }
    let mut done = Vec::with_capacity(layouts.len());
    for layout in &layouts {
        task.step(share(done.len(), layouts.len()), &layout.name())?;
        done.push(Platform { layout: *layout, result: same.simulate(layout)? });
    }
    tell_platforms(common, args.touches, &done)
}

/// What is the same for all platforms.
struct Same<'a> {
    common: &'a Common,
    touches: usize,
    robot: &'a Robot,
    cell: &'a Cell,
    nature: &'a Nature,
    set: ParameterSet,
    poses: &'a Poses,
}

impl Same<'_> {
    /// Calibrations of arms that touch the balls of a layout; a reason where it cannot be used.
    fn simulate(&self, layout: &Layout) -> Result<std::result::Result<Errors, String>> {
        let Self { common, robot, nature, set, poses, .. } = *self;
        let cell = layout.cell(self.cell);
        let known = model_of_touches(robot, &cell, set)?;
        let mut options = common.options(&known);
        options.per_ball = self.touches / layout.balls;
        options.pool_per_ball = common.pool.max(options.per_ball);
        // out of reach is a result, not an error
        let pool = match pool(robot, &cell, &options) {
            Ok(pool) => pool,
            Err(e) => return Ok(Err(e.to_string())),
        };
        let forward = nominal_forward(robot, &cell, &options)?;
        let region = region(&forward, poses, &options);
        let chosen = match choose_touches(&forward, &pool, &options, &region) {
            Ok(c) => c.touches,
            Err(e) => return Ok(Err(e.to_string())),
        };
        let outcomes = trials(common.trials, |k| {
            let truth = draw_arm(robot, &cell, nature, common.seed, k);
            let recording = touch(&truth, &chosen, nature, common.seed, k)?;
            calibrate(robot, &cell, &truth, recording, set, poses)
        })?;
        let good: Vec<Outcome> = outcomes.iter().flatten().copied().collect();
        if good.is_empty() {
            return Ok(Err("no fit succeeded: these touches do not determine the parameters".into()));
        }
        let spread = |of: fn(&Outcome) -> f64| Spread::of(good.iter().map(of));
        Ok(Ok((spread(SPHERE), spread(WORKSPACE), outcomes.len() - good.len())))
    }
}

/// Columns of the study's CSV, one row for each platform.
const COLUMNS: [&str; 12] = [
    "balls",
    "side_mm",
    "height_mm",
    "raise_mm",
    "sphere_mean_mm",
    "sphere_low_mm",
    "sphere_high_mm",
    "workspace_mean_mm",
    "workspace_low_mm",
    "workspace_high_mm",
    "gave_up",
    "problem",
];

/// Columns of the table that is shown.
const HEAD: [&str; 6] = ["platform", "side, mm", "sphere, mm", "80 % within", "workspace, mm", "80 % within"];

fn tell_platforms(common: &Common, touches: usize, done: &[Platform]) -> Result<Study> {
    let rows: Vec<_> = [HEAD.map(String::from).to_vec()].into_iter().chain(done.iter().map(Platform::row)).collect();
    let trials = [COLUMNS.map(String::from).to_vec()].into_iter().chain(done.iter().map(Platform::trial));
    let problems: Vec<String> = done.iter().filter_map(Platform::problem).collect();
    let (svg, figures) = drawn(
        "side of the platform, mm",
        "mean position error, mm",
        &[
            ("in the sphere".into(), curves(done, IN_SPHERE)),
            ("in the whole workspace".into(), curves(done, IN_WORKSPACE)),
        ],
        "Mean position error at poses that were not touched.",
    )?;
    let best = |of: fn(&Errors) -> Spread| {
        done.iter()
            .filter_map(|p| Some((p.mean(of)?, &p.layout)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or_else(|| "none could be used".into(), |(e, layout)| format!("{}: {e:.4} mm", layout.name_and_side()))
    };
    let verdict = format!(
        "With {touches} touches in all, the best platform for the sphere is {}; for the whole workspace {}.",
        best(IN_SPHERE),
        best(IN_WORKSPACE)
    );
    let text = vec![format!(
        "{} true arms for each platform, drawn as by trical study touches, {touches} touches shared by the balls. The sphere and \
         the poses of the workspace are the same for all. Platform, posts and floor are derived from the balls; other \
         obstacles of cell.toml are left out.",
        common.trials
    )];
    let mut sections = vec![
        Section::new("Platforms").with_text(text).with_figures(figures),
        Section::new("Numbers").with_tables([rows.clone()]),
    ];
    if !problems.is_empty() {
        let heading = "Platforms that cannot be used";
        sections.push(Section::new(heading).with_text(problems.clone()));
    }
    let json = json!({ "platforms": done.iter().map(Platform::json).collect::<Vec<_>>() });
    let title = "TriCal: study of platforms";
    Ok(Study { csv: csv(trials), table: rows, svg, verdict, notes: problems, json, title, sections })
}

/// Error against side: a curve for each number, height and raise of balls.
fn curves(done: &[Platform], of: fn(&Errors) -> Spread) -> Vec<Band> {
    let mut curves: Vec<Band> = Vec::new();
    for p in done {
        let name = p.layout.name();
        let k = curves.iter().position(|c| c.name == name).unwrap_or_else(|| {
            curves.push(Band { name, color: CURVES[curves.len() % CURVES.len()], points: Vec::new() });
            curves.len() - 1
        });
        curves[k].points.extend(p.mean(of).map(|mean| (p.layout.side * 1e3, mean, mean, mean)));
    }
    curves
}
