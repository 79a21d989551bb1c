//! A measuring process that is killed in the middle, and another that takes its recording up.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use crate::common::{Gantry, options, plan};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_device::{CellOptions, ProcedureOptions, Progress, VirtualCell, open_controller, open_gauge, run};
use trical_recording::mcap::Header;
use trical_recording::{RecordingWriter, read_recording};

const TOUCHES: u64 = 8;

/// The measuring process: does nothing unless started by the test below.
#[test]
fn child() {
    let Ok(path) = std::env::var("TRICAL_TEST_RECORDING") else { return };
    let mut gauge = open_gauge(&std::env::var("TRICAL_TEST_GAUGE").unwrap()).unwrap();
    let mut controller = open_controller(&std::env::var("TRICAL_TEST_CONTROLLER").unwrap()).unwrap();
    let (mut log, before) = RecordingWriter::resume(path.as_ref(), &Header::default()).unwrap();
    let skip = before.map(|read| read.done()).unwrap_or_default();
    let options = ProcedureOptions { skip, begin_t: log.last_t(), ..options() };
    // what is told here has been accepted: it must be in the file, whatever comes
    let mut tell = |event| {
        if let Progress::Measured { row, .. } = event {
            let mut told = std::fs::OpenOptions::new().append(true).create(true).open(format!("{path}.told")).unwrap();
            told.write_all(format!("{}\n", row.seq.unwrap()).as_bytes()).unwrap();
        }
    };
    let touches = std::env::var("TRICAL_TEST_TOUCHES").map_or(TOUCHES, |text| text.parse().unwrap());
    let cancel = AtomicBool::new(false);
    run(&plan(touches), (gauge.as_mut(), controller.as_mut()), &mut log, &options, &cancel, &mut tell).unwrap();
    log.finish().unwrap();
}

fn start(cell: &VirtualCell, path: &PathBuf) -> Child {
    start_with(cell, path, TOUCHES)
}

fn start_with(cell: &VirtualCell, path: &PathBuf, touches: u64) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "kill::child", "--nocapture"])
        .env("TRICAL_TEST_RECORDING", path)
        .env("TRICAL_TEST_TOUCHES", touches.to_string())
        .env("TRICAL_TEST_GAUGE", cell.gauge_url())
        .env("TRICAL_TEST_CONTROLLER", cell.controller_url())
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn nothing_is_lost_or_doubled_when_the_process_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    // about 25 simulated seconds a touch: 50 ms of real time
    let options = CellOptions { start: plan(1)[0].via[0], pace: 2e-3, ..CellOptions::default() };
    let cell = VirtualCell::start(Box::new(Gantry::default()), options).unwrap();

    let mut measured = Vec::new();
    for wanted in [2, 4] {
        let mut child = start(&cell, &path);
        let begin = Instant::now();
        loop {
            let count = read_recording(&path).map_or(0, |read| read.recording.rows.len());
            if count >= wanted {
                break;
            }
            assert!(begin.elapsed() < Duration::from_secs(20), "the process does not measure");
            std::thread::sleep(Duration::from_millis(3));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let rows = read_recording(&path).unwrap().recording.rows;
        assert!(rows.len() >= wanted);
        assert_eq!(rows[..measured.len()], measured[..], "what was there before is there still");
        measured = rows;
    }
    assert!(start(&cell, &path).wait().unwrap().success());

    let read = read_recording(&path).unwrap();
    assert_eq!(read.recording.rows[..measured.len()], measured[..]);
    let numbers: Vec<u64> = read.recording.rows.iter().map(|row| row.seq.unwrap()).collect();
    assert_eq!(numbers, (0..TOUCHES).collect::<Vec<_>>());
    assert_eq!(read.lost, None);
    assert!(read.recording.rows.windows(2).all(|pair| pair[0].state.t < pair[1].state.t));
}

#[test]
fn a_hundred_kills_at_random_lose_and_double_nothing() {
    const KILLS: usize = 100;
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let (mut kills, mut files, mut rows_in_all) = (0, 0, 0);
    while kills < KILLS {
        files += 1;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let told = folder.path().join("run.mcap.told");
        let options = CellOptions { start: plan(1)[0].via[0], seed: files, ..CellOptions::default() };
        let cell = VirtualCell::start(Box::new(Gantry::default()), options).unwrap();
        loop {
            let mut child = start_with(&cell, &path, 300);
            std::thread::sleep(Duration::from_micros(random.random_range(5_000..90_000)));
            let ended = if kills < KILLS { child.try_wait().unwrap() } else { Some(child.wait().unwrap()) };
            let last = match ended {
                Some(status) => {
                    assert!(status.success());
                    true
                }
                None => {
                    child.kill().unwrap();
                    child.wait().unwrap();
                    kills += 1;
                    false
                }
            };
            let accepted: Vec<u64> =
                std::fs::read_to_string(&told).unwrap_or_default().lines().map(|line| line.parse().unwrap()).collect();
            // the file may not be there yet
            let there: Vec<u64> = match read_recording(&path) {
                Ok(read) => read.recording.rows.iter().map(|row| row.seq.unwrap()).collect(),
                Err(error) => {
                    assert!(accepted.is_empty(), "{error}");
                    Vec::new()
                }
            };
            assert!(
                there.starts_with(&accepted) || accepted.iter().all(|n| there.contains(n)),
                "{accepted:?} {there:?}"
            );
            assert_eq!(there, (0..there.len() as u64).collect::<Vec<_>>(), "lost or doubled after {kills} kills");
            if last {
                assert_eq!(there.len(), 300);
                rows_in_all += there.len();
                break;
            }
        }
    }
    assert!(rows_in_all > 0 && files < KILLS as u64, "{files} files");
}
