//! Places, variables and regions in words.

/// "97 %".
pub(crate) fn percent(p: f64) -> String {
    format!("{:.0} %", 100.0 * p)
}

/// "joint 3", "joints 1 to 4", "joints 1, 3 and 4".
pub(crate) fn numbered(what: &str, mut numbers: Vec<usize>) -> Option<String> {
    numbers.sort_unstable();
    numbers.dedup();
    let (first, last) = (*numbers.first()?, *numbers.last()?);
    if first == last {
        return Some(format!("{what} {first}"));
    }
    if numbers.len() > 2 && last - first + 1 == numbers.len() {
        return Some(format!("{what}s {first} to {last}"));
    }
    let but_last: Vec<String> = numbers[..numbers.len() - 1].iter().map(ToString::to_string).collect();
    Some(format!("{what}s {} and {last}", but_last.join(", ")))
}

/// A text that begins with a capital letter.
#[must_use]
pub fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + chars.as_str())
}

/// A text that begins with a small letter.
pub(crate) fn small(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_lowercase().collect::<String>() + chars.as_str())
}

/// A variable in words: "q4" is "the angle of joint 4".
#[must_use]
pub fn variable(name: &str) -> String {
    let joint = |prefix| name.strip_prefix(prefix).filter(|n| n.parse::<usize>().is_ok());
    match (name, joint("q"), joint("dir")) {
        ("seq", ..) => "the number of the pose".into(),
        ("time", ..) => "the time".into(),
        (_, Some(n), _) => format!("the angle of joint {n}"),
        (_, _, Some(n)) => format!("the sense of joint {n}'s last motion"),
        _ => name.to_owned(),
    }
}

/// Where a mismatch without a known cause is, in words: "where the angle of joint 2 is below -32 deg", "depending on the angles of
/// joints 1 and 4".
#[must_use]
pub fn region(region: &str) -> String {
    match region.strip_prefix("all ").map(|all| all.strip_prefix("of ").ok_or(all)) {
        Some(Ok(of)) => format!("depending on {}", variables(&of.split(", with ").collect::<Vec<_>>())),
        Some(Err(all)) => format!("in all {all}"),
        None => {
            let (name, rest) = region.split_once(' ').unwrap_or((region, ""));
            let rest = rest.replacen('<', "below", 1).replacen('>', "above", 1);
            let mut what = variable(name);
            if rest.contains(" mm") {
                what = what.replace("the angle", "the position");
            }
            format!("where {what} is {rest}")
        }
    }
}

/// Variables in words: "the angles of joints 3 and 4".
pub(crate) fn variables(names: &[&str]) -> String {
    let joints: Vec<usize> = names.iter().filter_map(|name| name.strip_prefix('q')?.parse().ok()).collect();
    let all = joints.len() == names.len() && joints.len() > 1;
    match numbered("joint", joints).filter(|_| all) {
        Some(said) => format!("the angles of {said}"),
        None => names.iter().map(|name| variable(name)).collect::<Vec<_>>().join(" and "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_said_in_words() {
        for (name, said) in [
            ("q2 < -32 deg", "where the angle of joint 2 is below -32 deg"),
            ("time from 20.0 to 30.0 s", "where the time is from 20.0 to 30.0 s"),
            ("all of q4, with q1", "depending on the angles of joints 1 and 4"),
            ("q1 from 200.0 to 900.0 mm", "where the position of joint 1 is from 200.0 to 900.0 mm"),
            ("all of seq", "depending on the number of the pose"),
            ("all moves, in proportion to the last one", "in all moves, in proportion to the last one"),
        ] {
            assert_eq!(region(name), said);
        }
    }
}
