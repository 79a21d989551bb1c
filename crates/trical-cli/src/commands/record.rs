//! `trical record`: an arm guided by hand into sockets, one row for every key press.

use std::io::{BufRead, Write as _};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::ArgGroup;
use serde_json::json;
use trical_device::Controller;
use trical_device::controller::wait_settled;
use trical_device::joint_feed::JointFeed;
use trical_device::session::{SessionError, open_controller_of};
use trical_model::{Cell, JointKind, Joints, Robot};
use trical_recording::visits::{Visits, check_place};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::{say, say_json};

/// Arguments of `trical record`.
#[derive(clap::Args)]
#[command(group = ArgGroup::new("from").required(true).args(["controller", "follow"]))]
pub struct Args {
    /// The arm: robot.toml or a URDF
    #[arg(long, value_name = "FILE")]
    robot: PathBuf,
    /// The cell, for how many sockets there are: cell.toml
    #[arg(long, value_name = "FILE")]
    cell: Option<PathBuf>,
    /// Where the joints come from: a controller (as in `trical robot`); nothing is moved
    #[arg(long, value_name = "URL")]
    controller: Option<String>,
    /// Where the joints come from: a file that grows, as `ros2 topic echo /joint_states > joints.txt` writes it, or a CSV with q1_deg (q1_rad), ...
    #[arg(long, value_name = "FILE")]
    follow: Option<PathBuf>,
    /// Name of the place where the sockets (or balls) stand now
    #[arg(long, value_name = "NAME")]
    place: String,
    /// The recording; rows are added where it is there
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

enum Source<'a> {
    /// Its URL and arm, and the controller while it answers.
    Controller(&'a str, &'a Robot, Option<Box<dyn Controller>>),
    Feed(JointFeed),
}

impl Source<'_> {
    fn joints(&mut self) -> std::result::Result<Joints, String> {
        match self {
            Self::Controller(url, robot, open) => {
                // one that has failed is opened anew: it may be there again
                let anew = || open_controller_of(url, robot, &Cell::bare());
                let mut controller = open.take().map_or_else(anew, Ok).map_err(|e| e.to_string())?;
                let settle = controller.joint_settle();
                let q =
                    wait_settled(controller.as_mut(), &settle, &AtomicBool::new(false)).map_err(|e| e.to_string())?;
                *open = Some(controller);
                Ok(q)
            }
            Self::Feed(feed) => {
                let q = feed.joints().map_err(|e| e.to_string());
                feed.take_notes().iter().for_each(|n| note!("{n}"));
                q
            }
        }
    }
}

/// What a person types while an arm is guided.
pub(super) enum Typed {
    /// The ball is in this socket, counted from 1, or in the same as before.
    Visit(Option<usize>),
    /// The sockets stand at another place.
    Place(String),
    /// No more.
    End,
    /// None of these: what was found and what is expected.
    Wrong(String),
}

impl Typed {
    /// `sockets`: how many there are, where that is known.
    pub(super) fn of(line: &str, sockets: Option<usize>) -> Self {
        let line = line.trim();
        if let Some(name) = line.strip_prefix("p ").map(str::trim) {
            return check_place(name)
                .map_or_else(|e| Self::Wrong(format!("place: {e}")), |()| Self::Place(name.into()));
        }
        match (line, line.parse()) {
            ("", _) => Self::Visit(None),
            ("q", _) => Self::End,
            (_, Ok(k)) if k >= 1 && sockets.is_none_or(|most| k <= most) => Self::Visit(Some(k)),
            (_, Ok(_)) => Self::Wrong(format!("found socket {line}, and the cell has {}", sockets.unwrap_or(1))),
            _ => Self::Wrong(format!("found {line:?}. {HELP}")),
        }
    }
}

const HELP: &str = "Enter records the joints at the same socket; 1, 2, ... at that socket; p NAME begins the next place; q ends. Each row is on the disk at once.";

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    if args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
        let what = format!("--out: found {}, expected the name of a CSV, which rows are added to", args.out.display());
        return Err(CliError::Input(what));
    }
    check_place(&args.place).map_err(|e| CliError::Input(format!("--place: {e}")))?;
    let robot = Robot::load(&args.robot)?;
    let sockets = args.cell.as_ref().map(|c| Cell::load(c)).transpose()?.map(|c| c.balls.len().max(1));
    let (mut visits, cut) = Visits::open(&args.out, &robot)?;
    let mut source = source(args, &robot)?;
    if let Some(cut) = cut {
        note!("{cut}");
    }
    let (mut place, mut socket, mut taken) = (args.place.clone(), 1, 0_usize);
    let mut last: Option<(Joints, String, usize)> = None;
    let again = |visits: &Visits, place: &str| {
        if visits.has(place) {
            note!("{place} has rows already: unless the sockets have not moved since, give it another name");
        }
    };
    note!("{HELP}");
    again(&visits, &place);
    let mut lines = std::io::stdin().lock().split(b'\n');
    loop {
        let _ = write!(std::io::stderr(), "{place}, socket {socket}> ");
        let Some(line) = lines.next() else { break };
        let line = line.map_err(|e| CliError::Failed(format!("standard input cannot be read: {e}")))?;
        let typed = match String::from_utf8(line) {
            Ok(line) => Typed::of(&line, sockets),
            Err(e) => {
                Typed::Wrong(format!("found {:?}, which is not UTF-8. {HELP}", String::from_utf8_lossy(e.as_bytes())))
            }
        };
        match typed {
            Typed::End => break,
            Typed::Place(name) => {
                if name != place {
                    again(&visits, &name);
                }
                place = name;
                continue;
            }
            Typed::Visit(at) => socket = at.unwrap_or(socket),
            Typed::Wrong(what) => {
                note!("{what}");
                continue;
            }
        }
        let q = match source.joints() {
            Ok(q) => q,
            Err(e) => {
                note!("no row: {e}");
                continue;
            }
        };
        if !robot.within_limits(&q, 0.02) {
            note!("no row: the joints are beyond the limits of {}: {}", args.robot.display(), shown(&robot, &q));
            continue;
        }
        let (seq, again) = match visits.push(&q, &place, socket) {
            Ok(pushed) => pushed,
            // of a disk that is full: who makes room goes on
            Err(e) => {
                note!("no row: {e}");
                continue;
            }
        };
        if let Some(again) = again {
            note!("{again}");
        }
        taken += 1;
        note!("row {seq}: {place}, socket {socket}, {}", shown(&robot, &q));
        let near = |before: &Joints| before.iter().zip(&q).all(|(a, b)| (a - b).abs() < 0.1_f64.to_radians());
        match last.as_ref().filter(|(joints, ..)| near(joints)) {
            Some((_, at, of)) if (at, *of) != (&place, socket) => note!(
                "the arm stands as at the row before, which was socket {of} of {at}: one of the two rows is wrong; take it out of {}",
                args.out.display()
            ),
            Some(_) => note!("the arm stands as at the row before; a visit from another side tells more"),
            None => {}
        }
        last = Some((q, place.clone(), socket));
    }
    if let Some(again) = visits.look_for_file()? {
        note!("{again}");
    }
    if args.json {
        return say_json(&json!({ "rows": taken, "out": args.out.display().to_string() }));
    }
    say(format!("{} added to {}", table::counted(taken, "row"), args.out.display()))
}

fn source<'a>(args: &'a Args, robot: &'a Robot) -> Result<Source<'a>> {
    if let Some(url) = &args.controller {
        let controller = open_controller_of(url, robot, &Cell::bare()).map_err(|e| match e {
            SessionError::Controller(e) => e.into(),
            e => CliError::Input(format!("--controller: {e}")),
        })?;
        return Ok(Source::Controller(url, robot, Some(controller)));
    }
    let path = args.follow.as_ref().ok_or_else(|| CliError::Input("--controller or --follow is missing".into()))?;
    Ok(Source::Feed(JointFeed::open(path, robot).map_err(CliError::input)?))
}

/// Joints in deg and mm.
fn shown(robot: &Robot, q: &Joints) -> String {
    let one = |(q, joint): (&f64, &trical_model::Joint)| match joint.kind {
        JointKind::Revolute => format!("{:.3}", q.to_degrees()),
        JointKind::Prismatic => format!("{:.3} mm", q * 1e3),
    };
    q.iter().zip(&robot.joints).map(one).collect::<Vec<_>>().join(" ")
}
