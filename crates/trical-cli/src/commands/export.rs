//! `trical export`: the calibrated arm for other programs.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use serde_json::json;
use trical_ident::{ModelFile, unit, write_whole};
use trical_model::robot::tidy;
use trical_model::{Forward, JointKind, Model, Rigid, Robot, State, urdf};
use trical_report::ErrorMap;

use crate::error::{CliError, Result};
use crate::{input, say};

/// Arguments of `trical export`.
#[derive(clap::Args)]
pub struct Args {
    /// The model: calibrated.toml or improved.toml
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Refuse the model if it is not of this arm: robot.toml or a URDF
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Where to write base, links and tool as a URDF
    #[arg(long, value_name = "FILE", required_unless_present_any = ["mdh", "error_map"])]
    urdf: Option<PathBuf>,
    /// Where to write the table of modified Denavit-Hartenberg parameters: .toml (a robot file), .json or .csv
    #[arg(long, value_name = "FILE")]
    mdh: Option<PathBuf>,
    /// Where to write how far the arm misses all over its workspace: a CSV of poses at random within the limits
    #[arg(long, value_name = "FILE")]
    error_map: Option<PathBuf>,
    /// Poses of the map
    #[arg(long, value_name = "N", default_value_t = 2000, requires = "error_map", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    poses: u32,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

/// What an exported arm cannot say, in numbers.
struct LeftOut {
    /// Names with units of the terms.
    names: Vec<String>,
    /// How far the model's TCP is from the rigid one's at random poses within limits, mm.
    rms_mm: f64,
    max_mm: f64,
}

/// Poses at which the model is compared with its rigid part.
const POSES: usize = 1000;

impl LeftOut {
    fn of(model: &Model, rigid: &Rigid) -> Result<Self> {
        let names = rigid.left_out.iter().map(|t| format!("{} ({}, {})", t.name, t.effect, unit(t).name)).collect();
        let full = Forward::new(model.clone(), Vec::new())?;
        let bare = Forward::new(Model::nominal(rigid.robot.clone(), rigid.cell.clone()), Vec::new())?;
        let (mut a, mut b) = (full.workspace(), bare.workspace());
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(20_260_201);
        let (mut sum, mut max): (f64, f64) = (0.0, 0.0);
        for _ in 0..POSES {
            let q: Vec<f64> = model.robot.joints.iter().map(|j| rng.random_range(j.limits[0]..j.limits[1])).collect();
            let state = State::at(&q);
            let off =
                full.world_from_tool(&state, &mut a).translation - bare.world_from_tool(&state, &mut b).translation;
            sum += off.norm_squared();
            max = max.max(off.norm());
        }
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let rms = (sum / POSES as f64).sqrt();
        Ok(Self { names, rms_mm: rms * 1e3, max_mm: max * 1e3 })
    }

    fn sentences(&self) -> Vec<String> {
        if self.names.is_empty() {
            return vec!["Nothing is left out: the model is rigid.".into()];
        }
        let mut lines = vec![format!(
            "Left out, since a table of lengths and angles cannot hold it: {} terms, which move the TCP by {:.3} mm (rms) and up \
             to {:.3} mm at {POSES} random poses (load only; time, temperature and sense of motion not counted):",
            self.names.len(),
            self.rms_mm,
            self.max_mm
        )];
        lines.extend(self.names.iter().map(|n| format!("  {n}")));
        lines
    }
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    for out in [&args.urdf, &args.mdh, &args.error_map].into_iter().flatten() {
        input::check_output(out)?;
    }
    let file = ModelFile::load(&args.model)?;
    if let Some(robot) = &args.robot {
        file.require_robot(&Robot::load(robot)?, &args.model.display().to_string())?;
    }
    let rigid = file.model.rigid()?;
    let left_out = LeftOut::of(&file.model, &rigid)?;
    let mut written = Vec::new();
    if let Some(out) = &args.urdf {
        let mut remarks = vec![
            format!("{}, calibrated: {}.", rigid.robot.name, args.model.display()),
            "Lengths in m, angles in rad. From world to tcp: base, links in Craig's modified Denavit-Hartenberg frames, flange, tool."
                .into(),
            "Moments of inertia, greatest torques and speeds are not known, and zero.".into(),
        ];
        remarks.extend(left_out.sentences());
        write_whole(out, urdf::write(&rigid.robot, &rigid.cell, &remarks).as_bytes())?;
        written.push(out.display().to_string());
    }
    if let Some(out) = &args.mdh {
        write_whole(out, table(out, &file.model, &rigid, &left_out)?.as_bytes())?;
        written.push(out.display().to_string());
    }
    let mut map = None;
    if let Some(out) = &args.error_map {
        let errors = ErrorMap::of(&file.model, args.poses as usize)?;
        write_whole(out, errors.csv().as_bytes())?;
        written.push(out.display().to_string());
        map = Some(errors.summary());
    }
    if args.json {
        let summary = json!({
            "error_map": map,
            "written": written,
            "robot": rigid.robot.name,
            "left_out": left_out.names,
            "left_out_rms_mm": left_out.rms_mm,
            "left_out_max_mm": left_out.max_mm,
            "same_frames": rigid.same_frames,
        });
        return say(serde_json::to_string_pretty(&summary)?);
    }
    say(format!("Wrote {}", written.join(" and ")))?;
    if let Some(e) = map {
        say(format!(
            "Over {} poses within its limits the arm misses by {:.3} mm on average, {:.3} mm at most, as seen from its own base.",
            args.poses, e.mean_mm, e.max_mm
        ))?;
    }
    if args.urdf.is_none() && args.mdh.is_none() {
        return Ok(());
    }
    if !rigid.same_frames {
        say(
            "A term tilts an axis: the table has frames of its own, and is not comparable to the nominal one line by line.",
        )?;
    }
    for line in left_out.sentences() {
        say(line)?;
    }
    Ok(())
}

/// The columns of the CSV; a limit has its own column for each unit, and one of them is empty.
const COLUMNS: [&str; 11] = [
    "joint",
    "kind",
    "alpha_deg",
    "a_mm",
    "beta_deg",
    "d_mm",
    "theta_offset_deg",
    "lower_deg",
    "upper_deg",
    "lower_mm",
    "upper_mm",
];

/// One line of the table: numbers by name, each with its unit.
fn line(robot: &Robot, i: usize) -> Option<serde_json::Map<String, serde_json::Value>> {
    let j = robot.joints.get(i)?;
    let deg = |x: f64| json!(tidy(x.to_degrees()));
    let mm = |x: f64| json!(tidy(x * 1e3));
    let prismatic = j.kind == JointKind::Prismatic;
    let mut m = serde_json::Map::new();
    m.insert("joint".into(), json!(i + 1));
    m.insert("kind".into(), json!(j.kind));
    m.insert("alpha_deg".into(), deg(j.alpha));
    m.insert("a_mm".into(), mm(j.a));
    m.insert("beta_deg".into(), deg(j.beta));
    m.insert("d_mm".into(), mm(j.d));
    m.insert("theta_offset_deg".into(), deg(j.theta_offset));
    for (k, name) in ["lower", "upper"].iter().enumerate() {
        let (own, value) = if prismatic { ("mm", mm(j.limits[k])) } else { ("deg", deg(j.limits[k])) };
        for unit in ["deg", "mm"] {
            let value = if unit == own { value.clone() } else { serde_json::Value::Null };
            m.insert(format!("{name}_{unit}"), value);
        }
    }
    Some(m)
}

fn table(out: &Path, model: &Model, rigid: &Rigid, left_out: &LeftOut) -> Result<String> {
    let lines = || (0..rigid.robot.dof()).filter_map(|i| line(&rigid.robot, i));
    match out.extension().and_then(|e| e.to_str()) {
        Some("toml") => {
            let head: Vec<String> = left_out.sentences().iter().map(|s| format!("# {s}\n")).collect();
            Ok(format!(
                "# Calibrated; T(i-1, i) = Rx(alpha) Tx(a) Ry(beta) Rz(theta + theta_offset) Tz(d).\n{}\n{}",
                head.concat(),
                rigid.robot.to_toml()
            ))
        }
        Some("json") => {
            let pose = |p: &trical_model::Pose| {
                let xyz_mm = [p.translation.x, p.translation.y, p.translation.z].map(|x| tidy(x * 1e3));
                let zyx_deg = trical_model::pose::angles_zyx(&p.rotation).map(|a| tidy(a.to_degrees()));
                json!({ "xyz_mm": xyz_mm, "zyx_deg": zyx_deg })
            };
            let nominal: Vec<_> = if rigid.same_frames {
                (0..model.robot.dof()).filter_map(|i| line(&model.robot, i)).collect()
            } else {
                Vec::new()
            };
            let tool = trical_model::Pose { rotation: rigid.cell.tool.rotation, translation: rigid.cell.tool.tcp };
            Ok(serde_json::to_string_pretty(&json!({
                "robot": rigid.robot.name,
                "convention": "T(i-1, i) = Rx(alpha) Tx(a) Ry(beta) Rz(theta + theta_offset) Tz(d); R = Rz(a) Ry(b) Rx(c) in zyx_deg",
                "world_from_base": pose(&rigid.cell.world_from_base),
                "base_from_frame_0": pose(&rigid.robot.root_from_zero),
                "joints": lines().collect::<Vec<_>>(),
                "nominal_joints": nominal,
                "frame_n_from_flange": pose(&rigid.robot.last_from_flange),
                "flange_from_tcp": pose(&tool),
                "left_out": left_out.names,
                "left_out_rms_mm": left_out.rms_mm,
                "left_out_max_mm": left_out.max_mm,
            }))?)
        }
        Some("csv") => {
            let mut text = COLUMNS.join(",") + "\n";
            for m in lines() {
                let cell = |name: &&str| match m.get(*name) {
                    None | Some(serde_json::Value::Null) => String::new(),
                    Some(v) => v.as_str().map_or_else(|| v.to_string(), str::to_owned),
                };
                text.push_str(&COLUMNS.iter().map(cell).collect::<Vec<_>>().join(","));
                text.push('\n');
            }
            Ok(text)
        }
        _ => Err(CliError::Input(format!("{}: the name must end in .toml, .json or .csv", out.display()))),
    }
}
