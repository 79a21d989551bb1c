//! Replies of gauges that answer with one line of text, read with some tolerance.

use super::uwave_protocol::Unit;

/// What a line says.
#[derive(Clone, Debug, PartialEq)]
pub enum LineReply {
    /// One value for each `{v}` of the pattern, with the unit that stood behind it.
    Values(Vec<(f64, Unit)>),
    /// The instrument is busy: ask again shortly.
    Busy,
    /// The instrument reports an error.
    Error(&'static str),
    /// None of these.
    Garbage,
}

/// The form of a reply: literal text with `{v}` where a value stands, e.g. `01A{v}` or `{v};{v};{v}`.
///
/// Blanks around values are ignored, and so is a unit behind a value. Without literal text the line must hold just the
/// value. A comma in a value is a decimal one, but not where the literal text behind the value begins with one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// Literal text before each value, then what follows the last.
    literals: Vec<String>,
}

impl Default for Pattern {
    fn default() -> Self {
        Self { literals: vec![String::new(), String::new()] }
    }
}

impl Pattern {
    /// Reads a pattern; it must hold one or three `{v}`.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let literals: Vec<String> = text.split("{v}").map(|part| part.trim().to_owned()).collect();
        matches!(literals.len(), 2 | 4).then_some(Self { literals })
    }

    /// Number of values in a reply.
    #[must_use]
    pub fn values(&self) -> usize {
        self.literals.len() - 1
    }

    fn read(&self, text: &str) -> Option<Vec<(f64, Unit)>> {
        let mut rest = text;
        let mut values = Vec::with_capacity(self.values());
        for pair in self.literals.windows(2) {
            let [literal, behind] = pair else { continue };
            rest = rest.trim_start().strip_prefix(literal.as_str())?;
            let (value, unit, after) = take_value(rest.trim_start(), !behind.starts_with(','))?;
            values.push((value, unit));
            rest = after;
        }
        (rest.trim() == self.literals.last()?).then_some(values)
    }
}

/// Reads one line, without its end.
///
/// Errors that are known: `911`, `918` (busy) and other `91x` (USB-ITN), `ERR` with a number (Opto-RS, TESA), `OV`
/// (over range), a line that starts with `#` (Pico adaptor).
#[must_use]
pub fn parse_line(line: &[u8], pattern: &Pattern) -> LineReply {
    let Ok(text) = std::str::from_utf8(line) else { return LineReply::Garbage };
    let text = text.trim();
    if text.starts_with('#') {
        return LineReply::Error("the adaptor reports an error of the indicator");
    }
    let upper = text.to_ascii_uppercase();
    if upper.starts_with("ERR") {
        return LineReply::Error("the indicator is switched off, not connected or disturbed");
    }
    if upper.starts_with("OV") {
        return LineReply::Error("over range");
    }
    if text.len() == 3 && text.starts_with("91") && text.bytes().all(|byte| byte.is_ascii_digit()) {
        return match text {
            "911" => LineReply::Error("the indicator does not answer"),
            "918" => LineReply::Busy,
            _ => LineReply::Error("the interface reports an error of the indicator"),
        };
    }
    pattern.read(text).map_or(LineReply::Garbage, LineReply::Values)
}

/// A number at the start of the text, in which a comma may be a decimal one, a unit behind it, and the rest.
fn take_value(text: &str, comma: bool) -> Option<(f64, Unit, &str)> {
    let (sign, digits) = match text.as_bytes().first()? {
        b'+' => (1.0, text.get(1..)?),
        b'-' => (-1.0, text.get(1..)?),
        _ => (1.0, text),
    };
    // some instruments put blanks between the sign and the number
    let digits = digits.trim_start();
    let is_part = |byte: u8| byte.is_ascii_digit() || byte == b'.' || (comma && byte == b',');
    let end = digits.bytes().position(|byte| !is_part(byte)).unwrap_or(digits.len());
    let (number, rest) = digits.split_at_checked(end)?;
    // "91," is what is left of a garbled "918", not a value
    if !number.ends_with(|last: char| last.is_ascii_digit()) {
        return None;
    }
    // a decimal comma is a setting of some instruments
    let magnitude: f64 = number.replacen(',', ".", 1).parse().ok().filter(|v: &f64| v.is_finite())?;
    let after = rest.trim_start();
    for (name, unit) in [
        ("mm", Unit::Millimetre),
        ("MM", Unit::Millimetre),
        ("M", Unit::Millimetre),
        ("inch", Unit::Inch),
        ("in", Unit::Inch),
        ("IN", Unit::Inch),
        ("I", Unit::Inch),
        ("\"", Unit::Inch),
    ] {
        if let Some(rest) = after.strip_prefix(name) {
            return Some((sign * magnitude, unit, rest));
        }
    }
    Some((sign * magnitude, Unit::None, rest))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    fn one(line: &str) -> LineReply {
        parse_line(line.as_bytes(), &Pattern::default())
    }

    #[test]
    fn the_forms_of_the_known_devices() {
        let value = |value, unit| LineReply::Values(vec![(value, unit)]);
        assert_eq!(one("+0123.456"), value(123.456, Unit::None));
        assert_eq!(one("-12.345mm"), value(-12.345, Unit::Millimetre));
        assert_eq!(one(" 0.5000 in "), value(0.5, Unit::Inch));
        assert_eq!(one("- 1,25"), value(-1.25, Unit::None));
        assert_eq!(one("12.700000"), value(12.7, Unit::None));
        let itn = Pattern::parse("01A{v}").unwrap();
        assert_eq!(parse_line(b"01A+0000.123", &itn), value(0.123, Unit::None));
        assert_eq!(parse_line(b"02A+0000.123", &itn), LineReply::Garbage);
        let three = Pattern::parse("{v};{v};{v}").unwrap();
        let values = vec![(1.0, Unit::None), (-2.0, Unit::None), (3.5, Unit::None)];
        assert_eq!(parse_line(b"1.0; -2.0; +3.5", &three), LineReply::Values(values.clone()));
        let commas = Pattern::parse("{v},{v},{v}").unwrap();
        assert_eq!(parse_line(b"1.0,-2.0, 3.5", &commas), LineReply::Values(values));
    }

    #[test]
    fn errors_are_not_values() {
        for text in ["911", "912", "ERR0", "ERR3", "OV", "#no answer"] {
            assert!(matches!(one(text), LineReply::Error(_)), "{text}");
        }
        assert_eq!(one("918"), LineReply::Busy);
        for text in ["", "abc", "+", "1.2.3", "12.5 xyz", "91,", "12.", "0x12", "1e5", "nan", "inf"] {
            assert_eq!(one(text), LineReply::Garbage, "{text}");
        }
        assert_eq!(one(&"9".repeat(400)), LineReply::Garbage);
    }

    #[test]
    fn patterns_hold_one_or_three_values() {
        assert_eq!(Pattern::parse("no value"), None);
        assert_eq!(Pattern::parse("{v}{v}"), None);
        assert_eq!(Pattern::parse("{v}").unwrap().values(), 1);
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..80), pattern in ".{0,10}\\{v\\}.{0,10}") {
            let _ = parse_line(&bytes, &Pattern::default());
            if let Some(pattern) = Pattern::parse(&pattern) {
                let _ = parse_line(&bytes, &pattern);
            }
        }

        #[test]
        fn numbers_come_back(micrometres in -99_999_999_i64..99_999_999) {
            let value = micrometres as f64 / 1000.0;
            let expected = LineReply::Values(vec![(value, Unit::None)]);
            prop_assert_eq!(parse_line(format!("{value:+09.3}").as_bytes(), &Pattern::default()), expected);
        }
    }
}
