//! Places where a set of balls, or of printed sockets, stood: unknown poses of one rigid set, identified with the rest.
//!
//! Three balls that are not on one line fix where the arm's base stands: {w} is theirs, at the first place where they stood, and every
//! further place is a motion of the set from there. Two balls, or one, fix no base: {w} is then the base as the cell file has it, and
//! the pose of the set in it is unknown at every place.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Rotation3, Vector3};
use trical_model::pose::angles_zyx;
use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Parameter, Pose, Site, State, Term, Workspace,
};

use crate::dataset::{Dataset, Observation};
use crate::fit::priors::PriorKnowledge;
use crate::rigid::{median_point, robust_rigid_from_points};

/// What is usual of an arm before it is measured: standard deviations of lengths (m), of twists and of joint zeros (rad), of compliance
/// (rad/Nm), of each wave of a joint's error over its own angle (rad), and of the distance of printed sockets (m). They decide nothing that the touches can tell; they keep
/// what three or four places leave open where arms usually are.
const LENGTH: f64 = 3e-4;
const TWIST: f64 = 0.1_f64.to_radians();
const ZERO: f64 = 0.3_f64.to_radians();
const SOFT: f64 = 2e-4;
const WAVE: f64 = 0.07_f64.to_radians();
const PRINTED: f64 = 3e-4;

/// Touches of printed sockets are off by much so often that they count linearly beyond so many standard deviations (Huber 1964).
pub(crate) const HUBER: f64 = 0.6;

/// Before the first fit a tool is known to some centimetres, and where the nominal arm has it to some millimetres: standard deviations, m.
const TOOL: f64 = 0.03;
const ARM: f64 = 0.01;

/// Where the set of balls stood in a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BallPlace {
    /// From 1.
    pub session: Option<u32>,
    /// From 1, in the order of the recording; `None` for a recording that names no places.
    pub place: Option<usize>,
}

impl BallPlace {
    /// Of a touch at this pose.
    #[must_use]
    pub fn of(state: &State) -> Self {
        Self { session: state.session, place: state.place.map(|p| p + 1) }
    }

    /// 1 there, 0 elsewhere.
    fn basis(self) -> Basis {
        Basis { session: self.session, ..Basis::CONSTANT }.at_place(self.place)
    }
}

/// The place at which an observation touched a ball.
#[must_use]
pub fn place_of(o: &Observation) -> Option<BallPlace> {
    matches!(o.measured, Measured::Touch { .. }).then(|| BallPlace::of(&o.state))
}

/// Places at which balls were touched, in the order of the data.
#[must_use]
pub fn ball_places(data: &Dataset) -> Vec<BallPlace> {
    let mut seen = BTreeSet::new();
    data.observations.iter().filter_map(place_of).filter(|p| seen.insert(*p)).collect()
}

/// Balls (0-based) that were touched where `pick` says so.
pub(crate) fn touched(data: &Dataset, pick: impl Fn(BallPlace) -> bool) -> BTreeSet<usize> {
    let ball = |o: &Observation| match o.measured {
        Measured::Touch { ball, .. } if pick(BallPlace::of(&o.state)) => Some(ball),
        _ => None,
    };
    data.observations.iter().filter_map(ball).collect()
}

/// Whether {w} is that of the balls where they were first touched: three of them, not on one line, fix the base.
#[must_use]
pub fn base_is_fixed(cell: &Cell, data: &Dataset) -> bool {
    ball_places(data).first().is_some_and(|first| {
        let touched = touched(data, |p| p == *first);
        cell.balls_fix_base(|ball| touched.contains(&ball))
    })
}

/// Places at which the pose of the balls is to be identified, whatever sessions share.
#[must_use]
pub fn unknown_places(cell: &Cell, data: &Dataset) -> Vec<BallPlace> {
    let all = ball_places(data);
    if base_is_fixed(cell, data) { all.into_iter().skip(1).filter(|p| p.place.is_some()).collect() } else { all }
}

/// One pose in so many identifies what belongs to a session; the others are scored. Of a place of balls or sockets every second one.
const EVERY: usize = 4;
const EVERY_AT_PLACE: usize = 2;

/// Poses that identify what belongs to a session: every fourth of each recording. A ball or target that none of these measured adds every fourth of
/// its own poses. Where balls are `placed` anew, it is every second of the touches of each ball at each place.
pub(crate) fn training_poses(data: &Dataset, placed: bool) -> BTreeSet<usize> {
    let mut counted = BTreeMap::new();
    let mut last = None;
    let mut out = BTreeSet::new();
    for o in data.observations.iter() {
        if last == Some(o.pose) {
            continue;
        }
        last = Some(o.pose);
        let at = match o.measured {
            Measured::Touch { ball, .. } if placed => Some((BallPlace::of(&o.state), ball)),
            _ => None,
        };
        let count = counted.entry((o.recording, at)).or_insert(0_usize);
        if *count % if at.is_some() { EVERY_AT_PLACE } else { EVERY } == 0 {
            out.insert(o.pose);
        }
        *count += 1;
    }
    let what = |o: &Observation| match o.measured {
        Measured::Touch { ball, .. } => (o.recording, Some(ball)),
        Measured::Point { target, .. } => (o.recording, Some(target)),
        _ => (o.recording, None),
    };
    let has: BTreeSet<_> = data.observations.iter().filter(|o| out.contains(&o.pose)).map(what).collect();
    let mut others = BTreeMap::new();
    for o in data.observations.iter().filter(|o| !has.contains(&what(o))) {
        let count = others.entry(what(o)).or_insert(0_usize);
        if *count % EVERY == 0 {
            out.insert(o.pose);
        }
        *count += 1;
    }
    out
}

/// Name of a place as its recording has it, for people.
#[must_use]
pub fn name(data: &Dataset, place: BallPlace) -> String {
    let session = place.session.unwrap_or(1) as usize;
    let recording =
        data.observations.iter().find(|o| o.state.session == place.session).map_or(session - 1, |o| o.recording);
    let named = place.place.and_then(|p| data.places.get(recording)?.get(p - 1));
    match (named, data.names.len()) {
        (Some(named), 0 | 1) => named.clone(),
        (Some(named), _) => format!("{named} of {}", data.names[recording]),
        (None, _) if data.places.get(recording).is_some_and(|p| !p.is_empty()) => "(no name)".into(),
        (None, _) => data.names.get(recording).cloned().unwrap_or_default(),
    }
}

/// Motions of the set that touches of these balls tell: of one only where it is, of balls along x not a rotation about x.
fn motions(cell: &Cell, touched: &BTreeSet<usize>) -> Vec<Motion> {
    let balls: Vec<&Vector3<f64>> = touched.iter().filter_map(|b| cell.balls.get(*b)).collect();
    let along_x = balls.iter().all(|b| libm::hypot(b.y, b.z) < 1e-6);
    let told = |m: &Motion| match m {
        Motion::Along(_) => true,
        Motion::About(Axis::X) => balls.len() > 1 && !along_x,
        Motion::About(_) => balls.len() > 1,
    };
    Motion::ALL.into_iter().filter(told).collect()
}

/// Motions of the set that touches in a session tell.
pub(crate) fn motions_in(cell: &Cell, data: &Dataset, session: u32) -> Vec<Motion> {
    let touched = touched(data, |p| p.session == Some(session));
    if touched.is_empty() { Vec::new() } else { motions(cell, &touched) }
}

/// Terms of the set's pose at a place: its motion in {w} from where the cell file has it.
#[must_use]
pub fn terms(cell: &Cell, data: &Dataset, place: BallPlace) -> Vec<Term> {
    let session = place.session.filter(|s| *s > 1).map_or_else(String::new, |s| format!("_s{s}"));
    let number = place.place.map_or_else(String::new, |p| p.to_string());
    let name = |m: &Motion| format!("place{number}_{}{session}", m.name());
    let touched = touched(data, |p| p == place);
    let mut out: Vec<Term> =
        motions(cell, &touched).iter().map(|m| Term::new(name(m), "place", Site::Fixture(*m), place.basis())).collect();
    // what two sockets are apart by the arm, beside what they should be
    let both: Vec<usize> = touched.iter().copied().collect();
    if let (2, [first, second]) = (cell.balls.len(), &both[..])
        && let (first, second) = (*first, *second)
        && (cell.balls[second] - cell.balls[first]).cross(&Vector3::x()).norm() < 1e-6
    {
        let site = Site::Ball { ball: second + 1, axis: Axis::X };
        out.push(Term::new(format!("place{number}_distance{session}"), "place", site, place.basis()));
    }
    out
}

/// What is usual of each of the model's terms, in their order, where places are unknown and so few that touches may leave something open.
/// Empty where no place is unknown.
pub(crate) fn usual(model: &Model, data: &Dataset) -> Vec<PriorKnowledge> {
    if unknown_places(&model.cell, data).is_empty() {
        return Vec::new();
    }
    let sd = |t: &Term| match (t.site, t.effect.as_str()) {
        (Site::Link { parameter: Parameter::A | Parameter::D, .. }, "geometry") => Some(LENGTH),
        (Site::Link { parameter: Parameter::Alpha | Parameter::Beta, .. }, "geometry") => Some(TWIST),
        (Site::Link { parameter: Parameter::Theta, .. }, "geometry") => Some(ZERO),
        (_, "compliance") => Some(SOFT),
        (_, "joint_harmonic") => Some(WAVE),
        (Site::Ball { .. }, "place") => Some(PRINTED),
        _ => None,
    };
    model.terms.iter().map(|t| sd(t).map_or(PriorKnowledge::NOTHING, PriorKnowledge::about_zero)).collect()
}

/// Touches at one place, as closed forms see them.
struct Touched {
    at: BallPlace,
    ball: usize,
    base_from_flange: Pose,
    /// From the TCP to the ball, in flange axes.
    offset: Vector3<f64>,
}

/// Touches of those balls whose place the model has terms for.
fn touches(model: &Model, data: &Dataset, forward: &Forward, ws: &mut Workspace) -> Vec<Touched> {
    let free: BTreeSet<BallPlace> = of_model(model).into_iter().collect();
    let one = |o: &Observation| {
        let Measured::Touch { ball, reading } = o.measured else { return None };
        let at = BallPlace::of(&o.state);
        let own = [at, BallPlace { place: None, ..at }];
        let at = own.into_iter().find(|p| free.contains(p))?;
        let offset = model.cell.tool.rotation * Vector3::from(reading);
        Some(Touched { at, ball, base_from_flange: forward.world_from_flange(&o.state, ws), offset })
    };
    data.observations.iter().filter_map(one).collect()
}

/// Places for which the model has terms.
pub(crate) fn of_model(model: &Model) -> Vec<BallPlace> {
    let of = |t: &Term| {
        let local = matches!(t.site, Site::Fixture(_)) && t.basis.is_local();
        local.then_some(BallPlace { session: t.basis.session, place: t.basis.place })
    };
    let mut seen = BTreeSet::new();
    model.terms.iter().filter_map(of).filter(|p| seen.insert(*p)).collect()
}

/// The tool's point in the flange, m, that brings touches of the same ball at the same place nearest to each other, beside what the
/// cell file says of it: pivot calibration, linear in the point. `plain` is the arm without places and tool.
pub(crate) fn tool_by_pivoting(model: &Model, data: &Dataset, plain: &Forward, nominal: &Vector3<f64>) -> Vector3<f64> {
    let mut ws = plain.workspace();
    let touches = touches(model, data, plain, &mut ws);
    let mut normal = Matrix3::identity() * (ARM / TOOL).powi(2);
    let mut right = Vector3::zeros();
    for (_, group) in groups(&touches) {
        let n = group.len() as f64;
        let point = |t: &Touched| t.base_from_flange.apply(&(nominal + t.offset));
        let rotation = group.iter().map(|t| t.base_from_flange.rotation).sum::<Matrix3<f64>>() / n;
        let middle = group.iter().map(|t| point(t)).sum::<Vector3<f64>>() / n;
        for t in group {
            let turned = t.base_from_flange.rotation - rotation;
            normal += turned.transpose() * turned;
            right -= turned.transpose() * (point(t) - middle);
        }
    }
    normal.try_inverse().map_or(*nominal, |inverse| nominal + inverse * right)
}

/// Touches of one ball at one place, each group.
fn groups(touches: &[Touched]) -> BTreeMap<(BallPlace, usize), Vec<&Touched>> {
    let mut out = BTreeMap::new();
    for t in touches {
        out.entry((t.at, t.ball)).or_insert_with(Vec::new).push(t);
    }
    out
}

/// Where the set of balls stood at each place for which the model has terms: its motion in {w}. `plain` is the arm on its base,
/// `tcp_of` a session's TCP in the flange.
pub(crate) fn poses(
    model: &Model,
    data: &Dataset,
    plain: &Forward,
    tcp_of: &dyn Fn(Option<u32>) -> Vector3<f64>,
) -> Vec<(BallPlace, Pose)> {
    let mut ws = plain.workspace();
    let touches = touches(model, data, plain, &mut ws);
    let groups = groups(&touches);
    of_model(model)
        .into_iter()
        .map(|place| {
            let at = |t: &Touched| t.base_from_flange.apply(&(tcp_of(place.session) + t.offset));
            let own = groups.iter().filter(|((p, _), _)| *p == place);
            let balls: Vec<(Vector3<f64>, Vector3<f64>)> = own
                .clone()
                .filter_map(|((_, ball), group)| {
                    let points: Vec<Vector3<f64>> = group.iter().map(|t| at(t)).collect();
                    let middle = median_point(&points);
                    Some((middle, *model.cell.balls.get(*ball)?))
                })
                .collect();
            let pairs = own.flat_map(|((_, ball), group)| {
                group.iter().filter_map(|t| Some((at(t), *model.cell.balls.get(*ball)?)))
            });
            let all: Vec<_> = pairs.collect();
            (place, robust_rigid_from_points(&all).filter(|_| balls.len() > 2).unwrap_or_else(|| on_a_line(&balls)))
        })
        .collect()
}

/// A pose that brings points on one line (the second of each pair) to where they were found.
fn on_a_line(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Pose {
    let Some(((found, ball), rest)) = pairs.split_first() else { return Pose::identity() };
    let far = rest.iter().max_by(|a, b| (a.1 - ball).norm().total_cmp(&(b.1 - ball).norm()));
    let turn = far.and_then(|(f, b)| Rotation3::rotation_between(&(b - ball), &(f - found)));
    let rotation = turn.map_or_else(Matrix3::identity, |r| *r.matrix());
    Pose { rotation, translation: found - rotation * ball }
}

/// Value of a term of [`terms`] for the set's `pose`.
pub(crate) fn value(pose: &Pose, motion: Motion) -> f64 {
    match motion {
        Motion::Along(a) => pose.translation[a.index()],
        Motion::About(a) => angles_zyx(&pose.rotation)[2 - a.index()],
    }
}
