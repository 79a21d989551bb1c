//! Which joint angles to use, where the user leaves that to the data.

use trical_ident::calibration::joint_choice::all_commanded;
use trical_ident::dataset::{Dataset, JointSource};
use trical_ident::error::Result;
use trical_model::{Cell, Recording, Robot, Task};

use crate::diagnosis::Diagnosis;
use crate::options::Options;
use crate::procedure::diagnose;

/// Diagnoses recordings as [`diagnose`] does; without joints asked for as read and as commanded, and takes what leaves less, held out.
/// Also says which joints that were.
///
/// # Errors
/// As [`Dataset::build`] and [`diagnose`].
pub fn diagnose_recordings(
    robot: &Robot,
    cell: &Cell,
    recordings: &[Recording],
    options: &Options,
    task: &Task<'_>,
) -> Result<(Diagnosis, JointSource)> {
    let of = |source| -> Result<(Diagnosis, JointSource)> {
        let data = Dataset::build(recordings, source, None)?;
        Ok((diagnose(robot, cell, &data, options, task)?, source))
    };
    if let Some(source) = options.joints {
        return of(source);
    }
    let read = of(JointSource::Read)?;
    if !all_commanded(recordings) {
        return Ok(read);
    }
    let commanded = of(JointSource::Commanded)?;
    Ok(if commanded.0.after.holdout_rms_mm < read.0.after.holdout_rms_mm { commanded } else { read })
}
