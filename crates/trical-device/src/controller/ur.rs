//! Client of a Universal Robots controller: URScript to the secondary port, joints by RTDE.
//!
//! Each motion is a program that writes its number into an output register when it has come to its end, so that the client
//! knows which one is done. Nothing here was tried on a real controller; the arm has to be in remote control.

use std::io::{Error, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use trical_model::Forward;
use trical_model::recording::Joints;

use super::rtde::{self, State, kind};
use super::{
    Controller, ControllerError, JointSettle, LOOK_FOR_STOP, StopCount, Stops, confirmed_stop, connected,
    largest_difference, serial_number_in,
};
use trical_recording::motion::JointSample;

/// Settings of the connection.
#[derive(Clone, Debug, PartialEq)]
pub struct UrSettings {
    /// Port of RTDE.
    pub rtde_port: u16,
    /// Port that takes programs.
    pub script_port: u16,
    /// Port of the dashboard server, which tells the serial number. \[I\]: from which version on it does.
    pub dashboard_port: u16,
    /// How long an answer may take.
    pub timeout: Duration,
    /// How long a motion may take.
    pub move_timeout: Duration,
    /// Longest correction, m. The controller has no limit of its own for it.
    pub correction_limit: f64,
    /// When the joints stand still.
    pub settle: JointSettle,
}

impl Default for UrSettings {
    fn default() -> Self {
        Self {
            rtde_port: 30_004,
            script_port: 30_002,
            dashboard_port: 29_999,
            timeout: Duration::from_secs(5),
            move_timeout: Duration::from_secs(120),
            correction_limit: 5e-3,
            settle: JointSettle::default(),
        }
    }
}

/// Samples a second.
const FREQUENCY: f64 = 25.0;
/// How far the tool of any of this maker's arms is from a joint, m.
const REACH: f64 = 2.0;
/// Parts of a joint motion of which the fastest counts.
const WAY_PARTS: usize = 50;
/// Samples that are kept until somebody takes them.
const MOST_SAMPLES: usize = 100_000;

#[derive(Default)]
struct Seen {
    latest: Option<State>,
    packages: u64,
    history: Vec<JointSample>,
    lost: Option<String>,
}

/// What the reading thread and the client share.
#[derive(Default)]
struct Shared {
    seen: Mutex<Seen>,
    news: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, state: State) {
        let mut seen = self.lock();
        let moved = seen.latest.is_none_or(|last| last.q.iter().zip(&state.q).any(|(a, b)| (a - b).abs() > 1e-6));
        if moved && seen.history.len() < MOST_SAMPLES {
            seen.history.push(JointSample { t: state.t, q: joints(&state) });
        }
        seen.latest = Some(state);
        seen.packages += 1;
        self.news.notify_all();
    }

    fn lose(&self, reason: String) {
        self.lock().lost = Some(reason);
        self.news.notify_all();
    }
}

fn joints(state: &State) -> Joints {
    trical_model::State::at(&state.q).q
}

/// A Universal Robots controller.
pub struct UrClient {
    name: String,
    host: String,
    settings: UrSettings,
    shared: Arc<Shared>,
    data: TcpStream,
    script: TcpStream,
    tcp: [f64; 3],
    linear: f64,
    angular: f64,
    arm: Option<Forward>,
    stops: Stops,
}

impl UrClient {
    /// Connects to a host and waits for its first joints.
    ///
    /// # Errors
    /// No connection, or something else that answers.
    pub fn connect(host: &str, settings: UrSettings) -> Result<Self, ControllerError> {
        let open = |port: u16| connected(&format!("{host}:{port}"), settings.timeout, settings.timeout);
        let mut data = open(settings.rtde_port)?;
        let name = format!("ur {host}");
        // data may come behind the last answer already
        let mut bytes = Vec::new();
        let recipe = greet(&mut data, &mut bytes, &name, settings.timeout)?;
        let script = open(settings.script_port)?;
        let failed = |e: Error| ControllerError::Connect { address: host.to_owned(), reason: e.to_string() };
        let shared = Arc::new(Shared::default());
        let (mut reads, into) = (data.try_clone().map_err(failed)?, Arc::clone(&shared));
        reads.set_read_timeout(None).map_err(failed)?;
        let mut drained = script.try_clone().map_err(failed)?;
        drained.set_read_timeout(None).map_err(failed)?;
        let listen = move || {
            let reason = loop {
                if let Err(reason) = next(&mut reads, &mut bytes, None).map(|(kind, content)| {
                    if kind == kind::DATA
                        && let Some(state) = rtde::parse_state(&content, recipe)
                    {
                        into.take(state);
                    }
                }) {
                    break reason;
                }
            };
            into.lose(reason.to_string());
        };
        // the port for programs also sends the robot's state, which must be taken off
        let drain = move || std::io::copy(&mut drained, &mut std::io::sink()).map(|_| ());
        std::thread::Builder::new().name("ur data".to_owned()).spawn(listen).map_err(failed)?;
        std::thread::Builder::new().name("ur program port".to_owned()).spawn(drain).map_err(failed)?;
        let client = Self {
            name,
            host: host.to_owned(),
            settings,
            shared,
            data,
            script,
            tcp: [0.0; 3],
            linear: 0.01,
            angular: 0.1,
            arm: None,
            stops: Stops::default(),
        };
        client.fresh()?;
        Ok(client)
    }

    fn lost(&self, reason: &str) -> ControllerError {
        ControllerError::Lost { controller: self.name.clone(), reason: reason.to_owned() }
    }

    /// Waits until `is` holds of what has come.
    fn wait(
        &self,
        request: &str,
        timeout: Duration,
        mut is: impl FnMut(&Seen) -> Option<Result<State, ControllerError>>,
    ) -> Result<State, ControllerError> {
        let deadline = Instant::now() + timeout;
        let mut seen = self.shared.lock();
        loop {
            if let Some(reason) = &seen.lost {
                return Err(self.lost(reason));
            }
            if let Some(result) = is(&seen) {
                return result;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(ControllerError::silent(&self.name, request, timeout));
            }
            let left = left.min(LOOK_FOR_STOP);
            seen = self.shared.news.wait_timeout(seen, left).map_or_else(|e| e.into_inner().0, |(seen, _)| seen);
        }
    }

    /// The next data that come, not older ones.
    fn fresh(&self) -> Result<State, ControllerError> {
        let before = self.shared.lock().packages;
        self.wait("RTDE data", self.settings.timeout, |seen| {
            (seen.packages > before).then_some(seen.latest).flatten().map(Ok)
        })
    }

    /// Whether the arm may move: it has stopped for its safety in all modes but two.
    fn check_safety(&self, state: &State) -> Result<(), ControllerError> {
        let (what, remedy) = match state.safety {
            1 | 2 => return Ok(()),
            3 => (
                "protective stop",
                "look what the arm has met, or what load and tool it is set to; unlock it at the teach pendant, and jog it to a free place",
            ),
            4 => ("recovery mode", "move the arm back within its limits at the teach pendant"),
            5 => ("safeguard stop", "close the safeguard (door, light curtain) and reset it"),
            6 | 7 => ("emergency stop", "release the button once nobody is in danger, and power the arm on again"),
            8 | 9 => ("violation or fault", "restart the controller's safety system as the teach pendant says"),
            _ => ("not in normal operation", "look at the teach pendant"),
        };
        Err(ControllerError::SafetyStop { controller: self.name.clone(), mode: state.safety, what, remedy })
    }

    fn send(&mut self, program: &str) -> Result<(), ControllerError> {
        let sent = self.script.write_all(program.as_bytes()).and_then(|()| self.script.flush());
        sent.map_err(|e| self.lost(&e.to_string()))
    }

    /// How long the tool's way would be if it went all of a joint motion as fast as where it is fastest, m. Of an arm that is not known, the longest
    /// that one of this maker can make.
    fn way(&self, from: &Joints, to: &Joints) -> f64 {
        let Some(arm) = &self.arm else {
            return REACH * from.iter().zip(to).map(|(a, b)| (b - a).abs()).sum::<f64>();
        };
        let mut ws = arm.workspace();
        let mut at = |k: usize| {
            let part = k as f64 / WAY_PARTS as f64;
            let q: Joints = std::array::from_fn(|i| from[i] + part * (to[i] - from[i]));
            arm.world_from_tool(&trical_model::State::at(&q), &mut ws).translation
        };
        let (mut before, mut longest) = (at(0), 0.0_f64);
        for k in 1..=WAY_PARTS {
            let now = at(k);
            longest = longest.max((now - before).norm());
            before = now;
        }
        longest * WAY_PARTS as f64
    }

    /// Runs a motion and waits for its number. Of an arm that does not arrive in time, of which nothing is heard any more, or that stands
    /// for its safety, the program is ended: it is not to go on later.
    fn run(&mut self, motion: &str) -> Result<(), ControllerError> {
        let state = self.fresh()?;
        self.check_safety(&state)?;
        let number = (state.done.max(0) + 1) % 1_000_000;
        let [x, y, z] = self.tcp;
        let program = format!(
            "def trical():\n  set_tcp(p[{x:.7},{y:.7},{z:.7},0,0,0])\n  {motion}\n  \
             write_output_integer_register(24, {number})\nend\n"
        );
        let under_way = self.stops.begin()?;
        let begin = Instant::now();
        let UrSettings { timeout, move_timeout, .. } = self.settings;
        let (mut packages, mut heard) = (0, begin);
        let mut begun = false;
        self.send(&program)?;
        // what is waited for has a time of its own, and says more
        let result = self.wait(motion, 2 * move_timeout, |seen| {
            if under_way.is_to_stop() {
                return Some(Err(ControllerError::Stopped));
            }
            if packages != seen.packages {
                (packages, heard) = (seen.packages, Instant::now());
            } else if heard.elapsed() >= timeout {
                return Some(Err(ControllerError::silent(&self.name, "RTDE data", timeout)));
            }
            let now = seen.latest?;
            if let Err(error) = self.check_safety(&now) {
                return Some(Err(error));
            }
            begun |= is_apart(&state, &now);
            if now.done != number && !begun && begin.elapsed() >= timeout {
                let reason = "the arm does not begin to move; is it in remote control, powered on, are its brakes released, and is \
                              its speed slider above 0?";
                return Some(Err(ControllerError::refused(&self.name, motion, reason)));
            }
            if now.done != number && begin.elapsed() >= move_timeout {
                let reason = format!(
                    "the arm has not arrived within {} s; is its speed slider at 0, or does something hold it?",
                    move_timeout.as_secs_f64()
                );
                return Some(Err(ControllerError::refused(&self.name, motion, reason)));
            }
            (now.done == number).then_some(Ok(now))
        });
        let Err(error) = result else { return Ok(()) };
        // programs go another way than data: it may be there where no data come any more
        Err(match (self.send(STOP), error) {
            (Ok(()), ControllerError::Stopped) => confirmed_stop(self),
            (Err(_), why) | (Ok(()), why @ ControllerError::Lost { .. }) => {
                ControllerError::stop_not_confirmed(&self.name, why)
            }
            (Ok(()), error) => error,
        })
    }
}

/// Ends whatever program runs.
const STOP: &str = "def trical_stop():\n  stopj(2.0)\nend\n";

/// Whether an arm has moved from one to the other, beyond the noise of its encoders.
fn is_apart(a: &State, b: &State) -> bool {
    a.q.iter().zip(&b.q).any(|(a, b)| (a - b).abs() > 1e-4)
}

impl Drop for UrClient {
    fn drop(&mut self) {
        // ends both threads
        let _ = self.data.shutdown(Shutdown::Both);
        let _ = self.script.shutdown(Shutdown::Both);
    }
}

/// The next package from a stream; with a deadline, however slowly its bytes come.
fn next(stream: &mut TcpStream, bytes: &mut Vec<u8>, deadline: Option<Instant>) -> std::io::Result<(u8, Vec<u8>)> {
    loop {
        if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            return Err(ErrorKind::TimedOut.into());
        }
        if let Some(package) = rtde::take(bytes).map_err(Error::other)? {
            return Ok(package);
        }
        let mut some = [0; 512];
        match stream.read(&mut some) {
            Ok(0) => return Err(Error::other("closed at its other end")),
            Ok(count) => bytes.extend_from_slice(some.get(..count).unwrap_or_default()),
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

/// Version, fields, start; gives the number of the recipe.
fn greet(stream: &mut TcpStream, bytes: &mut Vec<u8>, name: &str, timeout: Duration) -> Result<u8, ControllerError> {
    let mut ask = |request: &[u8], wanted: u8, what: &str, expected: &str, right: &dyn Fn(&[u8]) -> bool| {
        let lost = |e: Error| match e.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => ControllerError::silent(name, what, timeout),
            _ => ControllerError::Lost { controller: name.to_owned(), reason: e.to_string() },
        };
        stream.write_all(request).map_err(lost)?;
        let deadline = Some(Instant::now() + timeout);
        loop {
            let (kind, content) = next(stream, bytes, deadline).map_err(lost)?;
            match kind {
                kind::TEXT | kind::DATA => {}
                kind if kind == wanted && right(&content) => return Ok(content),
                _ => return Err(ControllerError::garbage(name, what, &content, expected)),
            }
        }
    };
    let yes = |content: &[u8]| content.first() == Some(&1);
    ask(&rtde::package(kind::VERSION, &2_u16.to_be_bytes()), kind::VERSION, "RTDE version 2", "yes", &yes)?;
    let types = |content: &[u8]| content.get(1..) == Some(rtde::TYPES.as_bytes());
    let outputs = rtde::outputs_request(FREQUENCY);
    let recipe = ask(&outputs, kind::OUTPUTS, rtde::FIELDS, rtde::TYPES, &types)?;
    ask(&rtde::package(kind::START, &[]), kind::START, "RTDE start", "yes", &yes)?;
    Ok(recipe.first().copied().unwrap_or(0))
}

impl Controller for UrClient {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn joint_count(&self) -> usize {
        6
    }

    fn ping(&mut self) -> Result<(), ControllerError> {
        self.fresh().map(|_| ())
    }

    fn joints(&mut self) -> Result<Joints, ControllerError> {
        self.fresh().map(|state| joints(&state))
    }

    fn move_joints(&mut self, target: &Joints) -> Result<(), ControllerError> {
        let q: Vec<String> = target.iter().take(6).map(|q| format!("{q:.9}")).collect();
        let from = self.joints()?;
        let (farthest, way) = (largest_difference(&from, target).1, self.way(&from, target));
        // a joint motion knows no speed of the tool: that of its joints is such that the tool is nowhere faster
        let speed = if way > 0.0 { self.angular.min(self.linear * farthest / way) } else { self.angular };
        self.run(&format!("movej([{}], a=0.5, v={speed:.5})", q.join(",")))
    }

    fn correct(&mut self, displacement: [f64; 3]) -> Result<(), ControllerError> {
        let length = displacement.iter().map(|d| d * d).sum::<f64>().sqrt();
        let [x, y, z] = displacement;
        let motion = format!(
            "movel(pose_trans(get_target_tcp_pose(), p[{x:.9},{y:.9},{z:.9},0,0,0]), a=0.2, v={:.5})",
            self.linear
        );
        if length.is_nan() || length > self.settings.correction_limit {
            let (length, limit) = (length * 1e3, self.settings.correction_limit * 1e3);
            let reason = format!("correction {length:.3} mm is over the limit of {limit:.3} mm");
            return Err(ControllerError::refused(&self.name, &motion, reason));
        }
        self.run(&motion)
    }

    fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), ControllerError> {
        if !(linear > 0.0 && angular > 0.0 && linear.is_finite() && angular.is_finite()) {
            return Err(ControllerError::refused(&self.name, "speed", "two positive numbers expected"));
        }
        // those of reduced speed, whatever is asked for
        (self.linear, self.angular) = (linear.min(0.25), angular.min(0.5));
        Ok(())
    }

    fn set_tool(&mut self, tcp_in_flange: [f64; 3]) -> Result<(), ControllerError> {
        self.tcp = tcp_in_flange;
        Ok(())
    }

    fn clock(&mut self) -> Result<f64, ControllerError> {
        self.fresh().map(|state| state.t)
    }

    /// The dashboard greets with a line, and answers each command with one. Not every controller has it, and not every one knows the command.
    fn serial_number(&mut self) -> Result<Option<String>, ControllerError> {
        let ask = || -> Option<String> {
            let timeout = self.settings.timeout;
            let address = format!("{}:{}", self.host, self.settings.dashboard_port);
            let mut stream = connected(&address, timeout, timeout).ok()?;
            stream.write_all(b"get serial number\n").ok()?;
            let (deadline, mut said) = (Instant::now() + timeout, Vec::new());
            loop {
                let mut some = [0; 256];
                let count = stream.read(&mut some).ok().filter(|count| *count > 0 && Instant::now() < deadline)?;
                said.extend_from_slice(some.get(..count)?);
                let text = String::from_utf8_lossy(&said);
                if let Some((answer, _)) = text.split_once('\n').and_then(|(_, behind)| behind.split_once('\n')) {
                    return serial_number_in(answer);
                }
            }
        };
        Ok(ask())
    }

    fn stop_when(&mut self, count: StopCount) {
        self.stops.listen(count);
    }

    fn set_arm(&mut self, arm: &Forward) {
        self.arm = Some(arm.clone());
    }

    fn joint_settle(&self) -> JointSettle {
        self.settings.settle.clone()
    }

    fn take_history(&mut self) -> Vec<JointSample> {
        std::mem::take(&mut self.shared.lock().history)
    }
}
