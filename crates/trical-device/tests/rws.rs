//! The client of Robot Web Services against a server that speaks them, digest authentication included.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use md5::{Digest, Md5};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use trical_device::controller::{RwsClient, RwsSettings};
use trical_device::url::Secret;
use trical_device::{Controller, ControllerError, open_controller};

const NONCE: &str = "9d8c7b6a5f4e";
const CERTIFICATE: &str = include_str!("data/rws-test-server.pem");
const REALM: &str = "validusers@robapi.abb";

/// The controller behind the services.
#[derive(Default)]
struct Robot {
    variables: BTreeMap<String, String>,
    joints: [f64; 6],
    seen: Vec<String>,
    /// Looks at nAck before it follows.
    busy: u32,
    /// What the module refuses with.
    refuses: Option<String>,
    never_answers: bool,
    /// Sessions that were begun, by their cookie.
    sessions: u32,
    unauthorized: u32,
}

fn md5(text: &str) -> String {
    Md5::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Whether an Authorization header is right for this request (RFC 2617, by its own formulas).
fn is_authorized(header: &str, method: &str, path: &str) -> bool {
    let fields: BTreeMap<&str, &str> = header
        .trim_start_matches("Digest ")
        .split(", ")
        .filter_map(|part| part.split_once('='))
        .map(|(key, value)| (key, value.trim_matches('"')))
        .collect();
    let ha1 = md5(&format!("Default User:{REALM}:robotics"));
    let ha2 = md5(&format!("{method}:{path}"));
    let get = |key: &str| fields.get(key).copied().unwrap_or_default();
    let expected = md5(&format!("{ha1}:{NONCE}:{}:{}:auth:{ha2}", get("nc"), get("cnonce")));
    get("nonce") == NONCE && get("uri") == path && get("qop") == "auth" && get("response") == expected
}

impl Robot {
    fn new() -> Self {
        let variables =
            [("nReq", "[0,0,0,0,0,0,0,0]"), ("nSeq", "41"), ("nAck", "41"), ("nOk", "1"), ("sReply", "\"\"")];
        Self {
            variables: variables.map(|(k, v)| (k.to_owned(), v.to_owned())).into(),
            joints: [1.5, -2.0, 0.0, -0.00001, 45.0, 180.25],
            ..Self::default()
        }
    }

    fn handle(&mut self, method: &str, path: &str, body: &str) -> (u16, String) {
        if path.starts_with("/rw/motionsystem/mechunits/ROB_1/jointtarget") {
            let joints: Vec<String> =
                self.joints.iter().enumerate().map(|(k, q)| format!("\"rax_{}\":\"{q:.5}\"", k + 1)).collect();
            return (200, format!("{{\"_embedded\":{{\"_state\":[{{{},\"eax_a\":\"8.9E+09\"}}]}}}}", joints.join(",")));
        }
        let Some(name) = path.strip_prefix("/rw/rapid/symbol/data/RAPID/T_ROB1/TriCalRws/") else {
            return (404, "{}".to_owned());
        };
        let (name, query) = name.split_once('?').unwrap();
        if method == "GET" {
            assert_eq!(query, "json=1");
            if name == "nAck" && self.busy > 0 {
                self.busy -= 1;
                if self.busy == 0 && !self.never_answers {
                    self.done();
                }
            }
            let value = self.variables[name].replace('"', "\\\"");
            return (
                200,
                format!("{{\"_embedded\":{{\"_state\":[{{\"_type\":\"rap-data\",\"value\":\"{value}\"}}]}}}}"),
            );
        }
        assert_eq!(query, "action=set");
        let value = body.strip_prefix("value=").unwrap();
        self.variables.insert(name.to_owned(), value.to_owned());
        if name == "nSeq" {
            self.seen.push(self.variables["nReq"].clone());
            self.busy = 3;
        }
        (204, String::new())
    }

    fn done(&mut self) {
        let numbers: Vec<f64> =
            self.variables["nReq"].trim_matches(['[', ']']).split(',').map(|v| v.parse().unwrap()).collect();
        assert_eq!(numbers.len(), 8);
        let refused = self.refuses.clone().filter(|_| numbers[0] != 24.0);
        if numbers[0] == 2.0 && refused.is_none() {
            self.joints.copy_from_slice(&numbers[1..7]);
        }
        let reply = if numbers[0] == 24.0 { "TriCal 1 6 5.000" } else { "" };
        self.variables.insert("nOk".to_owned(), u8::from(refused.is_none()).to_string());
        self.variables.insert("sReply".to_owned(), format!("\"{}\"", refused.unwrap_or_else(|| reply.to_owned())));
        let seq = self.variables["nSeq"].clone();
        self.variables.insert("nAck".to_owned(), seq);
    }
}

fn serve(stream: impl Read + Write, robot: &Mutex<Robot>) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream);
    loop {
        let mut first = String::new();
        if reader.read_line(&mut first)? == 0 {
            return Ok(());
        }
        let mut words = first.split_whitespace();
        let (method, path) = (words.next().unwrap().to_owned(), words.next().unwrap().to_owned());
        let (mut length, mut authorization, mut cookie) = (0, String::new(), String::new());
        loop {
            let mut line = String::new();
            reader.read_line(&mut line)?;
            let Some((key, value)) = line.trim().split_once(": ") else { break };
            match key.to_ascii_lowercase().as_str() {
                "content-length" => length = value.parse().unwrap(),
                "authorization" => authorization = value.to_owned(),
                "cookie" => cookie = value.to_owned(),
                _ => {}
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body)?;
        let body = String::from_utf8(body).unwrap();
        let mut robot = robot.lock().unwrap();
        let mut more = String::new();
        let (status, text) = if is_authorized(&authorization, &method, &path) {
            if !cookie.contains("-http-session-=") {
                robot.sessions += 1;
                more = format!(
                    "Set-Cookie: -http-session-={}::http.session::x; path=/; httponly\r\nSet-Cookie: ABBCX=7\r\n",
                    robot.sessions
                );
            } else {
                assert!(cookie.contains("ABBCX=7"), "{cookie}");
            }
            robot.handle(&method, &path, &body)
        } else {
            robot.unauthorized += 1;
            more = format!(
                "WWW-Authenticate: Digest realm=\"{REALM}\", domain=\"/\", qop=\"auth\", nonce=\"{NONCE}\", algorithm=\"MD5\"\r\n"
            );
            (401, String::new())
        };
        let head = format!("HTTP/1.1 {status} X\r\n{more}Content-Length: {}\r\n\r\n", text.len());
        // in one piece: two small writes would wait for each other
        reader.get_mut().write_all(
            (if status == 204 { format!("HTTP/1.1 204 X\r\n{more}\r\n") } else { head + &text }).as_bytes(),
        )?;
    }
}

fn server() -> (String, Arc<Mutex<Robot>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let robot = Arc::new(Mutex::new(Robot::new()));
    let shared = Arc::clone(&robot);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let robot = Arc::clone(&shared);
            std::thread::spawn(move || serve(stream.unwrap(), &robot));
        }
    });
    (address, robot)
}

/// The same over https.
fn secure_server() -> (String, Arc<Mutex<Robot>>) {
    let certificates = CertificateDer::pem_slice_iter(CERTIFICATE.as_bytes()).map(Result::unwrap).collect();
    let key = PrivateKeyDer::from_pem_slice(CERTIFICATE.as_bytes()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let config = Arc::new(config.with_no_client_auth().with_single_cert(certificates, key).unwrap());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let robot = Arc::new(Mutex::new(Robot::new()));
    let shared = Arc::clone(&robot);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let (robot, tls) = (Arc::clone(&shared), rustls::ServerConnection::new(Arc::clone(&config)).unwrap());
            std::thread::spawn(move || serve(rustls::StreamOwned::new(tls, stream.unwrap()), &robot));
        }
    });
    (address, robot)
}

#[test]
fn over_https_the_controllers_own_certificate_is_believed_and_no_other() {
    let (address, robot) = secure_server();
    let certified = RwsSettings { certificate: Some(CERTIFICATE.to_owned()), ..settings() };
    let mut client = RwsClient::connect(&address, certified.clone()).unwrap();
    client.move_joints(&[0.1; 9]).unwrap();
    assert!((client.joints().unwrap()[0] - 0.1).abs() < 1e-6);
    // a controller that is not asked over https, and one that is another
    assert!(RwsClient::connect(&address, settings()).is_err());
    let (plain, asked) = server();
    assert!(RwsClient::connect(&plain, certified.clone()).is_err());
    assert_eq!(asked.lock().unwrap().unauthorized, 0, "nothing is said without encryption");
    let other = RwsClient::connect(&address.replace("127.0.0.1", "127.0.0.2"), certified);
    assert!(other.is_err());
    let none = RwsSettings { certificate: Some("no certificate".to_owned()), ..settings() };
    let error = RwsClient::connect(&address, none).err().unwrap().to_string();
    assert!(error.contains("its certificate is no PEM"), "{error}");
    assert_eq!(robot.lock().unwrap().sessions, 1);
}

fn settings() -> RwsSettings {
    RwsSettings {
        user: "Default User".to_owned(),
        password: Secret::new("robotics"),
        timeout: Duration::from_secs(5),
        move_timeout: Duration::from_millis(200),
        poll: Duration::from_millis(1),
        ..RwsSettings::default()
    }
}

fn connect() -> (RwsClient, Arc<Mutex<Robot>>) {
    let (address, robot) = server();
    (RwsClient::connect(&address, settings()).unwrap(), robot)
}

#[test]
fn joints_are_read_in_one_session_with_digest_authentication() {
    let (mut client, robot) = connect();
    for _ in 0..5 {
        let q = client.joints().unwrap();
        assert!((q[0].to_degrees() - 1.5).abs() < 1e-9 && (q[5].to_degrees() - 180.25).abs() < 1e-9);
    }
    assert_eq!(client.joint_count(), 6);
    let robot = robot.lock().unwrap();
    assert_eq!((robot.sessions, robot.unauthorized), (1, 1), "one challenge, then the session's cookie");
}

#[test]
fn motions_go_by_the_handshake_and_are_sampled() {
    let (mut client, robot) = connect();
    let mut q = [0.0; 9];
    (q[0], q[5]) = (30_f64.to_radians(), -200.5_f64.to_radians());
    client.set_speed(0.05, 10_f64.to_radians()).unwrap();
    client.move_joints(&q).unwrap();
    client.correct([0.25e-3, -1e-3, 0.0]).unwrap();
    client.set_tool([0.018, -0.012, 0.118]).unwrap();
    assert!((client.joints().unwrap()[5].to_degrees() + 200.5).abs() < 1e-9);
    assert!(!client.take_history().is_empty());
    let robot = robot.lock().unwrap();
    assert_eq!(
        robot.seen,
        [
            "[24,0.00000,0.00000,0.00000,0.00000,0.00000,0.00000,0.00000]",
            "[8,50.00000,10.00000,0.00000,0.00000,0.00000,0.00000,0.00000]",
            "[2,30.00000,0.00000,0.00000,0.00000,0.00000,-200.50000,0.00000]",
            "[20,0.25000,-1.00000,0.00000,0.00000,0.00000,0.00000,0.00000]",
            "[6,18.00000,-12.00000,118.00000,1.00000,0.00000,0.00000,0.00000]",
        ]
    );
    assert_eq!(robot.variables["nSeq"], "46");
}

#[test]
fn a_refusal_carries_the_reason_of_the_module() {
    let (mut client, robot) = connect();
    robot.lock().unwrap().refuses = Some("joint 3 out of limits at 99.000 deg".to_owned());
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("(joint 3 out of limits at 99.000 deg)"), "{error}");
    robot.lock().unwrap().refuses = None;
    client.move_joints(&[0.0; 9]).unwrap();
}

#[test]
fn a_motion_without_an_answer_blocks_the_next_one() {
    let (mut client, robot) = connect();
    client.set_speed(0.01, 0.1).unwrap();
    robot.lock().unwrap().never_answers = true;
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Silent { .. }), "{error}");
    let error = client.correct([1e-3, 0.0, 0.0]).unwrap_err().to_string();
    assert!(error.contains("still busy"), "{error}");
}

#[test]
fn wrong_users_missing_modules_and_other_servers_are_told_apart() {
    let (address, robot) = server();
    let error = RwsClient::connect(&address, RwsSettings { password: Secret::new("x"), ..settings() }).err().unwrap();
    assert!(error.to_string().contains("wrong user \"Default User\" or password"), "{error}");
    let error = RwsClient::connect(&address, RwsSettings { unit: "ROB_2".to_owned(), ..settings() }).err().unwrap();
    assert!(error.to_string().contains("ROB_2 the mechanical unit?"), "{error}");
    let mut client = RwsClient::connect(&address, RwsSettings { module: "Other".to_owned(), ..settings() }).unwrap();
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(error.to_string().contains("is module Other loaded into task T_ROB1"), "{error}");
    drop(robot);

    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let _ = stream.read(&mut [0; 500]);
        stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello").unwrap();
    });
    let error = RwsClient::connect(&address, settings()).err().unwrap();
    assert!(error.to_string().contains("answered \"hello\""), "{error}");
}

#[test]
fn the_url_opens_the_client() {
    let (address, _robot) = server();
    let mut controller =
        open_controller(&format!("rws://{address}?user=Default%20User&password=robotics&settle_ms=0")).unwrap();
    controller.ping().unwrap();
    assert_eq!(controller.temperature().unwrap(), None);
    assert!(controller.clock().unwrap() >= 0.0);
}
