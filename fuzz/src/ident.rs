//! Recordings, model files, what is known beforehand.

use trical_ident::{KnownParameters, ModelFile};
use trical_model::{Forward, Measured, Recording, Row, State};
use trical_recording::{parse_csv, write_csv};

/// All numbers of a row.
fn numbers(r: &Row) -> Vec<f64> {
    let State { q, q_commanded, t, temp_c, payload_kg, torques, .. } = r.state;
    let mut out: Vec<f64> = q.to_vec();
    out.extend(
        q_commanded.iter().chain(&torques).flatten().chain(t.iter()).chain(temp_c.iter()).chain(payload_kg.iter()),
    );
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

/// A CSV recording, of an arm with two joints or with six: what is taken is finite, and read back as it was written.
pub fn recording(data: &[u8]) -> bool {
    let of = |joints: usize| {
        let Ok(r) = parse_csv(data, "a.csv", joints) else { return false };
        let csv = String::from_utf8_lossy(data);
        assert!(r.rows.iter().flat_map(numbers).all(|x| x.is_finite() && x.abs() <= 1e9), "{csv}");
        let written = text(&r);
        let again = parse_csv(written.as_bytes(), "b.csv", joints).unwrap_or_else(|e| panic!("{e}\n{csv}\n{written}"));
        assert_eq!((again.rows.len(), &again.places), (r.rows.len(), &r.places), "{csv}");
        for (a, b) in again.rows.iter().zip(&r.rows) {
            assert_eq!((a.seq, a.state.dir, numbers(a).len()), (b.seq, b.state.dir, numbers(b).len()), "{csv}");
            for (a, b) in numbers(a).iter().zip(numbers(b)) {
                assert!((a - b).abs() <= 8.0 * f64::EPSILON * b.abs() + 1e-300, "{a} {b}\n{csv}\n{written}");
            }
        }
        true
    };
    of(2) | of(6)
}

/// A model file: read back as it was written, and its arm stands somewhere.
pub fn model(data: &[u8]) -> bool {
    let Ok(toml) = std::str::from_utf8(data) else { return false };
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
}

/// A file of what is known beforehand.
pub fn known(data: &[u8]) -> bool {
    let Ok(toml) = std::str::from_utf8(data) else { return false };
    let Ok(known) = KnownParameters::parse(toml, "k.toml") else { return false };
    let all = format!("{known:?}");
    assert!(!all.contains("NaN") && !all.contains(": Some(inf") && !all.contains("Some(-inf"), "{all}\n{toml}");
    true
}
