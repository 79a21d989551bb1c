//! An ABB controller that speaks Robot Web Services, digest authentication included.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};

use md5::{Digest, Md5};

const NONCE: &str = "9d8c7b6a5f4e";
const REALM: &str = "validusers@robapi.abb";

/// The controller behind the services.
#[derive(Default)]
pub struct Robot {
    pub variables: BTreeMap<String, String>,
    pub joints: [f64; 6],
    pub seen: Vec<String>,
    /// Looks at nAck before it follows.
    pub busy: u32,
    /// What the module refuses with.
    pub refuses: Option<String>,
    pub never_answers: bool,
    /// Takes a request, and does not have it.
    pub loses: bool,
    /// Moves on, whatever it is told.
    pub creeps: bool,
    /// Requests whose path holds this get status 503, once each, though what they ask for is done (true).
    pub bad: Vec<(&'static str, bool)>,
    /// How often the program was stopped.
    pub stopped: u32,
    /// Sessions that were begun, by their cookie.
    pub sessions: u32,
    pub unauthorized: u32,
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
    pub fn new() -> Self {
        let variables = [("nReq", "[41,0,0,0,0,0,0,0,0,41]"), ("nAck", "41"), ("nOk", "1"), ("sReply", "\"\"")];
        Self {
            variables: variables.map(|(k, v)| (k.to_owned(), v.to_owned())).into(),
            joints: [1.5, -2.0, 0.0, -0.00001, 45.0, 180.25],
            ..Self::default()
        }
    }

    fn handle(&mut self, method: &str, path: &str, body: &str) -> (u16, String) {
        if path == "/rw/rapid/execution?action=stop" {
            assert_eq!((method, body), ("POST", "stopmode=stop"));
            self.stopped += 1;
            return (204, String::new());
        }
        if path.starts_with("/rw/motionsystem/mechunits/ROB_1/jointtarget") {
            self.joints[0] += if self.creeps { 0.1 } else { 0.0 };
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
        if self.loses {
            return (204, String::new());
        }
        self.variables.insert(name.to_owned(), value.to_owned());
        let numbers = self.request();
        assert_eq!((numbers.len(), numbers[0]), (10, numbers[9]));
        let words: Vec<&str> = value.split(',').collect();
        self.seen.push(format!("[{}]", words[1..9].join(",")));
        self.busy = 3;
        (204, String::new())
    }

    /// The request as it stands.
    pub fn request(&self) -> Vec<f64> {
        self.variables["nReq"].trim_matches(['[', ']']).split(',').map(|v| v.parse().unwrap()).collect()
    }

    fn done(&mut self) {
        let numbers = self.request();
        let refused = self.refuses.clone().filter(|_| numbers[1] != 24.0);
        if numbers[1] == 2.0 && refused.is_none() {
            self.joints.copy_from_slice(&numbers[2..8]);
        }
        let reply = match numbers[1] {
            24.0 => "TriCal 1 6 5.000",
            28.0 => "120-501234",
            _ => "",
        };
        self.variables.insert("nOk".to_owned(), u8::from(refused.is_none()).to_string());
        self.variables.insert("sReply".to_owned(), format!("\"{}\"", refused.unwrap_or_else(|| reply.to_owned())));
        self.variables.insert("nAck".to_owned(), numbers[0].to_string());
    }
}

/// Answers a connection.
pub fn serve(stream: impl Read + Write, robot: &Mutex<Robot>) -> std::io::Result<()> {
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
            let bad = robot.bad.iter().position(|(part, _)| path.contains(part));
            match bad.map(|k| robot.bad.remove(k).1) {
                None => robot.handle(&method, &path, &body),
                Some(done) => {
                    if done {
                        robot.handle(&method, &path, &body);
                    }
                    (503, "busy".to_owned())
                }
            }
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

/// Its address, and what stands behind it.
pub fn server() -> (String, Arc<Mutex<Robot>>) {
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
