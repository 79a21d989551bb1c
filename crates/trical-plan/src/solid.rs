//! Solids as a convex core thickened by a radius, and exact distances between their cores.
//!
//! A sphere is a thick point, a capsule a thick segment. Distances between points, segments and boxes are closed forms;
//! whatever involves a hull, a cylinder or two boxes is parry's, less [`GJK_SLACK`].

mod segment_box;
mod segment_segment;

use nalgebra::{Matrix3, Vector3};
use parry3d_f64::glamx::{DMat3, DQuat, DVec3};
use parry3d_f64::query::{self, PointQuery};
use parry3d_f64::shape::{ConvexPolyhedron, Cuboid, Cylinder, Segment, Shape};
use trical_model::Pose;

pub use segment_box::distance_segment_box;
pub use segment_segment::distance_segment_segment;

type V3 = Vector3<f64>;

/// Taken off every distance that parry's iteration finds (it can be up to 16 um too large at curved surfaces), m.
pub const GJK_SLACK: f64 = 50e-6;

/// The core of a solid, in the frame of its body, m.
#[derive(Clone, Debug)]
pub enum Core {
    /// From one point to another; a point where they are the same.
    Segment(V3, V3),
    /// A box: its axes and centre in the body's frame, and half its edges.
    Box(Pose, V3),
    /// A cylinder about the y axis of the given frame: half its height, radius.
    Cylinder(Pose, f64, f64),
    /// The hull of points.
    Hull(Box<ConvexPolyhedron>),
}

/// A convex core thickened by a radius.
#[derive(Clone, Debug)]
pub struct Solid {
    /// The core.
    pub core: Core,
    /// Thickness around the core, m.
    pub radius: f64,
    /// Centre of a sphere around the core, in the body's frame, m.
    pub(crate) centre: V3,
    /// Radius of that sphere, without the thickness, m.
    pub(crate) bound: f64,
}

impl Solid {
    /// A sphere.
    #[must_use]
    pub fn sphere(centre: V3, radius: f64) -> Self {
        Self::capsule(centre, centre, radius)
    }

    /// All points within `radius` of a segment.
    #[must_use]
    pub fn capsule(from: V3, to: V3, radius: f64) -> Self {
        Self { core: Core::Segment(from, to), radius, centre: (from + to) * 0.5, bound: (to - from).norm() * 0.5 }
    }

    /// A box with the axes and centre of `frame` and edges `size`, its edges rounded off outwards by `radius`.
    #[must_use]
    pub fn cuboid(frame: Pose, size: V3, radius: f64) -> Self {
        let half = size * 0.5;
        Self { centre: frame.translation, bound: half.norm(), core: Core::Box(frame, half), radius }
    }

    /// A flat-ended cylinder. `None` where its ends coincide.
    #[must_use]
    pub fn cylinder(from: V3, to: V3, radius: f64) -> Option<Self> {
        let axis = to - from;
        let height = axis.norm();
        if height < 1e-9 {
            return None;
        }
        let y = axis / height;
        let x = y.cross(&if y.x.abs() < 0.9 { V3::x() } else { V3::y() }).normalize();
        let frame = Pose { rotation: Matrix3::from_columns(&[x, y, x.cross(&y)]), translation: (from + to) * 0.5 };
        Some(Self {
            centre: frame.translation,
            bound: libm::hypot(height * 0.5, radius),
            core: Core::Cylinder(frame, height * 0.5, radius),
            radius: 0.0,
        })
    }

    /// The hull of `points`, thickened by `radius`. `None` where they lie in a plane.
    #[must_use]
    pub fn hull(points: &[V3], radius: f64) -> Option<Self> {
        if !spans_space(points) {
            return None;
        }
        let list: Vec<DVec3> = points.iter().map(vec3).collect();
        let hull = ConvexPolyhedron::from_convex_hull(&list)?;
        // a hull that has lost a corner would be a silent "free"
        if list.iter().any(|p| hull.distance_to_local_point(*p, true) > 1e-7) {
            return None;
        }
        let centre = points.iter().sum::<V3>() / points.len() as f64;
        let bound = points.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        Some(Self { core: Core::Hull(Box::new(hull)), radius, centre, bound })
    }

    /// Corners whose hull contains the core, in the body's frame, for bounds on how fast a solid moves.
    pub(crate) fn corners(&self) -> Vec<V3> {
        let of_box = |frame: &Pose, h: V3| {
            (0..8)
                .map(|k| {
                    let sign = |bit: u32| if k & bit == 0 { -1.0 } else { 1.0 };
                    frame.apply(&V3::new(h.x * sign(1), h.y * sign(2), h.z * sign(4)))
                })
                .collect()
        };
        match &self.core {
            Core::Segment(a, b) => vec![*a, *b],
            Core::Box(frame, half) => of_box(frame, *half),
            Core::Cylinder(frame, half, r) => of_box(frame, V3::new(*r, *half, *r)),
            Core::Hull(hull) => hull.points().iter().map(|p| V3::new(p.x, p.y, p.z)).collect(),
        }
    }
}

/// Whether points have a volume to speak of: parry's hull of a flat set panics or lies.
fn spans_space(points: &[V3]) -> bool {
    let Some(first) = points.first() else { return false };
    let size = points.iter().map(|p| (p - first).norm()).fold(0.0, f64::max);
    let Some(b) = points.iter().find(|p| (*p - first).norm() > 0.5 * size) else { return false };
    let u = b - first;
    let far = |v: &V3| u.cross(v).norm();
    let Some(c) = points.iter().map(|p| p - first).max_by(|x, y| far(x).total_cmp(&far(y))) else { return false };
    let normal = u.cross(&c);
    let height = points.iter().map(|p| normal.dot(&(p - first)).abs()).fold(0.0, f64::max);
    normal.norm() > 1e-6 * size * size && height > 1e-6 * size * normal.norm()
}

fn vec3(v: &V3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

fn parry_pose(pose: &Pose) -> parry3d_f64::math::Pose {
    let r = &pose.rotation;
    let m = DMat3::from_cols(vec3(&r.column(0).into()), vec3(&r.column(1).into()), vec3(&r.column(2).into()));
    parry3d_f64::math::Pose::from_parts(vec3(&pose.translation), DQuat::from_mat3(&m))
}

/// Distance between the surfaces of `a` on a body at `world_from_a` and `b` on a body at `world_from_b`, m: negative by at
/// most the sum of their thicknesses where they overlap, and at most 0 wherever they do.
#[must_use]
pub fn distance(world_from_a: &Pose, a: &Solid, world_from_b: &Pose, b: &Solid) -> f64 {
    core_distance(world_from_a, a, world_from_b, b) - a.radius - b.radius
}

fn core_distance(pa: &Pose, a: &Solid, pb: &Pose, b: &Solid) -> f64 {
    match (&a.core, &b.core) {
        (Core::Segment(a0, a1), Core::Segment(b0, b1)) => {
            distance_segment_segment(&pa.apply(a0), &pa.apply(a1), &pb.apply(b0), &pb.apply(b1))
        }
        (Core::Segment(s0, s1), Core::Box(frame, half)) => {
            let to_box = frame.inverse().compose(&pb.inverse().compose(pa));
            distance_segment_box(&to_box.apply(s0), &to_box.apply(s1), half)
        }
        (Core::Box(..), Core::Segment(..)) => core_distance(pb, b, pa, a),
        _ => by_parry(pa, a, pb, b),
    }
}

/// What parry says, less the slack; a pair that it does not know counts as in contact.
fn by_parry(pa: &Pose, a: &Solid, pb: &Pose, b: &Solid) -> f64 {
    with_shape(pa, a, |p1, s1| {
        with_shape(pb, b, |p2, s2| query::distance(p1, s1, p2, s2).map_or(0.0, |d| (d.distance - GJK_SLACK).max(0.0)))
    })
}

fn with_shape<R>(body: &Pose, solid: &Solid, f: impl FnOnce(&parry3d_f64::math::Pose, &dyn Shape) -> R) -> R {
    match &solid.core {
        Core::Segment(a, b) => f(&parry_pose(body), &Segment::new(vec3(a), vec3(b))),
        Core::Box(frame, half) => f(&parry_pose(&body.compose(frame)), &Cuboid::new(vec3(half))),
        Core::Cylinder(frame, half, r) => f(&parry_pose(&body.compose(frame)), &Cylinder::new(*half, *r)),
        Core::Hull(hull) => f(&parry_pose(body), hull.as_ref()),
    }
}

/// A pose from its parts, re-orthogonalized: files give angles, never matrices.
#[must_use]
pub(crate) fn pose_zyx(translation: V3, zyx: [f64; 3]) -> Pose {
    Pose { rotation: trical_model::pose::rotation_zyx(zyx[0], zyx[1], zyx[2]), translation }
}

#[cfg(test)]
mod tests;
