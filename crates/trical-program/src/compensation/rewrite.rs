//! Behind it, every target by itself: the joints that the full model needs, and the numbers that bring the controller there.

use trical_model::ik::{IkError, closest, continue_from};
use trical_model::pose::rotation_vector;
use trical_model::{Forward, Joints, Pose, State, Workspace};

use super::arms::Compensator;
use super::nominal_joints::Start;
use crate::literal::{MOST, Meant};
use crate::scan::Spot;
use crate::text::{Span, kept_apart, written, written_whole};

/// A correction of a few mm that asks more of a joint than this says that the arm is nearly singular there, rad.
const MOST_JOINT_MOVE: f64 = 3.0_f64.to_radians();

/// No correction turns a joint, or the tool, by more, rad, nor moves the tool by more, m: an arm is not so far off, and nobody expects it of a
/// program that was corrected.
const MOST_TURN: f64 = 10.0_f64.to_radians();
const MOST_WAY: f64 = 0.05;

/// How far from a joint a correction is made at least, m: a large one may turn joints by more.
const LEVER: f64 = 0.1;

/// A target that is rewritten.
pub struct Done {
    /// New numbers.
    pub edits: Vec<(Span, String)>,
    /// How far the target moves, m.
    pub moved: f64,
    /// How far the arm is off before, by the model: m and rad.
    pub before: (f64, f64),
    /// How far off the arm is with the numbers as written, as `before`.
    pub after: (f64, f64),
    /// What the program wants, in {w}.
    pub wanted: Pose,
    /// Where the new numbers send the tool of the arm that the controller computes with, in {w}.
    pub commanded: Pose,
    /// Joints to which the controller will go, the rail's place in front of them where there is one.
    pub joints: Joints,
}

impl Compensator<'_> {
    /// Rewrites one target.
    ///
    /// # Errors
    /// In words, why it stays as it is.
    pub fn rewrite(&self, spot: &Spot, start: &Start, ws: &mut [(Workspace, Workspace)]) -> Result<Done, String> {
        let place = self.place(spot)?;
        let index = self.arm(spot, place)?;
        let arm = &self.arms[index];
        let (nominal_ws, model_ws) = &mut ws[index];
        let (values, meant) = self.read(spot)?;
        if let Some(why) = self.scan.forbidden(spot, &meant) {
            return Err(why);
        }
        let wanted = match &meant {
            Meant::Pose(pose) => place.world_from_frame.compose(pose),
            Meant::Joints(q) => arm.nominal.world_from_tool(&State::at(q), nominal_ws),
        };
        let state = self.state(&start.q, start.dir);
        let before = apart(&arm.model.world_from_tool(&state, model_ws), &wanted);
        if before.0 > MOST_WAY || before.1 > MOST_TURN {
            return Err(format!(
                "the model has the tool {:.1} mm and {:.1} deg off: that is too much for a correction. If the cell's base was only guessed, {} \
                 leaves it out; if the tool was guessed, name the program's own ({}, {})",
                before.0 * 1e3,
                before.1.to_degrees(),
                self.options.spelling.of("own_base"),
                self.options.spelling.with("tool", "NAME"),
                self.options.spelling.with("frames", "FILE")
            ));
        }
        let joints = self.continued(&arm.model, &wanted, &state, model_ws).map_err(|e| match e {
            // no iterations: there is a solution, but far away
            IkError::Singular { .. } | IkError::NotConverged { iterations: 0, .. } => {
                "at a singularity of the arm: no small change of the joints corrects it".into()
            }
            _ => e.to_string(),
        })?;
        self.check_change(start, &joints, before)?;
        let commanded = arm.nominal.world_from_tool(&State::at(&joints), nominal_ws);
        let new = match meant {
            Meant::Pose(_) => Meant::Pose(place.world_from_frame.inverse().compose(&commanded)),
            Meant::Joints(_) => Meant::Joints(joints),
        };
        let (edits, read_back) = self.edits(spot, start, &joints, (&values, &meant), &new);
        // what the controller will make of the new text, by the nominal arm, and where the real arm then is
        let reached = match spot.shape.meant(&read_back[..spot.shape.count(self.dof)], &self.slides)? {
            Meant::Joints(q) => q,
            Meant::Pose(pose) => {
                let world = place.world_from_frame.compose(&pose);
                self.continued(&arm.nominal, &world, &State::at(&joints), nominal_ws).map_err(|e| e.to_string())?
            }
        };
        let after = apart(&arm.model.world_from_tool(&self.state(&reached, start.dir), model_ws), &wanted);
        let moved = (commanded.translation - wanted.translation).norm();
        Ok(Done { edits, moved, before, after, wanted, commanded, joints: self.with_rail(spot, &reached) })
    }

    /// The joints of an arm at a pose, near those of a state; with fewer than six joints, as near to it as they come with the tool's point there.
    pub(super) fn continued(
        &self,
        arm: &Forward,
        pose: &Pose,
        near: &State,
        ws: &mut Workspace,
    ) -> Result<Joints, IkError> {
        if self.dof < 6 { closest(arm, pose, near, ws).map(|(q, ..)| q) } else { continue_from(arm, pose, near, ws) }
    }

    /// Refuses a correction that turns a joint much further than the error of the tool explains (`off`, m and rad), or leaves the branch.
    fn check_change(&self, start: &Start, joints: &Joints, off: (f64, f64)) -> Result<(), String> {
        let mut farthest = (0, 0.0_f64);
        for (k, (a, b)) in joints.iter().zip(&start.q).enumerate() {
            if !self.slides.get(k).copied().unwrap_or(false) && (a - b).abs() > farthest.1 {
                farthest = (k + 1, (a - b).abs());
            }
        }
        if farthest.1 > (2.0 * (off.1 + off.0 / LEVER)).clamp(MOST_JOINT_MOVE, MOST_TURN) {
            return Err(format!(
                "near a singularity: the correction would turn joint {} by {:.1} deg",
                farthest.0,
                farthest.1.to_degrees()
            ));
        }
        match self.branches.changed(&start.q, joints) {
            Some(how) => Err(format!("the branch changes: {how}")),
            None => Ok(()),
        }
    }

    /// The new numbers and, where the text has one, the new configuration; and the numbers as the controller will read them.
    fn edits(
        &self,
        spot: &Spot,
        start: &Start,
        joints: &Joints,
        (values, meant): (&[f64; MOST], &Meant),
        new: &Meant,
    ) -> (Vec<(Span, String)>, [f64; MOST]) {
        let count = spot.shape.count(self.dof);
        let spans = &self.scan.written(spot).numbers;
        let numbers = spot.shape.numbers(new, &values[..count], meant, &self.slides);
        let mut edits = Vec::with_capacity(count);
        let mut read_back = *values;
        for (k, (new, span)) in numbers.iter().zip(spans).enumerate().take(count) {
            let Some(x) = new else { continue };
            let scale = self.scan.scale(k);
            let digits = spot.shape.decimals(k) + libm::log10(scale).ceil() as usize;
            let text = written(*x / scale, span.text(self.bytes), digits);
            read_back[k] = text.parse().map_or(*x, |read: f64| read * scale);
            edits.push((*span, text));
        }
        let configuration = self.kept(self.scan.configuration(spot));
        if self.branches.mismatch(&configuration, &start.q).is_some() {
            let new = self.branches.rewritten(&configuration, &start.q, joints);
            let behind = spans.get(count..).unwrap_or(&[]);
            edits.extend(
                new.iter()
                    .zip(behind)
                    .filter_map(|(n, span)| Some((*span, written_whole((*n)?, span.text(self.bytes))))),
            );
        }
        let edits = edits.into_iter().map(|(span, new)| (span, kept_apart(new, self.bytes, span))).collect();
        (self.in_place(spot, edits), read_back)
    }

    /// New numbers of data that have a name are written in the place of the name: others may use these data too.
    fn in_place(&self, spot: &Spot, mut edits: Vec<(Span, String)>) -> Vec<(Span, String)> {
        for (name, numbers) in self.scan.parts_of(spot) {
            let text = |number: &Span| match edits.iter().find(|(span, _)| span == number) {
                Some((_, new)) => new.clone(),
                None => String::from_utf8_lossy(number.text(self.bytes)).into_owned(),
            };
            let whole = format!("[{}]", numbers.iter().map(text).collect::<Vec<_>>().join(","));
            let all = edits.len();
            edits.retain(|(span, _)| !numbers.contains(span));
            edits.extend((edits.len() < all).then_some((*name, whole)));
        }
        edits
    }
}

fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    ((a.translation - b.translation).norm(), rotation_vector(&(a.rotation.transpose() * b.rotation)).norm())
}
