//! Pictures of a cell: arm, device, what stands around, and the poses of a plan, seen from far away (parallel projection).
//!
//! Seen so, a thick segment is a stroke with round ends and a sphere a disc, exactly; whatever else is convex is the outline of
//! its corners. Shapes are drawn from the farthest to the nearest.

use std::fmt::Write;

use nalgebra::{Matrix3, Vector3};
use trical_model::{Joints, Pose, State};
use trical_plan::geometry::{Place, Role};
use trical_plan::solid::{Core, Solid};
use trical_plan::{CollisionModel, PlanEntry};

use crate::outline::hull;
use crate::turn;

type V3 = Vector3<f64>;

/// Colours of balls and of what touches them: told apart by those who see red and green alike, too.
const BALLS: [&str; 6] = ["#2666a5", "#d1661f", "#2a9d7c", "#8a5fb0", "#b8901c", "#c2476b"];

/// Colour of a ball (0-based).
pub fn ball_color(ball: usize) -> &'static str {
    BALLS[ball % BALLS.len()]
}

/// From where the cell is looked at.
#[derive(Clone, Copy)]
pub enum View {
    /// From the side and above.
    Oblique,
    /// From straight above.
    Above,
    /// From the side of the line from the base to the balls.
    Side,
}

/// {w} to the page: x to the right, y down, and depth away from the eye, m.
struct Camera {
    rows: Matrix3<f64>,
}

impl Camera {
    /// `ahead`: from the base to the balls, level.
    fn new(view: View, ahead: V3) -> Self {
        let turn = |angle: f64| trical_model::pose::rotation_z(angle) * ahead;
        // from the eye into the picture
        let (look, up) = match view {
            View::Oblique => {
                let level = -turn(-0.95);
                ((level * 0.88 - V3::z() * 0.47).normalize(), V3::z())
            }
            View::Above => (-V3::z(), ahead),
            View::Side => (-turn(-std::f64::consts::FRAC_PI_2), V3::z()),
        };
        let right = look.cross(&up).normalize();
        let down = look.cross(&right);
        Self { rows: Matrix3::from_rows(&[right.transpose(), down.transpose(), look.transpose()]) }
    }

    fn see(&self, p: &V3) -> V3 {
        self.rows * p
    }
}

/// Something to draw, and how far away it is.
struct Drawn {
    depth: f64,
    svg: String,
}

struct Page {
    camera: Camera,
    /// Pixels per metre.
    scale: f64,
    left: f64,
    top: f64,
}

impl Page {
    fn at(&self, p: &V3) -> (f64, f64, f64) {
        let s = self.camera.see(p);
        ((s.x - self.left) * self.scale, (s.y - self.top) * self.scale, s.z)
    }

    fn line(&self, points: &[V3], style: &str) -> String {
        let list: Vec<String> = points
            .iter()
            .map(|p| {
                let (x, y, _) = self.at(p);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        format!("<polyline points=\"{}\" fill=\"none\" {style}/>", list.join(" "))
    }

    fn text(&self, p: &V3, dx: f64, dy: f64, text: &str, style: &str) -> String {
        let (x, y, _) = self.at(p);
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        format!("<text x=\"{:.1}\" y=\"{:.1}\" {style}>{text}</text>", x + dx, y + dy)
    }

    /// The outline of points that is filled, with an edge as thick as the solid is rounded.
    fn outline(&self, points: &[V3], radius: f64, fill: &str, edge: &str, opacity: f64, title: &str) -> Drawn {
        let seen: Vec<(f64, f64, f64)> = points.iter().map(|p| self.at(p)).collect();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let depth = seen.iter().map(|s| s.2).sum::<f64>() / seen.len().max(1) as f64;
        let list: Vec<String> = hull(&seen.iter().map(|s| (s.0, s.1)).collect::<Vec<_>>())
            .iter()
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let list = list.join(" ");
        let wide = 2.0 * radius * self.scale;
        let mut svg = format!("<g opacity=\"{opacity}\"><title>{title}</title>");
        if wide > 1.0 {
            let _ = write!(
                svg,
                "<polygon points=\"{list}\" fill=\"{edge}\" stroke=\"{edge}\" stroke-width=\"{:.1}\" \
                 stroke-linejoin=\"round\"/>",
                wide + 1.4
            );
        }
        let _ = write!(
            svg,
            "<polygon points=\"{list}\" fill=\"{fill}\" stroke=\"{}\" stroke-width=\"{:.1}\" stroke-linejoin=\"round\"/></g>",
            if wide > 1.0 { fill } else { edge },
            wide.max(0.8)
        );
        Drawn { depth, svg }
    }

    fn solid(&self, pose: &Pose, solid: &Solid, fill: &str, edge: &str, opacity: f64, title: &str) -> Vec<Drawn> {
        match &solid.core {
            Core::Segment(a, b) => {
                // in pieces, so that long ones are sorted rightly; opacity of overlapping pieces would show
                let pieces = if opacity < 1.0 { 1 } else { 6 };
                let (a, b) = (pose.apply(a), pose.apply(b));
                let wide = 2.0 * solid.radius * self.scale;
                let stroke = |from: &V3, to: &V3, color: &str, wide: f64| {
                    self.line(
                        &[*from, *to],
                        &format!("stroke=\"{color}\" stroke-width=\"{wide:.1}\" stroke-linecap=\"round\""),
                    )
                };
                let mut drawn = Vec::new();
                for k in 0..pieces {
                    let part = |k: usize| {
                        a + (b - a)
                            * (f64::from(u8::try_from(k).unwrap_or(0)) / f64::from(u8::try_from(pieces).unwrap_or(1)))
                    };
                    let (from, to) = (part(k), part(k + 1));
                    let middle = self.at(&((from + to) * 0.5)).2;
                    let mut svg = format!("<g opacity=\"{opacity}\"><title>{title}</title>");
                    // the edge lies behind all pieces of the body
                    if k == 0 {
                        drawn.push(Drawn {
                            depth: self.at(&a).2.max(self.at(&b).2),
                            svg: format!("<g opacity=\"{opacity}\">{}</g>", stroke(&a, &b, edge, wide + 1.6)),
                        });
                    }
                    svg += &stroke(&from, &to, fill, wide);
                    // light from above: a paler stroke, off the middle
                    let lift = V3::z() * solid.radius * 0.35;
                    svg += &self.line(
                        &[from + lift, to + lift],
                        &format!(
                            "stroke=\"#fff\" stroke-opacity=\"0.16\" stroke-width=\"{:.1}\" stroke-linecap=\"round\"",
                            wide * 0.45
                        ),
                    );
                    svg += "</g>";
                    drawn.push(Drawn { depth: middle, svg });
                }
                drawn
            }
            Core::Box(frame, half) => self.cuboid(&pose.compose(frame), half, solid.radius, fill, edge, opacity, title),
            Core::Cylinder(frame, half, r) => {
                let frame = pose.compose(frame);
                let points: Vec<V3> = (0..48)
                    .map(|k| {
                        let (s, c) = (f64::from(k) / 24.0 * std::f64::consts::TAU).sin_cos();
                        frame.apply(&V3::new(r * c, if k < 24 { -*half } else { *half }, r * s))
                    })
                    .collect();
                vec![self.outline(&points, solid.radius, fill, edge, opacity, title)]
            }
            Core::Hull(hull) => {
                let points: Vec<V3> = hull.points().iter().map(|p| pose.apply(&V3::new(p.x, p.y, p.z))).collect();
                vec![self.outline(&points, solid.radius, fill, edge, opacity, title)]
            }
        }
    }

    /// The three faces of a box that look at the eye, shaded.
    #[expect(clippy::too_many_arguments, reason = "what a box looks like")]
    fn cuboid(
        &self,
        frame: &Pose,
        half: &V3,
        radius: f64,
        fill: &str,
        edge: &str,
        opacity: f64,
        title: &str,
    ) -> Vec<Drawn> {
        let look = self.camera.rows.row(2).transpose();
        let mut svg = format!("<g opacity=\"{opacity}\"><title>{title}</title>");
        for axis in 0..3 {
            let normal = frame.rotation.column(axis).clone_owned();
            let side = if normal.dot(&look) < 0.0 { 1.0 } else { -1.0 };
            let corners: Vec<V3> = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
                .iter()
                .map(|(u, v)| {
                    let mut c = V3::zeros();
                    c[axis] = side * half[axis];
                    c[(axis + 1) % 3] = u * half[(axis + 1) % 3];
                    c[(axis + 2) % 3] = v * half[(axis + 2) % 3];
                    frame.apply(&c)
                })
                .collect();
            let list: Vec<String> = corners
                .iter()
                .map(|c| {
                    let (x, y, _) = self.at(c);
                    format!("{x:.1},{y:.1}")
                })
                .collect();
            let list = list.join(" ");
            let light = (normal * side).z;
            let shade = if light > 0.5 { 0.0 } else { 0.06 + 0.06 * (normal * side).x.abs() };
            let wide = (2.0 * radius * self.scale).max(0.8);
            let _ = write!(
                svg,
                "<polygon points=\"{list}\" fill=\"{fill}\" stroke=\"{edge}\" stroke-width=\"{wide:.1}\" \
                 stroke-linejoin=\"round\"/><polygon points=\"{list}\" fill=\"#000\" opacity=\"{shade:.2}\"/>"
            );
        }
        svg += "</g>";
        vec![Drawn { depth: self.at(&frame.translation).2, svg }]
    }
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
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let mean = |sum: V3, n: usize| sum / n.max(1) as f64;
    if balls.is_empty() {
        mean(scene.marks.iter().map(|m| m.place).sum(), scene.marks.len())
    } else {
        mean(balls.iter().sum(), balls.len())
    }
}

/// The same, to be turned with mouse and keyboard where scripts run; paper has the picture as it was.
pub fn draw_turning(scene: &Scene<'_>, width: f64) -> crate::error::Result<String> {
    let base = scene.model.forward().model().cell.world_from_base.translation;
    let middle = middle(scene);
    let ahead = V3::new(middle.x - base.x, middle.y - base.y, 0.0).try_normalize(1e-6).unwrap_or_else(V3::x);
    let look = Camera::new(View::Oblique, ahead).rows.row(2).transpose();
    Ok(format!("{}{}{}</div>", turn::OPEN, draw(scene, View::Oblique, width), turn::script(scene, &look)?))
}

/// An SVG of the cell, `width` pixels wide at most.
pub fn draw(scene: &Scene<'_>, view: View, width: f64) -> String {
    let model = scene.model;
    let forward = model.forward();
    let cell = &forward.model().cell;
    let mut ws = forward.workspace();
    let links = forward.world_from_links(&State::at(&scene.shown), &mut ws);
    let skeletons = skeletons(scene);
    let base = links.first().map_or_else(V3::zeros, |b| b.translation);
    let middle = middle(scene);
    let ahead = V3::new(middle.x - base.x, middle.y - base.y, 0.0).try_normalize(1e-6).unwrap_or_else(V3::x);
    let camera = Camera::new(view, ahead);

    // the page shows what belongs to arm and balls; larger things are cut off at its edge
    let mut shown: Vec<V3> = vec![base];
    shown.extend(cell.balls.iter().copied());
    shown.extend(links.iter().map(|l| l.translation));
    shown.extend(skeletons.iter().flat_map(|s| s.1.iter().copied()));
    shown.extend(scene.marks.iter().map(|m| m.place));
    let pad = 0.16;
    let seen: Vec<V3> = shown.iter().map(|p| camera.see(p)).collect();
    let range = |k: usize| {
        let low = seen.iter().map(|s| s[k]).fold(f64::INFINITY, f64::min) - pad;
        (low, seen.iter().map(|s| s[k]).fold(f64::NEG_INFINITY, f64::max) + pad)
    };
    let ((left, right), (top, bottom)) = (range(0), range(1));
    let scale = width / (right - left);
    let height = (bottom - top) * scale;
    let page = Page { camera, scale, left, top };

    let mut drawn: Vec<Drawn> = Vec::new();
    let mut floor: Vec<Drawn> = Vec::new();
    for body in model.bodies() {
        let title = body.name.replace('&', "&amp;").replace('<', "&lt;");
        match (body.place, body.role) {
            (Place::World, Role::Ball(k)) => {
                for s in &body.solids {
                    let (x, y, depth) = page.at(&cell.balls.get(k).copied().unwrap_or(middle));
                    let r = (s.radius * scale).max(4.0);
                    let color = ball_color(k);
                    drawn.push(Drawn {
                        depth: depth - 0.02,
                        svg: format!(
                            "<g><title>{title}</title><circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"{color}\" \
                             stroke=\"#fff\" stroke-width=\"1\"/><circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{:.1}\" \
                             fill=\"#fff\" opacity=\"0.7\"/></g>",
                            x - r * 0.3,
                            y - r * 0.35,
                            r * 0.25
                        ),
                    });
                }
            }
            (Place::World, _) => {
                for s in &body.solids {
                    // what is as large as the room is drawn first and pale: it must hide nothing
                    let large = extent(s) > 0.6;
                    let (fill, opacity) = if large { ("#eceff3", 0.75) } else { ("#d5dbe3", 1.0) };
                    let list = page.solid(&Pose::identity(), s, fill, "#b4bfcc", opacity, &title);
                    if large { floor.extend(list) } else { drawn.extend(list) }
                }
            }
            (Place::Link(k), _) => {
                let pose = links.get(k).copied().unwrap_or_else(Pose::identity);
                let (fill, edge) = if body.device { ("#5d6b7c", "#39434f") } else { ("#f0a35e", "#b06c2c") };
                for s in &body.solids {
                    drawn.extend(page.solid(&pose, s, fill, edge, 1.0, &title));
                }
            }
        }
    }
    floor.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    drawn.sort_by(|a, b| b.depth.total_cmp(&a.depth));

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"100%\" style=\"max-width:{width:.0}px\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"system-ui, sans-serif\">\
         <rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"#fafbfc\"/>"
    );
    floor.iter().chain(&drawn).for_each(|d| svg += &d.svg);
    if let Some((centre, radius)) = scene.sphere {
        let (x, y, _) = page.at(&centre);
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"#2666a5\" fill-opacity=\"0.05\" stroke=\"#2666a5\" \
             stroke-opacity=\"0.6\" stroke-dasharray=\"5 4\"><title>where the arm is to be accurate</title></circle>",
            radius * scale
        );
    }
    // the poses over everything: they are what the picture is about
    for (k, (ball, points, approach)) in skeletons.iter().enumerate() {
        let color = ball_color(*ball);
        let tip = points.last().copied().unwrap_or_default();
        let arm = page.line(
            points,
            &format!("stroke=\"{color}\" stroke-width=\"1.3\" stroke-opacity=\"0.5\" stroke-linejoin=\"round\""),
        );
        let last =
            page.line(&[*approach, tip], &format!("stroke=\"{color}\" stroke-width=\"2.2\" stroke-opacity=\"0.9\""));
        let _ = write!(svg, "<g><title>touch {} of ball {}</title>{arm}", k + 1, ball + 1);
        for p in points.iter().skip(1).take(points.len().saturating_sub(2)) {
            let (x, y, _) = page.at(p);
            let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.7\" fill=\"{color}\" opacity=\"0.6\"/>");
        }
        let _ = write!(svg, "{last}</g>");
    }
    for m in scene.marks {
        let (x, y, _) = page.at(&m.place);
        let title = m.title.replace('&', "&amp;").replace('<', "&lt;");
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.6\" fill=\"{}\" fill-opacity=\"0.8\"><title>{title}</title></circle>",
            m.color
        );
    }
    for (k, ball) in cell.balls.iter().enumerate() {
        svg += &page.text(
            ball,
            9.0,
            -8.0,
            &format!("{}", k + 1),
            &format!(
                "font-size=\"15\" font-weight=\"700\" fill=\"{}\" stroke=\"#fff\" stroke-width=\"3\" paint-order=\"stroke\"",
                ball_color(k)
            ),
        );
    }
    // axes of {w}
    for (axis, name) in [V3::x(), V3::y(), V3::z()].into_iter().zip(["x", "y", "z"]) {
        let tip = axis * 0.1;
        let (x0, y0, _) = page.at(&V3::zeros());
        let (x1, y1, _) = page.at(&tip);
        if (x1 - x0).hypot(y1 - y0) < 6.0 {
            continue;
        }
        svg += &page.line(&[V3::zeros(), tip], "stroke=\"#1d2733\" stroke-width=\"1.6\"");
        svg += &page.text(&(axis * 0.118), -4.0, 4.0, name, "font-size=\"13\" font-style=\"italic\" fill=\"#1d2733\"");
    }
    // how long 200 mm are
    let (x, y, long) = (16.0, height - 16.0, 0.2 * scale);
    let _ = write!(
        svg,
        "<path d=\"M{x:.1} {:.1}v6h{long:.1}v-6\" fill=\"none\" stroke=\"#47566a\" stroke-width=\"1.4\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"13\" fill=\"#47566a\">200 mm</text></svg>",
        y - 6.0,
        x + long + 8.0,
        y + 2.0
    );
    svg
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
                let values = || p.iter().map(|p| f(&V3::new(p.x, p.y, p.z)));
                values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
            };
            wide(|p| p.x).max(wide(|p| p.y)).max(wide(|p| p.z))
        }
    }
}
