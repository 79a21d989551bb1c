//! Recordings as CSV: one row per measurement, columns known by name (the contract is in `formats.md`).

use std::io::Read as _;
use std::path::Path;

use trical_model::error::shortened;
use trical_model::{MAX_JOINTS, Measured, Recording, Row, State};

use crate::error::{IdentError, Result};

/// Columns by their meaning; `None` where the file has no such column.
struct Columns {
    /// Column, and how many SI units one of its own is.
    joints: Vec<(usize, f64)>,
    commanded: Option<Vec<(usize, f64)>>,
    dir: Option<Vec<usize>>,
    t: Option<usize>,
    temp: Option<usize>,
    payload: Option<usize>,
    seq: Option<usize>,
    ball: Option<usize>,
    indicators: Option<[usize; 3]>,
    xyz: Option<[usize; 3]>,
    quaternion: Option<[usize; 4]>,
    target: Option<usize>,
    reference: Option<usize>,
    distance: Option<usize>,
    anchor: Option<usize>,
}

/// No joint turns further than 278 times, and no instrument looks further than a kilometre.
const FAR_DEG: f64 = 1e5;
const FAR_MM: f64 = 1e6;
/// No cell has more balls, targets, references or anchors.
const MOST: f64 = 1e4;

struct Reader<'a> {
    file: &'a str,
    header: Vec<String>,
}

impl Reader<'_> {
    fn error(&self, place: impl Into<String>, problem: impl Into<String>) -> IdentError {
        IdentError::Recording { file: self.file.to_owned(), place: place.into(), problem: problem.into() }
    }

    fn at(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|h| h == name)
    }

    /// All of the named columns, none, or an error that names the first that is missing.
    fn group<const N: usize>(&self, names: [&str; N]) -> Result<Option<[usize; N]>> {
        let mut found = [0; N];
        let mut missing = None;
        let mut count = 0;
        for (slot, name) in found.iter_mut().zip(names) {
            match self.at(name) {
                Some(i) => {
                    *slot = i;
                    count += 1;
                }
                None => missing = missing.or(Some(name)),
            }
        }
        match (count, missing) {
            (0, _) => Ok(None),
            (_, None) => Ok(Some(found)),
            (_, Some(name)) => {
                Err(self
                    .error("header", format!("column {name} is missing; expected all of {} or none", names.join(", "))))
            }
        }
    }

    fn per_joint(&self, joints: usize, name: impl Fn(usize) -> String) -> Result<Option<Vec<usize>>> {
        let found: Vec<Option<usize>> = (1..=joints).map(|k| self.at(&name(k))).collect();
        if let Some(extra) = (joints + 1..=MAX_JOINTS).map(&name).find(|n| self.at(n).is_some()) {
            return Err(self.error("header", format!("column {extra} found, but the robot has {joints} joints")));
        }
        if found.iter().all(Option::is_none) {
            return Ok(None);
        }
        found
            .iter()
            .enumerate()
            .map(|(k, c)| c.ok_or_else(|| self.error("header", format!("column {} is missing", name(k + 1)))))
            .collect::<Result<Vec<_>>>()
            .map(Some)
    }

    /// `q1_deg` or, for a slide, `q1_mm`; each with the size of its unit.
    fn joint_values(&self, joints: usize, prefix: &str) -> Result<Option<Vec<(usize, f64)>>> {
        let name = |k: usize| {
            let (deg, mm) = (format!("{prefix}{k}_deg"), format!("{prefix}{k}_mm"));
            if self.at(&deg).is_none() && self.at(&mm).is_some() { mm } else { deg }
        };
        for k in 1..=MAX_JOINTS {
            if self.at(&format!("{prefix}{k}_deg")).is_some() && self.at(&format!("{prefix}{k}_mm")).is_some() {
                return Err(self.error("header", format!("columns {prefix}{k}_deg and {prefix}{k}_mm are both there")));
            }
        }
        let unit = |k: usize| if name(k).ends_with("_mm") { 1e-3 } else { 1.0_f64.to_radians() };
        let found = self.per_joint(joints, name)?;
        Ok(found.map(|columns| columns.into_iter().enumerate().map(|(k, c)| (c, unit(k + 1))).collect()))
    }

    fn columns(&self, joints: usize) -> Result<Columns> {
        for (i, name) in self.header.iter().enumerate() {
            if !is_known(name) {
                return Err(self.error(
                    "header",
                    format!("unknown column '{}'; known are t_s, seq, q1_deg (or q1_mm) ..., qc1_deg ..., dir1 ..., temp_c, payload_kg, ball, ix_mm, iy_mm, iz_mm, target, reference, x_mm, y_mm, z_mm, qw, qx, qy, qz, d_mm, anchor", shortened(name, 60)),
                ));
            }
            if self.header[..i].contains(name) {
                return Err(self.error("header", format!("column {name} stands there twice")));
            }
        }
        let Some(q) = self.joint_values(joints, "q")? else {
            return Err(self.error(
                "header",
                format!("column q1_deg is missing; expected the joint angles q1_deg to q{joints}_deg"),
            ));
        };
        let c = Columns {
            joints: q,
            commanded: self.joint_values(joints, "qc")?,
            dir: self.per_joint(joints, |k| format!("dir{k}"))?,
            t: self.at("t_s"),
            temp: self.at("temp_c"),
            payload: self.at("payload_kg"),
            seq: self.at("seq"),
            ball: self.at("ball"),
            indicators: self.group(["ix_mm", "iy_mm", "iz_mm"])?,
            xyz: self.group(["x_mm", "y_mm", "z_mm"])?,
            quaternion: self.group(["qw", "qx", "qy", "qz"])?,
            target: self.at("target"),
            reference: self.at("reference"),
            distance: self.at("d_mm"),
            anchor: self.at("anchor"),
        };
        if c.indicators.is_some() != c.ball.is_some() {
            let missing = if c.ball.is_none() { "ball" } else { "ix_mm, iy_mm, iz_mm" };
            return Err(self.error("header", format!("a touch needs ball, ix_mm, iy_mm and iz_mm; {missing} missing")));
        }
        if c.indicators.is_none() && c.xyz.is_none() && c.distance.is_none() {
            return Err(self.error(
                "header",
                "no measurement found; expected ball, ix_mm, iy_mm, iz_mm (touches) or x_mm, y_mm, z_mm (tracker) or d_mm (distances)",
            ));
        }
        Ok(c)
    }
}

fn is_known(name: &str) -> bool {
    const PLAIN: [&str; 22] = [
        "t_s",
        "seq",
        "temp_c",
        "payload_kg",
        "ball",
        "ix_mm",
        "iy_mm",
        "iz_mm",
        "target",
        "reference",
        "x_mm",
        "y_mm",
        "z_mm",
        "qw",
        "qx",
        "qy",
        "qz",
        "d_mm",
        "anchor",
        "order",
        "expected",
        "note",
    ];
    let numbered = |prefix: &str, suffix: &str| {
        name.strip_prefix(prefix)
            .and_then(|s| s.strip_suffix(suffix))
            .is_some_and(|s| s.len() == 1 && s.chars().all(|c| ('1'..='9').contains(&c)))
    };
    PLAIN.contains(&name)
        || ["_deg", "_mm"].iter().any(|unit| numbered("q", unit) || numbered("qc", unit))
        || numbered("dir", "")
}

struct Cells<'a, 'r> {
    reader: &'a Reader<'a>,
    record: &'r csv::StringRecord,
    line: usize,
}

impl Cells<'_, '_> {
    fn text(&self, column: usize) -> &str {
        self.record.get(column).unwrap_or("").trim()
    }

    fn shown(&self, column: usize) -> String {
        shortened(self.text(column), 60)
    }

    fn error(&self, column: usize, problem: String) -> IdentError {
        let name = self.reader.header.get(column).map_or("?", String::as_str);
        self.reader.error(format!("line {}, column {name}", self.line), problem)
    }

    fn empty(&self, column: usize) -> bool {
        self.text(column).is_empty()
    }

    fn number(&self, column: usize) -> Result<f64> {
        match self.text(column).parse::<f64>() {
            Ok(v) if v.is_finite() && v.abs() < 1e9 => Ok(v),
            _ => Err(self.no_number(column)),
        }
    }

    fn no_number(&self, column: usize) -> IdentError {
        self.error(column, format!("found '{}', expected a finite number", self.shown(column)))
    }

    /// A number whose size is that of an arm or an instrument; the unit stands in the column's name.
    fn within(&self, column: usize, limit: f64) -> Result<f64> {
        match self.text(column).parse::<f64>() {
            Ok(v) if v.abs() <= limit => Ok(v),
            Ok(v) if v.is_finite() => {
                Err(self
                    .error(column, format!("found '{}', expected between -{limit} and {limit}", self.shown(column))))
            }
            _ => Err(self.no_number(column)),
        }
    }

    /// A joint's value, deg or mm.
    fn joint(&self, column: usize) -> Result<f64> {
        let slides = self.reader.header.get(column).is_some_and(|h| h.ends_with("_mm"));
        self.within(column, if slides { FAR_MM } else { FAR_DEG })
    }

    /// Places, m.
    fn metres<const N: usize>(&self, columns: [usize; N]) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for (o, c) in out.iter_mut().zip(columns) {
            *o = self.within(c, FAR_MM)? * 1e-3;
        }
        Ok(out)
    }

    fn optional(&self, column: Option<usize>) -> Result<Option<f64>> {
        match column {
            Some(c) if !self.empty(c) => self.number(c).map(Some),
            _ => Ok(None),
        }
    }

    fn count(&self, column: usize) -> Result<usize> {
        let v = self.number(column)?;
        if v.fract() == 0.0 && (1.0..=MOST).contains(&v) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked just above")]
            let n = v as usize;
            Ok(n - 1)
        } else {
            Err(self.error(
                column,
                format!("found '{}', expected a number counted from 1 up to {MOST}", self.shown(column)),
            ))
        }
    }

    fn numbers<const N: usize>(&self, columns: [usize; N], scale: f64) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for (o, c) in out.iter_mut().zip(columns) {
            *o = self.number(c)? * scale;
        }
        Ok(out)
    }

    fn measured(&self, c: &Columns) -> Result<Measured> {
        let filled = |column: Option<usize>| column.filter(|c| !self.empty(*c));
        if let (Some(ball), Some(i)) = (filled(c.ball), c.indicators) {
            return Ok(Measured::Touch { ball: self.count(ball)?, reading: self.metres(i)? });
        }
        if let Some(d) = filled(c.distance) {
            let anchor = filled(c.anchor).map_or(Ok(0), |a| self.count(a))?;
            let [length] = self.metres([d])?;
            if length <= 0.0 {
                return Err(self.error(d, format!("found '{}', expected a positive length", self.shown(d))));
            }
            return Ok(Measured::Distance { anchor, length });
        }
        let Some(xyz) = c.xyz else {
            return Err(self.reader.error(
                format!("line {}", self.line),
                "the row has no measurement: its columns ball or d_mm are empty",
            ));
        };
        let position = self.metres(xyz)?;
        if let Some(q) = c.quaternion
            && !self.empty(q[0])
        {
            let quaternion = self.numbers(q, 1.0)?;
            let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-2 {
                return Err(self.error(q[0], format!("the quaternion has length {norm:.4}, expected 1")));
            }
            return Ok(Measured::Pose { position, quaternion });
        }
        match (filled(c.target), filled(c.reference)) {
            (Some(t), Some(_)) => {
                Err(self.error(t, "the row names a target and a reference, expected one of them".into()))
            }
            (None, Some(r)) => Ok(Measured::Reference { reference: self.count(r)?, position }),
            (Some(t), None) => Ok(Measured::Point { target: self.count(t)?, position }),
            (None, None) => Ok(Measured::Point { target: 0, position }),
        }
    }

    fn row(&self, c: &Columns) -> Result<Row> {
        let mut state = State::at(&[]);
        for (q, (column, unit)) in state.q.iter_mut().zip(&c.joints) {
            *q = self.joint(*column)? * unit;
        }
        if let Some(columns) = &c.commanded
            && !columns.iter().all(|(k, _)| self.empty(*k))
        {
            let mut q = [0.0; MAX_JOINTS];
            for (q, (column, unit)) in q.iter_mut().zip(columns) {
                *q = self.joint(*column)? * unit;
            }
            state.q_commanded = Some(q);
        }
        if let Some(columns) = &c.dir
            && !columns.iter().all(|k| self.empty(*k))
        {
            let mut dir = [0; MAX_JOINTS];
            for (d, column) in dir.iter_mut().zip(columns) {
                *d = match self.number(*column)? {
                    1.0 => 1,
                    0.0 => 0,
                    -1.0 => -1,
                    _ => {
                        return Err(
                            self.error(*column, format!("found '{}', expected -1, 0 or 1", self.shown(*column)))
                        );
                    }
                };
            }
            state.dir = Some(dir);
        }
        state.t = self.optional(c.t)?;
        state.temp_c = self.optional(c.temp)?;
        state.payload_kg = self.optional(c.payload)?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked just above")]
        let seq = match c.seq.filter(|k| !self.empty(*k)) {
            Some(column) => {
                let v = self.number(column)?;
                if v.fract() != 0.0 || v < 0.0 {
                    return Err(self.error(column, format!("found '{v}', expected a whole number")));
                }
                Some(v as u64)
            }
            None => None,
        };
        Ok(Row { state, measured: self.measured(c)?, seq, line: self.line })
    }
}

/// What a header says about the rows below it.
pub(crate) struct Parser<'a> {
    reader: Reader<'a>,
    columns: Columns,
}

impl<'a> Parser<'a> {
    /// Reads a header.
    pub fn new(file: &'a str, header: &csv::StringRecord, joints: usize) -> Result<Self> {
        let reader = Reader { file, header: header.iter().map(|h| h.trim().to_owned()).collect() };
        let columns = reader.columns(joints)?;
        Ok(Self { reader, columns })
    }

    /// Whether the file has fixed references.
    pub fn has_references(&self) -> bool {
        self.columns.reference.is_some()
    }

    /// Hands on every row; lines are counted from `lines_before`.
    pub fn each_row<R: std::io::Read>(
        &self,
        csv: &mut csv::Reader<R>,
        lines_before: usize,
        take: &mut dyn FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let mut record = csv::StringRecord::new();
        loop {
            match csv.read_record(&mut record) {
                Ok(false) => return Ok(()),
                Ok(true) => {}
                Err(e) => {
                    let line = e.position().map_or(0, |p| usize::try_from(p.line()).unwrap_or(0)) + lines_before;
                    return Err(self.reader.error(format!("line {line}"), format!("cannot be read as CSV: {e}")));
                }
            }
            let line = record.position().map_or(0, |p| usize::try_from(p.line()).unwrap_or(0)) + lines_before;
            if record.len() == 1 && record.get(0).is_some_and(|cell| cell.trim().is_empty()) {
                continue;
            }
            if record.len() != self.reader.header.len() {
                return Err(self.reader.error(
                    format!("line {line}"),
                    format!("found {} fields, expected {} as in the header", record.len(), self.reader.header.len()),
                ));
            }
            take(Cells { reader: &self.reader, record: &record, line }.row(&self.columns)?)?;
        }
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
    let error = |problem: String| IdentError::File { file: path.display().to_string(), problem };
    let file = std::fs::File::open(path).map_err(|e| error(format!("cannot be read: {e}")))?;
    let (mut bytes, mut line, mut begin) = (Vec::new(), 1, 0);
    loop {
        let from = bytes.len();
        let read = (&file).take(LONGEST_LINE as u64).read_to_end(&mut bytes);
        if read.map_err(|e| error(format!("cannot be read: {e}")))? == 0 {
            return Ok(bytes);
        }
        for (at, _) in bytes[from..].iter().enumerate().filter(|(_, b)| **b == b'\n') {
            (line, begin) = (line + 1, from + at + 1);
        }
        if bytes.len() - begin > LONGEST_LINE {
            return Err(error(format!(
                "line {line} is longer than {LONGEST_LINE} bytes; expected a recording, one measurement a line"
            )));
        }
    }
}

/// How recordings are read: lines end with \n, a \r before it is blank (the crate counts lines ending with both one too low).
pub fn csv_reader(has_headers: bool) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder.flexible(true).has_headers(has_headers).terminator(csv::Terminator::Any(b'\n'));
    builder
}

/// Reads the bytes of a CSV recording; `file` is its name for messages.
///
/// # Errors
/// As [`load_csv`].
pub fn parse_csv(bytes: &[u8], file: &str, joints: usize) -> Result<Recording> {
    let problem = |p: &str| IdentError::File { file: file.to_owned(), problem: p.to_owned() };
    let text = std::str::from_utf8(bytes).map_err(|_| problem("is not a text file; expected a CSV recording"))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(problem("is empty; expected a CSV recording with a header line"));
    }
    if text.contains('\0') {
        return Err(problem("is not a text file; expected a CSV recording"));
    }
    let mut csv = csv_reader(true).from_reader(text.as_bytes());
    let header = csv.headers().map_err(|e| problem(&format!("the header cannot be read: {e}")))?.clone();
    let parser = Parser::new(file, &header, joints)?;
    let mut rows = Vec::new();
    let mut last_t = f64::NEG_INFINITY;
    parser.each_row(&mut csv, 0, &mut |row| {
        parser.in_order(&row, &mut last_t)?;
        rows.push(row);
        Ok(())
    })?;
    if rows.is_empty() {
        return Err(problem("has a header but no rows"));
    }
    Ok(Recording { name: file.to_owned(), joints, rows })
}
