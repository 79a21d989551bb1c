//! One thread goes ahead through the program: the nominal arm's joints at every target.

mod ways;

use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};

use trical_model::ik::{all_closest, continue_from, inverse_kinematics, nearest_solution};
use trical_model::{Joints, MAX_JOINTS, Pose, State, Workspace};

use super::arms::Compensator;
use crate::branch::Configuration;
use crate::literal::Meant;
use crate::scan::{Fork, Near, Shift, Spot, Visit};
use trical_recording::motion::MotionSense;
use ways::{Block, Routine};

/// Motions to shifted places that are looked at one by one, at most.
pub const MOST_RELATIVE: usize = 1000;
/// Why a target is left.
const UNFIT: &str = "no solution has the configuration that the program demands";
/// Only a solution of the target before that is so near is taken without looking at the others, rad.
const NEAR: f64 = 0.35;

/// A motion to a place that is shifted against a target by what the text says.
#[derive(Clone, Copy, Debug)]
pub struct Shifted {
    /// The target, an index into `Scan::spots`.
    pub spot: u32,
    /// Where the motion stands in the file.
    pub at: u32,
    shift: Shift,
    start: Start,
}

/// What the walk through a program tells beside the joints at its targets.
#[derive(Debug, Default)]
pub struct Walked {
    /// Motions to shifted places, the first [`MOST_RELATIVE`] of them.
    pub shifted: Vec<Shifted>,
    /// The first target (an index into `Scan::spots`) whose turn no joints of the arm have, and which is taken all the same: the controller does
    /// not ask for it.
    pub without_turn: Option<u32>,
    /// Targets (as above) to which the program comes in another configuration, too, than the one they are corrected for.
    pub otherwise: BTreeSet<u32>,
    /// Targets whose configuration in the text no joints of the arm have there: how many, and the first.
    pub unlike: (usize, Option<u32>),
}

/// Where the program's own target is, by the nominal arm, and how it is approached.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub(super) q: Joints,
    pub(super) dir: [i8; MAX_JOINTS],
}

/// Where the nominal arm is as the program runs, and how it came there.
struct Walk<'a> {
    all: &'a Compensator<'a>,
    ws: Vec<(Workspace, Workspace)>,
    last: Joints,
    /// Where else it may be, since ways come together.
    others: Vec<Joints>,
    sense: MotionSense,
    /// Whether something told how it stands there.
    is_known: bool,
    /// Whether the program says near which joints the next target is, wherever the arm comes from.
    is_told_near: bool,
    on_path: bool,
    /// Targets whose configuration the controller asks for at some motion.
    asked: HashSet<u32>,
    /// Joints at targets to which the program comes again: nothing before it was there, an error where there are none.
    again: HashMap<u32, Option<Result<Joints, ()>>>,
    open: Vec<Block>,
    /// By half of their hashed names.
    routines: HashMap<u32, Routine>,
    /// Those that are being read, with where the arm was above each.
    within: Vec<(u32, Vec<Joints>)>,
    /// Loops that move the arm.
    repeated: HashSet<usize>,
    walked: Walked,
}

fn unknown_sense() -> MotionSense {
    MotionSense::new(MotionSense::DEAD_BAND)
}

impl Walk<'_> {
    fn go_near(&mut self, Near { spot, shift, at }: Near) {
        self.is_told_near = false;
        let (all, last) = (self.all, &self.last);
        let target = all.scan.spots.get(spot as usize);
        let demanded = self.demanded(spot);
        let Some(q) = target.and_then(|s| all.near(s, demanded, &shift, last, &mut self.ws)) else {
            self.sense = unknown_sense();
            return;
        };
        self.sense.push(&q);
        self.last = q;
        let near = |last| target.and_then(|s| all.near(s, demanded, &shift, last, &mut self.ws));
        let others: Vec<Joints> = self.others.iter().filter_map(near).collect();
        self.others = self.elsewhere(&others);
        self.moved_first(None);
        if self.walked.shifted.len() < MOST_RELATIVE {
            let start = Start { q, dir: self.sense.sense() };
            self.walked.shifted.push(Shifted { spot, at, shift, start });
        }
    }

    /// The configuration in which the arm comes to a target: on a path, that in which it is.
    fn demanded(&self, index: u32) -> Configuration {
        match self.all.scan.spots.get(index as usize) {
            Some(spot) if !(self.on_path && self.is_known) || self.asked.contains(&index) => {
                self.all.scan.configuration(spot)
            }
            _ => Configuration::Free,
        }
    }

    /// The joints at a target, and the configuration in which they reach it. On a path the controller asks for none, and a turn that no joints of
    /// the arm have says nothing: what else the text says is taken.
    fn solve(&mut self, index: u32, spot: &Spot) -> (Result<Joints, String>, Configuration) {
        let demanded = self.demanded(index);
        let found = self.all.start(spot, demanded, &self.last, &mut self.ws);
        if let Ok(q) = &found
            && !self.all.has(&demanded, q)
        {
            self.walked.unlike.0 += 1;
            self.walked.unlike.1.get_or_insert(index);
        }
        let is_asked = !self.on_path || self.asked.contains(&index);
        match demanded {
            Configuration::Kuka { s, t: Some(_) } if found.is_err() && !is_asked => {
                let left = s.map_or(Configuration::Free, |_| Configuration::Kuka { s, t: None });
                let found = self.all.start(spot, left, &self.last, &mut self.ws);
                if found.is_ok() {
                    self.walked.without_turn.get_or_insert(index);
                }
                (found, left)
            }
            _ => (found, demanded),
        }
    }

    /// The joints at a target are those of its first visit, which returns them; a target without a solution is passed over.
    fn go_to(&mut self, index: u32, spot: &Spot) -> Option<Result<Start, String>> {
        let known = self.again.get(&index).copied().flatten();
        let by_way = self.is_decided_by_way(index, spot);
        let is_told = std::mem::take(&mut self.is_told_near);
        let from = if known.is_some() { self.here() } else { self.others.clone() };
        let (q, demanded) = match known {
            Some(Ok(q)) => (Ok(q), self.demanded(index)),
            Some(Err(())) => return None,
            None => self.solve(index, spot),
        };
        if let Ok(q) = &q {
            self.sense.push(q);
            self.last = *q;
            self.is_known |= spot.shape.is_joints() || demanded != Configuration::Free;
            let others = if by_way { self.come_otherwise(index, q, &from) } else { Vec::new() };
            self.others = self.elsewhere(&others);
            self.moved_first((by_way && !is_told).then_some((index, *q)));
        }
        if let Some(again) = self.again.get_mut(&index) {
            *again = Some(q.clone().map_err(drop));
        }
        known.is_none().then(|| q.map(|q| Start { q, dir: self.sense.sense() }))
    }
}

impl Compensator<'_> {
    /// Where loops begin that move the arm, as indices of visits.
    fn moving_loops(&self) -> HashSet<usize> {
        let mut open: Vec<(usize, bool)> = Vec::new();
        let mut moving = HashSet::new();
        for (index, visit) in self.scan.visits.iter().enumerate() {
            match visit {
                Visit::Fork(Fork::Opens | Fork::Repeats) => open.push((index, false)),
                Visit::Fork(Fork::Closes) => {
                    let Some((begin, true)) = open.pop() else { continue };
                    moving.insert(begin);
                    if let Some((_, moves)) = open.last_mut() {
                        *moves = true;
                    }
                }
                Visit::Fork(Fork::Anywhere) | Visit::To(_) | Visit::Near(_) | Visit::Unknown | Visit::Call(_) => {
                    if let Some((_, moves)) = open.last_mut() {
                        *moves = true;
                    }
                }
                _ => {}
            }
        }
        moving
    }

    /// Targets whose configuration the controller asks for at some motion.
    fn asked(&self) -> HashSet<u32> {
        let mut on_path = false;
        let asked = |v: &Visit| match v {
            Visit::OnPath(is) => {
                on_path = *is;
                None
            }
            _ if on_path => None,
            Visit::To(spot) => Some(*spot),
            Visit::Near(k) => self.scan.near.get(*k as usize).map(|near| near.spot),
            _ => None,
        };
        // without paths nobody wants to know
        let has_paths = self.scan.visits.iter().any(|v| matches!(v, Visit::OnPath(true)));
        if has_paths { self.scan.visits.iter().filter_map(asked).collect() } else { HashSet::new() }
    }

    /// Whether motions name each target, and the targets that several name.
    fn visited(&self) -> (Vec<bool>, HashSet<u32>) {
        let (mut once, mut again) = (vec![false; self.scan.spots.len()], HashSet::new());
        for v in &self.scan.visits {
            if let Visit::To(s) = v
                && let Some(seen) = once.get_mut(*s as usize)
                && std::mem::replace(seen, true)
            {
                again.insert(*s);
            }
        }
        (once, again)
    }

    /// Joints of the nominal arm at every target, in the order of the program: each continues from the one before. Targets
    /// that no motion names come last, in the order of the file. `give` gets them in blocks of `size`, in the order of the file,
    /// each as soon as it is known: what is done with it need not wait for the rest. `unwanted` is asked before each target; when
    /// it says true, nothing more is solved or given.
    pub fn starts(
        &self,
        size: usize,
        give: &mut dyn FnMut(Vec<Result<Start, String>>),
        unwanted: &dyn Fn() -> bool,
    ) -> Walked {
        let (once, again) = self.visited();
        let unvisited = (0..).zip(once).filter(|(_, once)| !once).map(|(k, _)| Visit::To(k));
        let mut walk = Walk {
            all: self,
            ws: self.workspaces(),
            last: [0.0; MAX_JOINTS],
            sense: unknown_sense(),
            is_known: false,
            is_told_near: false,
            on_path: false,
            asked: self.asked(),
            again: again.into_iter().map(|spot| (spot, None)).collect(),
            open: Vec::new(),
            routines: HashMap::new(),
            within: Vec::new(),
            others: Vec::new(),
            repeated: self.moving_loops(),
            walked: Walked::default(),
        };
        // from target `given` on: what is known of each, up to the last of which something is; `known` of them without a gap
        let (mut given, mut known, mut waiting) = (0, 0, VecDeque::new());
        // what stands above the first motion that says how the arm stands, as routines do, comes from somewhere behind it
        let visits = &self.scan.visits;
        let seed = self.scan.first_seed().unwrap_or(0);
        let order = (seed..visits.len()).chain(0..seed);
        visits.iter().take(seed).for_each(|visit| walk.above(visit));
        walk.on_path =
            visits.iter().take(seed).rev().find_map(|v| if let Visit::OnPath(is) = v { Some(*is) } else { None })
                == Some(true);
        let in_order = order.filter_map(|k| Some((k, visits.get(k).copied()?)));
        for (index, visit) in in_order.chain((visits.len()..).zip(unvisited)) {
            if unwanted() {
                return walk.walked;
            }
            // of a target that no motion names its own configuration is all that is known
            walk.on_path &= index < visits.len();
            if index >= visits.len() {
                walk.others.clear();
            }
            if index == 0 {
                // whence, nobody knows
                walk.sense = unknown_sense();
                walk.open.clear();
                walk.within.clear();
                walk.others.clear();
            }
            while let Some(Some(_)) = waiting.get(known) {
                known += 1;
            }
            while known >= size {
                give(waiting.drain(..size).flatten().collect());
                (given, known) = (given + size, known - size);
            }
            match visit {
                Visit::Unknown => walk.sense = unknown_sense(),
                Visit::Fork(fork) => walk.branch(index, fork),
                Visit::Routine(routine) => walk.begin(routine),
                Visit::Ends => walk.end(),
                Visit::Call(routine) => walk.call(routine),
                Visit::Like(k) => {
                    walk.last = self.scan.nearest.get(k as usize).copied().unwrap_or(walk.last);
                    (walk.is_known, walk.is_told_near) = (true, true);
                    walk.others.clear();
                }
                Visit::OnPath(is) => walk.on_path = is,
                Visit::Near(k) => self.scan.near.get(k as usize).into_iter().for_each(|near| walk.go_near(*near)),
                Visit::To(k) => {
                    let start = self.scan.spots.get(k as usize).and_then(|spot| walk.go_to(k, spot));
                    // those that are given were gone to before
                    let (Some(start), Some(place)) = (start, (k as usize).checked_sub(given)) else { continue };
                    waiting.resize(waiting.len().max(place + 1), None);
                    waiting[place] = Some(start);
                }
            }
        }
        let lost = || Err("is not reached by the program".into());
        waiting.resize(self.scan.spots.len() - given, None);
        while !waiting.is_empty() {
            let block = waiting.drain(..size.min(waiting.len()));
            give(block.map(|start| start.unwrap_or_else(lost)).collect());
        }
        walk.walked
    }

    /// How far the arm is off at a shifted place before and after its target was rewritten, by the model, m. `wanted` is where the
    /// program's own target has the tool in {w}, `commanded` where the new numbers send the nominal arm's.
    pub fn remaining_errors(
        &self,
        shifted: &Shifted,
        wanted: &Pose,
        commanded: &Pose,
        ws: &mut [(Workspace, Workspace)],
    ) -> Option<(f64, f64)> {
        let spot = self.scan.spots.get(shifted.spot as usize)?;
        let place = self.place(spot).ok()?;
        let index = self.arm(spot, place).ok()?;
        let (arm, (nominal_ws, model_ws)) = (self.arms.get(index)?, ws.get_mut(index)?);
        let moved = |pose: &Pose| {
            let axes = if shifted.shift.in_tool { &pose.rotation } else { &place.world_from_frame.rotation };
            Pose { translation: pose.translation + axes * shifted.shift.by, ..*pose }
        };
        let (wanted, asked, start) = (moved(wanted), moved(commanded), &shifted.start);
        let q = self.continued(&arm.nominal, &asked, &State::at(&start.q), nominal_ws).ok()?;
        let mut off = |q: &Joints| {
            let reached = arm.model.world_from_tool(&self.state(q, start.dir), model_ws);
            (reached.translation - wanted.translation).norm()
        };
        Some((off(&start.q), off(&q)))
    }

    fn near(
        &self,
        spot: &Spot,
        demanded: Configuration,
        shift: &Shift,
        last: &Joints,
        ws: &mut [(Workspace, Workspace)],
    ) -> Option<Joints> {
        let place = self.place(spot).ok()?;
        let Meant::Pose(mut pose) = self.read(spot).ok()?.1 else { return None };
        pose.translation += if shift.in_tool { pose.rotation * shift.by } else { shift.by };
        let world = place.world_from_frame.compose(&pose);
        let arm = self.arm(spot, place).ok()?;
        self.solve(arm, &world, demanded, last, &mut ws.get_mut(arm)?.0).ok()
    }

    fn start(
        &self,
        spot: &Spot,
        demanded: Configuration,
        last: &Joints,
        ws: &mut [(Workspace, Workspace)],
    ) -> Result<Joints, String> {
        let place = self.place(spot)?;
        let arm = self.arm(spot, place)?;
        match self.read(spot)?.1 {
            Meant::Joints(q) => {
                let robot = &self.arms[arm].nominal.model().robot;
                if !robot.within_limits(&q, 1e-9) {
                    return Err("the program's own joint values are beyond the limits of the robot".into());
                }
                Ok(q)
            }
            Meant::Pose(pose) => {
                let world = place.world_from_frame.compose(&pose);
                self.solve(arm, &world, demanded, last, &mut ws[arm].0)
                    .map_err(|e| format!("the program's own target: {e}"))
            }
        }
    }

    /// The configuration that the controller keeps to: ABB's may be switched off.
    pub(super) fn kept(&self, demanded: Configuration) -> Configuration {
        let off = self.scan.configuration_off || self.options.any_configuration;
        if off && matches!(demanded, Configuration::Abb(_)) { Configuration::Free } else { demanded }
    }

    /// Whether joints have all of the configuration that the text demands.
    fn has(&self, demanded: &Configuration, q: &Joints) -> bool {
        let kept = self.kept(*demanded);
        self.branches.mismatch(&kept, q).is_some() && self.branches.unlike(&kept, q) == 0
    }

    /// The nominal arm's joints at a pose, in the configuration that the text demands, else nearest to `last`.
    fn solve(
        &self,
        arm: usize,
        world: &Pose,
        demanded: Configuration,
        last: &Joints,
        ws: &mut Workspace,
    ) -> Result<Joints, String> {
        let nominal = &self.arms[arm].nominal;
        if self.dof > 6 {
            // the controller chooses by rules of its own, and how far the arm is off depends on it
            return Err(format!(
                "a pose, which an arm of {} joints reaches in infinitely many ways; expected joint values",
                self.dof
            ));
        }
        let demanded = self.kept(demanded);
        let seed = State::at(last);
        let is_next = |q: &Joints| {
            let far = q.iter().zip(last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            far < NEAR && self.branches.mismatch(&demanded, q) == Some(0)
        };
        if self.dof < 6 {
            // rounded to the text's decimals, the pose is none that such an arm takes
            let all = all_closest(nominal, world, &seed, ws, is_next).map_err(|e| e.to_string())?;
            let fits = |q: &&Joints| self.branches.mismatch(&demanded, q).is_some();
            return all.iter().find(fits).copied().ok_or_else(|| UNFIT.to_owned());
        }
        if let Ok(q) = continue_from(nominal, world, &seed, ws)
            && is_next(&q)
        {
            return Ok(q);
        }
        if demanded == Configuration::Free {
            return nearest_solution(nominal, world, &seed, ws).map_err(|e| e.to_string());
        }
        let all = inverse_kinematics(nominal, world, &seed, ws).map_err(|e| e.to_string())?;
        // nearest first, so that the first of the best fits
        let best =
            all.iter().filter_map(|s| Some((self.branches.mismatch(&demanded, &s.joints)?, s))).min_by_key(|x| x.0);
        if best.is_none() && self.options.any_configuration {
            return nearest_solution(nominal, world, &seed, ws).map_err(|e| e.to_string());
        }
        best.map(|(_, s)| s.joints).ok_or_else(|| {
            format!(
                "{UNFIT} ({}); {} takes the solution nearest to the previous target",
                match demanded {
                    Configuration::Abb([a, b, c, d]) => format!("[{a},{b},{c},{d}]"),
                    Configuration::Kuka { t: Some(t), .. } => format!("T {t}"),
                    _ => "CONFIG".into(),
                },
                self.options.spelling.of("any_configuration")
            )
        })
    }
}
