//! The initial guess of a fit: base, measuring frames and tool points in closed form from nominal kinematics. The user need not guess.

use nalgebra::{Matrix3, Vector3};
use trical_model::pose::{angles_zyx, rotation_from_quaternion};
use trical_model::{Cell, Forward, Measured, Model, Motion, Pose, Scope, Site, Term};

use crate::dataset::{Dataset, Observation};
use crate::error::{IdentError, Result};
use crate::fit::ball_places::{self, BallPlace};
use crate::fit::trilateration::{Length, base_from_anchors, trilaterate};
use crate::rigid::{median, median_point, nearest_rotation, robust_rigid_from_points};

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

/// Turns of that at most.
const TURNS: usize = 30;

/// Sets `model.frames`, the base (a term at [`Site::Base`], if there is one) and tool points from the data, by the nominal arm.
///
/// # Errors
/// Too few measurements, or all of them at one place or on one line.
pub fn initial_guess(model: &mut Model, data: &Dataset) -> Result<()> {
    guess(model, data, Vec::new())
}

/// A start for sessions that a fitted model does not know: by its own arm, and only of the terms `own`, which are to be identified there. What the model
/// knows stays as it is.
///
/// # Errors
/// As [`initial_guess`].
pub(crate) fn initial_guess_of_sessions(model: &mut Model, data: &Dataset, own: &[usize]) -> Result<()> {
    let mut new = model.clone();
    let arm = model.terms.iter().filter(|t| t.scope() == Scope::Arm).cloned().collect();
    guess(&mut new, data, arm)?;
    let of_frame = |t: &Term| if let Site::Frame { frame, .. } = t.site { Some(frame - 1) } else { None };
    let is_new = |f: usize| own.iter().any(|k| of_frame(&model.terms[*k]) == Some(f));
    let seen = |f: usize| is_new(f) && data.observations.iter().any(|o| o.frame == f && o.measured.is_framed());
    let seen: Vec<bool> = (0..model.frames.len()).map(seen).collect();
    for ((to, from), _) in model.frames.iter_mut().zip(&new.frames).zip(&seen).filter(|(_, seen)| **seen) {
        *to = *from;
    }
    let here = |session: Option<u32>| session.is_some() && data.observations.iter().any(|o| o.state.session == session);
    for k in own {
        let (to, from) = (&mut model.terms[*k], &new.terms[*k]);
        if of_frame(to).is_some_and(|f| seen[f]) && to.basis.is_constant() {
            to.value = 0.0;
        } else if here(to.basis.session) && to.scope() == Scope::Setup {
            to.value = from.value;
        }
    }
    Ok(())
}

fn guess(model: &mut Model, data: &Dataset, arm: Vec<Term>) -> Result<()> {
    let mut plain = Model::nominal(model.robot.clone(), model.cell.without_geometry());
    plain.cell.world_from_base = Pose::identity();
    plain.terms = arm;
    let forward = Forward::new(plain.clone(), Vec::new())?;
    let own_tools = own_tools(model);
    let tool_of = |session: Option<u32>| own_tools.iter().position(|own| session == Some(*own)).map_or(0, |k| k + 1);
    let sights = sights(model, data, &forward, &tool_of);
    let lengths = lengths(model, data, &forward);
    let still = model.rigid()?.cell;
    let shared: Vec<Vector3<f64>> = std::iter::once(still.tool.tcp).chain(still.tool.targets.clone()).collect();
    // of every tool
    let mut points = vec![shared; own_tools.len() + 1];
    if sights.is_empty() && !ball_places::of_model(model).is_empty() {
        let tcp = ball_places::tool_by_pivoting(model, data, &forward, &points[0][0]);
        points.iter_mut().for_each(|of| of[0] = tcp);
    }
    let frames = frames_and_points(&sights, data, &mut points, &still.tool.rotation)?;
    let turned = |tool| tool_rotation(&sights, &frames, tool).unwrap_or(still.tool.rotation);
    let rotations: Vec<Matrix3<f64>> = (0..points.len()).map(turned).collect();
    let mut world_from_base = still.world_from_base;
    if sights.iter().any(|s| s.frame.is_none()) {
        world_from_base = frames[data.frames()].unwrap_or(world_from_base);
    } else if !lengths.is_empty() {
        (points[0][0], world_from_base) = tool_and_base_by_lengths(model, data, &lengths, &points[0][0])?;
    }
    model.frames = (0..data.frames())
        .map(|f| {
            frames[f].map_or_else(Pose::identity, |frame_from_base| frame_from_base.compose(&world_from_base.inverse()))
        })
        .collect();
    let tcp_of = |session: Option<u32>| points[tool_of(session)][0];
    let on_base = Model { cell: Cell { world_from_base, ..plain.cell.clone() }, ..plain };
    let balls = ball_places::poses(model, data, &Forward::new(on_base, Vec::new())?, &tcp_of);
    let found = Found { world_from_base, points, rotations, balls };
    let nominal = model.cell.clone();
    for term in &mut model.terms {
        match term.basis.session {
            Some(session) => found.beside_shared(term, session, &nominal, tool_of(Some(session))),
            None if term.basis.is_constant() => found.shared(term, &nominal),
            None => {}
        }
    }
    Ok(())
}

/// Touches, points and poses as the closed forms see them; without touches of balls that stand where is not known: their place is found from
/// the base, once that is known.
fn sights(model: &Model, data: &Dataset, forward: &Forward, tool_of: &dyn Fn(Option<u32>) -> usize) -> Vec<Sight> {
    let mut ws = forward.workspace();
    let own_balls = ball_places::of_model(model);
    let stands_elsewhere = |o: &Observation| {
        let at = BallPlace::of(&o.state);
        own_balls.contains(&at) || own_balls.contains(&BallPlace { place: None, ..at })
    };
    let sight = |o: &Observation| {
        let zero = Vector3::zeros();
        let (point, tool_point, offset, orientation, frame) = match o.measured {
            Measured::Touch { .. } if stands_elsewhere(o) => return None,
            Measured::Touch { ball, reading } => {
                (*model.cell.balls.get(ball)?, 0, model.cell.tool.rotation * Vector3::from(reading), None, None)
            }
            Measured::Point { target, position } => (Vector3::from(position), target + 1, zero, None, Some(o.frame)),
            Measured::Pose { position, quaternion } => {
                (Vector3::from(position), 0, zero, Some(rotation_from_quaternion(quaternion)), Some(o.frame))
            }
            _ => return None,
        };
        let (base_from_flange, tool) = (forward.world_from_flange(&o.state, &mut ws), tool_of(o.state.session));
        Some(Sight { base_from_flange, point, tool, tool_point, offset, orientation, frame })
    };
    data.observations.iter().filter_map(sight).collect()
}

/// Lengths from anchors.
fn lengths(model: &Model, data: &Dataset, forward: &Forward) -> Vec<Length> {
    let mut ws = forward.workspace();
    let length = |o: &Observation| match o.measured {
        Measured::Distance { anchor, length } if anchor < model.cell.anchors.len() => {
            Some(Length { base_from_flange: forward.world_from_flange(&o.state, &mut ws), anchor, length })
        }
        _ => None,
    };
    data.observations.iter().filter_map(length).collect()
}

/// Each measuring frame, and behind them {w}, from the base, in turn with the points of each tool.
fn frames_and_points(
    sights: &[Sight],
    data: &Dataset,
    points: &mut [Vec<Vector3<f64>>],
    tool: &Matrix3<f64>,
) -> Result<Vec<Option<Pose>>> {
    let mut frames: Vec<Option<Pose>> = vec![None; data.frames() + 1];
    let slot = |s: &Sight| s.frame.unwrap_or(data.frames());
    for _ in 0..TURNS {
        for (f, frame) in frames.iter_mut().enumerate() {
            let pairs: Vec<_> = sights
                .iter()
                .filter(|s| slot(s) == f)
                .map(|s| (s.point, s.base_from_flange.apply(&(points[s.tool][s.tool_point] + s.offset))))
                .collect();
            if pairs.is_empty() {
                continue;
            }
            let here = sights.iter().filter(|s| slot(s) == f);
            let found = robust_rigid_from_points(&pairs).or_else(|| frame_by_directions(here, &pairs, tool));
            *frame = Some(found.ok_or_else(|| no_frame(data, pairs.len()))?);
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
                let found = median_point(&in_flange);
                moved = moved.max((found - *point).norm());
                *point = found;
            }
        }
        if moved < SETTLED {
            break;
        }
    }
    Ok(frames)
}

/// A frame from the base where the points are too few or on one line: turned as the poses say if the tool sits on the
/// flange as `tool` does. `None` where no pose was measured.
fn frame_by_directions<'a>(
    sights: impl Iterator<Item = &'a Sight>,
    pairs: &[(Vector3<f64>, Vector3<f64>)],
    tool: &Matrix3<f64>,
) -> Option<Pose> {
    let turned = |s: &Sight| Some(s.orientation? * (s.base_from_flange.rotation * tool).transpose());
    let all: Vec<Matrix3<f64>> = sights.filter_map(turned).collect();
    let sum = all.iter().sum::<Matrix3<f64>>();
    let rotation = nearest_rotation(&sum);
    let translation = median_point(&pairs.iter().map(|(seen, in_base)| seen - rotation * in_base).collect::<Vec<_>>());
    (!all.is_empty()).then_some(Pose { rotation, translation })
}

fn no_frame(data: &Dataset, points: usize) -> IdentError {
    let do_not = if points == 1 { "1 measured point does not" } else { &format!("{points} measured points do not") };
    let fitted = data.used_poses().len();
    let of = if fitted < data.poses {
        format!(" (fitted: {fitted} of its {} poses, the others are scored)", data.poses)
    } else {
        String::new()
    };
    IdentError::NotEnough(format!(
        "{}: {do_not} fix a frame{of}; at least three that are not on one line, or a full pose, are needed",
        data.names.join(", ")
    ))
}

/// How a tool is turned on the flange, by poses; `None` where none was measured.
fn tool_rotation(sights: &[Sight], frames: &[Option<Pose>], tool: usize) -> Option<Matrix3<f64>> {
    let of = |s: &Sight| {
        let frame = frames[s.frame.unwrap_or(frames.len() - 1)]?;
        Some(s.base_from_flange.rotation.transpose() * frame.rotation.transpose() * s.orientation?)
    };
    let all: Vec<Matrix3<f64>> = sights.iter().filter(|s| s.tool == tool).filter_map(of).collect();
    let middle = |i, j| median(&all.iter().map(|r| r[(i, j)]).collect::<Vec<_>>());
    (!all.is_empty()).then(|| nearest_rotation(&Matrix3::from_fn(middle)))
}

/// The TCP in the flange and {w} from the base, by lengths from anchors.
fn tool_and_base_by_lengths(
    model: &Model,
    data: &Dataset,
    lengths: &[Length],
    tcp: &Vector3<f64>,
) -> Result<(Vector3<f64>, Pose)> {
    let found = trilaterate(lengths, tcp).ok_or_else(|| {
        IdentError::NotEnough(format!(
            "{}: {} lengths do not fix their anchors: at least four from each are needed, not all from places in one plane",
            data.names.join(", "),
            lengths.len()
        ))
    })?;
    let both = model.cell.anchors.iter().zip(&found.anchor_in_base);
    let pairs: Vec<_> = both.filter_map(|(in_world, in_base)| Some((*in_world, (*in_base)?))).collect();
    Ok((found.tcp_in_flange, base_from_anchors(&pairs, &model.cell.world_from_base)))
}

/// What the closed forms came to.
struct Found {
    world_from_base: Pose,
    /// Points and rotation of every tool in the flange, the shared one first.
    points: Vec<Vec<Vector3<f64>>>,
    rotations: Vec<Matrix3<f64>>,
    /// Where sets of balls stand.
    balls: Vec<(BallPlace, Pose)>,
}

impl Found {
    /// Sets a term that all sessions share: what is found less what is nominal.
    fn shared(&self, term: &mut Term, nominal: &Cell) {
        let turn = |found: &Matrix3<f64>, nominal: &Matrix3<f64>| angles_zyx(&(found * nominal.transpose()));
        let base = &nominal.world_from_base;
        match term.site {
            Site::Base(Motion::Along(a)) => {
                term.value = (self.world_from_base.translation - base.translation)[a.index()];
            }
            Site::Base(Motion::About(a)) => {
                term.value = turn(&self.world_from_base.rotation, &base.rotation)[2 - a.index()];
            }
            Site::Tool(Motion::Along(a)) => term.value = (self.points[0][0] - nominal.tool.tcp)[a.index()],
            Site::Tool(Motion::About(a)) => {
                term.value = turn(&self.rotations[0], &nominal.tool.rotation)[2 - a.index()];
            }
            Site::Target { target, axis } => {
                term.value = (self.points[0][target] - nominal.tool.targets[target - 1])[axis.index()];
            }
            _ => {}
        }
    }

    /// Sets a term of one session, whose tool it is: beside what is shared.
    fn beside_shared(&self, term: &mut Term, session: u32, nominal: &Cell, tool: usize) {
        let (own, shared) = (&self.points[tool], &self.points[0]);
        let turn = |tool: usize| angles_zyx(&(self.rotations[tool] * nominal.tool.rotation.transpose()));
        match term.site {
            Site::Tool(Motion::Along(a)) => term.value = (own[0] - shared[0])[a.index()],
            Site::Tool(Motion::About(a)) => term.value = turn(tool)[2 - a.index()] - turn(0)[2 - a.index()],
            Site::Target { target, axis } => term.value = (own[target] - shared[target])[axis.index()],
            Site::Fixture(m) => {
                let own = BallPlace { session: Some(session), place: term.basis.place };
                let pose = self.balls.iter().find(|(at, _)| *at == own).map(|(_, pose)| pose);
                term.value = pose.map_or(0.0, |pose| ball_places::value(pose, m));
            }
            _ => {}
        }
    }
}

/// Sessions with a tool of their own.
fn own_tools(model: &Model) -> Vec<u32> {
    let tools = model.terms.iter().filter(|t| matches!(t.site, Site::Tool(_) | Site::Target { .. }));
    let mut own: Vec<u32> = tools.filter_map(|t| t.basis.session).collect();
    own.sort_unstable();
    own.dedup();
    own
}
