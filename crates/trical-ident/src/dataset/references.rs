//! Fixed references of a measuring frame: where they are, and poses registered by them. An instrument that moves, or sits on what moves, sees
//! them from elsewhere at each pose.

use nalgebra::Vector3;
use trical_model::{Measured, Pose};

use crate::rigid::{median, median_point, rigid_from_points};

/// Which reference, and where, m.
pub(crate) type Seen = (usize, Vector3<f64>);

/// Where the fixed references of a measuring frame are, m.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct References {
    /// Position of each reference in the measuring frame; `None` for one never seen.
    pub positions: Vec<Option<[f64; 3]>>,
    /// How far the worst of those seen at a pose usually is off its place, m: the instrument's noise. 0 where no pose was registered.
    #[serde(skip)]
    pub(crate) usual_off: f64,
}

impl References {
    /// At these positions, as a model file has them.
    #[must_use]
    pub fn at(positions: Vec<Option<[f64; 3]>>) -> Self {
        Self { positions, usual_off: 0.0 }
    }

    /// Of what was seen at each pose: places that are not `known` begin at the medians, and move onto the mean of what was seen until they agree
    /// (generalized Procrustes).
    pub(crate) fn of(by_pose: &[&[Seen]], known: Option<&Self>) -> Self {
        let mut this = known.cloned().unwrap_or_else(|| Self::medians(by_pose));
        let rounds = if known.is_some() { 0 } else { 3 };
        for _ in 0..rounds {
            let fits: Vec<_> = by_pose.iter().map(|seen| this.onto(seen)).collect();
            let limit = 10.0 * usual(&fits) + 1e-6;
            let agree = |fit: &Option<(Pose, f64)>| fit.filter(|(_, off)| *off <= limit).map(|(pose, _)| pose);
            for (k, place) in this.positions.iter_mut().enumerate() {
                let (mut sum, mut n) = (Vector3::zeros(), 0.0);
                for (seen, pose) in by_pose.iter().zip(&fits).filter_map(|(seen, fit)| Some((seen, agree(fit)?))) {
                    for (_, p) in seen.iter().filter(|(reference, _)| *reference == k) {
                        sum += pose.apply(p);
                        n += 1.0;
                    }
                }
                if n > 0.0 {
                    *place = Some((sum / n).into());
                }
            }
        }
        this.usual_off = usual(&by_pose.iter().map(|seen| this.onto(seen)).collect::<Vec<_>>());
        this
    }

    fn medians(by_pose: &[&[Seen]]) -> Self {
        let all = || by_pose.iter().copied().flatten();
        let count = all().map(|(reference, _)| reference + 1).max().unwrap_or(0);
        let place = |k: usize| {
            let of: Vec<Vector3<f64>> = all().filter(|(reference, _)| *reference == k).map(|(_, p)| *p).collect();
            (!of.is_empty()).then(|| median_point(&of).into())
        };
        Self::at((0..count).map(place).collect())
    }

    /// Whether there are enough of them to register a pose by.
    pub(crate) fn can_register(&self) -> bool {
        self.positions.iter().flatten().count() >= 3
    }

    /// How what was seen at a pose is moved onto the places, and by how much one of them is off then.
    fn onto(&self, seen: &[Seen]) -> Option<(Pose, f64)> {
        let place = |k: usize| self.positions.get(k).copied().flatten().map(Vector3::from);
        let pairs: Vec<_> = seen.iter().filter_map(|(k, p)| Some((place(*k)?, *p))).collect();
        let pose = rigid_from_points(&pairs)?;
        let off = pairs.iter().map(|(q, p)| (pose.apply(p) - q).norm()).fold(0.0, f64::max);
        Some((pose, off))
    }

    /// How what was measured at a pose is moved, by the references seen there, or why it is not to be used: references scatter by the
    /// instrument's noise; beyond ten times what is usual something was bumped or lost.
    pub(crate) fn register(&self, seen: &[Seen]) -> Result<Pose, String> {
        if seen.is_empty() {
            return Err("no references were seen at this pose".into());
        }
        match self.onto(seen) {
            None => Err(format!("only {} of {} references were seen at this pose", seen.len(), self.positions.len())),
            Some((_, off)) if off > 10.0 * self.usual_off + 2e-6 => Err(format!(
                "a reference is {:.3} mm off its place at this pose (usual: {:.3} mm)",
                off * 1e3,
                self.usual_off * 1e3
            )),
            Some((pose, _)) => Ok(pose),
        }
    }
}

fn usual(fits: &[Option<(Pose, f64)>]) -> f64 {
    median(&fits.iter().flatten().map(|(_, off)| *off).collect::<Vec<_>>())
}

/// Moves a measured point or pose.
pub(crate) fn move_by(pose: &Pose, measured: &mut Measured) {
    match measured {
        Measured::Point { position, .. } => *position = pose.apply(&Vector3::from(*position)).into(),
        Measured::Pose { position, quaternion } => {
            *position = pose.apply(&Vector3::from(*position)).into();
            let r = pose.rotation * trical_model::pose::rotation_from_quaternion(*quaternion);
            *quaternion = trical_model::pose::quaternion_from_rotation(&r);
        }
        _ => {}
    }
}
