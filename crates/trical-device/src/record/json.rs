//! Rows of a recording as JSON objects with the columns of the CSV format: mm and degrees, counted from 1.

use std::fmt::Write as _;

use serde_json::{Map, Value};
use trical_model::recording::{Joints, MAX_JOINTS, Measured, Row, State};

/// A row as JSON; `joints` of each joint vector are written.
#[must_use]
pub fn row_to_json(row: &Row, joints: usize) -> String {
    let mut out = Object::new();
    let state = &row.state;
    out.number_if("t_s", state.t);
    out.joints("q", &state.q, joints);
    if let Some(q) = &state.q_commanded {
        out.joints("qc", q, joints);
    }
    if let Some(dir) = &state.dir {
        for (joint, dir) in dir.iter().take(joints).enumerate() {
            out.integer(&format!("dir{}", joint + 1), i64::from(*dir));
        }
    }
    out.number_if("temp_c", state.temp_c);
    out.number_if("payload_kg", state.payload_kg);
    match &row.measured {
        Measured::Touch { ball, reading } => {
            out.integer("ball", *ball as i64 + 1);
            out.millimetres(["ix_mm", "iy_mm", "iz_mm"], reading);
        }
        Measured::Point { target, position } => {
            out.integer("target", *target as i64 + 1);
            out.millimetres(["x_mm", "y_mm", "z_mm"], position);
        }
        Measured::Reference { reference, position } => {
            out.integer("reference", *reference as i64 + 1);
            out.millimetres(["x_mm", "y_mm", "z_mm"], position);
        }
        Measured::Distance { anchor, length } => {
            out.integer("anchor", *anchor as i64 + 1);
            out.number("d_mm", length * 1e3);
        }
        Measured::Pose { position, quaternion } => {
            out.millimetres(["x_mm", "y_mm", "z_mm"], position);
            for (name, value) in ["qw", "qx", "qy", "qz"].into_iter().zip(quaternion) {
                out.exactly(name, *value);
            }
        }
    }
    if let Some(seq) = row.seq {
        out.integer("seq", seq as i64);
    }
    out.end()
}

/// A reading of the gauge (m) as JSON.
#[must_use]
pub fn indicators_to_json(t: f64, reading: &[f64; 3], settled: bool) -> String {
    let mut out = Object::new();
    out.number("t_s", t);
    out.millimetres(["ix_mm", "iy_mm", "iz_mm"], reading);
    out.key("settled");
    out.0.push_str(if settled { "true" } else { "false" });
    out.end()
}

/// A temperature (degC) as JSON.
#[must_use]
pub fn temperature_to_json(t: f64, temp_c: f64) -> String {
    let mut out = Object::new();
    out.number("t_s", t);
    out.number("temp_c", temp_c);
    out.end()
}

/// Reads a row and its number of joints.
///
/// # Errors
/// One sentence: no JSON, an unknown or missing key, a wrong value.
pub fn row_from_json(text: &[u8]) -> Result<(Row, usize), String> {
    let value: Value = serde_json::from_slice(text).map_err(|error| format!("no JSON ({error})"))?;
    let Value::Object(map) = value else {
        return Err("no JSON object".to_owned());
    };
    let mut fields = Fields(map);

    let (q, joints) = fields.joints("q")?;
    if joints == 0 {
        return Err("no key \"q1_deg\"; every measurement needs its joint angles".to_owned());
    }
    let (q_commanded, commanded) = fields.joints("qc")?;
    if commanded != 0 && commanded != joints {
        return Err(format!("{commanded} keys qc1_deg...; expected {joints}, one for each joint"));
    }
    let dir = fields.directions(joints)?;
    let state = State {
        q,
        q_commanded: (commanded > 0).then_some(q_commanded),
        dir,
        t: fields.number("t_s")?,
        seq: None,
        temp_c: fields.number("temp_c")?,
        payload_kg: fields.number("payload_kg")?,
        session: None,
    };
    let seq = fields.integer("seq")?;
    let measured = fields.measured()?;
    if let Some(key) = fields.0.keys().next() {
        return Err(format!("unknown key {key:?}"));
    }
    Ok((Row { state, measured, seq, line: 0 }, joints))
}

/// No cell has more balls, targets, references or anchors.
const MOST: u64 = 10_000;

/// The largest value of a key: no joint turns further than 278 times, and no instrument looks further than a kilometre.
fn largest(key: &str) -> f64 {
    if key.ends_with("_deg") {
        1e5
    } else if key.ends_with("_mm") {
        1e6
    } else {
        1e9
    }
}

struct Fields(Map<String, Value>);

impl Fields {
    fn number(&mut self, key: &str) -> Result<Option<f64>, String> {
        match self.0.remove(key) {
            None => Ok(None),
            Some(value) => {
                let limit = largest(key);
                value
                    .as_f64()
                    .filter(|v| v.abs() <= limit)
                    .map(Some)
                    .ok_or_else(|| format!("key {key:?} is {value}; expected a number between -{limit} and {limit}"))
            }
        }
    }

    fn integer(&mut self, key: &str) -> Result<Option<u64>, String> {
        match self.0.remove(key) {
            None => Ok(None),
            Some(value) => {
                value.as_u64().map(Some).ok_or_else(|| format!("key {key:?} is {value}; expected a whole number"))
            }
        }
    }

    /// A 1-based number as a 0-based index.
    fn index(&mut self, key: &str) -> Result<Option<usize>, String> {
        match self.integer(key)? {
            None => Ok(None),
            Some(0) => Err(format!("key {key:?} is 0; expected 1 or more")),
            Some(number) if number > MOST => Err(format!("key {key:?} is {number}; expected {MOST} at most")),
            Some(number) => Ok(Some((number - 1) as usize)),
        }
    }

    fn joints(&mut self, stem: &str) -> Result<(Joints, usize), String> {
        let mut q = [0.0; MAX_JOINTS];
        let mut count = 0;
        for (joint, q) in q.iter_mut().enumerate() {
            let Some(degrees) = self.number(&format!("{stem}{}_deg", joint + 1))? else {
                break;
            };
            *q = degrees.to_radians();
            count += 1;
        }
        Ok((q, count))
    }

    fn directions(&mut self, joints: usize) -> Result<Option<[i8; MAX_JOINTS]>, String> {
        let mut dir = [0; MAX_JOINTS];
        let mut count = 0;
        for (joint, dir) in dir.iter_mut().take(joints).enumerate() {
            let key = format!("dir{}", joint + 1);
            let Some(value) = self.0.remove(&key) else {
                continue;
            };
            *dir = match value.as_i64() {
                Some(-1) => -1,
                Some(0) => 0,
                Some(1) => 1,
                _ => return Err(format!("key {key:?} is {value}; expected -1, 0 or 1")),
            };
            count += 1;
        }
        match count {
            0 => Ok(None),
            count if count == joints => Ok(Some(dir)),
            count => Err(format!("{count} keys dir1...; expected {joints}, one for each joint")),
        }
    }

    fn three(&mut self, keys: [&str; 3], scale: f64) -> Result<Option<[f64; 3]>, String> {
        let mut values = [0.0; 3];
        let mut missing = None;
        let mut found = None;
        for (key, to) in keys.into_iter().zip(&mut values) {
            match self.number(key)? {
                Some(value) => {
                    *to = value * scale;
                    found = Some(key);
                }
                None => missing = Some(key),
            }
        }
        match (found, missing) {
            (None, _) => Ok(None),
            (Some(_), None) => Ok(Some(values)),
            (Some(found), Some(missing)) => Err(format!("key {found:?} without {missing:?}")),
        }
    }

    fn measured(&mut self) -> Result<Measured, String> {
        let ball = self.index("ball")?;
        let reading = self.three(["ix_mm", "iy_mm", "iz_mm"], 1e-3)?;
        let target = self.index("target")?;
        let reference = self.index("reference")?;
        let anchor = self.index("anchor")?;
        let length = self.number("d_mm")?;
        let position = self.three(["x_mm", "y_mm", "z_mm"], 1e-3)?;
        let vector = self.three(["qx", "qy", "qz"], 1.0)?;
        let scalar = self.number("qw")?;
        match (ball, reading, length, position, scalar, vector) {
            (Some(ball), Some(reading), None, None, None, None) => Ok(Measured::Touch { ball, reading }),
            (None, None, Some(d), None, None, None) if d <= 0.0 => {
                Err(format!("key \"d_mm\" is {d}; expected a positive length"))
            }
            (None, None, Some(d), None, None, None) => {
                Ok(Measured::Distance { anchor: anchor.unwrap_or(0), length: d * 1e-3 })
            }
            (None, None, None, Some(position), Some(w), Some([x, y, z])) => {
                let length = (w * w + x * x + y * y + z * z).sqrt();
                if (length - 1.0).abs() > 1e-2 {
                    return Err(format!("the quaternion qw qx qy qz has length {length:.4}; expected 1"));
                }
                Ok(Measured::Pose { position, quaternion: [w, x, y, z] })
            }
            (None, None, None, Some(position), None, None) => match (target, reference) {
                (Some(_), Some(_)) => Err("both \"target\" and \"reference\"; expected one of them".to_owned()),
                (None, Some(reference)) => Ok(Measured::Reference { reference, position }),
                (target, None) => Ok(Measured::Point { target: target.unwrap_or(0), position }),
            },
            _ => Err("expected one kind of measurement: ball and ix_mm iy_mm iz_mm, or x_mm y_mm z_mm (with qw qx qy \
                      qz), or d_mm"
                .to_owned()),
        }
    }
}

/// Writes a JSON object key by key, in the order that people know from the CSV.
struct Object(String);

impl Object {
    fn new() -> Self {
        Self("{".to_owned())
    }

    fn key(&mut self, key: &str) {
        let comma = if self.0.len() > 1 { "," } else { "" };
        let _ = write!(self.0, "{comma}\"{key}\":");
    }

    /// A finite number as it is; others cannot stand in JSON and leave the key out, which the reader then misses.
    fn exactly(&mut self, key: &str, value: f64) {
        if value.is_finite() {
            self.key(key);
            let _ = write!(self.0, "{value:?}");
        }
    }

    /// A number to ten decimals: what a conversion to mm or degrees adds behind them is no information.
    fn number(&mut self, key: &str, value: f64) {
        let rounded = (value * 1e10).round() / 1e10;
        self.exactly(key, if rounded == 0.0 { 0.0 } else { rounded });
    }

    fn number_if(&mut self, key: &str, value: Option<f64>) {
        if let Some(value) = value {
            self.number(key, value);
        }
    }

    fn integer(&mut self, key: &str, value: i64) {
        self.key(key);
        let _ = write!(self.0, "{value}");
    }

    fn joints(&mut self, stem: &str, q: &Joints, joints: usize) {
        for (joint, q) in q.iter().take(joints).enumerate() {
            self.number(&format!("{stem}{}_deg", joint + 1), q.to_degrees());
        }
    }

    fn millimetres(&mut self, keys: [&str; 3], values: &[f64; 3]) {
        for (key, value) in keys.into_iter().zip(values) {
            self.number(key, value * 1e3);
        }
    }

    fn end(mut self) -> String {
        self.0.push('}');
        self.0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn touch() -> Row {
        let mut state = State::at(&[10.0, -20.5, 30.12345, 0.0, 1e-5, -90.0].map(f64::to_radians));
        state.t = Some(12.5);
        state.dir = Some([1, -1, 0, 1, -1, 1, 0, 0, 0]);
        state.temp_c = Some(21.5);
        Row { state, measured: Measured::Touch { ball: 2, reading: [0.001e-3, -0.012e-3, 0.0] }, seq: Some(7), line: 0 }
    }

    #[test]
    fn a_touch_has_the_columns_of_the_csv() {
        assert_eq!(
            row_to_json(&touch(), 6),
            "{\"t_s\":12.5,\"q1_deg\":10.0,\"q2_deg\":-20.5,\"q3_deg\":30.12345,\"q4_deg\":0.0,\"q5_deg\":1e-5,\
             \"q6_deg\":-90.0,\"dir1\":1,\"dir2\":-1,\"dir3\":0,\"dir4\":1,\"dir5\":-1,\"dir6\":1,\"temp_c\":21.5,\
             \"ball\":3,\"ix_mm\":0.001,\"iy_mm\":-0.012,\"iz_mm\":0.0,\"seq\":7}"
        );
    }

    #[test]
    fn every_kind_of_measurement_comes_back() {
        let kinds = [
            touch().measured,
            Measured::Point { target: 1, position: [0.1, 0.2, 0.3] },
            Measured::Reference { reference: 0, position: [0.1, 0.2, 0.3] },
            Measured::Distance { anchor: 2, length: 0.5 },
            Measured::Pose { position: [0.1, 0.2, 0.3], quaternion: [1.0, 0.0, 0.0, 0.0] },
        ];
        for measured in kinds {
            let mut row = Row { measured, ..touch() };
            row.state.q_commanded = Some(row.state.q);
            row.state.payload_kg = Some(1.5);
            let text = row_to_json(&row, 6);
            let (back, joints) = row_from_json(text.as_bytes()).unwrap();
            assert_eq!(joints, 6);
            assert_eq!(row_to_json(&back, 6), text);
            assert_eq!(back.seq, row.seq);
            assert_eq!(std::mem::discriminant(&back.measured), std::mem::discriminant(&row.measured));
        }
    }

    #[test]
    fn errors_name_the_key() {
        let says = |text: &str| row_from_json(text.as_bytes()).unwrap_err();
        assert!(says("{\"q1_deg\":1,\"bal\":1,\"ball\":1,\"ix_mm\":0,\"iy_mm\":0,\"iz_mm\":0}").contains("\"bal\""));
        assert!(says("{\"ball\":1}").contains("q1_deg"));
        assert!(says("{\"q1_deg\":\"a\"}").contains("\"q1_deg\""));
        assert!(says("{\"q1_deg\":1,\"ball\":0,\"ix_mm\":0,\"iy_mm\":0,\"iz_mm\":0}").contains("1 or more"));
        assert!(says("{\"q1_deg\":1,\"ball\":1,\"ix_mm\":0,\"iy_mm\":0}").contains("without \"iz_mm\""));
        assert!(says("{\"q1_deg\":1,\"dir1\":2}").contains("-1, 0 or 1"));
        assert!(says("{\"q1_deg\":1}").contains("one kind"));
        assert!(says("[]").contains("object"));
        assert!(says("nonsense").contains("no JSON"));
    }

    proptest::proptest! {
        #[test]
        fn random_text_never_panics(text in "\\{(\"[a-z0-9_]{1,6}\":[0-9.\\-]{1,4},?){0,6}\\}") {
            let _ = row_from_json(text.as_bytes());
        }
    }
}
