//! What a recording says comes back from CSV and from MCAP.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::robot;
use trical_model::{Measured, Recording, Row, State};
use trical_recording::mcap::{Attachment, Header, RecordingWriter, RunLog, check_same, each_row};
use trical_recording::motion::JointSample;
use trical_recording::stream::SAMPLE;
use trical_recording::visits::Visits;
use trical_recording::{
    CsvStream, RecordError, open, open_damaged, open_large, parse_csv, refuse_other_units, to_csv, write_recording,
};

/// A rail with an arm of two joints that senses torques, at two places.
const RAIL: &str = "seq,place,q1_mm,q2_deg,q3_deg,qc1_mm,qc2_deg,qc3_deg,tau1_nm,tau2_nm,tau3_nm,ball,ix_mm,iy_mm,iz_mm\n\
                    1,left,1250.5,10,-20.5,1250.25,10,-20.5,12.5,-3.25,0,1,0.01,-0.02,0.003\n\
                    2,\"right, by the door\",1300,11,-21,1300,11,-21,,,,2,0.011,-0.021,0.004\n\
                    3,left,1350,12,-22,,,,12,-3,0.5,1,0.012,-0.022,0.005\n\
                    4,,1350,12,-22,,,,12,-3,0.5,1,0.012,-0.022,0.005\n";

fn rail() -> Recording {
    parse_csv(RAIL.as_bytes(), "rail.csv", 3).unwrap()
}

/// All that the rows say, without the lines and the name of the file.
fn same(a: &Recording, b: &Recording) {
    assert_eq!((a.joints, a.prismatic, &a.places), (b.joints, b.prismatic, &b.places));
    assert_eq!(a.rows.len(), b.rows.len());
    for (a, b) in a.rows.iter().zip(&b.rows) {
        assert_eq!((a.seq, a.state.place, a.state.torques), (b.seq, b.state.place, b.state.torques));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close(&a.state.q, &b.state.q), "{:?} {:?}", a.state.q, b.state.q);
        assert_eq!(a.state.q_commanded.is_some(), b.state.q_commanded.is_some());
        assert!(close(&a.state.q_commanded.unwrap_or_default(), &b.state.q_commanded.unwrap_or_default()));
    }
}

#[test]
fn places_torques_and_slides_are_read_as_they_are_written() {
    let r = rail();
    assert_eq!(r.places, ["left", "right, by the door"]);
    assert_eq!(r.rows.iter().map(|r| r.state.place).collect::<Vec<_>>(), [Some(0), Some(1), Some(0), None]);
    assert_eq!(r.prismatic.unwrap()[..3], [true, false, false]);
    assert!((r.rows[0].state.q[0] - 1.2505).abs() < 1e-15 && (r.rows[0].state.q[1] - 10f64.to_radians()).abs() < 1e-15);
    assert!((r.rows[0].state.q_commanded.unwrap()[0] - 1.25025).abs() < 1e-15);
    assert_eq!(r.rows[0].state.torques.unwrap()[..3], [12.5, -3.25, 0.0]);
    assert!(r.rows[1].state.torques.is_none() && r.rows[2].state.q_commanded.is_none());
    assert_eq!(String::from_utf8(to_csv(&r).unwrap()).unwrap(), RAIL);
}

#[test]
fn a_joint_in_another_unit_than_the_robots_is_refused_from_every_kind_of_file() {
    let dir = tempfile::tempdir().unwrap();
    let (slides, turns) = (robot(&["prismatic", "revolute", "revolute"]), robot(&["revolute"; 3]));
    let [csv, mcap] = ["rail.csv", "rail.mcap"].map(|name| dir.path().join(name));
    std::fs::write(&csv, "q1_m,q2_deg,q3_deg,x_mm,y_mm,z_mm\n1.25,0,1,2,3,4\n").unwrap();
    write_recording(&mcap, &rail(), &Header::for_joints(3)).unwrap();
    let says = "joint 1: found column q1_mm or q1_m, expected q1_deg or q1_rad, for this joint of the robot turns";
    for path in [&csv, &mcap] {
        let read = open(path, Some(3)).unwrap();
        refuse_other_units(&read, &slides).unwrap();
        let said = refuse_other_units(&read, &turns).unwrap_err().to_string();
        assert_eq!(said, format!("{}, {says}", path.display()));
    }
    let said = open_large(std::slice::from_ref(&csv), &turns, true, true).unwrap_err().to_string();
    assert!(said.ends_with(says), "{said}");
    let deg = parse_csv(b"q1_rad,x_mm,y_mm,z_mm\n1,2,3,4\n", "r.csv", 1).unwrap();
    let said = refuse_other_units(&deg, &robot(&["prismatic"])).unwrap_err().to_string();
    assert!(
        said.contains("found column q1_deg or q1_rad, expected q1_mm or q1_m,") && said.ends_with("slides"),
        "{said}"
    );
    // arrays in SI do not say it
    refuse_other_units(&Recording { joints: 3, prismatic: None, ..deg }, &slides).unwrap();
}

#[test]
fn a_recording_that_is_being_measured_has_millimetres_of_joints_that_slide() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rail.mcap");
    let header = Header { prismatic: rail().prismatic.unwrap(), ..Header::for_joints(3) };
    let mut writer = RecordingWriter::create(&path, &header).unwrap();
    writer.measurement(&Row { state: State { place: None, ..rail().rows[0].state }, ..rail().rows[0] }).unwrap();
    writer.finish().unwrap();
    assert_eq!(open(&path, None).unwrap().prismatic, rail().prismatic);
    let said = RecordingWriter::resume(&path, &Header::for_joints(3)).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("unit of a joint"), "{said}");
}

#[test]
fn an_mcap_recording_says_what_its_csv_says() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rail.mcap");
    let r = rail();
    write_recording(&path, &r, &Header::for_joints(3)).unwrap();
    let back = open(&path, None).unwrap();
    same(&back, &r);
    assert_eq!(to_csv(&back).unwrap(), RAIL.as_bytes());
    assert!(matches!(open(&path, Some(6)), Err(RecordError::File { problem, .. }) if problem.contains("has 3 joints")));
    // which topic is asked of a bag only: of this one it would be passed over
    let topic = format!("{}#/tracker/pose", path.display());
    let told = open(Path::new(&topic), None).unwrap_err().to_string();
    assert!(
        told.contains("rail.mcap: has its measurements on /measurement") && told.ends_with("without '#/tracker/pose'"),
        "{told}"
    );
}

#[test]
fn a_damaged_recording_is_refused_unless_a_part_will_do() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rail.mcap");
    write_recording(&path, &rail(), &Header::for_joints(3)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let last = bytes.windows(7).rposition(|w| w == b"\"seq\":4").unwrap();
    std::fs::write(&path, &bytes[..last]).unwrap();
    let Err(RecordError::Damaged { lost, complete: 3 }) = open(&path, None) else { panic!("not refused") };
    assert!(lost.contains("rail.mcap: the recording is damaged or incomplete"), "{lost}");
    let (part, said) = open_damaged(&path, None).unwrap();
    assert_eq!((part.rows.len(), said), (3, Some(lost)));
}

#[test]
fn what_a_file_holds_decides_not_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let (csv, other) = (dir.path().join("rail.txt"), dir.path().join("rail.dat"));
    std::fs::write(&csv, RAIL).unwrap();
    write_recording(&other, &rail(), &Header::for_joints(3)).unwrap();
    // the number of joints is the file's own
    same(&open(&csv, None).unwrap(), &rail());
    same(&open(&other, None).unwrap(), &rail());
}

#[test]
fn messages_name_the_columns_of_the_table() {
    let says = |header: &str| parse_csv(format!("{header}\n").as_bytes(), "r.csv", 3).unwrap_err().to_string();
    let unknown = says("q1_deg,q2_deg,q3_deg,bal,x_mm,y_mm,z_mm");
    for name in ["'bal'", "place", "tau1_nm ...", "qc1_deg (or qc1_mm) ...", "anchor", "note"] {
        assert!(unknown.contains(name), "{name} in {unknown}");
    }
    assert!(says("q1_deg,q2_deg,q3_deg,tau1_nm,tau2_nm,x_mm,y_mm,z_mm").contains("column tau3_nm is missing"));
    assert!(
        says("q1_deg,q2_deg,q3_deg,qc1_mm,qc2_deg,qc3_deg,d_mm").contains("q1_deg and qc1_mm have different units")
    );
    assert!(says("q1_deg,q2_deg,q3_deg,tau4_nm,d_mm").contains("column tau4_nm found, but the robot has 3 joints"));
    assert!(says("q1_deg,q2_deg,q3_deg,ball").contains("a touch needs ball, ix_mm, iy_mm, iz_mm; ix_mm"));
    assert!(says("q1_deg,q2_deg,q3_deg,qw,qx,qy,qz").contains("x_mm, y_mm, z_mm (tracker)"));
    assert!(
        says("q1_deg,q2_deg,q3_deg,x_mm,y_mm").contains("column z_mm is missing; expected all of x_mm, y_mm, z_mm")
    );
}

#[test]
fn files_with_places_are_not_read_in_passes() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rail.csv");
    std::fs::write(&path, RAIL).unwrap();
    let message = CsvStream::open(std::slice::from_ref(&path), 3).unwrap_err().to_string();
    assert!(message.contains("column place"), "{message}");
}

/// All CSV files below a folder.
fn csv_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut found: Vec<PathBuf> = entries
        .flat_map(|path| if path.is_dir() { csv_files(&path) } else { vec![path] })
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    found.sort();
    found
}

#[test]
fn every_shared_recording_is_read_and_comes_back() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let files = csv_files(&folder);
    if files.is_empty() {
        eprintln!("skipped: ../shared/data is missing");
    }
    let dir = tempfile::tempdir().unwrap();
    for path in files {
        let r = open(&path, None).unwrap_or_else(|e| panic!("{e}"));
        let name = path.display();
        assert!(r.rows.iter().all(|r| !matches!(r.measured, Measured::Distance { .. })), "{name}");
        let text = String::from_utf8(std::fs::read(&path).unwrap()).unwrap();
        let header = text.lines().next().unwrap_or_default();
        assert_eq!(header.contains("place"), !r.places.is_empty(), "{name}");
        assert_eq!(header.contains("tau1_nm"), r.rows.iter().all(|r| r.state.torques.is_some()), "{name}");
        assert_eq!(header.contains("q1_mm"), r.prismatic.unwrap()[0], "{name}");
        let again = parse_csv(&to_csv(&r).unwrap(), "again.csv", r.joints).unwrap();
        same(&again, &r);
        let mcap = dir.path().join("r.mcap");
        write_recording(&mcap, &r, &Header::for_joints(r.joints)).unwrap();
        let back = open(&mcap, Some(r.joints)).unwrap();
        assert_eq!((back.joints, back.prismatic, &back.places), (r.joints, r.prismatic, &r.places), "{name}");
        assert_eq!(back.rows.len(), r.rows.len(), "{name}");
    }
}

#[test]
fn radians_metres_angles_and_matrices_are_read_by_the_names_of_their_columns() {
    let read = |text: &str| parse_csv(text.as_bytes(), "r.csv", 2);
    let usual = read("q1_mm,q2_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz\n1250,30,1,2,3,0.8,0,0.6,0\n").unwrap();
    let angle = 2.0 * 0.6_f64.asin();
    let (s, c) = angle.sin_cos();
    for text in [
        format!("q1_m,q2_rad,x_m,y_m,z_m,qw,qx,qy,qz\n1.25,{},0.001,0.002,0.003,0.8,0,0.6,0\n", 30f64.to_radians()),
        format!("q1_mm,q2_deg,x_m,y_mm,z_mm,roll_rad,pitch_rad,yaw_rad\n1250,30,0.001,2,3,0,{angle},0\n"),
        format!("q1_mm,q2_deg,x_mm,y_mm,z_mm,yaw_deg,roll_deg,pitch_deg\n1250,30,1,2,3,0,0,{}\n", angle.to_degrees()),
        format!(
            "q1_mm,q2_deg,x_mm,y_mm,z_mm,r11,r12,r13,r21,r22,r23,r31,r32,r33\n1250,30,1,2,3,{c},0,{s},0,1,0,-{s},0,{c}\n"
        ),
    ] {
        let r = read(&text).unwrap();
        assert_eq!(r.prismatic.unwrap()[..2], [true, false], "{text}");
        same(&r, &usual);
        let (Measured::Pose { position: a, quaternion: q }, Measured::Pose { position: b, quaternion: p }) =
            (r.rows[0].measured, usual.rows[0].measured)
        else {
            panic!("two poses")
        };
        assert!(a.iter().zip(&b).chain(q.iter().zip(&p)).all(|(a, b)| (a - b).abs() < 1e-12), "{text}: {a:?} {q:?}");
    }
    // all three, as they have to be written
    let r = read("q1_deg,q2_deg,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n1,2,3,4,5,10,20,30\n").unwrap();
    let expected = trical_model::pose::rotation_zyx(30f64.to_radians(), 20f64.to_radians(), 10f64.to_radians());
    let Measured::Pose { quaternion, .. } = r.rows[0].measured else { panic!("a pose") };
    assert!((trical_model::pose::rotation_from_quaternion(quaternion) - expected).norm() < 1e-12);
    let says = |text: &str| read(text).unwrap_err().to_string();
    let both = says("q1_deg,q1_rad,q2_deg,x_mm,y_mm,z_mm\n1,2,3,4,5,6\n");
    assert!(both.contains("columns q1_deg and q1_rad are both there"), "{both}");
    let twice = says("q1_deg,q2_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg\n1,2,3,4,5,1,0,0,0,0,0,0\n");
    assert!(twice.contains("the orientation is there twice"), "{twice}");
    let mirrored =
        says("q1_deg,q2_deg,x_mm,y_mm,z_mm,r11,r12,r13,r21,r22,r23,r31,r32,r33\n1,2,3,4,5,-1,0,0,0,1,0,0,0,1\n");
    assert!(mirrored.contains("line 2, column r11: the nine numbers are no rotation matrix"), "{mirrored}");
}

/// Tracker points in rows that are all different, some of them without a time.
fn points(rows: usize) -> String {
    let mut text = "seq,t_s,temp_c,q1_deg,q2_deg,x_mm,y_mm,z_mm\n".to_owned();
    for k in 0..rows {
        let _ = writeln!(text, "{k},{},20.1,{},{},{k},1.5,-2", 0.5 * k as f64, k % 90, k % 37);
    }
    text
}

#[test]
fn of_a_large_file_a_sample_is_kept_from_all_over_and_every_row_is_counted() {
    let rows = 60_000;
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("points.csv");
    std::fs::write(&path, points(rows)).unwrap();
    let sample = CsvStream::open(std::slice::from_ref(&path), 2).unwrap().sample().unwrap();
    assert_eq!(sample.rows, rows);
    let kept: Vec<usize> = sample.recordings[0].rows.iter().map(|r| r.line).collect();
    assert!((SAMPLE / 2..2 * SAMPLE).contains(&kept.len()), "{} of {SAMPLE}", kept.len());
    assert!(kept[..40].iter().enumerate().all(|(k, line)| *line == k + 2), "{:?}", &kept[..40]);
    // by a hash of the line: each tenth of the file, each last digit, and each remainder by 16 has its share
    let share = |of: &dyn Fn(usize) -> bool| kept.iter().filter(|line| of(**line)).count() as f64 / kept.len() as f64;
    for k in 0..10 {
        assert!((share(&|line| line * 10 / (rows + 2) == k) - 0.1).abs() < 0.02, "tenth {k}");
        assert!((share(&|line| line % 10 == k) - 0.1).abs() < 0.02, "digit {k}");
        assert!((share(&|line| line % 16 == k) - 1.0 / 16.0).abs() < 0.02, "remainder {k}");
    }
    // small files are read in passes where that is wanted, large ones where it is allowed
    let opened = |path: &PathBuf, wanted, allowed| {
        open_large(std::slice::from_ref(path), &robot(&["revolute"; 2]), wanted, allowed).unwrap().is_some()
    };
    assert_eq!([opened(&path, false, true), opened(&path, true, false)], [false, true]);
    let large = dir.path().join("large.csv");
    std::fs::write(&large, points(10) + &"\n".repeat(33 << 20)).unwrap();
    assert_eq!([opened(&large, false, true), opened(&large, false, false)], [true, false]);
}

#[test]
fn behind_empty_lines_a_row_has_its_own_number_in_passes_and_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("points.csv");
    let head = "q1_deg,q2_deg,x_mm,y_mm,z_mm\n1,2,3,4,5\n";
    for (rest, line) in [("\n2,2,3,x,5\n", 4), ("\n\n\"2\",2,3,x,5\n", 5), ("2,2,3,4,5\n\n\n2,2,3\n", 6)] {
        std::fs::write(&path, [head, rest].concat()).unwrap();
        let in_passes =
            CsvStream::open(std::slice::from_ref(&path), 2).and_then(|s| s.sample()).unwrap_err().to_string();
        let at_once = open(&path, Some(2)).unwrap_err().to_string();
        assert!(in_passes.contains(&format!("line {line}")), "{rest:?}: {in_passes}");
        assert_eq!(in_passes, at_once);
    }
}

#[test]
fn times_and_all_digits_of_what_is_not_converted_come_back() {
    let dir = tempfile::tempdir().unwrap();
    let text = "t_s,seq,q1_deg,q2_deg,x_mm,y_mm,z_mm,temp_c\n0.30000000000000004,1,10,20,1,2,3,20.1\n12.5,2,10.1,20,1,2,3,20.2\n";
    let r = parse_csv(text.as_bytes(), "points.csv", 2).unwrap();
    assert_eq!(String::from_utf8(to_csv(&r).unwrap()).unwrap(), text);
    let path = dir.path().join("points.mcap");
    write_recording(&path, &r, &Header::for_joints(2)).unwrap();
    let times: Vec<f64> = open(&path, None).unwrap().rows.iter().map(|r| r.state.t.unwrap()).collect();
    assert!((times[0] - 0.3).abs() < 1e-9 && (times[1] - 12.5).abs() < 1e-9, "{times:?}");
}

#[test]
fn numbers_that_no_cell_has_are_refused() {
    let says = |cells: &str| {
        let text = format!("seq,q1_deg,q2_deg,target,x_mm,y_mm,z_mm\n{cells}\n");
        parse_csv(text.as_bytes(), "points.csv", 2).map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(says("1,10,20,9999,1,2,3"), Ok(()));
    assert!(says("1,10,20,10002,1,2,3").unwrap_err().contains("target"));
    assert!(says("1,100001,20,1,1,2,3").unwrap_err().contains("q1_deg"));
    assert!(says("1,10,20,1,1,1000001,3").unwrap_err().contains("y_mm"));
}

#[test]
fn a_recording_that_is_cut_anywhere_is_not_read_piece_by_piece() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rail.mcap");
    write_recording(&path, &rail(), &Header::for_joints(3)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let rows = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let mut rows = 0;
        each_row(&path, &mut |_| {
            rows += 1;
            Ok(())
        })
        .map(|_| rows)
    };
    assert_eq!(rows(&bytes).unwrap(), 4);
    // the end record and what is behind it may be missing as a whole, or not
    for cut in (8..bytes.len() * 9 / 10).step_by(97) {
        let message = rows(&bytes[..cut]).unwrap_err().to_string();
        assert!(message.contains("rail.mcap: is cut") || message.contains("rail.mcap is cut"), "{cut}: {message}");
    }
}

#[test]
fn visits_go_on_with_their_numbers_where_the_file_ended() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("visits.csv");
    let robot = include_str!("../../trical-model/tests/data/arm.toml");
    let robot = trical_model::Robot::parse(robot, "arm.toml").unwrap();
    let mut q = [0.0; trical_model::MAX_JOINTS];
    q[0] = 0.5;
    let (mut visits, said) = Visits::open(&path, &robot).unwrap();
    assert_eq!(
        (said, visits.push(&q, "left", 1).unwrap(), visits.push(&q, "left", 2).unwrap()),
        (None, (0, None), (1, None))
    );
    drop(visits);
    // somebody took out the first row, and the last one was not written whole
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines.remove(1);
    std::fs::write(&path, lines.join("\n")).unwrap();
    let (mut visits, said) = Visits::open(&path, &robot).unwrap();
    assert!(said.unwrap().contains("line 2 did not end"));
    assert_eq!(visits.push(&q, "right", 1).unwrap().0, 2);
    drop(visits);
    let read = open(&path, Some(6)).unwrap();
    assert_eq!(read.places, ["left", "right"]);
    assert_eq!(read.rows.iter().map(|r| r.seq).collect::<Vec<_>>(), [Some(1), Some(2)]);
    assert!((read.rows[1].state.q[0] - 0.5).abs() < 1e-12);
    // Windows lets nobody do that
    #[cfg(unix)]
    what_is_removed_or_emptied_under_way_is_written_again(dir.path(), &path, &robot, &q);
    #[cfg(windows)]
    {
        let (mut visits, _) = Visits::open(&path, &robot).unwrap();
        std::fs::remove_file(&path).unwrap_err();
        std::fs::write(&path, "").unwrap_err();
        assert!(Visits::open(&path, &robot).unwrap_err().to_string().contains("another program"));
        assert_eq!(visits.push(&q, "right", 1).unwrap(), (3, None));
    }
    std::fs::write(&path, "seq,q1_deg\n").unwrap();
    assert!(Visits::open(&path, &robot).unwrap_err().to_string().contains("this is another file"));
}

#[cfg(unix)]
fn what_is_removed_or_emptied_under_way_is_written_again(
    dir: &Path,
    path: &Path,
    robot: &trical_model::Robot,
    q: &trical_model::Joints,
) {
    let before = std::fs::read_to_string(path).unwrap();
    let (mut visits, _) = Visits::open(path, robot).unwrap();
    for k in 0..2 {
        if k == 0 {
            std::fs::remove_file(path).unwrap()
        } else {
            std::fs::write(path, "").unwrap()
        }
        let (seq, said) = visits.push(q, "right", 1).unwrap();
        assert_eq!(seq, 3 + k);
        assert!(said.unwrap().contains("was removed or emptied"));
        assert!(std::fs::read_to_string(path).unwrap().starts_with(&before));
    }
    assert_eq!(open(path, Some(6)).unwrap().rows.len(), 4);
    // where that cannot be done, as on a full disk, it is done later: nothing is lost
    std::fs::remove_dir_all(dir).unwrap();
    assert!(visits.push(q, "right", 1).is_err() && visits.look_for_file().is_err());
    std::fs::create_dir(dir).unwrap();
    assert!(visits.look_for_file().unwrap().unwrap().contains("was removed or emptied"));
    assert_eq!(visits.push(q, "right", 1).unwrap(), (5, None));
    assert_eq!(open(path, Some(6)).unwrap().rows.len(), 5);
}

#[test]
fn rows_that_go_back_in_time_are_refused_and_rows_of_one_time_are_not() {
    let read = |times: [f64; 3]| {
        let rows: String = times.iter().map(|t| format!("{t},10,1,2,3\n")).collect();
        parse_csv(format!("t_s,q1_deg,x_mm,y_mm,z_mm\n{rows}").as_bytes(), "r.csv", 1)
    };
    assert_eq!(read([0.0, 2.5, 2.5]).unwrap().rows.len(), 3);
    let error = read([0.0, 2.5, 2.0]).unwrap_err().to_string();
    assert!(error.contains("line 4, column t_s: found 2 after 2.5; expected rows in the order of time"), "{error}");
}

#[test]
fn files_of_other_kinds_are_told_by_how_they_begin() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.csv");
    for (begin, told) in [
        (&b"PK\x03\x04"[..], "another ZIP file"),
        (b"\xd0\xcf\x11\xe0", "is a spreadsheet, expected"),
        (b"\x1f\x8b\x08\x00", "is compressed"),
        (b"\x28\xb5\x2f\xfd", "is compressed"),
        (b"%PDF", "is a PDF"),
    ] {
        std::fs::write(&path, [begin, b" and more"].concat()).unwrap();
        let error = open(&path, None).unwrap_err().to_string();
        assert!(error.contains("run.csv") && error.contains(told), "{told}: {error}");
    }
}

/// Senses of motion come from the joint states between, where a measurement does not say them itself.
#[test]
fn joint_states_of_a_recording_say_from_which_side_a_joint_came() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let mut row = rail().rows[0];
    row.state.dir = None;
    let mut writer = RecordingWriter::create(&path, &Header::for_joints(3)).unwrap();
    for (k, q2) in [0.1, 0.3, 0.2].into_iter().enumerate() {
        let t = k as f64;
        row.state.q[1] = q2;
        writer.joint_state(&JointSample { t, q: row.state.q }).unwrap();
        row.state.t = Some(t);
        writer.measurement(&row).unwrap();
    }
    assert_eq!(writer.last_t(), 2.0);
    writer.finish().unwrap();
    let rows = open(&path, None).unwrap().rows;
    let senses: Vec<i8> = rows.iter().map(|r| r.state.dir.unwrap()[1]).collect();
    assert_eq!(senses, [0, 1, -1]);
}

fn with_files(path: &Path, robot: &[u8]) -> Header {
    let file = |name: &str, data: &[u8]| Attachment {
        name: name.into(),
        media_type: "application/toml".into(),
        data: data.into(),
    };
    let header =
        Header { attachments: vec![file("robot.toml", robot), file("empty.toml", b"")], ..Header::for_joints(3) };
    if !path.exists() {
        let mut writer = RecordingWriter::create(path, &header).unwrap();
        let q = rail().rows[0].state.q;
        writer.joint_state(&JointSample { t: 12.345_678_901, q }).unwrap();
        writer.measurement(&Row { state: State { t: Some(13.0), ..rail().rows[0].state }, ..rail().rows[0] }).unwrap();
        writer.finish().unwrap();
    }
    header
}

#[test]
fn files_beside_the_measurements_are_passed_over_and_have_to_be_the_same_where_it_is_gone_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let header = with_files(&path, b"name = \"a\"");
    let mut rows = 0;
    each_row(&path, &mut |_| {
        rows += 1;
        Ok::<_, RecordError>(())
    })
    .unwrap();
    assert_eq!(rows, 1);
    let read = check_same(&path, &header).unwrap();
    assert_eq!(read.attachments.iter().map(|a| a.data.len()).collect::<Vec<_>>(), [10, 0]);
    let told = read.joint_states[0].t;
    assert!((told - 12.345_678_901).abs() < 1e-9, "{told}");
    // as others read the message: seconds and nanoseconds, little-endian
    let stamp = [12_u32, 345_678_901].map(u32::to_le_bytes).concat();
    assert!(std::fs::read(&path).unwrap().windows(8).any(|bytes| bytes == stamp));
    let e = check_same(&path, &with_files(&path, b"name = \"b\"")).unwrap_err().to_string();
    assert!(e.contains("was recorded with another robot.toml"), "{e}");
}
