//! Whole calibrations without hardware: an arm drawn by chance is touched, identified, and compared with itself.
//!
//! The true arm is another arm: every number of its Denavit-Hartenberg table, its base and its tool is changed, those that no
//! fit could tell from others too, and every joint gives way. It knows nothing of what a solver calls its parameters.

use nalgebra::Vector3;
use rand::seq::SliceRandom;
use rand_distr::{Distribution, Normal, Uniform};
use rand_pcg::Pcg64Mcg;
use trical_ident::rigid::rigid_from_points;
use trical_ident::{Dataset, ErrorSummary, JointSource, ParameterSet, identify};
use trical_model::ik::continue_from;
use trical_model::pose::rotation_zyx;
use trical_model::{
    Basis, Cell, Forward, JointKind, Joints, Measured, Model, Pose, Recording, Robot, Row, Shape, Site, State, Term,
};
use trical_plan::{Candidate, generator};

use crate::error::{Error, Result};

/// How far true arms are from nominal, and how noisy touches are. SI.
#[derive(Clone, Copy, Debug)]
pub struct Nature {
    /// Standard deviation of every length of the arm, of base and tool, m.
    pub length: f64,
    /// Standard deviation of every angle of the arm and of the base, rad.
    pub angle: f64,
    /// Least and largest compliance of a joint, rad/Nm; logarithmically uniform between.
    pub compliance: [f64; 2],
    /// Standard deviation of an indicator, m.
    pub indicator: f64,
    /// Standard deviation of the procedure along each axis, m.
    pub procedure: f64,
    /// Standard deviation of each coordinate of a ball's known place, m.
    pub ballbar: f64,
}

impl Nature {
    /// These arms, touched without any noise.
    pub fn silent(self) -> Self {
        Self { indicator: 0.0, procedure: 0.0, ballbar: 0.0, ..self }
    }
}

fn normal(rng: &mut Pcg64Mcg, sd: f64) -> f64 {
    Normal::new(0.0, sd.max(0.0)).map_or(0.0, |n| n.sample(rng))
}

/// Three normal numbers.
pub(crate) fn normal3(rng: &mut Pcg64Mcg, sd: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng, sd))
}

/// A true arm of a trial: same seed and trial, same arm.
pub fn draw_arm(robot: &Robot, cell: &Cell, nature: &Nature, seed: u64, trial: u64) -> Model {
    let rng = &mut generator(seed, trial, 1);
    let (mut robot, mut cell) = (robot.clone(), cell.clone());
    for joint in &mut robot.joints {
        joint.alpha += normal(rng, nature.angle);
        joint.a += normal(rng, nature.length);
        joint.d += normal(rng, nature.length);
        joint.theta_offset += normal(rng, nature.angle);
    }
    let turn: [f64; 3] = std::array::from_fn(|_| normal(rng, nature.angle));
    cell.world_from_base.rotation = rotation_zyx(turn[0], turn[1], turn[2]) * cell.world_from_base.rotation;
    cell.world_from_base.translation += normal3(rng, nature.length);
    cell.tool.tcp += normal3(rng, nature.length);
    let mut model = Model::nominal(robot, cell);
    if model.robot.require_masses().is_ok() {
        let [low, high] = nature.compliance.map(f64::ln);
        for joint in 1..=model.robot.dof() {
            let exponent = Uniform::new(low, high).map_or(low, |u| u.sample(rng));
            if model.robot.joints[joint - 1].kind == JointKind::Revolute {
                let basis = Basis::torque(joint, Shape::Linear);
                let mut term = Term::new(format!("c_{joint}"), "compliance", Site::Joint { joint }, basis);
                term.value = exponent.exp();
                model.terms.push(term);
            }
        }
    }
    model
}

/// A true arm that the parameters of `known` can describe exactly: its terms, drawn.
pub fn draw_known(known: &Model, nature: &Nature, seed: u64, trial: u64) -> Model {
    let rng = &mut generator(seed, trial, 2);
    let mut model = known.clone();
    let [low, high] = nature.compliance.map(f64::ln);
    for t in &mut model.terms {
        t.value = if !t.basis.is_constant() {
            Uniform::new(low, high).map_or(low, |u| u.sample(rng)).exp()
        } else if trical_ident::unit(&known.robot, t).name == "mm" {
            normal(rng, nature.length)
        } else {
            normal(rng, nature.angle)
        };
    }
    model
}

/// Moves the balls of the true arm's cell to where they might be, {w} being where the balls say it is.
fn displace_balls(balls: &mut [Vector3<f64>], sd: f64, rng: &mut Pcg64Mcg) {
    if sd <= 0.0 {
        return;
    }
    let moved: Vec<_> = balls.iter().map(|b| b + normal3(rng, sd)).collect();
    let pairs: Vec<_> = balls.iter().copied().zip(moved.iter().copied()).collect();
    let back = rigid_from_points(&pairs).unwrap_or_else(Pose::identity);
    for (ball, m) in balls.iter_mut().zip(&moved) {
        *ball = back.apply(m);
    }
}

/// What the procedure would record: at each touch the arm is displaced, as the indicators say, until it is on the ball.
pub fn touch(truth: &Model, touches: &[Candidate], nature: &Nature, seed: u64, trial: u64) -> Result<Recording> {
    let rng = &mut generator(seed, trial, 3);
    let mut truth = truth.clone();
    displace_balls(&mut truth.cell.balls, nature.ballbar, rng);
    let forward = Forward::new(truth, Vec::new())?;
    let balls = &forward.model().cell.balls;
    let mut ws = forward.workspace();
    let mut rows = Vec::with_capacity(touches.len());
    for t in touches {
        let planned = State { dir: Some(t.senses()), ..State::at(&t.joints) };
        let noise = Vector3::from_fn(|_, _| normal(rng, nature.indicator) + normal(rng, nature.procedure));
        let Some(ball) = balls.get(t.ball) else { continue };
        let at = forward.world_from_tool(&planned, &mut ws);
        let target = Pose { rotation: at.rotation, translation: *ball };
        // a touch that cannot be done is left out, as in a real run
        let Ok(q) = continue_from(&forward, &target, &planned, &mut ws) else { continue };
        let state = State { q, ..planned };
        // what is left of the way is data, not an error
        let there = forward.world_from_tool(&state, &mut ws);
        let reading = (there.rotation.transpose() * (ball - there.translation) + noise).into();
        rows.push(Row { state, measured: Measured::Touch { ball: t.ball, reading }, seq: None, line: 0 });
    }
    Ok(Recording { name: "simulated".into(), joints: forward.model().robot.dof(), rows, ..Recording::default() })
}

/// Poses at which true and identified arm are compared.
pub struct Poses {
    /// In the sphere.
    pub sphere: Vec<Joints>,
    /// All over.
    pub workspace: Vec<Joints>,
}

/// How a trial ended. Lengths in mm.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Position error in the sphere, mean and largest.
    pub sphere: [f64; 2],
    /// Position error in the workspace, mean and largest.
    pub workspace: [f64; 2],
    /// What the parameters left of the touches, root mean square.
    pub residual: f64,
    /// Largest difference of a parameter from the true one's of the same name, SI; infinite where there is none.
    pub parameter: f64,
    /// Touches that could be done.
    pub touches: usize,
}

/// Identifies an arm from what was recorded, and compares it with the truth. `None` where the fit gave up.
pub fn calibrate(
    robot: &Robot,
    cell: &Cell,
    truth: &Model,
    recording: Recording,
    set: ParameterSet,
    poses: &Poses,
) -> Result<Option<Outcome>> {
    let touches = recording.rows.len();
    let data = Dataset::build(&[recording], JointSource::Read, None)?;
    let Ok(fitted) = identify(robot, cell, &data, set) else { return Ok(None) };
    let residual = ErrorSummary::of(&fitted.errors()?).rms_mm;
    let of = |terms: &[Term], name: &str| terms.iter().find(|t| t.name == name).map_or(f64::INFINITY, |t| t.value);
    let parameter = fitted.model.terms.iter().map(|t| (t.value - of(&truth.terms, &t.name)).abs()).fold(0.0, f64::max);
    let (real, found) = (Forward::new(truth.clone(), Vec::new())?, Forward::new(fitted.model, Vec::new())?);
    let (mut a, mut b) = (real.workspace(), found.workspace());
    let mut errors = |poses: &[Joints]| {
        let errors: Vec<f64> = poses
            .iter()
            .map(|q| {
                let p = real.world_from_tool(&State::at(q), &mut a).translation;
                (p - found.world_from_tool(&State::at(q), &mut b).translation).norm()
            })
            .collect();
        let summary = ErrorSummary::of(&errors);
        [summary.mean_mm, summary.max_mm]
    };
    let outcome =
        Outcome { sphere: errors(&poses.sphere), workspace: errors(&poses.workspace), residual, parameter, touches };
    Ok(Some(outcome))
}

/// `per_ball` candidates of each ball, at random: another set for each trial.
pub fn random_touches(
    pool: &[Candidate],
    balls: usize,
    per_ball: usize,
    seed: u64,
    trial: u64,
) -> Result<Vec<Candidate>> {
    let rng = &mut generator(seed, trial, 4);
    let mut all = Vec::new();
    for ball in 0..balls {
        let mut mine: Vec<Candidate> = pool.iter().filter(|c| c.ball == ball).copied().collect();
        if mine.len() < per_ball {
            return Err(Error::Input(format!(
                "ball {}: {per_ball} touches were asked for, but there are {} candidates",
                ball + 1,
                mine.len()
            )));
        }
        mine.shuffle(rng);
        all.extend_from_slice(&mine[..per_ball]);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

    use super::*;

    fn nature() -> Nature {
        Nature {
            length: 1e-3,
            angle: 1.0_f64.to_radians(),
            compliance: [1e-3_f64.to_radians(), 1e-1_f64.to_radians()],
            indicator: 1e-6,
            procedure: 1e-5,
            ballbar: 1e-6,
        }
    }

    fn irb120() -> (Robot, Cell) {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
        (robot, cell)
    }

    #[test]
    fn a_true_arm_differs_in_every_number_and_comes_back_by_its_seed() {
        let (robot, cell) = irb120();
        let a = draw_arm(&robot, &cell, &nature(), 1, 2);
        assert_eq!(a, draw_arm(&robot, &cell, &nature(), 1, 2));
        assert_ne!(a, draw_arm(&robot, &cell, &nature(), 1, 3));
        for (t, n) in a.robot.joints.iter().zip(&robot.joints) {
            assert!(t.alpha != n.alpha && t.a != n.a && t.d != n.d && t.theta_offset != n.theta_offset);
        }
        assert_eq!(a.terms.len(), 6);
    }

    #[test]
    fn displaced_balls_leave_the_world_frame_where_it_was() {
        let (_, cell) = irb120();
        let mut balls = cell.balls.clone();
        displace_balls(&mut balls, 1e-4, &mut generator(1, 1, 1));
        let pairs: Vec<_> = cell.balls.iter().copied().zip(balls.iter().copied()).collect();
        assert!(pairs.iter().all(|(a, b)| a != b));
        let left = rigid_from_points(&pairs).unwrap();
        assert!(left.translation.norm() < 1e-9 && (left.rotation - nalgebra::Matrix3::identity()).norm() < 1e-9);
    }
}
