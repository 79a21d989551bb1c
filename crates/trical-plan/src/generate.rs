//! Configurations at a ball that the arm can take without meeting anything: random orientation, all branches of the inverse
//! kinematics, one of them at random, checked where it touches and on its way there and back.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use trical_model::ik::continue_from;
use trical_model::pose::rotation_zyx;
use trical_model::{IkError, JointKind, Joints, MAX_JOINTS, Pose, Robot, State, Task, inverse_kinematics, trig};

use crate::collision::{CollisionModel, Contact, MotionWorkspace};
use crate::error::{PlanError, Result};
use crate::joints::{rounded, senses};
use crate::options::PlanOptions;
use crate::random::{downward, generator, uniform};
use crate::route::travel;

type V3 = Vector3<f64>;

/// A touch that the arm can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Which ball, 0-based.
    pub ball: usize,
    /// Joints at the touch: TCP in the ball's centre.
    pub joints: Joints,
    /// Joints at the stand-off pose, from which a straight line in joint space leads to the touch and back.
    pub approach: Joints,
}

impl Candidate {
    /// Sense of each joint's last motion before the touch, as a recording would have it.
    #[must_use]
    pub fn senses(&self) -> [i8; MAX_JOINTS] {
        senses(&self.approach, &self.joints)
    }
}

/// Why attempts were refused, and how often.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Rejected {
    /// Attempts in all, successful ones included.
    pub attempts: usize,
    /// No branch reaches the pose.
    pub unreachable: usize,
    /// Branches reach it, but beyond joint limits or too close to them.
    pub out_of_limits: usize,
    /// The arm is too near to a singular configuration, or to the end of its reach, for corrections.
    pub singular: usize,
    /// Bodies meet at the touch.
    pub touch_in_collision: usize,
    /// No stand-off pose is reachable on the same branch, or the ball would meet a stem from its side.
    pub no_approach: usize,
    /// Bodies meet on the way from the stand-off pose to the touch.
    pub approach_in_collision: usize,
    /// Which bodies met ("stem x and post 1"), and how often.
    pub contacts: BTreeMap<String, usize>,
}

impl Rejected {
    /// Adds the counts of another.
    pub fn add(&mut self, other: &Self) {
        self.attempts += other.attempts;
        self.unreachable += other.unreachable;
        self.out_of_limits += other.out_of_limits;
        self.singular += other.singular;
        self.touch_in_collision += other.touch_in_collision;
        self.no_approach += other.no_approach;
        self.approach_in_collision += other.approach_in_collision;
        for (k, v) in &other.contacts {
            *self.contacts.entry(k.clone()).or_default() += v;
        }
    }

    /// Each reason and how often it refused an attempt; their counts and the successes make up the attempts.
    #[must_use]
    pub fn reasons(&self) -> [(&'static str, usize); 6] {
        [
            ("out of reach", self.unreachable),
            ("beyond joint limits", self.out_of_limits),
            ("no room for corrections", self.singular),
            ("collision at the touch", self.touch_in_collision),
            ("no stand-off pose", self.no_approach),
            ("collision on the approach", self.approach_in_collision),
        ]
    }

    /// All reasons in words, commonest first, and which bodies met most often.
    #[must_use]
    pub fn in_words(&self) -> String {
        let mut reasons: Vec<(&str, usize)> = self.reasons().into_iter().filter(|r| r.1 > 0).collect();
        reasons.sort_by_key(|r| std::cmp::Reverse(r.1));
        let mut words: Vec<String> = reasons.iter().map(|(reason, n)| format!("{n} {reason}")).collect();
        if let Some((pair, n)) = self.contacts.iter().max_by_key(|(_, n)| **n) {
            words.push(format!("most contacts, {n}, between {pair}"));
        }
        words.join(", ")
    }

    fn count(&mut self, refusal: Refusal, model: &CollisionModel) {
        let mut met = |contact| {
            let (a, b) = model.names(contact);
            *self.contacts.entry(format!("{a} and {b}")).or_default() += 1;
        };
        match refusal {
            Refusal::Unreachable => self.unreachable += 1,
            Refusal::Limits => self.out_of_limits += 1,
            Refusal::Singular => self.singular += 1,
            Refusal::NoApproach => self.no_approach += 1,
            Refusal::Touch(c) => {
                met(c);
                self.touch_in_collision += 1;
            }
            Refusal::Approach(c) => {
                met(c);
                self.approach_in_collision += 1;
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Refusal {
    Unreachable,
    Limits,
    Singular,
    Touch(Contact),
    NoApproach,
    Approach(Contact),
}

/// A refused attempt.
#[derive(Clone, Copy, Debug)]
struct Refused {
    why: Refusal,
    /// Whether the tool's pose refused it: it is refused whatever the joints are, and perhaps for another reason before.
    by_pose: bool,
}

impl From<Refusal> for Refused {
    fn from(why: Refusal) -> Self {
        Self { why, by_pose: false }
    }
}

/// What an attempt looks at before it solves for the joints, which takes an arm of seven joints some 10 ms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Looks {
    /// Nothing.
    Nothing,
    /// Whether the links are long enough.
    Reach,
    /// As well whether the device meets something there: where few attempts succeed.
    Device,
}

/// Streams of random numbers.
const TOUCH: u64 = 1;

/// Attempts that are made before anyone looks whether there are enough.
const CHUNK: usize = 128;

/// A ball is given up where none of the first twentieth of the attempts was in reach. Where all attempts give the 15 touches that
/// are wanted, and a tenth of those in reach can be used, the first 1000 of 20 000 have seven in reach.
const NONE_IN_REACH: usize = 20;

/// `options.pool_per_ball` candidates at `ball` (0-based), in the order in which they were found. Same options, same result, for
/// any number of threads.
///
/// # Errors
/// [`PlanError::TooFew`] where the attempts are used up.
pub fn generate(
    model: &CollisionModel,
    ball: usize,
    options: &PlanOptions,
    task: &Task<'_>,
) -> Result<(Vec<Candidate>, Rejected)> {
    let wanted = options.pool_per_ball;
    let most = wanted.saturating_mul(options.attempts_per_candidate);
    let mut pool = Vec::with_capacity(wanted);
    let mut rejected = Rejected::default();
    // attempts that the tool's pose alone refuses, and what it says of them
    let (mut unsolved, mut by_pose): (Vec<usize>, _) = (Vec::new(), Rejected::default());
    let stream = TOUCH | ((ball as u64) << 8);
    let attempt = |scratch: &mut MotionWorkspace, k: usize, looks: Looks| {
        let rng = &mut generator(options.seed, stream, k as u64);
        Search { model, options, ball, scratch }.attempt(rng, looks)
    };
    let none_in_reach = |all: &Rejected, by_pose: &Rejected| {
        all.unreachable + by_pose.unreachable == all.attempts && all.attempts >= most / NONE_IN_REACH
    };
    while pool.len() < wanted && rejected.attempts < most && !none_in_reach(&rejected, &by_pose) {
        let done = (pool.len() as f64 / wanted.max(1) as f64).max(rejected.attempts as f64 / most as f64);
        task.step(done, "looking for touches")?;
        let first = rejected.attempts;
        let is_in_reach = rejected.unreachable + by_pose.unreachable < first;
        let looks = if is_in_reach && pool.len() < first / CHUNK { Looks::Device } else { Looks::Reach };
        let results: Vec<std::result::Result<Candidate, Refused>> = (first..(first + CHUNK).min(most))
            .into_par_iter()
            .map_init(|| MotionWorkspace::new(model), |scratch, k| attempt(scratch, k, looks))
            .collect();
        for (k, result) in (first..).zip(results) {
            if pool.len() == wanted {
                break;
            }
            rejected.attempts += 1;
            match result {
                Ok(candidate) => pool.push(candidate),
                Err(Refused { why, by_pose: false }) => rejected.count(why, model),
                Err(Refused { why, by_pose: true }) => {
                    unsolved.push(k);
                    by_pose.count(why, model);
                }
            }
        }
    }
    let none_in_reach = none_in_reach(&rejected, &by_pose);
    if pool.len() < options.per_ball {
        rejected.add(&by_pose);
        return Err(PlanError::TooFew {
            ball: ball + 1,
            found: pool.len(),
            wanted: options.per_ball,
            attempts: rejected.attempts,
            reason: if none_in_reach {
                "all were out of reach: the ball is too far away, or the joints do not turn the device every way".into()
            } else {
                format!("refused were {}", rejected.in_words())
            },
        });
    }
    // a plan tells what the arm itself, too, says of every attempt
    for some in unsolved.chunks(CHUNK) {
        task.step(1.0, "looking for touches")?;
        let solved: Vec<_> = some
            .par_iter()
            .map_init(|| MotionWorkspace::new(model), |scratch, k| attempt(scratch, *k, Looks::Nothing))
            .collect();
        solved.into_iter().filter_map(std::result::Result::err).for_each(|refused| rejected.count(refused.why, model));
    }
    Ok((pool, rejected))
}

/// How far corrections may take the tool along each axis of {w}, m: wherever they may, the arm must follow on the same
/// branch and within limits.
const CORRECTION: f64 = 0.004;
/// How far a joint may move for such a correction, rad: more means that the arm is nearly singular or at the end of its
/// reach.
const CORRECTION_JOINT: f64 = 3.0_f64.to_radians();
/// Largest angle between the retreat and the direction in which the device leaves, rad.
const CONE: f64 = 0.35;
/// Largest turn of the device about each of its axes between stand-off and touch, rad.
const TURN: f64 = 0.07;
/// How far a ball may come towards a stem's side on the way, m: less than a stem's travel.
const INTO_STEM: f64 = 3e-4;

/// Where candidates are looked for.
struct Search<'a> {
    model: &'a CollisionModel,
    options: &'a PlanOptions,
    ball: usize,
    scratch: &'a mut MotionWorkspace,
}

impl Search<'_> {
    fn attempt(&mut self, rng: &mut Pcg64Mcg, looks: Looks) -> std::result::Result<Candidate, Refused> {
        let Self { model, options, ball, .. } = *self;
        let world_from_tool = Pose {
            rotation: downward(rng, options.max_tilt_rad, options.spin_rad),
            translation: model.forward().model().cell.balls.get(ball).copied().unwrap_or_else(V3::zeros),
        };
        let by_pose = |why| Err(Refused { why, by_pose: true });
        if looks != Looks::Nothing && model.is_too_far(&world_from_tool, self.scratch) {
            return by_pose(Refusal::Unreachable);
        }
        if looks == Looks::Device
            && let Some(hit) = model.check_tool(&world_from_tool, Some(ball), self.scratch)
        {
            return by_pose(Refusal::Touch(hit));
        }
        let joints = self.random_branch(&world_from_tool, rng)?;
        if let Some(hit) = model.check_joints(&joints, Some(ball), self.scratch) {
            return Err(Refusal::Touch(hit).into());
        }
        let mut refusal = Refusal::NoApproach;
        for _ in 0..4 {
            match self.approach(&joints, rng) {
                Ok(approach) => return Ok(Candidate { ball, joints, approach }),
                Err(r) => refusal = r,
            }
        }
        Err(refusal.into())
    }

    /// One of the ways to take a pose that keep off limits and singularities, at random.
    fn random_branch(&mut self, world_from_tool: &Pose, rng: &mut Pcg64Mcg) -> std::result::Result<Joints, Refusal> {
        let Self { model, options, .. } = *self;
        let forward = model.forward();
        let robot = &forward.model().robot;
        let all = inverse_kinematics(forward, world_from_tool, &State::at(&[]), self.scratch.forward()).map_err(
            |e| match e {
                IkError::OutOfLimits { .. } | IkError::OutOfTravel { .. } => Refusal::Limits,
                IkError::Singular { .. } => Refusal::Singular,
                _ => Refusal::Unreachable,
            },
        )?;
        let inside: Vec<Joints> = all
            .iter()
            .map(|s| rounded(robot, &s.joints))
            .filter(|q| robot.within_limits(q, -options.limit_margin_rad))
            .filter(|q| within_a_turn(robot, q))
            .collect();
        if inside.is_empty() {
            return Err(Refusal::Limits);
        }
        let joints = inside.get(rng.random_range(0..inside.len())).copied().ok_or(Refusal::Limits)?;
        if self.can_be_corrected(world_from_tool, &joints) { Ok(joints) } else { Err(Refusal::Singular) }
    }

    /// Whether the arm can follow wherever a correction may take the tool, on the same branch and without large motions.
    fn can_be_corrected(&mut self, pose: &Pose, joints: &Joints) -> bool {
        (0..8).all(|corner| {
            let side = |bit: u32| if corner & bit == 0 { -CORRECTION } else { CORRECTION };
            let moved =
                Pose { translation: pose.translation + V3::new(side(1), side(2), side(4)), rotation: pose.rotation };
            continue_from(self.model.forward(), &moved, &State::at(joints), self.scratch.forward())
                .is_ok_and(|q| travel(&q, joints) < CORRECTION_JOINT)
        })
    }

    /// A random stand-off pose for a touch, and its way checked. Random directions and turns make each joint arrive in either
    /// sense.
    fn approach(&mut self, joints: &Joints, rng: &mut Pcg64Mcg) -> std::result::Result<Joints, Refusal> {
        let Self { model, options, ball, .. } = *self;
        let forward = model.forward();
        let robot = &forward.model().robot;
        let touch = forward.world_from_tool(&State::at(joints), self.scratch.forward());
        let retreat = *model.retreat();
        let sideways = retreat.cross(&if retreat.x.abs() < 0.6 { V3::x() } else { V3::y() }).normalize();
        let around = uniform(rng, -std::f64::consts::PI, std::f64::consts::PI);
        let lean = libm::acos(uniform(rng, trig::cos(CONE), 1.0));
        let side = sideways * trig::cos(around) + retreat.cross(&sideways) * trig::sin(around);
        let direction = retreat * trig::cos(lean) + side * trig::sin(lean);
        let distance = uniform(rng, options.standoff_m[0], options.standoff_m[1]);
        let [z, y, x] = std::array::from_fn(|_| uniform(rng, -TURN, TURN));
        let standoff = Pose {
            rotation: touch.rotation * rotation_zyx(z, y, x),
            translation: touch.translation + touch.rotation * direction * distance,
        };
        let from = continue_from(forward, &standoff, &State::at(joints), self.scratch.forward())
            .map_err(|_| Refusal::NoApproach)?;
        let from = rounded(robot, &from);
        if !robot.within_limits(&from, -options.limit_margin_rad) || !self.enters_openly(&from, joints) {
            return Err(Refusal::NoApproach);
        }
        model.check_motion(&from, joints, Some(ball), self.scratch).map_or(Ok(from), |hit| Err(Refusal::Approach(hit)))
    }

    /// Whether the ball comes in on the open side of every stem: the collision check lets stem and ball pass each other, so this
    /// is what keeps a stem from being hit from its side.
    fn enters_openly(&mut self, from: &Joints, to: &Joints) -> bool {
        let forward = self.model.forward();
        let Some(centre) = forward.model().cell.balls.get(self.ball) else { return false };
        const STEPS: u32 = 12;
        (0..STEPS).all(|k| {
            let t = f64::from(k) / f64::from(STEPS);
            let mut q = *from;
            for (x, y) in q.iter_mut().zip(to) {
                *x += t * (y - *x);
            }
            let tool = forward.world_from_tool(&State::at(&q), self.scratch.forward());
            let ball_in_tool = tool.rotation.transpose() * (centre - tool.translation);
            self.model.stems().all(|side| side.dot(&ball_in_tool) < INTO_STEM)
        })
    }
}

/// Whether every joint is within half a turn of the middle of its range: what lies beyond tells little more, and makes ways long.
fn within_a_turn(robot: &Robot, q: &Joints) -> bool {
    robot.joints.iter().zip(q).all(|(j, q)| {
        j.kind == JointKind::Prismatic || (q - 0.5 * (j.limits[0] + j.limits[1])).abs() <= std::f64::consts::PI
    })
}

/// Up to `count` different stand-off poses for a touch that have passed all checks, the candidate's own first.
pub(crate) fn more_approaches(
    model: &CollisionModel,
    candidate: &Candidate,
    options: &PlanOptions,
    count: usize,
    rng: &mut Pcg64Mcg,
    scratch: &mut MotionWorkspace,
) -> Vec<Joints> {
    let mut search = Search { model, options, ball: candidate.ball, scratch };
    let mut found = vec![candidate.approach];
    for _ in 0..3 * count {
        if found.len() >= count {
            break;
        }
        found.extend(search.approach(&candidate.joints, rng));
    }
    found
}

#[cfg(test)]
mod tests;
