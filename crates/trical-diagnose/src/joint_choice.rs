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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::test_data::{recorded, with_joint_2};

    /// Which joints are used of touches of an arm that is as it says where its joints were `read` or `commanded`; the others are off by 0.3 mrad.
    fn used(true_ones: JointSource, all: bool, asked: Option<JointSource>) -> JointSource {
        let (truth, data) = with_joint_2(&[]);
        let mut recording = recorded(&data);
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        for row in &mut recording.rows {
            let off = row.state.q.map(|q| q + rng.random_range(-3e-4..3e-4));
            let (q, commanded) = if true_ones == JointSource::Read { (row.state.q, off) } else { (off, row.state.q) };
            (row.state.q, row.state.q_commanded) = (q, Some(commanded));
        }
        if !all {
            recording.rows[0].state.q_commanded = None;
        }
        let options = Options { joints: asked, names_only: true, ..Options::default() };
        diagnose_recordings(&truth.robot, &truth.cell, &[recording], &options, &Task::silent()).unwrap().1
    }

    #[test]
    fn the_joints_that_leave_less_are_used_unless_a_row_has_no_command_or_the_user_says_which() {
        use JointSource::{Commanded, Read};
        assert_eq!((used(Read, true, None), used(Commanded, true, None)), (Read, Commanded));
        assert_eq!(used(Commanded, false, None), Read);
        assert_eq!((used(Read, true, Some(Commanded)), used(Commanded, true, Some(Read))), (Commanded, Read));
    }
}
