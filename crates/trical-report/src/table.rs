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

/// A ratio in percent, as people read it; any other number as it is.
pub fn in_percent(value: f64, sd: Option<f64>, unit: &str) -> (f64, Option<f64>, &str) {
    if unit == "1" { (100.0 * value, sd.map(|sd| 100.0 * sd), "%") } else { (value, sd, unit) }
}

/// "beta_2 = 0.0255 deg"; numbers of no dimension have no unit.
pub fn number(name: &str, value: f64, unit: &str) -> String {
    let size = value.abs();
    let digits =
        if size != 0.0 && !(1e-3..1e4).contains(&size) { format!("{value:.3e}") } else { format!("{value:.4}") };
    if unit == "1" { format!("{name} = {digits}") } else { format!("{name} = {digits} {unit}") }
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
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let d = (1.0 - sd.log10().floor()).clamp(0.0, 12.0) as usize;
    d
}
