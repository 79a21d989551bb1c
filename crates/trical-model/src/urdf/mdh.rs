//! Axes in space to Craig's modified Denavit-Hartenberg parameters, exactly.
//!
//! Between axes that are clearly not parallel, frame {i} stands where the common normal to axis i+1 meets axis i, its x along
//! that normal. Where the feet of the normal would lie far away (axes nearly parallel), the frame stays where it was entered,
//! its x towards the next axis, and Hayati's beta holds what alpha cannot. Either way nothing is rounded away.

use nalgebra::Matrix3;

use crate::pose::Pose;
use crate::robot::{Joint, Robot};

use super::tree::Axes;

type V3 = nalgebra::Vector3<f64>;

/// Axes closer to parallel than this sine always get Hayati's form: a normal is no more accurate than 1e-16 over it.
const LEAST_SINE: f64 = 1e-4;
/// The feet of a common normal may be this many lengths of the arm away from the points that the URDF gives the axes.
const REACH: f64 = 2.0;

/// A line with a direction.
#[derive(Clone, Copy)]
struct Line {
    point: V3,
    z: V3,
}

impl Line {
    fn foot(&self, p: &V3) -> V3 {
        self.point + self.z * self.z.dot(&(p - self.point))
    }
}

/// Feet of the common normal on `a` and on `b`, and its direction; `None` where the axes are nearly parallel.
fn common_normal(a: &Line, b: &Line, size: f64) -> Option<(V3, V3, V3)> {
    let n = a.z.cross(&b.z);
    let sine = n.norm();
    if sine < LEAST_SINE {
        return None;
    }
    let w = b.point - a.point;
    let s = w.cross(&b.z).dot(&n) / (sine * sine);
    let t = w.cross(&a.z).dot(&n) / (sine * sine);
    (s.abs().max(t.abs()) <= REACH * size).then(|| (a.point + a.z * s, b.point + b.z * t, n / sine))
}

/// `v` made perpendicular to `z` and of unit length; `None` where it is (nearly) parallel to it.
fn across(v: &V3, z: &V3) -> Option<V3> {
    let p = v - z * z.dot(v);
    (p.norm() > 1e-6 * v.norm().max(1e-300)).then(|| p.normalize())
}

fn frame(origin: V3, x: &V3, z: &V3) -> Pose {
    // x is perpendicular to z but for rounding: what is left of it goes into y
    let y = z.cross(x).normalize();
    Pose { rotation: Matrix3::from_columns(&[y.cross(z), y, *z]), translation: origin }
}

/// Frame at the foot of `p` on an axis, its x as nearly as can be along that of `like`.
fn beside(line: &Line, like: &Pose) -> Pose {
    let [x, y] = [0, 1].map(|k| like.rotation.column(k).into_owned());
    let x = across(&x, &line.z).or_else(|| across(&y, &line.z)).unwrap_or(x);
    frame(line.foot(&like.translation), &x, &line.z)
}

/// Exactly the identity where nothing but rounding separates them.
fn cleaned(pose: Pose, size: f64) -> Pose {
    let id = Pose::identity();
    let turned = (pose.rotation - id.rotation).amax() > 4.0 * f64::EPSILON;
    let moved = pose.translation.amax() > 4.0 * f64::EPSILON * size;
    Pose {
        rotation: if turned { pose.rotation } else { id.rotation },
        translation: if moved { pose.translation } else { id.translation },
    }
}

/// A number that is zero but for rounding.
fn zeroed(x: f64, size: f64) -> f64 {
    if x.abs() <= 4.0 * f64::EPSILON * size { 0.0 } else { x }
}

/// The arm in Craig's frames; `tip` is the flange at the zero position.
pub(crate) fn robot_from_axes(list: &[Axes], tip: &Pose, name: &str) -> Robot {
    let lines: Vec<Line> = list.iter().map(|j| Line { point: j.point, z: j.axis }).collect();
    let mut points: Vec<V3> = vec![V3::zeros()];
    points.extend(lines.iter().map(|l| l.point));
    points.push(tip.translation);
    let size = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>().max(1e-3);
    let root = Pose::identity();
    let root_from_zero = beside(&lines[0], &root);
    let mut robot = Robot::empty(name);
    robot.root_from_zero = cleaned(root_from_zero, size);
    // where frame {i} is entered: the point on axis i from which d_i counts
    let mut entry = root_from_zero.translation;
    let mut before = root_from_zero;
    for (i, (joint, line)) in list.iter().zip(&lines).enumerate() {
        let mut next_entry = entry;
        let here = match lines.get(i + 1) {
            None => beside(line, tip),
            Some(next) => {
                if let Some((out, into, n)) = common_normal(line, next, size) {
                    next_entry = into;
                    // towards the next axis; where they meet, the way that turns less
                    let reach = (into - out).dot(&n);
                    let turn: V3 = before.rotation.column(0).into();
                    let along = if reach.abs() > 1e-9 * size { reach } else { n.dot(&turn) + 1e-9 };
                    frame(out, &(n * along.signum()), &line.z)
                } else {
                    // where the plane across this axis at the entry meets the next one
                    let s = line.z.dot(&(entry - next.point)) / line.z.dot(&next.z);
                    next_entry = next.point + next.z * s;
                    let way = next_entry - entry;
                    match across(&way, &line.z).filter(|_| way.norm() > 1e-12 * size) {
                        Some(x) => frame(entry, &x, &line.z),
                        None => Pose { translation: entry, ..beside(line, &before) },
                    }
                }
            }
        };
        robot.joints.push(parameters(joint, &before, &here, &entry, size));
        (before, entry) = (here, next_entry);
    }
    robot.last_from_flange = cleaned(before.inverse().compose(tip), size);
    robot
}

/// Parameters of joint i from frames {i-1} and {i} at the zero position.
fn parameters(joint: &Axes, before: &Pose, here: &Pose, entry: &V3, size: f64) -> Joint {
    let z = before.rotation.transpose() * joint.axis;
    let alpha = zeroed(libm::atan2(-z.y, z.z), 1.0);
    let beta = zeroed(libm::atan2(z.x, libm::hypot(z.y, z.z)), 1.0);
    let a = zeroed(before.rotation.column(0).dot(&(entry - before.translation)), size);
    let turned = before.rotation * crate::pose::rotation_x(alpha) * crate::pose::rotation_y(beta);
    let x = here.rotation.column(0);
    let theta = zeroed(libm::atan2(turned.column(1).dot(&x), turned.column(0).dot(&x)), 1.0);
    let d = zeroed(joint.axis.dot(&(here.translation - entry)), size);
    Joint {
        kind: joint.kind,
        alpha,
        a,
        beta,
        d,
        theta_offset: theta,
        limits: joint.limits,
        mass: joint.mass,
        cog: if joint.mass.is_some_and(|m| m > 0.0) { here.inverse().apply(&joint.cog) } else { V3::zeros() },
    }
}
