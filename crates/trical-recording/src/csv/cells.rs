//! The cells of one line of a recording in CSV, as a row.

use nalgebra::Matrix3;
use trical_model::error::shortened;
use trical_model::pose::{quaternion_from_rotation, rotation_zyx};
use trical_model::{MAX_JOINTS, Measured, Row, State};

use super::header::{Reader, Slot, Slots};
use super::lines::Lines;
use crate::columns::{Field, Unit};
use crate::error::{RecordError, Result};
use crate::shared::Places;

/// The cells of one line.
pub(super) struct Cells<'a> {
    pub reader: &'a Reader<'a>,
    pub row: &'a Lines<'a>,
    pub line: usize,
}

impl Cells<'_> {
    fn text(&self, slot: Slot) -> &str {
        self.row.cells.get(slot.at).map_or("", |cell| cell.text(self.row.text()))
    }

    /// The number of a plain cell; NaN where the text has to be looked at.
    fn plain(&self, slot: Slot) -> f64 {
        self.row.cells.get(slot.at).map_or(f64::NAN, |cell| cell.number)
    }

    fn parsed(&self, slot: Slot) -> Option<f64> {
        let plain = self.plain(slot);
        if plain.is_nan() { self.text(slot).parse().ok() } else { Some(plain) }
    }

    fn error(&self, slot: Slot, problem: String) -> RecordError {
        let name = self.reader.header.get(slot.at).map_or("?", String::as_str);
        self.reader.error(format!("line {}, column {name}", self.line), problem)
    }

    fn unexpected(&self, slot: Slot, expected: &str) -> RecordError {
        self.error(slot, format!("found '{}', expected {expected}", shortened(self.text(slot), 60)))
    }

    /// Whether nothing stands there, or a mark that people and programs set for it.
    fn empty(&self, slot: Slot) -> bool {
        self.plain(slot).is_nan() && is_nothing(self.text(slot))
    }

    /// Whether one of these is empty.
    fn gap(&self, slots: &[Slot]) -> bool {
        slots.iter().any(|s| self.empty(*s))
    }

    fn all_empty(&self, slots: &[Slot]) -> bool {
        slots.iter().all(|s| self.empty(*s))
    }

    /// The joints of a row: it says nothing without them.
    fn joints(&self, slots: &[Slot]) -> Result<[f64; MAX_JOINTS]> {
        match slots.iter().find(|s| self.empty(**s)) {
            None => self.numbers(slots),
            Some(slot) => Err(self.unexpected(
                *slot,
                "a finite number: the joints of a measurement; remove the line where they are not known",
            )),
        }
    }

    /// A number whose size is that of an arm or an instrument, SI; the unit stands in the column's name.
    fn number(&self, slot: Slot) -> Result<f64> {
        let found = self.parsed(slot);
        match found.filter(|v| v.abs() <= slot.unit.limit()) {
            Some(v) => Ok(slot.unit.to_si(v)),
            None => Err(self.no_number(slot, found)),
        }
    }

    #[cold]
    fn no_number(&self, slot: Slot, found: Option<f64>) -> RecordError {
        let (limit, since) = (slot.unit.limit(), since(slot.unit));
        if found.is_some_and(f64::is_finite) {
            return self.unexpected(slot, &format!("between -{limit} and {limit}{since}"));
        }
        self.unexpected(slot, &format!("a finite number{since}"))
    }

    fn numbers<const N: usize>(&self, slots: &[Slot]) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for (o, slot) in out.iter_mut().zip(slots) {
            *o = self.number(*slot)?;
        }
        Ok(out)
    }

    /// Numbers that a row may leave out together.
    fn optional_numbers<const N: usize>(&self, slots: &[Slot]) -> Result<Option<[f64; N]>> {
        if self.all_empty(slots) { Ok(None) } else { self.numbers(slots).map(Some) }
    }

    fn optional(&self, slot: Option<Slot>) -> Result<Option<f64>> {
        slot.filter(|s| !self.empty(*s)).map(|s| self.number(s)).transpose()
    }

    /// A whole number from `from` to the unit's limit.
    fn whole(&self, slot: Slot, from: f64, expected: &str) -> Result<u64> {
        match self.parsed(slot) {
            Some(v) if v.fract() == 0.0 && (from..=slot.unit.limit()).contains(&v) => {
                let n = v as u64;
                Ok(n)
            }
            _ => Err(self.unexpected(slot, expected)),
        }
    }

    fn count(&self, slot: Slot) -> Result<usize> {
        let n = self.whole(slot, 1.0, &format!("a number counted from 1 up to {}", slot.unit.limit()))?;
        Ok(usize::try_from(n - 1).unwrap_or(usize::MAX))
    }

    fn sign(&self, slot: Slot) -> Result<i8> {
        match self.parsed(slot) {
            Some(1.0) => Ok(1),
            Some(0.0) => Ok(0),
            Some(-1.0) => Ok(-1),
            _ => Err(self.unexpected(slot, "-1, 0 or 1")),
        }
    }

    /// `None` = nothing was measured at this pose, or not all of it: a lost beam, a gauge that did not answer.
    fn measured(&self, slots: &Slots) -> Result<Option<Measured>> {
        let filled = |field: Field| slots.one(field).filter(|s| !self.empty(*s));
        let whole = |field: Field| slots.has(field) && !self.gap(slots.all(field));
        let kinds = [
            (filled(Field::Ball).filter(|_| whole(Field::Indicators)), "a touch"),
            (filled(Field::Length), "a length"),
            (filled(Field::Position).filter(|_| whole(Field::Position)), "a position"),
        ];
        let mut found = kinds.iter().filter_map(|(slot, what)| slot.map(|slot| (slot, what)));
        if let (Some((first, one)), Some((_, other))) = (found.next(), found.next()) {
            return Err(
                self.error(first, format!("found {one} and {other} in one row, expected one measurement a row"))
            );
        }
        let of_position = [Field::Target, Field::Reference].into_iter().find_map(filled);
        if let Some(slot) = of_position.filter(|_| kinds[..2].iter().any(|(slot, _)| slot.is_some()))
            && (slots.one(Field::Target).is_none_or(|t| t.at != slot.at) || self.count(slot)? > 0)
        {
            return Err(self.error(slot, format!("found '{}' beside what is no position", self.text(slot))));
        }
        if let Some(ball) = filled(Field::Ball) {
            let (ball, reading) = (self.count(ball)?, slots.all(Field::Indicators));
            if self.gap(reading) {
                return Ok(None);
            }
            return Ok(Some(Measured::Touch { ball, reading: self.numbers(reading)? }));
        }
        if let Some(d) = filled(Field::Length) {
            let anchor = filled(Field::Anchor).map_or(Ok(0), |a| self.count(a))?;
            let length = self.number(d)?;
            if length <= 0.0 {
                return Err(self.unexpected(d, "a positive length"));
            }
            return Ok(Some(Measured::Distance { anchor, length }));
        }
        if let Some(ball) = slots.one(Field::Ball).filter(|_| !self.all_empty(slots.all(Field::Indicators))) {
            return Err(self.unexpected(ball, "the ball that was touched, counted from 1"));
        }
        let position = slots.all(Field::Position);
        let orientations = [Field::Quaternion, Field::RollPitchYaw, Field::Matrix].map(|f| slots.all(f));
        if position.is_empty() || self.gap(position) || orientations.iter().any(|o| self.gap(o) && !self.all_empty(o)) {
            return Ok(None);
        }
        let position = self.numbers(position)?;
        match (filled(Field::Target), filled(Field::Reference)) {
            (Some(t), Some(_)) => {
                return Err(self.error(t, "the row names a target and a reference, expected one of them".into()));
            }
            // a fixed point has no orientation, whatever the instrument says beside it
            (None, Some(r)) => return Ok(Some(Measured::Reference { reference: self.count(r)?, position })),
            (Some(t), None) => {
                let target = self.count(t)?;
                let oriented = orientations.iter().any(|o| !o.is_empty() && !self.gap(o));
                if !oriented {
                    return Ok(Some(Measured::Point { target, position }));
                }
                if target > 0 {
                    let problem = format!(
                        "found target {} with an orientation; full poses are of the tool: leave out the orientation or the target",
                        target + 1
                    );
                    return Err(self.error(t, problem));
                }
            }
            (None, None) => {}
        }
        if let Some(first) = filled(Field::Quaternion) {
            let quaternion: [f64; 4] = self.numbers(slots.all(Field::Quaternion))?;
            let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-2 {
                return Err(self.error(first, format!("the quaternion has length {norm:.4}, expected 1")));
            }
            return Ok(Some(Measured::Pose { position, quaternion }));
        }
        if filled(Field::RollPitchYaw).is_some() {
            let [roll, pitch, yaw] = self.numbers(slots.all(Field::RollPitchYaw))?;
            let quaternion = quaternion_from_rotation(&rotation_zyx(yaw, pitch, roll));
            return Ok(Some(Measured::Pose { position, quaternion }));
        }
        if let Some(first) = filled(Field::Matrix) {
            let numbers: [f64; 9] = self.numbers(slots.all(Field::Matrix))?;
            let quaternion = rotation_of(&numbers).map_err(|problem| self.error(first, problem))?;
            return Ok(Some(Measured::Pose { position, quaternion }));
        }
        Ok(Some(Measured::Point { target: 0, position }))
    }

    pub fn row(&self, slots: &Slots, places: &mut Places) -> Result<Option<Row>> {
        let q = self.joints(slots.all(Field::Joints))?;
        let q_commanded = self.optional_numbers(slots.all(Field::Commanded))?;
        let (senses, mut dir) = (slots.all(Field::Directions), None);
        if !self.all_empty(senses) {
            let dir = dir.insert([0; MAX_JOINTS]);
            for (d, slot) in dir.iter_mut().zip(senses) {
                *d = self.sign(*slot)?;
            }
        }
        let t = self.optional(slots.one(Field::Time))?;
        let temp_c = self.optional(slots.one(Field::Temperature))?;
        if let Some(slot) = slots.one(Field::Temperature).filter(|_| temp_c.is_some_and(|t| !ROOM_C.contains(&t))) {
            return Err(
                self.unexpected(slot, &format!("a temperature from {} to {} degC", ROOM_C.start(), ROOM_C.end()))
            );
        }
        let payload_kg = self.optional(slots.one(Field::Payload))?;
        let torques = self.optional_numbers(slots.all(Field::Torques))?;
        let mut place = None;
        if let Some(slot) = slots.one(Field::Place).filter(|s| !self.empty(*s)) {
            place = Some(places.index_of(self.text(slot)).map_err(|problem| self.error(slot, problem))?);
        }
        let seq = slots.one(Field::Seq).filter(|s| !self.empty(*s));
        let seq = seq.map(|s| self.whole(s, 0.0, "a whole number")).transpose()?;
        let Some(measured) = self.measured(slots)? else { return Ok(None) };
        let state = State { q, q_commanded, dir, t, seq: None, temp_c, payload_kg, torques, place, session: None };
        Ok(Some(Row { state, measured, seq, line: self.line }))
    }
}

/// What is said of a time that cannot be read, as one of a calendar.
fn since(unit: Unit) -> &'static str {
    if unit == Unit::Second { ": seconds since the recording began; subtract the first time" } else { "" }
}

/// A matrix, row by row, as a quaternion: of the rotation that is nearest to it.
fn rotation_of(rows: &[f64; 9]) -> Result<[f64; 4], String> {
    let matrix = Matrix3::from_row_slice(rows);
    let off = (matrix.transpose() * matrix - Matrix3::identity()).norm();
    let turn = matrix.determinant();
    if off.is_nan() || off > 2e-2 || turn < 0.0 {
        return Err(format!(
            "the nine numbers are no rotation matrix: their columns are {off:.3} from orthonormal and the determinant is {turn:.3}, expected 0 \
             and 1"
        ));
    }
    Ok(quaternion_from_rotation(&matrix))
}

/// Whether a cell says that nothing was measured or known: it is empty, or holds a mark that people and programs set for it.
#[must_use]
pub fn is_nothing(cell: &str) -> bool {
    NOTHING.iter().any(|nothing| nothing.eq_ignore_ascii_case(cell))
}

/// What stands where nothing was measured, in either case.
const NOTHING: [&str; 10] = ["", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--"];

/// Temperatures in which arms are measured, degC, with room beyond.
pub const ROOM_C: std::ops::RangeInclusive<f64> = -100.0..=200.0;
