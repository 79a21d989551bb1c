//! Where targets stand in the text, in few bytes: programs have millions of them, and most numbers are short and begin a byte behind the one before.

use crate::text::Span;

/// What a target has in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Its numbers; those of a configuration stand behind the others.
    pub numbers: Vec<Span>,
    /// Its name; empty where it has none.
    pub name: Span,
    /// Where it asks external axes (a track, a positioner) to be.
    pub external: External,
}

/// External axes of a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum External {
    /// It says nothing of them.
    #[default]
    None,
    /// The first is here, in the text's unit (mm of a track); others are at 0 or not there.
    First(f64),
    /// Others than the first are elsewhere than at 0.
    Others,
}

impl External {
    /// Of the values that a target gives, the first axis first.
    #[must_use]
    pub fn of(values: &[Option<f64>]) -> Self {
        let elsewhere = values.iter().skip(1).flatten().any(|v| *v != 0.0);
        match values.first() {
            _ if elsewhere => Self::Others,
            Some(Some(first)) => Self::First(*first),
            _ => Self::None,
        }
    }
}

/// What targets have in the text, one behind the other.
#[derive(Debug, Default)]
pub(crate) struct Packed(Vec<u8>);

impl Packed {
    /// Adds one; where it begins is what [`Self::get`] asks for.
    pub fn push(&mut self, numbers: &[Span], name: Span, external: External) -> u32 {
        let first = self.0.len() as u32;
        self.put(numbers.len() as u64);
        let mut before = 0;
        for span in numbers {
            self.put_span(*span, before);
            before = span.at.wrapping_add(u32::from(span.len));
        }
        self.put(u64::from(name.len > 0));
        if name.len > 0 {
            self.put_span(name, before);
        }
        match external {
            External::None => self.put(0),
            External::Others => self.put(1),
            External::First(value) => {
                self.put(2);
                // the last bytes of round numbers are zeros
                self.put(value.to_bits().swap_bytes());
            }
        }
        first
    }

    /// How many they take.
    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        self.0.len()
    }

    /// What was added at `first`.
    pub fn get(&self, first: u32) -> Written {
        let mut rest = self.0.get(first as usize..).unwrap_or(&[]);
        let mut before = 0;
        let numbers = (0..take(&mut rest))
            .map(|_| {
                let span = take_span(&mut rest, before);
                before = span.at.wrapping_add(u32::from(span.len));
                span
            })
            .collect();
        let name = if take(&mut rest) > 0 { take_span(&mut rest, before) } else { Span::default() };
        let external = match take(&mut rest) {
            0 => External::None,
            1 => External::Others,
            _ => External::First(f64::from_bits(take(&mut rest).swap_bytes())),
        };
        Written { numbers, name, external }
    }

    /// Seven bits a byte; the eighth says that more follow.
    fn put(&mut self, mut x: u64) {
        while x >= 0x80 {
            self.0.push(x as u8 | 0x80);
            x >>= 7;
        }
        self.0.push(x as u8);
    }

    /// How long it is, and how far from `before` it begins, the sign in the last bit.
    fn put_span(&mut self, span: Span, before: u32) {
        self.put(u64::from(span.len));
        let way = i64::from(span.at) - i64::from(before);
        self.put(((way << 1) ^ (way >> 63)) as u64);
    }
}

fn take(rest: &mut &[u8]) -> u64 {
    let (mut x, mut shift) = (0, 0);
    while let Some((byte, behind)) = rest.split_first() {
        *rest = behind;
        x |= u64::from(byte & 0x7f) << shift;
        shift += 7;
        if *byte < 0x80 || shift > 63 {
            break;
        }
    }
    x
}

fn take_span(rest: &mut &[u8], before: u32) -> Span {
    let len = take(rest) as u16;
    let way = take(rest);
    let way = (way >> 1) as i64 ^ -((way & 1) as i64);
    Span { at: (i64::from(before) + way) as u32, len }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_comes_back() {
        let span = |at, len| Span { at, len };
        let near = [span(1_000_000, 7), span(1_000_008, 6), span(1_000_015, 1)];
        let far = [span(u32::MAX - 9, 9), span(0, 1), span(70_000, u16::MAX), span(70_000, 0)];
        let all = [
            (&near[..], Span::default(), External::None),
            (&far[..], span(3, 200), External::First(-123.456)),
            (&[], span(u32::MAX - 1, 1), External::Others),
            (&near[1..], span(999_990, 4), External::First(0.0)),
        ];
        let mut packed = Packed::default();
        let first = all.map(|(numbers, name, external)| packed.push(numbers, name, external));
        for (first, (numbers, name, external)) in first.into_iter().zip(all) {
            assert_eq!(packed.get(first), Written { numbers: numbers.to_vec(), name, external });
        }
    }

    #[test]
    fn numbers_beside_each_other_take_two_bytes_each() {
        let numbers: Vec<Span> = (0..7).map(|k| Span { at: 500 + 8 * k, len: 7 }).collect();
        let mut packed = Packed::default();
        packed.push(&numbers, Span::default(), External::None);
        assert_eq!(packed.bytes(), 1 + 7 * 2 + 1 + 2);
    }
}
