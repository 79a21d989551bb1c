//! The client of the RAPID dialect against servers that do not do as they should.

use std::io::{Read, Write};
use std::net::TcpListener;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use trical_device::controller::{RapidClient, RapidSettings, StopCount};
use trical_device::url::Secret;
use trical_device::{CellOptions, Controller, ControllerError, VirtualCell, open_controller};

/// A server that answers each whole request by a script, for one client.
fn server(mut script: impl FnMut(&str) -> Option<String> + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut request = String::new();
        let mut byte = [0];
        while stream.read(&mut byte).is_ok_and(|count| count == 1) {
            request.push(char::from(byte[0]));
            if byte[0] == b'#' {
                match script(&request) {
                    Some(reply) => stream.write_all(reply.as_bytes()).unwrap(),
                    None => return,
                }
                request.clear();
            }
        }
    });
    address
}

/// What a sound server says, so that a script has to name its faults only.
fn sound(request: &str) -> Option<String> {
    let code = &request[..2];
    let data = match code {
        "24" => "TriCal 1 6 5.000",
        "04" => "1.00000 -2.00000 3.00000 0.00000 45.00000 -180.00000",
        "21" => "12.500",
        _ => "",
    };
    Some(format!("{code} 1 {data}#"))
}

/// A server that is sound but for one request, which it answers so.
fn but(code: &'static str, reply: &'static str) -> impl FnMut(&str) -> Option<String> + Send {
    move |request| if request.starts_with(code) { Some(reply.to_owned()) } else { sound(request) }
}

fn settings() -> RapidSettings {
    RapidSettings {
        timeout: Duration::from_millis(200),
        move_timeout: Duration::from_millis(300),
        ..Default::default()
    }
}

fn connect(
    script: impl FnMut(&str) -> Option<String> + Send + 'static,
) -> Result<RapidClient<std::net::TcpStream>, ControllerError> {
    RapidClient::connect(&server(script), settings())
}

#[test]
fn a_sound_server_is_understood() {
    let mut client = connect(sound).unwrap();
    assert_eq!(client.joint_count(), 6);
    assert!((client.correction_limit() - 5e-3).abs() < 1e-12);
    let q = client.joints().unwrap();
    assert!((q[4].to_degrees() - 45.0).abs() < 1e-9 && (q[5].to_degrees() + 180.0).abs() < 1e-9);
    assert_eq!(client.clock().unwrap(), 12.5);
    assert_eq!(client.temperature().unwrap(), None);
    client.set_tool([0.018, -0.012, 0.118]).unwrap();
}

#[test]
fn requests_are_written_as_the_module_reads_them() {
    let (send, seen) = std::sync::mpsc::channel();
    let mut client = connect(move |request| {
        send.send(request.to_owned()).unwrap();
        sound(request)
    })
    .unwrap();
    let mut q = [0.0; 9];
    (q[0], q[5]) = (30_f64.to_radians(), -200.5_f64.to_radians());
    client.move_joints(&q).unwrap();
    client.correct([0.25e-3, -1e-3, 0.0]).unwrap();
    client.set_speed(0.05, 10_f64.to_radians()).unwrap();
    client.set_tool([0.018, -0.012, 0.118]).unwrap();
    let seen: Vec<String> = seen.try_iter().collect();
    assert_eq!(
        seen,
        [
            "24 #",
            "09 1 #",
            "22 100 #",
            "02 30.00000 0.00000 0.00000 0.00000 0.00000 -200.50000 #",
            "20 0.25000 -1.00000 0.00000 #",
            "08 50.000 10.000 #",
            "06 18.0000 -12.0000 118.0000 1.0000 0.0000 0.0000 0.0000 #",
        ]
    );
    assert!(seen.iter().all(|request| request.len() <= 80));
}

#[test]
fn plain_open_abb_is_told_from_the_module() {
    let error = connect(|request| Some(format!("{} 0 #", &request[..2]))).err().unwrap();
    assert!(error.to_string().contains("load rapid/TriCal.mod"), "{error}");
    let error = connect(|_| Some("HTTP/1.1 400 Bad Request\r\n\r\n#".to_owned())).err().unwrap();
    assert!(matches!(error, ControllerError::Garbage { .. }), "{error}");
    let error = connect(|_| Some("x".repeat(3000))).err().unwrap();
    assert!(matches!(error, ControllerError::Lost { .. }), "{error}");
    let error = connect(|_| Some(String::new())).err().unwrap();
    assert!(error.to_string().contains("no answer to \"24 #\" within 0.2 s"), "{error}");
    let error = connect(|_| None).err().unwrap();
    assert!(matches!(error, ControllerError::Lost { .. }), "{error}");
}

#[test]
fn samples_come_before_the_reply_and_are_kept() {
    let mut client = connect(|request| {
        let reply = sound(request)?;
        Some(if request.starts_with("02") {
            format!("30 1 1.5 1 2 3 4 5 6#30 1 1.6 2 2 3 4 5 6#{reply}")
        } else {
            reply
        })
    })
    .unwrap();
    client.move_joints(&[0.0; 9]).unwrap();
    let history = client.take_history();
    assert_eq!(history.len(), 2);
    assert_eq!(history[1].t, 1.6);
    assert!((history[1].q[0].to_degrees() - 2.0).abs() < 1e-12);
    assert!(client.take_history().is_empty());
}

#[test]
fn a_server_that_refuses_the_samples_is_used_without() {
    assert!(connect(but("22", "22 0 unknown code#")).is_ok());
}

#[test]
fn after_a_late_answer_the_connection_is_not_used_again() {
    let mut client = connect(but("02", "")).unwrap();
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Silent { .. }), "{error}");
    let error = client.joints().unwrap_err();
    assert!(error.to_string().contains("no answer to \"02"), "a late answer could be taken for this one: {error}");
}

#[test]
fn answers_to_another_request_are_an_error() {
    let mut client = connect(but("04", "21 1 3#")).unwrap();
    let error = client.joints().unwrap_err();
    assert!(error.to_string().contains("answered \"21 1 3\" to \"04 #\", expected 04 1 ... #"), "{error}");
    assert!(client.ping().is_err());
}

#[test]
fn a_refusal_carries_the_reason_and_the_connection_lives_on() {
    let mut client = connect(but("20", "20 0 correction 6.000 mm is over the limit of 5.000 mm#")).unwrap();
    let error = client.correct([6e-3, 0.0, 0.0]).unwrap_err().to_string();
    assert!(error.contains("refused \"20 6.00000 0.00000 0.00000 #\" (correction 6.000 mm is over"), "{error}");
    client.ping().unwrap();
}

#[test]
fn wrong_numbers_of_joints_are_noticed() {
    let mut client = connect(but("04", "04 1 1 2 3#")).unwrap();
    assert!(client.joints().unwrap_err().to_string().contains("expected 6 joint values"));
}

#[test]
fn the_url_opens_the_client() {
    let address = server(sound);
    let mut controller = open_controller(&format!("rapid://{address}?timeout_s=1&stream_ms=0")).unwrap();
    controller.ping().unwrap();
}

#[test]
fn a_controller_that_falls_silent_in_a_motion_is_not_waited_for() {
    let address = server(|request| {
        if request.starts_with("02") || request.starts_with("26") { Some(String::new()) } else { sound(request) }
    });
    let settings = RapidSettings { move_timeout: Duration::from_secs(120), ..settings() };
    let mut client = RapidClient::connect(&address, settings).unwrap();
    let begin = std::time::Instant::now();
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Silent { .. }), "{error}");
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
}

#[test]
fn a_stop_is_sent_and_confirmed_while_the_arm_moves() {
    let moving = std::sync::atomic::AtomicBool::new(false);
    let mut client = connect(move |request| match &request[..2] {
        // the motion takes for ever
        "02" => {
            moving.store(true, Ordering::Relaxed);
            Some(String::new())
        }
        "25" => Some(if moving.swap(false, Ordering::Relaxed) { "02 0 stopped#25 1 #" } else { "25 1 #" }.to_owned()),
        _ => sound(request),
    })
    .unwrap();
    let stops = StopCount::default();
    client.stop_when(Arc::clone(&stops));
    let asking = Arc::clone(&stops);
    let asks = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(80));
        asking.ask();
    });
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Stopped), "{error}");
    asks.join().unwrap();
    // the line can still be used, and the arm be led back, but not on
    assert!(client.joints().is_ok());
    assert!(matches!(client.correct([1e-3, 0.0, 0.0]), Err(ControllerError::NotBegun)));
    stops.hear();
    client.correct([1e-3, 0.0, 0.0]).unwrap();
    // a second request is the last one
    stops.ask();
    stops.hear();
    assert!(matches!(client.correct([1e-3, 0.0, 0.0]), Err(ControllerError::NotBegun)));
}

#[test]
fn an_arm_that_moves_on_after_its_stop_has_not_confirmed_it() {
    for (answer, expected) in [("25 0 not now#", "refused \"25 #\" (not now)"), ("02 0 stopped#25 1 #", "still moves")]
    {
        let mut at = 0.0;
        let mut client = connect(move |request| match &request[..2] {
            "02" => Some(String::new()),
            "25" => Some(answer.to_owned()),
            "04" => {
                at += 0.1;
                Some(format!("04 1 {at} 0 0 0 0 0#"))
            }
            _ => sound(request),
        })
        .unwrap();
        let stops = StopCount::default();
        client.stop_when(Arc::clone(&stops));
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(80));
            stops.ask();
        });
        let error = client.move_joints(&[0.0; 9]).unwrap_err();
        assert!(matches!(error, ControllerError::StopNotConfirmed { .. }), "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn an_answer_that_comes_twice_is_not_taken_for_the_next_one() {
    let mut asked = 0;
    let mut client = connect(move |request| {
        asked += usize::from(request.starts_with("04"));
        let answer = format!("04 1 {asked} 0 0 0 0 0#");
        if request.starts_with("04") { Some(answer.repeat(2)) } else { sound(request) }
    })
    .unwrap();
    client.joints().unwrap();
    std::thread::sleep(Duration::from_millis(50));
    let error = client.joints().unwrap_err();
    assert!(error.to_string().contains("said \"04 1 1 0 0 0 0 0\" before \"04 #\" was sent"), "{error}");
    // nor is anything else asked on that line
    assert!(matches!(client.move_joints(&[0.0; 9]), Err(ControllerError::Lost { .. })));
}

#[test]
fn a_motion_whose_answer_is_no_message_is_stopped_and_the_connection_not_used_again() {
    let (send, seen) = std::sync::mpsc::channel();
    let mut client = connect(move |request| {
        send.send(request.to_owned()).unwrap();
        if request.starts_with("02") { Some("HTTP/1.1 200 OK #".to_owned()) } else { sound(request) }
    })
    .unwrap();
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::Garbage { .. }), "{error}");
    assert!(matches!(client.correct([1e-3, 0.0, 0.0]), Err(ControllerError::Lost { .. })));
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(seen.try_iter().last().unwrap(), "25 #");
}

#[test]
fn a_controller_that_floods_is_stopped_all_the_same() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut request = String::new();
        let mut byte = [0];
        while !request.contains("02 ") && stream.read(&mut byte).is_ok_and(|count| count == 1) {
            request.push(char::from(byte[0]));
            if byte[0] == b'#' && !request.contains("02 ") {
                stream.write_all(sound(&request).unwrap().as_bytes()).unwrap();
                request.clear();
            }
        }
        while stream.write_all(&b"26 1 #".repeat(1000)).is_ok() {}
    });
    let mut client = RapidClient::connect(&address, settings()).unwrap();
    let stops = StopCount::default();
    client.stop_when(Arc::clone(&stops));
    let begin = std::time::Instant::now();
    let asks = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(80));
        stops.ask();
    });
    let error = client.move_joints(&[0.0; 9]).unwrap_err();
    assert!(matches!(error, ControllerError::StopNotConfirmed { .. } | ControllerError::Silent { .. }), "{error}");
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
    asks.join().unwrap();
}

#[test]
fn who_speaks_another_language_is_disconnected_and_moves_nothing() {
    let cell = VirtualCell::start(Box::new(crate::common::Gantry::default()), CellOptions::default()).unwrap();
    for text in [
        "POST / HTTP/1.1\r\nHost: robot\r\nContent-Length: 99\r\n\r\n#02 10 0 0 0 0 0 #",
        "hello #02 10 0 0 0 0 0 #",
        &format!("{}#02 10 0 0 0 0 0 #", "x".repeat(2000)),
    ] {
        let mut stream = std::net::TcpStream::connect(cell.address()).unwrap();
        stream.write_all(text.as_bytes()).unwrap();
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        assert_eq!(answer, "", "{text:?}");
    }
    assert_eq!(cell.motions(), 0);
}

/// What a raw client is answered, until it is disconnected.
fn answered(cell: &VirtualCell, text: &str) -> String {
    let mut stream = std::net::TcpStream::connect(cell.address()).unwrap();
    stream.write_all(text.as_bytes()).unwrap();
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8(answer).unwrap()
}

#[test]
fn who_does_not_know_the_secret_commands_nothing() {
    let options = CellOptions { secret: Some(Secret::new("Torx25kanne")), ..CellOptions::default() };
    let cell = VirtualCell::start(Box::new(crate::common::Gantry::default()), options).unwrap();
    assert_eq!(answered(&cell, "24 #02 10 0 0 0 0 0 #"), "27 0 secret expected#");
    assert_eq!(answered(&cell, "02 10 0 0 0 0 0 #"), "27 0 secret expected#");
    assert_eq!(answered(&cell, "27 Torx25 #02 10 0 0 0 0 0 #"), "27 0 wrong secret#");
    assert_eq!(answered(&cell, "POST / HTTP/1.1\r\n\r\n#27 Torx25kanne #02 10 0 0 0 0 0 #"), "");
    assert_eq!(cell.motions(), 0);

    let url = format!("rapid://{}?settle_ms=0", cell.address());
    let error = open_controller(&url).err().unwrap().to_string();
    assert!(error.contains("secret expected; secret= in the URL is to be SECRET of its module"), "{error}");
    let error = open_controller(&format!("{url}&secret=Torx25kannen")).err().unwrap().to_string();
    assert!(error.contains("wrong secret") && !error.contains("Torx25"), "{error}");
    let mut controller = open_controller(&cell.controller_url()).unwrap();
    controller.move_joints(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(cell.motions(), 1);
}

#[test]
fn a_secret_where_none_is_set_is_told() {
    let cell = VirtualCell::start(Box::new(crate::common::Gantry::default()), CellOptions::default()).unwrap();
    let error = open_controller(&format!("rapid://{}?secret=Torx25kanne", cell.address())).err().unwrap();
    assert!(error.to_string().contains("no secret is set here"), "{error}");
    open_controller(&format!("rapid://{}?secret=none", cell.address())).unwrap().ping().unwrap();
}

#[test]
fn a_second_client_waits_until_the_first_has_gone() {
    let cell = VirtualCell::start(Box::new(crate::common::Gantry::default()), CellOptions::default()).unwrap();
    let first = open_controller(&cell.controller_url()).unwrap();
    let mut second = std::net::TcpStream::connect(cell.address()).unwrap();
    second.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    second.write_all(b"02 10 0 0 0 0 0 #").unwrap();
    let mut answer = [0; 20];
    assert!(second.read(&mut answer).is_err(), "{answer:?}");
    assert_eq!(cell.motions(), 0);
    drop(first);
    second.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    assert!(second.read(&mut answer).unwrap() > 0);
}

#[test]
fn an_arm_whose_client_is_gone_stops() {
    let options = CellOptions { pace: 1.0, dwell: 0.0, ..CellOptions::default() };
    let cell = VirtualCell::start(Box::new(crate::common::Gantry::default()), options).unwrap();
    let mut stream = std::net::TcpStream::connect(cell.address()).unwrap();
    // 1 rad of the gantry is 1 m, at 0.1 m/s
    stream.write_all(b"02 57.29578 0 0 0 0 0 #").unwrap();
    std::thread::sleep(Duration::from_millis(300));
    drop(stream);
    std::thread::sleep(Duration::from_millis(300));
    let stands = cell.state().q;
    assert!((0.001..0.5).contains(&stands[0]), "{stands:?}");
}

#[test]
fn joints_that_slide_are_in_mm_on_the_line() {
    let (send, seen) = std::sync::mpsc::channel();
    let mut client = connect(move |request| {
        send.send(request.to_owned()).unwrap();
        if request.starts_with("04") { Some("04 1 0 0 100 0 0 45#".to_owned()) } else { sound(request) }
    })
    .unwrap();
    let mut robot = trical_model::Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    robot.joints[2].kind = trical_model::JointKind::Prismatic;
    let model = trical_model::Model::nominal(robot, trical_model::Cell::bare());
    client.set_arm(&trical_model::Forward::new(model, Vec::new()).unwrap());
    let mut q = client.joints().unwrap();
    assert!((q[2] - 0.1).abs() < 1e-12 && (q[5] - 45_f64.to_radians()).abs() < 1e-12, "{q:?}");
    q[2] += 5e-3;
    client.move_joints(&q).unwrap();
    let sent = seen.try_iter().find(|request| request.starts_with("02")).unwrap();
    assert!(sent.contains(" 105.00000 ") && sent.contains(" 45.00000"), "{sent}");
}
