//! Platforms of balls compared: how many, how far apart, how high.

use std::fmt::Write;

use nalgebra::Vector3;
use serde_json::json;
use trical_ident::{ParameterSet, model_of_touches};
use trical_model::{Cell, Robot, Task};
use trical_plan::{choose_touches, nominal_forward};

use super::simulation::{Nature, Outcome, Poses, calibrate, draw_arm, touch};
use super::{CURVES, Common, SPHERE, Spread, Study, WORKSPACE, drawn, pool, poses, region, share, trials};
use crate::error::{Error, Result};
use crate::page::Section;
use crate::plots::Band;
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
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        let (n, own) = (self.balls as f64, cell.balls.len() as f64);
        let middle = cell.balls.iter().sum::<Vector3<f64>>() / own;
        // the first ball lies as the cell's own first ball does
        let first = cell.balls.first().map_or(0.0, |b| (b.y - middle.y).atan2(b.x - middle.x));
        let radius = self.side / 3.0_f64.sqrt();
        let balls = (0..self.balls)
            .map(|k| {
                #[expect(clippy::cast_precision_loss, reason = "a count")]
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
}

/// How a layout did; a reason where it could not be used.
struct Platform {
    layout: Layout,
    result: std::result::Result<(Spread, Spread, usize), String>,
}

/// Compares platforms.
///
/// # Errors
/// Numbers that make no sense; a cell whose balls have no middle. A platform that cannot be used is a result.
pub fn platforms(robot: &Robot, cell: &Cell, common: &Common, args: &Platforms, task: &Task<'_>) -> Result<Study> {
    let nature = common.nature()?;
    if let Some(n) = args.balls.iter().find(|n| **n < 3 || **n > args.touches) {
        return Err(Error::Input(format!(
            "balls: found {n}, expected 3 (the least that say where {{w}} is) to {}, the number of touches",
            args.touches
        )));
    }
    if let Some(side) = args.side_mm.iter().find(|s| !(s.is_finite() && **s > 20.0)) {
        return Err(Error::Input(format!("side_mm: found {side}, expected more than 20")));
    }
    let poses = poses(robot, cell, common.seed)?;
    let set = common.set(robot);
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
        let result = try_layout(common, args.touches, robot, cell, layout, &nature, set, &poses)?;
        done.push(Platform { layout: *layout, result });
    }
    tell_platforms(common, args.touches, &done)
}

#[expect(clippy::too_many_arguments, reason = "one trial of many")]
fn try_layout(
    common: &Common,
    touches: usize,
    robot: &Robot,
    cell: &Cell,
    layout: &Layout,
    nature: &Nature,
    set: ParameterSet,
    poses: &Poses,
) -> Result<std::result::Result<(Spread, Spread, usize), String>> {
    let cell = layout.cell(cell);
    let known = model_of_touches(robot, &cell, set)?;
    let mut options = common.options(&known);
    options.per_ball = touches / layout.balls;
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

fn tell_platforms(common: &Common, touches: usize, done: &[Platform]) -> Result<Study> {
    let mut platforms = vec![COLUMNS.map(String::from).to_vec()];
    let mut rows = vec![
        ["platform", "side, mm", "sphere, mm", "80 % within", "workspace, mm", "80 % within"]
            .map(String::from)
            .to_vec(),
    ];
    let mut problems: Vec<String> = Vec::new();
    for p in done {
        let l = &p.layout;
        let (side, height, raise) = (l.side * 1e3, l.height * 1e3, l.raise * 1e3);
        let mut row = vec![l.balls.to_string()];
        row.extend([side, height, raise].map(|x| format!("{x:.1}")));
        match &p.result {
            Ok((s, w, failed)) => {
                row.extend([s.mean, s.low, s.high, w.mean, w.low, w.high].map(|x| format!("{x:e}")));
                row.extend([failed.to_string(), String::new()]);
                rows.push(vec![
                    l.name(),
                    format!("{side:.0}"),
                    format!("{:.4}", s.mean),
                    format!("{:.4} to {:.4}", s.low, s.high),
                    format!("{:.4}", w.mean),
                    format!("{:.4} to {:.4}", w.low, w.high),
                ]);
            }
            Err(problem) => {
                row.extend(vec![String::new(); 7]);
                row.push(problem.clone());
                rows.push(vec![l.name(), format!("{side:.0}"), "-".into(), "-".into(), "-".into(), "-".into()]);
                problems.push(format!("{}, side {side:.0} mm, cannot be used: {problem}.", l.name()));
            }
        }
        platforms.push(row);
    }
    let mut names: Vec<String> = Vec::new();
    for p in done {
        if !names.contains(&p.layout.name()) {
            names.push(p.layout.name());
        }
    }
    let panel = |of: fn(&(Spread, Spread, usize)) -> Spread| -> Vec<Band> {
        names
            .iter()
            .enumerate()
            .map(|(k, name)| Band {
                name: name.clone(),
                color: CURVES[k % CURVES.len()],
                points: done
                    .iter()
                    .filter(|p| p.layout.name() == *name)
                    .filter_map(|p| {
                        let s = of(p.result.as_ref().ok()?);
                        Some((p.layout.side * 1e3, s.mean, s.mean, s.mean))
                    })
                    .collect(),
            })
            .collect()
    };
    let (svg, figures) = drawn(
        "side of the platform, mm",
        "mean position error, mm",
        &[("in the sphere".into(), panel(|r| r.0)), ("in the whole workspace".into(), panel(|r| r.1))],
        "Mean position error at poses that were not touched.",
    )?;
    let best = |of: fn(&(Spread, Spread, usize)) -> Spread| {
        done.iter()
            .filter_map(|p| Some((of(p.result.as_ref().ok()?).mean, &p.layout)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or_else(
                || "none could be used".into(),
                |(e, l)| format!("{}, side {:.0} mm: {e:.4} mm", l.name(), l.side * 1e3),
            )
    };
    let verdict = format!(
        "With {} touches in all, the best platform for the sphere is {}; for the whole workspace {}.",
        touches,
        best(|r| r.0),
        best(|r| r.1)
    );
    let mut sections = vec![
        Section {
            heading: "Platforms".into(),
            text: vec![format!(
                "{} true arms for each platform, drawn as by trical study touches, {} touches shared by the balls. The sphere and \
             the poses of the workspace are the same for all. Platform, posts and floor are derived from the balls; other \
             obstacles of cell.toml are left out.",
                common.trials, touches
            )],
            figures,
            ..Section::default()
        },
        Section { heading: "Numbers".into(), tables: vec![rows.clone()], ..Section::default() },
    ];
    if !problems.is_empty() {
        let heading = "Platforms that cannot be used".into();
        sections.push(Section { heading, text: problems.clone(), ..Section::default() });
    }
    let list: Vec<serde_json::Value> = done
        .iter()
        .map(|p| {
            let l = &p.layout;
            let (s, w, problem) = match &p.result {
                Ok((s, w, _)) => (Some(s.mean), Some(w.mean), None),
                Err(e) => (None, None, Some(e)),
            };
            json!({
                "balls": l.balls, "side_mm": l.side * 1e3, "height_mm": l.height * 1e3, "raise_mm": l.raise * 1e3,
                "sphere_mean_mm": s, "workspace_mean_mm": w, "problem": problem,
            })
        })
        .collect();
    let json = json!({ "platforms": list });
    Ok(Study {
        table: rows,
        csv: csv(platforms),
        svg,
        verdict,
        notes: problems,
        json,
        title: "TriCal: study of platforms",
        sections,
    })
}
