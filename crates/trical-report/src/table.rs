//! Plain text tables.

/// Lines of a table: the first row is the header; the first column is left-aligned, the others right.
pub fn lines(rows: &[Vec<String>]) -> Vec<String> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width: Vec<usize> = (0..columns)
        .map(|c| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max().unwrap_or(0))
        .collect();
    rows.iter()
        .map(|r| {
            let cells: Vec<String> = r
                .iter()
                .enumerate()
                .map(|(c, s)| {
                    let pad = " ".repeat(width[c].saturating_sub(s.chars().count()));
                    if c == 0 { format!("{s}{pad}") } else { format!("{pad}{s}") }
                })
                .collect();
            format!("  {}", cells.join("  ")).trim_end().to_owned()
        })
        .collect()
}

/// Rows as CSV, the first one the header. Cells are quoted where they must be.
pub fn csv<S: AsRef<[u8]>>(rows: impl IntoIterator<Item: IntoIterator<Item = S>>) -> String {
    let mut out = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for row in rows {
        // writing to memory cannot fail
        let _ = out.write_record(row);
    }
    String::from_utf8(out.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// Text in lines of at most `width` characters, broken at blanks, each after `indent`.
pub fn wrapped(text: &str, width: usize, indent: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = indent.to_owned();
    for word in text.split_whitespace() {
        if line.len() > indent.len() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(std::mem::replace(&mut line, indent.to_owned()));
        }
        if line.len() > indent.len() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.push(line);
    lines
}

/// In which unit a person is told a number, and the factor to it: ratios in percent, powers as such.
pub fn unit_told(unit: &str) -> (f64, &str) {
    match unit {
        "1" => (100.0, "%"),
        "deg/Nm2" => (1.0, "deg/Nm^2"),
        "deg/Nm3" => (1.0, "deg/Nm^3"),
        "m/s2" => (1.0, "m/s^2"),
        _ => (1.0, unit),
    }
}

/// "1 row", "2 rows", "2 touches": a number with what it counts.
pub fn counted(n: usize, what: &str) -> String {
    format!("{n} {}", plural(n, what))
}

/// "row" of one, "rows" and "touches" of more.
pub fn plural(n: usize, what: &str) -> String {
    let end = match (n, what.ends_with("ch")) {
        (1, _) => "",
        (_, true) => "es",
        _ => "s",
    };
    format!("{what}{end}")
}

/// A sentence with an end.
pub fn ended(text: &str) -> String {
    let end = if text.ends_with(['.', '?', '!']) { "" } else { "." };
    format!("{text}{end}")
}

/// "ratio_2 = 0.0255 % (sd 0.0018)": a ratio in percent, and no more digits than the standard deviation leaves meaningful.
pub fn estimate(name: &str, value: f64, sd: Option<f64>, unit: &str) -> String {
    let (factor, unit) = unit_told(unit);
    let (value, sd) = (factor * value, sd.map(|sd| factor * sd));
    // a value within its standard deviation is written as that
    let size = value.abs().max(sd.filter(|sd| sd.is_finite()).unwrap_or(0.0));
    let least = if sd.is_some() { 1e-4 } else { 1e-3 };
    let is_plain = size == 0.0 || (least..1e4).contains(&size);
    let digits = match sd.filter(|sd| sd.is_finite() && *sd > 0.0) {
        None if is_plain => format!("{value:.4}"),
        None => format!("{value:.3e}"),
        Some(sd) if is_plain => format!("{value:.0$}", decimals_for(sd)),
        Some(sd) => {
            let d = (1.0 + size.log10().floor() - sd.log10().floor()).clamp(0.0, 12.0) as usize;
            format!("{value:.d$e}")
        }
    };
    let sd = sd.map_or_else(String::new, |sd| {
        format!(" (sd {})", if is_plain { two_digits(sd) } else { format!("{sd:.1e}") })
    });
    format!("{name} = {digits} {unit}{sd}")
}

/// A number with so many decimals; zero has no sign.
pub fn fixed(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.strip_prefix('-') {
        Some(size) if !size.contains(|c: char| ('1'..='9').contains(&c)) => size.to_owned(),
        _ => text,
    }
}

/// A number with two significant digits.
pub fn two_digits(x: f64) -> String {
    let d = decimals_for(x.abs());
    format!("{x:.d$}")
}

/// Decimals that a standard deviation leaves meaningful: two digits of it.
pub fn decimals_for(sd: f64) -> usize {
    if !(sd.is_finite() && sd > 0.0) {
        return 4;
    }
    (1.0 - sd.log10().floor()).clamp(0.0, 12.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_a_csv_are_quoted_where_they_must_be_and_come_back() {
        let rows = [["a", "b, c", "d \"e\""], ["1", "", "two\nlines"]];
        let text = csv(rows);
        assert_eq!(text, "a,\"b, c\",\"d \"\"e\"\"\"\n1,,\"two\nlines\"\n");
        let read = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes()).into_records();
        let read: Vec<Vec<String>> = read.flatten().map(|r| r.iter().map(str::to_owned).collect()).collect();
        assert_eq!(read, rows.map(|r| r.map(str::to_owned).to_vec()));
    }

    #[test]
    fn columns_stand_below_each_other_and_text_is_broken_at_blanks() {
        let rows = [["what", "mm"], ["a", "12.5"]].map(|r| r.map(str::to_owned).to_vec());
        assert_eq!(lines(&rows), ["  what    mm", "  a     12.5"]);
        assert_eq!(wrapped("one two three", 9, "  "), ["  one two", "  three"]);
        assert_eq!(["is off", "is it?", "Stop."].map(ended), ["is off.", "is it?", "Stop."]);
        assert_eq!(wrapped("a word_that_is_longer", 6, ""), ["a", "word_that_is_longer"]);
    }

    #[test]
    fn one_is_told_without_the_end_that_more_have() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "row")), ["0 rows", "1 row", "2 rows"]);
        assert_eq!([1, 2].map(|n| counted(n, "touch")), ["1 touch", "2 touches"]);
    }

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        assert_eq!([-0.0, -0.04, 0.04, -0.06, -1.0].map(|x| fixed(x, 1)), ["0.0", "0.0", "0.0", "-0.1", "-1.0"]);
        assert_eq!([-0.4, f64::NAN].map(|x| fixed(x, 0)), ["0", "NaN"]);
    }

    /// Two digits of a standard deviation, however large or small it is.
    #[test]
    fn numbers_have_the_digits_that_their_uncertainty_leaves() {
        assert_eq!([0.0123, 1.23, 12.3, 1230.0].map(decimals_for), [3, 1, 0, 0]);
        assert_eq!([0.0, f64::NAN, -1.0].map(decimals_for), [4, 4, 4]);
        assert_eq!([0.0126, -0.126, 0.0].map(two_digits), ["0.013", "-0.13", "0.0000"]);
        assert_eq!(estimate("a_1", 0.5, None, "mm"), "a_1 = 0.5000 mm");
        assert_eq!(estimate("a_1", -11.7038, Some(2.91), "mm"), "a_1 = -11.7 mm (sd 2.9)");
        assert_eq!(estimate("lag", 0.995301, Some(0.0009), "1"), "lag = 99.530 % (sd 0.090)");
        assert_eq!(estimate("soft", 12345.6, Some(210.0), "N"), "soft = 1.235e4 N (sd 2.1e2)");
        assert_eq!(estimate("ripple", 8.514e-4, Some(8.4e-5), "deg"), "ripple = 0.000851 deg (sd 0.000084)");
        assert_eq!(estimate("drift", -2.0778e-5, Some(7.1e-7), "mm/s"), "drift = -2.078e-5 mm/s (sd 7.1e-7)");
        assert_eq!(estimate("a", 1.2e-5, Some(3.9e-3), "deg"), "a = 0.0000 deg (sd 0.0039)");
        assert_eq!(estimate("stiffness", 1.0, None, "deg/Nm3"), "stiffness = 1.0000 deg/Nm^3");
        assert_eq!(estimate("g", -2.0e-6, None, "1"), "g = -2.000e-4 %");
    }
}
