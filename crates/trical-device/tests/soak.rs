//! Hours of simulated measuring through the real drivers, recorded as MCAP: memory does not grow with time.
//!
//! Two hours by default; `TRICAL_SOAK_S=86400 cargo test -p trical-device --test soak -- --nocapture` measures for a day.

#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
#![cfg(target_os = "linux")]

mod common;

use std::sync::atomic::{AtomicBool, Ordering};

use common::{Bench, Gantry, options, plan};
use trical_device::{CellOptions, Progress, run};
use trical_recording::mcap::Header;
use trical_recording::{RecordingWriter, read_recording};

/// Two hours, s.
const USUAL: f64 = 7200.0;
/// What may be added between a tenth of the time and its end, KiB: an index of the file's chunks and what an allocator keeps.
/// The recording is four times as large.
const GROWTH: u64 = 2048;

/// Resident memory of this process, KiB.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with("VmRSS:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

#[test]
fn two_hours_of_measuring_leave_memory_flat() {
    let seconds = std::env::var("TRICAL_SOAK_S").map_or(USUAL, |s| s.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("soak.mcap");
    let mut bench = Bench::new(Gantry { backlash: 5e-6, ..Gantry::default() }, CellOptions::default());
    let mut log = RecordingWriter::create(&path, &Header::for_joints(6)).unwrap();
    // no touch takes less than the time to settle and read
    let touches = (seconds / 2.0) as u64;
    let (stop, mut early, mut last, mut rows) = (AtomicBool::new(false), None, 0.0, 0);
    let ended = run(
        &plan(touches),
        (bench.gauge.as_mut(), bench.controller.as_mut()),
        &mut log,
        &options(),
        &stop,
        &mut |event| {
            if let Progress::Measured { row, .. } = event {
                rows += 1;
                last = row.state.t.unwrap();
                if last > 0.1 * seconds && early.is_none() {
                    early = Some(resident());
                }
                stop.store(last >= seconds, Ordering::Relaxed);
            }
        },
    );
    assert!(ended.unwrap_err().is_cancelled());
    let (early, late) = (early.unwrap(), resident());
    log.finish().unwrap();
    let bytes = std::fs::metadata(&path).unwrap().len();
    println!("{last:.0} s, {rows} touches, {bytes} bytes: {early} KiB after a tenth, {late} KiB at the end");
    assert!(last >= seconds);
    assert!(late < early + GROWTH, "{early} KiB after a tenth of the time, {late} KiB at its end");
    assert_eq!(read_recording(&path).unwrap().recording.rows.len(), rows);
}
