//! From targets to targets: the pose that the program wants, the joints that the full model needs for it, and the pose by
//! which the controller, which knows the nominal arm only, is brought to those joints.

use nalgebra::Vector3;
use trical_model::ik::{IkError, continue_from, inverse_kinematics, nearest_solution};
use trical_model::pose::rotation_vector;
use trical_model::{Forward, JointKind, Joints, MAX_JOINTS, Measured, Model, Pose, Site, State, Term, Workspace};

use super::branch::{Branches, Configuration};
use super::frames::{Frames, ToolFrame};
use super::literal::{MOST, Meant};
use super::scan::{Scan, Setup, Spot, Visit};
use super::text::{Span, written};
use super::{Options, ProgramError};
use crate::motion::MotionSense;

/// A correction of less than a few mm that asks more of a joint than this says that the arm is nearly singular there, rad.
const MOST_JOINT_MOVE: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Only a solution of the target before that is so near is taken without looking at the others, rad.
const NEAR: f64 = 0.35;

/// The same arm twice, with one tool: as the controller believes it and as it is.
struct Arm {
    nominal: Forward,
    model: Forward,
}

/// One tool in one frame.
struct Place {
    arm: usize,
    world_from_frame: Pose,
}

/// Everything that targets need, made once.
pub struct Compensator<'a> {
    scan: &'a Scan,
    bytes: &'a [u8],
    arms: Vec<Arm>,
    /// One for each setup of the scan, and one behind them for targets without.
    places: Vec<Result<Place, String>>,
    branches: Branches,
    slides: Vec<bool>,
    dof: usize,
    options: &'a Options,
}

/// Where the program's own target is, by the nominal arm, and how it is approached.
#[derive(Clone, Copy)]
pub struct Start {
    q: Joints,
    dir: [i8; MAX_JOINTS],
}

/// A target that is rewritten.
pub struct Done {
    /// New numbers.
    pub edits: Vec<(Span, String)>,
    /// How far the target moves, m.
    pub moved: f64,
    /// How far the arm is off before, by the model: m and rad.
    pub before: (f64, f64),
    /// The same with the numbers as written.
    pub after: (f64, f64),
    /// What the program wants, in {w}.
    pub wanted: Pose,
    /// Joints to which the controller will go.
    pub joints: Joints,
}

fn site_of_device(site: &Site) -> bool {
    matches!(site, Site::Tool(_) | Site::Payload(_) | Site::Target { .. })
}

/// Whether a term can move the tool in {w}.
fn moves_tool(term: &Term) -> bool {
    !matches!(
        term.site,
        Site::Target { .. }
            | Site::Fixture(_)
            | Site::Ball { .. }
            | Site::Frame { .. }
            | Site::Anchor { .. }
            | Site::LengthZero { .. }
    )
}

fn workspaces(arms: &[Arm]) -> Vec<(Workspace, Workspace)> {
    arms.iter().map(|a| (a.nominal.workspace(), a.model.workspace())).collect()
}

impl<'a> Compensator<'a> {
    /// Prepares arms and frames for what `scan` found.
    ///
    /// # Errors
    /// A term that needs what `options` does not say; tools of a kind that the model refuses.
    pub fn new(
        scan: &'a Scan,
        bytes: &'a [u8],
        nominal: &Model,
        model: &Model,
        frames: &'a Frames,
        options: &'a Options,
    ) -> Result<Self, ProgramError> {
        let input = |e: trical_model::ModelError| ProgramError::Input(e.to_string());
        let mut model = model.clone();
        model.terms.retain(moves_tool);
        if options.own_base {
            model.terms.retain(|t| !matches!(t.site, Site::Base(_)));
            model.cell.world_from_base = nominal.cell.world_from_base;
        }
        let mut this = Self {
            scan,
            bytes,
            arms: Vec::new(),
            places: Vec::new(),
            branches: Branches::of(&nominal.robot),
            slides: nominal.robot.joints.iter().map(|j| j.kind == JointKind::Prismatic).collect(),
            dof: nominal.robot.dof(),
            options,
        };
        let state = this.state(&[0.0; MAX_JOINTS], [0; MAX_JOINTS]);
        let anything = Measured::Touch { ball: 0, reading: [0.0; 3] };
        for term in &model.terms {
            if let Some(needs) = term.basis.missing(&state, &anything) {
                let how = match needs {
                    n if n.starts_with("temperature") => "--temp-c says at what temperature the program runs",
                    _ => "--time-s says when the program runs, in seconds since the recording began",
                };
                return Err(ProgramError::Input(format!("the model's term '{}' needs {needs}: {how}", term.name)));
            }
        }
        let world_from_controller = nominal.cell.world_from_base.compose(&frames.world.unwrap_or_else(Pose::identity));
        let mut tools: Vec<Option<ToolFrame>> = Vec::new();
        for setup in scan.setups.iter().chain(std::iter::once(&Setup::default())) {
            let (tool, frame) = (known_tool(setup, frames, options), known_frame(setup, frames, options));
            let place = match (tool, frame) {
                (Err(e), _) | (_, Err(e)) => Err(e),
                (Ok(tool), Ok(frame)) => {
                    let tool = tool.filter(|t| !t.is_of(&nominal.cell));
                    let arm = match tools.iter().position(|t| *t == tool) {
                        Some(k) => k,
                        None => {
                            this.arms.push(Arm {
                                nominal: Forward::new(with_tool(nominal, tool.as_ref()), Vec::new()).map_err(input)?,
                                model: Forward::new(with_tool(&model, tool.as_ref()), Vec::new()).map_err(input)?,
                            });
                            tools.push(tool);
                            tools.len() - 1
                        }
                    };
                    Ok(Place { arm, world_from_frame: world_from_controller.compose(&frame) })
                }
            };
            this.places.push(place);
        }
        Ok(this)
    }

    fn state(&self, q: &Joints, dir: [i8; MAX_JOINTS]) -> State {
        State {
            q: *q,
            q_commanded: None,
            dir: Some(dir),
            t: self.options.time_s,
            temp_c: self.options.temp_c,
            payload_kg: self.options.payload_kg,
        }
    }

    fn place(&self, spot: &Spot) -> Result<&Place, String> {
        if let (Some(a), Some(b)) = (spot.setup, spot.ambiguous) {
            let words = |k: u32| self.scan.setups.get(k as usize).map(in_words).unwrap_or_default();
            return Err(format!(
                "is used with {} and with {}; a target can be right for one of them only",
                words(a),
                words(b)
            ));
        }
        let k = spot.setup.map_or(self.scan.setups.len(), |k| k as usize);
        match self.places.get(k) {
            Some(Ok(place)) => Ok(place),
            Some(Err(e)) => Err(e.clone()),
            None => Err("its tool and frame are not known".into()),
        }
    }

    /// The numbers of a target, and what they mean.
    fn read(&self, spot: &Spot) -> Result<([f64; MOST], Meant), String> {
        let spans = self.scan.spans(spot);
        let count = spot.shape.count(self.dof);
        if spans.len() < count {
            return Err(format!("has {} joint values, and the robot has {} joints", spans.len(), self.dof));
        }
        let mut values = [0.0; MOST];
        for (to, span) in values.iter_mut().zip(spans).take(count) {
            *to = span.value(self.bytes).ok_or("holds something that is not a number")?;
        }
        Ok((values, spot.shape.meant(&values[..count], &self.slides)?))
    }

    /// Joints of the nominal arm at every target, in the order of the program: each continues from the one before. Targets
    /// that no motion names come last, in the order of the file. `give` gets them in blocks of `size`, in the order of the file,
    /// each as soon as it is known: what is done with it need not wait for the rest. `unwanted` is asked before each target; when
    /// it says true, nothing more is solved or given.
    pub fn starts(&self, size: usize, give: &mut dyn FnMut(Vec<Result<Start, String>>), unwanted: &dyn Fn() -> bool) {
        let mut out: Vec<Option<Result<Start, String>>> = vec![None; self.scan.spots.len()];
        let mut ws = workspaces(&self.arms);
        let mut last = [0.0; MAX_JOINTS];
        let mut sense = MotionSense::new(MotionSense::DEAD_BAND);
        let unvisited = {
            let mut seen = vec![false; self.scan.spots.len()];
            for v in &self.scan.visits {
                if let Visit::To(s) = v
                    && let Some(seen) = seen.get_mut(*s as usize)
                {
                    *seen = true;
                }
            }
            seen
        };
        let rest = unvisited.iter().enumerate().filter(|(_, seen)| !**seen).map(|(k, _)| Visit::To(k as u32));
        let mut given = 0;
        let mut known = 0;
        for visit in self.scan.visits.iter().copied().chain(rest) {
            if unwanted() {
                return;
            }
            while let Some(Some(_)) = out.get(known) {
                known += 1;
            }
            while known - given >= size {
                give(out[given..given + size].iter().flatten().cloned().collect());
                given += size;
            }
            match visit {
                Visit::Unknown => sense = MotionSense::new(MotionSense::DEAD_BAND),
                Visit::Near { spot, shift, in_tool } => {
                    match self.scan.spots.get(spot as usize).and_then(|s| self.near(s, &shift, in_tool, &last, &mut ws))
                    {
                        Some(q) => {
                            sense.push(&q);
                            last = q;
                        }
                        None => sense = MotionSense::new(MotionSense::DEAD_BAND),
                    }
                }
                Visit::To(k) => {
                    let (Some(spot), Some(slot)) = (self.scan.spots.get(k as usize), out.get_mut(k as usize)) else {
                        continue;
                    };
                    let q = match slot {
                        Some(Ok(known)) => Ok(known.q),
                        Some(Err(_)) => continue,
                        None => self.start(spot, &last, &mut ws),
                    };
                    if let Ok(q) = &q {
                        sense.push(q);
                        last = *q;
                    }
                    if slot.is_none() {
                        *slot = Some(q.map(|q| Start { q, dir: sense.sense() }));
                    }
                }
            }
        }
        let lost = || Err("is not reached by the program".into());
        let rest: Vec<_> = out.drain(given..).map(|s| s.unwrap_or_else(lost)).collect();
        rest.chunks(size).for_each(|block| give(block.to_vec()));
    }

    fn near(
        &self,
        spot: &Spot,
        shift: &Vector3<f64>,
        in_tool: bool,
        last: &Joints,
        ws: &mut [(Workspace, Workspace)],
    ) -> Option<Joints> {
        let place = self.place(spot).ok()?;
        let Meant::Pose(mut pose) = self.read(spot).ok()?.1 else { return None };
        pose.translation += if in_tool { pose.rotation * shift } else { *shift };
        let world = place.world_from_frame.compose(&pose);
        self.solve(place.arm, &world, &spot.configuration, last, &mut ws.get_mut(place.arm)?.0).ok()
    }

    fn start(&self, spot: &Spot, last: &Joints, ws: &mut [(Workspace, Workspace)]) -> Result<Joints, String> {
        let place = self.place(spot)?;
        match self.read(spot)?.1 {
            Meant::Joints(q) => {
                let robot = &self.arms[place.arm].nominal.model().robot;
                if !robot.within_limits(&q, 1e-9) {
                    return Err("the program's own joint values are beyond the limits of the robot".into());
                }
                Ok(q)
            }
            Meant::Pose(pose) => {
                let world = place.world_from_frame.compose(&pose);
                self.solve(place.arm, &world, &spot.configuration, last, &mut ws[place.arm].0)
                    .map_err(|e| format!("the program's own target: {e}"))
            }
        }
    }

    /// The nominal arm's joints at a pose, in the configuration that the text demands, else nearest to `last`.
    fn solve(
        &self,
        arm: usize,
        world: &Pose,
        demanded: &Configuration,
        last: &Joints,
        ws: &mut Workspace,
    ) -> Result<Joints, String> {
        let nominal = &self.arms[arm].nominal;
        let off = self.scan.configuration_off || self.options.configuration_off;
        let demanded = if off { &Configuration::Free } else { demanded };
        let seed = State::at(last);
        if let Ok(q) = continue_from(nominal, world, &seed, ws) {
            let far = q.iter().zip(last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if far < NEAR && self.branches.mismatch(demanded, &q) == Some(0) {
                return Ok(q);
            }
        }
        if *demanded == Configuration::Free {
            return nearest_solution(nominal, world, &seed, ws).map_err(|e| e.to_string());
        }
        let all = inverse_kinematics(nominal, world, &seed, ws).map_err(|e| e.to_string())?;
        // nearest first, so that the first of the best fits
        let best =
            all.iter().filter_map(|s| Some((self.branches.mismatch(demanded, &s.joints)?, s))).min_by_key(|x| x.0);
        best.map(|(_, s)| s.joints).ok_or_else(|| {
            format!(
                "no solution has the configuration that the text demands ({}); --any-configuration takes the one nearest to the target before",
                match demanded {
                    Configuration::Abb([a, b, c, d]) => format!("[{a},{b},{c},{d}]"),
                    Configuration::Kuka { t: Some(t), .. } => format!("T {t}"),
                    _ => "CONFIG".into(),
                }
            )
        })
    }

    /// Scratch space for [`Compensator::rewrite`], one a thread.
    #[must_use]
    pub fn workspaces(&self) -> Vec<(Workspace, Workspace)> {
        workspaces(&self.arms)
    }

    /// Rewrites one target.
    ///
    /// # Errors
    /// In words, why it stays as it is.
    pub fn rewrite(&self, spot: &Spot, start: &Start, ws: &mut [(Workspace, Workspace)]) -> Result<Done, String> {
        let place = self.place(spot)?;
        let arm = &self.arms[place.arm];
        let (nominal_ws, model_ws) = &mut ws[place.arm];
        let (values, meant) = self.read(spot)?;
        let wanted = match &meant {
            Meant::Pose(pose) => place.world_from_frame.compose(pose),
            Meant::Joints(q) => arm.nominal.world_from_tool(&State::at(q), nominal_ws),
        };
        let state = self.state(&start.q, start.dir);
        let before = apart(&arm.model.world_from_tool(&state, model_ws), &wanted);
        let joints = continue_from(&arm.model, &wanted, &state, model_ws).map_err(|e| match e {
            IkError::Singular { .. } | IkError::NotConverged { .. } => format!("near a singularity: {e}"),
            _ => e.to_string(),
        })?;
        let mut farthest = (0, 0.0_f64);
        for (k, (a, b)) in joints.iter().zip(&start.q).enumerate() {
            if !self.slides.get(k).copied().unwrap_or(false) && (a - b).abs() > farthest.1 {
                farthest = (k + 1, (a - b).abs());
            }
        }
        if farthest.1 > MOST_JOINT_MOVE {
            return Err(format!(
                "near a singularity: the correction would turn joint {} by {:.1} deg",
                farthest.0,
                farthest.1.to_degrees()
            ));
        }
        if let Some(how) = self.branches.changed(&start.q, &joints) {
            return Err(format!("the branch changes: {how}"));
        }
        let commanded = arm.nominal.world_from_tool(&State::at(&joints), nominal_ws);
        let new = match meant {
            Meant::Pose(_) => Meant::Pose(place.world_from_frame.inverse().compose(&commanded)),
            Meant::Joints(_) => Meant::Joints(joints),
        };
        let count = spot.shape.count(self.dof);
        let spans = self.scan.spans(spot);
        let numbers = spot.shape.numbers(&new, &values[..count], &meant, &self.slides);
        let mut edits = Vec::with_capacity(count);
        let mut read_back = values;
        for (k, (new, span)) in numbers.iter().zip(spans).enumerate().take(count) {
            let Some(x) = new else { continue };
            let text = written(*x, span.text(self.bytes), spot.shape.decimals(k));
            read_back[k] = text.parse().unwrap_or(*x);
            edits.push((*span, text));
        }
        if !self.scan.configuration_off && !self.options.configuration_off {
            let new = self.branches.rewritten(&spot.configuration, &start.q, &joints);
            let behind = spans.get(count..).unwrap_or(&[]);
            edits.extend(new.iter().zip(behind).filter_map(|(n, span)| Some((*span, (*n)?.to_string()))));
        }
        // what the controller will make of the new text, by the nominal arm, and where the real arm then is
        let reached = match spot.shape.meant(&read_back[..count], &self.slides)? {
            Meant::Joints(q) => q,
            Meant::Pose(pose) => {
                let world = place.world_from_frame.compose(&pose);
                continue_from(&arm.nominal, &world, &State::at(&joints), nominal_ws).map_err(|e| e.to_string())?
            }
        };
        let after = apart(&arm.model.world_from_tool(&self.state(&reached, start.dir), model_ws), &wanted);
        let moved = (commanded.translation - wanted.translation).norm();
        Ok(Done { edits, moved, before, after, wanted, joints: reached })
    }
}

fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    ((a.translation - b.translation).norm(), rotation_vector(&(a.rotation.transpose() * b.rotation)).norm())
}

/// A model with another tool: what was identified of the measuring device does not hold for it.
fn with_tool(model: &Model, tool: Option<&ToolFrame>) -> Model {
    let mut out = model.clone();
    if let Some(tool) = tool {
        out.cell.tool = tool.tool();
        out.terms.retain(|t| !site_of_device(&t.site));
    }
    out
}

/// `None` is the cell's tool.
fn known_tool(setup: &Setup, frames: &Frames, options: &Options) -> Result<Option<ToolFrame>, String> {
    let Some(name) = setup.tool.as_deref().or(options.tool.as_deref()) else { return Ok(None) };
    match frames.tools.get(&name.to_lowercase()) {
        Some(Ok(tool)) => Ok(Some(*tool)),
        Some(Err(e)) => Err(e.clone()),
        None => Err(format!("the tool '{name}' is not declared in the program (--frames FILE gives tools and frames)")),
    }
}

fn known_frame(setup: &Setup, frames: &Frames, options: &Options) -> Result<Pose, String> {
    let Some(name) = setup.frame.as_deref().or(options.frame.as_deref()) else { return Ok(Pose::identity()) };
    match frames.frames.get(&name.to_lowercase()) {
        Some(Ok(frame)) => Ok(*frame),
        Some(Err(e)) => Err(e.clone()),
        None => {
            Err(format!("the frame '{name}' is not declared in the program (--frames FILE gives tools and frames)"))
        }
    }
}

/// A setup for messages.
#[must_use]
pub fn in_words(setup: &Setup) -> String {
    let tool = setup.tool.as_deref().map_or("the cell's tool".to_owned(), |t| format!("tool '{t}'"));
    let frame = setup.frame.as_deref().map_or("the robot's base".to_owned(), |f| format!("'{f}'"));
    format!("{tool} in {frame}")
}
