//! Gauges on pseudo-terminals, opened by their URLs like the hardware.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use trical_device::gauge::uwave_protocol::{Record, Unit};
use trical_device::gauge::{UWave, UWaveSettings, open_serial};
use trical_device::open_gauge;

/// A pseudo-terminal on which a script answers: each request's bytes go in, the reply's come out.
struct Mock {
    path: String,
    master: File,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _slave: OwnedFd,
}

impl Mock {
    fn new(end: u8, mut script: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) -> Self {
        let pair = nix::pty::openpty(None, None).unwrap();
        let mut settings = tcgetattr(&pair.slave).unwrap();
        cfmakeraw(&mut settings);
        tcsetattr(&pair.slave, SetArg::TCSANOW, &settings).unwrap();
        let path = nix::unistd::ttyname(&pair.slave).unwrap().display().to_string();
        let master = File::from(pair.master);
        let stop = Arc::new(AtomicBool::new(false));
        let mut io = master.try_clone().unwrap();
        let ends = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut pending = Vec::new();
            let mut byte = [0];
            while !ends.load(Ordering::Relaxed) && io.read(&mut byte).is_ok_and(|count| count == 1) {
                pending.push(byte[0]);
                if byte[0] == end {
                    io.write_all(&script(&pending)).unwrap();
                    pending.clear();
                }
            }
        });
        Self { path, master, stop, thread: Some(thread), _slave: pair.slave }
    }
}

impl Drop for Mock {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // one byte from the other side ends the blocking read
        let _ = std::fs::OpenOptions::new().write(true).open(&self.path).and_then(|mut slave| slave.write_all(b"\0"));
        let _ = self.thread.take().unwrap().join();
    }
}

fn close(found: [f64; 3], expected_mm: [f64; 3]) {
    for (found, expected) in found.iter().zip(expected_mm) {
        assert!((found - expected * 1e-3).abs() < 1e-12, "{found} m, expected {expected} mm");
    }
}

#[test]
fn three_usb_itn_adaptors() {
    let mocks: Vec<Mock> = [1, 2, 3]
        .map(|axis| {
            let mut busy = 2;
            Mock::new(b'\r', move |request| {
                assert_eq!(request, b"1\r");
                busy -= 1;
                if busy >= 0 { b"918\r".to_vec() } else { format!("01A+0000.{axis}23\r").into_bytes() }
            })
        })
        .into();
    let url = format!("itn://{},{},{}?flip=z", mocks[0].path, mocks[1].path, mocks[2].path);
    close(open_gauge(&url).unwrap().read().unwrap(), [0.123, 0.223, -0.323]);
}

#[test]
fn one_line_gauge_with_three_channels_and_inches() {
    let mock = Mock::new(b'\r', |request| match request {
        b"A\r" => b"+0.0100 in\r\n".to_vec(),
        b"B\r" => b"-1.250 mm\r\n".to_vec(),
        b"C\r" => b"0.500\r\n".to_vec(),
        other => panic!("{other:?}"),
    });
    let url = format!("line://{}?x=A%0D&y=B%0D&z=C%0D&framing=7E2&baud=4800", mock.path);
    close(open_gauge(&url).unwrap().read().unwrap(), [0.254, -1.25, 0.5]);
}

#[test]
fn one_line_with_three_values() {
    let mock = Mock::new(b'?', |_| b"1.0; -2.0; 3.0\n".to_vec());
    let url = format!("line://{}?request=%3F&pattern={{v}};{{v}};{{v}}", mock.path);
    close(open_gauge(&url).unwrap().read().unwrap(), [1.0, -2.0, 3.0]);
}

#[test]
fn errors_of_instruments_are_not_values() {
    for (reply, words) in [
        ("ERR2\r", "answered \"ERR2\""),
        ("OV\r", "over range"),
        ("911\r", "does not answer"),
        ("#no indicator\n", "#no indicator"),
        ("hello\r", "expected a line with a value"),
        ("", "no answer to \"?\" in 2 attempts"),
        ("918\r", "busy"),
        ("12345678;0;0\r", "expected a reading within 100 mm; check unit, scale and pattern"),
        ("\u{0}\u{7f}\"\r", r#"answered "\x00\x7f\"", expected"#),
    ] {
        let mock = Mock::new(b'\r', move |_| reply.as_bytes().to_vec());
        // on a machine under load an answer may take its time; only silence has to be waited for
        let timeout = if reply.is_empty() { 60 } else { 1000 };
        let url = format!("line://{}?pattern={{v}};{{v}};{{v}}&timeout_ms={timeout}&attempts=2", mock.path);
        let error = open_gauge(&url).unwrap().read().unwrap_err().to_string();
        assert!(error.contains(words), "{reply:?}: {error}");
    }
}

#[test]
fn what_came_before_a_request_is_no_answer_to_it() {
    let mut mock = Mock::new(b'\r', |request| {
        let channel = std::str::from_utf8(&request[3..5]).unwrap().to_owned();
        format!("DT100{channel}+0000000.500M\r").into_bytes()
    });
    let mut gauge = open_gauge(&format!("uwave://{}?interval_ms=0", mock.path)).unwrap();
    mock.master.write_all(b"DT10000+0000009.999M\rST10001FFFFFFFFFF00\rDT100").unwrap();
    std::thread::sleep(std::time::Duration::from_millis(20));
    close(gauge.read().unwrap(), [0.5, 0.5, 0.5]);
    let warnings = gauge.take_warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("channel 01 is low"));
}

#[test]
fn inches_and_missing_units() {
    let mock = Mock::new(b'\r', |request| match &request[3..5] {
        b"00" => b"DT10000+0000000.010I\r".to_vec(),
        b"01" => b"DT10001-0000000.010M\r".to_vec(),
        _ => b"DT10002+0000000.0100\r".to_vec(),
    });
    let url = format!("uwave://{}?interval_ms=0", mock.path);
    let error = open_gauge(&url).unwrap().read().unwrap_err().to_string();
    assert!(error.contains("unit=mm"), "{error}");
    close(open_gauge(&format!("{url}&unit=mm")).unwrap().read().unwrap(), [0.254, -0.01, 0.01]);
}

#[test]
fn the_receiver_tells_of_itself_and_its_transmitters() {
    let mock = Mock::new(b'\r', |request| match request {
        b"IR1000000\r" => format!("DT10000+0000000.010M\rRI100123456789002{}\r", "0".repeat(50)).into_bytes(),
        b"IR1100001\r" => b"TI1002001234567890021\r".to_vec(),
        other => panic!("{other:?}"),
    });
    let port = open_serial(&mock.path, &UWaveSettings::serial()).unwrap();
    let mut gauge = UWave::new(port, "mock", UWaveSettings::default());
    assert!(matches!(gauge.receiver_information(0).unwrap(), Record::Receiver { id, .. } if id == "1234567890"));
    let transmitter = gauge.transmitter_information(0, 0).unwrap();
    assert!(matches!(transmitter, Record::Transmitter { channel: 2, event_mode: true, .. }));
    assert_eq!(Unit::Inch.in_metres(), Some(0.0254));
}
