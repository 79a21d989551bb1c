//! Corrections at a touch: how the TCP is displaced, and whether the channels follow.

use trical_model::recording::Joints;

use super::{Runner, is_same, norm, responds};
use crate::controller::largest_difference;
use crate::gauge::AXES;
use crate::procedure::options::{CONFIRM, JOINT_CHANGE, STALE};
use crate::procedure::steps::check_joints;
use crate::procedure::{PlanEntry, Violation};

impl Runner<'_, '_> {
    /// A little aside along all axes, which every channel has to follow. A gap in a joint may swallow one step: then a longer
    /// one goes the same way before a transmitter is taken for dead.
    pub(super) fn aside(&mut self, entry: &PlanEntry, before: [f64; 3]) -> Result<[f64; 3], Violation> {
        let mut moved = 0.0;
        loop {
            let step = if moved == 0.0 { CONFIRM } else { 2.0 * CONFIRM };
            moved += step;
            self.correct([step; 3])?;
            let after = self.read(entry)?;
            match (0..3).find(|k| !responds(before[*k], after[*k], CONFIRM)) {
                None => return Ok(after),
                Some(k) if moved > CONFIRM => {
                    return Err(Violation::Stale { axis: AXES[k], reading_mm: after[k] * 1e3, moved_mm: moved * 1e3 });
                }
                Some(_) => {}
            }
        }
    }

    /// Corrects by a reading, and reads again. A gap in a joint may swallow a small correction: where a channel shows the very
    /// same, steps of twice the length follow the same way, until no gap would be that wide and its transmitter may be dead.
    pub(super) fn follow(&mut self, entry: &PlanEntry, before: [f64; 3]) -> Result<[f64; 3], Violation> {
        let limits = &self.options.limits;
        let (mut step, mut moved) = (before, before);
        loop {
            self.correct(step)?;
            let after = self.read(entry)?;
            let silent = |k: usize| is_same(before[k], after[k]) && before[k].abs() > STALE;
            let Some(first) = (0..3).find(|k| silent(*k)) else {
                self.check_growth(norm(&before).max(norm(&step)), norm(&after))?;
                return Ok(after);
            };
            let given_up = (0..3).find(|k| silent(*k) && moved[*k].abs() > 2.0 * CONFIRM);
            if given_up.is_some() || self.corrections >= limits.iterations {
                let k = given_up.unwrap_or(first);
                let (reading_mm, moved_mm) = (after[k] * 1e3, moved[k].abs() * 1e3);
                return Err(Violation::Stale { axis: AXES[k], reading_mm, moved_mm });
            }
            step = std::array::from_fn(|k| if silent(k) { 2.0 * step[k] } else { after[k] });
            moved = std::array::from_fn(|k| moved[k] + step[k]);
        }
    }

    /// Steps (d), (e): displaces the TCP by the reading, in the tool's axes.
    fn correct(&mut self, reading: [f64; 3]) -> Result<(), Violation> {
        let limits = &self.options.limits;
        let length = norm(&reading);
        self.corrected += length;
        if length > limits.correction {
            return Err(Violation::Correction { length_mm: length * 1e3, limit_mm: limits.correction * 1e3 });
        }
        if self.corrected > limits.total_correction {
            let (length_mm, limit_mm) = (self.corrected * 1e3, limits.total_correction * 1e3);
            return Err(Violation::TotalCorrection { length_mm, limit_mm });
        }
        self.check_cancelled()?;
        self.look()?;
        let before = self.at;
        if let Some(corrected) = self.options.corrected {
            let to = corrected(&before, reading).map_err(|why| Violation::NoWay(format!("the correction: {why}")))?;
            self.check_turn(&before, &to, length)?;
            self.options.allow(&before, &to, self.touching).map_err(Violation::NoWay)?;
        }
        self.controller.correct(reading)?;
        self.at = self.settled_joints()?;
        self.note_joints()?;
        check_joints(&self.at, self.options)?;
        if largest_difference(&before, &self.at).1 == 0.0 && length > STALE {
            return Err(Violation::NotMoved { length_mm: length * 1e3 });
        }
        self.check_turn(&before, &self.at, length)?;
        self.corrections += 1;
        self.report.corrections += 1;
        Ok(())
    }

    /// Whether a correction turns no joint too far.
    fn check_turn(&self, before: &Joints, after: &Joints, length: f64) -> Result<(), Violation> {
        let (joint, turn) = largest_difference(before, after);
        if turn > JOINT_CHANGE {
            return Err(Violation::JointChange {
                joint: joint + 1,
                length_mm: length * 1e3,
                turn_deg: turn.to_degrees(),
                limit_deg: JOINT_CHANGE.to_degrees(),
            });
        }
        Ok(())
    }

    /// Compares the lengths of the readings before (or of the correction) and after.
    fn check_growth(&self, before: f64, after: f64) -> Result<(), Violation> {
        if after > self.options.limits.growth * before && after > 2.0 * self.options.epsilon {
            return Err(Violation::Diverging { before_mm: before * 1e3, after_mm: after * 1e3 });
        }
        Ok(())
    }
}
