//! Recordings of an arm that is a model: what would be measured at given poses, with noise from a seed.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal, Uniform};
use rand_pcg::Pcg64Mcg;
use trical_model::ik::continue_from;
use trical_model::pose::{quaternion_from_rotation, rotation_zyx};
use trical_model::touch::reading_at;
use trical_model::{Forward, Measured, Model, ModelError, Pose, Recording, Row, State, Workspace};

use crate::error::{IdentError, Result};

/// What is measured at a pose. Numbers count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// A ball is touched.
    Ball(usize),
    /// A target on the tool is seen, in measuring frame 0 ({w} where the model has none).
    Target(usize),
    /// The whole pose of the tool is seen, in the same frame.
    Pose,
    /// The length from an anchor to the TCP.
    Anchor(usize),
}

/// How measurements scatter. Zero for none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation of every length that is measured, m.
    pub length: f64,
    /// Standard deviation of a measured orientation about each axis of the tool, rad.
    pub angle: f64,
    /// The same seed gives the same recording.
    pub seed: u64,
}

/// What would be recorded. With `stop_within` the arm is first moved, as the measuring procedure does it, until the TCP of the
/// model is within that of the ball's centre (along each axis, m; evenly distributed), and its joints there are recorded.
///
/// # Errors
/// A ball, target or anchor that the cell does not have, something that a term needs and a state lacks, or a ball that the arm
/// cannot be moved onto; rows are counted from 0.
pub fn simulate(
    model: &Model,
    rows: &[(State, Aim)],
    scatter: &Scatter,
    stop_within: Option<f64>,
) -> Result<Recording> {
    let mut model = model.clone();
    if model.frames.is_empty() {
        model.frames.push(Pose::identity());
    }
    let forward = Forward::new(model, Vec::new())?;
    let mut ws = forward.workspace();
    let mut noise = Noise { rng: Pcg64Mcg::seed_from_u64(scatter.seed) };
    let mut out = Vec::with_capacity(rows.len());
    for (k, (state, aim)) in rows.iter().enumerate() {
        let wrong = |problem: String| IdentError::at("simulation", format!("row {k}"), problem);
        let mut state = *state;
        forward.check(&state, &nothing_at(*aim), 0).map_err(|e: ModelError| wrong(e.to_string()))?;
        if let (Aim::Ball(ball), Some(within)) = (aim, stop_within) {
            let off = noise.even(within);
            state.q = onto(&forward, &state, *ball, &off, &mut ws).map_err(|e| wrong(e.to_string()))?;
        }
        let measured = match *aim {
            Aim::Ball(ball) => {
                let reading = Vector3::from(reading_at(&forward, &state, ball, &mut ws));
                Measured::Touch { ball, reading: (reading + noise.vector(scatter.length)).into() }
            }
            Aim::Target(target) => {
                forward.residual(&state, &Measured::Point { target, position: [0.0; 3] }, 0, &mut ws);
                let r = ws.residual();
                let seen = Vector3::new(r[0], r[1], r[2]) + noise.vector(scatter.length);
                Measured::Point { target, position: seen.into() }
            }
            Aim::Pose => {
                let frame = forward.frame_from_world(0).unwrap_or_else(Pose::identity);
                let at = frame.compose(&forward.world_from_tool(&state, &mut ws));
                let (v, turn) = (noise.vector(scatter.length), noise.vector(scatter.angle));
                let turned = rotation_zyx(turn.z, turn.y, turn.x);
                Measured::Pose {
                    position: (at.translation + v).into(),
                    quaternion: quaternion_from_rotation(&(at.rotation * turned)),
                }
            }
            Aim::Anchor(anchor) => {
                forward.residual(&state, &Measured::Distance { anchor, length: 0.0 }, 0, &mut ws);
                Measured::Distance { anchor, length: ws.residual()[0] + noise.number(scatter.length) }
            }
        };
        out.push(Row { state, measured, seq: None, line: k + 2 });
    }
    let robot = &forward.model().robot;
    let (name, prismatic) = ("simulated".into(), Some(robot.prismatic()));
    Ok(Recording { name, joints: robot.dof(), prismatic, rows: out, ..Recording::default() })
}

fn nothing_at(aim: Aim) -> Measured {
    match aim {
        Aim::Ball(ball) => Measured::Touch { ball, reading: [0.0; 3] },
        Aim::Target(target) => Measured::Point { target, position: [0.0; 3] },
        Aim::Pose => Measured::Pose { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0] },
        Aim::Anchor(anchor) => Measured::Distance { anchor, length: 0.0 },
    }
}

fn onto(
    forward: &Forward,
    state: &State,
    ball: usize,
    off: &Vector3<f64>,
    ws: &mut Workspace,
) -> std::result::Result<trical_model::Joints, trical_model::IkError> {
    let at = forward.world_from_tool(state, ws);
    let target = Pose { rotation: at.rotation, translation: forward.model().cell.balls[ball] + off };
    continue_from(forward, &target, state, ws)
}

struct Noise {
    rng: Pcg64Mcg,
}

impl Noise {
    fn number(&mut self, sd: f64) -> f64 {
        Normal::new(0.0, sd.max(0.0)).map_or(0.0, |n| n.sample(&mut self.rng))
    }

    fn even(&mut self, most: f64) -> Vector3<f64> {
        let most = most.max(0.0);
        Vector3::from_fn(|_, _| Uniform::new_inclusive(-most, most).map_or(0.0, |u| u.sample(&mut self.rng)))
    }

    fn vector(&mut self, sd: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.number(sd))
    }
}
