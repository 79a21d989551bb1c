//! `trical robot`: for a person who tries the controller's cable.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::{ArgGroup, Subcommand};
use serde_json::json;
use trical_device::controller::trial::{self, JogError, check_speed};
use trical_device::controller::wait_settled;
use trical_device::session::tell_arm;
use trical_device::{Controller, open_controller};
use trical_model::{Cell, Joints, Robot};

use crate::error::{CliError, Result};
use crate::{interrupt, say, say_json};

/// Arguments of `trical robot`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Whether the controller answers, who it is and how fast; nothing moves
    Ping {
        #[command(flatten)]
        link: Link,
    },
    /// Where the joints are, once they stand still; nothing moves
    Joints {
        #[command(flatten)]
        link: Link,
    },
    /// Move a little, with --go only
    Jog(Jog),
}

/// The controller.
#[derive(clap::Args)]
pub struct Link {
    /// The robot controller: rapid://192.168.125.1:5000?secret=@FILE (ABB, rapid/TriCal.mod),
    /// rws://192.168.125.1?user=NAME&password=@FILE (ABB, Robot Web Services), ur://192.168.0.2 (Universal Robots)
    #[arg(long, value_name = "URL")]
    controller: String,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

impl Link {
    fn open(&self) -> Result<Box<dyn Controller>> {
        Ok(open_controller(&self.controller)?)
    }
}

#[derive(clap::Args)]
#[command(group = ArgGroup::new("how").required(true).args(["joint", "joints_deg", "tool_mm"]))]
struct Jog {
    #[command(flatten)]
    link: Link,
    /// Which joint, counted from 1
    #[arg(long, value_name = "J", requires = "by_deg")]
    joint: Option<usize>,
    /// By how much the joint goes on (mm for a prismatic joint, which --robot has to say that it is)
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, requires = "joint")]
    by_deg: Option<f64>,
    /// Where all joints go (mm for a prismatic joint of --robot)
    #[arg(long, value_name = "Q1,Q2,...", value_delimiter = ',', allow_hyphen_values = true)]
    joints_deg: Vec<f64>,
    /// By how much the tool goes along its own axes
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true)]
    tool_mm: Vec<f64>,
    /// No joint goes farther than this (mm for a prismatic joint of --robot)
    #[arg(long, value_name = "DEG", default_value_t = 5.0)]
    max_deg: f64,
    /// Speed of the tool
    #[arg(long, value_name = "MM_S", default_value_t = 10.0)]
    speed_mm_s: f64,
    /// The arm, for the limits and kinds of its joints: robot.toml or a URDF
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Move; without it only what would be done is printed
    #[arg(long)]
    go: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    match &args.what {
        What::Ping { link } => ping(link),
        What::Joints { link } => joints(link),
        What::Jog(jog) => move_a_little(jog),
    }
}

fn ping(link: &Link) -> Result<()> {
    let mut controller = link.open()?;
    let answer = trial::ping(controller.as_mut()).map_err(CliError::failed)?;
    if link.json {
        return say_json(&json!({ "controller": controller.name(), "joints": controller.joint_count(),
                            "answers_in_s": answer.answers_in, "clock_s": answer.clock, "temp_c": answer.temp_c }));
    }
    say(format!(
        "{} answers in {:.1} ms: {} joints, its clock shows {:.3} s, {}",
        controller.name(),
        answer.answers_in * 1e3,
        controller.joint_count(),
        answer.clock,
        answer.temp_c.map_or_else(|| "no temperature sensor".to_owned(), |t| format!("{t:.2} degC"))
    ))
}

fn joints(link: &Link) -> Result<()> {
    let mut controller = link.open()?;
    let settle = controller.joint_settle();
    let q = wait_settled(controller.as_mut(), &settle, &AtomicBool::new(false)).map_err(CliError::failed)?;
    let degrees = in_degrees(&q, controller.joint_count(), None);
    if link.json {
        return say_json(&json!({ "joints_deg": degrees }));
    }
    say(listed(&degrees))
}

/// In deg, and mm of joints that slide.
fn in_degrees(q: &Joints, count: usize, robot: Option<&Robot>) -> Vec<f64> {
    let shown = |(k, q): (usize, &f64)| (q / trial::shown_in(robot, k).0 * 1e7).round() * 1e-7;
    q.iter().take(count).enumerate().map(shown).collect()
}

fn listed(degrees: &[f64]) -> String {
    degrees.iter().map(|q| format!("{q:.5}")).collect::<Vec<_>>().join(",")
}

impl Jog {
    /// What is to be done, in SI.
    fn what(&self, robot: Option<&Robot>) -> Result<trial::Jog> {
        let si = |k: usize, v: f64| v * trial::shown_in(robot, k).0;
        Ok(match (self.joint, self.by_deg, self.tool_mm.as_slice()) {
            (Some(0), ..) => return Err(CliError::Input("--joint: found 0, expected 1 or more".into())),
            (Some(joint), Some(by), _) => trial::Jog::Joint(joint - 1, si(joint - 1, by)),
            (_, _, []) => trial::Jog::Joints(self.joints_deg.iter().enumerate().map(|(k, q)| si(k, *q)).collect()),
            (_, _, [x, y, z]) => trial::Jog::Tool([x * 1e-3, y * 1e-3, z * 1e-3]),
            (_, _, other) => {
                return Err(CliError::Input(format!(
                    "--tool-mm: found {} numbers, expected three of 5 mm at most",
                    other.len()
                )));
            }
        })
    }

    /// A refusal, with the option that it is about.
    fn refused(&self, e: &JogError) -> CliError {
        let option = match e {
            JogError::NoJoint { .. } => "--joint: ",
            JogError::Count { .. } => "--joints-deg: ",
            JogError::FarTool(_) => "--tool-mm: ",
            JogError::Speed(_) => "--speed-mm-s: ",
            _ => "",
        };
        let more = if matches!(e, JogError::Far { .. }) { " (--max-deg)" } else { "" };
        CliError::Input(format!("{option}{e}{more}"))
    }
}

fn move_a_little(jog: &Jog) -> Result<()> {
    check_speed(jog.speed_mm_s * 1e-3).map_err(|e| jog.refused(&e))?;
    let robot = jog.robot.as_ref().map(|path| Robot::load(path)).transpose()?;
    let robot = robot.as_ref();
    let what = jog.what(robot)?;
    let unit = if robot.is_some_and(|r| r.prismatic().contains(&true)) { "deg (mm)" } else { "deg" };
    let interrupt = interrupt::watch()?;
    let mut controller = jog.link.open()?;
    controller.stop_when(interrupt.stops);
    if let Some(robot) = robot {
        tell_arm(controller.as_mut(), robot, &Cell::bare())?;
    }
    let count = controller.joint_count();
    let settle = controller.joint_settle();
    let from = wait_settled(controller.as_mut(), &settle, &interrupt.asked).map_err(CliError::failed)?;
    let to = what.target(&from, count, jog.max_deg.to_radians(), robot).map_err(|e| jog.refused(&e))?;
    let along = if let trial::Jog::Tool(by) = &what { Some(*by) } else { None };
    let would = along.map_or_else(
        || format!("all joints to {} {unit}", listed(&in_degrees(&to, count, robot))),
        |d| format!("the tool by {:.3} {:.3} {:.3} mm along its own axes", d[0] * 1e3, d[1] * 1e3, d[2] * 1e3),
    );
    if !jog.go {
        if jog.link.json {
            return say_json(&json!({ "moved": false, "would": would, "joints_deg": in_degrees(&from, count, robot) }));
        }
        say(format!("Now at {} {unit}.", listed(&in_degrees(&from, count, robot))))?;
        say(format!("Would move {would}, at {} mm/s.", jog.speed_mm_s))?;
        return say("Nothing has moved. Add --go to move.");
    }
    what.go(controller.as_mut(), &to, jog.speed_mm_s * 1e-3).map_err(CliError::failed)?;
    let at = wait_settled(controller.as_mut(), &settle, &AtomicBool::new(false)).map_err(CliError::failed)?;
    let degrees = in_degrees(&at, count, robot);
    if jog.link.json {
        return say_json(&json!({ "moved": true, "joints_deg": degrees }));
    }
    say(format!("Now at {} {unit}.", listed(&degrees)))
}
