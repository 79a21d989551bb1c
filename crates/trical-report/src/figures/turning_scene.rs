//! The cell as data for the script of a report that turns it.

use nalgebra::Vector3;
use serde_json::{Value, json};
use trical_model::{Pose, State};
use trical_plan::geometry::{Place, Role};
use trical_plan::solid::{Core, Solid};

use crate::error::Result;
use crate::figures::picture::{Scene, View, ball_color, draw, extent, oblique_look, skeletons};

type V3 = Vector3<f64>;

/// A picture of the cell, to be turned with mouse and keyboard where scripts run; paper has the picture as it was.
pub fn draw_turning(scene: &Scene<'_>, width: f64) -> Result<String> {
    let picture = draw(scene, View::Oblique, width);
    Ok(format!("{OPEN}{picture}{}</div>", script(scene, &oblique_look(scene))?))
}

/// What a picture that can be turned begins with.
pub const OPEN: &str = "<div class=\"turn\">";

/// Tenths of a millimetre are enough for a picture.
fn point(p: &V3) -> Value {
    json!([p.x, p.y, p.z].map(|x| (x * 1e4).round() / 1e4))
}

fn points<'a>(all: impl IntoIterator<Item = &'a V3>) -> Value {
    all.into_iter().map(point).collect()
}

/// A body as what can be drawn at once: the points whose outline is filled, each grown by a radius.
fn body(pose: &Pose, solid: &Solid, fill: &str, edge: &str, pale: bool) -> Value {
    let corners: Vec<V3> = match &solid.core {
        Core::Segment(a, b) => vec![pose.apply(a), pose.apply(b)],
        Core::Box(frame, half) => {
            let frame = pose.compose(frame);
            let sign = |k: usize, bit: usize| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
            (0..8).map(|k| frame.apply(&V3::new(sign(k, 0), sign(k, 1), sign(k, 2)).component_mul(half))).collect()
        }
        Core::Cylinder(frame, half, r) => {
            let frame = pose.compose(frame);
            let at = |k: u8| {
                let (s, c) = (f64::from(k) / 12.0 * std::f64::consts::TAU).sin_cos();
                frame.apply(&V3::new(r * c, if k < 12 { -*half } else { *half }, r * s))
            };
            (0..24).map(at).collect()
        }
        Core::Hull(hull) => hull.points().iter().map(|p| pose.apply(&V3::new(p.x, p.y, p.z))).collect(),
    };
    json!({ "p": points(&corners), "r": solid.radius, "fill": fill, "edge": edge, "pale": pale })
}

/// The data of a scene, in {w} and m, looked at along `look`.
pub fn script(scene: &Scene<'_>, look: &V3) -> Result<String> {
    let forward = scene.model.forward();
    let cell = &forward.model().cell;
    let mut ws = forward.workspace();
    let links = forward.world_from_links(&State::at(&scene.shown), &mut ws);
    let mut bodies = Vec::new();
    for b in scene.model.bodies() {
        for s in &b.solids {
            bodies.push(match (b.place, b.role) {
                (Place::World, Role::Ball(_)) => continue,
                (Place::World, _) if extent(s) > 0.6 => body(&Pose::identity(), s, "#eceff3", "#b4bfcc", true),
                (Place::World, _) => body(&Pose::identity(), s, "#d5dbe3", "#b4bfcc", false),
                (Place::Link(k), _) => {
                    let pose = links.get(k).copied().unwrap_or_else(Pose::identity);
                    let (fill, edge) = if b.device { ("#5d6b7c", "#39434f") } else { ("#f0a35e", "#b06c2c") };
                    body(&pose, s, fill, edge, false)
                }
            });
        }
    }
    let radius = |k: usize| {
        let ball = scene.model.bodies().iter().find(|b| b.role == Role::Ball(k));
        ball.and_then(|b| b.solids.first()).map_or(0.01, |s| s.radius)
    };
    let balls: Vec<Value> = cell
        .balls
        .iter()
        .enumerate()
        .map(|(k, b)| json!({ "p": point(b), "r": radius(k), "fill": ball_color(k) }))
        .collect();
    let arms: Vec<Value> = skeletons(scene)
        .iter()
        .map(|(ball, arm, from)| json!({ "p": points(arm), "from": point(from), "ink": ball_color(*ball) }))
        .collect();
    let marks: Vec<Value> = scene.marks.iter().map(|m| json!({ "p": point(&m.place), "fill": m.color })).collect();
    let data = json!({
        "look": [look.x, look.y, look.z],
        "bodies": bodies,
        "balls": balls,
        "arms": arms,
        "marks": marks,
        "sphere": scene.sphere.map(|(c, r)| json!({ "p": point(&c), "r": r })),
    });
    // nothing in it may end the script
    let data = serde_json::to_string(&data)?.replace('<', "\\u003c");
    Ok(format!("<script type=\"application/json\">{data}</script>"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_plan::CollisionModel;

    fn corners(v: &Value) -> Vec<V3> {
        let list = v["p"].as_array().unwrap();
        list.iter().map(|p| V3::from_iterator(p.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()))).collect()
    }

    #[test]
    fn a_box_has_its_eight_corners_and_a_cylinder_stands_along_its_own_y() {
        let pose = Pose {
            rotation: trical_model::pose::rotation_x(std::f64::consts::FRAC_PI_2),
            translation: V3::new(1.0, 2.0, 3.0),
        };
        let of = |core| {
            let mut solid = Solid::sphere(V3::zeros(), 0.0);
            solid.core = core;
            solid
        };
        let found = corners(&body(&pose, &of(Core::Box(Pose::identity(), V3::new(0.1, 0.2, 0.3))), "", "", false));
        assert_eq!(found.len(), 8);
        for (x, y, z) in [(0.9, 1.7, 2.8), (1.1, 2.3, 3.2), (0.9, 2.3, 2.8), (1.1, 1.7, 3.2)] {
            // turned by a quarter about x: y goes to z, z to -y
            assert_eq!(found.iter().filter(|p| (*p - V3::new(x, y, z)).norm() < 1e-9).count(), 1, "{x} {y} {z}");
        }
        let round = corners(&body(&pose, &of(Core::Cylinder(Pose::identity(), 0.4, 0.1)), "", "", false));
        assert!(round.iter().all(|p| ((p.z - 3.0).abs() - 0.4).abs() < 1e-9), "its ends");
        assert!(round.iter().all(|p| ((p.x - 1.0).hypot(p.y - 2.0) - 0.1).abs() < 2e-4), "its radius");
    }

    #[test]
    fn the_script_has_the_cells_balls_and_bodies_in_the_world_and_cannot_be_ended_by_a_name() {
        let model = crate::test_data::arm();
        let solids = CollisionModel::new(&model.robot, &model.cell).unwrap();
        let marks = [crate::figures::picture::Mark {
            place: V3::new(0.1, 0.2, 0.3),
            color: "</script>".into(),
            title: String::new(),
        }];
        let scene =
            Scene { model: &solids, touches: &[], marks: &marks, shown: crate::test_data::pose(3).q, sphere: None };
        let text = script(&scene, &V3::x()).unwrap();
        assert_eq!(text.matches("</script>").count(), 1);
        let data = text.split_once('>').and_then(|t| t.1.strip_suffix("</script>")).unwrap();
        let data: Value = serde_json::from_str(data).unwrap();
        for (k, ball) in model.cell.balls.iter().enumerate() {
            let found = &data["balls"][k];
            assert!(
                (V3::from_iterator(found["p"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap())) - ball).norm()
                    < 1e-4
            );
            assert_eq!((found["r"].as_f64(), found["fill"].as_str()), (Some(0.00635), Some(ball_color(k))));
        }
        // balls are not bodies too; every other solid is
        let others =
            solids.bodies().iter().filter(|b| !matches!(b.role, Role::Ball(_))).map(|b| b.solids.len()).sum::<usize>();
        assert_eq!(data["bodies"].as_array().unwrap().len(), others);
    }
}
