//! Numbers that programs write as expressions: `300+10`, `h/2`, `-pi`, `d2r(90)`.
//!
//! Only what is the same on every run has a value here: numbers, names of constants, `+ - * /`, parentheses, and a few functions.
//! In KRL, integers divide to integers: 5/2 is 2.

use std::collections::HashMap;
use trical_model::trig;

use crate::scan::{Scan, hashed, hashed_as_written};
use crate::text::{Cursor, Span};

/// Parentheses inside parentheses, at most.
const DEEPEST: usize = 16;

/// Constants of a program by the hash of their names ([`hashed`]).
#[derive(Debug, Default)]
pub struct Constants {
    values: HashMap<u64, Option<Number>>,
    /// Whether sine and cosine are of degrees.
    degrees: bool,
    /// Whether integers divide to integers.
    truncates: bool,
    /// Whether `H` and `h` are two names.
    as_written: bool,
}

/// A value, and whether the language has it as an integer.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    value: f64,
    whole: bool,
}

impl Number {
    fn by(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self { value: of(self.value, other.value), whole: self.whole && other.whole }
    }
}

impl Constants {
    /// None yet, in a language that tells `H` from `h`.
    #[must_use]
    pub fn as_written() -> Self {
        Self { as_written: true, ..Self::default() }
    }

    /// None yet, in a language whose sine and cosine are of degrees.
    #[must_use]
    pub fn with_degrees() -> Self {
        Self { degrees: true, ..Self::default() }
    }

    /// None yet, in a language whose sine and cosine are of degrees, and whose integers divide to integers.
    #[must_use]
    pub fn with_integers() -> Self {
        Self { truncates: true, ..Self::with_degrees() }
    }

    /// A constant; a second one of this name with another value makes both unknown.
    pub fn define(&mut self, name: u64, value: f64) {
        self.keep(name, Number { value, whole: false });
    }

    /// As [`Self::define`], of one that is an integer.
    pub fn define_integer(&mut self, name: u64, value: f64) {
        self.keep(name, Number { value: value.round(), whole: true });
    }

    fn keep(&mut self, name: u64, new: Number) {
        let known = self.values.entry(name).or_insert(Some(new));
        if *known != Some(new) {
            *known = None;
        }
    }

    /// A name whose value only the running program knows.
    pub fn forget(&mut self, name: u64) {
        self.values.insert(name, None);
    }

    /// The value of the constant, where there is one of this name.
    #[must_use]
    pub fn get(&self, name: &[u8]) -> Option<f64> {
        self.named(name).map(|known| known.value)
    }

    fn named(&self, name: &[u8]) -> Option<Number> {
        let hash = if self.as_written { hashed_as_written(name) } else { hashed(name) };
        match self.values.get(&hash) {
            Some(value) => *value,
            None => name.eq_ignore_ascii_case(b"pi").then_some(Number { value: std::f64::consts::PI, whole: false }),
        }
    }

    /// The expression that begins at the cursor: where it stands, and its value, which is finite. What has no value is not
    /// passed.
    pub fn expression(&self, c: &mut Cursor<'_>) -> Option<(Span, f64)> {
        let start = *c;
        let found = self.sum(c, 0).filter(|(_, found)| found.value.is_finite());
        if found.is_none() {
            *c = start;
        }
        found.map(|(end, found)| (Span::new(start.at, end), found.value))
    }

    /// A number that stands at the cursor before one of `ends`, plain or calculated; what is none is not passed.
    pub fn number(&self, c: &mut Cursor<'_>, ends: &[u8], scan: &mut Scan) -> Option<Span> {
        let start = *c;
        let ends_here = |c: &Cursor<'_>| {
            let mut behind = *c;
            behind.skip_space();
            ends.contains(&behind.peek())
        };
        if let Some(span) = c.number().filter(|_| ends_here(c)) {
            return Some(span);
        }
        *c = start;
        if let Some((span, value)) = self.expression(c).filter(|_| ends_here(c)) {
            scan.calculated(span, value);
            return Some(span);
        }
        *c = start;
        None
    }

    /// The end of the text, and the value.
    fn sum(&self, c: &mut Cursor<'_>, depth: usize) -> Option<(usize, Number)> {
        let (mut end, mut value) = self.product(c, depth)?;
        while let Some(op) = operator(c, b"+-") {
            let (to, x) = self.product(c, depth)?;
            value = value.by(x, |a, b| if op == b'+' { a + b } else { a - b });
            end = to;
        }
        Some((end, value))
    }

    fn product(&self, c: &mut Cursor<'_>, depth: usize) -> Option<(usize, Number)> {
        let (mut end, mut value) = self.factor(c, depth)?;
        while let Some(op) = operator(c, b"*/") {
            let (to, x) = self.factor(c, depth)?;
            value = value.by(x, |a, b| if op == b'*' { a * b } else { a / b });
            if op == b'/' && value.whole && self.truncates {
                value.value = value.value.trunc();
            }
            end = to;
        }
        Some((end, value))
    }

    fn factor(&self, c: &mut Cursor<'_>, depth: usize) -> Option<(usize, Number)> {
        c.skip_space();
        if let Some(span) = c.number() {
            let whole = !span.text(c.bytes).iter().any(|b| b".eE".contains(b)) || c.bytes.get(c.at - 1) == Some(&b'\'');
            return Some((c.at, Number { value: span.value(c.bytes)?, whole }));
        }
        if depth > DEEPEST {
            return None;
        }
        match c.peek() {
            sign @ (b'-' | b'+') => {
                c.at += 1;
                let (end, x) = self.factor(c, depth + 1)?;
                Some((end, if sign == b'-' { Number { value: -x.value, ..x } } else { x }))
            }
            b'(' => self.in_parentheses(c, depth),
            _ => {
                let name = c.word();
                if name.is_empty() {
                    return None;
                }
                let end = c.at;
                c.skip_blank();
                if c.peek() == b'(' {
                    let (end, x) = self.in_parentheses(c, depth)?;
                    return Some((end, Number { value: self.function(name, x.value)?, whole: false }));
                }
                c.at = end;
                // not a part or an element of something
                if matches!(c.peek(), b'.' | b'[' | b'{') {
                    return None;
                }
                Some((end, self.named(name)?))
            }
        }
    }

    fn in_parentheses(&self, c: &mut Cursor<'_>, depth: usize) -> Option<(usize, Number)> {
        c.at += 1;
        let (_, value) = self.sum(c, depth + 1)?;
        c.eat(b')').then_some((c.at, value))
    }

    fn function(&self, name: &[u8], x: f64) -> Option<f64> {
        let angle = if self.degrees { x.to_radians() } else { x };
        match name.to_ascii_lowercase().as_slice() {
            b"d2r" => Some(x.to_radians()),
            b"r2d" => Some(x.to_degrees()),
            b"sqrt" => Some(x.sqrt()),
            b"abs" => Some(x.abs()),
            b"sin" => Some(trig::sin(angle)),
            b"cos" => Some(trig::cos(angle)),
            _ => None,
        }
    }
}

/// The operator that comes next, which is then passed.
fn operator(c: &mut Cursor<'_>, which: &[u8]) -> Option<u8> {
    let start = *c;
    c.skip_space();
    let op = c.peek();
    // an operator of two characters (`//`, `**`) is none of these
    let found = which.contains(&op) && c.bytes.get(c.at + 1) != Some(&op);
    if found {
        c.at += 1;
        return Some(op);
    }
    *c = start;
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::hashed;

    #[test]
    fn constants_and_arithmetic_have_a_value_and_the_rest_has_none() {
        let mut known = Constants::default();
        known.define(hashed(b"h"), 25.0);
        known.define(hashed(b"twice"), 1.0);
        known.define(hashed(b"twice"), 2.0);
        let value = |text: &str| {
            let mut c = Cursor::new(text.as_bytes(), b'!');
            known.expression(&mut c).map(|(span, v)| (v, span.text(text.as_bytes()).len(), c.at))
        };
        assert_eq!(value("300+10]"), Some((310.0, 6, 6)));
        assert_eq!(value("2 * (H - 5) / 4 , 1"), Some((10.0, 15, 15)));
        assert_eq!(value("-pi]").map(|v| v.0), Some(-std::f64::consts::PI));
        assert!((value("d2r(90)").unwrap_or_default().0 - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert_eq!(value("10 -5"), Some((5.0, 5, 5)));
        for none in ["twice", "x", "1/0", "h.x", "h[1]", "f(h)", "(1", "1+", "\"1\""] {
            assert_eq!(value(none), None, "{none}");
        }
        assert_eq!(value(&"(".repeat(1_000_000)), None);
    }

    #[test]
    fn integers_divide_to_integers_where_the_language_says_so() {
        let value = |mut known: Constants, text: &str| {
            known.define(hashed(b"h"), 5.0);
            known.define_integer(hashed(b"w"), 5.0);
            known.expression(&mut Cursor::new(text.as_bytes(), b';')).map(|(_, v)| v)
        };
        let of = |text: &str| [Constants::with_integers(), Constants::with_degrees()].map(|known| value(known, text));
        for (text, truncated) in [("w/2", 2.0), ("1+-w/2*3", -5.0), ("(w+2)/'HE'", 0.0), ("7/(w-3)/2.0", 1.5)] {
            assert_eq!(of(text)[0], Some(truncated), "{text}");
        }
        for real in ["h/2", "w/2.0", "w/2e0", "5.0/2"] {
            assert_eq!(of(real), [Some(2.5); 2], "{real}");
        }
        assert_eq!([of("w/2")[1], of("5/2")[1], of("w/0")[0]], [Some(2.5), Some(2.5), None]);
    }
}
