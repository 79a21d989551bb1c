//! Recordings as CSV: one row per measurement, columns known by name (`docs/formats.md`).

mod layout;
mod lines;
mod tidy;

use std::io::Read as _;
use std::path::Path;

use nalgebra::Matrix3;
use trical_model::error::shortened;
use trical_model::pose::{quaternion_from_rotation, rotation_zyx};
use trical_model::{MAX_JOINTS, Measured, Recording, Row, State};

use crate::columns::{self, Column, FIELDS, Field, Kind, Unit};
use crate::error::{RecordError, Result};
use crate::shared::Places;

pub use layout::{CsvWriter, Layout, write_csv};
pub(crate) use lines::{Lines, ends_of_lines};

/// Where a column stands in the file, and its unit.
#[derive(Clone, Copy, Debug)]
struct Slot {
    at: usize,
    unit: Unit,
}

/// The columns of a file, by what they fill; empty where it has none.
struct Slots([Vec<Slot>; FIELDS]);

impl Slots {
    fn all(&self, field: Field) -> &[Slot] {
        &self.0[field as usize]
    }

    fn has(&self, field: Field) -> bool {
        !self.all(field).is_empty()
    }

    fn one(&self, field: Field) -> Option<Slot> {
        self.all(field).first().copied()
    }
}

struct Reader<'a> {
    file: &'a str,
    header: Vec<String>,
}

impl Reader<'_> {
    fn error(&self, place: impl Into<String>, problem: impl Into<String>) -> RecordError {
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

    fn slots(&self, joints: usize) -> Result<Slots> {
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

struct Cells<'a> {
    reader: &'a Reader<'a>,
    row: &'a Lines<'a>,
    line: usize,
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

    fn row(&self, slots: &Slots, places: &mut Places) -> Result<Option<Row>> {
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

/// What a header says about the rows below it.
pub(crate) struct Parser<'a> {
    reader: Reader<'a>,
    slots: Slots,
}

/// Whether a cell says that nothing was measured or known: it is empty, or holds a mark that people and programs set for it.
#[must_use]
pub fn is_nothing(cell: &str) -> bool {
    NOTHING.iter().any(|nothing| nothing.eq_ignore_ascii_case(cell))
}

/// What stands where nothing was measured, in either case.
const NOTHING: [&str; 10] = ["", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--"];

/// Rows without a measured value, in one sentence.
pub(crate) fn left_out(lines: &[usize]) -> Option<String> {
    const MOST: usize = 8;
    let told = lines.iter().take(MOST).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let more = if lines.len() > MOST { format!(" and {} more", lines.len() - MOST) } else { String::new() };
    match lines.len() {
        0 => None,
        1 => Some(format!("line {told} lacks a measured value and is left out")),
        _ => Some(format!("lines {told}{more} lack a measured value and are left out")),
    }
}

/// So many problems of a file are told at most.
const MOST_PROBLEMS: usize = 6;

/// Temperatures in which arms are measured, degC, with room beyond.
pub const ROOM_C: std::ops::RangeInclusive<f64> = -100.0..=200.0;

/// One message with all problems of a file, the first one first.
fn all_in_one(problems: Vec<RecordError>) -> Option<RecordError> {
    let many = problems.len() >= MOST_PROBLEMS;
    let mut problems = problems.into_iter();
    let mut first = problems.next()?;
    if let RecordError::At { problem, .. } = &mut first {
        for other in problems {
            match other {
                RecordError::At { place, problem: next, .. } => *problem += &format!("; {place}: {next}"),
                other => *problem += &format!("; {other}"),
            }
        }
        if many {
            *problem += "; perhaps more";
        }
    }
    Some(first)
}

impl<'a> Parser<'a> {
    /// Reads a header.
    pub fn new(file: &'a str, header: &csv::StringRecord, joints: usize) -> Result<Self> {
        let reader = Reader { file, header: header.iter().map(|h| h.trim().to_owned()).collect() };
        let slots = reader.slots(joints)?;
        Ok(Self { reader, slots })
    }

    /// Whether the file has these columns.
    pub fn has(&self, field: Field) -> bool {
        self.slots.has(field)
    }

    /// Which joints slide.
    pub fn prismatic(&self) -> [bool; MAX_JOINTS] {
        let mut out = [false; MAX_JOINTS];
        for (slides, slot) in out.iter_mut().zip(self.slots.all(Field::Joints)) {
            *slides = slot.unit.usual() == Unit::Millimetre;
        }
        out
    }

    /// The row of a line; `None` where it is none.
    pub fn row_of(&self, line: &[u8]) -> Option<Row> {
        let (mut row, rows) = (None, Lines::of(csv_reader(false).from_reader(line), line));
        let mut take = |found| {
            row = Some(found);
            Ok::<_, RecordError>(())
        };
        self.each_row(rows, 0, &mut Places::default(), &mut take).ok()?;
        row
    }

    /// Hands on every row, and returns the lines of those without a measured value; lines are counted from `lines_before`.
    pub fn each_row<E: From<RecordError>>(
        &self,
        mut rows: Lines<'_>,
        lines_before: usize,
        places: &mut Places,
        take: &mut dyn FnMut(Row) -> Result<(), E>,
    ) -> Result<Vec<usize>, E> {
        let number = |line: u64| usize::try_from(line).unwrap_or(0) + lines_before;
        let mut left_out = Vec::new();
        let mut problems: Vec<RecordError> = Vec::new();
        loop {
            let line = match rows.next() {
                _ if problems.len() >= MOST_PROBLEMS => break,
                Ok(None) => break,
                Ok(Some(line)) => number(line),
                Err(e) => {
                    let line = number(e.position().map_or(0, |begin| rows.line(begin)));
                    let problem = format!("cannot be read as CSV: {e}");
                    return Err(self.reader.error(format!("line {line}"), problem).into());
                }
            };
            let text = |cell: &lines::Cell| cell.text(rows.text());
            if let [cell] = rows.cells.as_slice()
                && text(cell).is_empty()
            {
                continue;
            }
            if rows.cells.len() != self.reader.header.len() {
                let (found, expected) = (rows.cells.len(), self.reader.header.len());
                // a decimal comma divides its number in two
                let hint = if found > expected && rows.cells.iter().skip(expected).all(|f| text(f).is_empty()) {
                    "; there is nothing behind the last separator: remove it"
                } else if found > expected && rows.cells.iter().any(|f| text(f).parse::<i64>().is_ok()) {
                    "; with decimal commas, separate the columns with semicolons or tabs"
                } else {
                    ""
                };
                let problem = format!("found {found} fields, expected {expected} as in the header{hint}");
                problems.push(self.reader.error(format!("line {line}"), problem));
                continue;
            }
            match (Cells { reader: &self.reader, row: &rows, line }.row(&self.slots, places)) {
                Ok(Some(row)) if problems.is_empty() => take(row)?,
                Ok(Some(_)) => {}
                Ok(None) => left_out.push(line),
                Err(e) => problems.push(e),
            }
        }
        all_in_one(problems).map_or(Ok(left_out), |e| Err(e.into()))
    }

    /// Refuses a row that goes back in time.
    pub fn in_order(&self, row: &Row, last_t: &mut f64) -> Result<()> {
        if let Some(t) = row.state.t {
            if t < *last_t {
                return Err(self.reader.error(
                    format!("line {}, column t_s", row.line),
                    format!("found {t} after {last_t}; expected rows in the order of time"),
                ));
            }
            *last_t = t;
        }
        Ok(())
    }
}

/// A recording that is being read.
pub(crate) struct Reading<'a> {
    parser: &'a Parser<'a>,
    joints: usize,
    rows: Vec<Row>,
    places: Places,
    last_t: f64,
    left_out: Vec<usize>,
}

impl<'a> Reading<'a> {
    pub fn new(parser: &'a Parser<'a>, joints: usize) -> Self {
        let (places, last_t) = (Places::default(), f64::NEG_INFINITY);
        Self { parser, joints, rows: Vec::new(), places, last_t, left_out: Vec::new() }
    }

    /// Takes more rows; lines are counted from `lines_before`.
    pub fn take(&mut self, rows: Lines<'_>, lines_before: usize) -> Result<()> {
        let Self { parser, rows: taken, places, last_t, .. } = self;
        let left_out = parser.each_row(rows, lines_before, places, &mut |row| {
            parser.in_order(&row, last_t)?;
            taken.push(row);
            Ok::<_, RecordError>(())
        })?;
        self.left_out.extend(left_out);
        Ok(())
    }

    /// The recording, of a file of which so much is `said`.
    pub fn end(self, said: impl IntoIterator<Item = String>) -> Result<Recording> {
        let name = self.parser.reader.file.to_owned();
        if self.rows.is_empty() {
            return Err(RecordError::File { file: name, problem: no_rows(&self.left_out).to_owned() });
        }
        let said: Vec<String> = said.into_iter().chain(left_out(&self.left_out)).collect();
        let notes = if said.is_empty() { Vec::new() } else { vec![format!("{name}: {}", said.join("; "))] };
        let (prismatic, places) = (Some(self.parser.prismatic()), self.places.into_names());
        Ok(Recording { name, joints: self.joints, prismatic, places, rows: self.rows, notes })
    }
}

/// Reads a CSV recording of an arm with `joints` joints.
///
/// # Errors
/// One sentence with file, line, column, what was found and what was expected.
pub fn load_csv(path: &Path, joints: usize) -> Result<Recording> {
    let name = path.display().to_string();
    let bytes = whole_lines(path)?;
    parse_csv(&bytes, &name, joints)
}

/// No row is this long, bytes.
pub(crate) const LONGEST_LINE: usize = 1 << 20;

/// The bytes of a file; one without ends of lines is given up before it fills the memory.
fn whole_lines(path: &Path) -> Result<Vec<u8>> {
    crate::bounds::check_file(path, true)?;
    let error = |problem: String| RecordError::File { file: path.display().to_string(), problem };
    let file = std::fs::File::open(path).map_err(|e| error(format!("cannot be read: {e}")))?;
    let (mut bytes, mut begin) = (Vec::new(), 0);
    loop {
        let from = bytes.len();
        let read = (&file).take(LONGEST_LINE as u64).read_to_end(&mut bytes);
        if read.map_err(|e| error(format!("cannot be read: {e}")))? == 0 {
            return Ok(bytes);
        }
        if let Some(at) = bytes[from..].iter().rposition(|b| *b == b'\n') {
            begin = from + at + 1;
        }
        if bytes.len() - begin > LONGEST_LINE {
            let line = 1 + ends_of_lines(&bytes[..begin]);
            return Err(error(format!(
                "line {line} is longer than {LONGEST_LINE} bytes; expected a recording, one measurement a line"
            )));
        }
    }
}

/// How recordings are read: lines end with \n, a \r before it is blank (the crate counts lines ending with both one too low).
pub(crate) fn csv_reader(has_headers: bool) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder.flexible(true).has_headers(has_headers).terminator(csv::Terminator::Any(b'\n'));
    builder
}

/// The names of the columns, as they are known, of a file that begins with these bytes.
pub(crate) fn header_names(begin: &[u8]) -> Vec<String> {
    tidy::decoded(begin).map(|(text, _)| tidy::names(&text)).unwrap_or_default()
}

/// What would have to be done to a file that begins with these bytes before it could be read row by row; `None` for nothing.
pub(crate) fn is_untidy(begin: &[u8]) -> Option<String> {
    // whole lines, lest a letter be cut
    let begin = begin.iter().rposition(|b| *b == b'\n').map_or(begin, |at| &begin[..at]);
    let (text, encoded) = tidy::decoded(begin)?;
    let separated_by_cr = !begin.contains(&b'\n') && begin.contains(&b'\r');
    let note = match tidy::tidied(&text) {
        Ok(tidied) => tidied.note,
        Err(problem) => Some(problem),
    };
    encoded
        .map(str::to_owned)
        .or(note)
        .or_else(|| separated_by_cr.then(|| "its lines end with a carriage return".to_owned()))
}

/// Whether rows below a header are as they should be, each beginning with a number and no cell quoted: such a file is read block by block. Of
/// others this may be so, too.
pub(crate) fn are_plain(rows: &str) -> bool {
    let bytes = rows.as_bytes();
    tidy::are_numbers(rows) && !lines::holds(bytes, b'"') && !lines::holds(bytes, 0)
}

/// What a file without rows is told.
pub(crate) fn no_rows(left_out: &[usize]) -> &'static str {
    if left_out.is_empty() { "has a header but no rows" } else { "has no row with a measured value" }
}

/// Reads the bytes of a CSV recording; `file` is its name for messages. UTF-16, separators, decimal commas, upper case, units in
/// brackets or in a line of their own, an index column, remarks and blank lines are understood where their meaning is certain, and rows without a
/// measured value are left out; [`Recording::notes`] says so.
///
/// # Errors
/// As [`load_csv`].
pub fn parse_csv(bytes: &[u8], file: &str, joints: usize) -> Result<Recording> {
    let problem = |p: &str| RecordError::File { file: file.to_owned(), problem: p.to_owned() };
    let (text, encoded) =
        tidy::decoded(bytes).ok_or_else(|| problem("is not a text file; expected a CSV recording"))?;
    let text = text.as_ref();
    if text.trim().is_empty() {
        return Err(problem("is empty; expected a CSV recording with a header line"));
    }
    let tidy::Tidied { text, before, note } = tidy::tidied(text).map_err(|p| problem(&p))?;
    let mut csv = csv_reader(true).from_reader(text.as_bytes());
    let header = csv.headers().map_err(|e| problem(&format!("the header cannot be read: {e}")))?.clone();
    let parser = Parser::new(file, &header, joints)?;
    let mut reading = Reading::new(&parser, joints);
    reading.take(Lines::of(csv, text.as_bytes()), before)?;
    reading.end(encoded.map(str::to_owned).into_iter().chain(note))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_line_that_does_not_end_is_told_with_its_number() {
        let path = tempfile::tempdir().unwrap().keep().join("long.csv");
        std::fs::write(&path, format!("a\nb\n{}", "x".repeat(3 * LONGEST_LINE))).unwrap();
        let e = whole_lines(&path).unwrap_err().to_string();
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
        assert!(e.contains("line 3 is longer than"), "{e}");
    }
}
