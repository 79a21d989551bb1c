//! Arms that are guided into sockets at places drawn by chance, and what unknown places are worth: arms drawn by chance are guided into sockets at
//! more and more of them, calibrated, and compared with themselves.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use trical_ident::rigid::rigid_from_points;
use trical_ident::{Dataset, ErrorSummary, JointSource, identify, usual_set};
use trical_model::ik::continue_from;
use trical_model::pose::rotation_zyx;
use trical_model::{
    Cell, Forward, Joints, MAX_JOINTS, Measured, Model, Pose, Recording, Robot, Row, State, Task, Workspace,
};

use crate::error::{Error, Result};
use crate::study::simulation::{Nature, draw_arm, normal3};

/// Numbers of places that are tried.
const PLACES: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// Arms that are drawn for each.
const ARMS: u64 = 5;

/// Poses at which an arm is compared with itself.
const POSES: usize = 150;

/// Arms as they leave their makers: lengths, m, and angles, rad.
const LENGTH: f64 = 0.3e-3;
const ANGLE: f64 = 0.15_f64.to_radians();

/// By how much joints differ from touch to touch before the ball is in its socket, rad (m).
const VARIED: f64 = 0.7;

/// Cosine of the largest tilt of the tool's axis where sockets stand.
const DOWN: f64 = 0.5;

/// A draw that no arm can follow is drawn again so often.
const DRAWS: usize = 400;

/// What so many places are worth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worth {
    /// At how many places the sockets stood.
    pub places: usize,
    /// Touches altogether.
    pub touches: usize,
    /// Mean position error of the calibrated arm over its workspace, mm, mean of the arms that were drawn; the frame is identified.
    pub mean_mm: f64,
    /// Before, of the nominal arm.
    pub before_mm: f64,
}

/// What places are worth for this arm and these sockets, with so many touches of each socket at each place and noise of `noise` (m).
///
/// # Errors
/// Cancelled, or an arm that reaches no place at which sockets could stand.
pub fn worth(
    robot: &Robot,
    cell: &Cell,
    per_ball: usize,
    noise: f64,
    seed: u64,
    task: &Task<'_>,
) -> Result<Vec<Worth>> {
    let nature = Nature {
        length: LENGTH,
        angle: ANGLE,
        compliance: [1e-3, 5e-3].map(f64::to_radians),
        indicator: noise,
        procedure: 0.0,
        ballbar: 0.0,
    };
    let most = PLACES.iter().copied().max().unwrap_or(1);
    let mut errors = vec![(0.0, 0.0, 0.0); PLACES.len()];
    for arm in 0..ARMS {
        let truth = draw_arm(robot, cell, &nature, seed, arm);
        let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(1000).wrapping_add(arm));
        let mut all = Vec::with_capacity(most);
        for place in 0..most {
            all.push(visits(&truth, cell, place, per_ball, noise, &mut rng)?);
        }
        let poses: Vec<Joints> = (0..POSES).map(|_| drawn(robot, &mut rng)).collect();
        let before = apart(&truth, &Model::nominal(robot.clone(), cell.clone()), &poses)?;
        for (k, places) in PLACES.iter().enumerate() {
            task.step((arm as f64 + k as f64 / PLACES.len() as f64) / ARMS as f64, "what places are worth")?;
            let rows: Vec<Row> = all[..*places].iter().flatten().copied().collect();
            let names = (1..=*places).map(|p| format!("place {p}")).collect();
            let recording = Recording {
                name: "simulated".into(),
                joints: robot.dof(),
                rows: rows.into_iter().enumerate().map(|(line, r)| Row { line: line + 2, ..r }).collect(),
                places: names,
                ..Recording::default()
            };
            let data = Dataset::build(&[recording], JointSource::Read, None)?;
            // too few places leave the arm as it is
            let after = match identify(robot, cell, &data, usual_set(robot)) {
                Ok(fitted) => apart(&truth, &fitted.model, &poses)?,
                Err(_) => before,
            };
            let sums = &mut errors[k];
            *sums = (sums.0 + after, sums.1 + before, sums.2 + 1.0);
        }
    }
    let touches = |places: usize| places * per_ball * cell.balls.len();
    let told = PLACES.iter().zip(errors).map(|(places, (after, before, n))| Worth {
        places: *places,
        touches: touches(*places),
        mean_mm: after / n,
        before_mm: before / n,
    });
    Ok(told.collect())
}

/// Joints within the limits, and one turn.
fn drawn(robot: &Robot, rng: &mut Pcg64Mcg) -> Joints {
    let mut q = [0.0; MAX_JOINTS];
    for (q, joint) in q.iter_mut().zip(&robot.joints) {
        let pi = std::f64::consts::PI;
        let (low, high) = (joint.limits[0].max(-pi), joint.limits[1].min(pi));
        *q = rng.random_range(low..=high.max(low));
    }
    q
}

/// A block of sockets that stands somewhere in an arm's reach.
struct Block {
    /// The arm with its tool at the block.
    q: Joints,
    world_from_block: Pose,
}

impl Block {
    /// Where the tool is at joints drawn by chance; `None` where the tool does not point down there, or the place is too low.
    fn drawn(arm: &Forward, rng: &mut Pcg64Mcg, ws: &mut Workspace) -> Option<Self> {
        let q = drawn(&arm.model().robot, rng);
        let at = arm.world_from_tool(&State::at(&q), ws);
        let low = at.translation.z < arm.model().cell.world_from_base.translation.z - 0.2;
        if -at.rotation[(2, 2)] < DOWN || low {
            return None;
        }
        let rotation = rotation_zyx(rng.random_range(-3.0..3.0), 0.0, 0.0);
        Some(Self { q, world_from_block: Pose { rotation, translation: at.translation } })
    }

    /// The arm with its ball in a socket (m, in the block's frame), turned by chance; `None` where it was not brought there.
    fn visited(&self, arm: &Forward, socket: &Vector3<f64>, rng: &mut Pcg64Mcg, ws: &mut Workspace) -> Option<State> {
        let translation = self.world_from_block.apply(socket);
        let robot = &arm.model().robot;
        (0..20).find_map(|_| {
            let mut near = self.q;
            near.iter_mut().take(robot.dof()).for_each(|q| *q += rng.random_range(-VARIED..VARIED));
            let state = State::at(&near);
            let rotation = arm.world_from_tool(&state, ws).rotation;
            let q = continue_from(arm, &Pose { rotation, translation }, &state, ws).ok()?;
            robot.within_limits(&q, 0.0).then(|| State::at(&q))
        })
    }
}

fn no_place() -> Error {
    Error::Input("the arm reaches no place at which sockets could stand, within its limits and pointing down".into())
}

/// Touches of the sockets at one place, somewhere in reach.
fn visits(
    truth: &Model,
    cell: &Cell,
    place: usize,
    per_ball: usize,
    noise: f64,
    rng: &mut Pcg64Mcg,
) -> Result<Vec<Row>> {
    let forward = Forward::new(truth.clone(), Vec::new())?;
    let mut ws = forward.workspace();
    'place: for _ in 0..DRAWS {
        let Some(block) = Block::drawn(&forward, rng, &mut ws) else { continue };
        let mut rows = Vec::with_capacity(cell.balls.len() * per_ball);
        for (ball, socket) in cell.balls.iter().enumerate() {
            for _ in 0..per_ball {
                let Some(state) = block.visited(&forward, socket, rng, &mut ws) else { continue 'place };
                let reading = normal3(rng, noise).into();
                let state = State { place: Some(place), ..state };
                rows.push(Row { state, measured: Measured::Touch { ball, reading }, seq: None, line: 0 });
            }
        }
        return Ok(rows);
    }
    Err(no_place())
}

/// An arm that a person guides by hand into the sockets of a block, one place after the other.
pub struct Guided {
    arm: Forward,
    sockets: Vec<Vector3<f64>>,
    /// Standard deviation of a ball's centre in its socket, on each axis, m.
    play: f64,
    rng: Pcg64Mcg,
    ws: Workspace,
    block: Block,
}

impl Guided {
    /// The true arm, and a block at a first place; `play` is the standard deviation of a ball's centre in its socket on each axis, m.
    ///
    /// # Errors
    /// A model that makes no sense, or an arm that reaches no place at which sockets could stand.
    pub fn new(truth: &Model, play: f64, seed: u64) -> Result<Self> {
        let arm = Forward::new(truth.clone(), Vec::new())?;
        let (mut rng, mut ws) = (Pcg64Mcg::seed_from_u64(seed), arm.workspace());
        let sockets = truth.cell.balls.clone();
        let block = stand(&arm, &sockets, &mut rng, &mut ws)?;
        Ok(Self { arm, sockets, play, rng, ws, block })
    }

    /// How many sockets the block has.
    #[must_use]
    pub fn sockets(&self) -> usize {
        self.sockets.len()
    }

    /// Puts the block somewhere else.
    ///
    /// # Errors
    /// As [`Guided::new`].
    pub fn next_place(&mut self) -> Result<()> {
        self.block = stand(&self.arm, &self.sockets, &mut self.rng, &mut self.ws)?;
        Ok(())
    }

    /// Joints with the ball in a socket, counted from 1, turned by chance.
    ///
    /// # Errors
    /// There is no such socket, or the arm was not brought there.
    pub fn visit(&mut self, socket: usize) -> Result<Joints> {
        let at = socket.checked_sub(1).and_then(|k| self.sockets.get(k));
        let at =
            at.ok_or_else(|| Error::Input(format!("found socket {socket}, and the cell has {}", self.sockets())))?;
        let off = normal3(&mut self.rng, self.play);
        let Self { arm, rng, ws, block, .. } = self;
        (0..DRAWS).find_map(|_| block.visited(arm, &(at + off), rng, ws)).map(|s| s.q).ok_or_else(no_place)
    }
}

/// A block at a place where every socket can be visited in several ways.
fn stand(arm: &Forward, sockets: &[Vector3<f64>], rng: &mut Pcg64Mcg, ws: &mut Workspace) -> Result<Block> {
    let suits = |block: &Block, rng: &mut Pcg64Mcg, ws: &mut Workspace| {
        sockets.iter().all(|s| (0..5).all(|_| block.visited(arm, s, rng, ws).is_some()))
    };
    (0..DRAWS).find_map(|_| Block::drawn(arm, rng, ws).filter(|block| suits(block, rng, ws))).ok_or_else(no_place)
}

/// Mean distance of two arms' tools, mm, one laid over the other as well as it goes.
fn apart(truth: &Model, other: &Model, poses: &[Joints]) -> Result<f64> {
    let (real, found) = (Forward::new(truth.clone(), Vec::new())?, Forward::new(other.clone(), Vec::new())?);
    let (mut a, mut b) = (real.workspace(), found.workspace());
    let pairs: Vec<_> = poses
        .iter()
        .map(|q| {
            let state = State { place: Some(0), session: Some(1), ..State::at(q) };
            (found.world_from_tool(&state, &mut b).translation, real.world_from_tool(&state, &mut a).translation)
        })
        .collect();
    let over = rigid_from_points(&pairs).unwrap_or_else(Pose::identity);
    let errors: Vec<f64> = pairs.iter().map(|(found, real)| (over.apply(real) - found).norm()).collect();
    Ok(ErrorSummary::of(&errors).mean_mm)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn more_places_of_two_sockets_make_a_better_arm() {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let text = "[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [15, -10, 120]\nmass_kg = 0.5\ncog_mm = [0, 0, 60]\n\
                    [balls]\ndistances_mm = { d12 = 50.0 }";
        let cell = Cell::parse(text, "cell.toml").unwrap();
        let told = worth(&robot, &cell, 10, 5e-5, 3, &Task::silent()).unwrap();
        assert_eq!(told.iter().map(|w| (w.places, w.touches)).collect::<Vec<_>>()[..3], [(1, 20), (2, 40), (3, 60)]);
        let at = |places| told.iter().find(|w| w.places == places).map(|w| w.mean_mm).unwrap();
        assert!(at(8) < 0.6 * at(2) && at(4) < at(1), "{told:?}");
        assert!(at(8) < 0.3 && told[0].before_mm > 0.5, "{told:?}");
        assert_eq!(told, worth(&robot, &cell, 10, 5e-5, 3, &Task::silent()).unwrap());
    }

    #[test]
    fn a_person_brings_the_ball_into_the_socket_that_is_asked_for_wherever_the_block_stands() {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let cell = Cell::parse(
            "[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [15, -10, 120]\n[balls]\ndistances_mm = { d12 = 50.0 }",
            "cell.toml",
        );
        let arm = Model::nominal(robot, cell.unwrap());
        let forward = Forward::new(arm.clone(), Vec::new()).unwrap();
        let mut ws = forward.workspace();
        let mut at = |q: &Joints| forward.world_from_tool(&State::at(q), &mut ws).translation;
        let mut exact = Guided::new(&arm, 0.0, 7).unwrap();
        let visits: Vec<Joints> = [1, 1, 2, 2].map(|socket| exact.visit(socket).unwrap()).into();
        let balls: Vec<Vector3<f64>> = visits.iter().map(&mut at).collect();
        assert!(visits[0] != visits[1] && (balls[0] - balls[1]).norm() < 1e-8 && (balls[2] - balls[3]).norm() < 1e-8);
        assert!(((balls[0] - balls[2]).norm() - 0.05).abs() < 1e-8);
        exact.next_place().unwrap();
        assert!((at(&exact.visit(1).unwrap()) - balls[0]).norm() > 0.01);
        assert!(exact.visit(0).is_err() && exact.visit(3).is_err());
        let mut loose = Guided::new(&arm, 1e-4, 7).unwrap();
        let scatter: f64 =
            (0..200).map(|_| (at(&loose.visit(1).unwrap()) - balls[0]).norm_squared()).sum::<f64>() / 600.0;
        assert!((scatter.sqrt() - 1e-4).abs() < 1e-5, "{scatter}");
    }
}
