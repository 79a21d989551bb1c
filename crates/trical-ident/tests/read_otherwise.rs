//! Readings that are not what their columns say.

use trical_ident::fit::read_otherwise::read_otherwise;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet, identify};
use trical_model::{Basis, Forward, Measured, Model, Pose, Shape, Site, Term, Variable};

use crate::arm;

/// What is said of 60 touches with up to 0.5 mm on each indicator, whose readings are as `wrong` makes them.
fn said(wrong: impl Fn([f64; 3]) -> [f64; 3]) -> Option<String> {
    let truth = arm::truth(ParameterSet::Compliance, 5);
    let mut recording = arm::touch(&truth, 60, 3e-6, 7);
    for row in &mut recording.rows {
        if let Measured::Touch { reading, .. } = &mut row.measured {
            *reading = wrong(*reading);
        }
    }
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let choice = Choice::from(ParameterSet::Compliance);
    read_otherwise(&identify(&truth.robot, &truth.cell, &data, choice).unwrap())
}

#[test]
fn signs_axes_and_units_of_the_readings_are_told_where_all_fits_with_them() {
    assert_eq!(said(|r| r), None);
    assert_eq!(said(|[x, y, z]| [1.05 * x, y, z]), None, "a gain is an effect of its own");
    let begins = |wrong: fn([f64; 3]) -> [f64; 3], with: &str| {
        let said = said(wrong).unwrap();
        assert!(said.starts_with(&format!("the device moved {with}, if")), "{said}");
    };
    begins(|[x, y, z]| [-x, y, z], "along x as -ix_mm says");
    begins(|[x, y, z]| [y, x, z], "along x as iy_mm says, along y as ix_mm says");
    begins(|[x, y, z]| [x, y, z / 2.0], "along z as 2.00 iz_mm says");
}

#[test]
fn readings_that_count_for_nothing_fit_at_poses_as_they_were_planned_and_are_not_proposed() {
    let truth = arm::truth(ParameterSet::Compliance, 5);
    let mut real = truth.clone();
    let wave = Basis::new(Variable::Joint { joint: 4 }, Shape::Sine { cycles: 2.0 });
    real.terms.push(Term { value: 4e-3, ..Term::new("hidden", "hidden", Site::Joint { joint: 4 }, wave) });
    let planned = Forward::new(Model::nominal(truth.robot.clone(), truth.cell.clone()), Vec::new()).unwrap();
    let forward = Forward::new(real, Vec::new()).unwrap();
    let (mut there, mut ws) = (planned.workspace(), forward.workspace());
    let mut recording = arm::touch(&truth, 80, 3e-6, 7);
    recording.rows.retain_mut(|row| {
        let Measured::Touch { ball, reading } = &mut row.measured else { return false };
        let rotation = planned.world_from_tool(&row.state, &mut there).rotation;
        let on = Pose { rotation, translation: truth.cell.balls[*ball] };
        let Ok(q) = trical_model::ik::continue_from(&planned, &on, &row.state, &mut there) else { return false };
        row.state.q = q;
        let pose = forward.world_from_tool(&row.state, &mut ws);
        *reading = (pose.rotation.transpose() * (truth.cell.balls[*ball] - pose.translation)).into();
        true
    });
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let choice = Choice::from(ParameterSet::Compliance);
    let fitted = identify(&truth.robot, &truth.cell, &data, choice).unwrap();
    let errors = fitted.errors().unwrap();
    assert!(errors.iter().sum::<f64>() / errors.len() as f64 > 1e-4, "the model lacks something");
    assert_eq!(read_otherwise(&fitted), None);
}
