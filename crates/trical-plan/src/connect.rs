//! A collision-free way between two configurations where the straight one is blocked: two trees that grow towards each other
//! (RRT-Connect, Kuffner and LaValle 2000), then shortened.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use trical_model::ik::continue_from;
use trical_model::{Joints, MAX_JOINTS, Pose, State};

use crate::collision::{CollisionModel, Contact, MotionWorkspace};
use crate::joints::rounded;
use crate::random::uniform;
use crate::route::travel;

/// Longest step of a tree, rad.
const STEP: f64 = 0.5;
/// Nodes of both trees together.
const NODES: usize = 1500;

/// Via points of a way from `from` to `to`, every part of it checked: none for the straight way. `Err` holds what is in the way
/// of the straight one where no other was found.
pub(crate) fn connect(
    model: &CollisionModel,
    from: &Joints,
    to: &Joints,
    rng: &mut Pcg64Mcg,
    scratch: &mut MotionWorkspace,
) -> Result<Vec<Joints>, Contact> {
    let Some(blocked) = model.check_motion(from, to, None, scratch) else { return Ok(Vec::new()) };
    // up from both ends and across is what a person would do
    for height in [0.06, 0.12, 0.2] {
        let lifted: Vec<Joints> = [from, to].iter().filter_map(|q| lift(model, q, height, scratch)).collect();
        let ways: &[&[Joints]] = match lifted.as_slice() {
            [a, b] => &[&[*a], &[*b], &[*a, *b]],
            [a] => &[&[*a]],
            _ => &[],
        };
        for way in ways {
            if is_free(model, from, way, to, scratch) {
                return Ok(way.to_vec());
            }
        }
    }
    trees(model, from, to, rng, scratch).map(|way| shorten(model, from, way, to, rng, scratch)).ok_or(blocked)
}

fn is_free(model: &CollisionModel, from: &Joints, way: &[Joints], to: &Joints, scratch: &mut MotionWorkspace) -> bool {
    let mut at = from;
    for next in way.iter().chain(std::iter::once(to)) {
        if model.check_motion(at, next, None, scratch).is_some() {
            return false;
        }
        at = next;
    }
    true
}

/// The same pose of the tool, `height` m higher in {w}, on the same branch.
fn lift(model: &CollisionModel, q: &Joints, height: f64, scratch: &mut MotionWorkspace) -> Option<Joints> {
    let forward = model.forward();
    let robot = &forward.model().robot;
    let mut pose: Pose = forward.world_from_tool(&State::at(q), scratch.forward());
    pose.translation.z += height;
    let up = continue_from(forward, &pose, &State::at(q), scratch.forward()).ok()?;
    let up = rounded(robot, &up);
    robot.within_limits(&up, 0.0).then_some(up)
}

struct Tree {
    nodes: Vec<(Joints, usize)>,
}

impl Tree {
    fn nearest(&self, q: &Joints) -> usize {
        (0..self.nodes.len())
            .reduce(|a, b| if travel(&self.nodes[b].0, q) < travel(&self.nodes[a].0, q) { b } else { a })
            .unwrap_or(0)
    }

    /// One step towards `q`; the new node and whether it is there.
    fn extend(&mut self, q: &Joints, model: &CollisionModel, scratch: &mut MotionWorkspace) -> Option<(usize, bool)> {
        let near = self.nearest(q);
        let at = self.nodes[near].0;
        let far = travel(&at, q);
        let share = if far > STEP { STEP / far } else { 1.0 };
        let mut next = *q;
        if share < 1.0 {
            for (x, (a, b)) in next.iter_mut().zip(at.iter().zip(q)) {
                *x = a + share * (b - a);
            }
            next = rounded(&model.forward().model().robot, &next);
        }
        let inside = model.forward().model().robot.within_limits(&next, 0.0);
        if !inside || model.check_motion(&at, &next, None, scratch).is_some() {
            return None;
        }
        self.nodes.push((next, near));
        Some((self.nodes.len() - 1, share >= 1.0))
    }

    /// From node `k` to the root, both included.
    fn branch(&self, mut k: usize) -> Vec<Joints> {
        let mut list = vec![self.nodes[k].0];
        while k != 0 {
            k = self.nodes[k].1;
            list.push(self.nodes[k].0);
        }
        list
    }
}

fn trees(
    model: &CollisionModel,
    from: &Joints,
    to: &Joints,
    rng: &mut Pcg64Mcg,
    scratch: &mut MotionWorkspace,
) -> Option<Vec<Joints>> {
    let joints = &model.forward().model().robot.joints;
    let mut trees = [Tree { nodes: vec![(*from, 0)] }, Tree { nodes: vec![(*to, 0)] }];
    let mut grown = 0;
    // a try that fails costs as much as one that succeeds
    for _ in 0..2 * NODES {
        if trees[0].nodes.len() + trees[1].nodes.len() > NODES {
            return None;
        }
        let mut goal = [0.0; MAX_JOINTS];
        for (x, (joint, (a, b))) in goal.iter_mut().zip(joints.iter().zip(from.iter().zip(to))) {
            // about both ends more than all over: a last joint that can turn twice need not
            let [low, high] = joint.limits;
            *x = uniform(rng, low.max(a.min(*b) - 1.5), high.min(a.max(*b) + 1.5));
        }
        let (mine, other) = trees.split_at_mut(1);
        let (tree, goal_tree) =
            if grown % 2 == 0 { (&mut mine[0], &mut other[0]) } else { (&mut other[0], &mut mine[0]) };
        grown += 1;
        let Some((new, _)) = tree.extend(&goal, model, scratch) else { continue };
        let target = tree.nodes[new].0;
        while let Some((k, there)) = goal_tree.extend(&target, model, scratch) {
            if there {
                let (first, second) = if grown % 2 == 1 {
                    (tree.branch(new), goal_tree.branch(k))
                } else {
                    (goal_tree.branch(k), tree.branch(new))
                };
                // first: meeting point .. from; second: meeting point .. to
                let mut way: Vec<Joints> = first.into_iter().rev().collect();
                way.extend(second.into_iter().skip(1));
                way.pop();
                if !way.is_empty() {
                    way.remove(0);
                }
                return Some(way);
            }
        }
    }
    None
}

/// Leaves out what can be left out.
fn shorten(
    model: &CollisionModel,
    from: &Joints,
    way: Vec<Joints>,
    to: &Joints,
    rng: &mut Pcg64Mcg,
    scratch: &mut MotionWorkspace,
) -> Vec<Joints> {
    let mut path = vec![*from];
    path.extend(way);
    path.push(*to);
    for _ in 0..60 {
        if path.len() < 3 {
            break;
        }
        let (mut i, mut j) = (rng.random_range(0..path.len()), rng.random_range(0..path.len()));
        if i > j {
            (i, j) = (j, i);
        }
        if j - i >= 2 && model.check_motion(&path[i], &path[j], None, scratch).is_none() {
            path.drain(i + 1..j);
        }
    }
    let mut i = 0;
    while i + 2 < path.len() {
        if model.check_motion(&path[i], &path[i + 2], None, scratch).is_none() {
            path.remove(i + 1);
        } else {
            i += 1;
        }
    }
    path.pop();
    path.remove(0);
    path
}
