//! Random bytes from and to every device: errors, never a panic or a hang.

use std::io::{self, Read, Write};
use std::time::Duration;

use proptest::prelude::*;
use trical_device::controller::{RapidClient, RapidSettings};
use trical_device::gauge::{LineGauge, LineSettings, Port, UWave, UWaveSettings};
use trical_device::{Controller, Gauge};

/// Answers each request with the next piece of a script, then with silence.
#[derive(Default)]
struct Script {
    pieces: Vec<Vec<u8>>,
    waiting: Vec<u8>,
}

impl Read for Script {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.waiting.is_empty() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        let count = into.len().min(self.waiting.len()).min(7);
        for (to, from) in into.iter_mut().zip(self.waiting.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

impl Write for Script {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(piece) = self.pieces.pop() {
            self.waiting.extend(piece);
        }
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Port for Script {
    fn waiting(&mut self) -> io::Result<usize> {
        Ok(self.waiting.len())
    }
}

/// Sends for ever, without a pause.
struct Flood(&'static [u8], usize);

impl Read for Flood {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        for to in into.iter_mut() {
            *to = self.0[self.1 % self.0.len()];
            self.1 += 1;
        }
        Ok(into.len())
    }
}

impl Write for Flood {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Port for Flood {
    fn waiting(&mut self) -> io::Result<usize> {
        Ok(4096)
    }
}

#[test]
fn devices_that_never_end_sending_are_not_heard_for_ever() {
    let begin = std::time::Instant::now();
    for said in
        [&b"x"[..], b"hello\r", b"DT10009+0000000.001M\r", b"\r", b"911\r", b"26 1 #", b"30 1 1 1 2 3 4 5 6#", b"#"]
    {
        let settings = UWaveSettings { timeout: Duration::from_millis(1), attempts: 2, ..UWaveSettings::default() };
        let mut gauge = UWave::new(Flood(said, 0), "flood", settings);
        assert!(gauge.read().is_err(), "{said:?}");
        assert!(gauge.receiver_information(0).is_err(), "{said:?}");
        let timeout = Duration::from_millis(1);
        let settings = LineSettings { timeout, attempts: 2, ..LineSettings::preset("line").unwrap() };
        // a number in it is a reading
        let _ = LineGauge::new(vec![Flood(said, 0)], "flood", settings).unwrap().read();
        let settings = RapidSettings { timeout, move_timeout: timeout, ..RapidSettings::default() };
        assert!(RapidClient::new(Flood(said, 0), "flood", settings).is_err(), "{said:?}");
    }
    assert!(begin.elapsed() < Duration::from_secs(60), "{:?}", begin.elapsed());
}

fn pieces() -> impl Strategy<Value = Vec<Vec<u8>>> {
    let piece = prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..60),
        "(DT1|ST1|TI1|RI1)[0-9F]{0,10}[+-]?[0-9.]{0,12}[MI0]?\r".prop_map(String::into_bytes),
        "[+-]?[0-9.,]{0,8} ?(mm|in|M)?\r?\n?".prop_map(String::into_bytes),
        "[0-9]{2} [01] (TriCal 1 6 5|[0-9. -]{0,40})#".prop_map(String::into_bytes),
        "24 1 TriCal 1 [0-9]{1,2} [0-9.]{1,4}#".prop_map(String::into_bytes),
    ];
    proptest::collection::vec(piece, 0..12)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn gauges_survive_any_answer(pieces in pieces()) {
        let settings = UWaveSettings {
            timeout: Duration::from_millis(1),
            interval: Duration::ZERO,
            attempts: 2,
            ..UWaveSettings::default()
        };
        let mut gauge = UWave::new(Script { pieces: pieces.clone(), ..Script::default() }, "script", settings);
        let reading = gauge.read();
        prop_assert!(reading.is_err() || reading.unwrap().iter().all(|value| value.is_finite()));
        let _ = gauge.receiver_information(0);

        let settings = LineSettings {
            timeout: Duration::from_millis(1),
            busy_pause: Duration::ZERO,
            attempts: 2,
            ..LineSettings::preset("line").unwrap()
        };
        let mut gauge = LineGauge::new(vec![Script { pieces, ..Script::default() }], "script", settings).unwrap();
        let reading = gauge.read();
        prop_assert!(reading.is_err() || reading.unwrap().iter().all(|value| value.is_finite()));
    }

    #[test]
    fn controllers_survive_any_answer(pieces in pieces()) {
        let settings = RapidSettings {
            timeout: Duration::from_millis(1),
            move_timeout: Duration::from_millis(1),
            ..RapidSettings::default()
        };
        let mut all = pieces;
        all.extend([b"22 1 #".to_vec(), b"09 1 #".to_vec(), b"24 1 TriCal 1 6 5#".to_vec()]);
        if let Ok(mut client) = RapidClient::new(Script { pieces: all, ..Script::default() }, "script", settings) {
            if let Ok(q) = client.joints() {
                prop_assert!(q.iter().all(|q| q.is_finite()));
            }
            let _ = client.move_joints(&[0.0; 9]);
            let _ = client.clock();
        }
    }

    #[test]
    fn the_virtual_cell_survives_any_request(noise in proptest::collection::vec(any::<u8>(), 0..400)) {
        let bench = crate::common::bench();
        // where it is a TCP port, one client is heard at a time
        #[cfg(unix)]
        {
            let mut port = std::fs::OpenOptions::new().write(true).open(bench.cell.gauge_place()).unwrap();
            port.write_all(&noise).unwrap();
            port.write_all(b"\r").unwrap();
        }
        drop(bench.controller);
        let mut stream = std::net::TcpStream::connect(bench.cell.address()).unwrap();
        // the cell may close the connection on us
        let _ = stream.write_all(&noise);
        drop(stream);
        let mut controller = trical_device::open_controller(&bench.cell.controller_url()).unwrap();
        controller.ping().unwrap();
        // refusals of the noise come late; a reading succeeds once they are through
        std::thread::sleep(Duration::from_millis(5));
        let mut gauge = bench.gauge;
        prop_assert!((0..5).any(|_| gauge.read().is_ok()));
        prop_assert!(bench.cell.is_running());
    }
}
