//! The rows of a CSV, taken apart: where each cell stands, and its number where it is a plain one.

/// A cell of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Where it begins in the text of the row, bytes.
    begin: usize,
    /// Behind its last byte.
    end: usize,
    /// The number that stands there; NaN where the text has to be looked at.
    pub number: f64,
}

impl Cell {
    /// What stands there, without blanks around it.
    pub fn text<'a>(&self, row: &'a str) -> &'a str {
        row.get(self.begin..self.end).unwrap_or("").trim()
    }
}

/// Rows one after the other.
pub(crate) struct Lines<'a> {
    text: &'a [u8],
    csv: csv::Reader<&'a [u8]>,
    record: csv::StringRecord,
    /// The same, where nothing in it is quoted: then its commas and ends of lines divide it.
    plain: Option<&'a str>,
    /// Where the next row begins in it, bytes.
    at: usize,
    line: u64,
    pub(super) cells: Vec<Cell>,
}

impl<'a> Lines<'a> {
    /// The rows that `csv`, a reader of `text`, has not read yet.
    pub fn of(csv: csv::Reader<&'a [u8]>, text: &'a [u8]) -> Self {
        let (at, line) = (usize::try_from(csv.position().byte()).unwrap_or(usize::MAX), csv.position().line());
        let is_plain = text.get(at..).is_some_and(|rows| !holds(rows, b'"'));
        let plain = if is_plain { std::str::from_utf8(text).ok() } else { None };
        Self { text, csv, record: csv::StringRecord::new(), plain, at, line, cells: Vec::new() }
    }

    /// The line of a row that begins here: the crate takes empty lines before it for its beginning.
    pub(super) fn line(&self, begin: &csv::Position) -> u64 {
        let from = usize::try_from(begin.byte()).ok().and_then(|at| self.text.get(at..)).unwrap_or(&[]);
        begin.line() + from.iter().take_while(|b| **b == b'\n').count() as u64
    }

    /// Goes to the next row, and returns the number of its line.
    pub(super) fn next(&mut self) -> csv::Result<Option<u64>> {
        let Some(text) = self.plain else {
            let found = self.csv.read_record(&mut self.record)?;
            let cell = |range: std::ops::Range<usize>| Cell { begin: range.start, end: range.end, number: f64::NAN };
            self.cells.clear();
            self.cells.extend((0..self.record.len()).filter_map(|k| self.record.range(k)).map(cell));
            return Ok(found.then(|| self.record.position().map_or(0, |begin| self.line(begin))));
        };
        let text = text.as_bytes();
        while text.get(self.at) == Some(&b'\n') {
            (self.at, self.line) = (self.at + 1, self.line + 1);
        }
        if self.at >= text.len() {
            return Ok(None);
        }
        self.cells.clear();
        loop {
            let (length, number) = cell(&text[self.at..]);
            let end = self.at + length;
            self.cells.push(Cell { begin: self.at, end, number });
            self.at = end + 1;
            if text.get(end) != Some(&b',') {
                self.line += 1;
                return Ok(Some(self.line - 1));
            }
        }
    }

    /// The text in which the cells of the row stand.
    pub(super) fn text(&self) -> &str {
        self.plain.unwrap_or_else(|| self.record.as_slice())
    }
}

/// Powers of ten that are exact.
const TENS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The first cell of a text: its length, and its number. Up to 15 digits are a whole number that is exact, and divided by a power of ten that
/// is exact, too, they give the nearest number, as [`str::parse`] does (Clinger 1990). NaN for all else.
///
/// There is no loop over the digits, whose end no processor foresees: sixteen bytes are looked at at once (Lemire, simdjson).
fn cell(text: &[u8]) -> (usize, f64) {
    const ONES: u128 = u128::MAX / 0xff;
    let blanks = |from: usize| text[from..].iter().take_while(|b| matches!(b, b' ' | b'\r')).count();
    let sign = blanks(0);
    let negative = text.get(sign) == Some(&b'-');
    let first = sign + usize::from(negative);
    let bytes = text[first..].first_chunk().copied().unwrap_or_else(|| padded(&text[first..]));
    let values = u128::from_le_bytes(bytes) ^ (ONES * u128::from(b'0'));
    // the highest bit of each byte that is no digit, up to the first that is not ASCII: what is carried over goes to those behind it
    let others = (values.wrapping_add(ONES * 0x76) | values) & (ONES * 0x80);
    let whole = others.trailing_zeros() / 8;
    let point = bytes.get(whole as usize) == Some(&b'.');
    let behind = if point { others & (others - 1) } else { others };
    let found = behind.trailing_zeros() / 8;
    let length = first + found as usize;
    let length = length + blanks(length);
    if found == 16 || !matches!(text.get(length), None | Some(b',' | b'\n')) {
        let rest = text[first..].iter().position(|b| matches!(b, b',' | b'\n'));
        return (rest.map_or(text.len(), |rest| first + rest), f64::NAN);
    }
    // the digits without the point between them, and zeros in front of them
    let before = (1_u128 << (8 * whole)) - 1;
    let digits = if point { values & before | values >> 8 & !before } else { values };
    let count = found - u32::from(point);
    let digits = digits.unbounded_shl(8 * (16 - count));
    let number = 100_000_000 * eight_digits(digits as u64) + eight_digits((digits >> 64) as u64);
    let tens = TENS[if point { count - whole } else { 0 } as usize];
    let number = number as f64 / tens;
    // its sign as a bit, without a jump that none foresees either
    let signed = f64::from_bits(number.to_bits() | u64::from(negative) << 63);
    (length, if count > 0 { signed } else { f64::NAN })
}

/// The number of eight digits, the first one in the lowest byte: each product joins pairs of digits, or pairs of these.
fn eight_digits(digits: u64) -> u64 {
    let pairs = digits * 10 + (digits >> 8);
    let mask = 0x0000_00ff_0000_00ff;
    let upper = (pairs & mask).wrapping_mul(100 + (1_000_000 << 32));
    let lower = ((pairs >> 16) & mask).wrapping_mul(1 + (10_000 << 32));
    upper.wrapping_add(lower) >> 32
}

/// The last bytes of a text, and zeros.
#[cold]
fn padded(text: &[u8]) -> [u8; 16] {
    std::array::from_fn(|k| text.get(k).copied().unwrap_or(0))
}

/// Whether a byte stands anywhere in a text.
pub(super) fn holds(text: &[u8], byte: u8) -> bool {
    // without a jump for each byte, so that many are compared at once
    text.chunks(4096).any(|some| some.iter().fold(false, |found, b| found | (*b == byte)))
}

/// How many lines end in a text.
pub(crate) fn ends_of_lines(text: &[u8]) -> usize {
    // counted in bytes, so that many are compared at once
    let count = |some: &[u8]| some.iter().fold(0, |count: u8, b| count + u8::from(*b == b'\n'));
    text.chunks(255).map(|some| usize::from(count(some))).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn rows(text: &str) -> Vec<(u64, Vec<(String, f64)>)> {
        let csv = crate::csv::csv_reader(false).from_reader(text.as_bytes());
        let mut lines = Lines::of(csv, text.as_bytes());
        let mut rows = Vec::new();
        while let Some(line) = lines.next().unwrap() {
            let one = |c: &Cell| (c.text(lines.text()).to_owned(), c.number);
            rows.push((line, lines.cells.iter().map(one).collect()));
        }
        rows
    }

    /// The same text as the crate divides it, which is what decides where something is quoted, and the lines in which something stands.
    fn as_quoted(text: &str) -> Vec<(u64, Vec<String>)> {
        let mut csv = crate::csv::csv_reader(false).from_reader(text.as_bytes());
        let records = csv.records().map(|record| record.unwrap());
        let lines = (1..).zip(text.split('\n')).filter(|(_, line)| !line.is_empty()).map(|(number, _)| number);
        lines.zip(records.map(|r| r.iter().map(|cell| cell.trim().to_owned()).collect())).collect()
    }

    #[test]
    fn numbers_are_those_of_the_standard_library_to_the_bit() {
        for (text, plain) in [
            ("0", true),
            ("-0", true),
            ("-0.0", true),
            ("98.0913154", true),
            ("-12.6677248", true),
            (".5", true),
            ("-5.", true),
            ("0.1", true),
            ("  7.25 \r", true),
            ("999999999999999", true),
            ("1000000000000000", false),
            ("12345678.9012345", false),
            ("0.0000000000001", true),
            ("-123456.78901234", true),
            ("36893488147419103233", false),
            ("+1", false),
            ("1e3", false),
            ("--1", false),
            ("1.2.3", false),
            ("", false),
            ("-", false),
            (".", false),
            ("1 2", false),
            ("- 1", false),
            ("nan", false),
            ("\u{a0}1", false),
        ] {
            for behind in ["", ",", "\n", ",1", "\n1"] {
                let (length, number) = cell(format!("{text}{behind}").as_bytes());
                assert_eq!((length, number.is_nan()), (text.len(), !plain), "'{text}{behind}'");
                let parsed = text.trim().parse::<f64>();
                assert!(!plain || parsed.is_ok_and(|x| x.to_bits() == number.to_bits()), "'{text}': {number}");
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn a_number_that_is_read_at_once_is_the_one_that_its_text_says(text in " ?-?[0-9]{0,20}\\.?[0-9]{0,20}\r?") {
            let (length, number) = cell(text.as_bytes());
            assert_eq!(length, text.len());
            let parsed = text.trim().parse::<f64>();
            assert!(number.is_nan() || parsed.is_ok_and(|x| x.to_bits() == number.to_bits()), "'{text}': {number}");
        }

        #[test]
        fn text_without_quotes_is_divided_as_the_crate_divides_it(text in "[-0-9., \r\n\u{b0}x]{0,40}") {
            let found = rows(&text).into_iter().map(|(n, row)| (n, row.into_iter().map(|(text, _)| text).collect()));
            assert_eq!(found.collect::<Vec<_>>(), as_quoted(&text));
        }
    }

    #[test]
    fn what_is_quoted_is_not_divided() {
        let quoted = rows("1,\"a,\n\"\"b\",2\n\n3,4");
        let text: Vec<(u64, Vec<&str>)> =
            quoted.iter().map(|(n, row)| (*n, row.iter().map(|(text, _)| text.as_str()).collect())).collect();
        assert_eq!(text, [(1, vec!["1", "a,\n\"b", "2"]), (4, vec!["3", "4"])]);
    }
}
