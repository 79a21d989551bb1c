//! Joint limits, whole turns, and when two solutions are one.

use std::f64::consts::TAU;

use super::error::IkError;
use crate::recording::Joints;
use crate::robot::{Joint, JointKind, Robot};

/// No pose has more solutions than this listed: an arm of six joints that turn twice has 8 branches x 64 wraps.
pub(super) const MOST: usize = 4096;

/// Of a joint whose limits leave more whole turns, those nearest to their middle are listed.
const TURNS: usize = 5;

/// Solutions that differ by less than this in every joint are one, rad or m.
const SAME: f64 = 1e-6;

/// A joint may pass its limit by this much, rad or m; it is then put on the limit.
const LIMIT_SLACK: f64 = 1e-12;

/// `q` with every revolute joint turned into the turn about the middle of its limits.
pub(super) fn principal(robot: &Robot, q: &Joints) -> Joints {
    let mut out = *q;
    for (x, j) in out.iter_mut().zip(&robot.joints) {
        if j.kind == JointKind::Revolute {
            let middle = 0.5 * (j.limits[0] + j.limits[1]);
            *x -= TAU * ((*x - middle) / TAU).round();
        }
    }
    out
}

pub(super) fn same(robot: &Robot, a: &Joints, b: &Joints) -> bool {
    robot.joints.iter().zip(a.iter().zip(b)).all(|(j, (x, y))| {
        let mut d = x - y;
        if j.kind == JointKind::Revolute {
            d -= TAU * (d / TAU).round();
        }
        d.abs() < SAME
    })
}

pub(super) fn farthest(n: usize, a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).take(n).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

fn beyond(robot: &Robot, joint: usize, value: f64) -> IkError {
    let j = &robot.joints[joint];
    let [lower, upper] = j.limits;
    match j.kind {
        JointKind::Revolute => {
            IkError::OutOfLimits { joint: joint + 1, value_rad: value, lower_rad: lower, upper_rad: upper }
        }
        JointKind::Prismatic => {
            IkError::OutOfTravel { joint: joint + 1, value_m: value, lower_m: lower, upper_m: upper }
        }
    }
}

/// How far beyond limits an error says the arm would be.
pub(super) fn excess(e: &IkError) -> f64 {
    match *e {
        IkError::OutOfLimits { value_rad: v, lower_rad: l, upper_rad: u, .. }
        | IkError::OutOfTravel { value_m: v, lower_m: l, upper_m: u, .. } => (l - v).max(v - u),
        _ => 0.0,
    }
}

/// Checks limits, and puts joints that pass one by rounding onto it.
pub(super) fn put_within(robot: &Robot, q: &mut Joints) -> Result<(), IkError> {
    let mut worst: Option<IkError> = None;
    for (i, j) in robot.joints.iter().enumerate() {
        let over = (j.limits[0] - q[i]).max(q[i] - j.limits[1]);
        if over > LIMIT_SLACK {
            let e = beyond(robot, i, q[i]);
            if worst.as_ref().is_none_or(|w| excess(w) < excess(&e)) {
                worst = Some(e);
            }
        } else {
            q[i] = q[i].clamp(j.limits[0], j.limits[1]);
        }
    }
    worst.map_or(Ok(()), Err)
}

/// The least of the whole turns of `value` that is not below `lower`.
#[inline]
fn first_from(lower: f64, value: f64) -> f64 {
    // `ceil` is a call where the processor is not asked for its own
    if (lower..lower + TAU).contains(&value) { value } else { value + TAU * ((lower - value) / TAU).ceil() }
}

/// Whether some whole turn of a revolute joint at `value` can be within its limits, with a little to spare.
#[inline]
pub(super) fn may_be_within(joint: &Joint, value: f64) -> bool {
    const SPARE: f64 = 1e-9;
    let [lower, upper] = joint.limits;
    first_from(lower - SPARE, value) <= upper + SPARE
}

/// `q` within limits, where every joint has one way to be there: the usual case, for which nothing is allocated.
fn only_wrap(robot: &Robot, q: &Joints) -> Option<Joints> {
    let mut out = *q;
    for (x, j) in out.iter_mut().zip(&robot.joints) {
        let [lower, upper] = [j.limits[0] - LIMIT_SLACK, j.limits[1] + LIMIT_SLACK];
        if j.kind == JointKind::Revolute {
            *x = first_from(lower, *x);
            if *x + TAU <= upper {
                return None;
            }
        }
        if *x < lower || *x > upper {
            return None;
        }
        *x = x.clamp(j.limits[0], j.limits[1]);
    }
    Some(out)
}

/// Hands on all whole turns of `q` within limits.
pub(super) fn all_wraps(robot: &Robot, q: &Joints, mut found: impl FnMut(Joints)) -> Result<(), IkError> {
    if let Some(only) = only_wrap(robot, q) {
        found(only);
        return Ok(());
    }
    let mut worst: Option<IkError> = None;
    let mut wraps = vec![*q];
    for (i, j) in robot.joints.iter().enumerate() {
        let [lower, upper] = j.limits;
        let mut values = Vec::with_capacity(3);
        if j.kind == JointKind::Revolute {
            let mut v = first_from(lower - LIMIT_SLACK, q[i]);
            while v <= upper + LIMIT_SLACK {
                values.push(v.clamp(lower, upper));
                v += TAU;
            }
            if values.len() > TURNS {
                let from_middle = |v: &f64| (v - 0.5 * (lower + upper)).abs();
                values.sort_by(|a, b| from_middle(a).total_cmp(&from_middle(b)));
                values.truncate(TURNS);
            }
        } else if q[i] >= lower - LIMIT_SLACK && q[i] <= upper + LIMIT_SLACK {
            values.push(q[i].clamp(lower, upper));
        }
        if values.is_empty() {
            let e = beyond(robot, i, q[i]);
            if worst.as_ref().is_none_or(|w| excess(w) < excess(&e)) {
                worst = Some(e);
            }
            continue;
        }
        let before = std::mem::take(&mut wraps);
        for w in before.iter().take(MOST / values.len().max(1)) {
            for v in &values {
                let mut next = *w;
                next[i] = *v;
                wraps.push(next);
            }
        }
    }
    if let Some(e) = worst {
        return Err(e);
    }
    wraps.into_iter().for_each(found);
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f64::consts::PI;

    use super::*;
    use crate::recording::MAX_JOINTS;

    #[test]
    fn of_limits_that_leave_many_turns_those_about_the_middle_are_listed() {
        let mut robot = Robot::parse(include_str!("../../tests/data/arm.toml"), "arm.toml").unwrap();
        robot.joints[0].limits = [-166.0, 166.0];
        let mut found = Vec::new();
        all_wraps(&robot, &[0.5; MAX_JOINTS], |joints| found.push(joints)).unwrap();
        let mut turns: Vec<f64> = found.iter().map(|q| ((q[0] - 0.5) / TAU).round()).collect();
        turns.sort_by(f64::total_cmp);
        turns.dedup();
        assert_eq!(turns, [-2.0, -1.0, 0.0, 1.0, 2.0]);
    }

    #[test]
    fn an_angle_that_is_a_turn_from_itself_within_limits_is_both() {
        let mut robot = Robot::parse(include_str!("../../tests/data/arm.toml"), "arm.toml").unwrap();
        robot.joints[5].limits = [-PI, PI];
        let ends = |at: f64| {
            let (mut q, mut out) = ([0.0; MAX_JOINTS], Vec::new());
            q[5] = at;
            all_wraps(&robot, &q, |joints| out.push(joints)).map(|()| out.iter().map(|q| q[5]).collect::<Vec<_>>())
        };
        assert_eq!(ends(PI).unwrap(), [-PI, PI]);
        assert_eq!(ends(-PI).unwrap(), [-PI, PI]);
        assert_eq!(ends(3.0).unwrap(), [3.0]);
    }
}
