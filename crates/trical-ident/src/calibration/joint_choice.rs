//! Which joint angles to use, where the user leaves that to the data.

use trical_model::{Cell, Recording, Robot};

use crate::dataset::{Dataset, JointSource};
use crate::error::Result;
use crate::fit::choice::ParameterSet;
use crate::fit::gross_errors::reject_gross_errors;
use crate::fit::identify::identify;
use crate::fit::stuck_stems::refuse_stuck_stems;
use crate::rigid::median;

/// Whether every row says what was commanded.
#[must_use]
pub fn all_commanded(recordings: &[Recording]) -> bool {
    recordings.iter().all(|r| r.rows.iter().all(|r| r.state.q_commanded.is_some()))
}

/// Recordings as observations, gross errors rejected unless they are to be kept. Without `joints`: whichever the parameters of
/// `set` explain better.
///
/// # Errors
/// As [`Dataset::build`], [`refuse_stuck_stems`] and [`reject_gross_errors`].
pub fn clean(
    robot: &Robot,
    cell: &Cell,
    recordings: &[Recording],
    joints: Option<JointSource>,
    set: ParameterSet,
    keep_outliers: bool,
) -> Result<Dataset> {
    let of = |source| -> Result<Dataset> {
        let data = Dataset::build(recordings, source, None)?;
        if keep_outliers {
            return Ok(data);
        }
        refuse_stuck_stems(robot, cell, &data)?;
        reject_gross_errors(robot, cell, &data)
    };
    if let Some(source) = joints {
        return of(source);
    }
    let read = of(JointSource::Read)?;
    if !all_commanded(recordings) {
        return Ok(read);
    }
    let commanded = of(JointSource::Commanded)?;
    let left = |data: &Dataset| -> Result<f64> { Ok(median(&identify(robot, cell, data, set)?.errors()?)) };
    Ok(if left(&commanded)? < left(&read)? { commanded } else { read })
}
