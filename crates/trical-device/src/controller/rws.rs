//! Client of ABB Robot Web Services 1.0 (RobotWare 6): joints, and motions by the variables of `rapid/TriCalRws.mod`.
//!
//! Nothing here was tried on a real controller. That setting a variable needs no mastership in automatic mode is what the
//! manual says for a local program; where a controller asks for it, it answers 403, and the error says so \[I\].

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::Arc;
use std::time::{Duration, Instant};

use digest_auth::{AuthContext, HttpMethod, WwwAuthenticateHeader};
use trical_model::Forward;
use trical_model::recording::{Joints, MAX_JOINTS};
use ureq::tls::{Certificate, RootCerts, TlsConfig};

use super::rapid_protocol::{self, code};
use super::rws_protocol as protocol;
use super::{
    Controller, ControllerError, JointSettle, Motion, STOP_TIMEOUT, StopCount, Stops, confirmed_stop, serial_number_in,
};
use crate::gauge::shorten;
use crate::url::Secret;
use trical_recording::motion::JointSample;

/// Stops the RAPID program.
const STOP_PATH: &str = "/rw/rapid/execution?action=stop";

/// User and password that every new controller has.
pub const FACTORY_LOGIN: (&str, &str) = ("Default User", "robotics");

/// Settings of the connection.
#[derive(Clone, Debug, PartialEq)]
pub struct RwsSettings {
    /// User of the controller.
    pub user: String,
    /// Password of the user; sent as a digest, and only when the controller asks.
    pub password: Secret,
    /// The controller's certificate or that of who issued it, as PEM: then the services are asked over https, and only where they
    /// have it. `None` = http.
    pub certificate: Option<String>,
    /// Task of the module.
    pub task: String,
    /// Name of the module.
    pub module: String,
    /// Name of the mechanical unit.
    pub unit: String,
    /// How long an answer may take.
    pub timeout: Duration,
    /// How long a motion may take.
    pub move_timeout: Duration,
    /// Pause between two looks whether a request is done; joints are sampled at each look.
    pub poll: Duration,
    /// When the joints stand still.
    pub settle: JointSettle,
}

impl Default for RwsSettings {
    fn default() -> Self {
        Self {
            user: String::new(),
            password: Secret::default(),
            certificate: None,
            task: "T_ROB1".to_owned(),
            module: "TriCalRws".to_owned(),
            unit: "ROB_1".to_owned(),
            timeout: Duration::from_secs(10),
            move_timeout: Duration::from_secs(120),
            poll: Duration::from_millis(100),
            settle: JointSettle::default(),
        }
    }
}

/// An ABB controller behind Robot Web Services 1.0.
pub struct RwsClient {
    agent: ureq::Agent,
    base: String,
    name: String,
    settings: RwsSettings,
    challenge: Option<WwwAuthenticateHeader>,
    cookies: Vec<(String, String)>,
    joints: usize,
    begin: Instant,
    /// What the module may show as the number of its request: the one that was there before, where the last that was sent is lost, and that one.
    /// `None` = the module was not asked yet.
    known: Option<[u64; 2]>,
    history: Vec<JointSample>,
    slides: [bool; MAX_JOINTS],
    stops: Stops,
}

impl RwsClient {
    /// Connects to `host[:port]` and reads the joints once.
    ///
    /// # Errors
    /// No connection, a certificate that is none or not the controller's, wrong user or password, or something else that answers.
    pub fn connect(address: &str, settings: RwsSettings) -> Result<Self, ControllerError> {
        let mut config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .timeout_global(Some(settings.timeout));
        if let Some(pem) = &settings.certificate {
            let certificate = Certificate::from_pem(pem.as_bytes()).map_err(|error| ControllerError::Connect {
                address: address.to_owned(),
                reason: format!("its certificate is no PEM: {error}"),
            })?;
            let tls = TlsConfig::builder()
                .root_certs(RootCerts::new_with_certs(&[certificate]))
                .unversioned_rustls_crypto_provider(Arc::new(rustls::crypto::ring::default_provider()));
            config = config.tls_config(tls.build()).https_only(true);
        }
        let scheme = if settings.certificate.is_some() { "https" } else { "http" };
        let mut client = Self {
            agent: config.build().into(),
            base: format!("{scheme}://{address}"),
            name: format!("rws {address}"),
            settings,
            challenge: None,
            cookies: Vec::new(),
            joints: 0,
            begin: Instant::now(),
            known: None,
            history: Vec::new(),
            slides: [false; MAX_JOINTS],
            stops: Stops::default(),
        };
        let path = protocol::joints_path(&client.settings.unit);
        match client.request(HttpMethod::GET, &path, "") {
            Err(ControllerError::Lost { reason, .. }) => {
                Err(ControllerError::Connect { address: address.to_owned(), reason })
            }
            Err(error) => Err(error),
            Ok(body) => {
                client.joints = client.parse_joints(&path, &body)?.1;
                Ok(client)
            }
        }
    }

    /// One HTTP exchange, without authentication of its own.
    fn exchange(
        &mut self,
        method: &HttpMethod<'_>,
        path: &str,
        body: &str,
        authorization: Option<&str>,
    ) -> Result<(u16, Option<String>, String), ControllerError> {
        let url = format!("{}{path}", self.base);
        let cookies = self.cookies.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join("; ");
        let headers = [("Authorization", authorization.unwrap_or_default()), ("Cookie", &cookies)];
        let headers = || headers.into_iter().filter(|(_, value)| !value.is_empty());
        let answer = if *method == HttpMethod::POST {
            let request = self.agent.post(&url).content_type("application/x-www-form-urlencoded");
            headers().fold(request, |request, (name, value)| request.header(name, value)).send(body)
        } else {
            headers().fold(self.agent.get(&url), |request, (name, value)| request.header(name, value)).call()
        };
        let lost =
            |error: ureq::Error| ControllerError::Lost { controller: self.name.clone(), reason: error.to_string() };
        let mut answer = match answer {
            Err(ureq::Error::Timeout(_)) => {
                return Err(ControllerError::silent(&self.name, path, self.settings.timeout));
            }
            other => other.map_err(lost)?,
        };
        for cookie in answer.headers().get_all("set-cookie") {
            let pair = cookie.to_str().ok().and_then(|text| text.split(';').next()?.split_once('='));
            if let Some((name, value)) = pair {
                self.cookies.retain(|(known, _)| known != name.trim());
                self.cookies.push((name.trim().to_owned(), value.trim().to_owned()));
            }
        }
        let challenge = answer.headers().get("www-authenticate").and_then(|text| text.to_str().ok()).map(str::to_owned);
        let status = answer.status().as_u16();
        let text = answer.body_mut().with_config().limit(1 << 20).read_to_string().map_err(lost)?;
        Ok((status, challenge, text))
    }

    fn authorization(&mut self, method: &HttpMethod<'_>, path: &str, body: &str) -> Option<String> {
        let settings = &self.settings;
        let bytes = (!body.is_empty()).then_some(body.as_bytes());
        let context =
            AuthContext::new_with_method(&settings.user, settings.password.text(), path, bytes, method.clone());
        Some(self.challenge.as_mut()?.respond(&context).ok()?.to_header_string())
    }

    /// A request with digest authentication; the session's cookie is kept, and the challenge too.
    fn request(&mut self, method: HttpMethod<'_>, path: &str, body: &str) -> Result<String, ControllerError> {
        let authorization = self.authorization(&method, path, body);
        let (mut status, challenge, mut text) = self.exchange(&method, path, body, authorization.as_deref())?;
        if status == 401
            && let Some(mut challenge) = challenge.and_then(|text| digest_auth::parse(&text).ok())
        {
            // a new session, or a challenge that has grown old
            challenge.nc = 0;
            self.challenge = Some(challenge);
            let authorization = self.authorization(&method, path, body);
            (status, _, text) = self.exchange(&method, path, body, authorization.as_deref())?;
        }
        let reason = match status {
            200..=299 => return Ok(text),
            401 => format!("status 401: wrong user {:?} or password", self.settings.user),
            403 => "status 403: not allowed; the controller may want mastership, or automatic mode".to_owned(),
            404 | 400 => format!(
                "status {status}: no such thing; is module {} loaded into task {}, and {} the mechanical unit?",
                self.settings.module, self.settings.task, self.settings.unit
            ),
            503 => "status 503: too many sessions or requests".to_owned(),
            other => format!("status {other}: {}", shorten(text.as_bytes())),
        };
        Err(ControllerError::refused(&self.name, path, reason))
    }

    fn garbage(&self, path: &str, found: &str, expected: &str) -> ControllerError {
        ControllerError::garbage(&self.name, path, found.as_bytes(), expected)
    }

    fn parse_joints(&self, path: &str, body: &str) -> Result<(Joints, usize), ControllerError> {
        protocol::parse_joints(body, &self.slides).ok_or_else(|| self.garbage(path, body, "JSON with rax_1 to rax_6"))
    }

    fn get(&mut self, name: &str) -> Result<String, ControllerError> {
        let path = protocol::variable_path(&self.settings.task, &self.settings.module, name) + "?json=1";
        let body = self.request(HttpMethod::GET, &path, "")?;
        protocol::parse_value(&body).ok_or_else(|| self.garbage(&path, &body, "JSON with a value"))
    }

    fn set(&mut self, name: &str, value: &str) -> Result<(), ControllerError> {
        let path = protocol::variable_path(&self.settings.task, &self.settings.module, name) + "?action=set";
        self.request(HttpMethod::POST, &path, &format!("value={value}")).map(|_| ())
    }

    fn number(&mut self, name: &str) -> Result<u64, ControllerError> {
        let text = self.get(name)?;
        protocol::parse_number(&text).ok_or_else(|| self.garbage(name, &text, "a whole number"))
    }

    /// Number of the request that the module shows, which has to be one of these: only one program may command.
    fn shown(&mut self, known: Option<[u64; 2]>) -> Result<u64, ControllerError> {
        let text = self.get("nReq")?;
        let shown = protocol::request_number(&text).ok_or_else(|| {
            self.garbage("nReq", &text, "ten numbers; load the rapid/TriCalRws.mod of this version into the controller")
        })?;
        match known {
            Some(known) if !known.contains(&shown) => {
                Err(ControllerError::OtherProgram { controller: self.name.clone(), found: shown, expected: known[1] })
            }
            _ => Ok(shown),
        }
    }

    /// The handshake: a request with a new number; done when the module shows the same number as done.
    fn command(&mut self, wanted: u8, parameters: &[f64], timeout: Duration) -> Result<String, ControllerError> {
        if self.known.is_none() {
            let answer = self.handshake(code::IDENTIFY, &[], self.settings.timeout)?;
            let version = answer.split_ascii_whitespace().nth(1).and_then(|v| v.parse::<u32>().ok());
            if !answer.starts_with("TriCal ") || version != Some(rapid_protocol::VERSION) {
                self.known = None;
                let expected = format!("TriCal {}; load rapid/TriCalRws.mod", rapid_protocol::VERSION);
                return Err(self.garbage("24", &answer, &expected));
            }
        }
        self.handshake(wanted, parameters, timeout)
    }

    fn handshake(&mut self, wanted: u8, parameters: &[f64], timeout: Duration) -> Result<String, ControllerError> {
        let shown = self.shown(self.known)?;
        // a request that was not answered may still be under way: a new one would run into it
        if self.number("nAck")? != shown {
            let reason = "the module is still busy with a request before, or does not run; start TriCalRwsLoop";
            return Err(ControllerError::refused(&self.name, &format!("{wanted:02}"), reason));
        }
        let next = new_number(shown);
        let request = protocol::request_value(next, wanted, parameters);
        let moves = matches!(wanted, code::MOVE_JOINTS | code::CORRECT);
        let motion = moves.then(|| self.stops.begin()).transpose()?;
        // whether the module gets it or not
        self.known = Some([shown, next]);
        let followed =
            self.set("nReq", &request).and_then(|()| self.follow([shown, next], &request, timeout, motion.as_ref()));
        match followed {
            Err(error) if moves => return Err(self.end_motion(error)),
            other => other?,
        }
        let ok = self.number("nOk")?;
        let reply = protocol::unquoted(&self.get("sReply")?).to_owned();
        // still the answer to this request
        self.shown(Some([next; 2]))?;
        if ok == 1 { Ok(reply) } else { Err(ControllerError::refused(&self.name, &request, reply)) }
    }

    /// Waits until a request is done; joints are sampled in a motion.
    fn follow(
        &mut self,
        known: [u64; 2],
        request: &str,
        timeout: Duration,
        motion: Option<&Motion>,
    ) -> Result<(), ControllerError> {
        let begin = Instant::now();
        loop {
            self.shown(Some(known))?;
            if self.number("nAck")? == known[1] {
                return Ok(());
            }
            if motion.is_some_and(Motion::is_to_stop) {
                return Err(ControllerError::Stopped);
            }
            if begin.elapsed() > timeout {
                return Err(ControllerError::silent(&self.name, request, timeout));
            }
            if motion.is_some() {
                let q = self.joints()?;
                self.history.push(JointSample { t: self.begin.elapsed().as_secs_f64(), q });
            }
            std::thread::sleep(self.settings.poll);
        }
    }

    /// Stops a motion that is not waited for any more, whatever the reason: the whole program stops, and has to be started again by
    /// hand \[I\]. Services that answer wrongly once may do so twice, so they are asked again.
    fn end_motion(&mut self, error: ControllerError) -> ControllerError {
        let begin = Instant::now();
        while self.request(HttpMethod::POST, STOP_PATH, "stopmode=stop").is_err() {
            if begin.elapsed() >= STOP_TIMEOUT {
                return ControllerError::stop_not_confirmed(&self.name, error);
            }
            std::thread::sleep(self.settings.poll);
        }
        if matches!(error, ControllerError::Stopped) { confirmed_stop(self) } else { error }
    }
}

/// Another number than this, which no other program draws at the same time but once in a million. Single precision counts to 16 777 216.
fn new_number(before: u64) -> u64 {
    let drawn = 1 + RandomState::new().build_hasher().finish() % 999_998;
    if drawn < before { drawn } else { drawn + 1 }
}

impl Controller for RwsClient {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn joint_count(&self) -> usize {
        self.joints
    }

    fn ping(&mut self) -> Result<(), ControllerError> {
        self.joints().map(|_| ())
    }

    fn joints(&mut self) -> Result<Joints, ControllerError> {
        let path = protocol::joints_path(&self.settings.unit);
        let body = self.request(HttpMethod::GET, &path, "")?;
        let (q, count) = self.parse_joints(&path, &body)?;
        if count != self.joints {
            return Err(self.garbage(&path, &body, &format!("{} joints as before", self.joints)));
        }
        Ok(q)
    }

    fn move_joints(&mut self, target: &Joints) -> Result<(), ControllerError> {
        let target = rapid_protocol::joint_parameters(target, self.joints, &self.slides);
        self.command(code::MOVE_JOINTS, &target, self.settings.move_timeout).map(|_| ())
    }

    fn correct(&mut self, displacement: [f64; 3]) -> Result<(), ControllerError> {
        self.command(code::CORRECT, &displacement.map(|d| d * 1e3), self.settings.move_timeout).map(|_| ())
    }

    fn set_speed(&mut self, linear: f64, angular: f64) -> Result<(), ControllerError> {
        self.command(code::SPEED, &[linear * 1e3, angular.to_degrees()], self.settings.timeout).map(|_| ())
    }

    fn set_tool(&mut self, tcp_in_flange: [f64; 3]) -> Result<(), ControllerError> {
        let [x, y, z] = tcp_in_flange.map(|p| p * 1e3);
        self.command(code::TOOL, &[x, y, z, 1.0, 0.0, 0.0, 0.0], self.settings.timeout).map(|_| ())
    }

    /// The clock of this computer since the connection was made: the services' own has whole seconds only.
    fn clock(&mut self) -> Result<f64, ControllerError> {
        Ok(self.begin.elapsed().as_secs_f64())
    }

    fn serial_number(&mut self) -> Result<Option<String>, ControllerError> {
        Ok(serial_number_in(&self.command(code::SERIAL_NUMBER, &[], self.settings.timeout)?))
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
