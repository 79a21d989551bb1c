//! Terms that an arm or its instrument may need, of which the measurements decide: what gravity does to an arm whose masses nobody knows, errors of a
//! rail over its length, and where measured lengths begin.

use trical_model::{
    Axis, Basis, Forward, JointKind, Measured, Model, Parameter, Shape, Site, State, Term, Variable, trig,
};

use crate::dataset::Dataset;

/// An axis is horizontal, and two are parallel, within this, rad.
const LEVEL: f64 = 0.05;

/// Poses at which it is looked whether axes stay horizontal.
const LOOKS: u32 = 20;

/// What gravity does to an arm of unknown masses: consecutive joints with parallel axes that stay horizontal turn, each in proportion to its
/// torque, by sums of sines and cosines of how far the links from there to the last of them are inclined.
pub(crate) fn sag(model: &Model) -> Vec<Term> {
    let plain = Model { terms: Vec::new(), ..model.clone() };
    let Ok(forward) = Forward::new(plain, Vec::new()) else { return Vec::new() };
    let mut ws = forward.workspace();
    let joints = &model.robot.joints;
    let mut horizontal = vec![true; joints.len()];
    for k in 0..LOOKS {
        let q: Vec<f64> =
            (0..joints.len() as u32).map(|j| 3.0 * trig::sin(1.7 * f64::from(k) + 2.9 * f64::from(j))).collect();
        for (level, pose) in horizontal.iter_mut().zip(forward.world_from_joints(&State::at(&q), &mut ws)) {
            *level &= pose.rotation[(2, 2)].abs() < LEVEL;
        }
    }
    let turns = |k: usize| horizontal[k] && joints[k].kind == JointKind::Revolute;
    let goes_on = |k: usize| turns(k) && trig::sin(joints[k].alpha).abs() < LEVEL && trig::cos(joints[k].alpha) > 0.0;
    let mut terms = Vec::new();
    let mut first = 0;
    while first < joints.len() {
        let end = (first + 1..joints.len()).find(|k| !goes_on(*k)).unwrap_or(joints.len());
        for joint in (first..end).filter(|_| turns(first)) {
            for last in joint..end {
                for (name, shape) in [("sin", Shape::Sine { cycles: 1.0 }), ("cos", Shape::Cosine { cycles: 1.0 })] {
                    let of = Variable::Inclination { first: first + 1, last: last + 1 };
                    let name = format!("sag_{}_{name}_{}", joint + 1, last + 1);
                    terms.push(Term::new(name, "compliance", Site::Joint { joint: joint + 1 }, Basis::new(of, shape)));
                }
            }
        }
        first = end;
    }
    terms
}

/// Errors of the rail that carries an arm, as far as it was used, in three groups: its scale; how far the carriage turns from one end to the other
/// (about the two axes across the rail, and about the rail); how far the rail is bent, from its beginning to its end.
pub(crate) fn rail(model: &Model, data: &Dataset) -> Vec<Vec<Term>> {
    if !model.robot.is_on_rail() {
        return Vec::new();
    }
    let places = data.observations.iter().map(|o| o.state.q[0]);
    let [low, high] = places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| [low.min(q), high.max(q)]);
    let length = high - low;
    if length.is_nan() || length < 1e-3 {
        return Vec::new();
    }
    let along = |shape| Basis::new(Variable::Joint { joint: 1 }, shape);
    let slope = along(Shape::Tent { left: low, centre: high, right: high + 10.0 * length });
    let bow = along(Shape::Growth { from: low, to: high });
    let term = |name: &str, site, basis| Term::new(format!("rail_{name}"), "geometry", site, basis);
    let link = |link, parameter| Site::Link { link, parameter };
    vec![
        vec![term("scale", Site::Joint { joint: 1 }, along(Shape::Linear))],
        vec![
            term("turn_x", Site::Tilt { joint: 1, axis: Axis::X }, slope),
            term("turn_y", Site::Tilt { joint: 1, axis: Axis::Y }, slope),
            term("turn_z", link(1, Parameter::Theta), slope),
        ],
        vec![term("bow_a", link(1, Parameter::A), bow), term("bow_d", link(2, Parameter::D), bow)],
    ]
}

/// Zeros of the lengths that were measured, as of wire encoders that count from anywhere.
pub(crate) fn length_zeros(model: &Model, data: &Dataset) -> Vec<Term> {
    let seen = |anchor: &usize| data.has(|m| matches!(m, Measured::Distance { anchor: a, .. } if a + 1 == *anchor));
    let zero =
        |anchor| Term::new(format!("zero_{anchor}"), "length_zero", Site::LengthZero { anchor }, Basis::CONSTANT);
    (1..=model.cell.anchors.len()).filter(seen).map(zero).collect()
}
