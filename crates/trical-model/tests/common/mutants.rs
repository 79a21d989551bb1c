//! Valid texts with a few characters changed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const CASES: usize = 10_000;

/// Words that change what a number is, or what a file means.
const WORDS: [&str; 16] = [
    "nan",
    "inf",
    "-inf",
    "1e300",
    "-1e-300",
    "1e999",
    "0",
    "-0",
    "''",
    "[]",
    "{}",
    "true",
    "\n[[joint]]\n",
    "9",
    "\"",
    "<a>",
];

/// Gives mutants of the seeds to `check`, which says whether it took them: some are taken, and some are not.
pub fn mutants(seeds: &[&str], mut check: impl FnMut(&str) -> bool) {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut taken = 0;
    for _ in 0..CASES {
        let mut bytes = seeds[random.random_range(0..seeds.len())].as_bytes().to_vec();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            match random.random_range(0..6) {
                0 => bytes[at] = b"0123456789.-+e,[]{}\"=\n <>/"[random.random_range(0..26)],
                1 => {
                    bytes.remove(at);
                }
                2 => bytes.insert(at, random.random()),
                3 if random.random_range(0..20) == 0 => bytes.truncate(at + 1),
                // a whole number becomes a word
                _ => {
                    let of_number = |b: &u8| b.is_ascii_digit() || b".-e".contains(b);
                    let from = at - bytes[..at].iter().rev().take_while(|b| of_number(b)).count();
                    let upto = at + bytes[at..].iter().take_while(|b| of_number(b)).count();
                    bytes.splice(from..upto, WORDS[random.random_range(0..WORDS.len())].bytes());
                }
            }
        }
        if let Ok(text) = std::str::from_utf8(&bytes) {
            taken += usize::from(check(text));
        }
    }
    assert!(taken > CASES / 50 && taken < CASES, "{taken} of {CASES} were taken");
}
