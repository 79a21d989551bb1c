//! The cell as data for the script of a report that turns it.

use nalgebra::Vector3;
use serde_json::{Value, json};
use trical_model::{Pose, State};
use trical_plan::geometry::{Place, Role};
use trical_plan::solid::{Core, Solid};

use crate::error::Result;
use crate::picture::{Scene, View, ball_color, draw, extent, oblique_look, skeletons};

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
