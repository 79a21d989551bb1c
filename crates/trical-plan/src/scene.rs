//! The cell as simple solids: links and device as capsules, platform and table as boxes, the balls' posts as capsules.
//!
//! Where `cell.toml` says nothing, sizes are those of a small arm: links 55 mm and the base 90 mm in radius, posts 6 mm.

use glamx::DPose3;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::query;
use parry3d_f64::shape::{Capsule, Cuboid, Shape};
use trical_model::{Cell, Forward, Pose, State, Workspace};

const LINK_RADIUS: f64 = 0.055;
const WRIST_RADIUS: f64 = 0.045;
const BASE_RADIUS: f64 = 0.09;
const DEVICE_RADIUS: f64 = 0.03;
const POST_RADIUS: f64 = 0.006;
/// The platform lies this far below the lowest ball.
const PLATFORM_DEPTH: f64 = 0.12;
/// The stems of the device reach this far beyond its body.
const STEM: f64 = 0.03;

/// A solid that stands still.
struct Fixed {
    name: String,
    shape: Box<dyn Shape>,
    place: DPose3,
}

/// Something that the arm would touch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contact {
    /// Part of the arm.
    pub part: String,
    /// What it touches.
    pub with: String,
}

/// The cell, ready for checks.
pub struct Scene {
    fixed: Vec<Fixed>,
    tcp: Vector3<f64>,
    clearance: f64,
}

fn place(pose: &Pose) -> DPose3 {
    DPose3::from(Isometry3::from_parts(
        Translation3::from(pose.translation),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation)),
    ))
}

fn capsule(a: &Vector3<f64>, b: &Vector3<f64>, radius: f64) -> Capsule {
    Capsule::new((*a).into(), (*b).into(), radius)
}

impl Scene {
    /// The scene of a cell. `clearance` (m) is kept from everything.
    #[must_use]
    pub fn new(cell: &Cell, clearance: f64) -> Self {
        let mut fixed = Vec::new();
        if !cell.balls.is_empty() {
            #[expect(clippy::cast_precision_loss, reason = "a count")]
            let n = cell.balls.len() as f64;
            let middle = cell.balls.iter().sum::<Vector3<f64>>() / n;
            let low = cell.balls.iter().map(|b| b.z).fold(f64::INFINITY, f64::min) - PLATFORM_DEPTH;
            let reach = cell.balls.iter().map(|b| (b.xy() - middle.xy()).norm()).fold(0.0, f64::max) + 0.05;
            let half = Vector3::new(reach, reach, 0.01);
            fixed.push(Fixed {
                name: "platform".into(),
                shape: Box::new(Cuboid::new(half.into())),
                place: place(&Pose {
                    rotation: nalgebra::Matrix3::identity(),
                    translation: Vector3::new(middle.x, middle.y, low - 0.01),
                }),
            });
            for (k, b) in cell.balls.iter().enumerate() {
                // the ball itself may be touched; its post may not
                let top = b - Vector3::z() * 0.02;
                fixed.push(Fixed {
                    name: format!("post of ball {}", k + 1),
                    shape: Box::new(capsule(&top, &Vector3::new(b.x, b.y, low), POST_RADIUS)),
                    place: place(&Pose::identity()),
                });
            }
        }
        let base = &cell.world_from_base;
        let thick = Vector3::new(1.5, 1.5, 0.05);
        let table = Pose {
            rotation: base.rotation,
            translation: base.translation - base.rotation * Vector3::z() * (thick.z + 0.001),
        };
        fixed.push(Fixed { name: "table".into(), shape: Box::new(Cuboid::new(thick.into())), place: place(&table) });
        Self { fixed, tcp: cell.tool.tcp, clearance }
    }

    /// What the arm would touch with its links at `links` (base first, as [`Forward::world_from_links`] gives them).
    #[must_use]
    pub fn contact(&self, links: &[Pose]) -> Option<Contact> {
        let n = links.len();
        let identity = place(&Pose::identity());
        let flange = links.last()?;
        let tip = flange.apply(&self.tcp);
        let along = (tip - flange.translation).normalize();
        let mut parts: Vec<(usize, Capsule)> = Vec::with_capacity(n + 1);
        for k in 1..n {
            let (a, b) = (links[k - 1].translation, links[k].translation);
            let radius = match k {
                1 => BASE_RADIUS,
                _ if k + 2 >= n => WRIST_RADIUS,
                _ => LINK_RADIUS,
            };
            if (a - b).norm() > 1e-3 {
                parts.push((k, capsule(&a, &b, radius)));
            }
        }
        parts.push((n, capsule(&flange.translation, &(tip - along * (STEM + DEVICE_RADIUS)), DEVICE_RADIUS)));
        let name = |k: usize| if k == n { "device".to_owned() } else { format!("link {k}") };
        let near = |a: &Capsule, shape: &dyn Shape, at: &DPose3| {
            // what parry cannot decide counts as a collision
            query::distance(&identity, a, at, shape).map_or(true, |d| d.distance <= self.clearance)
        };
        for (k, part) in parts.iter().filter(|(k, _)| *k > 1) {
            for f in &self.fixed {
                if near(part, f.shape.as_ref(), &f.place) {
                    return Some(Contact { part: name(*k), with: f.name.clone() });
                }
            }
        }
        // parts of the arm that are three or more apart in the chain can meet
        for (i, (a, pa)) in parts.iter().enumerate() {
            // the wrist's own solid lies around the end of the forearm: what turns about it is always near that end
            let along = pa.segment.b - pa.segment.a;
            let length = along.length();
            let short = if length > 2.0 * WRIST_RADIUS + LINK_RADIUS {
                Capsule::new(pa.segment.a, pa.segment.b - along * ((WRIST_RADIUS + LINK_RADIUS) / length), pa.radius)
            } else {
                *pa
            };
            for (b, pb) in &parts[i + 1..] {
                if b - a >= 3 && near(&short, pb, &identity) {
                    return Some(Contact { part: name(*b), with: name(*a) });
                }
            }
        }
        None
    }

    /// As [`Scene::contact`], at joint values.
    pub fn contact_at(&self, forward: &Forward, q: &[f64], ws: &mut Workspace, links: &mut [Pose]) -> Option<Contact> {
        forward.world_from_links_into(&State::at(q), ws, links);
        self.contact(links)
    }

    /// What the arm would touch on the way between two joint values, in joint interpolation: checked wherever some joint
    /// has moved by 1 deg, with the scene's clearance to spare between.
    pub fn contact_between(
        &self,
        forward: &Forward,
        from: &[f64],
        to: &[f64],
        ws: &mut Workspace,
        links: &mut [Pose],
    ) -> Option<Contact> {
        let most = from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
        let steps = (most / 1.0_f64.to_radians()).ceil().max(1.0) as u32;
        (0..=steps).find_map(|k| {
            let s = f64::from(k) / f64::from(steps);
            let q: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + (b - a) * s).collect();
            self.contact_at(forward, &q, ws, links)
        })
    }
}
