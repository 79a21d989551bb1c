//! Whether the arm, its device and the cell meet, at a configuration and along a motion.

mod guard;
mod motion;
mod pairs;
mod tool;

use nalgebra::Vector3;
use trical_model::{Cell, Forward, Joints, Model, Pose, Robot, State, Workspace};

use crate::error::Result;
use crate::geometry::{Body, Geometry, Place, Role};
use crate::solid::{Core, Solid, distance, distance_segment_box, distance_segment_segment};

pub use guard::MotionGuard;
pub use motion::MotionWorkspace;
use pairs::Pair;

type V3 = Vector3<f64>;

/// Two bodies that are closer than the margin: indices into [`CollisionModel::bodies`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Contact {
    /// One body.
    pub a: usize,
    /// The other one.
    pub b: usize,
}

/// One solid of one body.
#[derive(Clone, Debug)]
struct Part {
    solid: Solid,
    body: usize,
    /// Index into the poses of the links; the last entry is {w} itself.
    frame: usize,
}

/// The nominal arm in its cell, ready for many checks. Shared between threads.
///
/// The nominal arm stands for the real one: they differ by a few millimetres at most, which is what the margin is for.
#[derive(Clone, Debug)]
pub struct CollisionModel {
    forward: Forward,
    bodies: Vec<Body>,
    parts: Vec<Part>,
    pairs: Vec<Pair>,
    always: Vec<Contact>,
    margin: f64,
    retreat: V3,
    joints: usize,
}

impl CollisionModel {
    /// Builds the bodies of arm, device and cell, and the list of pairs that can meet.
    ///
    /// Left out are: pairs that do not move against each other; neighbouring links; pairs named in `ignore`; pairs of the arm
    /// and its device that meet whatever the joints do, since their solids overlap by design (see
    /// [`CollisionModel::always_in_contact`]).
    ///
    /// # Errors
    /// What is wrong with the `[geometry]` of the cell.
    pub fn new(robot: &Robot, cell: &Cell) -> Result<Self> {
        let geometry = Geometry::of(robot, cell)?;
        let forward = Forward::new(Model::nominal(robot.clone(), cell.clone()), Vec::new())?;
        let n = robot.dof();
        let mut parts = Vec::new();
        for (body, b) in geometry.bodies.iter().enumerate() {
            let frame = match b.place {
                Place::World => n + 1,
                Place::Link(k) => k.min(n),
            };
            parts.extend(b.solids.iter().map(|s| Part { solid: s.clone(), body, frame }));
        }
        let mut this = Self {
            pairs: Vec::new(),
            always: Vec::new(),
            forward,
            parts,
            margin: geometry.margin,
            retreat: geometry.retreat,
            joints: n,
            bodies: geometry.bodies,
        };
        this.pairs = pairs::build(&this, &geometry.ignore);
        this.always = pairs::always_in_contact(&this);
        let (always, parts) = (&this.always, &this.parts);
        this.pairs.retain(|p| {
            let (a, b) = (parts[p.a].body, parts[p.b].body);
            !always.contains(&Contact { a: a.min(b), b: a.max(b) })
        });
        Ok(this)
    }

    /// The same with another clearance to keep, m: a motion that was planned with a generous one is checked with less when the
    /// arm has been corrected away from its nominal pose.
    #[must_use]
    pub fn with_margin(mut self, margin: f64) -> Self {
        self.margin = margin.max(2e-4);
        self
    }

    /// The nominal forward model that the checks use.
    #[must_use]
    pub fn forward(&self) -> &Forward {
        &self.forward
    }

    /// The bodies; a [`Contact`] points into them.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Names of the two bodies of a contact.
    #[must_use]
    pub fn names(&self, contact: Contact) -> (&str, &str) {
        let name = |k: usize| self.bodies.get(k).map_or("?", |b| b.name.as_str());
        (name(contact.a), name(contact.b))
    }

    /// Pairs of the arm's own bodies that are never checked because they meet at every configuration.
    #[must_use]
    pub fn always_in_contact(&self) -> &[Contact] {
        &self.always
    }

    /// Number of pairs of solids that are checked.
    #[must_use]
    pub fn pair_count(&self) -> usize {
        self.pairs.len()
    }

    /// Clearance that is kept, m.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin
    }

    /// Direction in which the device leaves a ball, unit vector in the tool's axes.
    #[must_use]
    pub fn retreat(&self) -> &V3 {
        &self.retreat
    }

    /// Sides of the TCP on which the stems are, unit vectors in the tool's axes.
    pub fn stems(&self) -> impl Iterator<Item = V3> + '_ {
        self.bodies.iter().filter_map(|b| if let Role::Stem(side) = b.role { Some(side) } else { None })
    }

    /// Two bodies that are closer than the margin with the base and joint frames at `links` (n + 1 poses in {w}, as
    /// [`Forward::world_from_links_into`] gives them), or `None`. Nothing is allocated.
    #[must_use]
    pub fn check(&self, links: &[Pose]) -> Option<Contact> {
        self.check_touching(links, None)
    }

    /// As [`CollisionModel::check`], where the device's stems may meet ball `touched` (0-based).
    #[must_use]
    pub fn check_touching(&self, links: &[Pose], touched: Option<usize>) -> Option<Contact> {
        self.pairs
            .iter()
            .find(|p| !p.allowed(touched) && self.closer_than(p, links, self.margin))
            .map(|p| self.contact(p))
    }

    /// As [`CollisionModel::check_touching`] at joint values `q`.
    #[must_use]
    pub fn check_joints(&self, q: &Joints, touched: Option<usize>, ws: &mut MotionWorkspace) -> Option<Contact> {
        let MotionWorkspace { ws, links, .. } = ws;
        self.place(q, ws, links);
        self.check_touching(links, touched)
    }

    /// Smallest distance of any checked pair, m (at most 0 where two meet), and the pair; `None` where nothing can meet.
    #[must_use]
    pub fn clearance(&self, links: &[Pose], touched: Option<usize>) -> Option<(f64, Contact)> {
        self.pairs
            .iter()
            .filter(|p| !p.allowed(touched))
            .map(|p| (self.pair_distance(p, links), self.contact(p)))
            .min_by(|x, y| x.0.total_cmp(&y.0))
    }

    fn place(&self, q: &Joints, ws: &mut Workspace, links: &mut [Pose]) {
        self.forward.world_from_links_into(&State::at(q), ws, links);
    }

    fn contact(&self, pair: &Pair) -> Contact {
        let (a, b) = (self.parts[pair.a].body, self.parts[pair.b].body);
        Contact { a: a.min(b), b: a.max(b) }
    }

    /// Whether the two solids of a pair are closer than `limit`, by their spheres first.
    #[inline]
    fn closer_than(&self, pair: &Pair, links: &[Pose], limit: f64) -> bool {
        self.least_distance(pair, links) < limit && self.pair_distance(pair, links) < limit
    }

    /// A lower bound of the pair's distance, from spheres (and for boxes, the box itself), m.
    #[inline]
    fn least_distance(&self, pair: &Pair, links: &[Pose]) -> f64 {
        let (a, b) = (&self.parts[pair.a], &self.parts[pair.b]);
        let ca = links[a.frame].apply(&a.solid.centre);
        // b stands still in {w} in most pairs
        let thick = a.solid.bound + a.solid.radius + b.solid.radius;
        if b.frame > self.joints {
            if let Core::Box(_, half) = &b.solid.core {
                let x = pair.still.apply(&ca);
                return V3::from_fn(|i, _| (x[i].abs() - half[i]).max(0.0)).norm() - thick;
            }
            return (ca - b.solid.centre).norm() - thick - b.solid.bound;
        }
        (ca - links[b.frame].apply(&b.solid.centre)).norm() - thick - b.solid.bound
    }

    #[inline]
    fn pair_distance(&self, pair: &Pair, links: &[Pose]) -> f64 {
        let (a, b) = (&self.parts[pair.a], &self.parts[pair.b]);
        let pa = &links[a.frame];
        if b.frame <= self.joints {
            return distance(pa, &a.solid, &links[b.frame], &b.solid);
        }
        match (&a.solid.core, &b.solid.core) {
            (Core::Segment(a0, a1), Core::Segment(b0, b1)) => {
                distance_segment_segment(&pa.apply(a0), &pa.apply(a1), b0, b1) - a.solid.radius - b.solid.radius
            }
            (Core::Segment(a0, a1), Core::Box(_, half)) => {
                let (s0, s1) = (pair.still.apply(&pa.apply(a0)), pair.still.apply(&pa.apply(a1)));
                distance_segment_box(&s0, &s1, half) - a.solid.radius - b.solid.radius
            }
            _ => distance(pa, &a.solid, &Pose::identity(), &b.solid),
        }
    }
}

#[cfg(test)]
mod tests;
