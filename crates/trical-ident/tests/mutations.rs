//! Valid recordings, model files and files of what is known, with a few characters changed: no panic, and whatever is taken is
//! finite and is read back as it was written.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::cast_precision_loss)]

#[path = "../../trical-model/tests/common/mutants.rs"]
mod common;

use common::mutants;
use trical_ident::{KnownParameters, ModelFile, parse_csv, write_csv};
use trical_model::{Forward, Measured, Recording, Row, State};

const ROBOT: &str = include_str!("../../trical-model/tests/data/arm.toml");
const CELL: &str = include_str!("../../trical-model/tests/data/cell.toml");

const TOUCHES: &str = "t_s,seq,q1_deg,q2_deg,qc1_deg,qc2_deg,dir1,dir2,ball,ix_mm,iy_mm,iz_mm,temp_c,payload_kg\n\
                       0,1,10,20.5,10,20.5,-1,1,1,0.001,-0.002,0.003,21.5,0\n2.5,2,-10,2e1,-10,20,0,1,3,0,0,0,22,1.5\n";
const POINTS: &str =
    "q1_deg,q2_mm,target,reference,x_mm,y_mm,z_mm\n1,2,1,,100.5,200,-300\n1,2,,3,1,2,3\n3,4,2,,5,6,7\n";
const OTHERS: &str =
    "q1_deg,q2_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,anchor,d_mm\n1,2,100,200,300,1,0,0,0,,\n3,4,,,,,,,,1,812.5\n";

/// All numbers of a row.
fn numbers(r: &Row) -> Vec<f64> {
    let State { q, q_commanded, t, temp_c, payload_kg, .. } = r.state;
    let mut out: Vec<f64> = q.to_vec();
    out.extend(q_commanded.iter().flatten().chain(t.iter()).chain(temp_c.iter()).chain(payload_kg.iter()));
    match r.measured {
        Measured::Touch { ball, reading: v } => out.extend([v[0], v[1], v[2], ball as f64]),
        Measured::Point { target: k, position: v } | Measured::Reference { reference: k, position: v } => {
            out.extend([v[0], v[1], v[2], k as f64]);
        }
        Measured::Distance { anchor, length } => out.extend([length, anchor as f64]),
        Measured::Pose { position, quaternion } => out.extend(position.iter().chain(&quaternion)),
    }
    out
}

fn text(recording: &Recording) -> String {
    let mut out = Vec::new();
    write_csv(recording, &mut out).unwrap();
    String::from_utf8(out).unwrap()
}

#[test]
fn recordings() {
    mutants(&[TOUCHES, POINTS, OTHERS], |csv| {
        let Ok(r) = parse_csv(csv.as_bytes(), "a.csv", 2) else { return false };
        assert!(r.rows.iter().flat_map(numbers).all(|x| x.is_finite() && x.abs() < 1e9), "{csv}");
        let written = text(&r);
        let again = parse_csv(written.as_bytes(), "b.csv", 2).unwrap_or_else(|e| panic!("{e}\n{csv}\n{written}"));
        assert_eq!(again.rows.len(), r.rows.len());
        for (a, b) in again.rows.iter().zip(&r.rows) {
            assert_eq!((a.seq, a.state.dir, numbers(a).len()), (b.seq, b.state.dir, numbers(b).len()), "{csv}");
            for (a, b) in numbers(a).iter().zip(numbers(b)) {
                assert!((a - b).abs() <= 8.0 * f64::EPSILON * b.abs() + 1e-300, "{a} {b}\n{csv}\n{written}");
            }
        }
        true
    });
}

#[test]
fn model_files() {
    let term = |rest: &str| format!("[[term]]\neffect = \"e\"\nvalue = 0.5\nsd = 0.01\n{rest}\n");
    let head = format!(
        "format_version = 1\nprogram = \"trical\"\njoints = \"read\"\nrecordings = [\"a\"]\n[robot]\n{}\n[cell]\n{}\n\
         [[frame]]\nxyz_mm = [1, 2, 3]\nquaternion_wxyz = [1, 0, 0, 0]\nreferences_mm = [[1, 2, 3]]\n",
        ROBOT.replace("[[joint]]", "[[robot.joint]]"),
        CELL.replace("\n[", "\n[cell.").replace("[base]", "[cell.base]"),
    );
    let terms = [
        "name = \"a\"\nunit = \"deg\"\nsite = { joint = { joint = 2 } }",
        "name = \"b\"\nunit = \"deg\"\nsite = { joint = { joint = 2 } }\n\
         basis = { of = { joint = { joint = 3 } }, shape = { sine = { cycles = 2.0 } } }",
        "name = \"c\"\nunit = \"deg\"\nsite = { joint = { joint = 1 } }\n\
         basis = { of = { joint = { joint = 2 } }, shape = { tent = { left = -0.5, centre = 0.0, right = 1.0 } }, sense = 2 }",
    ];
    let seeds: Vec<String> = terms.iter().map(|t| head.clone() + &term(t)).collect();
    for s in &seeds {
        ModelFile::parse(s, "m.toml").unwrap_or_else(|e| panic!("{e}\n{s}"));
    }
    mutants(&seeds.iter().map(String::as_str).collect::<Vec<_>>(), |toml| {
        let Ok(m) = ModelFile::parse(toml, "m.toml") else { return false };
        for t in &m.model.terms {
            assert!(t.value.is_finite() && t.sd.is_none_or(|s| s.is_finite() && s >= 0.0), "{toml}");
        }
        let written = m.to_toml().unwrap();
        let again = ModelFile::parse(&written, "w.toml").unwrap_or_else(|e| panic!("{e}\n{toml}\n{written}"));
        assert_eq!(again.model.terms.len(), m.model.terms.len());
        for (a, b) in again.model.terms.iter().zip(&m.model.terms) {
            assert!(a.name == b.name && a.site == b.site && a.basis == b.basis, "{toml}");
            assert!((a.value - b.value).abs() <= 4.0 * f64::EPSILON * b.value.abs(), "{toml}");
        }
        if let Ok(forward) = Forward::new(m.model.clone(), Vec::new()) {
            let mut state = State::at(&[0.3; 6]);
            state.dir = Some([1; 9]);
            let pose = forward.world_from_tool(&state, &mut forward.workspace());
            assert!(pose.translation.iter().chain(pose.rotation.iter()).all(|x| x.is_finite()), "{toml}");
        }
        true
    });
}

#[test]
fn what_is_known() {
    let seed = "[[parameter]]\nname = \"a_2\"\nvalue = 270.0\nsd = 0.5\n[[parameter]]\nname = \"d_4\"\nmin = -1.0\nmax = 2.5\n";
    mutants(&[seed], |toml| {
        let Ok(known) = KnownParameters::parse(toml, "k.toml") else { return false };
        let all = format!("{known:?}");
        assert!(!all.contains("NaN") && !all.contains(": Some(inf") && !all.contains("Some(-inf"), "{all}\n{toml}");
        true
    });
}
