//! What stands in the cell, as data: the `[geometry]` section of `cell.toml`, with defaults for whatever it leaves out.
//!
//! ```toml
//! [geometry]
//! margin_mm = 5.0                       # clearance to keep; 5 if left out: an arm that is not calibrated is off by 3
//! retreat = [-1.0, -1.0, -1.0]          # in the tool's axes: the way in which the device leaves a ball;
//!                                       # if left out: away along all stems, or along -z
//! ignore = [["link 4", "link 6"]]       # pairs of bodies that may meet
//!
//! [geometry.balls]
//! diameter_mm = 12.7
//! post_radius_mm = 4.0                  # each ball stands on a post, down along -z of {w}
//! post_length_mm = 90.0
//!
//! [[geometry.link]]                     # bodies of the arm, in frame {link}; 0 is the base
//! link = 2
//! name = "upper arm"                    # "link 2" if left out
//! solids = [{ shape = "capsule", from_mm = [0, 0, 0], to_mm = [270, 0, 0], radius_mm = 65 }]
//!
//! [[geometry.device]]                   # bodies on the flange
//! name = "stem x"
//! frame = "tool"                        # origin in the TCP, axes of the tool; "flange" if left out
//! touches = true                        # may meet the ball that is being touched; its direction from the TCP is the side
//! solids = [{ shape = "capsule", from_mm = [-9.35, 0, 0], to_mm = [-50, 0, 0], radius_mm = 3 }]
//!
//! [[geometry.obstacle]]                 # all that does not move
//! name = "table"
//! frame = "base"                        # {0}; "world" if left out
//! solids = [{ shape = "box", center_mm = [0, 0, -110], size_mm = [2000, 2000, 200] }]
//! ```
//!
//! Shapes: `sphere` (`center_mm`, `radius_mm`), `capsule` and `cylinder` (`from_mm`, `to_mm`, `radius_mm`), `box` (`center_mm`,
//! `size_mm`, `zyx_deg`, `rounding_mm`), `hull` (`points_mm`, `rounding_mm`), `mesh` (`file`, an STL or OBJ beside `cell.toml`;
//! `unit_mm`, `at_mm`, `zyx_deg`, `rounding_mm`; its hull, or with `shells = true` that of each of its shells). A solid is
//! convex; several make a body.
//! A list that is left out altogether is derived: capsules along the arm's axes, a device of three gauges, posts, a platform
//! under the balls and a floor under the base. An empty list (`obstacle = []`) means that there is nothing.

mod derived;
mod file;
pub mod mesh;

use nalgebra::Vector3;
use trical_model::{Cell, Robot};

use crate::error::Result;
use crate::solid::Solid;

/// On what a body is mounted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It does not move; its solids are given in {w}.
    World,
    /// Frame {k} of the arm, 0 the base, n the flange.
    Link(usize),
}

/// What a body is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// A body that must meet nothing.
    Plain,
    /// Part of the device that touches balls; the unit vector from the TCP to it, in the tool's axes.
    Stem(Vector3<f64>),
    /// Ball k, 0-based.
    Ball(usize),
}

/// A rigid body of the cell.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its name in messages and in `ignore`.
    pub name: String,
    /// On what it is mounted.
    pub place: Place,
    /// What it is for.
    pub role: Role,
    /// Whether it belongs to the device rather than to the arm.
    pub device: bool,
    /// Its shape, in the frame on which it is mounted, m.
    pub solids: Vec<Solid>,
}

/// All bodies of a cell.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// The bodies: arm, device, obstacles, balls and posts, in this order.
    pub bodies: Vec<Body>,
    /// Pairs of names of bodies that may meet.
    pub ignore: Vec<(String, String)>,
    /// Clearance to keep, m.
    pub margin: f64,
    /// Direction in which the device leaves a ball, unit vector in the tool's axes.
    pub retreat: Vector3<f64>,
}

impl Geometry {
    /// Reads the cell's `[geometry]`, and derives what it leaves out.
    ///
    /// # Errors
    /// [`crate::PlanError::Geometry`] names section and field, what was found and what is expected.
    pub fn of(robot: &Robot, cell: &Cell) -> Result<Self> {
        // the commands have done so already, from the cell's own folder
        let mut cell = cell.clone();
        mesh::resolve_meshes(&mut cell, std::path::Path::new("."))?;
        let cell = &cell;
        let sections = file::read(robot, cell)?;
        let balls = sections.balls.unwrap_or_else(|| derived::balls(cell));
        let mut bodies = sections.links.unwrap_or_else(|| derived::links(robot));
        bodies.extend(sections.device.unwrap_or_else(|| derived::device(cell, robot.dof(), &balls)));
        bodies.extend(sections.obstacles.unwrap_or_else(|| derived::obstacles(robot, cell, &balls)));
        bodies.extend(derived::balls_and_posts(cell, &balls));
        file::check_names(&bodies, &sections.ignore)?;
        file::check_balls_stand_free(&bodies)?;
        let retreat = file::retreat(sections.retreat, &bodies)?;
        Ok(Self { bodies, ignore: sections.ignore, margin: sections.margin, retreat })
    }
}

/// Size of the balls and of what they stand on, m.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Balls {
    radius: f64,
    post_radius: f64,
    post_length: f64,
}

#[cfg(test)]
mod tests;
