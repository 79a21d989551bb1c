//! CSV files as spreadsheets and loggers write them, made into those of `docs/formats.md` where the meaning is certain.

use std::borrow::Cow;

use crate::columns;

/// Separators that are known, beside the comma, and what is said of them.
const SEPARATORS: [(char, &str); 2] =
    [(';', "columns are separated by semicolons"), ('\t', "columns are separated by tabs")];

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
}

impl Form {
    fn of(text: &str) -> Self {
        let header = header(text);
        let separator = SEPARATORS.into_iter().find(|(c, _)| header.contains(*c) && !header.contains(','));
        let by = separator.map_or(',', |(c, _)| c);
        let names: Vec<String> = header.split(by).map(known_name).collect();
        Self { by, separated: separator.map(|(_, says)| says), index: has_index(text, by, &names), names }
    }

    fn is_blank(&self, line: &str) -> bool {
        line.chars().all(|c| c == self.by || c.is_whitespace())
    }

    /// Whether the text is as it should be already.
    fn is_tidy(&self, text: &str) -> bool {
        self.separated.is_none()
            && !self.index
            && header(text).split(self.by).map(|n| n.trim().trim_matches('"').trim()).eq(self.names.iter())
            && text.lines().all(|l| !self.is_blank(l))
    }

    /// Adds a line, `headed` where it is not the header, and what was done to it.
    fn copy(&self, line: &str, headed: bool, out: &mut String, done: &mut Vec<&'static str>) {
        let first = usize::from(self.index);
        for (k, cell) in line.split(self.by).enumerate().skip(first) {
            if k > first {
                out.push(',');
            }
            match (headed, self.names.get(k)) {
                (false, Some(name)) => {
                    if name != cell.trim() {
                        note(done, "names of columns are read in lower case");
                    }
                    out.push_str(name);
                }
                _ if self.by != ',' && decimal_comma(cell) => {
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

fn header(text: &str) -> &str {
    text.lines().find(|l| !l.trim().is_empty()).unwrap_or("")
}

fn note(done: &mut Vec<&'static str>, what: &'static str) {
    if !done.contains(&what) {
        done.push(what);
    }
}

/// The text with commas and decimal points, column names as they are known, without an index column; line numbers stay. And
/// what was done, in one sentence, where anything was.
pub(super) fn tidied(text: &str) -> (Cow<'_, str>, Option<String>) {
    let form = Form::of(text);
    // a quoted cell may hold anything: such a file is read as it is
    if text.contains('"') && form.separated.is_none() || form.is_tidy(text) {
        return (Cow::Borrowed(text), None);
    }
    let mut done: Vec<&str> = Vec::new();
    let mut out = String::with_capacity(text.len());
    let mut headed = false;
    for line in text.split('\n') {
        let line = line.strip_suffix('\r').unwrap_or(line);
        if form.is_blank(line) {
            if !line.is_empty() {
                note(&mut done, "lines without a value are left out");
            }
            // where the header is still to come, the number of the line is lost
            if headed {
                // a reader counts lines with a blank, not those without
                out.push_str(" \n");
            }
            continue;
        }
        form.copy(line, headed, &mut out, &mut done);
        headed = true;
    }
    done.extend(form.separated);
    done.extend(form.index.then_some("the first column is an index and is left out"));
    (Cow::Owned(out), (!done.is_empty()).then(|| done.join("; ")))
}

/// A column's name as it is known: as it stands, or in lower case.
fn known_name(cell: &str) -> String {
    let name = cell.trim().trim_matches('"').trim();
    let lower = name.to_lowercase();
    if columns::find(name).is_none() && columns::find(&lower).is_some() { lower } else { name.to_owned() }
}

/// "3,14", with or without a sign and an exponent.
fn decimal_comma(cell: &str) -> bool {
    let cell = cell.trim();
    cell.matches(',').count() == 1 && cell.replace(',', ".").parse::<f64>().is_ok()
}

/// Whether the first column counts the rows: 0, 1, 2 or 1, 2, 3, under a name that says no more.
fn has_index(text: &str, by: char, names: &[String]) -> bool {
    if !names.first().is_some_and(|n| INDEX.contains(&n.to_lowercase().as_str())) {
        return false;
    }
    let rows = text.lines().filter(|l| !l.chars().all(|c| c == by || c.is_whitespace())).skip(1);
    let mut first = None;
    for (k, line) in rows.enumerate() {
        let Some(n) = line.split(by).next().and_then(|c| c.trim().parse::<usize>().ok()) else { return false };
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
        assert!(matches!(tidied(PLAIN), (Cow::Borrowed(_), None)));
    }

    #[test]
    fn what_spreadsheets_write_is_read_with_one_note() {
        let plain = parse_csv(PLAIN.as_bytes(), "r.csv", 2).expect("plain").rows;
        let german = PLAIN.replace(',', ";").replace('.', ",");
        let tabs = PLAIN.replace(',', "\t");
        let upper = PLAIN.replacen("t_s,q1_deg", "T_s,Q1_DEG", 1);
        let index = PLAIN.replacen("t_s", ",t_s", 1).replace("\n0,", "\n0,0,").replace("\n1,", "\n1,1,");
        let blank = PLAIN.replace("\n1,", "\n\n,,,,,\n1,");
        for (text, says) in [
            (german.as_str(), "semicolons; decimal commas"),
            (&tabs, "separated by tabs"),
            (&upper, "lower case"),
            (&index, "is an index"),
            (&blank, "lines without a value"),
        ] {
            let read = parse_csv(format!("\u{feff}{text}").as_bytes(), "r.csv", 2).expect(says);
            assert_eq!(read.notes.len(), 1, "{says}");
            for word in says.split("; ") {
                assert!(read.notes[0].contains(word), "{says}: {:?}", read.notes);
            }
            let same = |a: &trical_model::Row, b: &trical_model::Row| a.state == b.state && a.measured == b.measured;
            assert!(read.rows.iter().zip(&plain).all(|(a, b)| same(a, b)) && read.rows.len() == 2, "{says}");
        }
        // errors name the line of the file
        let wrong = PLAIN.replace(',', ";").replace(";3.5;", ";x;").replace("\n1", "\n\n1");
        let error = parse_csv(wrong.as_bytes(), "r.csv", 2).expect_err("x is no number").to_string();
        assert!(error.contains("line 4, column q2_deg: found 'x'"), "{error}");
    }

    #[test]
    fn what_is_not_certain_is_not_guessed() {
        let says =
            |text: &str| parse_csv(text.as_bytes(), "r.csv", 2).map(|r| r.notes).expect_err("refused").to_string();
        // thousands or decimals?
        let both = PLAIN.replace(',', ";").replace("100.25", "1,100.25");
        assert!(says(&both).contains("found '1,100.25'"), "{}", says(&both));
        // a first column that does not count, and all columns that are not known
        let named =
            PLAIN.replacen("t_s", "index,colour,t_s", 1).replace("\n0,", "\n7,red,0,").replace("\n1,", "\n7,red,1,");
        assert!(says(&named).contains("unknown columns 'index', 'colour'"), "{}", says(&named));
        // no header at all
        let bare = PLAIN.split_once('\n').expect("two lines").1;
        assert!(says(bare).contains("header: found numbers, expected names of columns"), "{}", says(bare));
    }
}
