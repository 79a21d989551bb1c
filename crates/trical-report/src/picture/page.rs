//! The page of a picture: where a point of the cell is seen on it, and how solids look there.

use std::fmt::Write;

use nalgebra::Matrix3;
use trical_model::Pose;
use trical_plan::solid::{Core, Solid};

use super::V3;
use crate::outline::hull;

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

impl Page {
    pub(super) fn at(&self, p: &V3) -> (f64, f64, f64) {
        let s = self.camera.see(p);
        ((s.x - self.left) * self.scale, (s.y - self.top) * self.scale, s.z)
    }

    pub(super) fn line(&self, points: &[V3], style: &str) -> String {
        let list: Vec<String> = points
            .iter()
            .map(|p| {
                let (x, y, _) = self.at(p);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        format!("<polyline points=\"{}\" fill=\"none\" {style}/>", list.join(" "))
    }

    pub(super) fn text(&self, p: &V3, dx: f64, dy: f64, text: &str, style: &str) -> String {
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

    pub(super) fn solid(
        &self,
        pose: &Pose,
        solid: &Solid,
        fill: &str,
        edge: &str,
        opacity: f64,
        title: &str,
    ) -> Vec<Drawn> {
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
            let svg =
                page.cuboid(&frame, &half, 0.0, "#fff", "#000", 1.0, "box").pop().map(|d| d.svg).unwrap_or_default();
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
        let drawn = page.solid(&pose, &Solid::capsule(from, to, 0.05), "#abc", "#def", 1.0, "link");
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
