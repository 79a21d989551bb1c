//! A measuring process that is killed in the middle, and another that takes its recording up.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use common::{Gantry, options, plan};
use trical_device::{
    CellOptions, Header, ProcedureOptions, RecordingWriter, VirtualCell, open_controller, open_gauge, read_recording,
    run,
};

const TOUCHES: u64 = 8;

/// The measuring process: does nothing unless started by the test below.
#[test]
fn child() {
    let Ok(path) = std::env::var("TRICAL_TEST_RECORDING") else {
        return;
    };
    let mut gauge = open_gauge(&std::env::var("TRICAL_TEST_GAUGE").unwrap()).unwrap();
    let mut controller = open_controller(&std::env::var("TRICAL_TEST_CONTROLLER").unwrap()).unwrap();
    let (mut log, before) = RecordingWriter::resume(path.as_ref(), &Header::default()).unwrap();
    let skip = before.map(|read| read.done()).unwrap_or_default();
    let options = ProcedureOptions { skip, begin_t: log.last_t(), ..options() };
    run(&plan(TOUCHES), gauge.as_mut(), controller.as_mut(), &mut log, &options, &AtomicBool::new(false), &mut |_| ())
        .unwrap();
    log.finish().unwrap();
}

fn start(cell: &VirtualCell, path: &PathBuf) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child"])
        .env("TRICAL_TEST_RECORDING", path)
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
