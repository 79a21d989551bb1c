//! Pictures of a cell: arm, device, what stands around, and the poses of a plan, seen from far away (parallel projection).
//!
//! Seen so, a thick segment is a stroke with round ends and a sphere a disc, exactly; whatever else is convex is the outline of
//! its corners. Shapes are drawn from the farthest to the nearest.

mod page;

use std::fmt::Write;

use nalgebra::Vector3;
use trical_model::{Joints, Pose, State};
use trical_plan::geometry::{Place, Role};
use trical_plan::solid::{Core, Solid};
use trical_plan::{CollisionModel, PlanEntry};

use crate::figures::plots::span;
pub use page::View;
pub(crate) use page::escaped;
use page::{Camera, Drawn, Page, Paint};

type V3 = Vector3<f64>;

/// Colours of balls and of what touches them: told apart by those who see red and green alike, too.
const BALLS: [&str; 6] = ["#2666a5", "#d1661f", "#2a9d7c", "#8a5fb0", "#b8901c", "#c2476b"];

/// Colour of a ball (0-based).
pub fn ball_color(ball: usize) -> &'static str {
    BALLS[ball % BALLS.len()]
}

/// A dot.
pub struct Mark {
    /// Place in {w}, m.
    pub place: V3,
    /// Colour.
    pub color: String,
    /// What shows under the pointer.
    pub title: String,
}

/// What is drawn of a plan or of a recording.
pub struct Scene<'a> {
    /// Arm and cell.
    pub model: &'a CollisionModel,
    /// The touches.
    pub touches: &'a [PlanEntry],
    /// Dots over everything.
    pub marks: &'a [Mark],
    /// The pose in which arm and device are drawn as bodies.
    pub shown: Joints,
    /// Centre ({w}, m) and radius of the sphere in which the arm is to be accurate.
    pub sphere: Option<(V3, f64)>,
}

/// The arms of the touches: ball, base to tool in {w}, where the tool comes from.
pub(crate) fn skeletons(scene: &Scene<'_>) -> Vec<(usize, Vec<V3>, V3)> {
    let forward = scene.model.forward();
    let mut ws = forward.workspace();
    let mut skeleton = |q: &Joints| -> Vec<V3> {
        let mut points: Vec<V3> =
            forward.world_from_links(&State::at(q), &mut ws).iter().map(|l| l.translation).collect();
        points.push(forward.world_from_tool(&State::at(q), &mut ws).translation);
        points
    };
    let of = |e: &PlanEntry| (e.ball, skeleton(&e.joints), skeleton(&e.approach).last().copied().unwrap_or_default());
    scene.touches.iter().map(of).collect()
}

/// Of the balls; of the marks where there are none.
fn middle(scene: &Scene<'_>) -> V3 {
    let balls = &scene.model.forward().model().cell.balls;
    let mean = |sum: V3, n: usize| sum / n.max(1) as f64;
    if balls.is_empty() {
        mean(scene.marks.iter().map(|m| m.place).sum(), scene.marks.len())
    } else {
        mean(balls.iter().sum(), balls.len())
    }
}

/// Looks along the line from the base to the balls, as `view` says.
fn camera(scene: &Scene<'_>, view: View, base: &V3) -> Camera {
    let to_balls = middle(scene) - base;
    Camera::new(view, V3::new(to_balls.x, to_balls.y, 0.0).try_normalize(1e-6).unwrap_or_else(V3::x))
}

/// Direction (in the world) in which [`View::Oblique`] looks.
pub fn oblique_look(scene: &Scene<'_>) -> V3 {
    let base = scene.model.forward().model().cell.world_from_base.translation;
    camera(scene, View::Oblique, &base).rows.row(2).transpose()
}

/// An SVG of the cell, `width` pixels wide at most.
pub fn draw(scene: &Scene<'_>, view: View, width: f64) -> String {
    let forward = scene.model.forward();
    let balls = &forward.model().cell.balls;
    let links = forward.world_from_links(&State::at(&scene.shown), &mut forward.workspace());
    let skeletons = skeletons(scene);
    let base = links.first().map_or_else(V3::zeros, |b| b.translation);

    // the page shows what belongs to arm and balls; larger things are cut off at its edge
    let mut shown: Vec<V3> = vec![base];
    shown.extend(balls);
    shown.extend(links.iter().map(|l| l.translation));
    shown.extend(skeletons.iter().flat_map(|s| &s.1));
    shown.extend(scene.marks.iter().map(|m| m.place));
    let (page, height) = Page::around(&shown, camera(scene, view, &base), width);

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"100%\" style=\"max-width:{width:.0}px\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"system-ui, sans-serif\">\
         <rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"#fafbfc\"/>"
    );
    svg += &bodies(scene, &page, &links);
    if let Some((centre, radius)) = scene.sphere {
        let (x, y, _) = page.at(&centre);
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"#2666a5\" fill-opacity=\"0.05\" stroke=\"#2666a5\" \
             stroke-opacity=\"0.6\" stroke-dasharray=\"5 4\"><title>where the arm is to be accurate</title></circle>",
            radius * page.scale
        );
    }
    // the poses over everything: they are what the picture is about
    for (k, (ball, points, approach)) in skeletons.iter().enumerate() {
        svg += &touch(&page, k, *ball, points, approach);
    }
    for m in scene.marks {
        let (x, y, _) = page.at(&m.place);
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{}\" stroke=\"#fff\" stroke-width=\"0.8\"><title>{}</title></circle>",
            m.color,
            escaped(&m.title)
        );
    }
    for (k, ball) in balls.iter().enumerate() {
        let style = format!(
            "font-size=\"15\" font-weight=\"700\" fill=\"{}\" stroke=\"#fff\" stroke-width=\"3\" paint-order=\"stroke\"",
            ball_color(k)
        );
        svg += &page.text(ball, 9.0, -8.0, &format!("{}", k + 1), &style);
    }
    svg + &page.axes() + &page.scale_bar(height) + "</svg>"
}

/// The bodies from the farthest to the nearest; first those as large as the room, pale: they must hide nothing.
fn bodies(scene: &Scene<'_>, page: &Page, links: &[Pose]) -> String {
    let balls = &scene.model.forward().model().cell.balls;
    let mut large: Vec<Drawn> = Vec::new();
    let mut drawn: Vec<Drawn> = Vec::new();
    for body in scene.model.bodies() {
        let title = &escaped(&body.name);
        let paint = |fill, edge, opacity| Paint { fill, edge, opacity, title };
        for s in &body.solids {
            match (body.place, body.role) {
                (Place::World, Role::Ball(k)) => {
                    let centre = balls.get(k).copied().unwrap_or_else(|| middle(scene));
                    drawn.push(page.ball(&centre, s.radius, ball_color(k), title));
                }
                (Place::World, _) if extent(s) > 0.6 => {
                    large.extend(page.solid(&Pose::identity(), s, paint("#eceff3", "#b4bfcc", 0.75)));
                }
                (Place::World, _) => drawn.extend(page.solid(&Pose::identity(), s, paint("#d5dbe3", "#b4bfcc", 1.0))),
                (Place::Link(k), _) => {
                    let pose = links.get(k).copied().unwrap_or_else(Pose::identity);
                    let (fill, edge) = if body.device { ("#5d6b7c", "#39434f") } else { ("#f0a35e", "#b06c2c") };
                    drawn.extend(page.solid(&pose, s, paint(fill, edge, 1.0)));
                }
            }
        }
    }
    large.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    drawn.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    large.into_iter().chain(drawn).map(|d| d.svg).collect()
}

/// The arm of a touch, and the way of the tool from where it comes.
fn touch(page: &Page, k: usize, ball: usize, points: &[V3], approach: &V3) -> String {
    let color = ball_color(ball);
    let tip = points.last().copied().unwrap_or_default();
    let arm = page.line(
        points,
        &format!("stroke=\"{color}\" stroke-width=\"1.3\" stroke-opacity=\"0.5\" stroke-linejoin=\"round\""),
    );
    let way = page.line(&[*approach, tip], &format!("stroke=\"{color}\" stroke-width=\"2.2\" stroke-opacity=\"0.9\""));
    let mut svg = format!("<g><title>touch {} of ball {}</title>{arm}", k + 1, ball + 1);
    for p in points.iter().skip(1).take(points.len().saturating_sub(2)) {
        let (x, y, _) = page.at(p);
        let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.7\" fill=\"{color}\" opacity=\"0.6\"/>");
    }
    svg + &way + "</g>"
}

/// Length of the longest edge or axis of a solid, m.
pub(crate) fn extent(solid: &Solid) -> f64 {
    match &solid.core {
        Core::Segment(a, b) => (a - b).norm(),
        Core::Box(_, half) => 2.0 * half.max(),
        Core::Cylinder(_, half, r) => 2.0 * half.max(*r),
        Core::Hull(hull) => {
            let p = hull.points();
            let wide = |f: fn(&V3) -> f64| {
                let (low, high) = span(p.iter().map(|p| f(&V3::new(p.x, p.y, p.z))));
                high - low
            };
            wide(|p| p.x).max(wide(|p| p.y)).max(wide(|p| p.z))
        }
    }
}
