//! The one way from recordings to a calibration: which joint angles to use, gross errors, what sessions share, the fit, and what it is worth
//! at poses, blocks and sessions that it did not see. Command line, Python and reports show what this returns.

pub mod by_place;
pub(crate) mod held_out;
pub mod joint_choice;

use serde::Serialize;
use serde::ser::SerializeMap;
use trical_model::{Cell, MAX_JOINTS, Model, Motion, Recording, Robot, Site, Task};
use trical_recording::CsvStream;

use crate::calibration::by_place::{ByPlace, MeasuredDistance, OfPlace, TriedByPlace, choose, doubtful_places};
use crate::calibration::held_out::held_out;
pub use crate::calibration::held_out::{BY_BLOCK, FORWARD, HeldOut, cross_validate, forward_in_time, score_sessions};
use crate::calibration::joint_choice::clean;
use crate::dataset::torque_load::{TorqueLoad, torque_loads};
use crate::dataset::{Dataset, JointSource, Rejected};
use crate::error::{IdentError, Result};
use crate::fit::cautions::{
    EVEN_MASSES, beyond_limits, cautions, coincident, held, loads_left_out, near_nominal, no_arm, odd_units,
    shared_errors, too_many, which_target, without_masses,
};
use crate::fit::choice::{Choice, Elasticity, OwnSetup, ParameterSet, measured_torques};
use crate::fit::folds::Folds;
use crate::fit::identifiability::Dependent;
use crate::fit::identify::{ErrorSummary, Identified, identify};
use crate::fit::orientation::{AngleSummary, orientation};
use crate::fit::read_otherwise::read_otherwise;
use crate::fit::stream::identify_stream;
use crate::rigid::moved;
use crate::units::shown;

/// Beyond so many measurements errors at unseen poses are worked out only where they are asked for, and standard deviations are those of
/// independent measurements.
const SCORED: usize = 40_000;

/// Which sessions share a tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToolSharing {
    /// Sessions whose measurements do not say otherwise.
    #[default]
    FromData,
    /// All sessions.
    Same,
    /// No sessions: each has its own.
    Own,
}

/// What is asked of a calibration.
#[derive(Clone, Debug)]
pub struct Options {
    /// Which parameters.
    pub choice: Choice,
    /// Which joint angles to use; `None`: whichever the model explains better.
    pub joints: Option<JointSource>,
    /// Keep gross errors.
    pub keep_outliers: bool,
    /// Score every pose by a fit without it, in so many folds, beside what is always scored.
    pub folds: Option<usize>,
    /// Score the last so many percent of each recording's poses by a fit to those before.
    pub hold_out_last: Option<usize>,
    /// Which sessions share a tool.
    pub tool: ToolSharing,
}

impl Options {
    /// These parameters, and nothing else.
    #[must_use]
    pub fn new(choice: impl Into<Choice>) -> Self {
        Self {
            choice: choice.into(),
            joints: Some(JointSource::Read),
            keep_outliers: false,
            folds: None,
            hold_out_last: None,
            tool: ToolSharing::FromData,
        }
    }
}

/// What a session does not share with the first one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SessionSetup {
    /// Name of its recording.
    pub recording: String,
    /// "tool", "balls": what was identified for this session alone.
    pub own: Vec<&'static str>,
    /// How far each of `own` is from the first session's, mm; of several targets the root mean square.
    pub differs_mm: Vec<f64>,
}

impl SessionSetup {
    /// "second.csv: tool of its own, 2.000 mm from the first session's"; `None` for a session that shares everything.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        let each = self.own.iter().zip(&self.differs_mm).map(|(what, mm)| format!("{what} of its own, {mm:.3} mm"));
        let all = each.collect::<Vec<_>>().join(", and ");
        (!all.is_empty()).then(|| format!("{}: {all} from the first session's", self.recording))
    }
}

/// A fitted model, what it was fitted to and what it is worth.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The fit.
    pub fitted: Identified,
    /// The nominal arm, its frame and tool identified.
    pub nominal: Model,
    /// Errors of the nominal arm, m, one for each observation of `fitted.data`.
    pub each_before: Vec<f64>,
    /// Errors of the nominal arm at all rows, summed up.
    pub before: ErrorSummary,
    /// Errors of the fit at all rows.
    pub errors: ErrorSummary,
    /// Errors of orientation, of the nominal arm and of the fit, where full poses were measured.
    pub orientation: Option<[AngleSummary; 2]>,
    /// Errors at poses that the fit did not see.
    pub held_out: HeldOut,
    /// As asked: folds, and errors.
    pub cross_validation: Option<(usize, ErrorSummary)>,
    /// As asked: percent, and errors.
    pub forward_in_time: Option<(usize, ErrorSummary)>,
    /// Measurements used.
    pub observations: usize,
    /// Number of poses of `fitted.data`.
    pub poses: usize,
    /// Number of blocks of neighbouring poses of `fitted.data` ([`Folds::blocks`]).
    pub blocks: usize,
    /// Rows that were rejected.
    pub rejected: usize,
    /// The rejected rows that are named.
    pub named: Vec<Rejected>,
    /// Whether gross errors were looked for.
    pub cleaned: bool,
    /// From what it is known how far joints give way.
    pub elasticity: Elasticity,
    /// Passes over the files, where they were not read at once.
    pub passes: Option<usize>,
    /// What each session has of its own; empty for one session.
    pub sessions: Vec<SessionSetup>,
    /// Distances between balls at each unknown place, by the arm that the other places say.
    pub distances: Vec<MeasuredDistance>,
    /// What each unknown place is like by that arm.
    pub places: Vec<OfPlace>,
    /// Physics that was tried at places held out.
    pub tried: Vec<TriedByPlace>,
    /// What each session carries beside the first, by measured joint torques.
    pub loads: Vec<TorqueLoad>,
    /// How files that were read in passes were read: rows that were left out.
    pub notes: Vec<String>,
    /// What to look at where readings are not what their columns say.
    pub read_otherwise: Option<String>,
}

impl Calibration {
    /// Errors at poses that the fit did not see; folds or the last poses that were asked for stand in the place of the usual ones.
    #[must_use]
    pub fn unseen(&self) -> HeldOut {
        HeldOut {
            by_block: self.cross_validation.map(|(_, e)| e).or(self.held_out.by_block),
            forward: self.forward_in_time.map(|(_, e)| e).or(self.held_out.forward),
            ..self.held_out
        }
    }

    /// What should make one look twice.
    #[must_use]
    pub fn cautions(&self) -> Vec<String> {
        let f = &self.fitted;
        let mut out = no_arm(self.errors.mean_mm, self.orientation.as_ref().map(|[_, after]| after.mean_deg));
        out.extend(cautions(&f.model, f.observability.rows, f.free.len()));
        out.extend(self.read_otherwise.clone());
        out.extend(beyond_limits(&f.model.robot, &f.data));
        out.extend(odd_units(&f.model.robot));
        if self.tried.iter().any(|t| t.kept && t.added.contains("sag")) {
            out.push(EVEN_MASSES.into());
        } else {
            out.extend(without_masses(self.elasticity, &f.model));
        }
        out.extend(loads_left_out(self.elasticity, &f.model.robot, &f.data));
        if f.model.cell.balls.len() == 1 && f.model.cell.anchors.is_empty() && f.data.frames() == 0 {
            out.push("no distance between balls is known: the scale is held by the arm's nominal lengths alone".into());
        }
        out.extend(which_target(&f.data, f.model.cell.tool.targets.len()));
        out.extend(coincident(&f.model.robot));
        out.extend(doubtful_places(&self.places));
        out.extend(held(&f.model.robot, &f.data, &f.held()));
        out.extend(near_nominal(&f.kept_near_nominal()));
        out.extend(shared_errors(f.design_effect));
        out.extend(self.notes.iter().cloned());
        if self.passes.is_none() {
            out.extend(too_many(f.free.len() as f64, f.free.len(), &Folds::of(&f.data)));
        }
        out
    }
}

#[derive(Serialize)]
struct WorstHeldOut {
    how: &'static str,
    mean_mm: f64,
    rms_mm: f64,
}

#[derive(Serialize)]
struct LastPercent {
    #[serde(flatten)]
    errors: ErrorSummary,
    last_percent: usize,
}

#[derive(Serialize)]
struct InFolds {
    #[serde(flatten)]
    errors: ErrorSummary,
    folds: usize,
}

/// In the shape of `docs/formats.md`.
impl Serialize for Calibration {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let f = &self.fitted;
        let together = |d: &Dependent| std::iter::once(&d.name).chain(&d.with).cloned().collect::<Vec<String>>();
        let dependent = f.dependent.iter().filter(|d| !d.held).map(together).collect::<Vec<_>>();
        let parameters = f.free.iter().map(|k| shown(&f.model, &f.model.terms[*k])).collect::<Vec<_>>();
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("cautions", &self.cautions())?;
        map.serialize_entry("recordings", &f.data.names)?;
        map.serialize_entry("joints", &f.data.joints)?;
        map.serialize_entry("observations", &self.observations)?;
        map.serialize_entry("outliers", &self.named.iter().map(|r| r.row).collect::<Vec<_>>())?;
        map.serialize_entry("rejected", &self.named)?;
        map.serialize_entry("rejected_rows", &self.rejected)?;
        map.serialize_entry("poses", &self.poses)?;
        map.serialize_entry("blocks", &self.blocks)?;
        map.serialize_entry("parameters", &parameters)?;
        map.serialize_entry("not_identifiable", &dependent)?;
        map.serialize_entry("held", &f.held())?;
        map.serialize_entry("near_nominal", &f.kept_near_nominal())?;
        map.serialize_entry("elasticity", &self.elasticity)?;
        map.serialize_entry("correlated", &f.correlated(0.9))?;
        map.serialize_entry("at_limit", &f.stopped())?;
        map.serialize_entry("design_effect", &f.design_effect)?;
        map.serialize_entry("observability", &f.observability)?;
        map.serialize_entry("fit", &f.report)?;
        map.serialize_entry("before", &self.before)?;
        map.serialize_entry("errors", &self.errors)?;
        map.serialize_entry("rms_mm", &self.errors.rms_mm)?;
        map.serialize_entry("max_mm", &self.errors.max_mm)?;
        map.serialize_entry("mean_mm", &self.errors.mean_mm)?;
        map.serialize_entry("rms_nominal_mm", &self.before.rms_mm)?;
        map.serialize_entry("max_nominal_mm", &self.before.max_mm)?;
        map.serialize_entry("mean_nominal_mm", &self.before.mean_mm)?;
        if let Some(orientation) = &self.orientation {
            map.serialize_entry("orientation", orientation)?;
        }
        map.serialize_entry("held_out", &self.held_out)?;
        let worst = self.held_out.worst().map(|(how, e)| WorstHeldOut { how, mean_mm: e.mean_mm, rms_mm: e.rms_mm });
        map.serialize_entry("worst_held_out", &worst)?;
        map.serialize_entry("sessions", &self.sessions)?;
        if !self.distances.is_empty() {
            map.serialize_entry("distances", &self.distances)?;
        }
        if !self.tried.is_empty() {
            map.serialize_entry("tried_by_place", &self.tried)?;
        }
        if !self.loads.is_empty() {
            map.serialize_entry("loads", &self.loads)?;
        }
        if let Some(passes) = self.passes {
            map.serialize_entry("passes", &passes)?;
        }
        if let Some((last_percent, errors)) = self.forward_in_time {
            map.serialize_entry("forward_in_time", &LastPercent { errors, last_percent })?;
        }
        if let Some((folds, errors)) = self.cross_validation {
            map.serialize_entry("cross_validation", &InFolds { errors, folds })?;
        }
        map.end()
    }
}

fn torques_of(recordings: &[Recording]) -> [bool; MAX_JOINTS] {
    measured_torques(recordings.iter().flat_map(|r| &r.rows).map(|row| &row.state))
}

/// Calibrates an arm from recordings of it, one session each.
///
/// # Errors
/// Recordings that cannot be used or fitted, in one sentence; see [`identify`].
pub fn calibrate(
    robot: &Robot,
    cell: &Cell,
    recordings: &[Recording],
    options: &Options,
    task: &Task<'_>,
) -> Result<Calibration> {
    let set = options.choice.set();
    // a robot file that says half is refused before anything else is told
    options.choice.elasticity_of(robot, torques_of(recordings))?;
    task.step(0.05, "looking for gross errors")?;
    let data = clean(robot, cell, recordings, options.joints, set, options.keep_outliers)?;
    task.step(0.2, "fitting")?;
    let own = own_setup(robot, cell, &data, &options.choice, options.tool)?;
    let choice = options.choice.clone().with_own(own);
    let (robot, choice, tried) = choose(robot, cell, &data, &choice)?;
    let robot = &robot;
    let elasticity = choice.elasticity(robot, &data)?;
    let mut fitted = identify(robot, cell, &data, choice.clone())?;
    let few = data.observations.len() <= SCORED;
    if few {
        fitted = fitted.with_shared_errors()?;
    }
    let after = fitted.errors()?;
    let errors = ErrorSummary::of(&after);
    refuse_no_arm(set, errors)?;
    let nominal = identify(robot, cell, &data, Choice::from(ParameterSet::Nominal).with_own(choice.own().clone()))?;
    let each_before = nominal.errors()?;
    let folds = Folds::of(&data);
    let forward_in_time = options
        .hold_out_last
        .map(|percent| -> Result<_> {
            task.step(0.4, "forward in time")?;
            let errors = forward_in_time(robot, cell, &data, choice.clone(), percent)?;
            Ok((percent, ErrorSummary::of(&errors)))
        })
        .transpose()?;
    task.step(0.5, "scoring poses that the fit did not see")?;
    let cross_validation = options
        .folds
        .map(|k| cross_validate(robot, cell, &data, choice.clone(), k).map(|e| (k, ErrorSummary::of(&e))))
        .transpose()?;
    let (held_out, at_places) = if few {
        held_out(robot, cell, &data, &folds, &choice, task)?
    } else {
        (HeldOut::default(), ByPlace::default())
    };
    task.step(1.0, "done")?;
    Ok(Calibration {
        orientation: orientation([&nominal.model, &fitted.model].map(|m| (m, &fitted.data)))?,
        nominal: nominal.model,
        before: ErrorSummary::of(&each_before),
        errors,
        each_before,
        held_out,
        cross_validation,
        forward_in_time,
        observations: data.observations.len(),
        poses: folds.poses().len(),
        blocks: folds.blocks(),
        rejected: data.rejected.len(),
        named: data.rejected.clone(),
        cleaned: !options.keep_outliers,
        elasticity,
        passes: None,
        notes: Vec::new(),
        sessions: session_setups(&fitted),
        distances: at_places.distances,
        places: at_places.places,
        tried,
        loads: torque_loads(robot, cell, &data)?,
        read_otherwise: read_otherwise(&fitted),
        fitted,
    })
}

/// As [`calibrate`], from CSV files that are read in passes: what is scored at unseen poses is left out, and sessions share their tool.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_stream(
    robot: &Robot,
    cell: &Cell,
    stream: &CsvStream,
    options: &Options,
    task: &Task<'_>,
) -> Result<Calibration> {
    let set = options.choice.set();
    let sample = stream.sample()?;
    options.choice.elasticity_of(robot, torques_of(&sample.recordings))?;
    let data = clean(robot, cell, &sample.recordings, options.joints, set, options.keep_outliers)?;
    let elasticity = options.choice.elasticity(robot, &data)?;
    task.step(0.2, "fitting in passes")?;
    let streamed = identify_stream(robot, cell, stream, &data, options.choice.clone(), options.keep_outliers)?;
    refuse_no_arm(set, streamed.errors)?;
    // of what is drawn: the sample
    let nominal = identify(robot, cell, &streamed.identified.data, ParameterSet::Nominal)?;
    task.step(1.0, "done")?;
    Ok(Calibration {
        each_before: nominal.errors()?,
        orientation: orientation([&nominal.model, &streamed.identified.model].map(|m| (m, &streamed.identified.data)))?,
        nominal: nominal.model,
        before: streamed.before,
        errors: streamed.errors,
        held_out: HeldOut::default(),
        cross_validation: None,
        forward_in_time: None,
        observations: streamed.observations,
        poses: streamed.identified.data.used_poses().len(),
        blocks: 0,
        rejected: streamed.rejected,
        named: streamed.named,
        cleaned: !options.keep_outliers,
        elasticity,
        passes: Some(streamed.passes + 1),
        notes: sample.recordings.into_iter().flat_map(|r| r.notes).collect(),
        sessions: Vec::new(),
        distances: Vec::new(),
        places: Vec::new(),
        tried: Vec::new(),
        loads: Vec::new(),
        read_otherwise: read_otherwise(&streamed.identified),
        fitted: streamed.identified,
    })
}

/// Which sessions have a tool, or balls, of their own: those whose own coefficients, fitted beside those of the first session, are so far
/// from zero that the Bayesian information criterion (Schwarz 1978) keeps them. Data that cannot say share.
///
/// # Errors
/// None that a fit without own setups would not have.
pub fn own_setup(robot: &Robot, cell: &Cell, data: &Dataset, choice: &Choice, tool: ToolSharing) -> Result<OwnSetup> {
    let sessions = data.names.len();
    if sessions < 2 {
        return Ok(OwnSetup::default());
    }
    let mut all = OwnSetup::all(sessions);
    if tool == ToolSharing::Same {
        all.tool.clear();
    }
    let Ok(fitted) = identify(robot, cell, data, choice.clone().with_own(all.clone())) else {
        // what one shares with the others cannot be told of it, and they would have to pay for it
        if tool == ToolSharing::FromData {
            refuse_short(data)?;
        }
        let kept = if tool == ToolSharing::Own { all.tool } else { Vec::new() };
        return Ok(OwnSetup { tool: kept, balls: Vec::new() });
    };
    let needed = |session: u32, of_balls: bool| {
        let own: Vec<usize> = (0..fitted.free.len())
            .filter(|k| {
                let t = &fitted.model.terms[fitted.free[*k]];
                t.basis.session == Some(session) && matches!(t.site, Site::Fixture(_)) == of_balls
            })
            .collect();
        let rows = data.filtered(|o| o.state.session == Some(session)).scalars();
        let price = own.len() as f64 * libm::log(rows.max(2) as f64);
        !own.is_empty() && fitted.wald(&own) > price
    };
    if tool == ToolSharing::FromData {
        all.tool.retain(|s| needed(*s, false));
    }
    all.balls.retain(|s| needed(*s, true));
    Ok(all)
}

/// Refuses a fit that no arm has: half of its errors are larger than this, mm.
const REFUSED_MM: f64 = 50.0;

/// Refuses a fit of more than the nominal arm that leaves what no arm does.
///
/// # Errors
/// Errors of many centimetres.
pub fn refuse_no_arm(set: ParameterSet, left: ErrorSummary) -> Result<()> {
    if set != ParameterSet::Nominal && left.median_mm > REFUSED_MM {
        return Err(IdentError::WrongModel(no_arm(left.median_mm, None).join("; ")));
    }
    Ok(())
}

/// A recording with fewer poses does not say where its tool and its balls are.
const SHORT: usize = 5;

fn refuse_short(data: &Dataset) -> Result<()> {
    let poses = |k: usize| data.filtered(|o| o.recording == k).used_poses().len();
    match (0..data.names.len()).find(|k| poses(*k) < SHORT) {
        Some(k) => Err(IdentError::at(
            &data.names[k],
            "its rows",
            format!(
                "found {}; at least {SHORT} are needed to tell whether tool and balls are the same as in the other recordings: measure more, or \
                 say that all have one tool",
                if poses(k) == 1 { "1 pose".to_owned() } else { format!("{} poses", poses(k)) }
            ),
        )),
        None => Ok(()),
    }
}

fn session_setups(fitted: &Identified) -> Vec<SessionSetup> {
    let data = &fitted.data;
    if data.names.len() < 2 {
        return Vec::new();
    }
    let setup = |(k, name): (usize, &String)| {
        let own = |t: &&trical_model::Term| t.effect != "place" && t.basis.session.is_some_and(|s| s as usize == k + 1);
        let terms: Vec<_> = fitted.model.terms.iter().filter(own).collect();
        let differs = |balls: bool| {
            let mut of = terms.iter().filter(|t| matches!(t.site, Site::Fixture(_)) == balls).peekable();
            // components, each with its point: 0 the TCP, or the balls as one
            let part = |t: &&trical_model::Term| match t.site {
                Site::Target { target, .. } => Some((target, t.value)),
                Site::Tool(Motion::Along(_)) | Site::Fixture(Motion::Along(_)) => Some((0, t.value)),
                _ => None,
            };
            of.peek().is_some().then(|| moved(of.filter_map(part)) * 1e3)
        };
        let each =
            [("tool", differs(false)), ("balls", differs(true))].into_iter().filter_map(|(o, mm)| Some((o, mm?)));
        let (own, differs_mm) = each.unzip();
        SessionSetup { recording: name.clone(), own, differs_mm }
    };
    data.names.iter().enumerate().map(setup).collect()
}
