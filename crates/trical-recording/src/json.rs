//! Rows of a recording as JSON objects with the columns of the CSV ([`crate::columns`]): the messages of an MCAP recording.

use std::fmt::Write as _;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde_json::Value as Json;
use trical_model::recording::{Joints, MAX_JOINTS, Measured, Row, State};

use crate::columns::{COLUMNS, FIELDS, Field, Kind, Names, Unit, Value, column, find, value};
use crate::shared::{Places, Shared};

/// A row as JSON, with what it has.
#[must_use]
pub fn row_to_json(row: &Row, shared: &Shared) -> String {
    let mut out = Object::new();
    for c in &COLUMNS {
        for k in 0..c.width(shared.joints) {
            let Some(found) = value(row, c.field, k) else { break };
            let unit = c.unit(k, &shared.prismatic);
            match (c.names, found) {
                (Names::Fixed(names), found) => {
                    out.value(names.get(k).copied().unwrap_or_default(), unit, found, shared)
                }
                (Names::EachJoint(_), found) => out.value(&c.name(k, unit), unit, found, shared),
            }
        }
    }
    out.end()
}

/// A reading of the gauge (m) as JSON.
#[must_use]
pub fn indicators_to_json(t: f64, reading: &[f64; 3], settled: bool) -> String {
    let mut out = Object::new();
    out.numbers(Field::Time, &[t]);
    out.numbers(Field::Indicators, reading);
    out.key("settled");
    out.0.push_str(if settled { "true" } else { "false" });
    out.end()
}

/// A temperature (degC) as JSON.
#[must_use]
pub fn temperature_to_json(t: f64, temp_c: f64) -> String {
    let mut out = Object::new();
    out.numbers(Field::Time, &[t]);
    out.numbers(Field::Temperature, &[temp_c]);
    out.end()
}

/// A row that was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowRead {
    /// The row; its place is an index into the places that were given.
    pub row: Row,
    /// Number of the arm's joints.
    pub joints: usize,
    /// Which of them slide, joint 1 first.
    pub prismatic: [bool; MAX_JOINTS],
}

/// Reads a row; `places` are those of the recording so far.
///
/// # Errors
/// One sentence: no JSON, an unknown or missing key, a wrong value.
pub fn row_from_json(text: &[u8], places: &mut Places) -> Result<RowRead, String> {
    Fields::default().row(text, places)
}

/// All values, or none.
fn of_each_joint(first: &str, values: Joints, count: usize, joints: usize) -> Result<Option<Joints>, String> {
    match count {
        0 => Ok(None),
        count if count == joints => Ok(Some(values)),
        count => Err(format!("{count} keys {first}...; expected {joints}, one for each joint")),
    }
}

/// The fields of messages, one message after the other. Those of a recording have the same keys in the same order, so that each key is looked
/// up once.
#[derive(Default)]
pub(crate) struct Fields {
    /// Those of columns.
    keys: Vec<String>,
    /// Which key is that of a column's component in each of its units, counted from 1; 0 for none.
    of_column: [[[usize; 2]; MAX_JOINTS]; FIELDS],
    /// Of each key, until it is taken.
    values: Vec<Option<Json>>,
    /// The first key of the message, by its letters, that is none of a column's.
    unknown: Option<String>,
}

impl<'de> DeserializeSeed<'de> for &mut Fields {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for &mut Fields {
    type Value = ();

    fn expecting(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        self.values.clear();
        self.unknown = None;
        while let Some(k) = map.next_key_seed(Key(self))? {
            let value = Some(map.next_value()?);
            match k.map(|k| self.values.get_mut(k)) {
                // of a key that comes twice the last value counts
                Some(Some(before)) => *before = value,
                Some(None) => self.values.push(value),
                None => {}
            }
        }
        Ok(())
    }
}

/// The next key of a message: which one it is.
struct Key<'a>(&'a mut Fields);

impl<'de> DeserializeSeed<'de> for Key<'_> {
    type Value = Option<usize>;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<Option<usize>, D::Error> {
        from.deserialize_str(self)
    }
}

impl Visitor<'_> for Key<'_> {
    type Value = Option<usize>;

    fn expecting(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("a key")
    }

    fn visit_str<E: Error>(self, key: &str) -> Result<Option<usize>, E> {
        Ok(self.0.next(key))
    }
}

impl Fields {
    /// Which key this is, behind those that have values; `None` where it is unknown.
    fn next(&mut self, key: &str) -> Option<usize> {
        let k = self.values.len();
        if self.keys.get(k).is_some_and(|before| before == key) {
            return Some(k);
        }
        let found = find(key).and_then(|(c, j, unit)| Some((c.field, j, c.units.iter().position(|u| *u == unit)?)));
        let Some((field, j, which)) = found else {
            if self.unknown.as_ref().is_none_or(|before| key < before.as_str()) {
                self.unknown = Some(key.to_owned());
            }
            return None;
        };
        let at = self.of_column[field as usize][j][which];
        if (1..=k).contains(&at) {
            return Some(at - 1);
        }
        // another message than the one before
        self.keys.truncate(k);
        self.keys.push(key.to_owned());
        self.of_column.as_flattened_mut().as_flattened_mut().iter_mut().filter(|at| **at > k).for_each(|at| *at = 0);
        self.of_column[field as usize][j][which] = k + 1;
        Some(k)
    }

    /// Reads a row; `places` are those of the recording so far.
    ///
    /// # Errors
    /// As [`row_from_json`].
    pub(crate) fn row(&mut self, text: &[u8], places: &mut Places) -> Result<RowRead, String> {
        let mut from = serde_json::Deserializer::from_slice(text);
        if self.deserialize(&mut from).and_then(|()| from.end()).is_err() {
            let found = serde_json::from_slice::<Json>(text);
            return Err(found.map_or_else(|e| format!("no JSON ({e})"), |_| "no JSON object".to_owned()));
        }
        let (q, prismatic, joints) = self.joints(Field::Joints)?;
        if joints == 0 {
            return Err("no key \"q1_deg\"; every measurement needs its joint angles".to_owned());
        }
        let (commanded, slides, count) = self.joints(Field::Commanded)?;
        let q_commanded = of_each_joint("qc1_deg", commanded, count, joints)?;
        if q_commanded.is_some() && slides != prismatic {
            return Err("keys q1_deg... and qc1_deg... have different units".to_owned());
        }
        let (torques, _, count) = self.joints(Field::Torques)?;
        let torques = of_each_joint("tau1_nm", torques, count, joints)?;
        let state = State {
            q,
            q_commanded,
            dir: self.directions(joints)?,
            t: self.one(Field::Time)?,
            seq: None,
            temp_c: self.one(Field::Temperature)?,
            payload_kg: self.one(Field::Payload)?,
            torques,
            place: self.place(places)?,
            session: None,
        };
        let seq = self.integer(Field::Seq)?;
        let measured = self.measured()?;
        let others = self.keys.iter().zip(&self.values).filter(|(_, value)| value.is_some());
        if let Some(key) = others.map(|(key, _)| key).chain(&self.unknown).min() {
            return Err(format!("unknown key {key:?}"));
        }
        Ok(RowRead { row: Row { state, measured, seq, line: 0 }, joints, prismatic })
    }

    /// The value of a column's component, in one of the units that the column has.
    fn take(&mut self, field: Field, k: usize, which: usize) -> Option<Json> {
        let at = self.of_column[field as usize][k][which].checked_sub(1)?;
        self.values.get_mut(at)?.take()
    }

    /// A number in SI; in the file it has one of the units of its column.
    fn number(&mut self, field: Field, k: usize, which: usize) -> Result<Option<f64>, String> {
        let Some(value) = self.take(field, k, which) else { return Ok(None) };
        let unit = column(field).units.get(which).copied().unwrap_or(Unit::One);
        let limit = unit.limit();
        match value.as_f64() {
            Some(v) if v.abs() <= limit => Ok(Some(unit.to_si(v))),
            _ => {
                let key = column(field).name(k, unit);
                Err(format!("key {key:?} is {value}; expected a number between -{limit} and {limit}"))
            }
        }
    }

    /// The number of a field that has one.
    fn one(&mut self, field: Field) -> Result<Option<f64>, String> {
        Ok(self.all::<1>(field)?.map(|[x]| x))
    }

    /// The numbers of a field: all of them or none.
    fn all<const N: usize>(&mut self, field: Field) -> Result<Option<[f64; N]>, String> {
        let mut values = [0.0; N];
        let (mut found, mut missing) = (None, None);
        for ((k, key), to) in column(field).names.fixed().iter().enumerate().zip(&mut values) {
            match self.number(field, k, 0)? {
                Some(value) => (*to, found) = (value, Some(key)),
                None => missing = Some(key),
            }
        }
        match (found, missing) {
            (None, _) => Ok(None),
            (Some(_), None) => Ok(Some(values)),
            (Some(found), Some(missing)) => Err(format!("key {found:?} without {missing:?}")),
        }
    }

    fn integer(&mut self, field: Field) -> Result<Option<u64>, String> {
        match self.take(field, 0, 0) {
            None => Ok(None),
            Some(value) => {
                let key = column(field).words();
                value.as_u64().map(Some).ok_or_else(|| format!("key {key:?} is {value}; expected a whole number"))
            }
        }
    }

    /// A 1-based number as a 0-based index.
    fn index(&mut self, field: Field) -> Result<Option<usize>, String> {
        let key = column(field).names.fixed().first().copied().unwrap_or_default();
        let most = Unit::Count.limit();
        match self.integer(field)? {
            None => Ok(None),
            Some(0) => Err(format!("key {key:?} is 0; expected 1 or more")),
            Some(number) if number as f64 > most => Err(format!("key {key:?} is {number}; expected {most} at most")),
            Some(number) => Ok(Some((number - 1) as usize)),
        }
    }

    /// Values of the joints, which of them slide, and how many there are.
    fn joints(&mut self, field: Field) -> Result<(Joints, [bool; MAX_JOINTS], usize), String> {
        let column = column(field);
        let (mut q, mut slides) = ([0.0; MAX_JOINTS], [false; MAX_JOINTS]);
        for k in 0..MAX_JOINTS {
            let mut found = None;
            for (which, unit) in column.units.iter().enumerate() {
                if let Some(v) = self.number(field, k, which)? {
                    if found.is_some() {
                        return Err(format!("key {:?} twice, in two units", column.name(k, *unit)));
                    }
                    found = Some((v, which > 0));
                }
            }
            let Some((v, slide)) = found else { return Ok((q, slides, k)) };
            (q[k], slides[k]) = (v, slide);
        }
        Ok((q, slides, MAX_JOINTS))
    }

    fn directions(&mut self, joints: usize) -> Result<Option<[i8; MAX_JOINTS]>, String> {
        let mut dir = [0; MAX_JOINTS];
        let mut count = 0;
        for (joint, dir) in dir.iter_mut().take(joints).enumerate() {
            let Some(value) = self.take(Field::Directions, joint, 0) else { continue };
            *dir = match value.as_i64() {
                Some(-1) => -1,
                Some(0) => 0,
                Some(1) => 1,
                _ => {
                    let key = column(Field::Directions).name(joint, Unit::Sign);
                    return Err(format!("key {key:?} is {value}; expected -1, 0 or 1"));
                }
            };
            count += 1;
        }
        match count {
            0 => Ok(None),
            count if count == joints => Ok(Some(dir)),
            count => Err(format!("{count} keys dir1...; expected {joints}, one for each joint")),
        }
    }

    fn place(&mut self, places: &mut Places) -> Result<Option<usize>, String> {
        let name = match self.take(Field::Place, 0, 0) {
            None => return Ok(None),
            Some(Json::String(name)) => name.trim().to_owned(),
            Some(Json::Number(number)) => number.to_string(),
            Some(other) => return Err(format!("key \"place\" is {other}; expected a name or a number")),
        };
        if name.is_empty() {
            return Ok(None);
        }
        places.index_of(&name).map(Some).map_err(|problem| format!("key \"place\": {problem}"))
    }

    fn measured(&mut self) -> Result<Measured, String> {
        let ball = self.index(Field::Ball)?;
        let reading = self.all(Field::Indicators)?;
        let target = self.index(Field::Target)?;
        let reference = self.index(Field::Reference)?;
        let anchor = self.index(Field::Anchor)?;
        let length = self.one(Field::Length)?;
        let position = self.all(Field::Position)?;
        let quaternion = self.all(Field::Quaternion)?;
        match (ball, reading, length, position, quaternion) {
            (Some(ball), Some(reading), None, None, None) => Ok(Measured::Touch { ball, reading }),
            (None, None, Some(length), None, None) if length <= 0.0 => {
                Err(format!("key \"d_mm\" is {}; expected a positive length", Unit::Millimetre.from_si(length)))
            }
            (None, None, Some(length), None, None) => Ok(Measured::Distance { anchor: anchor.unwrap_or(0), length }),
            (None, None, None, Some(position), Some(quaternion)) => {
                let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
                if (length - 1.0).abs() > 1e-2 {
                    return Err(format!("the quaternion qw qx qy qz has length {length:.4}; expected 1"));
                }
                Ok(Measured::Pose { position, quaternion })
            }
            (None, None, None, Some(position), None) => match (target, reference) {
                (Some(_), Some(_)) => Err("both \"target\" and \"reference\"; expected one of them".to_owned()),
                (None, Some(reference)) => Ok(Measured::Reference { reference, position }),
                (target, None) => Ok(Measured::Point { target: target.unwrap_or(0), position }),
            },
            _ => {
                let kind = |k: &Kind| format!("{} ({})", k.required().join(" "), k.word());
                let kinds: Vec<String> = Kind::ALL.iter().map(kind).collect();
                Err(format!("expected one kind of measurement: {}", kinds.join(", or ")))
            }
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

    fn value(&mut self, key: &str, unit: Unit, value: Value, shared: &Shared) {
        let integer = match value {
            Value::Number(v) => return self.number(key, unit, v),
            Value::Place(k) => {
                self.key(key);
                let _ = write!(self.0, "{}", Json::String(shared.place(k)));
                return;
            }
            Value::Whole(n) => n,
            Value::Count(n) => n as u64 + 1,
            Value::Sign(s) => {
                self.key(key);
                let _ = write!(self.0, "{s}");
                return;
            }
        };
        self.key(key);
        let _ = write!(self.0, "{integer}");
    }

    /// A finite number, to ten decimals where it has a unit: what a conversion adds behind them is no information. Others cannot
    /// stand in JSON and leave the key out, which the reader then misses.
    fn number(&mut self, key: &str, unit: Unit, value: f64) {
        let value = unit.from_si(value);
        if !value.is_finite() {
            return;
        }
        let rounded = if unit == Unit::One { value } else { (value * 1e10).round() / 1e10 };
        self.key(key);
        let _ = write!(self.0, "{:?}", if rounded == 0.0 && unit != Unit::One { 0.0 } else { rounded });
    }

    /// The numbers of a field (SI).
    fn numbers(&mut self, field: Field, values: &[f64]) {
        let column = column(field);
        let unit = column.units.first().copied().unwrap_or(Unit::One);
        for (key, value) in column.names.fixed().iter().zip(values) {
            self.number(key, unit, *value);
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
            row_to_json(&touch(), &Shared::for_joints(6)),
            "{\"t_s\":12.5,\"seq\":7,\"q1_deg\":10.0,\"q2_deg\":-20.5,\"q3_deg\":30.12345,\"q4_deg\":0.0,\"q5_deg\":1e-5,\
             \"q6_deg\":-90.0,\"dir1\":1,\"dir2\":-1,\"dir3\":0,\"dir4\":1,\"dir5\":-1,\"dir6\":1,\
             \"ball\":3,\"ix_mm\":0.001,\"iy_mm\":-0.012,\"iz_mm\":0.0,\"temp_c\":21.5}"
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
            row.state.torques = Some([0.5, -12.25, 3.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0]);
            row.state.place = Some(0);
            let mut shared = Shared { joints: 6, places: vec!["by the door, \"left\"".into()], ..Shared::default() };
            shared.prismatic[0] = true;
            let text = row_to_json(&row, &shared);
            assert!(text.contains("q1_mm") && text.contains("qc1_mm") && text.contains("q2_deg"), "{text}");
            let mut places = Places::default();
            let back = row_from_json(text.as_bytes(), &mut places).unwrap();
            assert_eq!((back.joints, back.prismatic), (6, shared.prismatic));
            assert_eq!(row_to_json(&back.row, &shared), text);
            assert_eq!((back.row.seq, back.row.state.place), (row.seq, Some(0)));
            assert_eq!(back.row.state.torques, row.state.torques);
            assert_eq!(places.into_names(), shared.places);
            assert_eq!(std::mem::discriminant(&back.row.measured), std::mem::discriminant(&row.measured));
        }
    }

    #[test]
    fn errors_name_the_key() {
        let says = |text: &str| row_from_json(text.as_bytes(), &mut Places::default()).unwrap_err();
        assert!(says("{\"q1_deg\":1,\"bal\":1,\"ball\":1,\"ix_mm\":0,\"iy_mm\":0,\"iz_mm\":0}").contains("\"bal\""));
        assert!(says("{\"ball\":1}").contains("q1_deg"));
        assert!(says("{\"q1_deg\":\"a\"}").contains("\"q1_deg\""));
        assert!(says("{\"q1_deg\":1,\"ball\":0,\"ix_mm\":0,\"iy_mm\":0,\"iz_mm\":0}").contains("1 or more"));
        assert!(says("{\"q1_deg\":1,\"ball\":1,\"ix_mm\":0,\"iy_mm\":0}").contains("without \"iz_mm\""));
        assert!(says("{\"q1_deg\":1,\"dir1\":2}").contains("-1, 0 or 1"));
        assert!(says("{\"q1_deg\":1}").contains("one kind"));
        assert!(says("{\"q1_deg\":1,\"tau1_nm\":1,\"tau2_nm\":1}").contains("2 keys tau1_nm"));
        assert!(says("{\"q1_deg\":1,\"q1_mm\":1}").contains("two units"));
        assert!(says("{\"q1_deg\":1,\"place\":[]}").contains("a name or a number"));
        assert!(says("[]").contains("object"));
        assert!(says("nonsense").contains("no JSON"));
    }

    #[test]
    fn what_a_message_says_does_not_hang_on_those_before_it() {
        let touch = "{\"q1_deg\":1,\"ball\":1,\"ix_mm\":1,\"iy_mm\":2,\"iz_mm\":3}";
        let messages = [
            touch,
            "{\"t_s\":2,\"q1_deg\":1,\"q2_mm\":3,\"d_mm\":500}",
            "{\"q1_deg\":1,\"ball\":1,\"ix_mm\":1,\"iy_mm\":2}",
            // the last value of a key counts, wherever the first one stands
            "{\"q1_deg\":1,\"ball\":1,\"q1_deg\":2,\"ix_mm\":1,\"iy_mm\":2,\"iz_mm\":3,\"ball\":2}",
            "{\"ball\":1,\"q1_deg\":1,\"ix_mm\":1,\"iy_mm\":2,\"iz_mm\":3}",
            "{\"zz\":1,\"q1_deg\":1,\"ball\":1,\"x_m\":1,\"ix_mm\":1,\"iy_mm\":2,\"iz_mm\":3}",
            "[1]",
            "{\"q1_deg\":1,",
            touch,
        ];
        let mut fields = Fields::default();
        for message in messages {
            let alone = row_from_json(message.as_bytes(), &mut Places::default());
            assert_eq!(fields.row(message.as_bytes(), &mut Places::default()), alone, "{message}");
        }
        let read = |k: usize| fields_of(messages[k]).unwrap().row;
        assert_eq!(read(3).state.q[0], 2_f64.to_radians());
        assert!(matches!(read(3).measured, Measured::Touch { ball: 1, .. }));
        // of several unknown keys the first by its letters is told
        assert_eq!(fields_of(messages[5]).unwrap_err(), "unknown key \"x_m\"");
    }

    fn fields_of(text: &str) -> Result<RowRead, String> {
        row_from_json(text.as_bytes(), &mut Places::default())
    }

    proptest::proptest! {
        #[test]
        fn random_text_never_panics(text in "\\{(\"[a-z0-9_]{1,6}\":[0-9.\\-]{1,4},?){0,6}\\}") {
            let _ = row_from_json(text.as_bytes(), &mut Places::default());
        }
    }

    #[test]
    fn readings_and_temperatures_are_told_in_the_units_of_their_keys() {
        let read = |text: String| serde_json::from_str::<serde_json::Value>(&text).unwrap();
        let indicators = read(indicators_to_json(1.5, &[1e-3, -2.5e-5, 0.0], true));
        let told = serde_json::json!({ "t_s": 1.5, "ix_mm": 1.0, "iy_mm": -0.025, "iz_mm": 0.0, "settled": true });
        assert_eq!(indicators, told);
        assert_eq!(read(temperature_to_json(2.0, 21.25)), serde_json::json!({ "t_s": 2.0, "temp_c": 21.25 }));
    }
}
