//! The columns of a recording, once: names, units, meaning. Reading and writing of CSV and of MCAP messages, their schema,
//! messages about columns and the table in `docs/formats.md` follow from [`COLUMNS`].

use std::fmt::Write as _;

use trical_model::{MAX_JOINTS, Measured, Row};

/// What a group of columns fills in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Time since the recording began.
    Time,
    /// Number of the pose.
    Seq,
    /// Where the set of balls stood.
    Place,
    /// Joint values that the controller reported.
    Joints,
    /// Joint values that were commanded.
    Commanded,
    /// Sense of each joint's last motion.
    Directions,
    /// Measured joint torques.
    Torques,
    /// The ball that was touched.
    Ball,
    /// The three indicators.
    Indicators,
    /// Target on the tool.
    Target,
    /// Fixed point of the cell.
    Reference,
    /// Measured position.
    Position,
    /// Measured orientation.
    Quaternion,
    /// The same as angles; read, never written.
    RollPitchYaw,
    /// The same as a matrix; read, never written.
    Matrix,
    /// Where a length was measured from.
    Anchor,
    /// Measured length.
    Length,
    /// Temperature.
    Temperature,
    /// Added mass on the flange.
    Payload,
    /// Columns of a plan, which may stand beside its measurements.
    Plan,
}

impl Field {
    /// Whether its columns are written, and not only read.
    #[must_use]
    pub const fn is_written(self) -> bool {
        !matches!(self, Self::Plan | Self::RollPitchYaw | Self::Matrix)
    }
}

/// How many [`Field`]s there are.
pub const FIELDS: usize = Field::Plan as usize + 1;

/// The unit in which a column stands in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// s.
    Second,
    /// Degree of an angle; rad inside.
    Degree,
    /// Millimetre; m inside.
    Millimetre,
    /// Radian: read in place of degrees.
    Radian,
    /// Metre: read in place of millimetres.
    Metre,
    /// N m.
    NewtonMetre,
    /// Degree Celsius, inside too.
    Celsius,
    /// kg.
    Kilogram,
    /// A number without a unit.
    One,
    /// -1, 0 or 1.
    Sign,
    /// A number counted from 1; from 0 inside.
    Count,
    /// A whole number from 0.
    Whole,
    /// A name.
    Text,
}

impl Unit {
    /// As people write it; empty where there is none.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Second => "s",
            Self::Degree => "deg",
            Self::Millimetre => "mm",
            Self::Radian => "rad",
            Self::Metre => "m",
            Self::NewtonMetre => "N m",
            Self::Celsius => "degC",
            Self::Kilogram => "kg",
            Self::One | Self::Sign | Self::Count | Self::Whole | Self::Text => "",
        }
    }

    /// A number of a file in SI.
    #[must_use]
    pub fn to_si(self, value: f64) -> f64 {
        match self {
            Self::Degree => value.to_radians(),
            Self::Millimetre => value * 1e-3,
            _ => value,
        }
    }

    /// A number in SI as a file has it.
    #[must_use]
    pub fn from_si(self, value: f64) -> f64 {
        match self {
            Self::Degree => value.to_degrees(),
            Self::Millimetre => value * 1e3,
            _ => value,
        }
    }

    /// The largest number that a file may have, in its own unit: no joint turns further than 278 times, no instrument looks
    /// further than a kilometre, no cell has more balls, targets, references or anchors than ten thousand.
    #[must_use]
    pub const fn limit(self) -> f64 {
        match self {
            Self::Degree => 1e5,
            Self::Millimetre => 1e6,
            Self::Radian => 1745.0,
            Self::Metre => 1e3,
            Self::Count => 1e4,
            Self::Sign => 1.0,
            _ => 1e9,
        }
    }

    /// The unit of the table that this one is read in place of.
    #[must_use]
    pub const fn usual(self) -> Self {
        match self {
            Self::Radian => Self::Degree,
            Self::Metre => Self::Millimetre,
            unit => unit,
        }
    }

    /// The SI unit that is read in place of this one.
    pub(crate) const fn si(self) -> Option<Self> {
        match self {
            Self::Degree => Some(Self::Radian),
            Self::Millimetre => Some(Self::Metre),
            _ => None,
        }
    }

    /// The type that JSON has for it.
    #[must_use]
    pub const fn json_type(self) -> &'static str {
        match self {
            Self::Sign | Self::Count | Self::Whole => "integer",
            Self::Text => "string",
            _ => "number",
        }
    }

    /// How names of columns for each joint end.
    const fn ending(self) -> &'static str {
        match self {
            Self::Degree => "_deg",
            Self::Millimetre => "_mm",
            Self::Radian => "_rad",
            Self::Metre => "_m",
            Self::NewtonMetre => "_nm",
            _ => "",
        }
    }
}

/// Kinds of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A ball, touched with three indicators.
    Touch,
    /// A point, seen by a tracker.
    Tracker,
    /// A length from an anchor.
    Distance,
    /// A full pose.
    Pose,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Touch, Self::Tracker, Self::Distance, Self::Pose];

    /// In a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Touch => "touch",
            Self::Tracker => "tracker",
            Self::Distance => "distance",
            Self::Pose => "pose",
        }
    }

    /// The columns without which a row is none of this kind.
    #[must_use]
    pub fn required(self) -> Vec<&'static str> {
        let of_kind = COLUMNS.iter().filter(|c| c.required && c.kinds.contains(&self));
        of_kind.flat_map(|c| c.names.fixed().iter().copied()).collect()
    }
}

/// How the columns of a group are called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Names {
    /// One name for each component.
    Fixed(&'static [&'static str]),
    /// A stem for each joint: `q` gives `q1_deg` and so on, the ending by the unit.
    EachJoint(&'static str),
}

impl Names {
    /// The fixed names; none for joints.
    #[must_use]
    pub const fn fixed(self) -> &'static [&'static str] {
        match self {
            Self::Fixed(names) => names,
            Self::EachJoint(_) => &[],
        }
    }
}

/// A group of columns that belong together: all of them are there, or none.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// What they fill.
    pub field: Field,
    /// Their names.
    pub names: Names,
    /// Their unit; where there are two, each joint has the one or the other (turning and sliding joints).
    pub units: &'static [Unit],
    /// The kinds of measurement that they belong to; none for what any row may have.
    pub kinds: &'static [Kind],
    /// Whether every row needs them, or every row of their kinds.
    pub required: bool,
    /// What they mean.
    pub meaning: &'static str,
}

impl Column {
    /// The name of component `k` (from 0) in one of the column's units.
    #[must_use]
    pub fn name(&self, k: usize, unit: Unit) -> String {
        match self.names {
            Names::Fixed(names) => names.get(k).copied().unwrap_or_default().to_owned(),
            Names::EachJoint(stem) => format!("{stem}{}{}", k + 1, unit.ending()),
        }
    }

    /// How many columns the group has, for an arm with so many joints.
    #[must_use]
    pub fn width(&self, joints: usize) -> usize {
        match self.names {
            Names::Fixed(names) => names.len(),
            Names::EachJoint(_) => joints,
        }
    }

    /// The unit of component `k`, for an arm of which these joints slide.
    #[must_use]
    pub fn unit(&self, k: usize, prismatic: &[bool; MAX_JOINTS]) -> Unit {
        let slides = self.units.len() > 1 && prismatic.get(k).copied().unwrap_or(false);
        self.units.get(usize::from(slides)).copied().unwrap_or(Unit::One)
    }

    /// The group in words: `q1_deg (or q1_mm) ...`, `ix_mm, iy_mm, iz_mm`.
    #[must_use]
    pub fn words(&self) -> String {
        match (self.names, self.units) {
            (Names::Fixed(names), _) => names.join(", "),
            (Names::EachJoint(_), [unit, other, ..]) => {
                format!("{} (or {}) ...", self.name(0, *unit), self.name(0, *other))
            }
            (Names::EachJoint(_), units) => {
                format!("{} ...", self.name(0, units.first().copied().unwrap_or(Unit::One)))
            }
        }
    }
}

const TURN_OR_SLIDE: &[Unit] = &[Unit::Degree, Unit::Millimetre];

/// All columns, in the order in which they are written.
pub const COLUMNS: [Column; FIELDS] = [
    Column {
        field: Field::Time,
        names: Names::Fixed(&["t_s"]),
        units: &[Unit::Second],
        kinds: &[],
        required: false,
        meaning: "time since the recording began; never falls",
    },
    Column {
        field: Field::Seq,
        names: Names::Fixed(&["seq"]),
        units: &[Unit::Whole],
        kinds: &[],
        required: false,
        meaning: "number of the pose in the original order, where rows are missing or a pose has several rows; rows at the \
                  same joints are one pose whether or not `seq` says so",
    },
    Column {
        field: Field::Place,
        names: Names::Fixed(&["place"]),
        units: &[Unit::Text],
        kinds: &[],
        required: false,
        meaning: "a name or number: where the set of balls (or sockets, or the bar) stood. Balls keep their distances, the \
                  place of the set is unknown and identified for each `place`. Without the column there is one place",
    },
    Column {
        field: Field::Joints,
        names: Names::EachJoint("q"),
        units: TURN_OR_SLIDE,
        kinds: &[],
        required: true,
        meaning: "joint values that the controller reported, `_mm` for a joint that slides",
    },
    Column {
        field: Field::Commanded,
        names: Names::EachJoint("qc"),
        units: TURN_OR_SLIDE,
        kinds: &[],
        required: false,
        meaning: "joint values that were commanded",
    },
    Column {
        field: Field::Directions,
        names: Names::EachJoint("dir"),
        units: &[Unit::Sign],
        kinds: &[],
        required: false,
        meaning: "sense of each joint's last motion before the reading: -1, 0 (unknown or none) or 1",
    },
    Column {
        field: Field::Torques,
        names: Names::EachJoint("tau"),
        units: &[Unit::NewtonMetre],
        kinds: &[],
        required: false,
        meaning: "measured joint torques (N for a joint that slides), where the arm has sensors; with them elastic effects go by what was \
                  measured, and no masses are needed",
    },
    Column {
        field: Field::Ball,
        names: Names::Fixed(&["ball"]),
        units: &[Unit::Count],
        kinds: &[Kind::Touch],
        required: true,
        meaning: "which ball, from 1",
    },
    Column {
        field: Field::Indicators,
        names: Names::Fixed(&["ix_mm", "iy_mm", "iz_mm"]),
        units: &[Unit::Millimetre],
        kinds: &[Kind::Touch],
        required: true,
        meaning: "the three indicators: the position of the ball's centre relative to the TCP, in the device's axes. The touch \
                  says: FK(q) + R(q) i = ball",
    },
    Column {
        field: Field::Target,
        names: Names::Fixed(&["target"]),
        units: &[Unit::Count],
        kinds: &[Kind::Tracker],
        required: false,
        meaning: "which target on the tool, from 1; the tool's points are in `[tool] targets_mm`. 1 where not given",
    },
    Column {
        field: Field::Reference,
        names: Names::Fixed(&["reference"]),
        units: &[Unit::Count],
        kinds: &[Kind::Tracker],
        required: false,
        meaning: "instead of `target`, from 1: a fixed point of the cell, measured again and again; it ties the measuring \
                  frame down",
    },
    Column {
        field: Field::Position,
        names: Names::Fixed(&["x_mm", "y_mm", "z_mm"]),
        units: &[Unit::Millimetre],
        kinds: &[Kind::Tracker, Kind::Pose],
        required: true,
        meaning: "measured position in the measuring frame",
    },
    Column {
        field: Field::Quaternion,
        names: Names::Fixed(&["qw", "qx", "qy", "qz"]),
        units: &[Unit::One],
        kinds: &[Kind::Pose],
        required: true,
        meaning: "measured orientation: unit quaternion, measuring frame from tool",
    },
    Column {
        field: Field::RollPitchYaw,
        names: Names::Fixed(&["roll_deg", "pitch_deg", "yaw_deg"]),
        units: &[Unit::Degree],
        kinds: &[Kind::Pose],
        required: false,
        meaning: "in place of the quaternion: R = Rz(yaw) Ry(pitch) Rx(roll), measuring frame from tool; read, never written",
    },
    Column {
        field: Field::Matrix,
        names: Names::Fixed(&["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"]),
        units: &[Unit::One],
        kinds: &[Kind::Pose],
        required: false,
        meaning: "in place of the quaternion: the rotation matrix, row by row, measuring frame from tool; read, never written",
    },
    Column {
        field: Field::Anchor,
        names: Names::Fixed(&["anchor"]),
        units: &[Unit::Count],
        kinds: &[Kind::Distance],
        required: false,
        meaning: "the fixed point that the length was measured from, from 1 (a wire encoder, a ballbar). 1 where not given",
    },
    Column {
        field: Field::Length,
        names: Names::Fixed(&["d_mm"]),
        units: &[Unit::Millimetre],
        kinds: &[Kind::Distance],
        required: true,
        meaning: "measured length from the anchor to the TCP",
    },
    Column {
        field: Field::Temperature,
        names: Names::Fixed(&["temp_c"]),
        units: &[Unit::Celsius],
        kinds: &[],
        required: false,
        meaning: "temperature",
    },
    Column {
        field: Field::Payload,
        names: Names::Fixed(&["payload_kg"]),
        units: &[Unit::Kilogram],
        kinds: &[],
        required: false,
        meaning: "added mass on the flange, where it changes",
    },
    Column {
        field: Field::Plan,
        names: Names::Fixed(&["order", "expected", "note"]),
        units: &[Unit::Text],
        kinds: &[],
        required: false,
        meaning: "columns of a plan or remarks; not read",
    },
];

/// The column of a field.
#[must_use]
pub fn column(field: Field) -> &'static Column {
    // the table has them in the order of the fields: a test says so
    &COLUMNS[field as usize]
}

/// What a column's name stands for: its group, its component (from 0) and its unit. Names may end in `_rad` in place of `_deg`, and in `_m`
/// in place of `_mm`.
#[must_use]
pub fn find(name: &str) -> Option<(&'static Column, usize, Unit)> {
    COLUMNS.iter().find_map(|c| match c.names {
        Names::Fixed(names) => {
            let unit = c.units.first().copied()?;
            if let Some(k) = names.iter().position(|n| *n == name) {
                return Some((c, k, unit));
            }
            let si = unit.si()?;
            let stem = name.strip_suffix(si.ending())?;
            let k = names.iter().position(|n| n.strip_suffix(unit.ending()) == Some(stem))?;
            Some((c, k, si))
        }
        Names::EachJoint(stem) => {
            let rest = name.strip_prefix(stem)?;
            let joint = rest.chars().next()?.to_digit(10).filter(|d| *d > 0)? as usize;
            let all = c.units.iter().flat_map(|u| [Some(*u), u.si()]).flatten();
            let unit = all.into_iter().find(|u| rest.get(1..) == Some(u.ending()))?;
            (joint <= MAX_JOINTS).then_some((c, joint - 1, unit))
        }
    })
}

/// What may have been meant by a name without its unit: " (q1_deg?)"; nothing for any other.
pub fn meant(name: &str) -> String {
    let ends = ["deg", "mm", "s", "nm", "c", "kg"];
    let whole = ends.iter().map(|unit| format!("{name}_{unit}")).find(|whole| find(whole).is_some());
    whole.map_or_else(String::new, |whole| format!(" ({whole}?)"))
}

/// Whether columns of these names are those of a recording: all that every row needs, all that one kind of measurement needs, and none
/// that is unknown.
pub fn is_recording<'a>(names: impl Iterator<Item = &'a str>) -> bool {
    let Some(fields) = names.map(|name| find(name).map(|(c, ..)| c.field)).collect::<Option<Vec<_>>>() else {
        return false;
    };
    let needs = |c: &Column, kind| c.required && (c.kinds.is_empty() || c.kinds.contains(&kind));
    Kind::ALL.iter().any(|kind| COLUMNS.iter().filter(|c| needs(c, *kind)).all(|c| fields.contains(&c.field)))
}

/// All columns in words, for messages.
#[must_use]
pub fn known() -> String {
    COLUMNS.iter().map(Column::words).collect::<Vec<_>>().join(", ")
}

/// What measurements need, for messages: "ball, ix_mm, iy_mm, iz_mm (touch), ...".
#[must_use]
pub fn known_kinds() -> String {
    let kind = |k: &Kind| format!("{} ({})", k.required().join(", "), k.word());
    Kind::ALL.iter().map(kind).collect::<Vec<_>>().join(" or ")
}

/// What a row has in a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A number, SI.
    Number(f64),
    /// A whole number.
    Whole(u64),
    /// A sense of motion.
    Sign(i8),
    /// A number counted from 0.
    Count(usize),
    /// A place, as index into the recording's list.
    Place(usize),
}

/// What `row` has in component `k` of a field; `None` where it has nothing.
#[must_use]
pub fn value(row: &Row, field: Field, k: usize) -> Option<Value> {
    let s = &row.state;
    let number = |v: &[f64]| v.get(k).copied().map(Value::Number);
    match (field, &row.measured) {
        (Field::Time, _) => s.t.map(Value::Number),
        (Field::Seq, _) => row.seq.map(Value::Whole),
        (Field::Place, _) => s.place.map(Value::Place),
        (Field::Joints, _) => number(&s.q),
        (Field::Commanded, _) => s.q_commanded.and_then(|q| number(&q)),
        (Field::Directions, _) => s.dir.and_then(|d| d.get(k).copied()).map(Value::Sign),
        (Field::Torques, _) => s.torques.and_then(|t| number(&t)),
        (Field::Temperature, _) => s.temp_c.map(Value::Number),
        (Field::Payload, _) => s.payload_kg.map(Value::Number),
        (Field::Ball, Measured::Touch { ball, .. }) => Some(Value::Count(*ball)),
        (Field::Indicators, Measured::Touch { reading, .. }) => number(reading),
        (Field::Target, Measured::Point { target, .. }) => Some(Value::Count(*target)),
        (Field::Reference, Measured::Reference { reference, .. }) => Some(Value::Count(*reference)),
        (
            Field::Position,
            Measured::Point { position, .. } | Measured::Reference { position, .. } | Measured::Pose { position, .. },
        ) => number(position),
        (Field::Quaternion, Measured::Pose { quaternion, .. }) => number(quaternion),
        (Field::Anchor, Measured::Distance { anchor, .. }) => Some(Value::Count(*anchor)),
        (Field::Length, Measured::Distance { length, .. }) => Some(Value::Number(*length)),
        _ => None,
    }
}

/// The table of `docs/formats.md`.
#[must_use]
pub fn markdown() -> String {
    let mut out = "| column | unit | of | meaning |\n|---|---|---|---|\n".to_owned();
    for c in &COLUMNS {
        let names = match c.names {
            Names::Fixed(names) => names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", "),
            Names::EachJoint(_) => {
                let first = c.units.iter().map(|u| format!("`{}`", c.name(0, *u))).collect::<Vec<_>>();
                format!("{} ...", first.join(" or "))
            }
        };
        let symbols: Vec<&str> = c.units.iter().map(|u| u.symbol()).collect();
        let kinds = match c.kinds {
            [] => "any".to_owned(),
            kinds => kinds.iter().map(|k| k.word()).collect::<Vec<_>>().join(", "),
        };
        let required = if c.required { ", required" } else { "" };
        let _ = writeln!(out, "| {names} | {} | {kinds}{required} | {} |", symbols.join(" or "), c.meaning);
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_fields_and_every_name_is_found_again() {
        for (number, c) in COLUMNS.iter().enumerate() {
            assert_eq!(c.field as usize, number);
            for k in 0..c.width(MAX_JOINTS) {
                for unit in c.units {
                    let (found, component, its) = find(&c.name(k, *unit)).unwrap();
                    assert_eq!((found.field, component, its), (c.field, k, *unit));
                }
            }
        }
        for name in
            ["q0_deg", "q10_deg", "q1", "q1_nm", "tau1_deg", "dir", "dir1_deg", "q_deg", "bal", "", "q\u{e4}_mm"]
        {
            assert!(find(name).is_none(), "{name}");
        }
    }

    #[test]
    fn messages_name_every_column() {
        let all = known();
        for name in ["t_s", "place", "q1_deg (or q1_mm) ...", "tau1_nm ...", "iz_mm", "qw", "anchor", "note"] {
            assert!(all.contains(name), "{name} in {all}");
        }
        assert!(known_kinds().starts_with("ball, ix_mm, iy_mm, iz_mm (touch) or x_mm, y_mm, z_mm (tracker) or d_mm"));
    }
}
