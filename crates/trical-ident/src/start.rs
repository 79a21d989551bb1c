//! Where a fit starts: base, measuring frames and tool points in closed form from nominal kinematics. No guess is needed.

use nalgebra::{Matrix3, Vector3};
use trical_model::pose::{angles_zyx, rotation_from_quaternion};
use trical_model::{Cell, Forward, Measured, Model, Motion, Pose, Scope, Site, Term};

use crate::ball_places::{self, BallPlace};
use crate::dataset::Dataset;
use crate::error::{IdentError, Result};
use crate::rigid::{median, nearest_rotation, robust_rigid_from_points};
use crate::trilateration::{Length, base_from_anchors, trilaterate};

/// One observation as the closed forms see it: the flange by nominal kinematics, and the point that the tool was at.
struct Sight {
    base_from_flange: Pose,
    /// Measured point, in the measuring frame (points, poses) or in {w} (touches).
    point: Vector3<f64>,
    /// Which tool: 0 the shared one, k + 1 that of the k-th session with its own.
    tool: usize,
    /// Which of the tool's points: 0 the TCP, 1.. the targets.
    tool_point: usize,
    /// In flange axes, from the tool's point to what was measured (a touch's reading).
    offset: Vector3<f64>,
    orientation: Option<Matrix3<f64>>,
    /// Frame, or `None` for {w}.
    frame: Option<usize>,
}

/// Frames and tool points are found in turn until no point moves further, m: the fit does the rest.
const SETTLED: f64 = 1e-4;

/// Sets `model.frames`, the base (a term at [`Site::Base`], if there is one) and tool points from the data, by the nominal arm.
///
/// # Errors
/// Too few measurements, or all of them at one place or on one line.
pub fn start(model: &mut Model, data: &Dataset) -> Result<()> {
    start_of(model, data, Vec::new())
}

/// The same for sessions that a fitted model does not know: by its own arm, and only what belongs to these sessions.
///
/// # Errors
/// As [`start`].
pub(crate) fn start_sessions(model: &mut Model, data: &Dataset) -> Result<()> {
    let mut new = model.clone();
    let arm = model.terms.iter().filter(|t| t.scope() == Scope::Arm).cloned().collect();
    start_of(&mut new, data, arm)?;
    let seen = |frame: usize| data.observations.iter().any(|o| o.frame == frame && o.measured.is_framed());
    for (f, (to, from)) in model.frames.iter_mut().zip(&new.frames).enumerate() {
        if seen(f) {
            *to = *from;
        }
    }
    let here = |session: Option<u32>| session.is_some() && data.observations.iter().any(|o| o.state.session == session);
    for (to, from) in model.terms.iter_mut().zip(&new.terms) {
        let of_frame = matches!(to.site, Site::Frame { frame, .. } if seen(frame - 1)) && to.basis.is_constant();
        if of_frame {
            to.value = 0.0;
        } else if here(to.basis.session) && to.scope() == Scope::Setup {
            to.value = from.value;
        }
    }
    Ok(())
}

fn start_of(model: &mut Model, data: &Dataset, arm: Vec<Term>) -> Result<()> {
    let mut plain = Model::nominal(model.robot.clone(), model.cell.without_geometry());
    plain.cell.world_from_base = Pose::identity();
    plain.terms = arm;
    let forward = Forward::new(plain.clone(), Vec::new())?;
    let mut ws = forward.workspace();
    let own_tools = own_tools(model);
    let own_balls = ball_places::of_model(model);
    let stands_elsewhere = |o: &crate::dataset::Observation| {
        let at = BallPlace::of(&o.state);
        own_balls.contains(&at) || own_balls.contains(&BallPlace { place: None, ..at })
    };
    let tool_of = |session: Option<u32>| own_tools.iter().position(|own| session == Some(*own)).map_or(0, |k| k + 1);
    let sights: Vec<Sight> = data
        .observations
        .iter()
        .filter_map(|o| {
            let base_from_flange = forward.world_from_flange(&o.state, &mut ws);
            let zero = Vector3::zeros();
            if matches!(o.measured, Measured::Touch { .. }) && stands_elsewhere(o) {
                return None; // where these balls stand is found from the base, once that is known
            }
            let (point, tool_point, offset, orientation, frame) = match o.measured {
                Measured::Touch { ball, reading } => {
                    (*model.cell.balls.get(ball)?, 0, model.cell.tool.rotation * Vector3::from(reading), None, None)
                }
                Measured::Point { target, position } => {
                    (Vector3::from(position), target + 1, zero, None, Some(o.frame))
                }
                Measured::Pose { position, quaternion } => {
                    (Vector3::from(position), 0, zero, Some(rotation_from_quaternion(quaternion)), Some(o.frame))
                }
                _ => return None,
            };
            let tool = tool_of(o.state.session);
            Some(Sight { base_from_flange, point, tool, tool_point, offset, orientation, frame })
        })
        .collect();
    let lengths: Vec<Length> = data
        .observations
        .iter()
        .filter_map(|o| match o.measured {
            Measured::Distance { anchor, length } if anchor < model.cell.anchors.len() => {
                Some(Length { base_from_flange: forward.world_from_flange(&o.state, &mut ws), anchor, length })
            }
            _ => None,
        })
        .collect();
    let still = model.rigid()?.cell;
    let shared: Vec<Vector3<f64>> = std::iter::once(still.tool.tcp).chain(still.tool.targets.clone()).collect();
    // of every tool
    let mut points = vec![shared; own_tools.len() + 1];
    let touches = sights.iter().any(|s| s.frame.is_none());
    if sights.is_empty() && !own_balls.is_empty() {
        let tcp = ball_places::tool_by_pivoting(model, data, &forward, &points[0][0]);
        points.iter_mut().for_each(|of| of[0] = tcp);
    }
    // the measuring frame, or {w}, from the base
    let mut frames: Vec<Option<Pose>> = vec![None; data.frames() + 1];
    let slot = |s: &Sight| s.frame.unwrap_or(data.frames());
    for _ in 0..30 {
        for (f, frame) in frames.iter_mut().enumerate() {
            let pairs: Vec<_> = sights
                .iter()
                .filter(|s| slot(s) == f)
                .map(|s| (s.point, s.base_from_flange.apply(&(points[s.tool][s.tool_point] + s.offset))))
                .collect();
            if pairs.is_empty() {
                continue;
            }
            *frame = Some(robust_rigid_from_points(&pairs).ok_or_else(|| {
                IdentError::NotEnough(format!(
                    "{}: {} measured points do not fix a frame; at least three that are not on one line are needed",
                    data.names.join(", "),
                    pairs.len()
                ))
            })?);
        }
        let mut moved = 0.0_f64;
        let all =
            points.iter_mut().enumerate().flat_map(|(t, of)| of.iter_mut().enumerate().map(move |(k, p)| (t, k, p)));
        for (t, k, point) in all {
            let in_flange: Vec<Vector3<f64>> = sights
                .iter()
                .filter(|s| s.tool == t && s.tool_point == k)
                .filter_map(|s| {
                    let frame = frames[slot(s)]?;
                    let in_base = frame.inverse().apply(&s.point);
                    Some(s.base_from_flange.inverse().apply(&in_base) - s.offset)
                })
                .collect();
            if in_flange.len() >= 3 {
                let found = Vector3::from_fn(|i, _| median(&in_flange.iter().map(|p| p[i]).collect::<Vec<_>>()));
                moved = moved.max((found - *point).norm());
                *point = found;
            }
        }
        if moved < SETTLED {
            break;
        }
    }
    let rotation_of = |tool: usize| {
        let orientations: Vec<Matrix3<f64>> = sights
            .iter()
            .filter(|s| s.tool == tool)
            .filter_map(|s| {
                let frame = frames[slot(s)]?;
                Some(s.base_from_flange.rotation.transpose() * frame.rotation.transpose() * s.orientation?)
            })
            .collect();
        if orientations.is_empty() {
            return still.tool.rotation;
        }
        nearest_rotation(&Matrix3::from_fn(|i, j| median(&orientations.iter().map(|r| r[(i, j)]).collect::<Vec<_>>())))
    };
    let rotations: Vec<Matrix3<f64>> = (0..points.len()).map(rotation_of).collect();
    let mut world_from_base =
        if touches { frames[data.frames()].unwrap_or(still.world_from_base) } else { still.world_from_base };
    if !touches && !lengths.is_empty() {
        let found = trilaterate(&lengths, &points[0][0]).ok_or_else(|| {
            IdentError::NotEnough(format!(
                "{}: {} lengths do not fix their anchors: at least four from each are needed, not all from places in one plane",
                data.names.join(", "),
                lengths.len()
            ))
        })?;
        points[0][0] = found.tcp_in_flange;
        let pairs: Vec<_> = model
            .cell
            .anchors
            .iter()
            .zip(&found.anchor_in_base)
            .filter_map(|(in_world, in_base)| Some((*in_world, (*in_base)?)))
            .collect();
        world_from_base = base_from_anchors(&pairs, &model.cell.world_from_base);
    }
    model.frames = (0..data.frames())
        .map(|f| {
            frames[f].map_or_else(Pose::identity, |frame_from_base| frame_from_base.compose(&world_from_base.inverse()))
        })
        .collect();
    let base_turn = angles_zyx(&(world_from_base.rotation * model.cell.world_from_base.rotation.transpose()));
    let base_shift = world_from_base.translation - model.cell.world_from_base.translation;
    let turns: Vec<[f64; 3]> =
        rotations.iter().map(|r| angles_zyx(&(r * model.cell.tool.rotation.transpose()))).collect();
    let tcp_of = |session: Option<u32>| points[tool_of(session)][0];
    let on_base = Model { cell: Cell { world_from_base, ..plain.cell.clone() }, ..plain };
    let balls = ball_places::poses(model, data, &Forward::new(on_base, Vec::new())?, &tcp_of);
    for term in &mut model.terms {
        if let Some(session) = term.basis.session {
            // beside what is shared
            let tool = tool_of(Some(session));
            match term.site {
                Site::Tool(Motion::Along(a)) => term.value = (points[tool][0] - points[0][0])[a.index()],
                Site::Tool(Motion::About(a)) => term.value = turns[tool][2 - a.index()] - turns[0][2 - a.index()],
                Site::Target { target, axis } => term.value = (points[tool][target] - points[0][target])[axis.index()],
                Site::Fixture(m) => {
                    let own = BallPlace { session: Some(session), place: term.basis.place };
                    let pose = balls.iter().find(|(at, _)| *at == own).map(|(_, pose)| pose);
                    term.value = pose.map_or(0.0, |pose| ball_places::value(pose, m));
                }
                _ => {}
            }
            continue;
        }
        if !term.basis.is_constant() {
            continue;
        }
        match term.site {
            Site::Base(Motion::Along(a)) => term.value = base_shift[a.index()],
            Site::Base(Motion::About(a)) => term.value = base_turn[2 - a.index()],
            Site::Tool(Motion::Along(a)) => term.value = (points[0][0] - model.cell.tool.tcp)[a.index()],
            Site::Tool(Motion::About(a)) => term.value = turns[0][2 - a.index()],
            Site::Target { target, axis } => {
                term.value = (points[0][target] - model.cell.tool.targets[target - 1])[axis.index()];
            }
            _ => {}
        }
    }
    Ok(())
}

/// Sessions with a tool of their own.
fn own_tools(model: &Model) -> Vec<u32> {
    let tools = model.terms.iter().filter(|t| matches!(t.site, Site::Tool(_) | Site::Target { .. }));
    let mut own: Vec<u32> = tools.filter_map(|t| t.basis.session).collect();
    own.sort_unstable();
    own.dedup();
    own
}
