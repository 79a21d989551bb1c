//! The rail that carries the arm is not straight, or its carriage turns on the way: yaw, pitch and roll grow along it. A rail's wrong scale is
//! `gear_ratio` of joint 1.

use trical_model::{Axis, Basis, Parameter, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Part, Remedy, Size, deg};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::RailError,
    title: "rail that is not straight",
    family: Family::Geometry,
    scope: Scope::Arm,
    site: "joint",
    form: "a rail (joint 1, sliding) bends: a_1 and d_2 follow straight pieces over sixths of its length; or its carriage turns about x, y, z \
           in proportion to the way",
    needs: "an arm on a rail",
    typical: "0.1 to 1 mm, 0.01 to 0.1 deg",
    rivals: "gear_ratio of joint 1 (the rail's scale), frame_drift where the rail was gone along once",
    coefficients: &[("rail_bend", "bend", ""), ("rail_turn", "turn of the carriage from end to end", "about")],
    action: "Let the calibrated model correct it, or have the rail levelled and aligned.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

/// Straight pieces over the rail's length.
const PIECES: usize = 6;

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.model.robot.is_on_rail() {
        return Asked::default();
    }
    let [low, high] = r.model.robot.joints[0].limits;
    let length = high - low;
    if !length.is_finite() || length < 1e-3 {
        return Asked::lacking("limits of the rail in the robot file");
    }
    let along = |shape| Basis::new(Variable::Joint { joint: 1 }, shape);
    let link = |link, parameter| Site::Link { link, parameter };
    let at = |k: usize| low + length * k as f64 / PIECES as f64;
    let mut bends: Vec<Part> = Vec::new();
    for k in 1..PIECES {
        let knot = along(Shape::Tent { left: at(k - 1), centre: at(k), right: at(k + 1) });
        bends.push((format!("rail_bend_a_{k}"), link(1, Parameter::A), knot, 0));
        bends.push((format!("rail_bend_d_{k}"), link(2, Parameter::D), knot, 0));
    }
    // from 0 at the beginning to 1 at the end
    let slope = along(Shape::Tent { left: low, centre: high, right: high + 10.0 * length });
    let turn = |name: &str, site| (format!("rail_turn_{name}"), site, slope, 0);
    let turns = vec![
        turn("x", Site::Tilt { joint: 1, axis: Axis::X }),
        turn("y", Site::Tilt { joint: 1, axis: Axis::Y }),
        turn("z", link(1, Parameter::Theta)),
    ];
    let bend = Size { typical: 0.2e-3, large: 1e-3 };
    let twist = Size { typical: deg(0.02), large: deg(0.1) };
    vec![
        EFFECT.candidate(Place::Joint(1), "the rail bends across its length".into(), bend, bends),
        EFFECT.candidate(Place::Joint(1), "the carriage turns on its way along the rail".into(), twist, turns),
    ]
    .into()
}
