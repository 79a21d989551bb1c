//! Where a fit starts: base, measuring frames and tool points in closed form from nominal kinematics. No guess is needed.

use nalgebra::{Matrix3, Vector3};
use trical_model::pose::{angles_zyx, rotation_from_quaternion};
use trical_model::{Forward, Measured, Model, Motion, Pose, Site};

use crate::dataset::Dataset;
use crate::error::{IdentError, Result};
use crate::rigid::{median, nearest_rotation, robust_rigid_from_points};
use crate::trilateration::{Length, base_from_anchors, trilaterate};

/// One observation as the closed forms see it: the flange by nominal kinematics, and the point that the tool was at.
struct Sight {
    base_from_flange: Pose,
    /// Measured point, in the measuring frame (points, poses) or in {w} (touches).
    point: Vector3<f64>,
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

/// Sets `model.frames`, the base (a term at [`Site::Base`], if there is one) and tool points from the data.
///
/// # Errors
/// Too few measurements, or all of them at one place or on one line.
pub fn start(model: &mut Model, data: &Dataset) -> Result<()> {
    let mut plain = Model::nominal(model.robot.clone(), model.cell.without_geometry());
    plain.cell.world_from_base = Pose::identity();
    let forward = Forward::new(plain, Vec::new())?;
    let mut ws = forward.workspace();
    let sights: Vec<Sight> = data
        .observations
        .iter()
        .filter_map(|o| {
            let base_from_flange = forward.world_from_flange(&o.state, &mut ws);
            let zero = Vector3::zeros();
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
                Measured::Distance { .. } | Measured::Reference { .. } => return None,
            };
            Some(Sight { base_from_flange, point, tool_point, offset, orientation, frame })
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
    let mut points: Vec<Vector3<f64>> =
        std::iter::once(model.cell.tool.tcp).chain(model.cell.tool.targets.clone()).collect();
    let mut tool_rotation = model.cell.tool.rotation;
    let touches = sights.iter().any(|s| s.frame.is_none());
    // the measuring frame, or {w}, from the base
    let mut frames: Vec<Option<Pose>> = vec![None; data.frames() + 1];
    let slot = |s: &Sight| s.frame.unwrap_or(data.frames());
    for _ in 0..30 {
        for (f, frame) in frames.iter_mut().enumerate() {
            let pairs: Vec<_> = sights
                .iter()
                .filter(|s| slot(s) == f)
                .map(|s| (s.point, s.base_from_flange.apply(&(points[s.tool_point] + s.offset))))
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
        for (k, point) in points.iter_mut().enumerate() {
            let in_flange: Vec<Vector3<f64>> = sights
                .iter()
                .filter(|s| s.tool_point == k)
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
    let orientations: Vec<Matrix3<f64>> = sights
        .iter()
        .filter_map(|s| {
            let frame = frames[slot(s)]?;
            Some(s.base_from_flange.rotation.transpose() * frame.rotation.transpose() * s.orientation?)
        })
        .collect();
    if !orientations.is_empty() {
        let m = Matrix3::from_fn(|i, j| median(&orientations.iter().map(|r| r[(i, j)]).collect::<Vec<_>>()));
        tool_rotation = nearest_rotation(&m);
    }
    let mut world_from_base =
        if touches { frames[data.frames()].unwrap_or(model.cell.world_from_base) } else { model.cell.world_from_base };
    if !touches && !lengths.is_empty() {
        let found = trilaterate(&lengths, &points[0]).ok_or_else(|| {
            IdentError::NotEnough(format!(
                "{}: {} lengths do not fix their anchors: at least four from each are needed, not all from places in one plane",
                data.names.join(", "),
                lengths.len()
            ))
        })?;
        points[0] = found.tcp_in_flange;
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
    let tool_turn = angles_zyx(&(tool_rotation * model.cell.tool.rotation.transpose()));
    for term in &mut model.terms {
        if !term.basis.is_constant() {
            continue;
        }
        match term.site {
            Site::Base(Motion::Along(a)) => term.value = base_shift[a.index()],
            Site::Base(Motion::About(a)) => term.value = base_turn[2 - a.index()],
            Site::Tool(Motion::Along(a)) => term.value = (points[0] - model.cell.tool.tcp)[a.index()],
            Site::Tool(Motion::About(a)) => term.value = tool_turn[2 - a.index()],
            Site::Target { target, axis } => {
                term.value = (points[target] - model.cell.tool.targets[target - 1])[axis.index()];
            }
            _ => {}
        }
    }
    Ok(())
}
