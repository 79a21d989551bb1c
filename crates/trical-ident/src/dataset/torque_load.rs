//! What sessions carry, by measured joint torques: no masses of the arm are needed.
//!
//! Gravity torques are linear in the mass and the first moments of each link, so that all of the arm's, shared by the sessions, and those
//! of a further load on the flange in each session but the first follow by least squares (Swevers et al., IEEE Control Systems 2007). Of the
//! arm's own numbers many do the same; weak priors hold those, and the loads do not depend on them.

use serde::Serialize;
use trical_model::{Cell, Forward, Joints, MAX_JOINTS, Model, Robot, State, Workspace};

use crate::dataset::Dataset;
use crate::dense::{Cholesky, Mat};
use crate::error::Result;

/// The load of a session beside that of the first one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TorqueLoad {
    /// The session's recording.
    pub recording: String,
    /// The first session's.
    pub beside: String,
    /// By how much more is on the flange, kg, and its standard deviation.
    pub mass_kg: f64,
    /// Standard deviation of `mass_kg`.
    pub sd_kg: f64,
    /// Where the centre of gravity of what was added (or taken off) is, in the flange's frame, mm; `null` where that is less sure than 50 mm.
    pub cog_mm: Option<[f64; 3]>,
}

/// Below so many standard deviations loads are not told apart.
const TOLD: f64 = 3.0;

/// Differences that are of no account, kg.
const SMALL_KG: f64 = 0.05;

/// Standard deviation of a centre of gravity that is worth telling, m.
const KNOWN_COG: f64 = 0.05;

/// Priors: kg or kg m of a link or a load, N m of a torque sensor's zero.
const WEAK: f64 = 50.0;

impl TorqueLoad {
    /// In a sentence.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Self { recording, beside, mass_kg, sd_kg, cog_mm } = self;
        if mass_kg.abs() < TOLD * sd_kg || mass_kg.abs() < SMALL_KG {
            let within = (TOLD * sd_kg).max(SMALL_KG);
            return format!("By the measured torques {recording} has the load of {beside}, within {within:.2} kg.");
        }
        let more = if *mass_kg > 0.0 { "more" } else { "less" };
        let centre = cog_mm.map_or_else(String::new, |[x, y, z]| {
            format!(", its centre at {x:.0}, {y:.0}, {z:.0} mm in the flange's frame")
        });
        format!(
            "By the measured torques {recording} has {:.2} +- {sd_kg:.2} kg {more} on the flange than {beside}{centre}.",
            mass_kg.abs()
        )
    }
}

/// Loads of the sessions after the first one. Empty for one session, and where not every row has torques.
///
/// # Errors
/// None for a robot and a cell that were fitted.
pub fn torque_loads(robot: &Robot, cell: &Cell, data: &Dataset) -> Result<Vec<TorqueLoad>> {
    let sessions = data.names.len();
    if sessions < 2 || data.observations.iter().any(|o| o.state.torques.is_none()) {
        return Ok(Vec::new());
    }
    let n = robot.dof();
    let mut bodies = Vec::with_capacity(n + 1);
    for body in 0..=n {
        bodies.push(unit_loads(robot, cell, body)?);
    }
    let mut workspaces: Vec<Vec<_>> = bodies.iter().map(|b| b.iter().map(Forward::workspace).collect()).collect();
    let mut fit = Fit::new(n, sessions);
    for o in &data.observations {
        let Some(measured) = o.state.torques else { continue };
        let state = State { payload_kg: None, torques: None, ..o.state };
        let columns = torques_of_unit_loads(&bodies, &mut workspaces, &state)?;
        for (joint, torque) in measured.iter().enumerate().take(n) {
            fit.add(o.recording, joint, *torque, &columns);
        }
    }
    let Some(loads) = fit.loads() else { return Ok(Vec::new()) };
    let told = |(k, load): (usize, Load)| TorqueLoad {
        recording: data.names[k + 1].clone(),
        beside: data.names[0].clone(),
        mass_kg: load.mass,
        sd_kg: load.sd,
        cog_mm: load.cog.map(|cog| cog.map(|c| c * 1e3)),
    };
    Ok(loads.into_iter().enumerate().map(told).collect())
}

/// Torques of a unit mass at the origin of a body and of its three unit first moments, body by body, the tool last.
fn torques_of_unit_loads(
    bodies: &[Vec<Forward>],
    workspaces: &mut [Vec<Workspace>],
    state: &State,
) -> Result<Vec<Joints>> {
    let mut columns = Vec::with_capacity(4 * bodies.len());
    for (forwards, workspaces) in bodies.iter().zip(workspaces) {
        let first = columns.len();
        for (forward, ws) in forwards.iter().zip(workspaces) {
            let torque = forward.gravity_torques(state, ws)?;
            // a unit mass off the origin is a unit mass at the origin and a first moment
            let at_origin = columns.get(first).copied().unwrap_or([0.0; MAX_JOINTS]);
            columns.push(difference(&torque, &at_origin));
        }
    }
    Ok(columns)
}

/// Least squares of measured torques: four unknowns of each link, four of the load of each session but the first, and a zero of each torque
/// sensor.
struct Fit {
    joints: usize,
    sessions: usize,
    normal: Mat,
    right: Mat,
    /// One row.
    line: Vec<f64>,
    squares: f64,
    rows: usize,
    /// Below 0 where the controller reports what holds against gravity.
    sense: f64,
}

/// What is on the flange beside the first session's load: kg, and the centre of gravity in m where it is known.
struct Load {
    mass: f64,
    sd: f64,
    cog: Option<[f64; 3]>,
}

impl Fit {
    fn new(joints: usize, sessions: usize) -> Self {
        let p = 4 * joints + 4 * (sessions - 1) + joints;
        let (normal, right) = (Mat::zeros(p, p), Mat::zeros(p, 1));
        Self { joints, sessions, normal, right, line: vec![0.0; p], squares: 0.0, rows: 0, sense: 0.0 }
    }

    /// Where the unknowns of a session's load begin; sessions from 1.
    fn own(&self, session: usize) -> usize {
        4 * self.joints + 4 * (session - 1)
    }

    /// Adds what was measured about one joint.
    fn add(&mut self, session: usize, joint: usize, measured: f64, columns: &[Joints]) {
        let (links, p) = (4 * self.joints, self.line.len());
        self.line.fill(0.0);
        (0..links).for_each(|c| self.line[c] = columns[c][joint]);
        if session > 0 {
            let own = self.own(session);
            (0..4).for_each(|k| self.line[own + k] = columns[links + k][joint]);
        }
        self.line[p - self.joints + joint] = 1.0;
        for i in (0..p).filter(|i| self.line[*i] != 0.0) {
            self.right[(i, 0)] += self.line[i] * measured;
            for j in 0..p {
                self.normal[(i, j)] += self.line[i] * self.line[j];
            }
        }
        self.squares += measured * measured;
        self.rows += 1;
        // torques of an arm of equal links
        self.sense += measured * (0..self.joints).map(|link| columns[4 * link][joint]).sum::<f64>();
    }

    /// The loads of the sessions but the first; `None` where the torques do not determine them.
    fn loads(mut self) -> Option<Vec<Load>> {
        let p = self.line.len();
        (0..p).for_each(|i| self.normal[(i, i)] += WEAK.powi(-2));
        let factor = Cholesky::of(&self.normal)?;
        let solution = factor.solve(&self.right);
        let explained: f64 = (0..p).map(|i| solution[(i, 0)] * self.right[(i, 0)]).sum();
        let variance = ((self.squares - explained) / self.rows.saturating_sub(p).max(1) as f64).max(0.0);
        let inverse = factor.inverse();
        let sign = if self.sense < 0.0 { -1.0 } else { 1.0 };
        let load = |session: usize| {
            let own = self.own(session);
            let sd = |k: usize| (variance * inverse[(own + k, own + k)]).max(0.0).sqrt();
            let mass = sign * solution[(own, 0)];
            let cog: [f64; 3] = std::array::from_fn(|k| sign * solution[(own + 1 + k, 0)] / mass);
            let known = (0..3).all(|k| libm::hypot(sd(1 + k), cog[k] * sd(0)) < KNOWN_COG * mass.abs());
            Load { mass, sd: sd(0), cog: known.then_some(cog) }
        };
        Some((1..self.sessions).map(load).collect())
    }
}

/// Arms of which one body alone weighs: a link (from 0), or behind them the tool; 1 kg at its origin, then 1 m off along x, y and z.
fn unit_loads(robot: &Robot, cell: &Cell, body: usize) -> Result<Vec<Forward>> {
    let (mut robot, mut cell) = (robot.clone(), cell.clone());
    robot.joints.iter_mut().for_each(|j| j.mass = Some(0.0));
    cell.tool.mass = 0.0;
    let places = std::iter::once(nalgebra::Vector3::zeros()).chain((0..3).map(|k| nalgebra::Vector3::ith(k, 1.0)));
    places
        .map(|cog| {
            match robot.joints.get_mut(body) {
                Some(link) => (link.mass, link.cog) = (Some(1.0), cog),
                None => (cell.tool.mass, cell.tool.cog) = (1.0, cog),
            }
            Ok(Forward::new(Model::nominal(robot.clone(), cell.clone()), Vec::new())?)
        })
        .collect()
}

fn difference(a: &Joints, b: &Joints) -> Joints {
    std::array::from_fn(|k| a[k] - b[k])
}
