//! The arm behind the virtual cell: a hidden true model, and what the controller believes.

use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use trical_device::virtual_cell::Frame;
use trical_device::{CellOptions, Plant};
use trical_ident::simulate::reading_at;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet};
use trical_model::ik::{continue_from, nearest_solution};
use trical_model::{Forward, Joints, Measured, Model, Motion, Parameter, Pose, Recording, Row, Site, State, Workspace};

use crate::error::{CliError, Result};

/// The true arm and the balls, and the nominal arm of the controller.
pub struct ArmPlant {
    truth: Forward,
    nominal: Forward,
    truth_ws: Workspace,
    nominal_ws: std::sync::Mutex<Workspace>,
}

fn rows(p: &Pose) -> Frame {
    let r = &p.rotation;
    (p.translation.into(), std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])))
}

impl ArmPlant {
    /// From the true model; the controller's is its nominal arm.
    pub fn new(truth: &Model) -> Result<Self> {
        let nominal = Forward::new(Model::nominal(truth.robot.clone(), truth.cell.clone()), Vec::new())?;
        let truth = Forward::new(truth.clone(), Vec::new())?;
        Ok(Self { truth_ws: truth.workspace(), nominal_ws: std::sync::Mutex::new(nominal.workspace()), truth, nominal })
    }

    fn with_nominal<T>(&self, f: impl FnOnce(&Forward, &mut Workspace) -> T) -> T {
        let mut ws = match self.nominal_ws.lock() {
            Ok(ws) => ws,
            Err(poisoned) => poisoned.into_inner(),
        };
        f(&self.nominal, &mut ws)
    }
}

impl Plant for ArmPlant {
    fn joints(&self) -> usize {
        self.truth.model().robot.dof()
    }

    fn balls(&self) -> usize {
        self.truth.model().cell.balls.len()
    }

    fn offset_to_ball(&mut self, state: &State, ball: usize) -> [f64; 3] {
        reading_at(&self.truth, state, ball, &mut self.truth_ws)
    }

    fn tcp(&mut self, state: &State) -> Frame {
        rows(&self.truth.world_from_tool(state, &mut self.truth_ws))
    }

    fn nominal_tcp(&self, q: &Joints) -> Frame {
        self.with_nominal(|f, ws| rows(&f.world_from_tool(&State::at(q), ws)))
    }

    fn nominal_inverse(&self, position: [f64; 3], rotation: [[f64; 3]; 3], seed: &Joints) -> Option<Joints> {
        let pose = Pose { rotation: nalgebra::Matrix3::from_fn(|i, j| rotation[i][j]), translation: position.into() };
        self.with_nominal(|f, ws| continue_from(f, &pose, &State::at(seed), ws).ok())
    }

    fn temperature(&mut self, t: f64) -> Option<f64> {
        Some(22.0 + 3.0 * (1.0 - (-t / 1800.0).exp()))
    }
}

/// Noise and limits of a virtual cell like a real one.
pub fn cell_options(model: &Model, seed: u64, port: u16) -> CellOptions {
    CellOptions {
        port,
        limits: model.robot.joints.iter().map(|j| (j.limits[0], j.limits[1])).collect(),
        // the indicators resolve 0.001 mm; the arm comes to rest within 0.01 mm
        noise: 0.5e-6,
        placement: 4e-6,
        seed,
        ..CellOptions::default()
    }
}

/// A true arm drawn by chance: errors as arms of this size have them (0.3 mm and 0.1 deg in the chain, more in base and tool,
/// compliances of 0.002 to 0.02 deg/Nm), on the paper's parameters, the twist of axis 3 and nothing else.
pub fn draw_truth(nominal: &Model, seed: u64) -> Result<Model> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).map_err(|e| CliError::Failed(e.to_string()))?;
    let mut draw = |sd: f64| normal.sample(&mut rng) * sd;
    let touch = Row {
        state: State::at(&[0.0; 9]),
        measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
        seq: None,
        line: 0,
    };
    let recording = Recording { name: "truth".into(), joints: nominal.robot.dof(), rows: vec![touch] };
    let data = Dataset::build(&[recording], JointSource::Read, None)?;
    let choice = Choice::from(ParameterSet::Compliance);
    let mut model = nominal.clone();
    model.terms = trical_ident::identifiability::independent_terms(nominal, &data, &choice)?.0;
    for t in &mut model.terms {
        t.value = match t.site {
            Site::Base(Motion::Along(_)) => draw(0.5e-3),
            Site::Base(Motion::About(_)) => draw(0.05_f64.to_radians()),
            Site::Tool(_) => draw(0.3e-3),
            Site::Link { parameter: Parameter::A | Parameter::D, .. } => draw(0.3e-3),
            Site::Link { .. } => draw(0.1_f64.to_radians()),
            _ => (0.002 + 0.018 * draw(0.5).abs().min(1.0)).to_radians(),
        };
    }
    set_up(&mut model, || draw(0.1e-3))?;
    Ok(model)
}

/// The place of the base as the set-up of a cell leaves it: the three balls are touched once, in one orientation, before
/// anything else (paper, procedure), so that `cell.toml` is right there to about 0.1 mm.
fn set_up(model: &mut Model, mut rest: impl FnMut() -> f64) -> Result<()> {
    let nominal = Forward::new(Model::nominal(model.robot.clone(), model.cell.clone()), Vec::new())?;
    let truth = Forward::new(model.clone(), Vec::new())?;
    let (mut ws, mut true_ws) = (nominal.workspace(), truth.workspace());
    // the first orientation, from vertical to leaning, in which the device reaches all balls
    let home = State::at(&[0.0; 9]);
    let balls = model.cell.balls.clone();
    let reached = (0..7).find_map(|lean| {
        (0..24).find_map(|turn| {
            let down = trical_model::pose::rotation_z(f64::from(turn) * 15.0_f64.to_radians())
                * trical_model::pose::rotation_x((180.0 - 10.0 * f64::from(lean)).to_radians());
            balls
                .iter()
                .map(|ball| {
                    let at = Pose { rotation: down, translation: *ball };
                    nearest_solution(&nominal, &at, &home, &mut ws).ok()
                })
                .collect::<Option<Vec<Joints>>>()
        })
    });
    let Some(reached) = reached else {
        return Err(CliError::Input("the device reaches the three balls in no common orientation".into()));
    };
    let pairs: Vec<_> = balls
        .iter()
        .zip(&reached)
        .map(|(ball, q)| {
            let seen = truth.world_from_tool(&State::at(q), &mut true_ws).translation;
            (ball + nalgebra::Vector3::new(rest(), rest(), rest()), seen)
        })
        .collect();
    let Some(shift) = trical_ident::rigid::rigid_from_points(&pairs) else { return Ok(()) };
    // all links have moved from where they seemed to be: the base with them
    let links = truth.world_from_links(&State::at(&[0.0; 9]), &mut true_ws);
    let Some(base) = links.first() else { return Ok(()) };
    let base = shift.compose(base);
    let reference = &model.cell.world_from_base;
    let move_by = base.translation - reference.translation;
    let turn_by = trical_model::pose::angles_zyx(&(base.rotation * reference.rotation.transpose()));
    for t in &mut model.terms {
        match t.site {
            Site::Base(Motion::Along(a)) => t.value = move_by[a.index()],
            Site::Base(Motion::About(a)) => t.value = turn_by[2 - a.index()],
            _ => {}
        }
    }
    Ok(())
}
