//! The kinematic chain itself: frames of all joints, the twist of each of their motions, gravity moments.
//!
//! Joint i (0-based here) is `Rx(alpha) Tx(a) Ry(beta) E Rz(theta) Tz(d)`, where `E = Rx(tilt_x) Ry(tilt_y)` turns about the
//! joint's origin (the origin of frame {i}, after `Tz(d)`) in the frame that carries the bearing. Nothing is allocated.

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::pose::Pose;
use crate::recording::{Joints, MAX_JOINTS};
use crate::robot::{JointKind, Robot};
use crate::term::ChainDof;
use crate::trig::{all_sin_cos, sin_cos};

type V3 = Vector3<f64>;

/// Columns of a rotation matrix.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Axes {
    pub x: V3,
    pub y: V3,
    pub z: V3,
}

impl Axes {
    pub fn of(p: &Pose) -> Self {
        let r = &p.rotation;
        Self { x: r.column(0).into(), y: r.column(1).into(), z: r.column(2).into() }
    }

    pub fn matrix(&self) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::from_columns(&[self.x, self.y, self.z])
    }

    #[inline]
    pub fn times(&self, v: &V3) -> V3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// Times `Rx`.
    #[inline]
    fn rx(&self, (s, c): (f64, f64)) -> Self {
        Self { x: self.x, y: self.y * c + self.z * s, z: self.z * c - self.y * s }
    }

    /// Times `Ry`.
    #[inline]
    fn ry(&self, (s, c): (f64, f64)) -> Self {
        Self { x: self.x * c - self.z * s, y: self.y, z: self.z * c + self.x * s }
    }

    /// Times `Rz`.
    #[inline]
    fn rz(&self, (s, c): (f64, f64)) -> Self {
        Self { x: self.x * c + self.y * s, y: self.y * c - self.x * s, z: self.z }
    }

    pub fn axis(&self, a: Axis) -> V3 {
        match a {
            Axis::X => self.x,
            Axis::Y => self.y,
            Axis::Z => self.z,
        }
    }
}

/// Rotation axes of `Rz(v5) Ry(v4) Rx(v3)`, each where it acts, and the rotation itself, for increments `v[3..6]`.
pub(crate) fn small_rotation(v: &[f64; 6]) -> (Axes, nalgebra::Matrix3<f64>) {
    let (sy, cy) = sin_cos(v[4]);
    let (sz, cz) = sin_cos(v[5]);
    let axes = Axes { x: V3::new(cz * cy, sz * cy, -sy), y: V3::new(-sz, cz, 0.0), z: V3::z() };
    (axes, crate::pose::rotation_zyx(v[5], v[4], v[3]))
}

/// The first three of x, y, z, rx, ry, rz.
#[inline]
pub(crate) fn shift(v: &[f64; 6]) -> V3 {
    V3::new(v[0], v[1], v[2])
}

/// A frame that stands beside its reference by x, y, z, rx, ry, rz, and the axes about which these three turn it.
#[inline]
pub(crate) fn moved(reference: &Pose, by: &[f64; 6]) -> (Pose, Axes) {
    let (turns, turn) = small_rotation(by);
    (Pose { rotation: turn * reference.rotation, translation: reference.translation + shift(by) }, turns)
}

/// A motion of all that lies behind a site: a rotation about an axis through a point, or a translation.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Twist {
    About { axis: V3, through: V3 },
    Along(V3),
}

impl Twist {
    /// Velocity of the point `x`.
    #[inline]
    pub fn at(&self, x: &V3) -> V3 {
        match self {
            Self::About { axis, through } => axis.cross(&(x - through)),
            Self::Along(v) => *v,
        }
    }

    /// Change of the first moment of what joint `s` carries, when all of it moves.
    #[inline]
    pub fn load(&self, s: usize, loads: &Loads) -> V3 {
        match self {
            Self::About { axis, through } => axis.cross(&(loads.first[s] - through * loads.mass[s])),
            Self::Along(v) => v * loads.mass[s],
        }
    }

    /// Angular velocity.
    #[inline]
    pub fn angular(&self) -> V3 {
        match self {
            Self::About { axis, .. } => *axis,
            Self::Along(_) => V3::zeros(),
        }
    }
}

/// The seven motions of one joint, in the order of [`ChainDof`].
pub(crate) type JointIncrement = [f64; 7];

/// What moves the joints at one pose beyond the constant terms.
pub(crate) struct Increments<'a> {
    pub by_joint: &'a [JointIncrement; MAX_JOINTS],
    /// Frames of the same pose without them, where they are known.
    pub still: Option<&'a Frames>,
}

/// Below this (rad) the series of [`turned_by`] are exact to the last bit.
const SMALL_TURN: f64 = 1e-2;

/// Sine and cosine of an angle whose own are known, plus a small one: terms left out are below 1e-20.
#[inline]
fn turned_by((s, c): (f64, f64), d: f64) -> (f64, f64) {
    let d2 = d * d;
    let sine = d * (1.0 - d2 / 6.0 * (1.0 - d2 / 20.0 * (1.0 - d2 / 42.0)));
    // 1 - cos, so that nothing is lost beside 1
    let versine = d2 / 2.0 * (1.0 - d2 / 12.0 * (1.0 - d2 / 30.0));
    (s - s * versine + c * sine, c - c * versine - s * sine)
}

/// Constants of one joint with the constant terms included.
#[derive(Clone, Copy, Debug, Default)]
struct Constants {
    prismatic: bool,
    alpha: f64,
    a: f64,
    beta: f64,
    d: f64,
    tilt: [f64; 2],
    theta: f64,
    alpha_sc: (f64, f64),
    plain: bool,
    mass: f64,
    cog: V3,
}

/// Frames of one joint in {w}.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct JointFrames {
    x_before: V3,
    o_before: V3,
    y_beta: V3,
    o_beta: V3,
    /// Frame that carries the bearing, before tilt.
    pub bearing: Axes,
    y_tilt: V3,
    z_tilted: V3,
    /// Origin of frame {i}.
    pub origin: V3,
    /// Axes of frame {i}.
    pub axes: Axes,
    /// Sine and cosine of the joint's angle.
    turn: (f64, f64),
}

/// Frames of all joints at one pose.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frames {
    pub base_axes: Axes,
    pub base_origin: V3,
    /// Axes about which the base's three rotations act.
    pub base_turns: Axes,
    pub joints: [JointFrames; MAX_JOINTS],
    /// The flange, which carries the tool: frame {n} for an arm in Craig's frames.
    pub flange: Place,
}

/// Origin and axes of a frame in {w}.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    pub origin: V3,
    pub axes: Axes,
}

impl JointFrames {
    pub fn pose(&self) -> Pose {
        Pose { rotation: self.axes.matrix(), translation: self.origin }
    }
}

impl Place {
    fn of(pose: &Pose) -> Self {
        Self { origin: pose.translation, axes: Axes::of(pose) }
    }

    pub fn pose(&self) -> Pose {
        Pose { rotation: self.axes.matrix(), translation: self.origin }
    }
}

impl Frames {
    /// Twist of a motion within joint `i`.
    #[inline]
    pub fn twist(&self, i: usize, dof: ChainDof) -> Twist {
        let f = &self.joints[i];
        match dof {
            ChainDof::Alpha => Twist::About { axis: f.x_before, through: f.o_before },
            ChainDof::A => Twist::Along(f.x_before),
            ChainDof::Beta => Twist::About { axis: f.y_beta, through: f.o_beta },
            ChainDof::D => Twist::Along(f.bearing.z),
            ChainDof::TiltX => Twist::About { axis: f.bearing.x, through: f.origin },
            ChainDof::TiltY => Twist::About { axis: f.y_tilt, through: f.origin },
            ChainDof::Theta => Twist::About { axis: f.z_tilted, through: f.origin },
        }
    }

    /// Twist of a motion of the base: x, y, z, rx, ry, rz.
    #[inline]
    pub fn base_twist(&self, k: usize) -> Twist {
        let e = [V3::x(), V3::y(), V3::z()];
        match k {
            0..3 => Twist::Along(e[k]),
            3 => Twist::About { axis: self.base_turns.x, through: self.base_origin },
            4 => Twist::About { axis: self.base_turns.y, through: self.base_origin },
            _ => Twist::About { axis: self.base_turns.z, through: self.base_origin },
        }
    }
}

/// The chain with the constant terms built in.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    n: usize,
    joints: [Constants; MAX_JOINTS],
    reference: Pose,
    base: Pose,
    base_turns: Axes,
    /// `robot.root_from_zero` and `robot.last_from_flange`, where they are not the identity.
    root: Option<Pose>,
    flange: Option<Pose>,
}

impl Chain {
    /// `constant` are the constant terms' increments of each joint, `base` those of the base on `world_from_base`.
    pub fn new(
        robot: &Robot,
        world_from_base: &Pose,
        constant: &[JointIncrement; MAX_JOINTS],
        base: &[f64; 6],
    ) -> Self {
        let mut joints = [Constants::default(); MAX_JOINTS];
        for ((to, j), inc) in joints.iter_mut().zip(&robot.joints).zip(constant) {
            let alpha = j.alpha + inc[ChainDof::Alpha as usize];
            let beta = j.beta + inc[ChainDof::Beta as usize];
            let tilt = [inc[ChainDof::TiltX as usize], inc[ChainDof::TiltY as usize]];
            *to = Constants {
                prismatic: j.kind == JointKind::Prismatic,
                alpha,
                a: j.a + inc[ChainDof::A as usize],
                beta,
                d: j.d + inc[ChainDof::D as usize],
                tilt,
                theta: j.theta_offset + inc[ChainDof::Theta as usize],
                alpha_sc: sin_cos(alpha),
                plain: beta == 0.0 && tilt == [0.0; 2],
                mass: j.mass.unwrap_or(0.0),
                cog: j.cog,
            };
        }
        let (base, base_turns) = moved(world_from_base, base);
        Self {
            n: robot.dof(),
            joints,
            reference: *world_from_base,
            base,
            base_turns,
            root: (robot.root_from_zero != Pose::identity()).then_some(robot.root_from_zero),
            flange: (robot.last_from_flange != Pose::identity()).then_some(robot.last_from_flange),
        }
    }

    pub fn dof(&self) -> usize {
        self.n
    }

    /// All frames at joint values `q`, the constant terms included and the increments of this pose added.
    #[inline]
    pub fn run(&self, q: &Joints, increments: Option<&Increments<'_>>, frames: &mut Frames) {
        frames.base_turns = self.base_turns;
        self.run_from(&self.base, q, increments, frames);
    }

    /// As [`Chain::run`], with the base moved by `base` (x, y, z, rx, ry, rz in {w}) from nominal, its constant terms included.
    pub fn run_with_base(&self, base: &[f64; 6], q: &Joints, increments: Option<&Increments<'_>>, frames: &mut Frames) {
        let (moved, turns) = moved(&self.reference, base);
        frames.base_turns = turns;
        self.run_from(&moved, q, increments, frames);
    }

    #[inline]
    fn run_from(&self, base: &Pose, q: &Joints, increments: Option<&Increments<'_>>, frames: &mut Frames) {
        frames.base_axes = Axes::of(base);
        frames.base_origin = base.translation;
        frames.flange = self.along(base, q, increments, Some(&mut frames.joints));
    }

    /// The flange alone at joint values `q`, the constant terms included.
    #[inline]
    pub fn flange(&self, q: &Joints) -> Place {
        self.along(&self.base, q, None, None)
    }

    /// From the base to the flange, which it returns; the frames of each joint are left in `joints`, where they are asked for.
    #[inline(always)]
    fn along(
        &self,
        base: &Pose,
        q: &Joints,
        increments: Option<&Increments<'_>>,
        mut joints: Option<&mut [JointFrames; MAX_JOINTS]>,
    ) -> Place {
        let (mut axes, mut origin) = (Axes::of(base), base.translation);
        if let Some(root) = &self.root {
            let zero = Place::of(&base.compose(root));
            (axes, origin) = (zero.axes, zero.origin);
        }
        // without increments all angles are known now: their sines and cosines are computed side by side
        let (mut angles, mut turns) = ([0.0; MAX_JOINTS], [(0.0, 1.0); MAX_JOINTS]);
        let all_known = increments.is_none();
        if all_known {
            for ((angle, c), q) in angles.iter_mut().zip(&self.joints).zip(q) {
                *angle = if c.prismatic { c.theta } else { c.theta + q };
            }
            let n = self.n.min(MAX_JOINTS);
            all_sin_cos(&angles[..n], &mut turns[..n]);
        }
        for i in 0..self.n {
            let c = &self.joints[i];
            let (mut theta, mut d) = if c.prismatic { (c.theta, c.d + q[i]) } else { (c.theta + q[i], c.d) };
            let (mut a, mut beta, mut tilt, mut alpha_sc, mut plain) = (c.a, c.beta, c.tilt, c.alpha_sc, c.plain);
            let mut known = all_known.then(|| turns[i]);
            if let Some(Increments { by_joint, still }) = increments {
                let inc = &by_joint[i];
                let turned = inc[ChainDof::Theta as usize];
                theta += turned;
                known = still.filter(|_| turned.abs() < SMALL_TURN).map(|s| turned_by(s.joints[i].turn, turned));
                d += inc[ChainDof::D as usize];
                a += inc[ChainDof::A as usize];
                if inc[ChainDof::Alpha as usize] != 0.0 {
                    alpha_sc = sin_cos(c.alpha + inc[ChainDof::Alpha as usize]);
                }
                let (b, x, y) =
                    (inc[ChainDof::Beta as usize], inc[ChainDof::TiltX as usize], inc[ChainDof::TiltY as usize]);
                if b != 0.0 || x != 0.0 || y != 0.0 {
                    beta += b;
                    tilt[0] += x;
                    tilt[1] += y;
                    plain = false;
                }
            }
            let mut unasked = JointFrames::default();
            let f = joints.as_deref_mut().map_or(&mut unasked, |all| &mut all[i]);
            f.turn = known.unwrap_or_else(|| sin_cos(theta));
            f.x_before = axes.x;
            f.o_before = origin;
            let turned = axes.rx(alpha_sc);
            origin += axes.x * a;
            f.y_beta = turned.y;
            f.o_beta = origin;
            if plain {
                f.bearing = turned;
                f.y_tilt = turned.y;
                f.z_tilted = turned.z;
                origin += turned.z * d;
                axes = turned.rz(f.turn);
            } else {
                f.bearing = turned.ry(sin_cos(beta));
                origin += f.bearing.z * d;
                let half = f.bearing.rx(sin_cos(tilt[0]));
                f.y_tilt = half.y;
                let tilted = half.ry(sin_cos(tilt[1]));
                f.z_tilted = tilted.z;
                axes = tilted.rz(f.turn);
            }
            f.origin = origin;
            f.axes = axes;
        }
        let last = Place { origin, axes };
        match &self.flange {
            Some(flange) => Place::of(&last.pose().compose(flange)),
            None => last,
        }
    }

    /// Masses and first moments in {w} of all that each joint carries; `payload` is mass and first moment (kg m) in the
    /// flange frame.
    #[inline]
    pub fn loads(&self, frames: &Frames, payload: (f64, V3), loads: &mut Loads) {
        let (mut mass, mut moment) = (0.0, V3::zeros());
        for i in (0..self.n).rev() {
            let (c, f) = (&self.joints[i], &frames.joints[i]);
            if i + 1 == self.n {
                mass += payload.0;
                moment += frames.flange.origin * payload.0 + frames.flange.axes.times(&payload.1);
            }
            mass += c.mass;
            moment += (f.origin + f.axes.times(&c.cog)) * c.mass;
            loads.mass[i] = mass;
            loads.first[i] = moment;
        }
    }

    /// The gravity moment that basis functions look at, ready for derivatives.
    #[inline]
    pub fn moment(&self, frames: &Frames, loads: &Loads, at: MomentAt, gravity: &V3) -> Moment {
        let MomentAt { joint: i, axis, foot } = at;
        let f = &frames.joints[i];
        let about = if foot { f.o_beta } else { f.origin };
        let slides = self.joints[i].prismatic;
        // a tilt turns the axis of rotation, but not the way along which the joint slides
        let e = if axis == Axis::Z && !slides && !foot { f.z_tilted } else { f.bearing.axis(axis) };
        if axis == Axis::Z && slides {
            let weight = gravity * loads.mass[i];
            return Moment {
                at,
                value: e.dot(&weight),
                turn: gravity.cross(&e) * loads.mass[i],
                carry: V3::zeros(),
                arm: e * loads.mass[i],
                about,
                slide: Some(e),
            };
        }
        let s = loads.first[i] - about * loads.mass[i];
        let arm = e.cross(&s);
        Moment {
            at,
            value: arm.dot(gravity),
            turn: gravity.cross(&arm),
            carry: gravity.cross(&e),
            arm,
            about,
            slide: None,
        }
    }
}

/// What each joint carries.
#[derive(Clone, Debug)]
pub(crate) struct Loads {
    pub mass: [f64; MAX_JOINTS],
    /// Sum of mass times place in {w}, kg m.
    pub first: [V3; MAX_JOINTS],
}

impl Loads {
    pub fn new() -> Self {
        Self { mass: [0.0; MAX_JOINTS], first: [V3::zeros(); MAX_JOINTS] }
    }
}

/// Which component of which gravity moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MomentAt {
    /// 0-based.
    pub joint: usize,
    pub axis: Axis,
    /// About the joint's foot instead of its origin.
    pub foot: bool,
}

/// A component `e . M` of a gravity moment `M = S x g`, `S` the first moment of what joint i carries about its origin
/// (or its foot).
///
/// When everything from before joint i turns by `w`: `d(e . M) = -w . (g x (e x S))`, since turning gravity as well would
/// change nothing. When only bodies behind joint i move so that their first moment changes by `b`: `d(e . M) = b . (g x e)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    at: MomentAt,
    /// N m (N for the force along a prismatic joint).
    pub value: f64,
    turn: V3,
    carry: V3,
    /// `e x S`: derivative to gravity.
    pub arm: V3,
    about: V3,
    slide: Option<V3>,
}

impl Moment {
    /// The joint (0-based) about which it acts.
    #[inline]
    pub fn joint(&self) -> usize {
        self.at.joint
    }

    /// Minus its derivative to a rotation of everything from before its joint.
    #[inline]
    pub fn turn(&self) -> &V3 {
        &self.turn
    }

    /// Its derivative to the first moment of what its joint carries.
    #[inline]
    pub fn carry(&self) -> &V3 {
        &self.carry
    }

    /// Derivative to a motion within joint `s`.
    #[inline]
    pub fn by_chain(&self, s: usize, dof: ChainDof, frames: &Frames, loads: &Loads) -> f64 {
        let own = |dof| match dof {
            ChainDof::Theta => true,
            // a tilt turns the axis z with it, but not the bearing's x and y, nor the way along which the joint slides
            ChainDof::TiltX | ChainDof::TiltY => self.at.foot || self.at.axis != Axis::Z || self.slide.is_some(),
            // away from the foot, but the origin goes along
            ChainDof::D => self.at.foot,
            ChainDof::Alpha | ChainDof::A | ChainDof::Beta => false,
        };
        let behind = s > self.at.joint || (s == self.at.joint && own(dof));
        let twist = frames.twist(s, dof);
        if !behind {
            return -twist.angular().dot(&self.turn);
        }
        twist.load(s, loads).dot(&self.carry)
    }

    /// Derivative to the mass of a body at `place` in {w} on the flange.
    #[inline]
    pub fn by_mass(&self, place: &V3, gravity: &V3) -> f64 {
        match self.slide {
            Some(e) => e.dot(gravity),
            None => (place - self.about).dot(&self.carry),
        }
    }

    /// Derivative to the first moment on the flange along `axis` in {w}.
    #[inline]
    pub fn by_first_moment(&self, axis: &V3) -> f64 {
        axis.dot(&self.carry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_turn_loses_no_digit_up_to_the_largest_for_which_the_series_is_used() {
        for d in [SMALL_TURN, -SMALL_TURN, 7e-3, 1e-5, 0.0] {
            for angle in [0.0, 0.3, -1.2, 3.1_f64] {
                let ((s, c), (sine, cosine)) = (turned_by(angle.sin_cos(), d), (angle + d).sin_cos());
                assert!((s - sine).abs() < 3e-16 && (c - cosine).abs() < 3e-16, "{angle} + {d}: {s}, {c}");
            }
        }
    }
}
