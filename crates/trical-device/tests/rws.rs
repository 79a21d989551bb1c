//! The client of Robot Web Services against a server that speaks them, digest authentication included.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use trical_device::controller::{RwsClient, RwsSettings, StopCount};
use trical_device::url::Secret;
use trical_device::{Controller, ControllerError, open_controller};

use crate::rws_server::{Robot, serve, server};

const CERTIFICATE: &str = include_str!("data/rws-test-server.pem");

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
    assert_eq!(robot.variables["nAck"].parse::<f64>().unwrap(), robot.request()[0]);
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
    assert_eq!(robot.lock().unwrap().stopped, 1, "the arm is not left to go on unheard");
    let error = client.correct([1e-3, 0.0, 0.0]).unwrap_err().to_string();
    assert!(error.contains("still busy"), "{error}");
}

#[test]
fn a_bad_answer_in_a_motion_stops_the_arm_and_a_stop_that_is_refused_is_asked_again() {
    let (mut client, robot) = connect();
    client.set_speed(0.01, 0.1).unwrap();
    robot.lock().unwrap().never_answers = true;
    robot.lock().unwrap().bad = vec![("jointtarget", false), ("action=stop", false), ("action=stop", false)];
    let error = client.move_joints(&[0.0; 9]).unwrap_err().to_string();
    assert!(error.contains("status 503"), "{error}");
    let robot = robot.lock().unwrap();
    assert_eq!((robot.stopped, robot.bad.len()), (1, 0));
}

#[test]
fn a_stop_that_is_never_confirmed_is_told_with_what_failed_before() {
    let (mut client, robot) = connect();
    client.set_speed(0.01, 0.1).unwrap();
    robot.lock().unwrap().never_answers = true;
    robot.lock().unwrap().bad = vec![("action=stop", false); 100_000];
    robot.lock().unwrap().bad.push(("jointtarget", false));
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::StopNotConfirmed { .. }), "{error}");
    assert!(error.to_string().contains("status 503") && error.to_string().contains("emergency stop"), "{error}");
}

#[test]
fn a_request_is_done_once_whether_it_is_said_to_have_arrived_or_not() {
    let (mut client, robot) = connect();
    client.set_speed(0.01, 0.1).unwrap();
    for (arrives, done) in [(true, 2), (false, 1)] {
        let before = robot.lock().unwrap().seen.len();
        robot.lock().unwrap().bad = vec![("nReq?action=set", arrives)];
        assert!(client.set_tool([0.01, 0.0, 0.0]).is_err());
        // one that did arrive is done first
        while client.set_tool([0.02, 0.0, 0.0]).is_err() {}
        assert_eq!(robot.lock().unwrap().seen.len() - before, done);
    }
    // it is taken with a 204, and is not there
    robot.lock().unwrap().loses = true;
    let before = robot.lock().unwrap().seen.len();
    let error = client.move_joints(&[0.1; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Silent { .. }), "{error}");
    robot.lock().unwrap().loses = false;
    client.correct([1e-3, 0.0, 0.0]).unwrap();
    let robot = robot.lock().unwrap();
    assert_eq!(robot.seen[before..], ["[20,1.00000,0.00000,0.00000,0.00000,0.00000,0.00000,0.00000]"]);
}

#[test]
fn of_two_programs_on_one_controller_the_first_one_ends_and_neither_takes_a_motion_for_its_own() {
    let (address, robot) = server();
    let [mut first, mut second] = [(), ()].map(|()| RwsClient::connect(&address, settings()).unwrap());
    first.move_joints(&[0.1; 9]).unwrap();
    second.move_joints(&[0.2; 9]).unwrap();
    for _ in 0..2 {
        let error = first.move_joints(&[0.3; 9]).unwrap_err();
        assert!(matches!(error, ControllerError::OtherProgram { .. }), "{error}");
        assert!(error.to_string().contains("another program commands it, too"), "{error}");
    }
    second.move_joints(&[0.4; 9]).unwrap();
    assert_eq!(robot.lock().unwrap().seen.len(), 5);
    // it comes in the middle of a motion
    robot.lock().unwrap().never_answers = true;
    let shared = Arc::clone(&robot);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        shared.lock().unwrap().variables.insert("nReq".to_owned(), "[7,20,1,0,0,0,0,0,0,7]".to_owned());
    });
    let error = second.move_joints(&[0.5; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::OtherProgram { found: 7, .. }), "{error}");
    assert_eq!(robot.lock().unwrap().stopped, 1, "what moves the arm is not what was asked for");
}

#[test]
fn a_module_of_an_earlier_version_is_told() {
    let (mut client, robot) = connect();
    robot.lock().unwrap().variables.insert("nReq".to_owned(), "[0,0,0,0,0,0,0,0]".to_owned());
    let error = client.set_speed(0.01, 0.1).unwrap_err().to_string();
    assert!(error.contains("load the rapid/TriCalRws.mod of this version"), "{error}");
}

#[test]
fn after_two_requests_to_end_no_motion_begins() {
    let (mut client, robot) = connect();
    client.set_speed(0.01, 0.1).unwrap();
    let stops = StopCount::default();
    client.stop_when(Arc::clone(&stops));
    assert_eq!((stops.ask(), stops.ask()), (0, 1));
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::NotBegun), "{error}");
    assert_eq!((robot.lock().unwrap().seen.len(), stops.is_moving()), (2, false));
}

#[test]
fn a_stop_by_the_user_is_told_as_done_when_the_joints_stand() {
    for creeps in [false, true] {
        let (mut client, robot) = connect();
        client.set_speed(0.01, 0.1).unwrap();
        robot.lock().unwrap().never_answers = true;
        robot.lock().unwrap().creeps = creeps;
        let stops = StopCount::default();
        client.stop_when(Arc::clone(&stops));
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(30));
            stops.ask();
        });
        let error = client.move_joints(&[0.0; 9]).unwrap_err();
        let stands = matches!(error, ControllerError::Stopped);
        assert_eq!((stands, robot.lock().unwrap().stopped), (!creeps, 1), "{error}");
        assert!(stands || error.to_string().contains("has not confirmed it"), "{error}");
    }
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
    assert_eq!(controller.serial_number().unwrap().as_deref(), Some("120-501234"));
    assert!(controller.clock().unwrap() >= 0.0);
}
