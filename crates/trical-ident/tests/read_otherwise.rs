//! Readings that are not what their columns say.

use trical_ident::read_otherwise::read_otherwise;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet, identify};
use trical_model::Measured;

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
