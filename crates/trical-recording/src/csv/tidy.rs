//! CSV files as spreadsheets and loggers write them, made into those of `docs/formats.md` where the meaning is certain.

use std::borrow::Cow;

use super::lines::holds;
use crate::columns;

/// Separators that are known, beside the comma, and what is said of them.
const SEPARATORS: [(char, &str); 2] = [(';', "columns are separated by semicolons"), ('\t', TABS)];
const TABS: &str = "columns are separated by tabs";
const SPACES: &str = "columns are separated by spaces";

/// What joints are called, beside q, in names that say a unit.
const JOINTS: [&str; 5] = ["q", "j", "joint", "axis", "theta"];

/// Units as people write them, and as they end the names of columns.
const UNITS: [(&[&str], &str); 8] = [
    (&["°", "º", "degree", "degrees"], "deg"),
    (&["radian", "radians"], "rad"),
    (&["millimeter", "millimetre"], "mm"),
    (&["meter", "metre"], "m"),
    (&["sec", "seconds"], "s"),
    (&["°c", "degc"], "c"),
    (&["n m", "n*m", "n·m"], "nm"),
    (&["-", "1"], ""),
];

/// Names that an index column has.
const INDEX: [&str; 4] = ["", "index", "unnamed: 0", "#"];

/// How a file is written.
struct Form {
    by: char,
    /// What is said of the separator, where it is no comma.
    separated: Option<&'static str>,
    /// Of its columns, as they are known.
    names: Vec<String>,
    /// Whether the first column only counts the rows.
    index: bool,
    /// Whether every line ends with a separator, behind which there is nothing.
    trailing: bool,
    /// Whether the line below the header says the units of the columns.
    units: bool,
}

impl Form {
    fn of(text: &str) -> Self {
        let header = header(text).trim_start_matches('#');
        let separator = SEPARATORS.into_iter().find(|(c, _)| header.contains(*c) && !header.contains(','));
        let by = separator.map_or(',', |(c, _)| c);
        let mut names: Vec<String> = cells(header, by).map(known_name).collect();
        let trailing = names.len() > 1
            && names.last().is_some_and(String::is_empty)
            && text
                .lines()
                .all(|l| is_remark(l) || l.trim().is_empty() || l.trim_end_matches(['\r', ' ']).ends_with(by));
        names.truncate(names.len() - usize::from(trailing));
        let said = lines_of_table(text).nth(1).and_then(|line| with_units(&names, cells(line, by)));
        let (units, names) = (said.is_some(), said.unwrap_or(names));
        let index = has_index(text, by, &names, 1 + usize::from(units));
        Self { by, separated: separator.map(|(_, says)| says), index, trailing, units, names }
    }

    fn is_blank(&self, line: &str) -> bool {
        line.chars().all(|c| c == self.by || c.is_whitespace())
    }

    /// Whether the text is as it should be already.
    fn is_tidy(&self, text: &str) -> bool {
        self.separated.is_none()
            && !self.index
            && !self.trailing
            && !self.units
            && cells(header(text), self.by).map(|n| n.trim().trim_matches('"').trim()).eq(self.names.iter())
            && {
                let (first, below) = text.split_at(text.find('\n').map_or(text.len(), |at| at + 1));
                let is_row = |l: &str| !self.is_blank(l) && !is_remark(l);
                first.lines().all(is_row) && (are_numbers(below) || below.lines().all(is_row))
            }
    }

    /// Whether a column of a file whose separator is no comma holds numbers.
    fn is_number(&self, k: usize) -> bool {
        self.by != ',' && self.names.get(k).is_none_or(|name| name != "place")
    }

    /// Refuses a file whose numbers have decimal commas and points: one of the two divides thousands.
    fn check_decimals(&self, text: &str) -> Result<(), String> {
        if self.by == ',' {
            return Ok(());
        }
        let mut found: [Option<&str>; 2] = [None; 2];
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !is_remark(line)) {
            for (_, cell) in cells(line, self.by).enumerate().filter(|(k, _)| self.is_number(*k)) {
                let cell = cell.trim().trim_matches('"');
                let point = cell.contains('.') && cell.parse::<f64>().is_ok();
                if !point && !decimal_comma(cell) {
                    continue;
                }
                found[usize::from(point)].get_or_insert(cell);
                if let [Some(comma), Some(point)] = found {
                    return Err(format!(
                        "line {}: found numbers with a comma and with a point, '{comma}' and '{point}'; expected one decimal mark, and none \
                         between thousands",
                        number + 1
                    ));
                }
            }
        }
        Ok(())
    }

    /// Adds a line, `headed` where it is not the header, and what was done to it.
    fn copy(&self, line: &str, headed: bool, out: &mut String, done: &mut Vec<&'static str>) {
        let first = usize::from(self.index);
        let line = if headed { line } else { line.trim_start_matches('#') };
        let count = cells(line, self.by).count() - usize::from(self.trailing);
        for (k, cell) in cells(line, self.by).enumerate().take(count).skip(first) {
            if k > first {
                out.push(',');
            }
            match (headed, self.names.get(k)) {
                (false, Some(name)) => {
                    let cell = cell.trim().trim_matches('"');
                    if name.as_str() != cell {
                        let lower = *name == cell.to_lowercase();
                        note(done, if lower { LOWER } else { "names of columns are read as q1_deg, x_mm" });
                    }
                    out.push_str(name);
                }
                _ if self.is_number(k) && decimal_comma(cell) => {
                    note(done, "decimal commas are read as points");
                    out.push_str(&cell.replace(',', "."));
                }
                // a comma that is no decimal one must not become a separator
                _ if self.by != ',' && cell.contains(',') && !cell.contains('"') => {
                    out.push('"');
                    out.push_str(cell);
                    out.push('"');
                }
                _ => out.push_str(cell),
            }
        }
        out.push('\n');
    }
}

/// Whether each line begins with a number: then it is neither blank nor a remark.
pub(super) fn are_numbers(text: &str) -> bool {
    let is_other = |b: &u8| !b.is_ascii_digit() & (*b != b'-');
    let ends = text.as_bytes().iter().zip(text.as_bytes().iter().skip(1));
    !text.bytes().take(1).any(|b| is_other(&b))
        && !ends.fold(false, |other, (a, b)| other | ((*a == b'\n') & is_other(b)))
}

const LOWER: &str = "names of columns are read in lower case";

/// Header, rows.
fn lines_of_table(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|l| !l.trim().is_empty() && !is_remark(l))
}

fn header(text: &str) -> &str {
    lines_of_table(text).next().unwrap_or("")
}

/// The names with the units of the line below them, where it holds nothing but units and none that a name contradicts.
fn with_units<'a>(names: &[String], line: impl Iterator<Item = &'a str>) -> Option<Vec<String>> {
    let bare = |cell: &str| cell.trim().trim_matches(['"', '[', ']', '(', ')']).trim().to_lowercase();
    let units: Vec<String> = line.map(bare).collect();
    let known = |unit: &String| {
        UNITS.iter().any(|(written, known)| written.contains(&unit.as_str()) || known == unit) || unit == "kg"
    };
    let mm_or_deg = ["mm", "m", "deg", "rad", "°", "degree", "degrees", "radian"];
    if units.len() < names.len()
        || !units.iter().all(|unit| unit.is_empty() || known(unit))
        || !units.iter().any(|unit| mm_or_deg.contains(&unit.as_str()))
    {
        return None;
    }
    let one = |(name, unit): (&String, &String)| {
        let said = with_unit(&format!("{} [{unit}]", name.to_lowercase()));
        let (of_unit, has_own) = (unit.is_empty() || unit == "-" || unit == "1", columns::find(name).is_some());
        match said {
            // "q1" and "deg"
            Some(whole) if !has_own => Some(whole),
            _ if of_unit || !has_own => Some(name.clone()),
            // "q1_deg" and "deg"
            _ => {
                let stem = name.rsplit_once('_').map_or(name.as_str(), |(stem, _)| stem);
                with_unit(&format!("{stem} [{unit}]")).filter(|whole| whole == name)
            }
        }
    };
    names.iter().zip(&units).map(one).collect()
}

/// The text with a tab in place of each run of spaces, where its header has no other separator: a recording has more than one column. What a
/// cell with a space, or none at all, does to its line is refused by the number of its fields.
fn with_tabs(text: &str) -> Option<String> {
    let head = header(text);
    let spaces = !head.contains([',', ';', '\t']) && head.trim_start_matches('#').split_whitespace().nth(1).is_some();
    let tabs = |line: &str| match line.strip_prefix('#') {
        _ if is_remark(line) => line.to_owned(),
        Some(head) => format!("#{}", tabs_between(head)),
        None => tabs_between(line),
    };
    spaces.then(|| text.split('\n').map(tabs).collect::<Vec<_>>().join("\n"))
}

fn tabs_between(line: &str) -> String {
    line.split_whitespace().collect::<Vec<_>>().join("\t")
}

/// The cells of a line; what is quoted is not divided.
fn cells(line: &str, by: char) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    line.split(move |c| {
        quoted ^= c == '"';
        c == by && !quoted
    })
}

/// A line that is none of the table: "# measured on Monday", "sep=;". Behind the same sign a header stands, too ("# q1_deg,q2_deg").
fn is_remark(line: &str) -> bool {
    let Some(rest) = line.strip_prefix('#') else { return line.starts_with("sep=") && line.trim_end().len() == 5 };
    // "#N/A" is where the first column has no value
    if line.split([',', ';', '\t']).next().is_some_and(|cell| super::is_nothing(cell.trim())) {
        return false;
    }
    let named = |names: &mut dyn Iterator<Item = &str>| {
        let names: Vec<String> = names.map(known_name).collect();
        columns::is_recording(names.iter().map(String::as_str))
    };
    let separated = |by: char| rest.starts_with(by) || named(&mut rest.split(by));
    ![',', ';', '\t'].into_iter().any(separated) && !named(&mut rest.split_whitespace())
}

/// The text of a file, its lines ending with \n, and what was done for it; `None` where it is none.
pub(super) fn decoded(bytes: &[u8]) -> Option<(Cow<'_, str>, Option<&'static str>)> {
    let wide = |of: fn([u8; 2]) -> u16| {
        let units = bytes.get(2..)?.chunks_exact(2).map(|b| of([b[0], b[1]]));
        char::decode_utf16(units).collect::<Result<String, _>>().ok()
    };
    let (text, note) = match bytes {
        [0xff, 0xfe, ..] => (Cow::Owned(wide(u16::from_le_bytes)?), Some("the text is in UTF-16")),
        [0xfe, 0xff, ..] => (Cow::Owned(wide(u16::from_be_bytes)?), Some("the text is in UTF-16")),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => (Cow::Borrowed(text.strip_prefix('\u{feff}').unwrap_or(text)), None),
            // of recordings only the sign of degrees and what people remark are not ASCII
            Err(_) if bytes.iter().any(|b| *b < b'\t') => return None,
            Err(_) => (Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()), Some("the text is in Latin-1")),
        },
    };
    if holds(text.as_bytes(), 0) {
        return None;
    }
    if !text.contains('\n') && text.contains('\r') {
        return Some((Cow::Owned(text.replace('\r', "\n")), note));
    }
    Some((text, note))
}

fn note(done: &mut Vec<&'static str>, what: &'static str) {
    if !done.contains(&what) {
        done.push(what);
    }
}

/// The names of the columns, as they are known.
pub(super) fn names(text: &str) -> Vec<String> {
    Form::of(with_tabs(text).as_deref().unwrap_or(text)).names
}

/// A text made tidy.
pub(super) struct Tidied<'a> {
    pub text: Cow<'a, str>,
    /// Lines before the header that are left out.
    pub before: usize,
    /// What was done, in one sentence, where anything was.
    pub note: Option<String>,
}

/// The text with commas and decimal points, column names as they are known, without an index column; line numbers stay from
/// the header on.
///
/// # Errors
/// One sentence, where its meaning is not certain.
pub(super) fn tidied(text: &str) -> Result<Tidied<'_>, String> {
    if let Some(tabs) = with_tabs(text) {
        let Tidied { text, before, note } = tidied(&tabs)?;
        return Ok(Tidied { text: Cow::Owned(text.into_owned()), before, note: note.map(|n| n.replace(TABS, SPACES)) });
    }
    let form = Form::of(text);
    // a quoted cell that goes on in the next line: such a file is read as it is
    let goes_on =
        holds(text.as_bytes(), b'"') && text.lines().any(|l| !is_remark(l) && l.matches('"').count() % 2 == 1);
    if goes_on && form.separated.is_none() || form.is_tidy(text) {
        return Ok(Tidied { text: Cow::Borrowed(text), before: 0, note: None });
    }
    form.check_decimals(text)?;
    let mut done: Vec<&str> = Vec::new();
    let mut out = String::with_capacity(text.len());
    let (mut headed, mut before) = (false, 0);
    let mut units = form.units;
    for line in text.split('\n') {
        let line = line.strip_suffix('\r').unwrap_or(line);
        let remark = is_remark(line);
        if form.is_blank(line) || remark {
            if remark {
                note(&mut done, "remarks (# ...) are left out");
            } else if !line.is_empty() {
                note(&mut done, "lines without a value are left out");
            }
            before += usize::from(!headed);
            if headed {
                // a reader counts lines with a blank, not those without
                out.push_str(" \n");
            }
            continue;
        }
        if headed && std::mem::take(&mut units) {
            out.push_str(" \n");
            note(&mut done, "the line below the header says the units");
            continue;
        }
        form.copy(line, headed, &mut out, &mut done);
        headed = true;
    }
    done.extend(form.separated);
    done.extend(form.index.then_some("the first column is an index and is left out"));
    done.extend(form.trailing.then_some("the last column is empty and is left out"));
    Ok(Tidied { text: Cow::Owned(out), before, note: (!done.is_empty()).then(|| done.join("; ")) })
}

/// A column's name as it is known: as it stands, in lower case, or with its unit in brackets ("X [mm]", "Joint 1 (rad)").
fn known_name(cell: &str) -> String {
    let name = cell.trim().trim_matches('"').trim();
    let lower = name.to_lowercase();
    let known = [name, &lower].into_iter().find(|name| columns::find(name).is_some()).map(str::to_owned);
    known.or_else(|| with_unit(&lower)).unwrap_or_else(|| name.to_owned())
}

/// The known name of "x [mm]", "joint 1 (°)", "j1_rad": of nothing that does not say its unit.
fn with_unit(lower: &str) -> Option<String> {
    let (stem, unit) = match lower.strip_suffix([')', ']']) {
        Some(open) => open.rsplit_once(['(', '[']),
        None => lower.rsplit_once('_'),
    }?;
    let (stem, unit) = (stem.trim_end_matches([' ', '_']), unit.trim());
    let unit = UNITS.iter().find(|(written, _)| written.contains(&unit)).map_or(unit, |(_, known)| known);
    let joint = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let is_joint = joint.len() < stem.len() && JOINTS.contains(&joint.trim_end_matches([' ', '_']));
    let stem = if is_joint { format!("q{}", &stem[joint.len()..]) } else { stem.replace(' ', "_") };
    let name = if unit.is_empty() { stem } else { format!("{stem}_{unit}") };
    columns::find(&name).map(|_| name)
}

/// "3,14", with or without a sign and an exponent.
fn decimal_comma(cell: &str) -> bool {
    let cell = cell.trim().trim_matches('"');
    cell.matches(',').count() == 1 && cell.replace(',', ".").parse::<f64>().is_ok()
}

/// Whether the first column counts the rows: 0, 1, 2 or 1, 2, 3, under a name that says no more.
fn has_index(text: &str, by: char, names: &[String], above: usize) -> bool {
    if !names.first().is_some_and(|n| INDEX.contains(&n.to_lowercase().as_str())) {
        return false;
    }
    let rows = text.lines().filter(|l| !is_remark(l) && !l.chars().all(|c| c == by || c.is_whitespace())).skip(above);
    let mut first = None;
    for (k, line) in rows.enumerate() {
        let Some(n) = cells(line, by).next().and_then(|c| c.trim().trim_matches('"').parse::<usize>().ok()) else {
            return false;
        };
        if n != k + *first.get_or_insert(n) || n > k + 1 {
            return false;
        }
    }
    first.is_some()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]

    use super::*;
    use crate::csv::parse_csv;

    const PLAIN: &str = "t_s,q1_deg,q2_deg,x_mm,y_mm,z_mm\n0,1.5,-2.5,100.25,0,3\n1,2.5,3.5,101,0,4\n";

    #[test]
    fn a_plain_file_is_not_touched() {
        assert!(matches!(tidied(PLAIN), Ok(Tidied { text: Cow::Borrowed(_), before: 0, note: None })));
    }

    #[test]
    fn what_spreadsheets_write_is_read_with_one_note() {
        let plain = parse_csv(PLAIN.as_bytes(), "r.csv", 2).expect("plain").rows;
        let german = PLAIN.replace(',', ";").replace('.', ",");
        let tabs = PLAIN.replace(',', "\t");
        let upper = PLAIN.replacen("t_s,q1_deg", "T_s,Q1_DEG", 1);
        let index = PLAIN.replacen("t_s", ",t_s", 1).replace("\n0,", "\n0,0,").replace("\n1,", "\n1,1,");
        let blank = PLAIN.replace("\n1,", "\n\n,,,,,\n1,");
        let brackets = PLAIN.replacen("q1_deg,q2_deg,x_mm", "Joint 1 (°),J2 [deg],X [mm]", 1);
        let units = PLAIN.replacen("q1_deg,q2_deg,x_mm", "axis_1_deg,theta2_deg,X (millimetre)", 1);
        let remarks = format!("# Monday, in the hall\n{}", PLAIN.replace("\n1,", "\n# a pause\n1,"));
        let savetxt = format!("# {PLAIN}");
        let excel = format!("sep=;\r\n{}", german.replace('\n', "\r\n").replace("-2,5", "\"-2,5\""));
        let trailing = PLAIN.replace('\n', ",\n");
        let mac = PLAIN.replace('\n', "\r");
        let spaces = PLAIN.replace(',', " ");
        let aligned = PLAIN.replace(',', "   ").replace("\n1", " \n  1").replace('.', ",");
        let savetxt_spaces = format!("# {spaces}");
        let quoted =
            |text: &str| text.lines().map(|l| format!("\"{}\"\n", l.replace(',', "\",\""))).collect::<String>();
        let quoted_index = quoted(PLAIN)
            .replacen('"', "\"\",\"", 1)
            .replace("\n\"0", "\n\"1\",\"0")
            .replace("\n\"1\",\"2", "\n\"2\",\"1\",\"2");
        let quoted_brackets = quoted(&brackets);
        let quoted_remark = format!("# in the \"hall\", by 5\" flanges\n{PLAIN}");
        let quoted_units =
            quoted(&PLAIN.replacen("x_mm,y_mm,z_mm", "x,y,z", 1).replacen('\n', "\ns,deg,deg,mm,mm,mm\n", 1));
        for (text, says) in [
            (brackets.as_str(), "as q1_deg, x_mm"),
            (&units, "as q1_deg, x_mm"),
            (&remarks, "remarks"),
            (&savetxt, ""),
            (&spaces, "columns are separated by spaces"),
            (&aligned, "decimal commas; separated by spaces"),
            (&savetxt_spaces, "separated by spaces"),
            (&excel, "remarks; decimal commas"),
            (&trailing, "the last column is empty"),
            (&mac, ""),
            (&quoted_index, "is an index"),
            (&quoted_brackets, "as q1_deg, x_mm"),
            (&quoted_remark, "remarks"),
            (&quoted_units, "says the units"),
            (german.as_str(), "semicolons; decimal commas"),
            (&tabs, "separated by tabs"),
            (&upper, "lower case"),
            (&index, "is an index"),
            (&blank, "lines without a value"),
        ] {
            let read = parse_csv(format!("\u{feff}{text}").as_bytes(), "r.csv", 2).expect(says);
            assert_eq!(read.notes.len(), usize::from(!says.is_empty()), "{says}: {:?}", read.notes);
            for word in says.split("; ").filter(|word| !word.is_empty()) {
                assert!(read.notes[0].contains(word), "{says}: {:?}", read.notes);
            }
            let same = |a: &trical_model::Row, b: &trical_model::Row| a.state == b.state && a.measured == b.measured;
            assert!(read.rows.iter().zip(&plain).all(|(a, b)| same(a, b)) && read.rows.len() == 2, "{says}");
        }
        for (bytes, says) in [
            (PLAIN.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>(), &[0xff_u8, 0xfe][..]),
            (PLAIN.encode_utf16().flat_map(u16::to_be_bytes).collect(), &[0xfe, 0xff]),
        ] {
            // the number of joints is read from the header, too
            let read = crate::open::parse("r.csv", &[says, &bytes].concat()).expect("UTF-16");
            assert!(read.rows.len() == 2 && read.notes == ["r.csv: the text is in UTF-16"], "{:?}", read.notes);
        }
        let latin =
            [b"t_s,q1[\xb0],q2[\xb0],x_mm,y_mm,z_mm".as_slice(), &PLAIN.as_bytes()[PLAIN.find('\n').unwrap()..]]
                .concat();
        let read = parse_csv(&latin, "r.csv", 2).expect("Latin-1");
        assert_eq!(read.notes, ["r.csv: the text is in Latin-1; names of columns are read as q1_deg, x_mm"]);
        // errors name the line of the file
        let wrong = PLAIN.replace(',', ";").replace(";3.5;", ";x;").replace("\n1", "\n\n1");
        let error = parse_csv(wrong.as_bytes(), "r.csv", 2).expect_err("x is no number").to_string();
        assert!(error.contains("line 4, column q2_deg: found 'x'"), "{error}");
        let wrong = format!("# Monday\n\n{}", PLAIN.replace(",3.5,", ",x,"));
        let error = parse_csv(wrong.as_bytes(), "r.csv", 2).expect_err("x is no number").to_string();
        assert!(error.contains("line 5, column q2_deg: found 'x'"), "{error}");
    }

    #[test]
    fn what_is_not_certain_is_not_guessed() {
        let says =
            |text: &str| parse_csv(text.as_bytes(), "r.csv", 2).map(|r| r.notes).expect_err("refused").to_string();
        // thousands or decimals?
        let both = PLAIN.replace(',', ";").replace("100.25", "1,100.25");
        assert!(says(&both).contains("found '1,100.25'"), "{}", says(&both));
        for by in [";", "\t"] {
            let comma = PLAIN.replace(',', by).replace("101", "1,101");
            assert!(
                says(&comma).contains("line 3: found numbers with a comma and with a point, '1,101' and"),
                "{}",
                says(&comma)
            );
            let point = PLAIN.replace(',', by).replace('.', ",").replace("101", "1.101");
            assert!(says(&point).contains("one decimal mark, and none between thousands"), "{}", says(&point));
        }
        let some = PLAIN.replace(",0,4\n", ",0,4,\n");
        assert!(
            says(&some).contains("found 7 fields, expected 6 as in the header; there is nothing behind"),
            "{}",
            says(&some)
        );
        for time in ["1700000000.5", "2026-01-01T00:00:01"] {
            let clock = PLAIN.replace("\n1,", &format!("\n{time},"));
            assert!(says(&clock).contains("seconds since the recording began; subtract the first"), "{}", says(&clock));
        }
        // a first column that does not count, and all columns that are not known
        let named =
            PLAIN.replacen("t_s", "index,colour,t_s", 1).replace("\n0,", "\n7,red,0,").replace("\n1,", "\n7,red,1,");
        assert!(says(&named).contains("unknown columns 'index', 'colour'"), "{}", says(&named));
        // a cell that is empty, or has a space in it, moves those behind it
        let spaces = PLAIN.replace(',', " ");
        for (line, fields) in [("1 2.5 3.5 101 4", 5), ("1 2.5 3.5 101 by the 4", 7)] {
            let moved = spaces.replace("1 2.5 3.5 101 0 4", line);
            let expected = format!("line 3: found {fields} fields, expected 6 as in the header");
            assert!(says(&moved).contains(&expected), "{}", says(&moved));
        }
        let named = spaces.replacen("x_mm", "X [mm]", 1);
        assert!(says(&named).contains("unknown columns 'X', '[mm]'; known are"), "{}", says(&named));
        // no header at all
        let bare = PLAIN.split_once('\n').expect("two lines").1;
        assert!(says(bare).contains("header: found numbers, expected names of columns"), "{}", says(bare));
    }

    #[test]
    fn a_line_of_units_below_the_header_says_what_names_do_not() {
        let plain = parse_csv(PLAIN.as_bytes(), "r.csv", 2).expect("plain").rows;
        let (_, rows) = PLAIN.split_once('\n').expect("two lines");
        for head in [
            "t,q1,q2,x,y,z\ns,deg,deg,mm,mm,mm",
            "t_s,q1_deg,q2_deg,x_mm,y_mm,z_mm\ns,deg,deg,mm,mm,mm",
            "t_s,q1_deg,q2_deg,x_mm,y_mm,z_mm\n,[deg],[deg],[mm],[mm],[mm]",
            "t,Joint 1,Joint 2,X,Y,Z\n[s],[\u{b0}],[\u{b0}],[mm],[mm],[mm]",
        ] {
            let text = format!("{head}\n{rows}");
            let read = crate::open::parse("r.csv", text.as_bytes()).expect(head);
            assert!(read.notes.len() == 1 && read.notes[0].contains("says the units"), "{:?}", read.notes);
            let same = |a: &trical_model::Row, b: &trical_model::Row| a.state == b.state && a.measured == b.measured;
            assert!(read.rows.iter().zip(&plain).all(|(a, b)| same(a, b)) && read.rows.len() == 2, "{head}");
            let wrong = parse_csv(text.replace(",3.5,", ",x,").as_bytes(), "r.csv", 2).expect_err("x").to_string();
            assert!(wrong.contains("line 4, column q2_deg: found 'x'"), "{wrong}");
        }
        let metres = "t,q1,q2,x,y,z\ns,rad,rad,m,m,m\n0,0.1,0.2,0.3,0.4,0.5\n";
        let read = crate::open::parse("r.csv", metres.as_bytes()).expect("SI");
        let at = trical_model::Measured::Point { target: 0, position: [0.3, 0.4, 0.5] };
        assert!(read.rows[0].state.q[..2] == [0.1, 0.2] && read.rows[0].measured == at, "{:?}", read.rows);
        // names that say another unit, no unit at all
        let says = |text: &str| crate::open::parse("r.csv", text.as_bytes()).expect_err("refused").to_string();
        let other = format!("t_s,q1_deg,q2_deg,x_mm,y_mm,z_mm\ns,rad,rad,mm,mm,mm\n{rows}");
        assert!(says(&other).contains("line 2, column q1_deg: found 'rad'"), "{}", says(&other));
        let none = format!("t,q1,q2,x,y,z\n{rows}");
        assert!(says(&none).contains("no unit in the name of columns 't' (t_s?), 'q1' (q1_deg?)"), "{}", says(&none));
    }

    #[test]
    fn a_row_is_one_measurement_of_one_thing() {
        let says = |head: &str, row: &str| {
            let text = format!("q1_deg,q2_deg,{head}\n1,2,{row}\n");
            parse_csv(text.as_bytes(), "r.csv", 2).map(|r| r.rows[0].measured).map_err(|e| e.to_string())
        };
        for (head, row, told) in [
            (
                "ball,ix_mm,iy_mm,iz_mm,x_mm,y_mm,z_mm",
                "1,0,0,0,3,4,5",
                "column ball: found a touch and a position in one row",
            ),
            ("d_mm,x_mm,y_mm,z_mm", "500,3,4,5", "column d_mm: found a length and a position in one row"),
            ("ball,ix_mm,iy_mm,iz_mm,d_mm", "1,0,0,0,500", "column ball: found a touch and a length in one row"),
            ("d_mm,target", "500,2", "column target: found '2' beside what is no position"),
            ("x_mm,y_mm,z_mm,anchor", "3,4,5,2", "header: column anchor is there, but d_mm is missing"),
            (
                "x_mm,y_mm,z_mm,qw,qx,qy,qz,target",
                "3,4,5,1,0,0,0,2",
                "column target: found target 2 with an orientation",
            ),
        ] {
            let error = says(head, row).expect_err(told);
            assert!(error.contains(told), "{error}");
        }
        let oriented =
            |last: &str, k: &str| says(&format!("x_mm,y_mm,z_mm,qw,qx,qy,qz,{last}"), &format!("3,4,5,1,0,0,0,{k}"));
        let position = [0.003, 0.004, 0.005];
        let near = |m: trical_model::Measured| match m {
            trical_model::Measured::Reference { reference: 1, position: p } => {
                p.iter().zip(position).all(|(a, b)| (a - b).abs() < 1e-12)
            }
            _ => false,
        };
        assert!(near(oriented("reference", "2").expect("a reference")));
        assert!(matches!(oriented("target", "1"), Ok(trical_model::Measured::Pose { .. })));
    }

    #[test]
    fn what_begins_with_the_sign_of_remarks_is_a_row_where_it_says_that_nothing_is_known() {
        let text = PLAIN.replace("\n1,", "\n#N/A,");
        assert_eq!(parse_csv(text.as_bytes(), "r.csv", 2).expect("two rows").rows.len(), 2);
        // and the name of a place comes back, whatever it begins with; marks for nothing are no places
        let text = "place,q1_deg,q2_deg,x_mm,y_mm,z_mm\n\"#1\",1,2,3,4,5\nNaN,1,2,3,4,5\n-,1,2,3,4,5\n";
        let read = parse_csv(text.as_bytes(), "r.csv", 2).expect("three rows");
        assert_eq!(read.places, ["#1"]);
        let written = crate::to_csv(&read).expect("written");
        let again = parse_csv(&written, "r.csv", 2).expect("three rows");
        assert_eq!((again.rows.len(), &again.places), (3, &read.places), "{}", String::from_utf8_lossy(&written));
    }

    #[test]
    fn rows_without_a_measured_value_are_left_out_and_said_and_joints_are_not_guessed() {
        for mark in ["", "NaN", "NA", "-", "n/a", "null"] {
            let text = PLAIN.replace(",101,0,", &format!(",101,{mark},"));
            let read = parse_csv(text.as_bytes(), "r.csv", 2).expect(mark);
            assert_eq!(read.rows.len(), 1, "{mark}");
            assert_eq!(read.notes, ["r.csv: line 3 lacks a measured value and is left out"], "{mark}");
            let joint = PLAIN.replace(",3.5,", &format!(",{mark},"));
            let error = parse_csv(joint.as_bytes(), "r.csv", 2).expect_err(mark).to_string();
            assert!(
                error.contains(&format!("line 3, column q2_deg: found '{mark}', expected a finite number")),
                "{error}"
            );
            // a time that is not known is not needed
            let time = PLAIN.replace("\n1,", &format!("\n{mark},"));
            assert_eq!(parse_csv(time.as_bytes(), "r.csv", 2).expect(mark).rows.len(), 2);
        }
        // half a quaternion is no point
        let poses = "q1_deg,q2_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,2,3,4,5,1,0,0,0\n1,3,3,4,5,,0,0,1\n1,4,3,4,5,,,,\n";
        let read = parse_csv(poses.as_bytes(), "r.csv", 2).expect("two rows");
        assert_eq!((read.rows.len(), read.notes.len()), (2, 1), "{:?}", read.notes);
        // a reading whose ball nobody wrote down
        let touch = "ball,q1_deg,q2_deg,ix_mm,iy_mm,iz_mm\n1,2,3,0,0,0\n,2,4,0,0,0.01\n";
        let error = parse_csv(touch.as_bytes(), "r.csv", 2).expect_err("no ball").to_string();
        assert!(error.contains("line 3, column ball: found '', expected the ball that was touched"), "{error}");
        let none = parse_csv(PLAIN.replace(",0,", ",,").as_bytes(), "r.csv", 2).expect_err("none").to_string();
        assert!(none.contains("has no row with a measured value"), "{none}");
    }

    #[test]
    fn a_quoted_cell_between_semicolons_stays_as_it_is() {
        let text = "q1_deg;q2_deg;place;x_mm;y_mm;z_mm\n1,5;2;\"left, by the door\";3;4;5\n2,5;2;right;3;4;5\n";
        let read = parse_csv(text.as_bytes(), "r.csv", 2).expect("two rows");
        assert_eq!(read.places, ["left, by the door", "right"]);
    }
}
