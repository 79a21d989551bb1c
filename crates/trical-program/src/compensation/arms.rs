//! Everything that targets need, made once: both arms with every tool, and the frames.

use std::collections::{BTreeSet, HashMap};

use trical_model::{
    Forward, Joints, MAX_JOINTS, Measured, Model, Pose, Robot, Scope, Shape, Site, State, Term, Variable, Workspace,
};

use crate::branch::Branches;
use crate::error::ProgramError;
use crate::frames::{Frame, Frames};
use crate::literal::{MOST, Meant};
use crate::options::Options;
use crate::packed::External;
use crate::scan::{Scan, Setup, Spot};

/// The same arm twice, with one tool: as the controller believes it and as it is.
pub(super) struct Arm {
    pub(super) nominal: Forward,
    pub(super) model: Forward,
}

/// One tool in one frame.
pub(super) struct Place {
    pub(super) arm: usize,
    pub(super) world_from_frame: Pose,
}

/// Everything that targets need, made once.
pub struct Compensator<'a> {
    pub(super) scan: &'a Scan,
    pub(super) bytes: &'a [u8],
    pub(super) arms: Vec<Arm>,
    /// One for each setup of the scan, and one behind them for targets without.
    places: Vec<Result<Place, String>>,
    /// Of an arm on a rail that the program moves as an external axis: limits of the rail, m, and the arms where it stands, by that of the whole and
    /// where.
    rail: Option<[f64; 2]>,
    on_rail: HashMap<(usize, u64), usize>,
    pub(super) branches: Branches,
    pub(super) slides: Vec<bool>,
    pub(super) dof: usize,
    /// When the program runs, s and poses after the recording began.
    t: Option<f64>,
    seq: Option<f64>,
    session: Option<u32>,
    pub(super) options: &'a Options,
}

/// Long after any recording, s or poses.
const LONG_AFTER: f64 = 1e9;

/// When a program runs: as it was said, or long after the recording, where all that the model has of this variable comes to an end (the
/// arm is warm then, and what changed at once has changed).
fn when(said: Option<f64>, variable: Variable, model: &Model) -> Option<f64> {
    let ends = |t: &Term| matches!(t.basis.shape, Shape::WarmUp { .. } | Shape::Step { .. } | Shape::Tent { .. });
    let all_end = model.terms.iter().filter(|t| t.basis.of == variable).all(ends);
    said.or(all_end.then_some(LONG_AFTER))
}

/// Sessions in whose course something happened to the tool's place.
pub(crate) fn eventful(model: &Model) -> BTreeSet<u32> {
    let of_course = |t: &&Term| t.scope() == Scope::Course && t.moves_tool();
    model.terms.iter().filter(of_course).filter_map(|t| t.basis.session).collect()
}

/// The session in which a program runs, from 1: what happened in the course of one is the arm's at a stated moment of that session only.
fn session(model: &Model, options: &Options) -> Result<Option<u32>, ProgramError> {
    let is_moment = options.time_s.or(options.seq).is_some();
    let Some(asked) = &options.session else { return Ok(eventful(model).first().copied().filter(|_| is_moment)) };
    let [setting, time_s, seq] = ["session", "time_s", "seq"].map(|setting| options.spelling.of(setting));
    if !is_moment {
        let what = format!(
            "{setting}: found without {time_s} or {seq}, expected with one of them: when in this session the program runs"
        );
        return Err(ProgramError::Input(what));
    }
    let named: Vec<u32> = (1..).zip(&options.sessions).filter(|(_, name)| *name == asked).map(|(k, _)| k).collect();
    let numbered = (1..).zip(&options.sessions).find_map(|(k, _)| (asked.parse() == Ok(k)).then_some(k));
    match named[..] {
        [one] => Ok(Some(one)),
        [] if numbered.is_some() => Ok(numbered),
        _ => {
            let all: Vec<String> =
                (1..).zip(&options.sessions).map(|(k, name): (u32, _)| format!("{k} ({name})")).collect();
            let all = if all.is_empty() { "it has none".to_owned() } else { all.join(", ") };
            Err(ProgramError::Input(format!(
                "{setting}: found '{asked}', expected a session of the model by its number or its recording: {all}"
            )))
        }
    }
}

fn site_of_device(site: &Site) -> bool {
    matches!(site, Site::Tool(_) | Site::Payload(_) | Site::Target { .. })
}

/// Whether a term asks for what a joint's sensor measured: a program has no such reading.
pub(crate) fn by_measured_torque(term: &Term) -> bool {
    matches!(term.basis.of, Variable::Torque { .. })
}

/// What of a model holds where a program runs.
fn of_programs(model: &Model, nominal: &Model, options: &Options) -> Model {
    let mut model = model.clone().with_seen_tcp();
    model.terms.retain(|t| t.moves_tool() && !by_measured_torque(t));
    if options.own_base {
        model.terms.retain(|t| !matches!(t.site, Site::Base(_)));
        model.cell.world_from_base = nominal.cell.world_from_base;
    }
    model
}

/// Joints of a SCARA.
const SCARA: usize = 4;

/// Refuses a program whose columns say mm of a joint that turns, or deg of one that slides, and a SCARA's program for another arm.
fn check_arm(robot: &Robot, scan: &Scan) -> Result<(), ProgramError> {
    let joints = robot.dof();
    if let Some(letter) = scan.hand.filter(|_| joints > SCARA) {
        let letter = char::from(letter);
        return Err(ProgramError::Input(format!(
            "a position has the configuration '{letter}', as SCARA arms of {SCARA} joints have; the robot has {joints} joints"
        )));
    }
    let kinds = (1..=robot.dof()).map(|joint| robot.slides(joint));
    let Some((k, (slides, _))) = kinds.zip(&scan.in_mm).enumerate().find(|(_, (slides, mm))| slides != *mm) else {
        return Ok(());
    };
    let (does, expected) = if slides { ("slides", "mm") } else { ("turns", "deg") };
    let what = format!("joint {} of the robot {does}: expected a column q{}_{expected}", k + 1, k + 1);
    Err(ProgramError::Input(what))
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
        let model = of_programs(model, nominal, options);
        check_arm(&nominal.robot, scan)?;
        let moves_rail =
            nominal.robot.is_on_rail() && scan.spots.iter().any(|s| scan.written(s).external != External::None);
        let carried = if moves_rail { nominal.on_rail(0.0).map_err(input)?.robot } else { nominal.robot.clone() };
        let mut this = Self {
            scan,
            bytes,
            arms: Vec::new(),
            places: Vec::new(),
            rail: moves_rail.then(|| nominal.robot.joints[0].limits),
            on_rail: HashMap::new(),
            branches: Branches::of(&carried),
            slides: (1..=carried.dof()).map(|joint| carried.slides(joint)).collect(),
            dof: carried.dof(),
            t: when(options.time_s, Variable::Time, &model),
            seq: when(options.seq, Variable::Seq, &model),
            session: session(&model, options)?,
            options,
        };
        this.check_needs(&model)?;
        this.take_setups(nominal, &model, frames).map_err(input)?;
        this.put_on_rail().map_err(input)?;
        Ok(this)
    }

    /// Refuses a model with a term that asks for what nobody said of the program.
    fn check_needs(&self, model: &Model) -> Result<(), ProgramError> {
        let state = self.state(&[0.0; MAX_JOINTS], [0; MAX_JOINTS]);
        let anything = Measured::Touch { ball: 0, reading: [0.0; 3] };
        for term in &model.terms {
            if let Some(needs) = term.basis.missing(&state, &anything) {
                let (setting, what) = match term.basis.of {
                    Variable::Temperature { .. } => ("temp_c", "at what temperature the program runs"),
                    Variable::Seq => ("seq", "after how many poses of the recording the program runs"),
                    _ => ("time_s", "when the program runs, in seconds since the recording began"),
                };
                let setting = self.options.spelling.of(setting);
                let name = &term.name;
                return Err(ProgramError::Input(format!(
                    "the model's term '{name}' needs {needs}: {setting} says {what}"
                )));
            }
        }
        Ok(())
    }

    /// Makes the places of all setups, and the arms with their tools.
    fn take_setups(&mut self, nominal: &Model, model: &Model, frames: &Frames) -> trical_model::Result<()> {
        let world_from_controller = nominal.cell.world_from_base.compose(&frames.world.unwrap_or_else(Pose::identity));
        let mut tools: Vec<Option<Frame>> = Vec::new();
        for setup in self.scan.setups.iter().chain(std::iter::once(&Setup::default())) {
            let known = |is_tool| known(is_tool, setup, frames, self.options);
            let (tool, frame) = match known(true).and_then(|tool| Ok((tool, known(false)?))) {
                Ok((tool, frame)) => (tool.filter(|t| !t.is_of(&nominal.cell)), frame),
                Err(e) => {
                    self.places.push(Err(e));
                    continue;
                }
            };
            let arm = match tools.iter().position(|t| *t == tool) {
                Some(k) => k,
                None => {
                    self.arms.push(Arm {
                        nominal: Forward::new(with_tool(nominal, tool.as_ref()), Vec::new())?,
                        model: Forward::new(with_tool(model, tool.as_ref()), Vec::new())?,
                    });
                    tools.push(tool);
                    tools.len() - 1
                }
            };
            let frame = frame.map_or_else(Pose::identity, |f| f.parent_from_frame);
            self.places.push(Ok(Place { arm, world_from_frame: world_from_controller.compose(&frame) }));
        }
        Ok(())
    }

    /// Makes the arms that the program's targets need, the rail standing where they say.
    fn put_on_rail(&mut self) -> trical_model::Result<()> {
        if self.rail.is_none() {
            return Ok(());
        }
        for spot in &self.scan.spots {
            let External::First(at) = self.scan.written(spot).external else { continue };
            let Ok(whole) = self.place(spot).map(|place| place.arm) else { continue };
            if self.on_rail.contains_key(&(whole, at.to_bits())) {
                continue;
            }
            let carried = |f: &Forward| f.model().on_rail(at * 1e-3).and_then(|m| Forward::new(m, Vec::new()));
            let arm = Arm { nominal: carried(&self.arms[whole].nominal)?, model: carried(&self.arms[whole].model)? };
            self.arms.push(arm);
            self.on_rail.insert((whole, at.to_bits()), self.arms.len() - 1);
        }
        Ok(())
    }

    /// Which arm goes to a target: where the rail stands, if there is one.
    pub(super) fn arm(&self, spot: &Spot, place: &Place) -> Result<usize, String> {
        let Some([low, high]) = self.rail else { return Ok(place.arm) };
        match self.scan.written(spot).external {
            External::None => Err("does not say where the rail stands: its first external axis has no value".into()),
            External::Others => Err("places external axes beside the rail, which the model does not have".into()),
            External::First(at) if !(low..=high).contains(&(at * 1e-3)) => Err(format!(
                "places the rail (the first external axis) at {at} mm, beyond its limits {:.0} to {:.0} mm",
                low * 1e3,
                high * 1e3
            )),
            External::First(at) => {
                let known = self.on_rail.get(&(place.arm, at.to_bits())).copied();
                known.ok_or_else(|| "stands on a rail for which no arm was computed".into())
            }
        }
    }

    /// Joints of the whole arm: with where the rail stands, if there is one.
    pub(super) fn with_rail(&self, spot: &Spot, q: &Joints) -> Joints {
        match (self.rail, self.scan.written(spot).external) {
            (Some(_), External::First(at)) => {
                std::array::from_fn(|k| if k == 0 { at * 1e-3 } else { q.get(k - 1).copied().unwrap_or(0.0) })
            }
            _ => *q,
        }
    }

    pub(super) fn state(&self, q: &Joints, dir: [i8; MAX_JOINTS]) -> State {
        State {
            q: *q,
            q_commanded: None,
            dir: Some(dir),
            t: self.t,
            seq: self.seq,
            temp_c: self.options.temp_c,
            payload_kg: self.options.payload_kg,
            session: self.session,
            ..State::at(&[])
        }
    }

    pub(super) fn place(&self, spot: &Spot) -> Result<&Place, String> {
        if let (Some(a), Some(b)) = (spot.setup(), self.scan.ambiguous(spot)) {
            let words = |k: u32| self.scan.setups.get(k as usize).map(Setup::in_words).unwrap_or_default();
            return Err(format!(
                "is used with {} and with {}; a target can be right for one of them only",
                words(a),
                words(b)
            ));
        }
        let k = spot.setup().map_or(self.scan.setups.len(), |k| k as usize);
        match self.places.get(k) {
            Some(Ok(place)) => Ok(place),
            Some(Err(e)) => Err(e.clone()),
            None => Err("its tool and frame are not known".into()),
        }
    }

    /// The numbers of a target, and what they mean.
    pub(super) fn read(&self, spot: &Spot) -> Result<([f64; MOST], Meant), String> {
        let written = self.scan.written(spot);
        let elsewhere = !matches!(written.external, External::None | External::First(0.0));
        if elsewhere && self.rail.is_none() {
            return Err(if self.slides.contains(&true) || self.dof > 6 {
                "places an external axis (a track or positioner) too; of models with such axes only those of an arm on a rail, which is joint 1, are supported"
            } else {
                "places an external axis (a track or positioner), which the model does not have"
            }
            .into());
        }
        let spans = written.numbers;
        let count = spot.shape.count(self.dof);
        if spans.len() < count {
            return Err(format!("has {} joint values, and the robot has {} joints", spans.len(), self.dof));
        }
        let mut values = [0.0; MOST];
        for (k, (to, span)) in values.iter_mut().zip(&spans).enumerate().take(count) {
            *to =
                self.scan.value(*span, self.bytes).ok_or("holds something that is not a number")? * self.scan.scale(k);
        }
        Ok((values, spot.shape.meant(&values[..count], &self.slides)?))
    }

    /// Scratch space, one a thread.
    #[must_use]
    pub fn workspaces(&self) -> Vec<(Workspace, Workspace)> {
        self.arms.iter().map(|a| (a.nominal.workspace(), a.model.workspace())).collect()
    }
}

/// A model with another tool: what was identified of the measuring device does not hold for it.
fn with_tool(model: &Model, tool: Option<&Frame>) -> Model {
    let mut out = model.clone();
    if let Some(tool) = tool {
        out.cell.tool = tool.tool();
        out.terms.retain(|t| !site_of_device(&t.site));
    }
    out
}

/// The tool or the frame of a setup; `None` is the cell's tool, and the controller's world.
fn known(is_tool: bool, setup: &Setup, frames: &Frames, options: &Options) -> Result<Option<Frame>, String> {
    let (what, asked) = if is_tool { ("tool", &options.tool) } else { ("frame", &options.frame) };
    let Some(name) = setup.of(is_tool).or(asked.as_ref()) else { return Ok(None) };
    let undeclared = || {
        let frames = options.spelling.with("frames", "FILE");
        Err(format!("the {what} '{name}' is not declared in the program ({frames} gives tools and frames)"))
    };
    frames.of(is_tool).get(&name.to_lowercase()).cloned().unwrap_or_else(undeclared).map(Some)
}
