//! What a recording says comes back from CSV and from MCAP.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::path::{Path, PathBuf};

use trical_model::{Measured, Recording};
use trical_recording::mcap::Header;
use trical_recording::{CsvStream, RecordError, open, open_damaged, parse_csv, to_csv, write_recording};

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
    assert_eq!(r.prismatic[..3], [true, false, false]);
    assert!((r.rows[0].state.q[0] - 1.2505).abs() < 1e-15 && (r.rows[0].state.q[1] - 10f64.to_radians()).abs() < 1e-15);
    assert!((r.rows[0].state.q_commanded.unwrap()[0] - 1.25025).abs() < 1e-15);
    assert_eq!(r.rows[0].state.torques.unwrap()[..3], [12.5, -3.25, 0.0]);
    assert!(r.rows[1].state.torques.is_none() && r.rows[2].state.q_commanded.is_none());
    assert_eq!(String::from_utf8(to_csv(&r).unwrap()).unwrap(), RAIL);
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
    assert!(lost.contains("rail.mcap: the recording is not whole"), "{lost}");
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
        assert_eq!(header.contains("q1_mm"), r.prismatic[0], "{name}");
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
        assert_eq!(r.prismatic[..2], [true, false], "{text}");
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
