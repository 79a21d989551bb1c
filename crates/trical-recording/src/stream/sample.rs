//! Some rows that stand for all: chosen by a hash of their number, so that picks follow no pattern of the recording; the first rows
//! of each sort (ball, target, anchor) are always among them, so that nothing is left out that a parameter needs.

/// Rows of a sample, about.
pub const SAMPLE: usize = 8192;

/// Rows of each sort that are always among them.
pub const FIRST: usize = 40;

/// A hash of a line's number (Steele, Lea & Flood 2014): picks that follow no pattern of the recording.
#[must_use]
pub fn scatter(line: usize, file: usize) -> u64 {
    let mut z = (line as u64).wrapping_add((file as u64) << 48).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The generator of Steele, Lea & Flood, begun at 0: its first number.
    #[test]
    fn lines_are_scattered_by_the_published_hash() {
        assert_eq!(scatter(0, 0), 0xe220_a839_7b1d_cdaf);
        assert_ne!(scatter(7, 0), scatter(7, 1));
    }
}
