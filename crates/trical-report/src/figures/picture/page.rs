//! The page of a picture: where a point of the cell is seen on it, and how solids look there.

use std::fmt::Write;

use nalgebra::Matrix3;
use trical_model::Pose;
use trical_plan::solid::{Core, Solid};

use super::V3;
use crate::figures::outline::hull;
use crate::figures::plots::span;

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
pub(super) struct Camera {
    pub(super) rows: Matrix3<f64>,
}

impl Camera {
    /// `ahead`: from the base to the balls, level.
    pub(super) fn new(view: View, ahead: V3) -> Self {
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

    pub(super) fn see(&self, p: &V3) -> V3 {
        self.rows * p
    }
}

/// Something to draw, and how far away it is.
pub(super) struct Drawn {
    pub(super) depth: f64,
    pub(super) svg: String,
}

/// A page, and how {w} lies on it.
pub(super) struct Page {
    pub(super) camera: Camera,
    /// Pixels per metre.
    pub(super) scale: f64,
    pub(super) left: f64,
    pub(super) top: f64,
}

/// Least length of the axes that are drawn, and of the bar that shows the scale, pixels.
const AXIS: f64 = 30.0;
const BAR: f64 = 60.0;

/// What the bar may be long, mm.
const BARS: [f64; 5] = [200.0, 500.0, 1000.0, 2000.0, 5000.0];

/// How a body looks.
#[derive(Clone, Copy)]
pub(super) struct Paint<'a> {
    pub(super) fill: &'static str,
    pub(super) edge: &'static str,
    pub(super) opacity: f64,
    /// What shows under the pointer.
    pub(super) title: &'a str,
}

impl Paint<'_> {
    /// The beginning of a body's group.
    fn group(&self) -> String {
        format!("<g opacity=\"{}\"><title>{}</title>", self.opacity, self.title)
    }
}

/// Text as it stands in SVG.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

fn list(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    points.into_iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

impl Page {
    /// A page `width` pixels wide on which the points are with a margin, and its height.
    pub(super) fn around(points: &[V3], camera: Camera, width: f64) -> (Self, f64) {
        let seen: Vec<V3> = points.iter().map(|p| camera.see(p)).collect();
        let range = |k: usize| span(seen.iter().map(|s| s[k]));
        let ((left, right), (top, bottom)) = (range(0), range(1));
        // of an arm on a long rail the base is drawn whole, too
        let margin = ((right - left) * 0.09).max(0.16);
        let (left, right, top, bottom) = (left - margin, right + margin, top - margin, bottom + margin);
        let scale = width / (right - left);
        (Self { camera, scale, left, top }, (bottom - top) * scale)
    }

    pub(super) fn at(&self, p: &V3) -> (f64, f64, f64) {
        let s = self.camera.see(p);
        ((s.x - self.left) * self.scale, (s.y - self.top) * self.scale, s.z)
    }

    fn list(&self, points: &[V3]) -> String {
        list(points.iter().map(|p| self.at(p)).map(|(x, y, _)| (x, y)))
    }

    pub(super) fn line(&self, points: &[V3], style: &str) -> String {
        format!("<polyline points=\"{}\" fill=\"none\" {style}/>", self.list(points))
    }

    pub(super) fn text(&self, p: &V3, dx: f64, dy: f64, text: &str, style: &str) -> String {
        let (x, y, _) = self.at(p);
        format!("<text x=\"{:.1}\" y=\"{:.1}\" {style}>{}</text>", x + dx, y + dy, escaped(text))
    }

    /// The axes of {w}, but those that point at the eye.
    pub(super) fn axes(&self) -> String {
        let mut svg = String::new();
        let long = (AXIS / self.scale).max(0.1);
        for (axis, name) in [V3::x(), V3::y(), V3::z()].into_iter().zip(["x", "y", "z"]) {
            let tip = axis * long;
            let ((x0, y0, _), (x1, y1, _)) = (self.at(&V3::zeros()), self.at(&tip));
            if (x1 - x0).hypot(y1 - y0) < 6.0 {
                continue;
            }
            svg += &self.line(&[V3::zeros(), tip], "stroke=\"#1d2733\" stroke-width=\"1.6\"");
            let style = "font-size=\"13\" font-style=\"italic\" fill=\"#1d2733\"";
            svg += &self.text(&(axis * 1.18 * long), -4.0, 4.0, name, style);
        }
        svg
    }

    /// How long 200 mm are, or in a picture of something large a round number of millimetres.
    pub(super) fn scale_bar(&self, height: f64) -> String {
        let mm = BARS.into_iter().find(|mm| mm * 1e-3 * self.scale > BAR).unwrap_or(BARS[BARS.len() - 1]);
        let (x, y, long) = (16.0, height - 16.0, mm * 1e-3 * self.scale);
        format!(
            "<path d=\"M{x:.1} {:.1}v6h{long:.1}v-6\" fill=\"none\" stroke=\"#47566a\" stroke-width=\"1.4\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"13\" fill=\"#47566a\">{mm} mm</text>",
            y - 6.0,
            x + long + 8.0,
            y + 2.0
        )
    }

    /// A ball with a gleam, a little nearer than it is: before its post.
    pub(super) fn ball(&self, centre: &V3, radius: f64, color: &str, title: &str) -> Drawn {
        let (x, y, depth) = self.at(centre);
        let r = (radius * self.scale).max(4.0);
        let svg = format!(
            "<g><title>{title}</title><circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"{color}\" \
             stroke=\"#fff\" stroke-width=\"1\"/><circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{:.1}\" \
             fill=\"#fff\" opacity=\"0.7\"/></g>",
            x - r * 0.3,
            y - r * 0.35,
            r * 0.25
        );
        Drawn { depth: depth - 0.02, svg }
    }

    /// The outline of points that is filled, with an edge as thick as the solid is rounded.
    fn outline(&self, points: &[V3], radius: f64, paint: Paint<'_>) -> Drawn {
        let Paint { fill, edge, .. } = paint;
        let seen: Vec<(f64, f64, f64)> = points.iter().map(|p| self.at(p)).collect();
        let depth = seen.iter().map(|s| s.2).sum::<f64>() / seen.len().max(1) as f64;
        let list = list(hull(&seen.iter().map(|s| (s.0, s.1)).collect::<Vec<_>>()));
        let wide = 2.0 * radius * self.scale;
        let mut svg = paint.group();
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

    pub(super) fn solid(&self, pose: &Pose, solid: &Solid, paint: Paint<'_>) -> Vec<Drawn> {
        match &solid.core {
            Core::Segment(a, b) => self.capsule(&pose.apply(a), &pose.apply(b), solid.radius, paint),
            Core::Box(frame, half) => vec![self.cuboid(&pose.compose(frame), half, solid.radius, paint)],
            Core::Cylinder(frame, half, r) => {
                let frame = pose.compose(frame);
                let points: Vec<V3> = (0..48)
                    .map(|k| {
                        let (s, c) = (f64::from(k) / 24.0 * std::f64::consts::TAU).sin_cos();
                        frame.apply(&V3::new(r * c, if k < 24 { -*half } else { *half }, r * s))
                    })
                    .collect();
                vec![self.outline(&points, solid.radius, paint)]
            }
            Core::Hull(hull) => {
                let points: Vec<V3> = hull.points().iter().map(|p| pose.apply(&V3::new(p.x, p.y, p.z))).collect();
                vec![self.outline(&points, solid.radius, paint)]
            }
        }
    }

    /// A thick segment in pieces, so that long ones are sorted rightly; opacity of overlapping pieces would show.
    fn capsule(&self, a: &V3, b: &V3, radius: f64, paint: Paint<'_>) -> Vec<Drawn> {
        let pieces: u8 = if paint.opacity < 1.0 { 1 } else { 6 };
        let wide = 2.0 * radius * self.scale;
        let stroke = |from: V3, to: V3, style: &str, wide: f64| {
            self.line(&[from, to], &format!("{style} stroke-width=\"{wide:.1}\" stroke-linecap=\"round\""))
        };
        // the edge lies behind all pieces of the body
        let edge = stroke(*a, *b, &format!("stroke=\"{}\"", paint.edge), wide + 1.6);
        let mut drawn = vec![Drawn {
            depth: self.at(a).2.max(self.at(b).2),
            svg: format!("<g opacity=\"{}\">{edge}</g>", paint.opacity),
        }];
        let part = |k: u8| a + (b - a) * (f64::from(k) / f64::from(pieces));
        // light from above: a paler stroke, off the middle
        let lift = V3::z() * radius * 0.35;
        for k in 0..pieces {
            let (from, to) = (part(k), part(k + 1));
            let svg = paint.group()
                + &stroke(from, to, &format!("stroke=\"{}\"", paint.fill), wide)
                + &stroke(from + lift, to + lift, "stroke=\"#fff\" stroke-opacity=\"0.16\"", wide * 0.45)
                + "</g>";
            drawn.push(Drawn { depth: self.at(&((from + to) * 0.5)).2, svg });
        }
        drawn
    }

    /// The three faces of a box that look at the eye, shaded.
    fn cuboid(&self, frame: &Pose, half: &V3, radius: f64, paint: Paint<'_>) -> Drawn {
        let Paint { fill, edge, .. } = paint;
        let look = self.camera.rows.row(2).transpose();
        let wide = (2.0 * radius * self.scale).max(0.8);
        let mut svg = paint.group();
        for axis in 0..3 {
            let normal = frame.rotation.column(axis).clone_owned();
            let side = if normal.dot(&look) < 0.0 { 1.0 } else { -1.0 };
            let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(u, v)| {
                let mut c = V3::zeros();
                c[axis] = side * half[axis];
                c[(axis + 1) % 3] = u * half[(axis + 1) % 3];
                c[(axis + 2) % 3] = v * half[(axis + 2) % 3];
                frame.apply(&c)
            });
            let list = self.list(&corners);
            let light = (normal * side).z;
            let shade = if light > 0.5 { 0.0 } else { 0.06 + 0.06 * (normal * side).x.abs() };
            let _ = write!(
                svg,
                "<polygon points=\"{list}\" fill=\"{fill}\" stroke=\"{edge}\" stroke-width=\"{wide:.1}\" \
                 stroke-linejoin=\"round\"/><polygon points=\"{list}\" fill=\"#000\" opacity=\"{shade:.2}\"/>"
            );
        }
        svg += "</g>";
        Drawn { depth: self.at(&frame.translation).2, svg }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEWS: [View; 3] = [View::Oblique, View::Above, View::Side];

    fn near(a: V3, b: V3) -> bool {
        (a - b).norm() < 1e-12
    }

    #[test]
    fn no_view_is_a_mirror_image_and_what_is_high_or_in_front_is_where_one_expects_it() {
        let ahead = V3::new(0.6, 0.8, 0.0);
        for view in VIEWS {
            let rows = Camera::new(view, ahead).rows;
            assert!((rows * rows.transpose() - Matrix3::identity()).amax() < 1e-12);
            assert!((rows.determinant() - 1.0).abs() < 1e-12, "x right, y down, depth away: right-handed");
        }
        let see = |view, p: V3| Camera::new(view, ahead).see(&p);
        // from above: ahead is up on the page, its left is left, and what is high is near
        assert!(near(see(View::Above, ahead), V3::new(0.0, -1.0, 0.0)));
        assert!(near(see(View::Above, V3::new(-0.8, 0.6, 0.0)), V3::new(-1.0, 0.0, 0.0)));
        assert!(near(see(View::Above, V3::z()), V3::new(0.0, 0.0, -1.0)));
        // from the side: ahead is right, up is up
        assert!(near(see(View::Side, ahead), V3::x()) && near(see(View::Side, V3::z()), -V3::y()));
        // obliquely: up is up, what is high is nearer, and the eye is in front of the arm
        let (up, front) = (see(View::Oblique, V3::z()), see(View::Oblique, ahead));
        assert!(up.x.abs() < 1e-12 && up.y < -0.8 && up.z < -0.4 && front.z < -0.4, "{up} {front}");
    }

    fn page() -> Page {
        Page { camera: Camera::new(View::Oblique, V3::x()), scale: 1000.0, left: -0.5, top: -0.4 }
    }

    fn paint(fill: &'static str, edge: &'static str) -> Paint<'static> {
        Paint { fill, edge, opacity: 1.0, title: "body" }
    }

    #[test]
    fn the_corner_of_the_page_is_where_it_begins() {
        let page = page();
        let corner = page.camera.rows.transpose() * V3::new(-0.5, -0.4, 3.0);
        let (x, y, depth) = page.at(&corner);
        assert!(x.abs() < 1e-9 && y.abs() < 1e-9 && (depth - 3.0).abs() < 1e-12);
        let (x, y, _) = page.at(&(page.camera.rows.transpose() * V3::new(-0.3, -0.1, 0.0)));
        assert!((x - 200.0).abs() < 1e-9 && (y - 300.0).abs() < 1e-9);
    }

    /// Three faces of a box are seen: those that have the corner which is nearest to the eye, however the box is turned.
    #[test]
    fn the_faces_of_a_box_that_are_drawn_are_those_towards_the_eye() {
        let page = page();
        for k in 0..12_u8 {
            let angle = f64::from(k) * 0.55;
            let rotation = trical_model::pose::rotation_z(angle) * trical_model::pose::rotation_x(1.7 * angle);
            let frame = Pose { rotation, translation: V3::new(0.1, -0.2, 0.3) };
            let half = V3::new(0.1, 0.2, 0.3);
            let svg = page.cuboid(&frame, &half, 0.0, paint("#fff", "#000")).svg;
            let corner = |n: usize| {
                let sign = |bit: usize| if n >> bit & 1 == 0 { -1.0 } else { 1.0 };
                page.at(&frame.apply(&V3::new(sign(0), sign(1), sign(2)).component_mul(&half)))
            };
            let mut corners: Vec<(f64, f64, f64)> = (0..8).map(corner).collect();
            corners.sort_by(|a, b| a.2.total_cmp(&b.2));
            let drawn = |c: &(f64, f64, f64)| svg.matches(&format!("{:.1},{:.1}", c.0, c.1)).count();
            // each face is drawn twice: filled, and shaded
            assert_eq!((drawn(&corners[0]), drawn(&corners[7])), (6, 0), "{k}: {svg}");
        }
    }

    #[test]
    fn a_thick_segment_is_a_stroke_as_wide_as_it_is_thick_from_end_to_end() {
        let (page, from, to) = (page(), V3::new(0.1, 0.0, 0.2), V3::new(0.4, 0.3, 0.1));
        let pose = Pose { translation: V3::new(0.0, 0.1, 0.0), ..Pose::identity() };
        let drawn = page.solid(&pose, &Solid::capsule(from, to, 0.05), paint("#abc", "#def"));
        let ends = [from, to].map(|p| page.at(&pose.apply(&p)));
        let all: String = drawn.iter().map(|d| d.svg.as_str()).collect();
        assert!(
            all.contains("stroke=\"#abc\" stroke-width=\"100.0\"") && all.contains("stroke-width=\"101.6\""),
            "{all}"
        );
        for (x, y, _) in ends {
            assert!(all.contains(&format!("{x:.1},{y:.1}")), "{all}");
        }
        let depths = drawn.iter().map(|d| d.depth);
        assert!(
            depths.clone().fold(f64::MIN, f64::max) <= ends[0].2.max(ends[1].2)
                && depths.fold(f64::MAX, f64::min) >= ends[0].2.min(ends[1].2)
        );
    }
}
