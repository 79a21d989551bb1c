//! Soon.
use super::scan::Scan;
/// x
#[must_use]
pub fn scan(_bytes: &[u8]) -> Scan { Scan::default() }
/// x
#[must_use]
pub fn header(_bytes: &[u8]) -> usize { 0 }
