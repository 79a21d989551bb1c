//! What a person is asked and answers in a guided session, and the live readings beside the question.

use std::io::{BufRead, IsTerminal, Write};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use trical_device::gauge::AXES;
use trical_device::session::{SessionError, open_controller_of};
use trical_device::{Controller, Gauge, open_gauge};
use trical_model::{Cell, JointKind, Joints, Robot};
use trical_report::table;

use crate::error::{CliError, Result};
use crate::interrupt::Interrupt;
use crate::say_lines;

/// Live readings are shown anew this often, and Ctrl-C is looked for.
const EVERY: Duration = Duration::from_millis(200);

/// So wide are lines: as most terminals are.
const WIDE: usize = 78;

/// What a person answers.
pub enum Answer {
    /// Enter.
    Go,
    /// s
    Skip,
    /// b
    Back,
    /// Joint angles to go to, SI.
    Joints(Joints),
}

/// A paragraph on standard output.
pub fn tell(text: &str) -> Result<()> {
    say_lines(table::wrapped(text, WIDE, ""))
}

/// Lines that are typed. They are read in a thread of their own, so that readings are shown and Ctrl-C is heard meanwhile.
pub struct Person {
    lines: Receiver<std::io::Result<String>>,
    interrupt: Interrupt,
}

impl Person {
    /// The person at standard input.
    pub fn listen(interrupt: &Interrupt) -> Result<Self> {
        let (tell, lines) = channel();
        let read = move || {
            // a byte that is no text is not understood, like any other word
            let text = |line: Vec<u8>| String::from_utf8_lossy(&line).into_owned();
            for line in std::io::stdin().lock().split(b'\n') {
                if tell.send(line.map(text)).is_err() {
                    return;
                }
            }
        };
        let failed = |e: std::io::Error| CliError::Failed(format!("standard input cannot be read: {e}"));
        std::thread::Builder::new().name("typed".to_owned()).spawn(read).map_err(failed)?;
        Ok(Self { lines, interrupt: interrupt.clone() })
    }

    /// Asks until the answer is understood. `live` = gauge and controller whose readings are shown meanwhile.
    pub fn ask(&self, text: &str, robot: &Robot, live: Option<(&str, &str)>, stroke: [f64; 2]) -> Result<Answer> {
        let terminal = std::io::stderr().is_terminal() && std::io::stdin().is_terminal();
        let mut live = live.filter(|_| terminal).map(|(g, c)| Live::new(g, c, stroke));
        loop {
            self.forget_typed();
            tell(&format!("> {text}"))?;
            if live.is_some() {
                // the two lines of the readings; what is typed stands below them
                crate::note!("\n");
            }
            let line = self.typed(robot, live.as_mut())?;
            match line.trim() {
                "" => return Ok(Answer::Go),
                "s" | "S" => return Ok(Answer::Skip),
                "b" | "B" => return Ok(Answer::Back),
                "q" | "Q" => return Err(CliError::Failed("ended by the user; nothing moves".into())),
                other => match joints(other, robot) {
                    Ok(q) => return Ok(Answer::Joints(q)),
                    Err(e) => tell(&e)?,
                },
            }
        }
    }

    /// At a terminal a question is answered by what is typed once it is there: a key pressed earlier would let the arm start by itself. Where
    /// answers come through a pipe, they are written ahead.
    fn forget_typed(&self) {
        if !std::io::stdin().is_terminal() {
            return;
        }
        // a line that has not ended
        #[cfg(unix)]
        let _ = nix::sys::termios::tcflush(std::io::stdin(), nix::sys::termios::FlushArg::TCIFLUSH);
        // a line that the thread is just handing over
        std::thread::sleep(Duration::from_millis(20));
        while self.lines.try_recv().is_ok() {}
    }

    /// The next line.
    fn typed(&self, robot: &Robot, mut live: Option<&mut Live<'_>>) -> Result<String> {
        let mut readings = None;
        loop {
            if self.interrupt.asked.load(Ordering::Relaxed) {
                return Err(CliError::Failed("stopped by the user; nothing moves".into()));
            }
            match self.lines.recv_timeout(if readings.is_some() { Duration::ZERO } else { EVERY }) {
                Ok(Ok(line)) => return Ok(line),
                Ok(Err(e)) => return Err(CliError::Failed(format!("standard input: {e}"))),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(CliError::Failed("standard input has ended before the session did".into()));
                }
                // to read takes a while: what is typed meanwhile has moved the cursor, and is taken first
                Err(RecvTimeoutError::Timeout) => match readings.take() {
                    Some(lines) => {
                        let _ = std::io::stderr().write_all(above(&lines).as_bytes());
                    }
                    None => readings = live.as_mut().map(|live| live.read(robot)),
                },
            }
        }
    }
}

/// Readings and joints as they are now, in the two lines of the terminal above the one in which the answer is typed.
struct Live<'a> {
    urls: (&'a str, &'a str),
    gauge: Option<Box<dyn Gauge>>,
    controller: Option<Box<dyn Controller>>,
    stroke: [f64; 2],
}

impl<'a> Live<'a> {
    fn new(gauge: &'a str, controller: &'a str, stroke: [f64; 2]) -> Self {
        Self { urls: (gauge, controller), gauge: None, controller: None, stroke }
    }

    /// A device that cannot be read is opened anew the next time: a cable may have been plugged in again.
    fn read(&mut self, robot: &Robot) -> [String; 2] {
        let indicators = reading(&mut self.gauge, || open_gauge(self.urls.0), |gauge| gauge.read());
        let open = || open_controller_of(self.urls.1, robot, &Cell::bare());
        let q = reading(&mut self.controller, open, |controller| controller.joints().map_err(SessionError::Controller));
        now(indicators, q, robot, self.stroke)
    }
}

/// Reads a device that is opened where it is not; why it cannot be read.
fn reading<D, T, E: std::fmt::Display>(
    device: &mut Option<D>,
    open: impl FnOnce() -> std::result::Result<D, E>,
    read: impl FnOnce(&mut D) -> std::result::Result<T, E>,
) -> std::result::Result<T, String> {
    let mut opened = device.take().map_or_else(open, Ok).map_err(|e| e.to_string())?;
    let found = read(&mut opened).map_err(|e| e.to_string())?;
    *device = Some(opened);
    Ok(found)
}

/// Writes two lines anew that stand above the cursor, and leaves the cursor and what is typed where they are. Lines that are longer
/// than the terminal is wide are cut.
fn above([first, second]: &[String; 2]) -> String {
    // save the cursor, no wrapping; two lines up; each line cleared and written; the cursor and wrapping as before
    format!("\x1b7\x1b[?7l\x1b[2A\r\x1b[2K{first}\x1b[1B\r\x1b[2K{second}\x1b8\x1b[?7h")
}

/// Indicators in mm, each with where its stem is in its stroke (m), and joints: a line each.
fn now(
    reading: std::result::Result<[f64; 3], String>,
    q: std::result::Result<Joints, String>,
    robot: &Robot,
    [low, high]: [f64; 2],
) -> [String; 2] {
    let indicators = reading.map_or_else(
        |why| format!("  no reading: {why}"),
        |reading| {
            let axis = |(name, v): (&char, f64)| {
                let state = if (low..=high).contains(&v) { "touches" } else { "free" };
                format!("{name} {:+.3} mm {state}", v * 1e3)
            };
            format!("  {}", AXES.iter().zip(reading).map(axis).collect::<Vec<_>>().join("   "))
        },
    );
    let joints = q.map_or_else(
        |why| format!("  no joints: {why}"),
        |q| {
            let shown = robot.joints.iter().zip(q).map(|(joint, v)| match joint.kind {
                JointKind::Prismatic => format!("{:.2} mm", v * 1e3),
                _ => format!("{:.2}", v.to_degrees()),
            });
            format!("  joints {} deg", shown.collect::<Vec<_>>().join(", "))
        },
    );
    [indicators, joints]
}

/// Joint angles as they are typed.
fn joints(text: &str, robot: &Robot) -> std::result::Result<Joints, String> {
    let words: Vec<&str> = text.split([',', ' ']).filter(|w| !w.is_empty()).collect();
    let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).collect();
    let dof = robot.dof();
    if numbers.len() != words.len() || numbers.len() != dof {
        return Err(format!("'{text}' is not understood: expected Enter, s, b, q, or {dof} joint angles in degrees"));
    }
    let mut q = [0.0; trical_model::MAX_JOINTS];
    for (k, (joint, v)) in robot.joints.iter().zip(&numbers).enumerate() {
        let (scale, unit) = if joint.kind == JointKind::Prismatic { (1e-3, "mm") } else { (1_f64.to_radians(), "deg") };
        q[k] = v * scale;
        let [low, high] = joint.limits;
        if !(low..=high).contains(&q[k]) {
            let [low, high] = [low, high].map(|limit| limit / scale);
            return Err(format!("joint {} at {v} {unit} is outside its limits, {low:.1} to {high:.1} {unit}", k + 1));
        }
    }
    Ok(q)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn live_readings_say_which_stem_touches_and_where_the_joints_are() {
        let robot = Robot::parse(include_str!("../../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let q = joints("0,10 -20,0,45,0", &robot).unwrap();
        let lines = now(Ok([6e-3, -1.2345e-3, 0.0]), Ok(q), &robot, [-5.9e-3, 5.9e-3]);
        assert_eq!(
            lines,
            [
                "  x +6.000 mm free   y -1.234 mm touches   z +0.000 mm touches",
                "  joints 0.00, 10.00, -20.00, 0.00, 45.00, 0.00 deg"
            ]
        );
        assert!(lines.iter().all(|line| line.len() < 80), "two lines of a terminal");
        let none = now(Err("unplugged".into()), Err("silent".into()), &robot, [0.0, 0.0]);
        assert_eq!(none, ["  no reading: unplugged", "  no joints: silent"]);
        let refused = joints("0,1000,0,0,0,0", &robot).unwrap_err();
        assert!(refused.contains("joint 2 at 1000 deg is outside its limits, -110.0 to 110.0 deg"), "{refused}");
    }
}
