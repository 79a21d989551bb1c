//! The arm behind a virtual cell: a true model, and the nominal arm that the controller believes in.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::{Mutex, PoisonError};

use trical_model::ik::continue_from;
use trical_model::touch::reading_at;
use trical_model::{Forward, Joints, MAX_JOINTS, Model, Pose, State, Workspace};

use super::{CellOptions, Plant};
use crate::url::Secret;

/// The true arm and the balls, and the nominal arm of the controller.
pub struct ArmPlant {
    truth: Forward,
    nominal: Forward,
    truth_ws: Workspace,
    nominal_ws: Mutex<Workspace>,
}

impl ArmPlant {
    /// From the true model; the controller's is its nominal arm.
    ///
    /// # Errors
    /// A model that makes no sense.
    pub fn new(truth: &Model) -> trical_model::Result<Self> {
        let nominal = Forward::new(Model::nominal(truth.robot.clone(), truth.cell.clone()), Vec::new())?;
        let truth = Forward::new(truth.clone(), Vec::new())?;
        Ok(Self { truth_ws: truth.workspace(), nominal_ws: Mutex::new(nominal.workspace()), truth, nominal })
    }

    fn with_nominal<T>(&self, f: impl FnOnce(&Forward, &mut Workspace) -> T) -> T {
        let mut ws = self.nominal_ws.lock().unwrap_or_else(PoisonError::into_inner);
        f(&self.nominal, &mut ws)
    }
}

impl Plant for ArmPlant {
    fn joints(&self) -> usize {
        self.truth.model().robot.dof()
    }

    fn slides(&self) -> [bool; MAX_JOINTS] {
        self.truth.model().robot.prismatic()
    }

    fn balls(&self) -> usize {
        self.truth.model().cell.balls.len()
    }

    fn offset_to_ball(&mut self, state: &State, ball: usize) -> [f64; 3] {
        reading_at(&self.truth, state, ball, &mut self.truth_ws)
    }

    fn tcp(&mut self, state: &State) -> Pose {
        self.truth.world_from_tool(state, &mut self.truth_ws)
    }

    fn nominal_tcp(&self, q: &Joints) -> Pose {
        self.with_nominal(|f, ws| f.world_from_tool(&State::at(q), ws))
    }

    fn nominal_inverse(&self, world_from_tool: &Pose, seed: &Joints) -> Option<Joints> {
        self.with_nominal(|f, ws| continue_from(f, world_from_tool, &State::at(seed), ws).ok())
    }

    fn temperature(&mut self, t: f64) -> Option<f64> {
        Some(22.0 + 3.0 * (1.0 - (-t / 1800.0).exp()))
    }
}

impl CellOptions {
    /// Noise and limits of a cell like a real one, and a secret that is drawn anew: other programs of this computer, a web
    /// browser among them, reach its port, too.
    #[must_use]
    pub fn like_a_real_one(model: &Model, seed: u64, port: u16) -> Self {
        Self {
            port,
            secret: Some(drawn_secret()),
            limits: model.robot.joints.iter().map(|j| (j.limits[0], j.limits[1])).collect(),
            // the indicators resolve 0.001 mm; the arm comes to rest within 0.01 mm
            noise: 0.5e-6,
            placement: 4e-6,
            seed,
            ..Self::default()
        }
    }
}

/// A secret that nobody can guess, from the random keys that the operating system gives.
fn drawn_secret() -> Secret {
    let word = || RandomState::new().build_hasher().finish();
    Secret::new(format!("{:016x}{:016x}", word(), word()))
}
