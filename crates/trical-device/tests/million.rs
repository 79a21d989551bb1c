//! A million inputs for every parser, most of them one or a few bytes from a valid one: no panic, and nothing accepted that
//! the protocol does not allow.

#[path = "../../../fuzz/src/device.rs"]
#[expect(dead_code, reason = "recordings are asked for more here")]
mod targets;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_device::controller::rtde;
use trical_device::gauge::line_protocol::Pattern;
use trical_recording::json::row_from_json;
use trical_recording::mcap::Header;
use trical_recording::mcap::cdr::JointState;
use trical_recording::mcap::{read_bytes, write_recording};
use trical_recording::read_recording;

const CASES: u32 = 1_000_000;

/// Valid inputs with a few bytes changed, lost, doubled or put in; now and then random bytes.
struct Mutants {
    random: Pcg64Mcg,
    seeds: Vec<Vec<u8>>,
    alphabet: &'static [u8],
}

impl Mutants {
    fn new<S: AsRef<[u8]>>(seeds: &[S], alphabet: &'static [u8]) -> Self {
        let seeds = seeds.iter().map(|s| s.as_ref().to_vec()).collect();
        Self { random: Pcg64Mcg::seed_from_u64(1), seeds, alphabet }
    }

    fn next(&mut self, bytes: &mut Vec<u8>) {
        bytes.clear();
        let which = self.random.random_range(0..self.seeds.len());
        bytes.extend_from_slice(&self.seeds[which]);
        for _ in 0..self.random.random_range(0..4) {
            let at = self.random.random_range(0..=bytes.len());
            let byte = if self.random.random_range(0..3) == 0 {
                self.random.random()
            } else {
                self.alphabet[self.random.random_range(0..self.alphabet.len())]
            };
            match self.random.random_range(0..4) {
                0 => bytes.insert(at, byte),
                1 if at < bytes.len() => {
                    bytes.remove(at);
                }
                2 if self.random.random_range(0..20) == 0 => bytes.truncate(at),
                _ if at < bytes.len() => bytes[at] = byte,
                _ => {}
            }
        }
    }

    fn each(mut self, cases: u32, mut check: impl FnMut(&[u8])) {
        let mut bytes = Vec::new();
        for _ in 0..cases {
            self.next(&mut bytes);
            check(&bytes);
        }
    }
}

#[test]
fn records_of_the_u_wave() {
    let receiver = format!("RI100123456789002{}", "0".repeat(50));
    let seeds: [&[u8]; 7] = [
        b"DT10002-0000000.001M",
        b"DT10305+0000012.345I",
        b"ST10305FFFFFFFFFF04",
        b"ST1FFFF123456789050",
        receiver.as_bytes(),
        b"TI1002001234567890021",
        b"DR1FF0010",
    ];
    let mut values = 0;
    Mutants::new(&seeds, b"0123456789+-.FMIDTSR1").each(CASES, |line| {
        values += u32::from(targets::uwave(line));
    });
    assert!(values > CASES / 20, "{values} were data records");
}

#[test]
fn lines_of_other_gauges() {
    let seeds =
        ["01A+0000.123", "+0123.456", "ERR2", "OV", "911", "918", "12.345mm", " 0.5000 in ", "#no", "1.0; -2.0; +3.5"];
    let patterns = ["{v}", "01A{v}", "{v};{v};{v}"].map(|p| Pattern::parse(p).unwrap());
    let mut values = 0;
    Mutants::new(&seeds, b"0123456789+-.,; minMI\"AER#").each(CASES, |line| {
        for pattern in &patterns {
            values += u32::from(targets::line_in(line, pattern));
        }
    });
    assert!(values > CASES / 20, "{values} were values");
}

#[test]
fn messages_of_the_controllers() {
    let seeds = [
        "04 1 1.00000 -2.00000 3.00000 0.00000 45.00000 -180.00000",
        "20 0 too far",
        "02 1 2 3 4 5 6",
        "24 1 TriCal 1 6 5.000",
    ];
    let mut taken = 0;
    Mutants::new(&seeds, b"0123456789+-. naief").each(CASES, |message| taken += u32::from(targets::rapid(message)));
    assert!(taken > CASES / 20, "{taken} were messages");
    let body = r#"{"_embedded":{"_state":[{"rax_1":"1.5","rax_2":"-2","rax_3":0,"value":"[1,\"a\"]"}]}}"#;
    let mut taken = 0;
    Mutants::new(&[body], b"0123456789+-.e\"[]{}:,rax_").each(CASES, |bytes| taken += u32::from(targets::rws(bytes)));
    assert!(taken > CASES / 20, "{taken} were answers");
    let mut taken = 0;
    let seeds = ["uwave:///dev/a?x=00&y=%2F1&zero_mm=1,2,3"];
    Mutants::new(&seeds, b"0123456789%&=?/:,").each(CASES, |bytes| taken += u32::from(targets::url(bytes)));
    assert!(taken > CASES / 20, "{taken} were addresses");
}

#[test]
fn packages_of_the_real_time_data_exchange() {
    let mut content = vec![1];
    [1.5, 0.1, -0.2, 0.3, -0.4, 0.5, -0.6_f64].iter().for_each(|v| content.extend(v.to_be_bytes()));
    content.extend([0, 0, 0, 7, 0, 0, 0, 1]);
    let mut states = 0;
    Mutants::new(&[rtde::package(rtde::kind::DATA, &content)], &[0, 1, 3, 68, b'U', 127, 255]).each(CASES, |bytes| {
        states += u32::from(targets::rtde(bytes));
    });
    assert!(states > CASES / 20, "{states} were states");
}

#[test]
fn joint_states_and_rows() {
    let state = JointState {
        seconds: 1_700_000_000,
        nanoseconds: 123_456_789,
        frame: "base_link".to_owned(),
        names: vec!["joint_1".to_owned(), "joint_2".to_owned()],
        position: vec![0.5, -1.25],
        velocity: vec![],
        effort: vec![],
    };
    let mut taken = 0;
    Mutants::new(&[state.to_cdr()], &[0, 1, 2, 4, 8, 255]).each(CASES, |bytes| {
        taken += u32::from(targets::joint_state(bytes));
    });
    assert!(taken > CASES / 20, "{taken} were joint states");
    let row = r#"{"t_s":12.5,"q1_deg":10.0,"q2_deg":-20.5,"dir1":1,"dir2":-1,"ball":3,"ix_mm":0.001,"iy_mm":-0.012,"iz_mm":0.0,"seq":7}"#;
    let mut taken = 0;
    Mutants::new(&[row], b"0123456789+-.e\"{}:,qdir_").each(CASES, |bytes| taken += u32::from(targets::row(bytes)));
    assert!(taken > CASES / 20, "{taken} were measurements");
}

#[test]
fn recordings() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let trical_recording::json::RowRead { row, joints, .. } = row_from_json(
        br#"{"t_s":1,"q1_deg":1,"q2_deg":2,"ball":1,"ix_mm":0.001,"iy_mm":0,"iz_mm":0,"seq":0}"#,
        &mut Default::default(),
    )
    .unwrap();
    let recording = trical_model::recording::Recording {
        name: "a".to_owned(),
        joints,
        rows: vec![row; 3],
        ..trical_model::recording::Recording::default()
    };
    write_recording(&path, &recording, &Header::for_joints(2)).unwrap();
    let whole = std::fs::read(&path).unwrap();
    assert_eq!(read_recording(&path).unwrap().recording.rows.len(), 3);
    // a file is a thousand times longer than a record, and its chunks have checksums
    Mutants::new(&[whole], &[0, 1, 2, 5, 6, 255]).each(CASES / 20, |bytes| {
        if let Ok(read) = read_bytes("a.mcap".as_ref(), bytes) {
            for found in &read.recording.rows {
                assert_eq!((found.state.q, found.measured, found.seq), (row.state.q, row.measured, row.seq));
            }
        }
    });
}
