//! Directions in which the measurements say little: how far an arm's parameters can plausibly be from nominal, and what a fit makes of that
//! where the measurements alone would let them wander.

use std::cell::LazyCell;

use trical_model::{Forward, Model, Parameter, Scope, Site, Term, Variable};

use crate::dataset::Dataset;
use crate::fit::priors::PriorKnowledge;

/// How far lengths and angles of an arm are from nominal, roughly: m and rad (0.2 deg). Makers of industrial arms state 0.5 to 1 mm.
const LENGTH: f64 = 2e-3;
const ANGLE: f64 = 3.5e-3;

/// No joint gives way more than this, rad/Nm (0.1 deg/Nm), however little load it had: the upright axis of joint 1 has none but by a tilt of the base.
pub const SOFTEST: f64 = 2e-3;

/// The scale of a rail, roughly: 0.5 mm a metre.
const SCALE: f64 = 5e-4;

/// How far a joint gives way under the largest load of a recording, roughly, rad (0.3 deg) or m.
const GIVES_WAY: f64 = 5e-3;

/// A parameter was told by its prior rather than by the measurements where these leave so much of the prior's standard deviation.
const BY_PRIOR: f64 = 0.5;

/// For each of the model's terms: the standard deviation that it plausibly has about nominal, SI; `None` for what belongs to a session,
/// of which nothing is known beforehand.
pub(crate) fn plausible(model: &Model, data: &Dataset) -> Vec<Option<f64>> {
    let loads = LazyCell::new(|| largest_loads(model, data));
    let of = |t: &Term| match (t.site, t.basis.of) {
        _ if t.scope() != Scope::Arm => None,
        (Site::Link { parameter, .. }, _) if t.basis.is_constant() => match parameter {
            Parameter::A | Parameter::D => Some(LENGTH),
            Parameter::Alpha | Parameter::Beta | Parameter::Theta => Some(ANGLE),
        },
        (Site::Joint { .. }, Variable::Moment { joint, .. } | Variable::Torque { joint }) => {
            loads.get(joint - 1).filter(|load| **load > 0.0).map(|load| GIVES_WAY / load)
        }
        (Site::Joint { .. }, Variable::Inclination { .. }) => Some(GIVES_WAY),
        // errors of a rail over its length, with it
        (Site::Joint { .. }, Variable::Joint { .. }) => Some(SCALE),
        (Site::Link { parameter: Parameter::A | Parameter::D, .. }, Variable::Joint { .. }) => Some(LENGTH),
        (Site::Link { .. } | Site::Tilt { .. }, Variable::Joint { .. }) => Some(ANGLE),
        _ => None,
    };
    model.terms.iter().map(of).collect()
}

/// The largest torque of each joint over the data, N m: measured, or else of gravity on the nominal arm.
fn largest_loads(model: &Model, data: &Dataset) -> Vec<f64> {
    let mut most = vec![0.0_f64; model.robot.dof()];
    let plain = Model { terms: Vec::new(), ..model.clone() };
    let forward = Forward::new(plain, Vec::new()).ok();
    let mut ws = forward.as_ref().map(Forward::workspace);
    for o in &data.observations {
        let by_gravity = || forward.as_ref()?.gravity_torques(&o.state, ws.as_mut()?).ok();
        let Some(torques) = o.state.torques.or_else(by_gravity) else { continue };
        most.iter_mut().zip(torques).for_each(|(m, t)| *m = m.max(t.abs()));
    }
    most
}

/// Names of the terms whose standard deviation is more than `share` of what is plausible.
fn beyond(model: &Model, plausible: &[Option<f64>], share: f64) -> Vec<usize> {
    let sd = |t: &Term, limit: f64| t.sd.is_some_and(|sd| sd > share * limit);
    let weak = |(k, (t, limit)): (usize, (&Term, &Option<f64>))| limit.filter(|l| sd(t, *l)).map(|_| k);
    model.terms.iter().zip(plausible).enumerate().filter_map(weak).collect()
}

/// The same for a prior: no joint gives way more than the softest.
pub(crate) fn no_softer(model: &Model, plausible: &[Option<f64>]) -> Vec<Option<f64>> {
    let of = |(t, sd): (&Term, &Option<f64>)| match t.gives_way() {
        // a joint that never bears a load, too: nothing measures its compliance
        Some(_) => Some(sd.map_or(SOFTEST, |sd| sd.min(SOFTEST))),
        None => *sd,
    };
    model.terms.iter().zip(plausible).map(of).collect()
}

/// Whether the measurements leave a parameter of the arm more uncertain than it was before them.
pub(crate) fn wanders(model: &Model, plausible: &[Option<f64>]) -> bool {
    !beyond(model, plausible, 1.0).is_empty()
}

/// The terms that a fit with [`with_priors`] took from their priors rather than from the measurements.
pub(crate) fn by_prior(model: &Model, plausible: &[Option<f64>], known: &[PriorKnowledge]) -> Vec<usize> {
    let own = |k: &usize| known.get(*k).is_none_or(|known| known.prior.is_none());
    beyond(model, plausible, BY_PRIOR).into_iter().filter(own).collect()
}

/// What is known, and of all else that is the arm's that it is plausibly near nominal.
pub(crate) fn with_priors(plausible: &[Option<f64>], known: &[PriorKnowledge]) -> Vec<PriorKnowledge> {
    let of = |(k, sd): (usize, &Option<f64>)| {
        let said = known.get(k).copied().unwrap_or(PriorKnowledge::NOTHING);
        let prior = said.prior.or_else(|| sd.and_then(|sd| PriorKnowledge::about_zero(sd).prior));
        PriorKnowledge { prior, ..said }
    };
    plausible.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Cell, Robot, Shape};

    use super::*;

    #[test]
    fn a_joint_without_load_or_with_little_is_no_softer_than_the_softest() {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let soft = |joint| Term::new("c", "compliance", Site::Joint { joint }, Basis::torque(joint, Shape::Linear));
        let length = Term::new("a_2", "geometry", Site::Link { link: 2, parameter: Parameter::A }, Basis::CONSTANT);
        let measured = Term { basis: Basis::measured_torque(5), ..soft(5) };
        let terms = vec![soft(1), soft(6), soft(2), length, measured];
        let model = Model { terms, ..Model::nominal(robot, Cell::bare()) };
        let found = no_softer(&model, &[None, Some(0.1), Some(1e-4), Some(LENGTH), Some(0.1)]);
        assert_eq!(found, [Some(SOFTEST), Some(SOFTEST), Some(1e-4), Some(LENGTH), Some(SOFTEST)]);
    }

    #[test]
    fn of_what_belongs_to_a_session_nothing_is_known_beforehand() {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let along = Basis::new(Variable::Joint { joint: 1 }, Shape::Linear);
        let of = |session: Option<u32>| Term::new("t", "effect", Site::Joint { joint: 1 }, Basis { session, ..along });
        let model = Model { terms: vec![of(None), of(Some(1))], ..Model::nominal(robot, Cell::bare()) };
        let touch = trical_model::Measured::Touch { ball: 0, reading: [0.0; 3] };
        let row = trical_model::Row { state: trical_model::State::at(&[0.1; 6]), measured: touch, seq: None, line: 2 };
        let recording = trical_model::Recording { name: "r".into(), joints: 6, rows: vec![row], ..Default::default() };
        let data = Dataset::build(&[recording], crate::dataset::JointSource::Read, None).unwrap();
        assert_eq!(plausible(&model, &data), [Some(SCALE), None]);
    }
}
