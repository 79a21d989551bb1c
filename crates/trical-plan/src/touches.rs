//! The touches: random orientations at each ball, all branches of inverse kinematics, limits, collisions; the informative
//! subset; a short order.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use thiserror::Error;
use trical_model::ik::{continue_from, inverse_kinematics};
use trical_model::pose::{rotation_x, rotation_z};
use trical_model::{Forward, Joints, Measured, Model, Pose, State};

use crate::choice::choose;
use crate::scene::Scene;

/// What is planned.
#[derive(Clone, Debug)]
pub struct PlanOptions {
    /// Touches a ball.
    pub per_ball: usize,
    /// Candidates a ball, from which they are chosen.
    pub pool: usize,
    /// Seed of all chance.
    pub seed: u64,
    /// Largest angle between the device's axis and the vertical, rad.
    pub tilt: f64,
    /// How far the device is held short of the ball before the touch, m.
    pub approach: f64,
    /// Along each axis, how far corrections may take the device from where it is planned, m.
    pub correction: f64,
    /// What is kept from everything, m.
    pub clearance: f64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self {
            per_ball: 15,
            pool: 60,
            seed: 1,
            tilt: 65.0_f64.to_radians(),
            approach: 0.04,
            correction: 0.004,
            clearance: 0.008,
        }
    }
}

/// One planned touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Touch {
    /// Which ball, counted from 0.
    pub ball: usize,
    /// Joint values at the touch by the nominal model, rad.
    pub joints: Joints,
    /// Points on the way from the touch before; the last holds the device short of the ball.
    pub via: Vec<Joints>,
}

/// A plan and what became of the candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The touches, in order.
    pub touches: Vec<Touch>,
    /// Reasons for which candidates were dropped, counted.
    pub rejected: Vec<(String, usize)>,
    /// Candidates that passed, all balls together.
    pub pool: usize,
}

/// Why there is no plan.
#[derive(Debug, Error, PartialEq)]
pub enum PlanError {
    /// The cell has no balls.
    #[error("the cell has no [balls] to touch")]
    NoBalls,
    /// Not enough candidates.
    #[error("ball {ball}: only {found} of {wanted} touches were found in {tried} tries; {reasons}")]
    TooFew {
        /// 1-based.
        ball: usize,
        /// Found.
        found: usize,
        /// Wanted.
        wanted: usize,
        /// Orientations tried.
        tried: usize,
        /// What was in the way, counted.
        reasons: String,
    },
    /// The model cannot be used.
    #[error(transparent)]
    Model(#[from] trical_model::ModelError),
}

/// Axes of a device whose z points along `down` turned by chance: at most `tilt` off the vertical.
fn random_orientation(rng: &mut Pcg64Mcg, tilt: f64) -> Matrix3<f64> {
    let turn = std::f64::consts::TAU;
    // uniform over the cap
    let c = rng.random_range(tilt.cos()..1.0);
    rotation_z(rng.random_range(0.0..turn))
        * rotation_x(std::f64::consts::PI - c.acos())
        * rotation_z(rng.random_range(0.0..turn))
}

/// Largest change of a joint.
fn farthest(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

struct Planner<'a> {
    nominal: &'a Forward,
    scene: Scene,
    n: usize,
    rejected: std::collections::BTreeMap<String, usize>,
}

impl Planner<'_> {
    fn reject(&mut self, reason: impl Into<String>) {
        *self.rejected.entry(reason.into()).or_insert(0) += 1;
    }

    /// A touch of `ball` in a random orientation: joint values at the touch and short of it.
    fn candidate(
        &mut self,
        ball: &Vector3<f64>,
        options: &PlanOptions,
        rng: &mut Pcg64Mcg,
    ) -> Option<(Joints, Joints)> {
        let mut ws = self.nominal.workspace();
        let mut links = vec![Pose::identity(); self.n + 1];
        let rotation = random_orientation(rng, options.tilt);
        let at = Pose { rotation, translation: *ball };
        let home = State::at(&[0.0; 9]);
        let all = match inverse_kinematics(self.nominal, &at, &home, &mut ws) {
            Ok(all) => all,
            Err(e) => {
                self.reject(match e {
                    trical_model::ik::IkError::OutOfLimits { .. } => "joint limits",
                    _ => "out of reach",
                });
                return None;
            }
        };
        // whole turns of the last joint are the same touch: one a branch
        let mut branches: Vec<Joints> = Vec::new();
        let mut seen: Vec<usize> = Vec::new();
        for s in all {
            if !seen.contains(&s.branch) {
                seen.push(s.branch);
                branches.push(s.joints);
            }
        }
        let joints = branches[rng.random_range(0..branches.len())];
        if let Some(c) = self.scene.contact_at(self.nominal, &joints[..self.n], &mut ws, &mut links) {
            self.reject(format!("{} against {}", c.part, c.with));
            return None;
        }
        // wherever a correction may take it, the arm must follow smoothly: not at the end of its reach, not near a
        // singular pose
        let c = options.correction;
        for corner in 0..8 {
            let side = |bit: u8| if corner & (1 << bit) == 0 { -c } else { c };
            let moved = Pose { rotation, translation: ball + Vector3::new(side(0), side(1), side(2)) };
            match continue_from(self.nominal, &moved, &State::at(&joints), &mut ws) {
                Ok(q) if farthest(&q, &joints) < 3.0_f64.to_radians() => {}
                _ => {
                    self.reject("no room for corrections");
                    return None;
                }
            }
        }
        let back = Pose { rotation, translation: ball - rotation * Vector3::z() * options.approach };
        let Ok(approach) = continue_from(self.nominal, &back, &State::at(&joints), &mut ws) else {
            self.reject("no straight approach");
            return None;
        };
        let way = self.scene.contact_between(self.nominal, &approach[..self.n], &joints[..self.n], &mut ws, &mut links);
        if let Some(c) = way {
            self.reject(format!("approach: {} against {}", c.part, c.with));
            return None;
        }
        Some((joints, approach))
    }
}

/// Plans touches of every ball of the cell. `model` is the nominal model with the terms that are to be identified (they
/// decide which touches are informative).
///
/// # Errors
/// No balls, or too few reachable, collision-free touches.
pub fn plan_touches(model: &Model, options: &PlanOptions, progress: &mut dyn FnMut(f64)) -> Result<Plan, PlanError> {
    let cell = &model.cell;
    if cell.balls.is_empty() {
        return Err(PlanError::NoBalls);
    }
    let nominal = Forward::new(Model::nominal(model.robot.clone(), cell.clone()), Vec::new())?;
    let n = model.robot.dof();
    let mut planner =
        Planner { nominal: &nominal, scene: Scene::new(cell, options.clearance), n, rejected: Default::default() };
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let mut pool: Vec<(usize, Joints, Joints)> = Vec::new();
    for (ball, centre) in cell.balls.iter().enumerate() {
        let mut found = 0;
        let most = options.pool * 200;
        let mut tried = 0;
        while found < options.pool && tried < most {
            tried += 1;
            if let Some((joints, approach)) = planner.candidate(centre, options, &mut rng) {
                pool.push((ball, joints, approach));
                found += 1;
                #[expect(clippy::cast_precision_loss, reason = "counts")]
                progress(0.6 * pool.len() as f64 / (options.pool * cell.balls.len()) as f64);
            }
        }
        if found < options.per_ball {
            let reasons: Vec<String> = planner.rejected.iter().map(|(r, n)| format!("{r}: {n}")).collect();
            return Err(PlanError::TooFew {
                ball: ball + 1,
                found,
                wanted: options.per_ball,
                tried,
                reasons: reasons.join(", "),
            });
        }
    }
    let p = model.terms.len();
    let chosen: Vec<usize> = if p == 0 {
        let group: Vec<usize> = pool.iter().map(|c| c.0).collect();
        (0..cell.balls.len())
            .flat_map(|b| (0..pool.len()).filter(|k| group[*k] == b).take(options.per_ball).collect::<Vec<_>>())
            .collect()
    } else {
        let forward = Forward::new(model.clone(), (0..p).collect())?;
        let mut ws = forward.workspace();
        let mut jacobian = vec![0.0; 6 * p];
        let blocks: Vec<DMatrix<f64>> = pool
            .iter()
            .map(|(ball, q, _)| {
                let touch = Measured::Touch { ball: *ball, reading: [0.0; 3] };
                let rows = forward.linearize(&State::at(q), &touch, 0, &mut ws, &mut jacobian);
                DMatrix::from_row_slice(rows, p, &jacobian[..rows * p])
            })
            .collect();
        let group: Vec<usize> = pool.iter().map(|c| c.0).collect();
        choose(&blocks, &group, &vec![options.per_ball; cell.balls.len()])
    };
    progress(0.8);
    let touches = order(&mut planner, &pool, &chosen);
    progress(1.0);
    Ok(Plan { touches, rejected: planner.rejected.into_iter().collect(), pool: pool.len() })
}

/// Nearest neighbour first; where the straight way collides, through a pose with the arm drawn back.
fn order(planner: &mut Planner<'_>, pool: &[(usize, Joints, Joints)], chosen: &[usize]) -> Vec<Touch> {
    let mut ws = planner.nominal.workspace();
    let mut links = vec![Pose::identity(); planner.n + 1];
    let n = planner.n;
    let mut left: Vec<usize> = chosen.to_vec();
    let mut at: Joints = [0.0; 9];
    let mut touches = Vec::new();
    while !left.is_empty() {
        left.sort_by(|a, b| farthest(&pool[*a].2, &at).total_cmp(&farthest(&pool[*b].2, &at)).then(a.cmp(b)));
        let k = left.remove(0);
        let (ball, joints, approach) = pool[k];
        let scene = &planner.scene;
        let free = |from: &Joints, to: &Joints, ws: &mut trical_model::Workspace, links: &mut [Pose]| {
            scene.contact_between(planner.nominal, &from[..n], &to[..n], ws, links).is_none()
        };
        let mut via = Vec::new();
        if !free(&at, &approach, &mut ws, &mut links) {
            // lifted: the arm drawn back, wrist and base as at either end
            let lift = |q: &Joints| {
                let mut up = *q;
                for (k, v) in [(1, -0.5), (2, 0.3)] {
                    if k < n {
                        up[k] = v;
                    }
                }
                up
            };
            let (a, b) = (lift(&at), lift(&approach));
            if free(&at, &a, &mut ws, &mut links)
                && free(&a, &b, &mut ws, &mut links)
                && free(&b, &approach, &mut ws, &mut links)
            {
                via.extend([a, b]);
            } else {
                planner.reject("no free way there");
                continue;
            }
        }
        via.push(approach);
        touches.push(Touch { ball, joints, via });
        at = approach;
    }
    touches
}

/// Random collision-free poses of the arm: joint values at which the TCP satisfies `wanted`.
pub fn free_poses(
    model: &Model,
    count: usize,
    seed: u64,
    wanted: &dyn Fn(&Vector3<f64>) -> bool,
) -> Result<Vec<Joints>, PlanError> {
    let nominal = Forward::new(Model::nominal(model.robot.clone(), model.cell.clone()), Vec::new())?;
    let scene = Scene::new(&model.cell, 0.005);
    let mut ws = nominal.workspace();
    let mut links = vec![Pose::identity(); model.robot.dof() + 1];
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut out = Vec::with_capacity(count);
    let mut tries = 0_usize;
    while out.len() < count && tries < count * 20_000 {
        tries += 1;
        let mut q = [0.0; 9];
        for (q, j) in q.iter_mut().zip(&model.robot.joints) {
            let low = j.limits[0].max(-std::f64::consts::PI);
            let high = j.limits[1].min(std::f64::consts::PI);
            *q = rng.random_range(low..high);
        }
        let tip = nominal.world_from_tool(&State::at(&q), &mut ws).translation;
        if wanted(&tip) && scene.contact_at(&nominal, &q[..model.robot.dof()], &mut ws, &mut links).is_none() {
            out.push(q);
        }
    }
    Ok(out)
}
