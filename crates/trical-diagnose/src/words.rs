//! Places, variables and regions in words.

use trical_ident::fit::cautions::listed;
use trical_model::Robot;

/// "97 %", "62 to 97 %".
pub(crate) fn percents(of: [f64; 2]) -> String {
    let [low, high] = of.map(|p| format!("{:.0}", 100.0 * p));
    if low == high { format!("{high} %") } else { format!("{low} to {high} %") }
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
    Some(format!("{what}s {}", listed(&numbers.iter().map(ToString::to_string).collect::<Vec<_>>(), "and")))
}

/// A text that begins with a small letter.
#[must_use]
pub fn small(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_lowercase().collect::<String>() + chars.as_str())
}

/// A variable in words: "q4" is "the angle of joint 4", or its position where it slides.
#[must_use]
pub fn variable(name: &str, robot: &Robot) -> String {
    let joint = |prefix| name.strip_prefix(prefix).and_then(|n| n.parse::<usize>().ok());
    match (name, joint("q"), joint("dir")) {
        ("seq", ..) => "the number of the pose".into(),
        ("time", ..) => "the time".into(),
        (_, Some(n), _) if robot.slides(n) => format!("the position of joint {n}"),
        (_, Some(n), _) => format!("the angle of joint {n}"),
        (_, _, Some(n)) => format!("the sense of joint {n}'s last motion"),
        _ => joint("tau").map_or_else(|| name.to_owned(), |n| format!("the torque of joint {n}")),
    }
}

/// Where a mismatch without a known cause is, in words: "where the angle of joint 2 is below -32 deg", "depending on the angles of
/// joints 1 and 4".
#[must_use]
pub fn region(region: &str, robot: &Robot) -> String {
    match region.strip_prefix("all ").map(|all| all.strip_prefix("of ").ok_or(all)) {
        Some(Ok(of)) => {
            let (of, again) = period(of);
            format!("depending on {}{again}", variables(&of.split(", with ").collect::<Vec<_>>(), robot))
        }
        Some(Err(all)) => format!("in all {all}"),
        None => {
            let (name, rest) = region.split_once(' ').unwrap_or((region, ""));
            let rest = rest.replacen('<', "below", 1).replacen('>', "above", 1);
            format!("where {} is {rest}", variable(name, robot))
        }
    }
}

/// A region without the period of what repeats in it, and that in words: ", the same every 0.0409 deg".
pub(crate) fn period(region: &str) -> (&str, String) {
    region
        .split_once(", every ")
        .map_or((region, String::new()), |(of, every)| (of, format!(", the same every {every}")))
}

/// Variables in words: "the angles of joints 3 and 4", "the position of joint 1 and the angle of joint 4".
pub(crate) fn variables(names: &[&str], robot: &Robot) -> String {
    let joints: Vec<usize> = names.iter().filter_map(|name| name.strip_prefix('q')?.parse().ok()).collect();
    let all = joints.len() == names.len() && joints.len() > 1 && !joints.iter().any(|j| robot.slides(*j));
    match numbered("joint", joints).filter(|_| all) {
        Some(said) => format!("the angles of {said}"),
        None => names.iter().map(|name| variable(name, robot)).collect::<Vec<_>>().join(" and "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::arm;

    #[test]
    fn regions_are_said_in_words() {
        let mut robot = arm().robot;
        let said = |robot: &Robot, names: &[[&str; 2]]| {
            for [name, words] in names {
                assert_eq!(region(name, robot), *words);
            }
        };
        said(
            &robot,
            &[
                ["q2 < -32 deg", "where the angle of joint 2 is below -32 deg"],
                ["time from 20.0 to 30.0 s", "where the time is from 20.0 to 30.0 s"],
                ["all of q4, with q1", "depending on the angles of joints 1 and 4"],
                ["all of seq", "depending on the number of the pose"],
                ["all of q2, every 0.0409 deg", "depending on the angle of joint 2, the same every 0.0409 deg"],
                ["all moves, in proportion to the last one", "in all moves, in proportion to the last one"],
            ],
        );
        robot.joints[0].kind = trical_model::JointKind::Prismatic;
        said(
            &robot,
            &[
                ["q1 from 200.0 to 900.0 mm", "where the position of joint 1 is from 200.0 to 900.0 mm"],
                ["all of q1", "depending on the position of joint 1"],
                ["all of q4, with q1", "depending on the angle of joint 4 and the position of joint 1"],
            ],
        );
    }
}
