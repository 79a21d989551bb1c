//! What touches of a cell's balls can tell apart, before any is made.

use trical_model::{Cell, MAX_JOINTS, Measured, Model, Recording, Robot, Row, State};

use crate::dataset::{Dataset, JointSource};
use crate::error::{IdentError, Result};
use crate::fit::choice::{Choice, ParameterSet};
use crate::fit::identifiability::independent_terms;

/// The nominal model with the parameters of a set that touches of its balls can tell apart, their values zero.
///
/// # Errors
/// A cell without balls, and a robot without masses where compliance is asked for.
pub fn model_of_touches(robot: &Robot, cell: &Cell, set: ParameterSet) -> Result<Model> {
    if cell.balls.is_empty() {
        return Err(IdentError::NotEnough(
            "the cell has no balls that could be touched; expected [balls] in its file, with places or distances"
                .into(),
        ));
    }
    let data = planned(robot, (0..cell.balls.len()).map(|ball| (State::at(&[0.0; MAX_JOINTS]), ball)))?;
    let mut model = Model::nominal(robot.clone(), cell.clone());
    model.terms = independent_terms(&model, &data, &Choice::from(set))?.0;
    Ok(model)
}

/// Touches that are not made yet: the arm's state and the ball (from 0) of each.
///
/// # Errors
/// No touches.
pub fn planned(robot: &Robot, touches: impl Iterator<Item = (State, usize)>) -> Result<Dataset> {
    let touch =
        |(state, ball)| Row { state, measured: Measured::Touch { ball, reading: [0.0; 3] }, seq: None, line: 0 };
    let recording = Recording {
        name: "plan".into(),
        joints: robot.dof(),
        rows: touches.map(touch).collect(),
        ..Recording::default()
    };
    Dataset::build(&[recording], JointSource::Read, None)
}

/// The richest of the usual sets that the robot allows: with compliance where the links have masses.
#[must_use]
pub fn usual_set(robot: &Robot) -> ParameterSet {
    if robot.require_masses().is_ok() { ParameterSet::Compliance } else { ParameterSet::Geometry }
}
