//! Robot controllers: anything that moves the arm and says where its joints are.

pub mod rapid;
pub mod rapid_protocol;
pub mod rtde;
pub mod rws;
pub mod rws_protocol;
pub mod trial;
pub mod ur;

use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use thiserror::Error;
use trical_model::Forward;
use trical_model::error::read_text;
use trical_model::recording::Joints;

use self::rapid_protocol::{NO_SECRET, is_secret};
use crate::connection;
use crate::gauge::shorten;
use crate::url::{DeviceUrl, Secret, UrlError};
use trical_recording::motion::JointSample;

pub use rapid::{RapidClient, RapidSettings};
pub use rws::{RwsClient, RwsSettings};
pub use ur::{UrClient, UrSettings};

/// How often the user has asked for the end, and whether a motion is under way.
///
/// A motion under way is stopped when the number grows, and none begins after the first request, until whoever leads the arm back says
/// that it was [heard](Self::hear). After the second one none does.
#[derive(Debug, Default)]
pub struct StopRequests {
    asked: AtomicUsize,
    heard: AtomicUsize,
    moving: AtomicBool,
}

impl StopRequests {
    /// Asks once more; gives how often that was done before.
    pub fn ask(&self) -> usize {
        self.asked.fetch_add(1, Ordering::SeqCst)
    }

    /// What was asked for so far is being done: the motions that follow lead the arm back.
    pub fn hear(&self) {
        self.heard.store(self.asked.load(Ordering::SeqCst), Ordering::SeqCst);
    }

    /// Whether a motion is under way, or its stop. After two requests none begins: once this is false the program may end.
    pub fn is_moving(&self) -> bool {
        self.moving.load(Ordering::SeqCst)
    }
}

/// Shared by who asks and who moves.
pub type StopCount = Arc<StopRequests>;

/// What a driver knows of stops: nobody asks for any until it is told who may.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stops(StopCount);

impl Stops {
    pub(crate) fn listen(&mut self, count: StopCount) {
        self.0 = count;
    }

    /// A motion begins, if it may: it is under way until what this gives is dropped.
    pub(crate) fn begin(&self) -> Result<Motion, ControllerError> {
        let stops = Arc::clone(&self.0);
        // in this order: who asks looks whether anything moves after it has counted
        stops.moving.store(true, Ordering::SeqCst);
        let motion = Motion { before: stops.asked.load(Ordering::SeqCst), stops };
        let heard = motion.stops.heard.load(Ordering::SeqCst);
        if motion.before > heard || motion.before > 1 { Err(ControllerError::NotBegun) } else { Ok(motion) }
    }
}

/// A motion under way.
pub(crate) struct Motion {
    stops: StopCount,
    before: usize,
}

impl Motion {
    /// Whether the user has asked to stop it.
    pub(crate) fn is_to_stop(&self) -> bool {
        self.stops.asked.load(Ordering::SeqCst) > self.before
    }
}

impl Drop for Motion {
    fn drop(&mut self) {
        self.stops.moving.store(false, Ordering::SeqCst);
    }
}

/// A stop is looked for this often while the arm moves.
pub(crate) const LOOK_FOR_STOP: Duration = Duration::from_millis(50);

/// How long a controller may take to say that the arm stands after a stop.
pub(crate) const STOP_TIMEOUT: Duration = Duration::from_secs(5);

/// A robot controller.
///
/// Motions return when the arm stands still at the target, or with an error; none is queued.
pub trait Controller: Send {
    /// What it is and where, for messages.
    fn name(&self) -> String;

    /// Number of the arm's joints.
    fn joint_count(&self) -> usize;

    /// Asks for a sign of life.
    ///
    /// # Errors
    /// No or a wrong answer.
    fn ping(&mut self) -> Result<(), ControllerError>;

    /// Joint values that the controller reports, rad.
    ///
    /// # Errors
    /// No or a wrong answer.
    fn joints(&mut self) -> Result<Joints, ControllerError>;

    /// Moves all joints to `target` (rad) and stops there.
    ///
    /// # Errors
    /// The controller refuses or does not answer in time.
    fn move_joints(&mut self, target: &Joints) -> Result<(), ControllerError>;

    /// Displaces the TCP by `displacement` (m, in the tool's axes) on a straight line, orientation kept, and stops.
    ///
    /// # Errors
    /// The controller refuses (its own limits) or does not answer in time.
    fn correct(&mut self, displacement: [f64; 3]) -> Result<(), ControllerError>;

    /// Speed of the motions that follow: of the TCP in m/s, of rotation in rad/s.
    ///
    /// # Errors
    /// The controller refuses or does not answer in time.
    fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), ControllerError>;

    /// Tells the controller where the TCP is, in the flange's frame and m; the tool's axes are those of the flange.
    ///
    /// # Errors
    /// The controller refuses or does not answer in time.
    fn set_tool(&mut self, tcp_in_flange: [f64; 3]) -> Result<(), ControllerError>;

    /// The controller's clock in s; it is the time base of a recording.
    ///
    /// # Errors
    /// No or a wrong answer.
    fn clock(&mut self) -> Result<f64, ControllerError>;

    /// Temperature in degC, where the controller has a sensor.
    ///
    /// # Errors
    /// A wrong answer.
    fn temperature(&mut self) -> Result<Option<f64>, ControllerError> {
        Ok(None)
    }

    /// Serial number, where the controller tells one.
    ///
    /// # Errors
    /// No or a wrong answer.
    fn serial_number(&mut self) -> Result<Option<String>, ControllerError> {
        Ok(None)
    }

    /// Who may stop a motion under way: it then ends, through the controller, with [`ControllerError::Stopped`]. A controller
    /// without this finishes its motion.
    fn stop_when(&mut self, _count: StopCount) {}

    /// Which arm it moves: joints that slide, and how far the tool goes when joints turn. Until this is said all joints turn.
    fn set_arm(&mut self, _arm: &Forward) {}

    /// When the joints of this arm are taken as standing still.
    fn joint_settle(&self) -> JointSettle {
        JointSettle::default()
    }

    /// Where the joints have been since the last call, by the controller's clock, in the order of time.
    fn take_history(&mut self) -> Vec<JointSample> {
        Vec::new()
    }
}

/// When the joints stand still.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSettle {
    /// Largest difference between two readings, rad. The noise of a standing IRC5 is not known \[I\].
    pub tolerance: f64,
    /// Pause between two readings.
    pub interval: Duration,
    /// How long to try.
    pub timeout: Duration,
}

impl Default for JointSettle {
    fn default() -> Self {
        Self {
            tolerance: 0.001_f64.to_radians(),
            interval: Duration::from_millis(200),
            timeout: Duration::from_secs(10),
        }
    }
}

/// Why a controller did not do as it was told.
#[derive(Debug, Error)]
pub enum ControllerError {
    /// The URL cannot be used.
    #[error(transparent)]
    Url(#[from] UrlError),
    /// No connection.
    #[error(
        "robot controller {address}: cannot connect ({reason}); is it on and at this address, and does its program for TriCal run?"
    )]
    Connect {
        /// Address that was tried.
        address: String,
        /// What the operating system said.
        reason: String,
    },
    /// The connection failed while in use.
    #[error("robot controller {controller}: the connection is lost ({reason})")]
    Lost {
        /// Name of the controller.
        controller: String,
        /// Why.
        reason: String,
    },
    /// No answer in time.
    #[error("robot controller {controller}: no answer to {request:?} within {seconds} s")]
    Silent {
        /// Name of the controller.
        controller: String,
        /// The request.
        request: String,
        /// Time-out in s.
        seconds: f64,
    },
    /// The controller refuses.
    #[error("robot controller {controller}: refused {request:?} ({reason})")]
    Refused {
        /// Name of the controller.
        controller: String,
        /// The request.
        request: String,
        /// What the controller says.
        reason: String,
    },
    /// The controller wants a secret, or another one.
    #[error(
        "robot controller {controller}: {reason}; secret= in the URL is to be SECRET of its module, or none on both sides"
    )]
    Secret {
        /// Name of the controller.
        controller: String,
        /// What the controller says.
        reason: String,
    },
    /// An answer that is none.
    #[error("robot controller {controller}: answered \"{found}\" to {request:?}, expected {expected}")]
    Garbage {
        /// Name of the controller.
        controller: String,
        /// The request.
        request: String,
        /// What came, shortened.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// The arm stands for its safety.
    #[error("robot controller {controller}: {what} (safety mode {mode}): {remedy}")]
    SafetyStop {
        /// Name of the controller.
        controller: String,
        /// The controller's number of it.
        mode: i32,
        /// What kind of stop.
        what: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// Another program commands it, too.
    #[error(
        "robot controller {controller}: another program commands it, too: it has request {found}, and this program sent {expected}; expected one \
         program at a time: end the other one"
    )]
    OtherProgram {
        /// Name of the controller.
        controller: String,
        /// Number of the request that it has.
        found: u64,
        /// Number of the last request of this program.
        expected: u64,
    },
    /// The arm stands elsewhere than where it was sent.
    #[error(
        "robot controller {controller}: joint {joint} was sent to {sent_deg:.4} deg and reports {found_deg:.4} deg; expected them to agree \
         within 0.02 deg: was the motion stopped?"
    )]
    NotArrived {
        /// Name of the controller.
        controller: String,
        /// The joint that is farthest off, 1-based.
        joint: usize,
        /// Where it was sent, deg.
        sent_deg: f64,
        /// Where it is, deg.
        found_deg: f64,
    },
    /// The joints do not come to rest.
    #[error(
        "robot controller {controller}: joint {joint} still moves by {moves_deg:.5} deg between two readings after {seconds:.1} s"
    )]
    NotSettled {
        /// Name of the controller.
        controller: String,
        /// The joint that moves most, 1-based.
        joint: usize,
        /// By how much, in deg.
        moves_deg: f64,
        /// How long it was given, in s.
        seconds: f64,
    },
    /// The user asked to stop, and the controller has stopped the motion under way.
    #[error("stopped by the user in the middle of a motion")]
    Stopped,
    /// The user asked to stop before the motion began.
    #[error("stopped by the user before a motion began")]
    NotBegun,
    /// The controller was asked to stop the motion under way, and does not say that it did.
    #[error(
        "robot controller {controller}: asked to stop the arm, and has not confirmed it{}; use the emergency stop if it still moves",
        why.as_ref().map_or_else(String::new, |why| format!(" ({why})"))
    )]
    StopNotConfirmed {
        /// Name of the controller.
        controller: String,
        /// What else has failed.
        why: Option<Box<ControllerError>>,
    },
    /// The user asked to stop.
    #[error("stopped by the user while waiting for the arm to stand still")]
    Cancelled,
}

impl ControllerError {
    pub(crate) fn silent(controller: &str, request: &str, timeout: Duration) -> Self {
        Self::Silent { controller: controller.into(), request: request.into(), seconds: timeout.as_secs_f64() }
    }

    pub(crate) fn stop_not_confirmed(controller: &str, why: Self) -> Self {
        Self::StopNotConfirmed {
            controller: controller.into(),
            why: (!matches!(why, Self::Stopped)).then(|| Box::new(why)),
        }
    }

    pub(crate) fn refused(controller: &str, request: &str, reason: impl Into<String>) -> Self {
        Self::Refused { controller: controller.into(), request: request.into(), reason: reason.into() }
    }

    pub(crate) fn garbage(controller: &str, request: &str, found: &[u8], expected: impl Into<String>) -> Self {
        let (found, expected) = (shorten(found), expected.into());
        Self::Garbage { controller: controller.into(), request: request.into(), found, expected }
    }
}

/// A serial number out of what a controller answers: one word that has a digit. Others say that there is none, or that they do not understand.
pub(crate) fn serial_number_in(answer: &str) -> Option<String> {
    let word = answer.trim();
    let is_one = word.bytes().all(|b| b.is_ascii_graphic()) && word.bytes().any(|b| b.is_ascii_digit());
    is_one.then(|| word.to_owned())
}

/// How far a joint may stand from where it was sent, rad.
pub(crate) const ARRIVAL: f64 = 0.02 * std::f64::consts::PI / 180.0;

/// Moves all joints, and looks whether they have arrived.
///
/// # Errors
/// What [`Controller::move_joints`] and [`wait_settled`] say, or [`ControllerError::NotArrived`].
pub fn moved(controller: &mut dyn Controller, target: &Joints) -> Result<(), ControllerError> {
    controller.move_joints(target)?;
    let settle = controller.joint_settle();
    let at = wait_settled(controller, &settle, &AtomicBool::new(false))?;
    let (joint, off) = largest_difference(target, &at);
    if off <= ARRIVAL {
        return Ok(());
    }
    let [sent_deg, found_deg] = [target, &at].map(|q| q.get(joint).map_or(f64::NAN, |q| q.to_degrees()));
    Err(ControllerError::NotArrived { controller: controller.name(), joint: joint + 1, sent_deg, found_deg })
}

/// After a controller was told to stop the motion under way: it has when the joints stand.
pub(crate) fn confirmed_stop(controller: &mut dyn Controller) -> ControllerError {
    let settle = JointSettle { tolerance: 1e-4, interval: Duration::from_millis(200), timeout: STOP_TIMEOUT };
    match wait_settled(controller, &settle, &AtomicBool::new(false)) {
        Ok(_) => ControllerError::Stopped,
        Err(why) => ControllerError::stop_not_confirmed(&controller.name(), why),
    }
}

/// A connection to `host:port`, of which a read may take so long.
pub(crate) fn connected(address: &str, timeout: Duration, read: Duration) -> Result<TcpStream, ControllerError> {
    connection::connected(address, timeout, read)
        .map_err(|reason| ControllerError::Connect { address: address.to_owned(), reason })
}

/// Opens a controller by its URL.
///
/// `rapid://host:port` is an ABB IRC5 that runs `rapid/TriCal.mod` (default port 5000). Options: `timeout_s` (of an
/// answer), `move_timeout_s` (of a motion), `stream_ms` (joints while moving; 0 = off), `settle_ms` (pause between the two
/// readings of the joints that must agree), `secret` (what the module has as `SECRET`; `none` where it has none, `@FILE` for
/// the first line of a file).
///
/// `rws://host:port` is an ABB controller with RobotWare 6 behind Robot Web Services 1.0 (default port 80); motions need
/// `rapid/TriCalRws.mod`, reading the joints does not. Options: `user` and `password` (`@FILE` for the first line of a file), or
/// `login=factory` for those of every new controller; `certificate` (PEM file: https, default port 443), `task`, `module`, `unit`, `timeout_s`, `move_timeout_s`, `poll_ms`, `settle_ms`.
///
/// `ur://host` is a Universal Robots controller in remote control: URScript and RTDE. Options: `timeout_s`,
/// `move_timeout_s`, `settle_ms`, `max_correction_mm`, `rtde_port`, `script_port`, `dashboard_port`.
///
/// # Errors
/// A URL that cannot be used, no connection, or something else that answers there.
pub fn open_controller(url: &str) -> Result<Box<dyn Controller>, ControllerError> {
    let mut url = DeviceUrl::parse(url)?;
    match url.scheme.as_str() {
        "rapid" => {
            let settings = rapid_settings(&mut url)?;
            Ok(Box::new(RapidClient::connect(&with_port(&url.place, 5000), settings)?))
        }
        "rws" => {
            let settings = rws_settings(&mut url)?;
            let port = if settings.certificate.is_some() { 443 } else { 80 };
            Ok(Box::new(RwsClient::connect(&with_port(&url.place, port), settings)?))
        }
        "ur" => {
            let settings = ur_settings(&mut url)?;
            Ok(Box::new(UrClient::connect(&url.place, settings)?))
        }
        _ => Err(url.error(format!("unknown controller {:?}; known are rapid, rws and ur", url.scheme)).into()),
    }
}

/// A host that says no port with its usual one.
fn with_port(place: &str, port: u16) -> String {
    if says_port(place) { place.to_owned() } else { format!("{place}:{port}") }
}

/// Whether a port stands behind a host; an address of IPv6 is in brackets.
fn says_port(place: &str) -> bool {
    place.rsplit_once(']').map_or(place, |(_, behind)| behind).contains(':')
}

fn seconds(url: &mut DeviceUrl, key: &str, default: Duration) -> Result<Duration, UrlError> {
    let number = url.take_number(key, default.as_secs_f64(), 0.01..=86_400.0)?;
    Ok(Duration::from_secs_f64(number))
}

fn milliseconds(url: &mut DeviceUrl, key: &str, default: Duration) -> Result<Duration, UrlError> {
    let number = url.take_number(key, default.as_secs_f64() * 1e3, 0.0..=60_000.0)?;
    Ok(Duration::from_micros((number * 1e3) as u64))
}

fn settle(url: &mut DeviceUrl) -> Result<JointSettle, UrlError> {
    let default = JointSettle::default();
    Ok(JointSettle { interval: milliseconds(url, "settle_ms", default.interval)?, ..default })
}

fn rapid_settings(url: &mut DeviceUrl) -> Result<RapidSettings, UrlError> {
    let defaults = RapidSettings::default();
    let secret = url.take_secret("secret")?.filter(|secret| secret.text() != NO_SECRET);
    if secret.as_ref().is_some_and(|secret| !is_secret(secret.text())) {
        return Err(url.error("option \"secret\": expected 8 to 40 letters and digits, or none"));
    }
    let settings = RapidSettings {
        timeout: seconds(url, "timeout_s", defaults.timeout)?,
        move_timeout: seconds(url, "move_timeout_s", defaults.move_timeout)?,
        stream: milliseconds(url, "stream_ms", defaults.stream)?,
        settle: settle(url)?,
        secret,
    };
    url.finish("secret, timeout_s, move_timeout_s, stream_ms, settle_ms")?;
    Ok(settings)
}

fn rws_settings(url: &mut DeviceUrl) -> Result<RwsSettings, UrlError> {
    let defaults = RwsSettings::default();
    let (user, password) = match (url.take("login").as_deref(), url.take("user"), url.take_secret("password")?) {
        (Some("factory"), None, None) => (rws::FACTORY_LOGIN.0.to_owned(), Secret::new(rws::FACTORY_LOGIN.1)),
        (None, Some(user), Some(password)) => (user, password),
        _ => {
            let expected = "expected user= and password=, or login=factory for those that every new controller has";
            return Err(url.error(format!("no user and password: {expected}")));
        }
    };
    let certificate = url.take("certificate").map(|path| read_text(Path::new(&path))).transpose();
    let certificate = certificate.map_err(|e| url.error(e.to_string()))?;
    let mut word = |key: &str, default: String| url.take(key).unwrap_or(default);
    let [task, module, unit] =
        [word("task", defaults.task), word("module", defaults.module), word("unit", defaults.unit)];
    for (key, name) in [("task", &task), ("module", &module), ("unit", &unit)] {
        if name.is_empty() || !name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') {
            return Err(url.error(format!("option {key}={name:?}; expected letters, digits and _")));
        }
    }
    let settings = RwsSettings {
        user,
        password,
        certificate,
        task,
        module,
        unit,
        timeout: seconds(url, "timeout_s", defaults.timeout)?,
        move_timeout: seconds(url, "move_timeout_s", defaults.move_timeout)?,
        poll: milliseconds(url, "poll_ms", defaults.poll)?,
        settle: settle(url)?,
    };
    url.finish(
        "user, password, login, certificate, task, module, unit, timeout_s, move_timeout_s, poll_ms, settle_ms",
    )?;
    Ok(settings)
}

fn ur_settings(url: &mut DeviceUrl) -> Result<UrSettings, UrlError> {
    let defaults = UrSettings::default();
    let settings = UrSettings {
        rtde_port: url.take_number("rtde_port", f64::from(defaults.rtde_port), 1.0..=65_535.0)? as u16,
        script_port: url.take_number("script_port", f64::from(defaults.script_port), 1.0..=65_535.0)? as u16,
        dashboard_port: url.take_number("dashboard_port", f64::from(defaults.dashboard_port), 1.0..=65_535.0)? as u16,
        timeout: seconds(url, "timeout_s", defaults.timeout)?,
        move_timeout: seconds(url, "move_timeout_s", defaults.move_timeout)?,
        correction_limit: url.take_number("max_correction_mm", defaults.correction_limit * 1e3, 0.0..=10.0)? * 1e-3,
        settle: settle(url)?,
    };
    url.finish("timeout_s, move_timeout_s, settle_ms, max_correction_mm, rtde_port, script_port, dashboard_port")?;
    if says_port(&url.place) {
        return Err(url.error("a port behind the host; expected rtde_port= and script_port="));
    }
    Ok(settings)
}

/// Reads the joints until two readings agree, and gives the last.
///
/// # Errors
/// What [`Controller::joints`] says, joints that are no numbers or do not come to rest in time, or cancellation.
pub fn wait_settled(
    controller: &mut dyn Controller,
    settle: &JointSettle,
    cancel: &AtomicBool,
) -> Result<Joints, ControllerError> {
    let begin = Instant::now();
    let mut before = controller.joints()?;
    loop {
        if !settle.interval.is_zero() {
            std::thread::sleep(settle.interval);
        }
        let now = controller.joints()?;
        if let Some(joint) = now.iter().position(|q| !q.is_finite()) {
            return Err(ControllerError::Garbage {
                controller: controller.name(),
                request: "where are the joints".into(),
                found: format!("joint {} at {}", joint + 1, now[joint]),
                expected: "an angle".into(),
            });
        }
        let (joint, moves) = largest_difference(&before, &now);
        if moves <= settle.tolerance {
            return Ok(now);
        }
        if cancel.load(Ordering::Relaxed) {
            return Err(ControllerError::Cancelled);
        }
        if begin.elapsed() >= settle.timeout {
            return Err(ControllerError::NotSettled {
                controller: controller.name(),
                joint: joint + 1,
                moves_deg: moves.to_degrees(),
                seconds: begin.elapsed().as_secs_f64(),
            });
        }
        before = now;
    }
}

/// The joint (0-based) where two sets of values differ most, and by how much.
pub(crate) fn largest_difference(a: &Joints, b: &Joints) -> (usize, f64) {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).enumerate().fold((0, 0.0), |best, (joint, difference)| {
        if difference > best.1 || difference.is_nan() { (joint, difference) } else { best }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn says(url: &str) -> String {
        match open_controller(url) {
            Ok(_) => "opened".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_bad_url_is_one_clear_sentence() {
        assert!(says("kuka://host").contains("unknown controller \"kuka\""));
        assert!(says("rws://host?login=factory&module=a/b").contains("letters, digits"));
        assert!(says("rws://127.0.0.1:1?login=factory").contains("cannot connect"));
        assert!(says("rws://127.0.0.1:1?user=me&password=p").contains("cannot connect"));
        for unsaid in ["", "?user=me", "?password=p", "?login=default", "?login=factory&user=me"] {
            assert!(says(&format!("rws://127.0.0.1:1{unsaid}")).contains("login=factory for those"), "{unsaid}");
        }
        assert!(says("rapid://host?secret=short").contains("8 to 40 letters and digits"));
        assert!(says("rapid://host?speed=1").contains("unknown option \"speed\""));
        assert!(says("rapid://127.0.0.1:1").contains("cannot connect"));
        assert!(says("rapid://127.0.0.1:99999").contains("found port \"99999\", expected 1 to 65535"));
        assert!(says("rapid://").contains("nothing between"));
        assert!(
            says("ur://[::1]:30002").contains("a port behind the host") && says("ur://10.0.0.1:2").contains("a port")
        );
    }

    #[test]
    fn only_one_word_with_a_digit_is_a_serial_number() {
        assert_eq!(serial_number_in(" 120-501234\r\n").as_deref(), Some("120-501234"));
        for none in ["", "could not understand: 'get serial number 1'", "unknown", "-"] {
            assert_eq!(serial_number_in(none), None, "{none}");
        }
    }

    #[test]
    fn an_address_of_ipv6_has_its_port_behind_the_brackets() {
        for (place, full) in [("a", "a:7"), ("a:1", "a:1"), ("[::1]", "[::1]:7"), ("[::1]:1", "[::1]:1")] {
            assert_eq!(with_port(place, 7), full);
        }
    }
}
