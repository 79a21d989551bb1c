//! Dates in the names of recordings.

use std::path::Path;

/// A date such as 2026-11-22, 2026_11_22, 20261122 or 22.11.2026 in the name of a file, whatever its folder is called, in days.
pub(crate) fn day_in(path: &str) -> Option<f64> {
    let name = Path::new(path).file_name()?.to_str()?;
    // numbers, and what stands before each
    let mut numbers: Vec<(&str, &str)> = Vec::new();
    let mut rest = name;
    while let Some(from) = rest.find(|c: char| c.is_ascii_digit()) {
        let digits = &rest[from..];
        let to = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        numbers.push((&rest[..from], &digits[..to]));
        rest = &digits[to..];
    }
    let at_once = |digits: &str| (digits.len() == 8).then(|| day(&digits[..4], &digits[4..6], &digits[6..]))?;
    let in_parts = |w: &[(&str, &str)]| {
        let [(_, first), (mark, second), (next, third)] = w else { return None };
        match (first.len(), second.len(), third.len(), *mark) {
            _ if mark != next => None,
            (4, 2, 2, "-" | "_" | ".") => day(first, second, third),
            (2, 2, 4, ".") => day(third, second, first),
            _ => None,
        }
    };
    numbers.windows(3).find_map(in_parts).or_else(|| numbers.iter().find_map(|(_, digits)| at_once(digits)))
}

/// The day of the civil calendar; `None` where it is none of this age: a serial number, or a time.
fn day(year: &str, month: &str, day: &str) -> Option<f64> {
    let [year, month, day] = [year, month, day].map(|digits| digits.parse::<i64>().ok());
    let (year, month, day) = (year?, month?, day?);
    if !(1980..2100).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // years that begin in March
    let (y, m) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    Some((365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day) as f64)
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
        for same in ["20260301_run_1.csv", "cell_2026_03_01.csv", "01.03.2026 cell.csv", "cell7-2026-03-01-2.csv"] {
            assert_eq!(day_in(same), day_in("2026-03-01.csv"), "{same}");
        }
        for none in ["10452026.csv", "serial 4711_12_13.csv", "1-2-2026.csv", "2026-03_01.csv", "120260301.csv"] {
            assert_eq!(day_in(none), None, "{none}");
        }
    }

    #[test]
    fn names_are_ordered_by_their_dates_where_all_have_one() {
        let names = ["b 2026-02-01.csv", "a 2026-03-01.csv", "c 2026-01-01.csv"];
        assert_eq!((by_date(names.into_iter()), newest(names.into_iter())), (Some(vec![2, 0, 1]), Some(1)));
        assert_eq!(by_date(["2026-02-01.csv", "a.csv"].into_iter()), None);
    }
}
