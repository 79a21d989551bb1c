//! Bytes of programs: a cursor over them, numbers in them, and new numbers in their place.
//!
//! Nothing here decodes text: keywords and numbers are ASCII in every dialect, and whatever else the file holds (Latin-1
//! comments, mixed line ends) is copied as it stands.

/// Of a list that a sentence tells, so many are named.
const LISTED: usize = 8;

/// The first few of a list.
pub(crate) fn listed(all: impl ExactSizeIterator<Item = String>) -> String {
    let more = all.len().saturating_sub(LISTED);
    let first = all.take(LISTED).collect::<Vec<_>>().join(", ");
    if more == 0 { first } else { format!("{first} and {more} more") }
}

/// Where a number stands in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// Offset of its first byte.
    pub at: u32,
    /// Number of its bytes.
    pub len: u16,
}

impl Span {
    /// Bytes `from..to` of the file.
    #[must_use]
    pub fn new(from: usize, to: usize) -> Self {
        Self { at: u32::try_from(from).unwrap_or(u32::MAX), len: u16::try_from(to - from).unwrap_or(0) }
    }

    /// Its text.
    #[must_use]
    pub fn text(self, bytes: &[u8]) -> &[u8] {
        bytes.get(self.at as usize..self.at as usize + self.len as usize).unwrap_or(&[])
    }

    /// The number that stands there; KUKA's binary and hexadecimal forms ('B1010', 'H2A') too.
    #[must_use]
    pub fn value(self, bytes: &[u8]) -> Option<f64> {
        number(self.text(bytes))
    }
}

/// A finite number, or `None`.
#[must_use]
pub fn number(text: &[u8]) -> Option<f64> {
    if let Some(radix) = radix(text) {
        let digits = std::str::from_utf8(text[2..].strip_suffix(b"'")?.trim_ascii()).ok()?;
        return u32::from_str_radix(digits, radix).ok().map(f64::from);
    }
    // "inf" and "nan" are names here
    if !text.first().is_some_and(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.')) {
        return None;
    }
    std::str::from_utf8(text).ok()?.parse().ok().filter(|x: &f64| x.is_finite())
}

/// The radix of one of KUKA's numbers that are not decimal, by how it begins.
fn radix(text: &[u8]) -> Option<u32> {
    match text.get(..2)? {
        b"'B" | b"'b" => Some(2),
        b"'H" | b"'h" => Some(16),
        _ => None,
    }
}

/// What a file in UTF-8 may begin with.
const UTF8: &[u8] = b"\xEF\xBB\xBF";

/// Whether a name may begin with this byte; those beyond ASCII are letters of UTF-8 or Latin-1.
#[must_use]
pub fn is_letter(b: u8) -> bool {
    b.is_ascii_alphabetic() || b == b'_' || !b.is_ascii()
}

/// Bytes that are looked at ahead, at most.
const FARTHEST: usize = 1000;

/// Whether nothing but blanks stands in the line before `at`.
#[must_use]
pub fn begins_line(bytes: &[u8], at: usize) -> bool {
    bytes[..at].iter().rev().take_while(|b| **b != b'\n').all(u8::is_ascii_whitespace)
}

/// Whether a text has this name in it, in capitals or not, and not only in strings.
#[must_use]
pub fn mentions(text: &[u8], name: &[u8]) -> bool {
    let mut code = text.split(|b| *b == b'"').step_by(2);
    code.any(|code| code.split(|b| !is_letter(*b) && !b.is_ascii_digit()).any(|w| w.eq_ignore_ascii_case(name)))
}

/// Whether a word is one of these, in capitals or not.
#[must_use]
pub fn is_one_of(word: &[u8], list: &[&[u8]]) -> bool {
    list.iter().any(|k| word.eq_ignore_ascii_case(k))
}

/// Whether a word stands in a list, in capitals or not.
#[must_use]
pub fn is_among(word: &[u8], list: &str) -> bool {
    list.split_ascii_whitespace().any(|k| word.eq_ignore_ascii_case(k.as_bytes()))
}

/// As [`is_among`], where capitals matter.
#[must_use]
pub fn is_among_as_written(word: &[u8], list: &str) -> bool {
    list.split_ascii_whitespace().any(|k| word == k.as_bytes())
}

/// Whether bytes have these in them.
#[must_use]
pub fn contains(bytes: &[u8], word: &[u8]) -> bool {
    let first = word.first().copied().unwrap_or(0);
    let mut at = 0;
    while let Some(k) = bytes[at..].iter().position(|b| *b == first) {
        if bytes[at + k..].starts_with(word) {
            return true;
        }
        at += k + 1;
    }
    false
}

/// A place in a program, and small steps from there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor<'a> {
    /// All of the file.
    pub bytes: &'a [u8],
    /// Where the next byte is read.
    pub at: usize,
    /// What begins a comment that lasts to the end of its line.
    comment: u8,
}

impl<'a> Cursor<'a> {
    /// At the beginning, behind a mark of UTF-8; `comment` begins comments.
    #[must_use]
    pub fn new(bytes: &'a [u8], comment: u8) -> Self {
        Self { bytes, at: if bytes.starts_with(UTF8) { UTF8.len() } else { 0 }, comment }
    }

    /// As [`Self::new`], at this place.
    #[must_use]
    pub fn at(bytes: &'a [u8], at: usize, comment: u8) -> Self {
        Self { bytes, at, comment }
    }

    /// The next byte, 0 at the end.
    #[must_use]
    pub fn peek(&self) -> u8 {
        self.bytes.get(self.at).copied().unwrap_or(0)
    }

    /// Whether nothing is left.
    #[must_use]
    pub fn done(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// To the next of `ends` (which is not passed), or the end of the file.
    pub fn skip_to(&mut self, ends: &[u8]) {
        while !self.done() && !ends.contains(&self.peek()) {
            self.at += 1;
        }
    }

    /// Past the next `bracket`, unless one of `ends` comes before it.
    pub fn skip_past(&mut self, bracket: u8, ends: &[u8]) {
        while !self.done() && self.peek() != bracket && !ends.contains(&self.peek()) {
            self.at += 1;
        }
        self.at += usize::from(self.peek() == bracket);
    }

    /// To the line's end (which is not passed).
    pub fn skip_line(&mut self) {
        self.skip_to(b"\n\r");
    }

    /// Whether a string begins here; in the language of scripts also one in single quotes, where it ends on its line.
    #[must_use]
    pub fn begins_string(&self) -> bool {
        let mut behind = *self;
        behind.at += 1;
        let closes = || self.bytes.get(behind.at + behind.until(b"'\n\r").len()) == Some(&b'\'');
        self.peek() == b'"' || self.is_script() && self.peek() == b'\'' && closes()
    }

    fn is_script(&self) -> bool {
        self.comment == b'#'
    }

    /// Past a string that begins here, to its closing quote or the line's end; a script's `\"` closes none.
    pub fn skip_string(&mut self) {
        let quote = self.peek();
        self.at += usize::from(!self.done());
        while !self.done() && !matches!(self.peek(), b'\n' | b'\r') {
            let end = self.peek() == quote;
            self.at += 1 + usize::from(
                self.is_script() && self.peek() == b'\\' && self.bytes.get(self.at + 1) == Some(&quote),
            );
            if end {
                return;
            }
        }
    }

    /// Past blanks, line ends and comments.
    pub fn skip_space(&mut self) {
        loop {
            let b = self.peek();
            if b.is_ascii_whitespace() {
                self.at += 1;
            } else if b == self.comment && !self.done() {
                self.skip_line();
            } else {
                return;
            }
        }
    }

    /// What stands from here to the next of `ends`, or as much of it as a sane program has there: whoever looks ahead again and
    /// again does not look through all of a line without an end.
    #[must_use]
    pub fn until(&self, ends: &[u8]) -> &'a [u8] {
        let text = self.bytes.get(self.at..).unwrap_or(&[]);
        let text = &text[..text.len().min(FARTHEST)];
        let is_end = |b: &u8| ends.contains(b);
        let end = if ends.is_empty() { None } else { text.iter().position(is_end) };
        &text[..end.unwrap_or(text.len())]
    }

    /// Whether the word at `at` is a part of what stands before it (`x.end`).
    #[must_use]
    pub fn is_member(&self, at: usize) -> bool {
        at.checked_sub(1).and_then(|k| self.bytes.get(k)) == Some(&b'.')
    }

    /// Past blanks within the line.
    pub fn skip_blank(&mut self) {
        while matches!(self.peek(), b' ' | b'\t') {
            self.at += 1;
        }
    }

    /// Whether `b` comes next after space; it is then passed.
    pub fn eat(&mut self, b: u8) -> bool {
        self.skip_space();
        let found = self.peek() == b && !self.done();
        self.at += usize::from(found);
        found
    }

    /// Whether `b` comes next in the line; it is then passed, and blanks behind it.
    pub fn eat_in_line(&mut self, b: u8) -> bool {
        self.skip_blank();
        let found = self.peek() == b && !self.done();
        if found {
            self.at += 1;
            self.skip_blank();
        }
        found
    }

    /// Whether `=` comes next, and is no comparison.
    #[must_use]
    pub fn assigns(&self) -> bool {
        self.peek() == b'=' && self.bytes.get(self.at + 1) != Some(&b'=')
    }

    /// Past the next name of the file: where it begins, and the name. Strings, comments and all else before it are passed over.
    pub fn next_word(&mut self) -> Option<(usize, &'a [u8])> {
        while !self.done() {
            self.skip_space();
            let from = self.at;
            let word = self.word();
            if !word.is_empty() {
                return Some((from, word));
            }
            if self.begins_string() { self.skip_string() } else { self.at += 1 }
        }
        None
    }

    /// The name that begins here (letters, digits, `_`, and `$` for KUKA's system variables); empty where there is none.
    pub fn word(&mut self) -> &'a [u8] {
        let from = self.at;
        if is_letter(self.peek()) || self.peek() == b'$' {
            while is_letter(self.peek()) || self.peek().is_ascii_digit() || self.peek() == b'$' {
                self.at += 1;
            }
        }
        &self.bytes[from..self.at]
    }

    /// The name that comes next after space.
    pub fn name_ahead(&mut self) -> &'a [u8] {
        self.skip_space();
        self.word()
    }

    /// The number that begins here, where one does.
    pub fn number(&mut self) -> Option<Span> {
        let from = self.at;
        if radix(&self.bytes[from..]).is_some() {
            let close = self.bytes[from + 2..].iter().take(34).position(|b| *b == b'\'')?;
            self.at = from + close + 3;
        } else {
            if matches!(self.peek(), b'+' | b'-') {
                self.at += 1;
            }
            while self.peek().is_ascii_digit() || self.peek() == b'.' {
                self.at += 1;
            }
            if self.at > from && matches!(self.peek(), b'e' | b'E') {
                let mut k = self.at + 1;
                if matches!(self.bytes.get(k), Some(b'+' | b'-')) {
                    k += 1;
                }
                if self.bytes.get(k).is_some_and(u8::is_ascii_digit) {
                    self.at = k;
                    while self.peek().is_ascii_digit() {
                        self.at += 1;
                    }
                }
            }
        }
        let span = Span::new(from, self.at);
        if span.value(self.bytes).is_none() {
            self.at = from;
            return None;
        }
        Some(span)
    }
}

/// Digits behind the point of a number's text; 0 where it has an exponent.
fn decimals(text: &[u8]) -> usize {
    if text.iter().any(|b| matches!(b, b'e' | b'E')) {
        return 0;
    }
    text.iter().position(|b| *b == b'.').map_or(0, |k| text.len() - k - 1)
}

/// `new` with the digits that the old text has, and at least `least`.
#[must_use]
pub fn written(new: f64, old: &[u8], least: usize) -> String {
    // an expression has no digits of its own
    let digits = number(old).map_or(0, |_| decimals(old));
    let places = digits.clamp(least, 12);
    let text = format!("{new:.places$}");
    match text.strip_prefix('-') {
        Some(positive) if positive.bytes().all(|b| matches!(b, b'0' | b'.')) => positive.to_owned(),
        _ => text,
    }
}

/// A new number in the place of an old one: where the old one's sign kept it from the name before it ("A4-0.01"), or its exponent from a
/// point behind it ("50e0."), a blank does.
#[must_use]
pub fn kept_apart(new: String, bytes: &[u8], old: Span) -> String {
    let from = old.at as usize;
    let before = from.checked_sub(1).and_then(|k| bytes.get(k)).copied().unwrap_or(b' ');
    let runs_on = is_letter(before) || before.is_ascii_digit() || before == b'.';
    let left = if runs_on && new.starts_with(|c: char| c.is_ascii_digit()) { " " } else { "" };
    let right = if bytes.get(from + usize::from(old.len)) == Some(&b'.') { " " } else { "" };
    format!("{left}{new}{right}")
}

/// A whole number in the form of the old text, with as many digits where that is not decimal.
#[must_use]
pub fn written_whole(new: i16, old: &[u8]) -> String {
    let (digits, form) = (old.len().saturating_sub(3), old.get(1).copied().map_or('B', char::from));
    match radix(old) {
        Some(2) => format!("'{form}{new:0digits$b}'"),
        Some(_) => format!("'{form}{new:0digits$X}'"),
        None => new.to_string(),
    }
}

/// Lower-case copy of a name in UTF-8 or Latin-1.
#[must_use]
pub fn lower(name: &[u8]) -> String {
    match std::str::from_utf8(name) {
        Ok(name) => name.to_lowercase(),
        Err(_) => name.iter().flat_map(|b| char::from(*b).to_lowercase()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::hashed;

    #[test]
    fn names_have_letters_of_utf_8_and_latin_1() {
        for (bytes, word) in
            [(&b"pH\xc4ger,v1"[..], &b"pH\xc4ger"[..]), ("p_Höger2;".as_bytes(), "p_Höger2".as_bytes())]
        {
            assert_eq!(Cursor::new(bytes, b'!').word(), word);
            assert!(mentions(bytes, word) && !mentions(bytes, b"ger"));
            assert_eq!(hashed(word), hashed(lower(word).as_bytes()));
        }
        assert_eq!(lower(b"pH\xc4ger"), lower("PHäger".as_bytes()));
        // the mark that some editors put before UTF-8 is no part of the first word
        assert_eq!(Cursor::new(b"\xEF\xBB\xBFMODULE M", b'!').word(), b"MODULE");
    }
}
