//! Which pairs can meet, and how fast they can approach each other.

use nalgebra::Vector3;
use trical_model::{Joint, JointKind, Joints, MAX_JOINTS, Pose, trig};

use super::{CollisionModel, Contact, MotionWorkspace};
use crate::geometry::Role;
use crate::solid::Core;

type V3 = Vector3<f64>;

/// Two solids that can meet. `a` is on the arm; `b` is nearer to the base or stands still.
#[derive(Clone, Debug)]
pub(super) struct Pair {
    pub a: usize,
    pub b: usize,
    /// A stem and this ball: they may meet while it is touched.
    ball: Option<usize>,
    /// {b's box} from {w}, where b is a box that stands still.
    pub still: Pose,
    /// Largest speed of a point of a's core against b for a unit speed of each joint, m/rad (1 for sliding joints).
    pub speed: Joints,
}

impl Pair {
    #[inline]
    pub fn allowed(&self, touched: Option<usize>) -> bool {
        self.ball.is_some() && self.ball == touched
    }
}

pub(super) fn build(model: &CollisionModel, ignore: &[(String, String)]) -> Vec<Pair> {
    let world = model.joints + 1;
    let mut pairs = Vec::new();
    for (i, p) in model.parts.iter().enumerate() {
        for (j, q) in model.parts.iter().enumerate().skip(i + 1) {
            // the one that is further out on the arm comes first
            let (a, b) = match (p.frame == world, q.frame == world) {
                (true, true) => continue,
                (false, true) => (i, j),
                (true, false) => (j, i),
                (false, false) if p.frame >= q.frame => (i, j),
                (false, false) => (j, i),
            };
            let (x, y) = (&model.parts[a], &model.parts[b]);
            let (bx, by) = (&model.bodies[x.body], &model.bodies[y.body]);
            let carried = if y.frame == world { 0 } else { y.frame };
            let neighbours = y.frame != world && x.frame == carried + 1 && !bx.device && !by.device;
            let named = |s: &String, t: &String| (*s == bx.name && *t == by.name) || (*s == by.name && *t == bx.name);
            if x.frame == carried || neighbours || ignore.iter().any(|(s, t)| named(s, t)) {
                continue;
            }
            let ball = match (bx.role, by.role) {
                (Role::Stem(_), Role::Ball(k)) => Some(k),
                _ => None,
            };
            let still = match &y.solid.core {
                Core::Box(frame, _) => frame.inverse(),
                _ => Pose::identity(),
            };
            pairs.push(Pair { a, b, ball, still, speed: speeds(model, a, carried) });
        }
    }
    pairs
}

/// Largest speed of a point of part `a`'s core in frame {carried} for a unit speed of each joint between the two.
///
/// A joint turns a point about its axis with the point's distance from the axis as lever. From the axis to the next frame's
/// origin that is `hypot(a, d sin alpha)`; from there on no more than the lengths of all links that follow and, in the
/// part's own frame, the distance of its farthest corner, whatever the joints between do.
fn speeds(model: &CollisionModel, a: usize, carried: usize) -> Joints {
    let part = &model.parts[a];
    let joints = &model.forward.model().robot.joints;
    let corners = part.solid.corners();
    let mut speed = [0.0; MAX_JOINTS];
    // from the origin of frame {k + 2} to the farthest corner
    let mut beyond = corners.iter().map(V3::norm).fold(0.0, f64::max);
    for k in (carried..part.frame).rev() {
        let lever = if k + 1 == part.frame {
            corners.iter().map(|c| libm::hypot(c.x, c.y)).fold(0.0, f64::max)
        } else {
            let next = &joints[k + 1];
            let lever = libm::hypot(next.a, slide(next) * trig::sin(next.alpha)) + beyond;
            beyond += libm::hypot(next.a, slide(next));
            lever
        };
        speed[k] = if joints[k].kind == JointKind::Prismatic { 1.0 } else { lever };
    }
    speed
}

/// Largest |d| of a joint, m.
pub(super) fn slide(joint: &Joint) -> f64 {
    match joint.kind {
        JointKind::Revolute => joint.d.abs(),
        JointKind::Prismatic => (joint.d + joint.limits[0]).abs().max((joint.d + joint.limits[1]).abs()),
    }
}

/// Pairs on the arm itself that meet at each of many configurations all over the joint ranges; of an arm on a rail also its carriage and
/// what the rail lies on.
pub(super) fn always_in_contact(model: &CollisionModel) -> Vec<Contact> {
    let robot = &model.forward.model().robot;
    let mut ws = MotionWorkspace::new(model);
    let carriage = robot.is_on_rail().then_some(1);
    let of_arm = |p: &&Pair| model.parts[p.b].frame <= model.joints || Some(model.parts[p.a].frame) == carriage;
    let mut left: Vec<Contact> = model.pairs.iter().filter(of_arm).map(|p| model.contact(p)).collect();
    left.sort_unstable();
    left.dedup();
    const SAMPLES: u32 = 100;
    for k in 0..SAMPLES {
        if left.is_empty() {
            break;
        }
        let mut q = [0.0; MAX_JOINTS];
        for (i, (x, joint)) in q.iter_mut().zip(&robot.joints).enumerate() {
            // multiples of irrational numbers fill the ranges evenly
            let step = [0.7548, 0.5698, 0.8191, 0.6710, 0.5497, 0.4503, 0.8567, 0.7339, 0.6287][i % MAX_JOINTS];
            let u = (0.5 + step * f64::from(k)).fract();
            *x = joint.limits[0] + u * (joint.limits[1] - joint.limits[0]);
        }
        let MotionWorkspace { ws, links, .. } = &mut ws;
        model.place(&q, ws, links);
        left.retain(|c| {
            model.pairs.iter().any(|p| model.contact(p) == *c && model.pair_distance(p, links) < model.margin)
        });
    }
    left
}
