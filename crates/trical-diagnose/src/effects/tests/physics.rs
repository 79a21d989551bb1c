//! Every effect against plain kinematics: the tool is moved by hand as docs/effects.md says, and the terms of the effect's candidates must
//! move it as far.

use std::collections::BTreeSet;

use nalgebra::{Rotation3, Vector3};
use trical_ident::dataset::Observation;
use trical_ident::{Dataset, JointSource};
use trical_model::pose::{rotation_x, rotation_y, rotation_z, rotation_zyx};
use trical_model::{
    Axis, Basis, Forward, GRAVITY, JointKind, Joints, MAX_JOINTS, Measured, Model, Place, Pose, Recording, Row, Shape,
    Site, State, Term, Variable,
};

use super::super::{Family, ripple};
use crate::candidate::Candidate;
use crate::covariates::Covariates;
use crate::effect_id::EffectId;
use crate::test_data::arm;

type V3 = Vector3<f64>;

/// A gear whose ripple is tried, cycles per turn.
const GEAR: f64 = 100.0;
/// How far every joint gives way where the load is what is wrong, rad/Nm.
const COMPLIANCE: f64 = 1e-4;

/// The arm at one row of a recording, to be changed by hand, once.
#[derive(Clone)]
struct Scene {
    model: Model,
    /// As recorded.
    state: State,
    measured: Measured,
    /// From 0.
    frame: usize,
    frame_from_world: Pose,
    /// Where the joints really stand.
    q: Joints,
    compliance: f64,
    gravity: V3,
    /// On the flange: kg, and kg m in its axes.
    load: (f64, V3),
    /// Tilt of a joint's bearing about a point of its axis: the joint, the share of the way from origin to foot, and the
    /// rotation vector in the bearing's axes.
    tilt: Option<(usize, f64, V3)>,
    /// In the axes of the device, m.
    reading: V3,
}

impl Scene {
    /// The place where each joint's axis begins, in the axes of its bearing, and the frame that the joint moves.
    fn chain(&self, q: &Joints) -> Vec<(Pose, Pose)> {
        let mut at = self.model.cell.world_from_base;
        let joints = self.model.robot.joints.iter().zip(q).enumerate();
        let frames = joints.map(|(i, (j, q))| {
            let a = V3::new(j.a, 0.0, 0.0);
            let foot = at.compose(&Pose { rotation: rotation_x(j.alpha) * rotation_y(j.beta), translation: a });
            let (turn, slide) = if j.kind == JointKind::Revolute { (*q, 0.0) } else { (0.0, *q) };
            let rotation = rotation_z(j.theta_offset + turn);
            at = foot.compose(&Pose { rotation, translation: V3::new(0.0, 0.0, j.d + slide) });
            if let Some((joint, share, vector)) = self.tilt
                && joint == i + 1
            {
                let about = at.translation.lerp(&foot.translation, share);
                let tilt = Rotation3::new(foot.rotation * vector).into_inner();
                at = Pose { rotation: tilt * at.rotation, translation: about + tilt * (at.translation - about) };
            }
            (foot, at)
        });
        frames.collect()
    }

    /// Moment of gravity on all that a joint carries about a point of its axis, in the axes of its bearing, and the force.
    fn moment_and_force(&self, joint: usize, share: f64) -> (V3, V3) {
        let chain = self.chain(&self.state.q);
        let (foot, at) = &chain[joint - 1];
        let about = at.translation.lerp(&foot.translation, share);
        let flange = &chain[chain.len() - 1].1;
        let mut mass = self.load.0;
        let mut first = (flange.translation - about) * self.load.0 + flange.rotation * self.load.1;
        for (j, (_, frame)) in self.model.robot.joints.iter().zip(&chain).skip(joint - 1) {
            mass += j.mass.unwrap_or(0.0);
            first += (frame.apply(&j.cog) - about) * j.mass.unwrap_or(0.0);
        }
        let bearing = foot.rotation.transpose();
        (bearing * first.cross(&self.gravity), bearing * self.gravity * mass)
    }

    fn torque(&self, joint: usize) -> f64 {
        let (moment, force) = self.moment_and_force(joint, 0.0);
        if self.model.robot.slides(joint) { force.z } else { moment.z }
    }

    /// Where the tip is: from the ball's centre in {w} for touches, else in the measuring frame.
    fn tip(&self) -> V3 {
        let mut q = self.q;
        for joint in (1..=self.model.robot.dof()).filter(|_| self.compliance > 0.0) {
            q[joint - 1] += self.compliance * self.torque(joint);
        }
        let chain = self.chain(&q);
        let tip = chain[chain.len() - 1].1.apply(&(self.model.cell.tool.tcp + self.reading));
        match self.measured {
            Measured::Touch { ball, .. } => tip - self.model.cell.balls[ball],
            _ => self.frame_from_world.apply(&tip),
        }
    }

    /// What tells earlier from later.
    fn when(&self) -> f64 {
        self.state.t.or(self.state.seq).unwrap()
    }

    /// 1 from a moment on.
    fn after(&self, at: f64) -> f64 {
        f64::from(u8::from(self.when() > at))
    }

    fn sense(&self, joint: usize) -> f64 {
        f64::from(self.state.dir.unwrap()[joint - 1])
    }

    /// Commanded minus read.
    fn lag(&self, joint: usize) -> f64 {
        self.state.q_commanded.unwrap()[joint - 1] - self.state.q[joint - 1]
    }

    fn warmth(&self, clock: &Basis) -> f64 {
        match (clock.of, clock.shape) {
            (Variable::Temperature { reference_c }, _) => self.state.temp_c.unwrap() - reference_c,
            (_, Shape::WarmUp { constant }) => 1.0 - (-self.when() / constant).exp(),
            other => panic!("{other:?}"),
        }
    }
}

/// What a coefficient does to the scene, and how its name ends.
type Change = (String, Box<dyn Fn(&mut Scene, f64)>);
type Expected = (Place, Vec<Change>);

const AXES: [(usize, &str); 3] = [(0, "x"), (1, "y"), (2, "z")];

fn change(name: impl ToString, does: impl Fn(&mut Scene, f64) + 'static) -> Change {
    (name.to_string(), Box::new(does))
}

/// A joint moves by the coefficient times this.
fn turn(joint: usize, by: impl Fn(&Scene) -> f64 + 'static) -> Change {
    change(joint, move |s, k| s.q[joint - 1] += k * by(s))
}

/// The same as all that a candidate does.
fn turns(joint: usize, by: impl Fn(&Scene) -> f64 + 'static) -> Expected {
    (Place::Joint(joint), vec![turn(joint, by)])
}

/// Sine and cosine of n times a joint's angle.
fn waves(joint: usize, n: f64) -> Vec<Change> {
    let wave = |of: fn(f64) -> f64| turn(joint, move |s| of(n * s.state.q[joint - 1]));
    vec![wave(f64::sin), wave(f64::cos)]
}

/// A bearing tilts by the coefficient times this vector, about a point at a share of the way from origin to foot.
fn tilt(name: impl ToString, joint: usize, share: f64, by: impl Fn(&Scene) -> V3 + 'static) -> Change {
    change(name, move |s, k| s.tilt = Some((joint, share, k * by(s))))
}

/// Something moves along x, y and z by the coefficient times `by`.
fn along(what: fn(&mut Scene) -> &mut V3, by: impl Fn(&Scene) -> f64 + Copy + 'static) -> Vec<Change> {
    let of = |(axis, name)| {
        change(name, move |s, k| {
            let far = k * by(s);
            what(s)[axis] += far;
        })
    };
    AXES.map(of).into()
}

/// The ball that is touched.
fn ball(s: &mut Scene) -> &mut V3 {
    let Measured::Touch { ball, .. } = s.measured else { panic!("no touch") };
    &mut s.model.cell.balls[ball]
}

fn tcp(s: &mut Scene) -> &mut V3 {
    &mut s.model.cell.tool.tcp
}

fn turning<'a>(r: &'a Covariates<'_>) -> impl Iterator<Item = usize> + 'a {
    (1..=6).filter(|joint| !r.model.robot.slides(*joint))
}

/// Candidates of an effect; of ripples, whose frequencies come from a periodogram, one for each joint that turns.
fn asked(id: EffectId, r: &Covariates<'_>) -> Vec<Candidate> {
    if id == EffectId::GearRipple {
        return turning(r).map(|joint| ripple(joint, GEAR, 6)).collect();
    }
    (id.effect().ask)(r).candidates
}

/// What the candidates of an effect should be: places, and what each coefficient does. A positive coefficient is one of the
/// sign that physics allows. Where shapes are scanned, the scale is that of the candidate.
fn expected(id: EffectId, r: &Covariates<'_>, asked: &[Candidate]) -> Vec<Expected> {
    use EffectId as Id;
    let at = |joint: usize, changes: Vec<Change>| (Place::Joint(joint), changes);
    let on_rail = r.model.robot.slides(1);
    let has_foot = |joint: usize| r.model.robot.joints[joint - 1].d != 0.0 && !r.model.robot.slides(joint);
    let of_touches = |list: Vec<Expected>| if r.touches { list } else { Vec::new() };
    let of_indicators =
        |of: fn(usize) -> Vec<Change>| of_touches(Axis::ALL.map(|axis| (Place::Axis(axis), of(axis.index()))).into());
    let scanned = |of: &dyn Fn(usize, &Candidate) -> Expected| {
        let joints: Vec<usize> = asked.iter().filter_map(|c| c.site.joint()).collect();
        assert!(joints.iter().copied().collect::<BTreeSet<_>>().into_iter().eq(turning(r)), "{id}: {joints:?}");
        joints.iter().zip(asked).map(|(j, c)| of(*j, c)).collect()
    };
    match id {
        Id::LostMotionDirection => (1..=6).map(|j| turns(j, move |s| -s.sense(j))).collect(),
        Id::LostMotionGravity => scanned(&|j, c| {
            let soft = c.scale().unwrap();
            turns(j, move |s| (s.torque(j) / soft).tanh())
        }),
        Id::LoadFriction => {
            let by_load = |j: usize| turn(j, move |s| -s.sense(j) * s.torque(j).abs());
            let both = |j: usize| vec![turn(j, move |s| -s.sense(j)), by_load(j)];
            turning(r).map(|j| at(j, if r.unloaded(j) { vec![by_load(j)] } else { both(j) })).collect()
        }
        Id::JointHarmonic => turning(r).flat_map(|j| (1..=6).map(move |n| at(j, waves(j, f64::from(n))))).collect(),
        Id::GearRipple => turning(r).map(|j| at(j, waves(j, GEAR))).collect(),
        Id::EncoderError => {
            let curve = |j, n| at(j, (1..=n).flat_map(|n| waves(j, f64::from(n))).collect());
            turning(r).flat_map(|j| [curve(j, 15), curve(j, 12)]).collect()
        }
        Id::GearRatio => (1..=6).map(|j| turns(j, move |s| s.state.q[j - 1])).collect(),
        Id::JointCoupling => {
            let of = |(joint, from): (usize, usize)| {
                let (_, does) = turn(joint, move |s| s.state.q[from - 1]);
                (Place::Coupling { joint, from }, vec![(format!("{joint}_from_{from}"), does)])
            };
            let pairs = [(3, 2), (4, 3), (5, 4), (6, 4), (6, 5)];
            pairs.into_iter().filter(|p| on_rail || *p != (4, 3)).map(of).collect()
        }
        Id::NonlinearStiffness => scanned(&|j, c| {
            let (name, scale) = (c.terms[0].name.clone(), c.scale());
            let shape = move |tau: f64| match (name.split('_').nth(1).unwrap(), scale) {
                ("square", None) => tau * tau.abs(),
                ("cube", None) => tau.powi(3),
                ("soft", Some(at)) => (tau / at).tanh(),
                ("kink", Some(at)) => (tau / at).clamp(-1.0, 1.0),
                other => panic!("{other:?}"),
            };
            turns(j, move |s| shape(s.torque(j)))
        }),
        Id::CrossAxisCompliance => {
            let points = |j: usize| match j {
                _ if !has_foot(j) => vec![0.0],
                1 => vec![1.0],
                _ => vec![0.0, 1.0, 0.25, 0.5, 0.75],
            };
            let across = |j: usize, share: f64| {
                let moment = move |s: &Scene| s.moment_and_force(j, share).0;
                at(j, vec![tilt(j, j, share, move |s| moment(s).component_mul(&V3::new(1.0, 1.0, 0.0)))])
            };
            (1..=6).flat_map(|j| points(j).into_iter().map(move |share| across(j, share))).collect()
        }
        Id::AxisTwist => {
            // axes 2 and 3 are parallel, and on the rail axes 1 and 2
            let parallel = if on_rail { 2..=3 } else { 3..=3 };
            parallel.map(|j| at(j, vec![tilt(j - 1, j, 1.0, |_| V3::y())])).collect()
        }
        Id::AxisWobble => {
            let wobble = |j: usize, n: f64, share: f64| {
                let by = |axis: V3, wave: fn(f64) -> f64| tilt(j, j, share, move |s| axis * wave(n * s.state.q[j - 1]));
                at(j, vec![by(V3::x(), f64::sin), by(V3::x(), f64::cos), by(V3::y(), f64::sin), by(V3::y(), f64::cos)])
            };
            let ends = |j| if has_foot(j) { vec![0.0, 1.0] } else { vec![0.0] };
            let all = |n: f64| move |j: usize| ends(j).into_iter().map(move |share| wobble(j, n, share));
            turning(r).flat_map(|j| all(1.0)(j).chain(all(2.0)(j)).collect::<Vec<_>>()).collect()
        }
        Id::RailError => {
            let [low, high] = r.model.robot.joints[0].limits;
            let way = move |s: &Scene| (s.state.q[0] - low) / (high - low);
            // 1 at a sixth of the way, 0 from its neighbours on
            let bend = move |s: &Scene, k: u8| (1.0 - (6.0 * way(s) - f64::from(k)).abs()).max(0.0);
            let bends = |k: u8| {
                let a = change(k, move |s, size| s.model.robot.joints[1].a += size * bend(s, k));
                [a, change(k, move |s, size| s.model.robot.joints[1].d += size * bend(s, k))]
            };
            let turns = AXES.map(|(axis, name)| tilt(name, 1, 0.0, move |s| V3::ith(axis, way(s))));
            let both = [at(1, (1..=5).flat_map(bends).collect()), at(1, turns.into())];
            both.into_iter().filter(|_| on_rail).collect()
        }
        Id::GravityDirection => vec![(Place::Base, along(|s| &mut s.gravity, |_| 1.0).into_iter().take(2).collect())],
        Id::Payload => {
            let mut changes = along(|s| &mut s.load.1, |_| 1.0);
            changes.insert(0, change("mass", |s, k| s.load = (s.load.0 + k, s.load.1 + s.model.cell.tool.cog * k)));
            vec![(Place::Tool, changes)]
        }
        Id::ThermalGrowth => {
            let grow = |s: &mut Scene, by: f64| {
                s.model.robot.joints.iter_mut().for_each(|j| (j.a, j.d) = (j.a * (1.0 + by), j.d * (1.0 + by)));
            };
            let of = |clock: Basis| change("expansion", move |s, k| grow(s, k * s.warmth(&clock)));
            r.clocks.iter().map(|c| (Place::Links, vec![of(c.basis)])).collect()
        }
        Id::ThermalZeroDrift => {
            let of = |clock: Basis| (1..=6).map(move |j| turns(j, move |s| s.warmth(&clock)));
            r.clocks.iter().flat_map(|c| of(c.basis)).collect()
        }
        Id::JointZeroShift => {
            let whole = (1..=6).filter(|_| r.one_of_several).map(|j| turns(j, |_| 1.0));
            let at_once = |moment: &f64| {
                let moment = *moment;
                (1..=6).map(move |j| turns(j, move |s| s.after(moment)))
            };
            whole.chain(r.changes().iter().flat_map(at_once)).collect()
        }
        Id::FixtureShift => {
            let of = |moment: f64| (Place::Fixture, along(ball, move |s| s.after(moment)));
            of_touches(r.changes().iter().copied().map(of).collect())
        }
        Id::FixtureDrift => of_touches(vec![(Place::Fixture, along(ball, Scene::when))]),
        Id::ToolShift => {
            let of = |moment: f64| (Place::Tool, along(tcp, move |s| s.after(moment)));
            r.changes().iter().copied().map(of).collect()
        }
        Id::ToolDrift => vec![(Place::Tool, along(tcp, Scene::when))],
        Id::FrameDrift => {
            let of = |frame: usize| {
                let seen = move |s: &Scene| if s.frame == frame { s.when() } else { 0.0 };
                // {w} as the instrument sees it goes along the instrument's axes, or turns about them where it is
                let turn = |(axis, name)| {
                    change(format!("_r{name}"), move |s, k| {
                        let turn = Rotation3::new(V3::ith(axis, k * seen(s))).into_inner();
                        s.frame_from_world.rotation = turn * s.frame_from_world.rotation;
                    })
                };
                let mut motions = along(|s| &mut s.frame_from_world.translation, seen);
                motions.extend(AXES.map(turn));
                (Place::Frame(None), motions)
            };
            (0..2).filter(|_| !r.touches).map(of).collect()
        }
        Id::BallPosition => {
            let is = move |s: &Scene, number| matches!(s.measured, Measured::Touch { ball, .. } if ball + 1 == number);
            let of = |number| (Place::Ball(number), along(ball, move |s| f64::from(u8::from(is(s, number)))));
            of_touches((1..=3).map(of).collect())
        }
        Id::IndicatorGain => of_indicators(|a| vec![change(AXES[a].1, move |s, k| s.reading[a] *= 1.0 + k)]),
        Id::IndicatorSkew => of_indicators(|a| {
            let by = |(other, name)| change(name, move |s, k| s.reading[a] += k * s.reading[other]);
            AXES.into_iter().filter(|other| other.0 != a).map(by).collect()
        }),
        Id::IndicatorDrift => of_indicators(|a| vec![change(AXES[a].1, move |s, k| s.reading[a] += k * s.when())]),
        Id::LateJointReading => {
            let all = change("lag", |s, k| (1..=6).for_each(|j| s.q[j - 1] += k * s.lag(j)));
            let one = |j: usize| turns(j, move |s| s.lag(j));
            std::iter::once((Place::Joints, vec![all])).chain((1..=6).map(one)).collect()
        }
    }
}

/// A row of a recording: joints anywhere, every joint come from either side or not at all, and read a little before it arrived.
fn row(k: u32, measured: Measured) -> Row {
    let number = f64::from(k);
    // fractional parts of multiples of square roots: no two angles go together
    let steps = [0.4142, 0.7321, 0.2361, 0.6458, 0.3166, 0.6056];
    let mut state = State::at(&steps.map(|step| 2.4 * ((0.5 + number * step).fract() - 0.5)));
    let sense: [i8; MAX_JOINTS] = std::array::from_fn(|j| [1, -1, 1, 0, -1][(k as usize * (j + 1) + j) % 5]);
    let commanded = std::array::from_fn(|j| state.q[j] + f64::from(sense[j]) * 1e-4 * (j + 1 + k as usize % 3) as f64);
    state = State { dir: Some(sense), q_commanded: Some(commanded), t: Some(20.0 * number), ..state };
    Row { state: State { temp_c: Some(20.0 + 0.05 * number), ..state }, measured, seq: None, line: k as usize + 2 }
}

/// 180 touches, with readings, by an arm on a table that slopes.
pub(super) fn touches() -> (Model, Dataset) {
    let mut model = arm();
    model.cell.world_from_base.rotation = rotation_zyx(0.7, 0.15, -0.1);
    model.cell.tool.tcp.x = 0.06;
    let touch = |k: u32| {
        let reading = [0.31, 0.47, 0.83].map(|step| 1e-3 * ((f64::from(k) * step).fract() - 0.3));
        row(k, Measured::Touch { ball: k as usize % 3, reading })
    };
    let recording =
        Recording { name: "touches".into(), joints: 6, rows: (0..180).map(touch).collect(), ..Recording::default() };
    (model, Dataset::build(&[recording], JointSource::Read, None).unwrap())
}

/// Twice 90 points, seen by a tracker that was set up anew, of an arm that stands on its head on a rail.
pub(super) fn points() -> (Model, Dataset) {
    let mut model = arm();
    (model.robot.joints[0].kind, model.robot.joints[0].limits) = (JointKind::Prismatic, [-1.3, 1.4]);
    model.robot.joints[1].alpha = std::f64::consts::PI - 0.05;
    let pose = |x, z| Pose { rotation: rotation_zyx(z, 0.2, 0.1), translation: V3::new(x, 0.3, -0.2) };
    model.frames = vec![pose(0.5, 0.4), pose(-0.8, 2.0)];
    let of = |first: u32| {
        let rows = (first..first + 90).map(|k| row(k, Measured::Point { target: 0, position: [0.0; 3] })).collect();
        Recording { name: format!("from {first}"), joints: 6, rows, ..Recording::default() }
    };
    (model, Dataset::build(&[of(0), of(90)], JointSource::Read, None).unwrap())
}

/// The same without something that was recorded.
pub(super) fn without(mut data: Dataset, forget: fn(&mut Observation)) -> Dataset {
    data.observations.iter_mut().for_each(forget);
    data
}

/// How far a term, and a change by hand, moves the tip at some rows.
fn far(model: &Model, data: &Dataset, term: Term, by_hand: impl Fn(&mut Scene)) -> Vec<[V3; 2]> {
    let plain = Forward::new(model.clone(), Vec::new()).unwrap();
    let terms = [model.terms.clone(), vec![term]].concat();
    let changed = Forward::new(Model { terms, ..model.clone() }, Vec::new()).unwrap();
    let of = |o: &Observation| {
        let tip = |forward: &Forward| {
            let mut ws = forward.workspace();
            forward.residual(&o.state, &o.measured, o.frame, &mut ws);
            V3::from_column_slice(&ws.residual()[..3])
        };
        let tool = &model.cell.tool;
        let mut scene = Scene {
            model: model.clone(),
            state: o.state,
            measured: o.measured,
            frame: o.frame,
            frame_from_world: model.frames.get(o.frame).copied().unwrap_or(Pose::identity()),
            q: o.state.q,
            compliance: if model.terms.is_empty() { 0.0 } else { COMPLIANCE },
            gravity: V3::new(0.0, 0.0, -GRAVITY),
            load: (tool.mass, tool.cog * tool.mass),
            tilt: None,
            reading: if let Measured::Touch { reading, .. } = o.measured { reading.into() } else { V3::zeros() },
        };
        let before = scene.tip();
        assert!((tip(&plain) - before).norm() < 1e-12, "plain kinematics agree");
        by_hand(&mut scene);
        [tip(&changed) - tip(&plain), scene.tip() - before]
    };
    data.observations.iter().step_by(11).chain(data.observations.last()).map(of).collect()
}

#[test]
fn every_effect_moves_the_tool_as_plain_kinematics_say() {
    use EffectId as Id;
    let no_thermometer = |data| without(data, |o| o.state.temp_c = None);
    let numbers_only = |data| without(data, |o| (o.state.t, o.state.temp_c) = (None, None));
    let (touches, points) = (touches(), points());
    let mut seen = BTreeSet::new();
    for (several, model, data) in [
        (false, &touches.0, touches.1.clone()),
        (true, &touches.0, numbers_only(touches.1)),
        (false, &points.0, points.1.clone()),
        (true, &points.0, no_thermometer(points.1)),
    ] {
        let mut r = Covariates::new(model, &data, 1e-5);
        r.one_of_several = several;
        for id in EffectId::ALL {
            let mut model = model.clone();
            if id.effect().family == Family::Load {
                let gives = |joint| (format!("c_{joint}"), Site::Joint { joint }, Basis::torque(joint, Shape::Linear));
                let terms = (1..=6).map(gives).map(|(name, site, basis)| Term::new(name, "compliance", site, basis));
                model.terms = terms.map(|t| Term { value: COMPLIANCE, ..t }).collect();
            }
            let asked = asked(id, &r);
            let expected = expected(id, &r, &asked);
            assert!(asked.iter().map(|c| c.site).eq(expected.iter().map(|e| e.0)), "{id}: {asked:?}");
            for (c, (_, changes)) in asked.iter().zip(&expected) {
                assert_eq!(c.terms.len(), changes.len(), "{id} {c:?}");
                for (k, (name, change)) in changes.iter().enumerate() {
                    let what = format!("{id}, {}: {}", c.site, c.terms[k].name);
                    assert!(what.ends_with(name), "{what} ends with {name}");
                    // small enough that the order of turns does not matter
                    let size = 0.01 * c.scales[k];
                    let value = if c.signs[k] < 0 { -size } else { size };
                    let far = far(&model, &data, Term { value, ..c.terms[k].clone() }, |s| change(s, size));
                    let largest = far.iter().map(|f| f[1].norm()).fold(0.0, f64::max);
                    let wrong = far.iter().map(|f| (f[0] - f[1]).norm()).fold(0.0, f64::max);
                    assert!(wrong < 1e-4 * largest, "{what} is wrong by {wrong:e} of {largest:e} m");
                    // of all joints the one that bears least may give way less
                    let moves = 100.0 * largest;
                    assert!(moves < 1e-2 && (moves > 5e-7 || id == Id::NonlinearStiffness), "{what}: {moves} m");
                }
                seen.insert(id);
            }
        }
    }
    assert!(seen.into_iter().eq(EffectId::ALL));
}
