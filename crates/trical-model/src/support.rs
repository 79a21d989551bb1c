//! Where a model was learnt: the joint angles that its recordings visited.

use crate::recording::Joints;
use crate::robot::{JointKind, Robot};

/// An angle this near to one that was visited counts as visited, rad (3 deg), and a place on a slide, m.
const REACH: [f64; 2] = [0.052_359_877_559_829_88, 0.03];

/// Joint angles that recordings visited, each modulo a turn: a curve that was learnt of a joint's angle holds there. Beyond them it returns
/// to nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Support {
    joints: Vec<Visited>,
}

/// Numbers of a unit of files (deg; mm of sliding joints) in one of ours.
fn per_si(turns: bool) -> f64 {
    if turns { 180.0 / std::f64::consts::PI } else { 1e3 }
}

/// A number in units of files, to a hundredth.
fn shown(turns: bool, q: f64) -> f64 {
    (q * per_si(turns) * 1e2).round() / 1e2
}

/// Stretches of one joint's angles, lower and upper end, in order; with no gap in one that is wider than twice the reach.
#[derive(Clone, Debug, PartialEq)]
struct Visited {
    turns: bool,
    stretches: Vec<[f64; 2]>,
}

impl Visited {
    fn of(turns: bool, mut stretches: Vec<[f64; 2]>) -> Self {
        stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut out: Vec<[f64; 2]> = Vec::new();
        for s in stretches {
            match out.last_mut() {
                Some(last) if s[0] - last[1] <= 2.0 * REACH[usize::from(!turns)] => last[1] = last[1].max(s[1]),
                _ => out.push(s),
            }
        }
        Self { turns, stretches: out }
    }

    /// Between minus half a turn and half a turn.
    fn within_turn(&self, q: f64) -> f64 {
        if self.turns { (q + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI } else { q }
    }

    fn covers(&self, q: f64) -> bool {
        let (q, reach) = (self.within_turn(q), REACH[usize::from(!self.turns)]);
        let turns: &[f64] = if self.turns { &[-std::f64::consts::TAU, 0.0, std::f64::consts::TAU] } else { &[0.0] };
        turns.iter().any(|turn| self.stretches.iter().any(|[a, b]| (a - reach..=b + reach).contains(&(q + turn))))
    }
}

impl Support {
    /// Of the joint angles of some poses (rad; m of sliding joints).
    #[must_use]
    pub fn of(robot: &Robot, poses: &[Joints]) -> Self {
        let visited = |(k, joint): (usize, &crate::robot::Joint)| {
            let none = Visited { turns: joint.kind == JointKind::Revolute, stretches: Vec::new() };
            // as a file has it
            let of = |q: &Joints| shown(none.turns, none.within_turn(q[k])) / per_si(none.turns);
            Visited::of(none.turns, poses.iter().map(|q| [of(q); 2]).collect())
        };
        Self { joints: robot.joints.iter().enumerate().map(visited).collect() }
    }

    /// Of stretches as [`Self::stretches`] gives them; numbers that are not finite or not in order are left out.
    #[must_use]
    pub fn from_stretches(robot: &Robot, stretches: &[Vec<[f64; 2]>]) -> Self {
        let visited = |(joint, own): (&crate::robot::Joint, &Vec<[f64; 2]>)| {
            let turns = joint.kind == JointKind::Revolute;
            let si = own.iter().map(|s| s.map(|x| x / per_si(turns)));
            let good = si.filter(|[a, b]| a.is_finite() && b.is_finite() && a <= b);
            Visited::of(turns, good.collect())
        };
        Self { joints: robot.joints.iter().zip(stretches).map(visited).collect() }
    }

    /// For each joint the stretches that were visited, lower and upper end in deg (mm of sliding joints), to a hundredth.
    #[must_use]
    pub fn stretches(&self) -> Vec<Vec<[f64; 2]>> {
        let of = |v: &Visited| v.stretches.iter().map(|s| s.map(|q| shown(v.turns, q))).collect();
        self.joints.iter().map(of).collect()
    }

    /// This and another one of the same arm.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        if self.joints.is_empty() {
            return other.clone();
        }
        let both = |(a, b): (&Visited, &Visited)| Visited::of(a.turns, [&a.stretches[..], &b.stretches[..]].concat());
        Self { joints: self.joints.iter().zip(&other.joints).map(both).collect() }
    }

    /// The same for some joints (from 1) alone: what hangs on the others' angles is known everywhere.
    #[must_use]
    pub fn of_joints(&self, matters: impl Fn(usize) -> bool) -> Self {
        let everywhere = |turns| Visited { turns, stretches: vec![[f64::NEG_INFINITY, f64::INFINITY]] };
        let each = self.joints.iter().enumerate();
        Self { joints: each.map(|(k, v)| if matters(k + 1) { v.clone() } else { everywhere(v.turns) }).collect() }
    }

    /// From the lowest to the highest angle of a joint (from 1) that was visited, rad (m of a sliding one); `None` where none was.
    #[must_use]
    pub fn stroke(&self, joint: usize) -> Option<f64> {
        let stretches = &self.joints.get(joint - 1)?.stretches;
        Some(stretches.last()?[1] - stretches.first()?[0])
    }

    /// Whether nothing is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// What is not visited, in words: `{n} targets are` this.
    #[must_use]
    pub fn beyond_in_words(&self) -> &'static str {
        if self.joints.iter().all(|v| v.turns) {
            "more than 3 deg away from all joint angles that the model was fitted at"
        } else {
            "more than 3 deg (30 mm on a linear axis) away from all joint positions that the model was fitted at"
        }
    }

    /// The first joint (from 1) whose angle was not visited; `None` where all were, or nothing is known.
    #[must_use]
    pub fn beyond(&self, q: &Joints) -> Option<usize> {
        self.joints.iter().zip(q).position(|(visited, q)| !visited.covers(*q)).map(|k| k + 1)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn robot() -> Robot {
        Robot::parse(include_str!("../../../robots/kr6_r700.toml"), "kr6_r700").unwrap()
    }

    fn at(q1_deg: f64) -> Joints {
        let mut q = [0.0; crate::MAX_JOINTS];
        q[0] = q1_deg.to_radians();
        q
    }

    #[test]
    fn what_was_visited_is_known_modulo_a_turn_and_three_degrees_around() {
        let s = Support::of(&robot(), &[at(-178.0), at(-170.0), at(-173.0), at(10.0), at(40.0)]);
        assert_eq!(s.stretches()[0], [[-178.0, -170.0], [10.0, 10.0], [40.0, 40.0]]);
        for known in [-175.0, -181.0 + 360.0, 180.0, 12.9, 370.0, -350.0, 37.1] {
            assert_eq!(s.beyond(&at(known)), None, "{known}");
        }
        for new in [-166.9, 0.0, 25.0, 44.0, 170.0] {
            assert_eq!(s.beyond(&at(new)), Some(1), "{new}");
        }
        assert_eq!(s.of_joints(|joint| joint != 1).beyond(&at(0.0)), None);
        assert!((s.stroke(1).unwrap().to_degrees() - 218.0).abs() < 1e-9 && s.stroke(2) == Some(0.0));
        assert_eq!(Support::default().stroke(1), None);
        // another joint
        let mut q = at(10.0);
        q[3] = 1.0;
        assert_eq!(s.beyond(&q), Some(4));
    }

    #[test]
    fn sessions_are_joined_and_come_back_from_their_numbers() {
        let [a, b] = [[at(0.0), at(2.0)], [at(5.0), at(90.0)]].map(|q| Support::of(&robot(), &q));
        let both = a.with(&b);
        assert_eq!(both.stretches()[0], [[0.0, 5.0], [90.0, 90.0]]);
        assert_eq!(Support::from_stretches(&robot(), &both.stretches()), both);
        assert_eq!(Support::default().with(&a), a);
        assert_eq!(Support::default().beyond(&at(3.0)), None);
    }

    #[test]
    fn words_give_the_reach_of_slides_only_where_there_are_some() {
        let mut with_rail = robot();
        assert!(!Support::of(&with_rail, &[]).beyond_in_words().contains("linear"));
        with_rail.joints[0].kind = JointKind::Prismatic;
        assert!(Support::of(&with_rail, &[]).beyond_in_words().contains("30 mm on a linear axis"));
    }
}
