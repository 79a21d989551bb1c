//! Recordings through the real drivers: whole, cut, taken up again.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::{Gantry, options, plan};
use trical_device::{
    CellOptions, PlanEntry, ProcedureOptions, Progress, VirtualCell, open_controller, open_gauge, run,
};
use trical_model::Recording;
use trical_model::recording::{Measured, Row, State};
use trical_recording::mcap::Header;
use trical_recording::mcap::{Attachment, RunLog, each_row, write_recording};
use trical_recording::motion::JointSample;
use trical_recording::{ReadRecording, RecordError, RecordingWriter, read_recording};

fn header() -> Header {
    Header {
        start_ns: 1_700_000_000_000_000_000,
        attachments: vec![
            Attachment::toml("robot.toml", "name = \"gantry\"\n"),
            Attachment::toml("cell.toml", "[tool]\n"),
        ],
        settings: [("epsilon_mm".to_owned(), "0.005".to_owned())].into(),
        robot_description: Some("<robot name=\"gantry\"/>".to_owned()),
        ..Header::for_joints(6)
    }
}

fn cell() -> VirtualCell {
    let options = CellOptions { start: plan(1)[0].via[0], ..CellOptions::default() };
    VirtualCell::start(Box::new(Gantry::default()), options).unwrap()
}

/// Drives until so many touches are measured, then stops; gives the size of the file after each.
fn drive(
    cell: &VirtualCell,
    log: &mut RecordingWriter,
    path: &Path,
    plan: &[PlanEntry],
    options: &ProcedureOptions<'_>,
    stop_after: usize,
) -> Vec<u64> {
    let mut gauge = open_gauge(&cell.gauge_url()).unwrap();
    let mut controller = open_controller(&cell.controller_url()).unwrap();
    let cancel = AtomicBool::new(false);
    let mut sizes = Vec::new();
    let result = run(plan, (gauge.as_mut(), controller.as_mut()), log, options, &cancel, &mut |event| {
        if let Progress::Measured { .. } = event {
            sizes.push(std::fs::metadata(path).unwrap().len());
        }
        if sizes.len() >= stop_after && matches!(event, Progress::Begin { .. }) {
            cancel.store(true, Ordering::Relaxed);
        }
    });
    assert!(result.is_ok() || result.unwrap_err().is_cancelled());
    sizes
}

fn recorded(touches: u64) -> (tempfile::TempDir, std::path::PathBuf, Vec<u64>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RecordingWriter::create(&path, &header()).unwrap();
    let sizes = drive(&cell(), &mut log, &path, &plan(touches), &options(), usize::MAX);
    log.finish().unwrap();
    (folder, path, sizes)
}

fn recorded_row() -> Row {
    let measured = Measured::Touch { ball: 0, reading: [1e-6; 3] };
    Row { state: State { t: Some(1.0), ..State::at(&[0.1; 6]) }, measured, seq: Some(0), line: 0 }
}

fn rows(read: &ReadRecording) -> Vec<u64> {
    read.recording.rows.iter().map(|row| row.seq.unwrap()).collect()
}

#[test]
fn a_recording_holds_rows_history_files_and_settings() {
    let (_folder, path, _) = recorded(5);
    let read = read_recording(&path).unwrap();
    assert_eq!(rows(&read), [0, 1, 2, 3, 4]);
    assert_eq!(read.recording.joints, 6);
    assert_eq!(read.lost, None);
    assert_eq!(read.attachment("robot.toml"), Some("name = \"gantry\"\n"));
    assert_eq!(read.metadata["trical"]["epsilon_mm"], "0.005");
    assert_eq!(read.metadata["trical"]["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(read.start_ns, header().start_ns);
    assert!(read.joint_states.len() > 5 * 10, "continuous while the robot moves: {}", read.joint_states.len());
    assert!(read.joint_states.windows(2).all(|pair| pair[0].t <= pair[1].t));
    assert!(read.indicators.iter().filter(|sample| sample.settled).count() >= 10);
    // the index that viewers rely on
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes.len(), 2);
    assert_eq!(summary.stats.unwrap().message_count as usize, mcap::MessageStream::new(&bytes).unwrap().count());
    let topics: std::collections::BTreeSet<_> = summary.channels.values().map(|c| c.topic.clone()).collect();
    for topic in ["/joint_states", "/indicators", "/temperature", "/measurement", "/robot_description"] {
        assert!(topics.contains(topic), "{topic}");
    }
}

#[test]
fn senses_of_motion_come_from_the_joint_states_where_the_rows_have_none() {
    let (folder, path, _) = recorded(6);
    let read = read_recording(&path).unwrap();
    let bare = folder.path().join("bare.mcap");
    let mut log = RecordingWriter::create(&bare, &header()).unwrap();
    let mut rows = read.recording.rows.iter().peekable();
    for sample in &read.joint_states {
        while rows.peek().is_some_and(|row| row.state.t.unwrap() + 1e-6 < sample.t) {
            write_bare(&mut log, rows.next().unwrap());
        }
        log.joint_state(sample).unwrap();
    }
    rows.for_each(|row| write_bare(&mut log, row));
    log.finish().unwrap();
    let again = read_recording(&bare).unwrap();
    for (ours, theirs) in again.recording.rows.iter().zip(&read.recording.rows) {
        assert_eq!(ours.state.dir, theirs.state.dir);
    }
}

fn write_bare(log: &mut RecordingWriter, row: &Row) {
    let mut row = *row;
    row.state.dir = None;
    log.measurement(&row).unwrap();
}

#[test]
fn a_file_cut_anywhere_gives_all_complete_measurements() {
    let (folder, path, sizes) = recorded(6);
    let bytes = std::fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    for length in (0..bytes.len()).step_by(100) {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        if length < 8 {
            assert!(matches!(read_recording(&cut), Err(RecordError::NotMcap { .. })));
            continue;
        }
        let read = read_recording(&cut).unwrap();
        let complete = sizes.iter().filter(|size| **size as usize <= length).count();
        assert!(read.recording.rows.len() >= complete, "cut at {length}");
        assert!(read.lost.is_some() || length as u64 > sizes[5]);
        // and it can be taken up from there
        if length % 2_000 == 0 {
            let (log, before) = RecordingWriter::resume(&cut, &header()).unwrap();
            log.finish().unwrap();
            let resumed = read_recording(&cut).unwrap();
            assert_eq!(resumed.recording.rows, before.unwrap().recording.rows);
            assert_eq!(resumed.lost, None);
        }
    }
}

#[test]
fn rows_come_one_by_one_as_they_do_at_once_and_a_cut_file_is_refused() {
    let (folder, path, _) = recorded(6);
    let mut rows = Vec::new();
    let joints = each_row(&path, &mut |row| {
        rows.push(row);
        Ok(())
    });
    let whole = read_recording(&path).unwrap().recording;
    assert_eq!(joints.unwrap().joints, whole.joints);
    assert_eq!(rows, whole.rows);

    let bytes = std::fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    for length in (0..bytes.len()).step_by(97) {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        let end = each_row(&cut, &mut |_| Ok(()));
        let read = read_recording(&cut);
        // what is lost behind the end record is lost to nobody
        let lost = read.map_or(true, |r| r.lost.is_some());
        assert_eq!(end.is_err(), lost, "cut at {length}: {end:?}");
        if let Err(e) = end {
            assert!(e.to_string().contains("cut.mcap"), "{e}");
        }
    }
    let stop = || RecordError::Unreadable { path: path.clone(), problem: "enough".into() };
    assert!(matches!(each_row(&path, &mut |_| Err(stop())), Err(RecordError::Unreadable { .. })));
}

#[test]
fn bytes_that_changed_are_an_error_or_a_shorter_recording_never_a_panic() {
    let (folder, path, _) = recorded(3);
    let bytes = std::fs::read(&path).unwrap();
    let rows = read_recording(&path).unwrap().recording.rows;
    let broken = folder.path().join("broken.mcap");
    let mut recovered = 0;
    let mut tried = 0;
    for at in (8..bytes.len()).step_by(53) {
        let mut bytes = bytes.clone();
        bytes[at] ^= 0xFF;
        std::fs::write(&broken, &bytes).unwrap();
        if let Ok(read) = read_recording(&broken) {
            // their numbers change where one is lost before them
            let one_of = |row: &Row| rows.iter().any(|r| *row == Row { line: row.line, ..*r });
            assert!(read.recording.rows.iter().all(one_of), "a wrong row, byte {at}");
            recovered += read.recording.rows.len();
            tried += 1;
        }
    }
    assert!(recovered > tried, "most rows survive: {recovered} in {tried} files");
}

#[test]
fn a_run_that_was_broken_off_is_taken_up_with_nothing_lost_or_doubled() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let cell = cell();
    let mut log = RecordingWriter::create(&path, &header()).unwrap();
    drive(&cell, &mut log, &path, &plan(7), &options(), 3);
    // as after a crash: no end is written, and nobody holds the file
    let crashed = folder.path().join("crashed");
    std::fs::copy(&path, &crashed).unwrap();
    drop(log);
    std::fs::rename(&crashed, &path).unwrap();

    let (mut log, before) = RecordingWriter::resume(&path, &Header { start_ns: 1, ..header() }).unwrap();
    let before = before.unwrap();
    assert_eq!(rows(&before), [0, 1, 2]);
    assert!(before.lost.is_some());
    let again = ProcedureOptions { skip: before.done(), begin_t: log.last_t(), ..options() };
    drive(&cell, &mut log, &path, &plan(7), &again, usize::MAX);
    log.finish().unwrap();

    let read = read_recording(&path).unwrap();
    assert_eq!(rows(&read), [0, 1, 2, 3, 4, 5, 6]);
    assert_eq!(read.recording.rows[..3], before.recording.rows[..]);
    assert_eq!(read.lost, None);
    assert_eq!(read.start_ns, header().start_ns, "times go on from the first beginning");
    assert_eq!(read.attachments.len(), 2);
    assert!(read.recording.rows.windows(2).all(|pair| pair[0].state.t < pair[1].state.t));
    let note = &read.metadata["trical.resumed.1"]["recovered"];
    assert!(note.contains("damaged or incomplete") && note.contains("messages were recovered"), "{note}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");

    // taking up a whole recording changes nothing that counts
    let (log, _) = RecordingWriter::resume(&path, &header()).unwrap();
    log.finish().unwrap();
    assert_eq!(read_recording(&path).unwrap().recording, read.recording);
}

#[test]
fn a_recording_is_taken_up_with_the_same_robot_and_cell_only() {
    let (_folder, path, _) = recorded(1);
    let mut other = header();
    other.attachments[1] = Attachment::toml("cell.toml", "[tool]\nmass_kg = 2.0\n");
    let error = RecordingWriter::resume(&path, &other).err().unwrap();
    assert!(error.to_string().contains("another cell.toml"), "{error}");
    let error =
        RecordingWriter::resume(&path, &Header { joint_names: vec!["a".to_owned()], ..header() }).err().unwrap();
    assert!(error.to_string().contains("number of joints"), "{error}");
    let error = RecordingWriter::create(&path, &header()).err().unwrap();
    assert!(matches!(error, RecordError::Exists { .. }));
}

#[test]
fn a_recording_is_taken_up_with_its_own_plan_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let of = |plan: &str| Header { plan_sha256: Some(plan.to_owned()), ..header() };
    RecordingWriter::create(&path, &of("a")).unwrap().finish().unwrap();
    for other in [of("b"), header()] {
        let error = RecordingWriter::resume(&path, &other).err().unwrap().to_string();
        assert!(error.contains("run.mcap: was recorded with another plan"), "{error}");
    }
    RecordingWriter::resume(&path, &of("a")).unwrap().0.finish().unwrap();
    // and still so once it was taken up
    assert!(RecordingWriter::resume(&path, &of("b")).is_err());
}

#[cfg(unix)]
#[test]
fn a_recording_that_is_removed_or_replaced_while_it_is_written_is_kept_in_another_file() {
    for replaced in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RecordingWriter::create(&path, &header()).unwrap();
        let row = |seq| Row { seq: Some(seq), ..recorded_row() };
        log.measurement(&row(0)).unwrap();
        std::fs::remove_file(&path).unwrap();
        if replaced {
            std::fs::write(&path, "another file").unwrap();
        }
        let error = log.measurement(&row(1)).unwrap_err();
        let RecordError::Removed { saved: Ok(saved), .. } = &error else { panic!("{error}") };
        let name = if replaced { "run.rescued-1.mcap" } else { "run.mcap" };
        assert_eq!(*saved, folder.path().join(name), "{error}");
        log.finish().unwrap();
        // nor does whoever takes the recording up touch it
        drop(RecordingWriter::resume(&path, &header()));
        assert_eq!(rows(&read_recording(saved).unwrap()), [0, 1]);
    }
}

#[cfg(unix)]
#[test]
fn a_recording_that_is_renamed_while_it_is_written_stays_whole() {
    let folder = tempfile::tempdir().unwrap();
    let [run, before, after] = ["run", "before", "after"].map(|name| folder.path().join(name));
    std::fs::create_dir(&before).unwrap();
    let mut log = RecordingWriter::create(&before.join("run.mcap"), &header()).unwrap();
    log.measurement(&recorded_row()).unwrap();
    std::fs::rename(&before, &after).unwrap();
    let error = log.measurement(&Row { seq: Some(1), ..recorded_row() }).unwrap_err();
    assert!(error.to_string().contains("run.mcap: was moved or renamed while it was written"), "{error}");
    log.finish().unwrap();
    let read = read_recording(&after.join("run.mcap")).unwrap();
    assert_eq!((read.recording.rows.len(), read.lost), (2, None));
    // also where the folder is there and the file is renamed in it
    let mut log = RecordingWriter::create(&run, &header()).unwrap();
    log.measurement(&recorded_row()).unwrap();
    std::fs::rename(&run, folder.path().join("kept")).unwrap();
    assert!(matches!(log.finish().unwrap_err(), RecordError::Moved { .. }));
    assert!(!run.exists() && read_recording(&folder.path().join("kept")).unwrap().lost.is_none());
}

#[cfg(unix)]
#[test]
fn a_recording_that_another_program_empties_or_writes_over_ends_the_run() {
    for other in [String::new(), "x".repeat(1 << 16)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RecordingWriter::create(&path, &header()).unwrap();
        log.measurement(&recorded_row()).unwrap();
        log.measurement(&Row { seq: Some(1), ..recorded_row() }).unwrap();
        std::fs::write(&path, other).unwrap();
        let error = log.measurement(&Row { seq: Some(2), ..recorded_row() }).unwrap_err();
        assert!(matches!(error, RecordError::Removed { saved: Err(_), .. }), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn a_recording_that_is_removed_is_told_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RecordingWriter::create(&path, &header()).unwrap();
    log.measurement(&recorded_row()).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(log.finish().unwrap_err(), RecordError::Removed { saved: Ok(_), .. }));
    let read = read_recording(&path).unwrap();
    assert_eq!((read.recording.rows.len(), read.lost), (1, None));
}

#[cfg(windows)]
#[test]
fn a_recording_cannot_be_removed_renamed_or_written_over_while_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let check = |mut log: RecordingWriter, seq| {
        std::fs::remove_file(&path).unwrap_err();
        std::fs::rename(&path, folder.path().join("other.mcap")).unwrap_err();
        std::fs::write(&path, "").unwrap_err();
        log.measurement(&Row { seq: Some(seq), ..recorded_row() }).unwrap();
        assert_eq!(read_recording(&path).unwrap().recording.rows.len() as u64, seq + 1);
        log.finish().unwrap();
    };
    check(RecordingWriter::create(&path, &header()).unwrap(), 0);
    check(RecordingWriter::resume(&path, &header()).unwrap().0, 1);
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn what_the_free_stems_read_at_first_is_in_the_recording() {
    let (_folder, path, _) = recorded(2);
    let read = read_recording(&path).unwrap();
    let free = |reading: &[f64; 3]| reading.iter().all(|v| (v - 6e-3).abs() < 1e-9);
    assert_eq!(read.indicators.iter().filter(|sample| free(&sample.reading)).count(), 1);
}

#[test]
fn a_recording_has_one_writer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let log = RecordingWriter::create(&path, &header()).unwrap();
    let busy = |error: RecordError| {
        assert!(matches!(error, RecordError::Busy { .. }), "{error}");
        assert!(error.to_string().contains("run.mcap: another program is writing it"), "{error}");
    };
    busy(RecordingWriter::resume(&path, &header()).err().unwrap());
    busy(RecordingWriter::create(&path, &header()).err().unwrap());
    busy(write_recording(&path, &Recording { joints: 6, ..Recording::default() }, &header()).unwrap_err());
    log.finish().unwrap();
    let (log, _) = RecordingWriter::resume(&path, &header()).unwrap();
    // the new file has the name of the old one, and is locked as well
    busy(RecordingWriter::resume(&path, &header()).err().unwrap());
    log.finish().unwrap();
}

#[test]
fn files_beside_a_recording_are_left_alone_and_none_is_added() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other, precious] = ["run.mcap", "run.mcap.part", "precious"].map(|name| folder.path().join(name));
    std::fs::write(&other, "of somebody else").unwrap();
    std::fs::write(&precious, "mine").unwrap();
    // the name of the file in which it is begun
    let begun = folder.path().join(format!("run.mcap.part{}", std::process::id()));
    #[cfg(unix)]
    std::os::unix::fs::symlink(&precious, &begun).unwrap();
    #[cfg(not(unix))]
    std::fs::write(&begun, "of a program that was killed").unwrap();
    RecordingWriter::create(&path, &header()).unwrap().finish().unwrap();
    RecordingWriter::resume(&path, &header()).unwrap().0.finish().unwrap();
    assert_eq!(std::fs::read_to_string(&other).unwrap(), "of somebody else");
    assert_eq!(std::fs::read_to_string(&precious).unwrap(), "mine");
    // nor is anything left of one that cannot be put there
    std::fs::create_dir(folder.path().join("folder.mcap")).unwrap();
    let none = Recording { joints: 6, ..Recording::default() };
    assert!(write_recording(&folder.path().join("folder.mcap"), &none, &header()).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
}

#[cfg(unix)]
#[test]
fn a_recording_begins_where_a_link_leads_to() {
    let folder = tempfile::tempdir().unwrap();
    let [link, target] = ["link.mcap", "run.mcap"].map(|name| folder.path().join(name));
    std::os::unix::fs::symlink(&target, &link).unwrap();
    RecordingWriter::create(&link, &header()).unwrap().finish().unwrap();
    assert!(link.is_symlink() && read_recording(&target).is_ok());
    // a folder that is not there, as of a disk that is not mounted
    let away = folder.path().join("away.mcap");
    std::os::unix::fs::symlink(folder.path().join("disk/run.mcap"), &away).unwrap();
    assert!(RecordingWriter::create(&away, &header()).is_err() && away.is_symlink());
}

#[test]
fn a_measurement_that_could_not_be_read_again_is_not_written() {
    let (_folder, path, _) = recorded(2);
    let (mut log, before) = RecordingWriter::resume(&path, &header()).unwrap();
    let mut row = before.unwrap().recording.rows[1];
    row.state.t = Some(1e12);
    let error = log.measurement(&row).unwrap_err().to_string();
    assert!(error.contains("run.mcap: a measurement was not written") && error.contains("t_s"), "{error}");
    log.finish().unwrap();
    assert_eq!(rows(&read_recording(&path).unwrap()), [0, 1]);
}

#[test]
fn what_is_no_recording_is_one_clear_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows.csv");
    std::fs::write(&path, "q1_deg,q2_deg\n1,2\n").unwrap();
    let error = read_recording(&path).unwrap_err().to_string();
    assert!(error.contains("rows.csv: not an MCAP recording (begins with \"q1_deg,q\""), "{error}");
    let error = read_recording(&folder.path().join("none.mcap")).unwrap_err().to_string();
    assert!(error.contains("none.mcap: cannot open"), "{error}");
}

#[test]
fn the_same_rows_give_the_same_bytes() {
    let (folder, path, _) = recorded(4);
    let read = read_recording(&path).unwrap();
    let files = ["a.mcap", "b.mcap"].map(|name| {
        let path = folder.path().join(name);
        write_recording(&path, &read.recording, &header()).unwrap();
        std::fs::read(path).unwrap()
    });
    assert_eq!(files[0], files[1]);
    assert_eq!(read_recording(&folder.path().join("a.mcap")).unwrap().recording.rows, read.recording.rows);
    let again = folder.path().join("again.mcap");
    let mut log = RecordingWriter::create(&again, &header()).unwrap();
    drive(&cell(), &mut log, &again, &plan(4), &options(), usize::MAX);
    log.finish().unwrap();
    assert_eq!(std::fs::read(again).unwrap(), std::fs::read(path).unwrap(), "a whole run repeats byte for byte");
}

#[test]
fn joint_states_carry_the_time_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut log = RecordingWriter::create(&path, &header()).unwrap();
    let sample = JointSample { t: 1.5, q: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.0, 0.0, 0.0] };
    log.joint_state(&sample).unwrap();
    log.finish().unwrap();
    assert_eq!(read_recording(&path).unwrap().joint_states, [sample]);
    let bytes = std::fs::read(&path).unwrap();
    let message = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap)
        .find(|m| m.channel.topic == "/joint_states")
        .unwrap();
    let state = trical_recording::mcap::cdr::JointState::from_cdr(&message.data).unwrap();
    assert_eq!((state.seconds, state.nanoseconds), (1_700_000_001, 500_000_000));
    assert_eq!(state.names[5], "joint_6");
    let schema = message.channel.schema.clone().unwrap();
    assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("sensor_msgs/msg/JointState", "ros2msg"));
}

#[test]
fn recordings_of_other_programs_may_be_compressed_with_lz4_and_have_no_directions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let mut writer = options.create(std::fs::File::create(&path).unwrap()).unwrap();
    let channel = writer.add_channel(0, "/measurement", "json", &Default::default()).unwrap();
    for (number, text) in [
        r#"{"q1_deg": 1.5, "q2_deg": -2, "ball": 1, "ix_mm": 0.001, "iy_mm": 0, "iz_mm": 0}"#,
        r#"{"q1_deg": 2.5, "q2_deg": -2, "x_mm": 1, "y_mm": 2, "z_mm": 3}"#,
    ]
    .into_iter()
    .enumerate()
    {
        let time = number as u64;
        let header =
            mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let read = read_recording(&path).unwrap();
    assert_eq!((read.recording.rows.len(), read.recording.joints, read.lost), (2, 2, None));
    assert_eq!(read.recording.rows[0].state.dir, None);

    let mut wrong = std::fs::read(&path).unwrap();
    let at = wrong.windows(4).position(|bytes| bytes == b"\x03\0\0\0").unwrap() + 4;
    wrong[at..at + 3].copy_from_slice(b"xyz");
    std::fs::write(&path, wrong).unwrap();
    let error = read_recording(&path).unwrap_err().to_string();
    assert!(error.contains("compressed with \"xyz\"; expected none, lz4 or zstd"), "{error}");
}
