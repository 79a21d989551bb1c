//! Dates in the names of recordings.

use std::path::Path;

/// A date such as 2026-11-22 in the name of a file, whatever its folder is called, in days.
pub(crate) fn day_in(path: &str) -> Option<f64> {
    let name = Path::new(path).file_name()?.to_str()?;
    name.as_bytes().windows(10).find_map(|w| {
        let text = std::str::from_utf8(w).ok()?;
        let mut parts = text.split('-');
        let mut next = |length: usize| {
            let part = parts.next().filter(|p| p.len() == length && p.bytes().all(|b| b.is_ascii_digit()))?;
            part.parse::<i64>().ok()
        };
        let (year, month, day) = (next(4)?, next(2)?, next(2)?);
        if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
            return None;
        }
        // days of the civil calendar, years that begin in March
        let (y, m) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
        Some((365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day) as f64)
    })
}

/// Places in the order of the dates in `names`; `None` where some have none.
pub(crate) fn by_date<'a>(names: impl Iterator<Item = &'a str>) -> Option<Vec<usize>> {
    let days: Vec<f64> = names.map(day_in).collect::<Option<_>>()?;
    let mut order: Vec<usize> = (0..days.len()).collect();
    order.sort_by(|a, b| days[*a].total_cmp(&days[*b]));
    Some(order)
}

/// The newest recording (from 0) by the dates in `names`; `None` where some have none.
#[must_use]
pub fn newest<'a>(names: impl Iterator<Item = &'a str>) -> Option<usize> {
    by_date(names)?.last().copied()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn dates_in_names_are_days_apart() {
        let days = |name: &str| day_in(name).unwrap();
        assert_eq!(days("cell 2026-03-01.csv") - days("runs/2026-02-27-morning.csv"), 2.0);
        assert_eq!(days("2024-03-01") - days("2024-02-27"), 3.0);
        assert_eq!(day_in("session3.csv"), None);
        assert_eq!(day_in("2025-01-01/2026-02-03.csv"), day_in("2026-02-03.csv"));
        assert_eq!(day_in("2025-01-01/session3.csv"), None);
        assert_eq!(day_in("2026-13-01.csv"), None);
    }

    #[test]
    fn names_are_ordered_by_their_dates_where_all_have_one() {
        let names = ["b 2026-02-01.csv", "a 2026-03-01.csv", "c 2026-01-01.csv"];
        assert_eq!((by_date(names.into_iter()), newest(names.into_iter())), (Some(vec![2, 0, 1]), Some(1)));
        assert_eq!(by_date(["2026-02-01.csv", "a.csv"].into_iter()), None);
    }
}
