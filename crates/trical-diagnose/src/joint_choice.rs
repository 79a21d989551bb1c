//! Which joint angles to use, where the user leaves that to the data.

use trical_ident::dataset::{Dataset, JointSource};
use trical_ident::error::{IdentError, Result};
use trical_ident::joint_choice::all_commanded;
use trical_model::{Cell, Measured, Recording, Robot, Task};

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
        let found = diagnose(robot, cell, &data, options, task).map_err(|e| of_few_balls(e, cell, &data))?;
        Ok((found, source))
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

/// One or two balls leave the base open: a calibration closes it by what is usual of arms, a diagnosis takes nothing as known.
fn of_few_balls(e: IdentError, cell: &Cell, data: &Dataset) -> IdentError {
    let touches = data.observations.iter().any(|o| matches!(o.measured, Measured::Touch { .. }));
    let count = cell.balls.len();
    match e {
        IdentError::NotEnough(_) | IdentError::NotConverged(_) if touches && (1..3).contains(&count) => {
            IdentError::NotEnough(format!(
                "touches of {count} ball{} leave the arm's base open: identify closes it by what is usual of arms, but a diagnosis \
                 takes nothing as known ({e}); three balls that are not on a line allow it",
                if count == 1 { "" } else { "s" }
            ))
        }
        e => e,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::{arm, states};
    use trical_model::State;

    #[test]
    fn of_few_balls_a_diagnosis_says_why_it_cannot_and_of_three_what_failed() {
        let data = states(9, |k| State::at(&[0.1 * k]));
        let mut cell = arm().cell;
        let said = |cell: &Cell| of_few_balls(IdentError::NotEnough("too few".into()), cell, &data).to_string();
        assert!(said(&cell).contains("too few") && !said(&cell).contains("base open"), "{}", said(&cell));
        cell.balls.truncate(1);
        assert!(
            said(&cell).contains("touches of 1 ball leave")
                && said(&cell).contains("(")
                && said(&cell).contains("too few")
        );
        let other = || IdentError::File { file: "f".into(), problem: "is not there".into() };
        assert_eq!(of_few_balls(other(), &cell, &data).to_string(), other().to_string());
    }
}
