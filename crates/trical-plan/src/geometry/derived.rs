//! Bodies that a cell file leaves out, from what else is known of the arm and the cell. Deliberately a little stout.

use nalgebra::Vector3;
use trical_model::{Cell, JointKind, Pose, Robot, trig};

use super::{Balls, Body, Place, Role};
use crate::solid::Solid;

type V3 = Vector3<f64>;

/// Half an inch, as in the paper.
const BALL_RADIUS: f64 = 6.35e-3;
const STEM_RADIUS: f64 = 3e-3;
/// The floor lies this far below the base's mounting face, m: a base may be thinner than it looks.
const FLOOR_DROP: f64 = 5e-3;

fn body(name: impl Into<String>, place: Place, role: Role, solids: Vec<Solid>) -> Body {
    Body { name: name.into(), place, role, device: false, solids }
}

/// Capsules along the common normals and axes of the chain.
pub(super) fn links(robot: &Robot) -> Vec<Body> {
    let joints = &robot.joints;
    // from the shoulder on; small arms are stouter than large ones for their reach
    let reach: f64 = joints.iter().skip(1).map(|j| j.a.abs() + j.d.abs()).sum();
    let stout = 0.035 + 0.03 * reach;
    let n = joints.len();
    (0..=n)
        .map(|k| {
            let radius = stout * (1.0 - 0.3 * k as f64 / n as f64);
            let solids = match joints.get(k) {
                None => vec![Solid::sphere(V3::new(0.0, 0.0, -0.5 * radius), 0.7 * radius)],
                Some(next) => {
                    let (s, c) = trig::sin_cos(next.alpha);
                    // body 0 is placed by the arm's foot, and the first joint by {0}
                    let zero = if k == 0 { robot.root_from_zero } else { Pose::identity() };
                    let corner = zero.apply(&V3::new(next.a, 0.0, 0.0));
                    let along = zero.rotation * V3::new(0.0, -s, c);
                    // a sliding joint carries what is behind it as far as it slides
                    let ends = match next.kind {
                        JointKind::Revolute => [next.d; 2],
                        JointKind::Prismatic => [next.d + next.limits[0], next.d + next.limits[1]],
                    };
                    let mut list = vec![Solid::capsule(V3::zeros(), corner, radius)];
                    for d in ends {
                        if d.abs() > 1e-6 && (list.len() == 1 || ends[0] != ends[1]) {
                            list.push(Solid::capsule(corner, corner + along * d, radius));
                        }
                    }
                    if list.len() > 1 && corner.norm() < 1e-6 {
                        list.remove(0);
                    }
                    list
                }
            };
            body(format!("link {k}"), Place::Link(k), Role::Plain, solids)
        })
        .collect()
}

/// Three gauges along the tool's axes, their stems on the negative sides of the ball; a rod for a tool without balls.
pub(super) fn device(cell: &Cell, n: usize, balls: &Balls) -> Vec<Body> {
    let tool = &cell.tool;
    let flange = Place::Link(n);
    let place = |p: V3| tool.tcp + tool.rotation * p;
    if cell.balls.is_empty() || tool.tcp.norm() < 0.06 {
        let mut solids: Vec<Solid> = tool.targets.iter().map(|t| Solid::capsule(V3::zeros(), *t, 0.02)).collect();
        if !cell.balls.is_empty() {
            solids.clear();
        }
        if tool.tcp.norm() > 0.04 {
            solids.push(Solid::capsule(V3::zeros(), tool.tcp * (1.0 - 0.025 / tool.tcp.norm()), 0.02));
        }
        if solids.is_empty() {
            return Vec::new();
        }
        return vec![Body { device: true, ..body("tool", flange, Role::Plain, solids) }];
    }
    let mut bodies = Vec::new();
    for (axis, name) in [V3::x(), V3::y(), V3::z()].into_iter().zip(["x", "y", "z"]) {
        let tip = -axis * (balls.radius + STEM_RADIUS);
        bodies.push(body(
            format!("stem {name}"),
            flange,
            Role::Stem(-axis),
            vec![Solid::capsule(place(tip), place(tip - axis * 0.04), STEM_RADIUS)],
        ));
        // the gauge that points at the flange may not go through it
        let room = (-(tool.rotation * axis)).z;
        let behind = if room < -0.5 { 0.105_f64.min((tool.tcp.z / -room - 0.02).max(0.06)) } else { 0.105 };
        let (front, back) = (place(-axis * 0.065), place(-axis * behind));
        let bracket = V3::new(0.0, 0.0, 0.01);
        bodies.push(body(
            format!("gauge {name}"),
            flange,
            Role::Plain,
            vec![Solid::capsule(front, back, 0.02), Solid::capsule(bracket, (front + back) * 0.5, 0.012)],
        ));
    }
    for b in &mut bodies {
        b.device = true;
    }
    bodies
}

/// Where the floor is in {w}, m.
fn floor_height(cell: &Cell) -> f64 {
    cell.world_from_base.apply(&V3::new(0.0, 0.0, -FLOOR_DROP)).z
}

/// Whether the base stands on a floor: an arm on a wall or a ceiling has none that could be guessed.
fn stands(cell: &Cell) -> bool {
    cell.world_from_base.rotation[(2, 2)] > 0.99
}

pub(super) fn balls(cell: &Cell) -> Balls {
    let lowest = cell.balls.iter().map(|b| b.z).fold(f64::INFINITY, f64::min);
    let room = if stands(cell) && lowest.is_finite() { lowest - floor_height(cell) } else { 1.0 };
    let post_length = if room > 0.03 { 0.1_f64.min(room - 0.014) } else { 0.1 };
    Balls { radius: BALL_RADIUS, post_radius: 4e-3, post_length }
}

/// Each ball, and the post below it.
pub(super) fn balls_and_posts(cell: &Cell, balls: &Balls) -> Vec<Body> {
    let lowest = cell.balls.iter().map(|b| b.z).fold(f64::INFINITY, f64::min);
    let mut bodies = Vec::new();
    for (k, centre) in cell.balls.iter().enumerate() {
        bodies.push(body(
            format!("ball {}", k + 1),
            Place::World,
            Role::Ball(k),
            vec![Solid::sphere(*centre, balls.radius)],
        ));
        let top = centre - V3::z() * (balls.radius + balls.post_radius);
        let foot = V3::new(centre.x, centre.y, (lowest - balls.post_length).min(top.z));
        bodies.push(body(
            format!("post {}", k + 1),
            Place::World,
            Role::Plain,
            vec![Solid::capsule(top, foot, balls.post_radius)],
        ));
    }
    bodies
}

/// A floor under the base, a platform under the balls' posts and a column under the platform.
pub(super) fn obstacles(robot: &Robot, cell: &Cell, balls: &Balls) -> Vec<Body> {
    let mut bodies = Vec::new();
    if stands(cell) {
        // as far as a rail goes, to either side
        let rail = robot
            .joints
            .first()
            .filter(|_| robot.is_on_rail())
            .map_or(0.0, |j| j.limits[1].abs().max(j.limits[0].abs()));
        let wide = 6.0 + 2.0 * rail;
        let below = Pose {
            rotation: cell.world_from_base.rotation,
            translation: cell.world_from_base.apply(&V3::new(0.0, 0.0, -FLOOR_DROP - 0.1)),
        };
        bodies.push(body(
            "floor",
            Place::World,
            Role::Plain,
            vec![Solid::cuboid(below, V3::new(wide, wide, 0.2), 0.0)],
        ));
    }
    let Some(first) = cell.balls.first() else { return bodies };
    let (mut low, mut high) = (*first, *first);
    for b in &cell.balls {
        low = low.inf(b);
        high = high.sup(b);
    }
    const THICK: f64 = 0.012;
    const EDGE: f64 = 0.04;
    let top = low.z - balls.post_length;
    let centre = (low + high) * 0.5;
    let size = V3::new(high.x - low.x + 2.0 * EDGE, high.y - low.y + 2.0 * EDGE, THICK);
    let plate = Pose { translation: V3::new(centre.x, centre.y, top - 0.5 * THICK), ..Pose::identity() };
    let mut solids = vec![Solid::cuboid(plate, size, 0.0)];
    let height = top - THICK - floor_height(cell);
    if stands(cell) && height > 0.02 {
        let column = Pose { translation: V3::new(centre.x, centre.y, top - THICK - 0.5 * height), ..Pose::identity() };
        solids.push(Solid::cuboid(column, V3::new(0.1, 0.1, height), 0.0));
    }
    bodies.push(body("platform", Place::World, Role::Plain, solids));
    bodies
}
