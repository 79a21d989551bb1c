//! Configurations at which a calibrated arm is to prove itself: in a sphere, or all over the workspace.

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use trical_model::pose::rotation_z;
use trical_model::{Joints, MAX_JOINTS, Pose, State, inverse_kinematics, trig};

use crate::collision::{CollisionModel, MotionWorkspace};
use crate::error::{PlanError, Result};
use crate::joints::rounded;
use crate::random::{any_rotation, downward, generator, uniform};

type V3 = Vector3<f64>;

/// How the tool is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Facing {
    /// Any way.
    Any,
    /// Its z axis within this angle of straight down, rad.
    Down {
        /// rad.
        tilt_rad: f64,
    },
    /// An axis of the tool towards a point, as a reflector must face a tracker; any turn about it.
    Towards {
        /// In {w}, m.
        point: V3,
        /// In the tool's axes; need not be of unit length.
        axis_in_tool: V3,
        /// Largest angle between the two, rad.
        within_rad: f64,
    },
}

/// Settings of the generators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValidationOptions {
    /// Seed of all random choices.
    pub seed: u64,
    /// How the tool is held.
    pub facing: Facing,
}

/// Attempts for each configuration before giving up.
const ATTEMPTS: usize = 500;

impl Default for ValidationOptions {
    fn default() -> Self {
        Self { seed: 1, facing: Facing::Any }
    }
}

/// A random orientation of the tool at `place`.
fn orientation(facing: &Facing, place: &V3, rng: &mut Pcg64Mcg) -> Matrix3<f64> {
    match facing {
        Facing::Any => any_rotation(rng),
        Facing::Down { tilt_rad } => downward(rng, *tilt_rad, [-std::f64::consts::PI, std::f64::consts::PI]),
        Facing::Towards { point, axis_in_tool, within_rad } => {
            let to = point - place;
            let z_from = |v: &V3| {
                let z = v.try_normalize(1e-12).unwrap_or_else(V3::z);
                let x = z.cross(&if z.x.abs() < 0.9 { V3::x() } else { V3::y() }).normalize();
                Matrix3::from_columns(&[x, z.cross(&x), z])
            };
            // downward's -z is the middle of its cap: turn that onto the line of sight
            let flip = trical_model::pose::rotation_x(std::f64::consts::PI);
            let near = flip * downward(rng, *within_rad, [0.0, 0.0]);
            let turn = rotation_z(uniform(rng, -std::f64::consts::PI, std::f64::consts::PI));
            z_from(&to) * near * turn * z_from(axis_in_tool).transpose()
        }
    }
}

/// `count` configurations with the TCP uniformly distributed in the sphere about `centre` ({w}, m) of radius `radius` (m; the
/// paper's is 0.2), reachable and free of collisions where they stand, each of its branches at random.
///
/// # Errors
/// [`PlanError::TooFewPoses`] where the attempts are used up.
pub fn poses_in_sphere(
    model: &CollisionModel,
    centre: &V3,
    radius: f64,
    count: usize,
    options: &ValidationOptions,
) -> Result<Vec<Joints>> {
    collect(model, count, options, 5, |rng, scratch| {
        // uniform in the ball: radius by the cube root
        let z = uniform(rng, -1.0, 1.0);
        let around = uniform(rng, -std::f64::consts::PI, std::f64::consts::PI);
        let r = radius * libm::cbrt(rng.random::<f64>());
        let s = (1.0 - z * z).sqrt();
        let place = centre + V3::new(s * trig::cos(around), s * trig::sin(around), z) * r;
        take(model, &place, options, rng, scratch)
    })
}

/// `count` configurations all over the workspace: random joints, free of collisions where they stand. Where the tool has to be
/// held some way, the TCP stays where random joints bring it and the tool is turned.
///
/// # Errors
/// [`PlanError::TooFewPoses`] where the attempts are used up.
pub fn poses_in_workspace(model: &CollisionModel, count: usize, options: &ValidationOptions) -> Result<Vec<Joints>> {
    let forward = model.forward();
    let robot = &forward.model().robot;
    collect(model, count, options, 6, |rng, scratch| {
        let mut q = [0.0; MAX_JOINTS];
        for (x, joint) in q.iter_mut().zip(&robot.joints) {
            *x = uniform(rng, joint.limits[0], joint.limits[1]);
        }
        let q = rounded(robot, &q);
        if options.facing == Facing::Any {
            let free = robot.within_limits(&q, 0.0) && model.check_joints(&q, None, scratch).is_none();
            return free.then_some(q);
        }
        let place = forward.world_from_tool(&State::at(&q), scratch.forward()).translation;
        take(model, &place, options, rng, scratch)
    })
}

/// One way to bring the TCP to `place`, at random.
fn take(
    model: &CollisionModel,
    place: &V3,
    options: &ValidationOptions,
    rng: &mut Pcg64Mcg,
    scratch: &mut MotionWorkspace,
) -> Option<Joints> {
    let forward = model.forward();
    let robot = &forward.model().robot;
    let pose = Pose { rotation: orientation(&options.facing, place, rng), translation: *place };
    let all = inverse_kinematics(forward, &pose, &State::at(&[]), scratch.forward()).ok()?;
    let free: Vec<Joints> = all
        .iter()
        .map(|s| rounded(robot, &s.joints))
        .filter(|q| robot.within_limits(q, 0.0))
        .filter(|q| model.check_joints(q, None, scratch).is_none())
        .collect();
    if free.is_empty() {
        return None;
    }
    free.get(rng.random_range(0..free.len())).copied()
}

/// The first `count` successes of attempts that know only their number.
fn collect(
    model: &CollisionModel,
    count: usize,
    options: &ValidationOptions,
    stream: u64,
    attempt: impl Fn(&mut Pcg64Mcg, &mut MotionWorkspace) -> Option<Joints> + Sync,
) -> Result<Vec<Joints>> {
    let most = count.saturating_mul(ATTEMPTS);
    let mut found = Vec::with_capacity(count);
    let mut done = 0;
    while found.len() < count && done < most {
        let chunk = done..(done + 256).min(most);
        done = chunk.end;
        let some: Vec<Option<Joints>> = chunk
            .into_par_iter()
            .map_init(
                || MotionWorkspace::new(model),
                |scratch, k| attempt(&mut generator(options.seed, stream, k as u64), scratch),
            )
            .collect();
        found.extend(some.into_iter().flatten());
    }
    found.truncate(count);
    if found.len() < count {
        return Err(PlanError::TooFewPoses { found: found.len(), wanted: count, attempts: done });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

    use super::*;
    use crate::plan::tests::irb120;

    fn model() -> CollisionModel {
        let (robot, cell) = irb120();
        CollisionModel::new(&robot, &cell).unwrap()
    }

    fn all_good(model: &CollisionModel, poses: &[Joints]) {
        let mut scratch = MotionWorkspace::new(model);
        for q in poses {
            assert!(model.forward().model().robot.within_limits(q, 0.0));
            assert!(model.check_joints(q, None, &mut scratch).is_none());
        }
    }

    #[test]
    fn a_hundred_poses_in_the_papers_sphere_face_the_tracker() {
        let model = model();
        let (centre, tracker) = (V3::new(0.15, 0.087, 0.15), V3::new(0.15, 3.0, 0.5));
        let facing = Facing::Towards { point: tracker, axis_in_tool: V3::z(), within_rad: 0.4 };
        let options = ValidationOptions { facing, ..ValidationOptions::default() };
        let poses = poses_in_sphere(&model, &centre, 0.2, 100, &options).unwrap();
        assert_eq!(poses.len(), 100);
        all_good(&model, &poses);
        let mut ws = model.forward().workspace();
        let mut shells = 0;
        for q in &poses {
            let tool = model.forward().world_from_tool(&State::at(q), &mut ws);
            let off = (tool.translation - centre).norm();
            assert!(off < 0.2 + 1e-6);
            shells += usize::from(off > 0.2 * 0.5_f64.cbrt());
            let sight = (tracker - tool.translation).normalize();
            assert!(tool.rotation.column(2).dot(&sight) > 0.4_f64.cos() - 1e-6);
        }
        // half of a ball's volume lies beyond that radius
        assert!((25..=75).contains(&shells), "{shells}");
    }

    #[test]
    fn five_hundred_poses_fill_the_workspace() {
        let model = model();
        let poses = poses_in_workspace(&model, 500, &ValidationOptions::default()).unwrap();
        all_good(&model, &poses);
        for k in 0..6 {
            let [low, high] = model.forward().model().robot.joints[k].limits;
            let (min, max) = poses.iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(q[k]), b.max(q[k])));
            assert!(max - min > 0.75 * (high - low), "joint {}: {min} to {max}", k + 1);
        }
        let down = ValidationOptions { facing: Facing::Down { tilt_rad: 0.5 }, ..ValidationOptions::default() };
        all_good(&model, &poses_in_workspace(&model, 50, &down).unwrap());
    }

    #[test]
    fn a_sphere_out_of_reach_is_an_error() {
        let e = poses_in_sphere(&model(), &V3::new(9.0, 0.0, 0.0), 0.2, 3, &ValidationOptions::default()).unwrap_err();
        assert_eq!(e.to_string(), "0 collision-free configurations found in 1500 attempts, expected 3");
    }
}
