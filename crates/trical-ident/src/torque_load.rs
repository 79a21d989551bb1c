//! What sessions carry, by measured joint torques: no masses of the arm are needed.
//!
//! Gravity torques are linear in the mass and the first moments of each link, so that all of the arm's, shared by the sessions, and those
//! of a further load on the flange in each session but the first follow by least squares (Swevers et al., IEEE Control Systems 2007). Of the
//! arm's own numbers many do the same; weak priors hold those, and the loads do not depend on them.

use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};
use serde::Serialize;
use trical_model::{Cell, Forward, Joints, Model, Robot, State};

use crate::dataset::Dataset;
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
    /// See `mass_kg`.
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
    // four of each link, four of the tool for each further session, a zero of each torque sensor
    let links = 4 * n;
    let p = links + 4 * (sessions - 1) + n;
    let mut bodies = Vec::with_capacity(n + 1);
    for body in 0..=n {
        bodies.push(unit_loads(robot, cell, body)?);
    }
    let mut workspaces: Vec<Vec<_>> = bodies.iter().map(|b| b.iter().map(Forward::workspace).collect()).collect();
    let (mut normal, mut right) = (Mat::<f64>::zeros(p, p), Mat::<f64>::zeros(p, 1));
    let (mut squares, mut rows, mut sense) = (0.0, 0_usize, 0.0);
    let mut columns = vec![[0.0; trical_model::MAX_JOINTS]; links + 4];
    let mut line = vec![0.0; p];
    for o in &data.observations {
        let Some(measured) = o.state.torques else { continue };
        let state = State { payload_kg: None, torques: None, ..o.state };
        for (body, forwards) in bodies.iter().enumerate() {
            let mut torques = [[0.0; trical_model::MAX_JOINTS]; 4];
            for (k, forward) in forwards.iter().enumerate() {
                torques[k] = forward.gravity_torques(&state, &mut workspaces[body][k])?;
            }
            for (k, torque) in torques.iter().enumerate() {
                // a unit mass off the origin is a unit mass at the origin and a first moment
                let at_origin = if k == 0 { [0.0; trical_model::MAX_JOINTS] } else { torques[0] };
                columns[4 * body + k] = difference(torque, &at_origin);
            }
        }
        for joint in 0..n {
            line.fill(0.0);
            (0..links).for_each(|c| line[c] = columns[c][joint]);
            if o.recording > 0 {
                let own = links + 4 * (o.recording - 1);
                (0..4).for_each(|k| line[own + k] = columns[links + k][joint]);
            }
            line[p - n + joint] = 1.0;
            for i in (0..p).filter(|i| line[*i] != 0.0) {
                right[(i, 0)] += line[i] * measured[joint];
                for j in 0..p {
                    normal[(i, j)] += line[i] * line[j];
                }
            }
            squares += measured[joint] * measured[joint];
            rows += 1;
            // torques of an arm of equal links: controllers report what gravity does, or what holds against it
            sense += measured[joint] * (0..n).map(|link| columns[4 * link][joint]).sum::<f64>();
        }
    }
    (0..p).for_each(|i| normal[(i, i)] += WEAK.powi(-2));
    let Ok(llt) = Llt::new(normal.as_ref(), Side::Lower) else { return Ok(Vec::new()) };
    let solution = llt.solve(&right);
    let explained: f64 = (0..p).map(|i| solution[(i, 0)] * right[(i, 0)]).sum();
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let variance = ((squares - explained) / rows.saturating_sub(p).max(1) as f64).max(0.0);
    let inverse = llt.solve(Mat::<f64>::identity(p, p));
    let sign = if sense < 0.0 { -1.0 } else { 1.0 };
    let load = |session: usize| {
        let own = links + 4 * (session - 1);
        let sd = |k: usize| (variance * inverse[(own + k, own + k)]).max(0.0).sqrt();
        let mass = sign * solution[(own, 0)];
        let cog: [f64; 3] = std::array::from_fn(|k| sign * solution[(own + 1 + k, 0)] / mass);
        let known = (0..3).all(|k| sd(1 + k).hypot(cog[k] * sd(0)) < KNOWN_COG * mass.abs());
        TorqueLoad {
            recording: data.names[session].clone(),
            beside: data.names[0].clone(),
            mass_kg: mass,
            sd_kg: sd(0),
            cog_mm: known.then(|| cog.map(|c| c * 1e3)),
        }
    };
    Ok((1..sessions).map(load).collect())
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
