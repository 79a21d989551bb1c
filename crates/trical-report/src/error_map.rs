//! How far an arm misses all over its workspace, whatever it is about to do there.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use serde::Serialize;
use trical_ident::{ErrorSummary, Expected, ModelFile};
use trical_model::{Forward, JointKind, Joints, MAX_JOINTS, Model, Site, State, Term};

use crate::error::Result;
use crate::table::csv;

/// The error at one pose.
pub struct Miss {
    /// Joints, rad (m).
    pub joints: Joints,
    /// Where the nominal arm's TCP is, in the frame of its base, m.
    pub at: Vector3<f64>,
    /// From the nominal arm's TCP to the model's, m.
    pub off: Vector3<f64>,
    /// Standard deviation of a coordinate of `off`, m, if the model's file says it.
    pub deviation: Option<f64>,
    /// The first joint (from 1) whose angle is beyond those that the model was fitted at.
    pub beyond: Option<usize>,
}

/// What is said of all poses of a map.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MapSummary {
    /// How far the nominal arm misses.
    #[serde(flatten)]
    pub errors: ErrorSummary,
    /// Poses beyond the joint angles that the model was fitted at.
    pub beyond: usize,
}

/// Errors at poses at random within the limits of the joints.
pub struct ErrorMap {
    /// One after the other.
    pub misses: Vec<Miss>,
    kinds: Vec<JointKind>,
}

impl ErrorMap {
    /// Where the nominal arm's TCP is, from its base, and how far the model's is from there, at random poses. What only places
    /// the arm in the cell does not count, nor does the tool: both arms carry the one that was identified. Time, temperature and sense
    /// of motion do not count either: a pose does not have them.
    pub fn of(model: &Model, poses: usize) -> Result<Self> {
        let model = &model.clone().with_seen_tcp();
        let mut standing = model.clone();
        standing.terms.retain(|t| !matches!(t.site, Site::Base(_)));
        let real = Forward::new(standing, Vec::new())?;
        let mut nominal = Model::nominal(model.robot.clone(), model.cell.clone());
        let tool = |t: &&Term| matches!(t.site, Site::Tool(_)) && t.basis.is_constant();
        nominal.terms.extend(model.terms.iter().filter(tool).cloned());
        let nominal = Forward::new(nominal, Vec::new())?;
        let base = model.cell.world_from_base.inverse();
        let (mut a, mut b) = (real.workspace(), nominal.workspace());
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(20_261_121);
        let misses = (0..poses)
            .map(|_| {
                let mut joints = [0.0; MAX_JOINTS];
                for (q, j) in joints.iter_mut().zip(&model.robot.joints) {
                    *q = rng.random_range(j.limits[0]..j.limits[1]);
                }
                let state = State::at(&joints);
                let at = base.compose(&nominal.world_from_tool(&state, &mut b)).translation;
                let off = base.compose(&real.world_from_tool(&state, &mut a)).translation - at;
                Miss { joints, at, off, deviation: None, beyond: None }
            })
            .collect();
        Ok(Self { misses, kinds: model.robot.joints.iter().map(|j| j.kind).collect() })
    }

    /// Notes at each pose how uncertain the model is there, and whether it was fitted at such joint angles, by its file.
    ///
    /// # Errors
    /// A model that its own arm cannot have.
    pub fn expect(&mut self, file: &ModelFile) -> Result<()> {
        let (expected, visited) = (Expected::of(file)?, file.visited());
        for miss in &mut self.misses {
            miss.deviation = expected.as_ref().map(|e| e.deviation(&State::at(&miss.joints)));
            miss.beyond = visited.beyond(&miss.joints);
        }
        Ok(())
    }

    /// Of all poses.
    pub fn summary(&self) -> MapSummary {
        MapSummary {
            errors: ErrorSummary::of(&self.misses.iter().map(|m| m.off.norm()).collect::<Vec<_>>()),
            beyond: self.misses.iter().filter(|m| m.beyond.is_some()).count(),
        }
    }

    /// As text: joints in degrees (mm), place and error in mm, standard deviation of a coordinate of the error in mm and the joint that is beyond
    /// the angles of the fit; these two are empty where nothing is to be said.
    pub fn csv(&self) -> String {
        let joints = self.kinds.iter().enumerate().map(|(k, j)| format!("q{}_{}", k + 1, j.unit().1));
        let places =
            ["x_mm", "y_mm", "z_mm", "dx_mm", "dy_mm", "dz_mm", "error_mm", "sd_mm", "beyond_joint"].map(String::from);
        let row = |m: &Miss| {
            let joints = m.joints.iter().zip(&self.kinds).map(|(q, kind)| format!("{:.3}", q * kind.unit().0));
            let lengths = m.at.iter().chain(m.off.iter()).copied().chain([m.off.norm()]);
            let mm = |v: f64| format!("{:.4}", v * 1e3);
            let expected =
                [m.deviation.map(mm), m.beyond.map(|joint| joint.to_string())].map(Option::unwrap_or_default);
            joints.chain(lengths.map(mm)).chain(expected).collect::<Vec<String>>()
        };
        csv([joints.chain(places).collect()].into_iter().chain(self.misses.iter().map(row)))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_model::{Basis, Motion, Parameter};

    #[test]
    fn the_map_of_a_turned_first_joint_is_a_rotation_and_base_and_tool_do_not_count() {
        let mut model = crate::test_data::arm();
        let zero = Site::Link { link: 1, parameter: Parameter::Theta };
        for (site, value) in [(zero, 1e-3), (Site::Base(Motion::ALL[0]), 5e-3)] {
            model.terms.push(Term { value, ..Term::new("t", "geometry", site, Basis::CONSTANT) });
        }
        let same_tool = ErrorMap::of(&model, 200).unwrap().summary().errors;
        // a probe is 90 mm from where the cell's file has it
        model
            .terms
            .push(Term { value: 0.09, ..Term::new("tool_z", "setup", Site::Tool(Motion::ALL[2]), Basis::CONSTANT) });
        let map = ErrorMap::of(&model, 200).unwrap();
        assert!((map.summary().errors.mean_mm - same_tool.mean_mm).abs() < 0.1, "{:?}", map.summary());
        let (text, errors) = (map.csv(), map.summary().errors);
        let mut largest: f64 = 0.0;
        for line in text.lines().skip(1) {
            let v: Vec<f64> = line.trim_end_matches(',').split(',').map(|v| v.parse().unwrap()).collect();
            let [x, y, dx, dy, dz, error] = [v[6], v[7], v[9], v[10], v[11], v[12]];
            // to second order in the milliradian
            let near = 1e-3 + 1e-6 * x.hypot(y);
            assert!((dx + 1e-3 * y).abs() < near && (dy - 1e-3 * x).abs() < near && dz.abs() < 1e-3, "{line}");
            assert!((error - 1e-3 * x.hypot(y)).abs() < 2.0 * near, "{line}");
            largest = largest.max(error);
        }
        assert_eq!(text.lines().count(), 201);
        assert!((errors.max_mm - largest).abs() < 1e-3);
    }

    #[test]
    fn poses_beyond_the_angles_of_the_fit_are_told_with_their_joint_and_deviations_are_those_of_the_file() {
        let calibration = crate::test_data::calibration();
        let mut file = ModelFile::of_fit(&calibration.fitted);
        let mut map = ErrorMap::of(&file.model, 100).unwrap();
        map.expect(&ModelFile::unmeasured(file.model.clone())).unwrap();
        assert!(map.summary().beyond == 0 && map.csv().lines().skip(1).all(|line| line.ends_with(",,")));
        // a curve over joint 2 is known at its lower half only
        let basis = Basis::new(trical_model::Variable::Joint { joint: 2 }, trical_model::Shape::Linear);
        let site = Site::Joint { joint: 2 };
        file.model.terms.push(Term { value: 1e-4, ..Term::new("curve", "joint_curve", site, basis) });
        let [low, high] = file.model.robot.joints[1].limits.map(f64::to_degrees);
        let half = (low + high) / 2.0;
        let stretches: Vec<_> = (0..6).map(|k| vec![if k == 1 { [low, half] } else { [-400.0, 400.0] }]).collect();
        file.sessions[0].visited = trical_model::Support::from_stretches(&file.model.robot, &stretches);
        map.expect(&file).unwrap();
        let expected = Expected::of(&file).unwrap().unwrap();
        let text = map.csv();
        for (miss, line) in map.misses.iter().zip(text.lines().skip(1)) {
            let cells: Vec<&str> = line.rsplitn(3, ',').collect();
            assert_eq!(cells[0], if miss.joints[1].to_degrees() > half + 3.0 { "2" } else { "" }, "{line}");
            let deviation = expected.deviation(&State::at(&miss.joints));
            assert!(deviation > 0.0 && cells[1] == format!("{:.4}", deviation * 1e3), "{line}");
        }
        let lines = text.lines().filter(|line| line.ends_with(",2")).count();
        assert!(map.summary().beyond == lines && (20..80).contains(&lines), "{lines}");
    }
}
