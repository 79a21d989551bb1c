//! Client of the RAPID dialect, over TCP or any other byte stream.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use trical_model::Forward;
use trical_model::recording::{Joints, MAX_JOINTS};

use super::rapid_protocol::{self as protocol, Reply, code};
use super::{
    Controller, ControllerError, JointSettle, LOOK_FOR_STOP, Motion, STOP_TIMEOUT, StopCount, Stops, confirmed_stop,
    connected, serial_number_in,
};
use crate::gauge::port::{Port, is_not_yet};
use crate::gauge::shorten;
use crate::url::Secret;
use trical_recording::motion::JointSample;

/// How often each end of the line hears of the other while the arm moves.
const ALIVE_EVERY: Duration = Duration::from_secs(1);

/// Answers that were sent in time are taken so long after it; a controller that never ends sending is not heard for ever.
const LATE: Duration = Duration::from_secs(1);

/// More joint samples than any motion has; a controller that sends more is not ours.
const MOST_SAMPLES: usize = 100_000;

/// Settings of the connection.
#[derive(Clone, Debug, PartialEq)]
pub struct RapidSettings {
    /// How long an answer may take.
    pub timeout: Duration,
    /// How long a motion may take.
    pub move_timeout: Duration,
    /// Interval of joint samples while the arm moves; zero = none.
    ///
    /// They come from a trap routine in the module; whether every controller lets a trap send while a motion waits is
    /// not known \[I\], so a controller that refuses is used without.
    pub stream: Duration,
    /// When the joints stand still.
    pub settle: JointSettle,
    /// What the module has as `SECRET`; `None` where it has none.
    pub secret: Option<Secret>,
}

impl Default for RapidSettings {
    fn default() -> Self {
        Self {
            timeout: Duration::from_secs(10),
            move_timeout: Duration::from_secs(120),
            stream: Duration::from_millis(100),
            settle: JointSettle::default(),
            secret: None,
        }
    }
}

/// An ABB controller that runs `rapid/TriCal.mod`.
pub struct RapidClient<S> {
    stream: S,
    name: String,
    settings: RapidSettings,
    buffer: Vec<u8>,
    joints: usize,
    slides: [bool; MAX_JOINTS],
    correction_limit: f64,
    history: Vec<JointSample>,
    stops: Stops,
    /// Why the connection can no longer be used: a late answer would be taken for the next one.
    broken: Option<String>,
}

impl RapidClient<TcpStream> {
    /// Connects to `host:port` and asks who is there.
    ///
    /// # Errors
    /// No connection, or something else answers.
    pub fn connect(address: &str, settings: RapidSettings) -> Result<Self, ControllerError> {
        let stream = connected(address, settings.timeout, Duration::from_millis(50))?;
        Self::new(stream, format!("rapid {address}"), settings)
    }
}

impl<S: Port> RapidClient<S> {
    /// A client on an open stream whose reads time out after a few milliseconds; asks who is there.
    ///
    /// # Errors
    /// Something else answers, or nothing.
    pub fn new(stream: S, name: impl Into<String>, settings: RapidSettings) -> Result<Self, ControllerError> {
        let mut client = Self {
            stream,
            name: name.into(),
            settings,
            buffer: Vec::new(),
            joints: 0,
            slides: [false; MAX_JOINTS],
            correction_limit: 0.0,
            history: Vec::new(),
            stops: Stops::default(),
            broken: None,
        };
        client.login()?;
        client.identify()?;
        let fine = protocol::write_request(code::ZONE, &[1.0], 0);
        client.request(code::ZONE, &fine, client.settings.timeout)?;
        let interval = client.settings.stream.as_secs_f64() * 1e3;
        let stream = protocol::write_request(code::STREAM, &[interval], 0);
        match client.request(code::STREAM, &stream, client.settings.timeout) {
            Ok(_) | Err(ControllerError::Refused { .. }) => Ok(client),
            Err(error) => Err(error),
        }
    }

    /// Largest correction that the controller takes, m.
    pub fn correction_limit(&self) -> f64 {
        self.correction_limit
    }

    /// Gives the secret, before anything else.
    fn login(&mut self) -> Result<(), ControllerError> {
        let Some(secret) = &self.settings.secret else { return Ok(()) };
        let message = protocol::write_login(secret.text());
        self.send(&message)?;
        self.reply(code::LOGIN, "27 ... #", self.settings.timeout).map(|_| ())
    }

    fn identify(&mut self) -> Result<(), ControllerError> {
        let request = protocol::write_request(code::IDENTIFY, &[], 0);
        let version = protocol::VERSION;
        let expected = format!("TriCal {version} and its number of joints; load rapid/TriCal.mod into the controller");
        let answer = match self.request(code::IDENTIFY, &request, self.settings.timeout) {
            Err(ControllerError::Refused { controller, reason: found, .. }) => {
                return Err(ControllerError::Garbage { controller, request: "24 #".to_owned(), found, expected });
            }
            other => other?,
        };
        let words: Vec<&str> = answer.split_ascii_whitespace().collect();
        let parsed = match words.as_slice() {
            ["TriCal", version, joints, limit] => {
                let version: Option<u32> = version.parse().ok().filter(|version| *version == protocol::VERSION);
                let joints: Option<usize> = joints.parse().ok().filter(|count| (1..=MAX_JOINTS).contains(count));
                let limit: Option<f64> = limit.parse().ok().filter(|limit: &f64| limit.is_finite());
                version.and(joints).zip(limit)
            }
            _ => None,
        };
        let (joints, limit) = parsed.ok_or_else(|| self.garbage("24 #", answer.as_bytes(), expected))?;
        (self.joints, self.correction_limit) = (joints, limit * 1e-3);
        Ok(())
    }

    fn lost(&mut self, reason: String) -> ControllerError {
        self.broken = Some(reason.clone());
        ControllerError::Lost { controller: self.name.clone(), reason }
    }

    /// Whether the connection can still be used.
    fn whole(&self) -> Result<(), ControllerError> {
        match self.broken.clone() {
            Some(reason) => Err(ControllerError::Lost { controller: self.name.clone(), reason }),
            None => Ok(()),
        }
    }

    /// Sends a request and waits for its reply; samples of the stream are kept on the way.
    fn request(&mut self, wanted: u8, request: &str, timeout: Duration) -> Result<String, ControllerError> {
        self.whole()?;
        self.check_nothing_came(request)?;
        self.send(request)?;
        self.reply(wanted, request, timeout)
    }

    /// Before a request is sent: what has come by then answers an earlier one a second time, and would be taken for the answer to this one.
    fn check_nothing_came(&mut self, request: &str) -> Result<(), ControllerError> {
        while self.buffer.len() <= protocol::LONGEST && self.stream.waiting().map_err(|e| self.lost(e.to_string()))? > 0
        {
            self.read()?;
        }
        while let Some(message) = self.buffered() {
            match protocol::parse_reply(&message) {
                Some(Reply { code: code::SAMPLE, ok: true, data }) if self.keep_sample(&data) => {}
                Some(Reply { code: code::ALIVE, .. }) => {}
                _ => {
                    let found = shorten(&message);
                    return Err(self.lost(format!(
                        "it said \"{found}\" before {request:?} was sent; expected nothing: it has answered an earlier request twice"
                    )));
                }
            }
        }
        Ok(())
    }

    /// The reply to a request that was sent, which is shown in messages as `request`.
    fn reply(&mut self, wanted: u8, request: &str, timeout: Duration) -> Result<String, ControllerError> {
        let deadline = Instant::now() + timeout;
        loop {
            let Some(message) = self.next_message(deadline)? else {
                self.broken = Some(format!("no answer to {request:?} before"));
                return Err(ControllerError::silent(&self.name, request, timeout));
            };
            if let Some(Reply { code: code::LOGIN, ok: false, data }) = protocol::parse_reply(&message) {
                self.broken = Some(data.clone());
                return Err(ControllerError::Secret { controller: self.name.clone(), reason: data });
            }
            if let Some(data) = self.reply_to(wanted, request, &message, false)? {
                return Ok(data);
            }
        }
    }

    /// What a message answers to a request that was sent: the data of its reply, or nothing yet.
    fn reply_to(
        &mut self,
        wanted: u8,
        request: &str,
        message: &[u8],
        moves: bool,
    ) -> Result<Option<String>, ControllerError> {
        match protocol::parse_reply(message) {
            Some(Reply { code: code::SAMPLE, ok: true, data }) if self.keep_sample(&data) => Ok(None),
            // perhaps to a sign of life that came when the motion had ended; a module that does not know it refuses it, and is alive
            Some(Reply { code: code::ALIVE, .. }) => Ok(None),
            Some(reply) if reply.code == wanted && reply.ok => Ok(Some(reply.data)),
            Some(reply) if reply.code == wanted => {
                let reason = if reply.data.is_empty() { "without a reason" } else { &reply.data };
                Err(ControllerError::refused(&self.name, request, reason))
            }
            _ => {
                if moves {
                    let _ = self.send(&protocol::write_request(code::STOP, &[], 0));
                }
                self.broken = Some(format!("an answer before was \"{}\"", shorten(message)));
                Err(self.garbage(request, message, format!("{wanted:02} 1 ... #")))
            }
        }
    }

    fn send(&mut self, request: &str) -> Result<(), ControllerError> {
        let sent = self.stream.write_all(request.as_bytes()).and_then(|()| self.stream.flush());
        sent.map_err(|error| self.lost(error.to_string()))
    }

    /// After the motion's request: waits for its reply. Meanwhile each end tells the other that it is alive, and the arm is
    /// stopped where the user asks for it.
    fn motion_reply(&mut self, wanted: u8, request: &str, motion: &Motion) -> Result<(), ControllerError> {
        let (begin, timeout) = (Instant::now(), self.settings.move_timeout);
        let (mut heard, mut said) = (begin, begin);
        loop {
            let now = Instant::now();
            if motion.is_to_stop() {
                return Err(self.stop());
            }
            let silent = [(now - begin, timeout), (now - heard, self.settings.timeout.max(2 * ALIVE_EVERY))];
            if let Some((_, limit)) = silent.into_iter().find(|(time, limit)| time >= limit) {
                // whatever the arm does now, it is not waited for
                let _ = self.send(&protocol::write_request(code::STOP, &[], 0));
                self.broken = Some(format!("no answer to {request:?} before"));
                return Err(ControllerError::silent(&self.name, request, limit));
            }
            if now - said >= ALIVE_EVERY {
                said = now;
                self.send(&protocol::write_request(code::ALIVE, &[], 0))?;
            }
            let Some(message) = self.next_message((now + LOOK_FOR_STOP).min(begin + timeout))? else { continue };
            heard = Instant::now();
            if self.reply_to(wanted, request, &message, true)?.is_some() {
                return Ok(());
            }
        }
    }

    /// Stops the motion under way: done when the controller has answered, behind whatever it still had to say, and the joints stand still.
    fn stop(&mut self) -> ControllerError {
        let wait = |client: &mut Self| -> Result<bool, ControllerError> {
            client.send(&protocol::write_request(code::STOP, &[], 0))?;
            let deadline = Instant::now() + STOP_TIMEOUT;
            while let Some(message) = client.next_message(deadline)? {
                match protocol::parse_reply(&message) {
                    Some(Reply { code: code::STOP, ok: true, .. }) => return Ok(true),
                    Some(Reply { code: code::STOP, ok: false, data }) => {
                        client.broken = Some("it refused to stop".to_owned());
                        return Err(ControllerError::refused(&client.name, "25 #", data));
                    }
                    _ => {}
                }
            }
            Ok(false)
        };
        match wait(self) {
            Ok(true) => confirmed_stop(self),
            Ok(false) => {
                self.broken = Some("it did not confirm a stop".to_owned());
                ControllerError::stop_not_confirmed(
                    &self.name,
                    ControllerError::silent(&self.name, "stop", STOP_TIMEOUT),
                )
            }
            Err(why) => ControllerError::stop_not_confirmed(&self.name, why),
        }
    }

    fn garbage(&self, request: &str, found: &[u8], expected: impl Into<String>) -> ControllerError {
        ControllerError::garbage(&self.name, request, found, expected)
    }

    fn next_message(&mut self, deadline: Instant) -> Result<Option<Vec<u8>>, ControllerError> {
        loop {
            if Instant::now() >= deadline + LATE {
                return Ok(None);
            }
            if let Some(message) = self.buffered() {
                return Ok(Some(message));
            }
            if self.buffer.len() > protocol::LONGEST {
                let found = std::mem::take(&mut self.buffer);
                return Err(self.lost(format!("it sends \"{}\" and no end of message", shorten(&found))));
            }
            if Instant::now() >= deadline {
                return Ok(None);
            }
            self.read()?;
        }
    }

    /// The first whole message of those that have come, without its `#`.
    fn buffered(&mut self) -> Option<Vec<u8>> {
        let end = self.buffer.iter().position(|byte| *byte == b'#')?;
        Some(self.buffer.drain(..=end).take(end).collect())
    }

    /// Takes what has come, or comes within a few milliseconds.
    fn read(&mut self) -> Result<(), ControllerError> {
        let mut bytes = [0_u8; 256];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Err(self.lost("closed at its other end".to_owned())),
            Ok(count) => self.buffer.extend_from_slice(bytes.get(..count).unwrap_or_default()),
            Err(error) if is_not_yet(&error) => {}
            Err(error) => return Err(self.lost(error.to_string())),
        }
        Ok(())
    }

    fn keep_sample(&mut self, data: &str) -> bool {
        let Some(numbers) = protocol::parse_numbers(data) else { return false };
        let Some((t, degrees)) = numbers.split_first() else { return false };
        let Some(q) = protocol::parse_joints(degrees, self.joints, &self.slides) else { return false };
        self.history.push(JointSample { t: *t, q });
        self.history.len() < MOST_SAMPLES
    }

    fn simple(&mut self, wanted: u8, parameters: &[f64], decimals: usize) -> Result<String, ControllerError> {
        let request = protocol::write_request(wanted, parameters, decimals);
        self.request(wanted, &request, self.settings.timeout)
    }

    fn motion(&mut self, wanted: u8, parameters: &[f64], decimals: usize) -> Result<(), ControllerError> {
        self.whole()?;
        let request = protocol::write_request(wanted, parameters, decimals);
        let motion = self.stops.begin()?;
        self.check_nothing_came(&request)?;
        self.send(&request)?;
        self.motion_reply(wanted, &request, &motion)
    }
}

impl<S: Port> Controller for RapidClient<S> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn joint_count(&self) -> usize {
        self.joints
    }

    fn ping(&mut self) -> Result<(), ControllerError> {
        self.simple(code::PING, &[], 0).map(|_| ())
    }

    fn joints(&mut self) -> Result<Joints, ControllerError> {
        let answer = self.simple(code::JOINTS, &[], 0)?;
        protocol::parse_numbers(&answer)
            .and_then(|degrees| protocol::parse_joints(&degrees, self.joints, &self.slides))
            .ok_or_else(|| self.garbage("04 #", answer.as_bytes(), format!("{} joint values in degrees", self.joints)))
    }

    fn move_joints(&mut self, target: &Joints) -> Result<(), ControllerError> {
        self.motion(code::MOVE_JOINTS, &protocol::joint_parameters(target, self.joints, &self.slides), 5)
    }

    fn correct(&mut self, displacement: [f64; 3]) -> Result<(), ControllerError> {
        self.motion(code::CORRECT, &displacement.map(|d| d * 1e3), 5)
    }

    fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), ControllerError> {
        self.simple(code::SPEED, &[linear * 1e3, angular.to_degrees()], 3).map(|_| ())
    }

    fn set_tool(&mut self, tcp_in_flange: [f64; 3]) -> Result<(), ControllerError> {
        let [x, y, z] = tcp_in_flange.map(|p| p * 1e3);
        self.simple(code::TOOL, &[x, y, z, 1.0, 0.0, 0.0, 0.0], 4).map(|_| ())
    }

    fn clock(&mut self) -> Result<f64, ControllerError> {
        let answer = self.simple(code::CLOCK, &[], 0)?;
        match protocol::parse_numbers(&answer).as_deref() {
            Some([seconds]) => Ok(*seconds),
            _ => Err(self.garbage("21 #", answer.as_bytes(), "seconds")),
        }
    }

    fn temperature(&mut self) -> Result<Option<f64>, ControllerError> {
        let answer = match self.simple(code::TEMPERATURE, &[], 0) {
            Err(ControllerError::Refused { .. }) => return Ok(None),
            other => other?,
        };
        match protocol::parse_numbers(&answer).as_deref() {
            Some([]) => Ok(None),
            Some([temperature]) => Ok(Some(*temperature)),
            _ => Err(self.garbage("23 #", answer.as_bytes(), "a temperature in degC")),
        }
    }

    fn serial_number(&mut self) -> Result<Option<String>, ControllerError> {
        match self.simple(code::SERIAL_NUMBER, &[], 0) {
            // a module of an earlier version
            Err(ControllerError::Refused { .. }) => Ok(None),
            other => other.map(|answer| serial_number_in(&answer)),
        }
    }

    fn stop_when(&mut self, count: StopCount) {
        self.stops.listen(count);
    }

    fn set_arm(&mut self, arm: &Forward) {
        self.slides = arm.model().robot.prismatic();
    }

    fn joint_settle(&self) -> JointSettle {
        self.settings.settle.clone()
    }

    fn take_history(&mut self) -> Vec<JointSample> {
        std::mem::take(&mut self.history)
    }
}
