//! `trical repeatability`: how far repeat visits scatter, by ball, by sense of approach, and over the session.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use trical_ident::{Repeatability, repeatability};
use trical_model::{Cell, Recording, Robot};
use trical_recording::{is_mcap, load_csv, open_damaged, read_recording, refuse_other_units};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::{say, say_json};

/// Arguments of `trical repeatability`.
#[derive(clap::Args)]
#[command(
    after_help = "RP = mean(l) + 3 S, where l is the distance of a visit from the barycentre of all visits of its place and S \
    their standard deviation (n - 1). Formulas of ISO 9283; no conformity is claimed. A touch counts with what the three \
    indicators had left: its place is where the arm, by its nominal geometry, says that the ball is."
)]
pub struct Args {
    /// Recordings (CSV or MCAP) with repeat visits, as trical measure --visits 5 makes them
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// The arm: robot.toml or a URDF; needed for touches, unless the recording has it inside
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Base and tool: cell.toml; needed for touches, unless the recording has it inside
    #[arg(long, value_name = "FILE")]
    cell: Option<PathBuf>,
    /// Number of the arm's joints, for a CSV without --robot
    #[arg(long, value_name = "N", default_value_t = 6)]
    joints: usize,
    /// Rows of one ball (or target) whose joints differ by less than this are visits of one place (default: 1 of
    /// touches, 0.1 of measured points)
    #[arg(long, value_name = "DEG")]
    same_deg: Option<f64>,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    if let Some(found) = args.same_deg.filter(|same| !(*same > 0.0 && same.is_finite())) {
        return Err(CliError::Input(format!("--same-deg: found {found}, expected a positive number")));
    }
    let mut all = Vec::new();
    for path in &args.recordings {
        let (recording, robot, cell) = load(path, args)?;
        all.push(repeatability(&recording, robot, cell, args.same_deg)?);
    }
    if args.json {
        return say_json(&serde_json::json!({ "recordings": all }));
    }
    all.iter().try_for_each(|told| lines(told).iter().try_for_each(say))
}

/// The recording, and the arm and cell for its touches.
fn load(path: &Path, args: &Args) -> Result<(Recording, Option<Robot>, Option<Cell>)> {
    let mut robot = args.robot.as_ref().map(|p| Robot::load(p)).transpose()?;
    let mut cell = args.cell.as_ref().map(|p| Cell::load(p)).transpose()?;
    let recording = if is_mcap(path)? {
        let (recording, lost) = open_damaged(path, None)?;
        if let Some(lost) = lost {
            crate::note!("trical: note: {lost}");
        }
        if robot.is_none() || cell.is_none() {
            let inside = read_recording(path)?;
            let (arm, place) = inside.arm_and_cell(path)?;
            robot = robot.or(arm);
            cell = cell.or(place);
        }
        recording
    } else {
        load_csv(path, robot.as_ref().map_or(args.joints, Robot::dof))?
    };
    if let Some(robot) = &robot {
        refuse_other_units(&recording, robot)?;
    }
    Ok((recording, robot, cell))
}

fn lines(told: &Repeatability) -> Vec<String> {
    let mut out = vec![format!(
        "{}: {} visited twice or more, {} once",
        told.recording,
        table::counted(told.places.len(), "place"),
        told.single_visits
    )];
    let mut rows = vec![["", "places", "visits", "mean RP mm", "largest RP mm"].map(String::from).to_vec()];
    rows.extend(told.by_ball.iter().map(|b| {
        vec![
            b.name.clone(),
            b.places.to_string(),
            b.visits.to_string(),
            format!("{:.4}", b.mean_rp_mm),
            format!("{:.4}", b.max_rp_mm),
        ]
    }));
    out.extend(table::lines(&rows));
    if told.by_joint_sense.is_empty() {
        out.push(
            "No place was approached with both senses of a joint, so the effect of the sense is not known.".into(),
        );
    } else {
        out.push("By the sense of each joint's last motion (places that have both):".into());
        let mut rows = vec![["joint", "visits + / -", "differ by mm", "sd mm"].map(String::from).to_vec()];
        rows.extend(told.by_joint_sense.iter().map(|j| {
            let sd = if j.sd_mm.is_finite() { format!("{:.4}", j.sd_mm) } else { "-".to_owned() };
            let visits = format!("{} / {}", j.visits[0], j.visits[1]);
            vec![j.joint.to_string(), visits, format!("{:.4}", j.difference_mm), sd]
        }));
        out.extend(table::lines(&rows));
    }
    out.push(told.drift.as_ref().map_or_else(
        || "Drift over the session: not known (no times, or too few visits)".to_owned(),
        |d| {
            format!(
                "Drift over the session ({:.2} h): {:.4} mm/h (sd {:.4} on each axis), {}",
                d.hours,
                Vector3::from(d.mm_per_h).norm(),
                d.sd_mm_per_h,
                if d.seen {
                    format!("{:.4} mm from first to last visit", d.over_the_session_mm)
                } else {
                    "not significant".to_owned()
                }
            )
        },
    ));
    out.push("RP = mean(l) + 3 S (formula of ISO 9283; no conformity is claimed)".into());
    out
}
