//! The header of a recording in CSV: which columns it has, and where.

use trical_model::MAX_JOINTS;
use trical_model::error::shortened;

use crate::columns::{self, Column, FIELDS, Field, Kind, Unit};
use crate::error::{RecordError, Result};

/// Where a column stands in the file, and its unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub at: usize,
    pub unit: Unit,
}

/// The columns of a file, by what they fill; empty where it has none.
pub(super) struct Slots([Vec<Slot>; FIELDS]);

impl Slots {
    pub fn all(&self, field: Field) -> &[Slot] {
        &self.0[field as usize]
    }

    pub fn has(&self, field: Field) -> bool {
        !self.all(field).is_empty()
    }

    pub fn one(&self, field: Field) -> Option<Slot> {
        self.all(field).first().copied()
    }
}

/// A header, and what is told of what stands below it.
pub(super) struct Reader<'a> {
    pub file: &'a str,
    pub header: Vec<String>,
}

impl Reader<'_> {
    pub fn error(&self, place: impl Into<String>, problem: impl Into<String>) -> RecordError {
        RecordError::At { file: self.file.to_owned(), place: place.into(), problem: problem.into() }
    }

    fn wrong_header(&self, problem: impl Into<String>) -> RecordError {
        self.error("header", problem)
    }

    /// Where the columns of a group stand: all of them, none, or an error that names the first that is missing.
    fn group(&self, column: &Column, found: &[[Option<Slot>; 2]], joints: usize) -> Result<Vec<Slot>> {
        let width = column.width(joints);
        let name = |k: usize| column.name(k, column.units.first().copied().unwrap_or(Unit::One));
        for (k, both) in found.iter().enumerate() {
            if let ([Some(_), Some(_)], [one, other, ..]) = (both, column.units) {
                let (one, other) = (column.name(k, *one), column.name(k, *other));
                return Err(self.wrong_header(format!("columns {one} and {other} are both there")));
            }
        }
        let one = |both: &[Option<Slot>; 2]| both[0].or(both[1]);
        if let Some(extra) = found.iter().skip(width).find_map(one) {
            let name = self.header.get(extra.at).map_or("", String::as_str);
            return Err(self.wrong_header(format!("column {name} found, but the robot has {joints} joints")));
        }
        let slots: Vec<Slot> = found.iter().filter_map(one).collect();
        if slots.is_empty() || slots.len() == width || column.field == Field::Plan {
            return Ok(slots);
        }
        let missing = found.iter().position(|both| one(both).is_none()).unwrap_or(slots.len());
        let expected = match column.names.fixed() {
            [] => String::new(),
            names => format!("; expected all of {} or none", names.join(", ")),
        };
        Err(self.wrong_header(format!("column {} is missing{expected}", name(missing))))
    }

    /// Where the columns stand.
    pub fn slots(&self, joints: usize) -> Result<Slots> {
        let unknown: Vec<String> = self
            .header
            .iter()
            .filter(|n| columns::find(n).is_none())
            .map(|n| format!("'{}'{}", shortened(n, 60), columns::meant(n)))
            .collect();
        if !unknown.is_empty() {
            let (s, known) = (if unknown.len() > 1 { "s" } else { "" }, columns::known());
            if self.header.iter().all(|n| n.parse::<f64>().is_ok()) {
                return Err(self.wrong_header(format!("found numbers, expected names of columns; known are {known}")));
            }
            if self.header.iter().any(|n| n == "a1_deg") && self.header.iter().any(|n| n == "via") {
                return Err(self.wrong_header("is that of a plan of touches, expected that of a recording"));
            }
            if unknown.iter().all(|told| told.ends_with("?)")) {
                return Err(self.wrong_header(format!(
                    "no unit in the name of column{s} {}; expected one in each name (deg or rad, mm or m), or a line of units below the header",
                    unknown.join(", ")
                )));
            }
            return Err(self.wrong_header(format!("unknown column{s} {}; known are {known}", unknown.join(", "))));
        }
        let mut found: [[[Option<Slot>; 2]; MAX_JOINTS]; FIELDS] = [[[None; 2]; MAX_JOINTS]; FIELDS];
        for (at, name) in self.header.iter().enumerate() {
            let Some((column, k, unit)) = columns::find(name) else { continue };
            let which = usize::from(column.units.first() != Some(&unit.usual()));
            let slot = &mut found[column.field as usize][k][which];
            if let Some(other) = slot {
                let other = self.header.get(other.at).map_or("", String::as_str);
                return Err(self.wrong_header(if other == name {
                    format!("column {name} is given twice")
                } else {
                    format!("columns {other} and {name} are both there")
                }));
            }
            *slot = Some(Slot { at, unit });
        }
        let mut slots = Slots(Default::default());
        for column in &columns::COLUMNS {
            slots.0[column.field as usize] = self.group(column, &found[column.field as usize], joints)?;
        }
        if !slots.has(Field::Joints) {
            return Err(self.wrong_header(format!(
                "column q1_deg is missing; expected the joint angles q1_deg to q{joints}_deg (q1_mm where a joint slides)"
            )));
        }
        for (q, commanded) in slots.all(Field::Joints).iter().zip(slots.all(Field::Commanded)) {
            if q.unit.usual() != commanded.unit.usual() {
                let name = |slot: &Slot| self.header.get(slot.at).map_or("", String::as_str);
                let (q, commanded) = (name(q), name(commanded));
                return Err(self.wrong_header(format!("columns {q} and {commanded} have different units")));
            }
        }
        if slots.has(Field::Indicators) != slots.has(Field::Ball) {
            let missing = if slots.has(Field::Ball) { Field::Indicators } else { Field::Ball };
            let (needed, missing) = (Kind::Touch.required().join(", "), columns::column(missing).words());
            return Err(self.wrong_header(format!("a touch needs {needed}; {missing} missing")));
        }
        if slots.has(Field::Anchor) && !slots.has(Field::Length) {
            return Err(self.wrong_header("column anchor is there, but d_mm is missing: the length from it"));
        }
        let orientations = [Field::Quaternion, Field::RollPitchYaw, Field::Matrix];
        let said: Vec<String> =
            orientations.into_iter().filter(|f| slots.has(*f)).map(|f| columns::column(f).words()).collect();
        if said.len() > 1 {
            let said = said.join(" and ");
            return Err(self.wrong_header(format!("the orientation is there twice, as {said}; expected it once")));
        }
        if ![Field::Indicators, Field::Position, Field::Length].into_iter().any(|f| slots.has(f)) {
            return Err(self.wrong_header(format!("no measurement found; expected {}", columns::known_kinds())));
        }
        Ok(slots)
    }
}
