//! ROS 2 bags (MCAP) of others: joint states, and what an instrument saw of the tool, matched by time.
//!
//! The arm has to stand where it is measured: what was seen while it moved is left out, and what was seen while it stood in one place is
//! averaged to one row. Everything that is assumed is said in [`Recording::notes`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use trical_model::pose::{quaternion_from_rotation, rotation_from_quaternion};
use trical_model::recording::{Joints, MAX_JOINTS, Measured, Recording, Row, State};
use trical_model::urdf;

use super::cdr::{JointState, Stamped, StampedKind, string_from_cdr};
use super::records::{RawFile, RawMessage};
use super::schema;
use crate::error::RecordError;
use crate::expected::Expected;
use crate::motion::MotionSense;

/// A measurement needs a joint state at most so long before and after it, s.
const NEAR: f64 = 1.0;

/// The arm stands where no joint moves by more than this (rad, or m) from so long before a measurement to so long after it, s.
const STILL: f64 = 5e-4;
const AROUND: f64 = 0.1;

/// Clocks of joint states and measurements that differ by more than this against the clock of the recorder cannot be compared, s.
const CLOCKS: f64 = 0.5;

/// Where transforms are published.
const TREE: &str = "/tf";

const JOINT_STATE: &str = schema::JOINT_STATE_NAME;

/// Whether this is somebody else's bag and not a recording of ours.
pub(super) fn is_bag(raw: &RawFile) -> bool {
    // metadata stand first: a recording of ours that was cut has them
    let ours = raw.metadata.iter().any(|(name, _)| name == "trical")
        || raw.channels.values().any(|c| c.topic == schema::MEASUREMENT && c.encoding == "json");
    !ours && raw.channels.values().any(|c| kind_of(c).is_some() || is_joint_states(c))
}

fn is_joint_states(channel: &super::records::RawChannel) -> bool {
    channel.schema.as_ref().is_some_and(|s| s.name == JOINT_STATE)
}

fn kind_of(channel: &super::records::RawChannel) -> Option<StampedKind> {
    StampedKind::of(&channel.schema.as_ref()?.name)
}

/// Where the joints stood, on the clock that counts.
struct Sample {
    t: f64,
    q: Joints,
}

/// What was seen, likewise.
#[derive(Clone, Copy)]
struct Sight {
    t: f64,
    position: [f64; 3],
    quaternion: Option<[f64; 4]>,
}

/// Reads a bag of the arm that is `expected`; `topic` says which measurements where there are several.
pub(super) fn recording(
    path: &Path,
    raw: &RawFile,
    expected: Expected<'_>,
    topic: Option<&str>,
) -> Result<Recording, RecordError> {
    let bad = |problem: String| RecordError::Unreadable { path: path.to_owned(), problem };
    let states_on = one_topic(raw, None, &is_joint_states)
        .map_err(|found| bad(several(&found, "joint states (sensor_msgs/msg/JointState)", schema::JOINT_STATES)))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (seen_on, child) = topic_of_measurements(raw, topic, &name).map_err(bad)?;
    let states: Vec<(&RawMessage, JointState)> = messages(raw, &states_on)
        .map(|(number, m)| match JointState::from_cdr(&m.data) {
            Some(state) => Ok((m, state)),
            None => Err(wrong(path, &states_on, number, "no sensor_msgs/msg/JointState in little-endian CDR")),
        })
        .collect::<Result<_, _>>()?;
    let kind = raw.channels.values().find(|c| c.topic == seen_on).and_then(kind_of).unwrap_or(StampedKind::Pose);
    let mut seen: Vec<(&RawMessage, Stamped)> = Vec::new();
    for (number, m) in messages(raw, &seen_on) {
        let all = Stamped::from_cdr(&m.data, kind);
        let all = all.ok_or_else(|| wrong(path, &seen_on, number, "no such message in little-endian CDR"))?;
        seen.extend(all.into_iter().map(|stamped| (m, stamped)));
    }
    if matches!(kind, StampedKind::Tree | StampedKind::Transform) {
        let wanted = frame_of_tree(&seen, child, &format!("{name}#{seen_on}"), &seen_on).map_err(bad)?;
        seen.retain(|(_, s)| s.child == wanted);
    }
    if states.is_empty() || seen.is_empty() {
        let empty = if states.is_empty() { &states_on } else { &seen_on };
        return Err(bad(format!("has no message on {empty}")));
    }
    let all = seen.len();
    seen.retain(|(_, s)| s.is_whole());
    let lost = all - seen.len();
    let frame = frame_of(&seen, &seen_on).map_err(bad)?;
    let described = description(raw);
    let known = KnownJoints::new(expected, described.as_ref());
    let (states, others) = of_the_arm(states, known);
    let names = states.first().map_or(&[][..], |(_, s)| &s.names);
    let (order, mut notes) = order_of(names, known).map_err(&bad)?;
    notes.extend(others);
    let clock = Clock::of(&states, &seen);
    notes.push(clock.in_words());
    let order_names: Vec<&String> = order.iter().filter_map(|k| names.get(*k)).collect();
    let samples = samples(&states, &order_names, clock);
    if samples.len() < states.len() {
        let (n, of) = (states.len() - samples.len(), states.len());
        notes.push(format!(
            "{n} of {of} joint states on {states_on} have no finite position of every joint and are left out"
        ));
    }
    let sights: Vec<Sight> = seen
        .iter()
        .map(|(m, s)| Sight { t: clock.time(m, s.stamp()), position: s.position, quaternion: s.quaternion })
        .collect();
    let stands = stands(&samples, &sights);
    notes.push(stands.in_words(all, lost, &seen_on).map_err(bad)?);
    notes.push(format!("positions in m in the frame {frame}, which is taken as the measuring frame"));
    let described = described.as_ref().filter(|d| d.robot.dof() == order.len());
    let prismatic = described.map(|d| d.robot.prismatic());
    let name = path.display().to_string();
    let notes = notes.into_iter().map(|n| format!("{name}: {n}")).collect();
    Ok(Recording { name, joints: order.len(), prismatic, places: Vec::new(), rows: stands.rows, notes })
}

/// The one frame that all was seen in, in quotes.
fn frame_of(seen: &[(&RawMessage, Stamped)], seen_on: &str) -> Result<String, String> {
    let frames: BTreeSet<&str> = seen.iter().map(|(_, s)| s.frame.as_str()).collect();
    let frames: Vec<String> = frames.iter().take(6).map(|f| format!("'{f}'")).collect();
    match frames.as_slice() {
        [] => Ok(String::new()),
        [one] => Ok(one.clone()),
        several => {
            Err(format!("its measurements on {seen_on} are in the frames {}; expected one frame", several.join(", ")))
        }
    }
}

/// The topic with measurements, and the frame that was asked for: of a tree of transforms one frame is a measurement, which has to be
/// named, as in /tf:probe. `name` is the file's.
fn topic_of_measurements<'a>(
    raw: &RawFile,
    asked: Option<&'a str>,
    name: &str,
) -> Result<(String, Option<&'a str>), String> {
    let (topic, child) = asked.map_or((None, None), |t| match t.split_once(':') {
        Some((topic, child)) => (Some(topic), Some(child)),
        None => (Some(t), None),
    });
    let is_tree = |c: &super::records::RawChannel| kind_of(c) == Some(StampedKind::Tree);
    let only_trees = !raw.channels.values().any(|c| kind_of(c).is_some() && !is_tree(c));
    let fits = |c: &super::records::RawChannel| kind_of(c).is_some() && (topic.is_some() || only_trees || !is_tree(c));
    let default = only_trees.then_some(TREE).filter(|t| raw.channels.values().any(|c| c.topic == *t));
    let seen_on = one_topic(raw, topic.or(default), &fits).map_err(|found| {
        let example = found.first().map_or(String::new(), |t| format!("; name one of them, as in {name}#{t}"));
        let what = "measurements (PoseStamped, PointStamped, TransformStamped or TFMessage)";
        format!("{}{}{example}", several(&found, what, ""), if found.is_empty() { others(raw) } else { String::new() })
    })?;
    Ok((seen_on, child))
}

/// What a bag without measurements has instead.
fn others(raw: &RawFile) -> String {
    let named = |c: &super::records::RawChannel| Some((c.schema.as_ref()?.name.clone(), c.topic.clone()));
    let own = |(name, _): &(String, String)| ![schema::STRING_NAME, JOINT_STATE].contains(&name.as_str());
    let found: BTreeSet<(String, String)> = raw.channels.values().filter_map(named).filter(own).collect();
    let found: Vec<String> = found.into_iter().take(6).map(|(name, topic)| format!("{name} on {topic}")).collect();
    if found.is_empty() { String::new() } else { format!("; found {}", found.join(", ")) }
}

/// The frame of a tree of transforms that is the measurement: the one that was asked for, or the only one.
fn frame_of_tree(
    seen: &[(&RawMessage, Stamped)],
    asked: Option<&str>,
    place: &str,
    topic: &str,
) -> Result<String, String> {
    let children: BTreeSet<&str> = seen.iter().map(|(_, s)| s.child.as_str()).collect();
    let wanted = asked.or_else(|| children.first().copied().filter(|_| children.len() == 1));
    if let Some(wanted) = wanted.filter(|w| children.contains(w)) {
        return Ok(wanted.to_owned());
    }
    let all: Vec<&str> = children.into_iter().take(20).collect();
    let example = all.last().map_or(String::new(), |c| format!(", as in {place}:{c}"));
    Err(format!(
        "has transforms of {} on {topic}; name the frame that the instrument measured{example}",
        if all.is_empty() { "no frame".to_owned() } else { all.join(", ") }
    ))
}

fn wrong(path: &Path, topic: &str, number: usize, problem: &str) -> RecordError {
    RecordError::Message { path: path.to_owned(), topic: topic.to_owned(), number, problem: problem.to_owned() }
}

fn several(found: &[String], what: &str, usual: &str) -> String {
    let usual = if usual.is_empty() { String::new() } else { format!(" or {usual}") };
    match found {
        [] => format!("has no topic with {what}"),
        found => format!("has {what} on {}; expected one topic{usual}", found.join(", ")),
    }
}

/// The topic that fits: the one that was asked for, the usual one of joint states, or the only one; else all that fit.
fn one_topic(
    raw: &RawFile,
    asked: Option<&str>,
    fits: &dyn Fn(&super::records::RawChannel) -> bool,
) -> Result<String, Vec<String>> {
    let mut found: Vec<String> =
        raw.channels.values().filter(|c| c.encoding == "cdr" && fits(c)).map(|c| c.topic.clone()).collect();
    found.sort();
    found.dedup();
    let wanted = asked.unwrap_or(schema::JOINT_STATES);
    match &found[..] {
        _ if found.iter().any(|t| t == wanted) => Ok(wanted.to_owned()),
        [one] if asked.is_none() => Ok(one.clone()),
        _ => Err(found),
    }
}

/// Messages on a topic in the order of the recorder's time, with their numbers from 1.
fn messages<'a>(raw: &'a RawFile, topic: &str) -> impl Iterator<Item = (usize, &'a RawMessage)> {
    let on = |m: &&RawMessage| raw.channels.get(&m.channel).is_some_and(|c| c.topic == topic);
    let mut all: Vec<&RawMessage> = raw.messages.iter().filter(on).collect();
    all.sort_by_key(|m| m.log_time);
    all.into_iter().enumerate().map(|(k, m)| (k + 1, m))
}

/// The arm of `/robot_description`, where the bag has it.
fn description(raw: &RawFile) -> Option<urdf::Imported> {
    let (_, message) = messages(raw, schema::ROBOT_DESCRIPTION).next()?;
    urdf::parse(&string_from_cdr(&message.data)?, "robot_description", None, None).ok()
}

/// Which positions of a joint state with these names are the arm's joints, joint 1 first, and what was assumed of it.
///
/// # Errors
/// One sentence: neither their number nor their names say it.
pub fn joint_order<'a>(
    names: &[String],
    expected: impl Into<Expected<'a>>,
) -> Result<(Vec<usize>, Vec<String>), String> {
    order_of(names, KnownJoints::new(expected.into(), None))
}

/// What is known of the arm's joints beside a message.
#[derive(Clone, Copy)]
struct KnownJoints<'a> {
    count: Option<usize>,
    /// Names, and who says them, those that count first.
    names: [(&'a [String], &'static str); 2],
}

impl<'a> KnownJoints<'a> {
    fn new(expected: Expected<'a>, described: Option<&'a urdf::Imported>) -> Self {
        let of_bag = described.map_or(&[][..], |d| &d.robot.joint_names);
        let names = [
            (expected.names, "as the robot's description has them"),
            (of_bag, "as the bag's /robot_description has them"),
        ];
        Self { count: expected.joints, names }
    }
}

fn order_of(names: &[String], known: KnownJoints<'_>) -> Result<(Vec<usize>, Vec<String>), String> {
    let joints = known.count;
    let place = |name: &String| names.iter().position(|n| n == name);
    let fits = |count: usize| joints.is_none_or(|j| j == count) && (1..=MAX_JOINTS).contains(&count);
    let said = |order: Vec<usize>, how: &str| {
        let list: Vec<&str> = order.iter().map(|k| names[*k].as_str()).collect();
        let note = format!("joints 1 to {} are {}, {how}", order.len(), list.join(", "));
        Ok((order, vec![note]))
    };
    for (of_arm, how) in known.names {
        if let Some(order) = of_arm.iter().map(place).collect::<Option<Vec<_>>>()
            && fits(order.len())
        {
            return said(order, how);
        }
    }
    const UR: [&str; 6] = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"];
    let ur = UR.map(|part| names.iter().position(|n| n.contains(part)));
    if let Some(order) = ur.into_iter().collect::<Option<Vec<_>>>()
        && fits(6)
    {
        return said(order, "in the order of Universal Robots' arms");
    }
    // of names that differ in the number alone, or else from the number on
    for whole in [true, false] {
        let groups = numbered(names, whole);
        let mut right = groups.into_iter().filter(|g| fits(g.len()) && (joints.is_some() || g.len() > 3));
        if let (Some(group), None) = (right.next(), right.next()) {
            return said(group, "by the numbers in their names");
        }
    }
    if fits(names.len()) {
        return said((0..names.len()).collect(), "in the order of the message");
    }
    Err(format!(
        "its joint states are of {} joint{} ({}){}; expected as many as the arm has, names that are numbered, or a /robot_description",
        names.len(),
        if names.len() == 1 { "" } else { "s" },
        names.join(", "),
        joints.map_or(String::new(), |j| format!(", and the robot has {j}"))
    ))
}

/// Places of names that have a number behind the same letters, in its order; with `whole` the same letters behind it, too. Of names that share a
/// number, none.
fn numbered(names: &[String], whole: bool) -> BTreeSet<Vec<usize>> {
    let mut groups: BTreeMap<(&str, &str), Vec<(u32, usize)>> = BTreeMap::new();
    for (k, name) in names.iter().enumerate() {
        let mut from = 0;
        while let Some(begin) = name[from..].find(|c: char| c.is_ascii_digit()).map(|at| from + at) {
            from = name[begin..].find(|c: char| !c.is_ascii_digit()).map_or(name.len(), |at| begin + at);
            let behind = if whole { &name[from..] } else { "" };
            if let Ok(number) = name[begin..from].parse() {
                groups.entry((&name[..begin], behind)).or_default().push((number, k));
            }
        }
    }
    let apart = |mut group: Vec<(u32, usize)>| {
        group.sort_unstable();
        group.windows(2).all(|w| w[0].0 < w[1].0).then(|| group.into_iter().map(|(_, k)| k).collect())
    };
    groups.into_values().filter_map(apart).collect()
}

/// Which clock tells what was at the same time.
#[derive(Clone, Copy, PartialEq)]
enum Clock {
    Stamps,
    Recorder,
}

impl Clock {
    /// That of the stamps, if both have some and they run alike.
    fn of(states: &[(&RawMessage, JointState)], seen: &[(&RawMessage, Stamped)]) -> Self {
        let late = |stamp: f64, m: &RawMessage| m.log_time as f64 * 1e-9 - stamp;
        let stamped = states.iter().all(|(_, s)| s.stamp() > 0.0) && seen.iter().all(|(_, s)| s.stamp() > 0.0);
        let apart = middle(states.iter().map(|(m, s)| late(s.stamp(), m)))
            - middle(seen.iter().map(|(m, s)| late(s.stamp(), m)));
        if stamped && apart.abs() < CLOCKS { Self::Stamps } else { Self::Recorder }
    }

    fn time(self, message: &RawMessage, stamp: f64) -> f64 {
        if self == Self::Stamps { stamp } else { message.log_time as f64 * 1e-9 }
    }

    fn in_words(self) -> String {
        match self {
            Self::Stamps => "joints and measurements are matched by the stamps of the messages".to_owned(),
            Self::Recorder => "joints and measurements are matched by when they were recorded, since the stamps of the messages are missing or \
                               of different clocks"
                .to_owned(),
        }
    }
}

/// Joint states of one set of names, in whatever order.
type States<'a> = Vec<(&'a RawMessage, JointState)>;

/// The joint states of the arm, and what is said of others on the topic, as a gripper's: those whose names fit the arm, of which the joints move,
/// or else that are the most.
fn of_the_arm<'a>(states: States<'a>, known: KnownJoints<'_>) -> (States<'a>, Option<String>) {
    let mut sets: BTreeMap<Vec<String>, States<'a>> = BTreeMap::new();
    for (m, state) in states {
        let mut names = state.names.clone();
        names.sort();
        sets.entry(names).or_default().push((m, state));
    }
    let rank = |states: &States<'_>| {
        let Some((_, first)) = states.first() else { return (false, false, 0) };
        let moves = states.iter().any(|(_, s)| {
            s.names == first.names && s.position.iter().zip(&first.position).any(|(a, b)| (a - b).abs() > STILL)
        });
        (order_of(&first.names, known).is_ok(), moves, states.len())
    };
    let arm = sets.iter().max_by_key(|(_, states)| rank(states)).map(|(names, _)| names.clone()).unwrap_or_default();
    let states = sets.remove(&arm).unwrap_or_default();
    let others: Vec<String> = sets.iter().map(|(names, s)| format!("{} of {}", s.len(), names.join(", "))).collect();
    (states, (!others.is_empty()).then(|| format!("joint states of others are left out: {}", others.join("; "))))
}

/// Where the joints with these names stood; states without a finite position of each are left out.
fn samples(states: &States<'_>, names: &[&String], clock: Clock) -> Vec<Sample> {
    let sample = |(m, state): &(&RawMessage, JointState)| {
        let mut q = [0.0; MAX_JOINTS];
        for (to, name) in q.iter_mut().zip(names) {
            let place = state.names.iter().position(|n| n == *name)?;
            *to = state.position.get(place).copied().filter(|q| q.is_finite())?;
        }
        Some(Sample { t: clock.time(m, state.stamp()), q })
    };
    let mut out: Vec<Sample> = states.iter().filter_map(sample).collect();
    out.sort_by(|a, b| a.t.total_cmp(&b.t));
    out
}

/// One row for each stop of the arm at which something was seen, and how many measurements are in none.
#[derive(Default)]
struct Stands {
    rows: Vec<Row>,
    moving: usize,
    without: usize,
    /// Far from the others of their stop.
    far: usize,
    /// How far what is averaged is from its mean at most, m.
    spread: f64,
}

impl Stands {
    /// What became of `all` measurements on a topic, of which `lost` hold no numbers; an error where no row did.
    fn in_words(&self, all: usize, lost: usize, seen_on: &str) -> Result<String, String> {
        let Self { rows, moving, without, far, spread } = self;
        if rows.is_empty() {
            return Err(format!(
                "none of {all} measurements on {seen_on} can be used: {lost} hold no finite numbers or no unit quaternion, {without} have no joint \
                 state within {NEAR} s, {moving} were taken while the arm moved; expected measurements of an arm that stands"
            ));
        }
        Ok(format!(
            "{} rows from {all} measurements on {seen_on} where the arm stood (no joint moved by {STILL} rad or m within {AROUND} s), averaged at \
             each stop, from whose mean they are {:.3} mm off at most; left out: {moving} while it moved, {without} without a joint state within \
             {NEAR} s, {lost} without finite numbers or a unit quaternion, {far} far from the others of their stop",
            rows.len(),
            spread * 1e3
        ))
    }
}

/// Measurements at one stop.
#[derive(Default)]
struct Stop {
    /// Each with the joints then.
    sights: Vec<(Joints, Sight)>,
    dir: [i8; MAX_JOINTS],
}

fn stands(samples: &[Sample], sights: &[Sight]) -> Stands {
    let mut out = Stands::default();
    let begin = samples.first().map_or(0.0, |s| s.t);
    let mut motion = MotionSense::default();
    let (mut pushed, mut stop) = (0, Stop::default());
    let mut sorted: Vec<&Sight> = sights.iter().collect();
    sorted.sort_by(|a, b| a.t.total_cmp(&b.t));
    for sight in sorted {
        let after = samples.partition_point(|s| s.t < sight.t);
        for s in samples.iter().take(after).skip(pushed) {
            motion.push(&s.q);
        }
        pushed = pushed.max(after);
        // those around, and the next to either side
        let from = samples.partition_point(|s| s.t < sight.t - AROUND).min(after.saturating_sub(1));
        let to = samples.partition_point(|s| s.t <= sight.t + AROUND).max((after + 1).min(samples.len()));
        let near: Vec<&Sample> = samples[from..to].iter().filter(|s| (s.t - sight.t).abs() <= NEAR).collect();
        // one on either side, or one so near that it is both: while joint states are missing, the arm may move
        let (before, after) = (|s: &&Sample| s.t <= sight.t + AROUND, |s: &&Sample| s.t >= sight.t - AROUND);
        if !(near.iter().any(before) && near.iter().any(after)) {
            out.without += 1;
            continue;
        }
        let q: Joints = std::array::from_fn(|k| near.iter().map(|s| s.q[k]).sum::<f64>() / near.len() as f64);
        let moved = |s: &&Sample| s.q.iter().zip(&q).any(|(a, b)| (a - b).abs() > STILL);
        if near.iter().any(moved) {
            out.moving += 1;
            finish(&mut stop, begin, &mut out);
            continue;
        }
        let elsewhere =
            stop.sights.first().is_some_and(|(at, _)| at.iter().zip(&q).any(|(a, b)| (a - b).abs() > STILL));
        if elsewhere {
            finish(&mut stop, begin, &mut out);
        }
        stop.dir = motion.sense();
        stop.sights.push((q, *sight));
    }
    finish(&mut stop, begin, &mut out);
    out
}

/// The one in the middle.
fn middle(all: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = all.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

/// Leaves out what is farther from the median of a stop than so many times what is usual there, and than so many metres: a beam that was lost.
fn without_far(sights: &mut Vec<(Joints, Sight)>) -> usize {
    const TIMES: f64 = 10.0;
    const LEAST: f64 = 1e-4;
    let median: [f64; 3] = std::array::from_fn(|k| middle(sights.iter().map(|s| s.1.position[k])));
    let off = |s: &(Joints, Sight)| distance(&s.1.position, &median);
    let limit = LEAST.max(TIMES * middle(sights.iter().map(off)));
    let before = sights.len();
    sights.retain(|s| off(s) <= limit);
    before - sights.len()
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Ends a stop: its measurements become one row.
fn finish(stop: &mut Stop, begin: f64, out: &mut Stands) {
    let Stop { mut sights, dir } = std::mem::take(stop);
    out.far += without_far(&mut sights);
    let Some((_, first)) = sights.first() else { return };
    let n = sights.len() as f64;
    let mean = |of: &dyn Fn(&(Joints, Sight)) -> f64| sights.iter().map(of).sum::<f64>() / n;
    let q: Joints = std::array::from_fn(|k| mean(&|s| s.0[k]));
    let position = std::array::from_fn(|k| mean(&|s| s.1.position[k]));
    out.spread = sights.iter().map(|s| distance(&s.1.position, &position)).fold(out.spread, f64::max);
    let measured = match first.quaternion {
        None => Measured::Point { target: 0, position },
        Some(_) => {
            let sum = sights
                .iter()
                .filter_map(|s| s.1.quaternion)
                .fold(nalgebra::Matrix3::zeros(), |sum, q| sum + rotation_from_quaternion(q));
            // of rotations that are near each other the sum is nearly one: its nearest rotation is their mean
            let svd = sum.svd(true, true);
            let turn = svd
                .u
                .zip(svd.v_t)
                .map_or(rotation_from_quaternion(first.quaternion.unwrap_or([1.0, 0.0, 0.0, 0.0])), |(u, v)| u * v);
            Measured::Pose { position, quaternion: quaternion_from_rotation(&turn) }
        }
    };
    let rows = &mut out.rows;
    let seq = rows.len() as u64;
    let state = State { q, dir: Some(dir), t: Some(mean(&|s| s.1.t) - begin), ..State::at(&[]) };
    rows.push(Row { state, measured, seq: Some(seq), line: rows.len() + 2 });
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;

    fn names(all: &str) -> Vec<String> {
        all.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn joints_are_put_in_order_by_what_their_names_say() {
        let order = |all: &str, joints: Option<usize>| joint_order(&names(all), joints).map(|(order, _)| order);
        // as the drivers of Universal Robots publish them: by the alphabet
        let ur = "elbow_joint shoulder_lift_joint shoulder_pan_joint wrist_1_joint wrist_2_joint wrist_3_joint";
        assert_eq!(order(ur, Some(6)).unwrap(), [2, 1, 0, 3, 4, 5]);
        let panda = "panda_finger_joint1 panda_finger_joint2 panda_joint2 panda_joint1 panda_joint3 panda_joint4 panda_joint5 \
                     panda_joint6 panda_joint7";
        let panda = panda.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(order(&panda, Some(7)).unwrap(), [3, 2, 4, 5, 6, 7, 8]);
        assert_eq!(order(&panda, None).unwrap(), [3, 2, 4, 5, 6, 7, 8]);
        assert_eq!(order("a b c", Some(3)).unwrap(), [0, 1, 2]);
        let refused = order("a b c", Some(6)).unwrap_err();
        assert!(refused.contains("3 joints (a, b, c), and the robot has 6"), "{refused}");
    }

    #[test]
    fn what_was_seen_at_one_stop_is_one_row_and_what_was_seen_in_motion_is_none() {
        // 1 s at 0, 1 s on the way to 0.5, 1 s there, at 50 Hz
        let q = |t: f64| (0.5 * (t - 1.0)).clamp(0.0, 0.5);
        let samples: Vec<Sample> = (0..150)
            .map(|k| f64::from(k) * 0.02)
            .map(|t| Sample { t, q: std::array::from_fn(|j| if j == 0 { q(t) } else { 0.0 }) })
            .collect();
        let sights: Vec<Sight> = (0..31)
            .map(|k| f64::from(k) * 0.1)
            .map(|t| Sight { t, position: [q(t), 0.0, 1e-4 * (10.0 * t).round() % 2.0], quaternion: None })
            .chain([Sight { t: 9.0, position: [0.0; 3], quaternion: None }])
            .collect();
        let found = stands(&samples, &sights);
        assert_eq!((found.rows.len(), found.without), (2, 1));
        assert!((9..=13).contains(&found.moving), "{}", found.moving);
        let Measured::Point { position, .. } = found.rows[1].measured else { panic!("a point") };
        assert!((position[0] - 0.5).abs() < 1e-12 && (found.rows[1].state.q[0] - 0.5).abs() < 1e-12);
        assert_eq!(found.rows[1].state.dir.unwrap()[0], 1);
    }
}
