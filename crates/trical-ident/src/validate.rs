//! Validation: what a model learnt of an arm, on any recording of that arm.
//!
//! A recording that the model was learnt on is predicted with all that was learnt of it. To any other only what belongs to the arm goes;
//! what belongs to that session (measuring frame, place of the balls, tool points) is identified there from some of its poses and the
//! others are scored, or it is taken as the model has it.

use trical_model::{
    Basis, Cell, Forward, JointKind, Measured, Model, Motion, Pose, Recording, Robot, Scope, Shape, Site, Support, Term,
};

use crate::ball_places::{self, place_of, training_poses};
use crate::dataset::{Dataset, JointSource, Observation, References, Rejected, told_of_tool};
use crate::degenerate::{hardly_moving, little};
use crate::error::Result;
use crate::fit::position_errors;
use crate::identifiability::{Choice, OwnSetup, ParameterSet};
use crate::identify::{ErrorSummary, identify, refit};
use crate::initial_guess::initial_guess_of_sessions;
use crate::model_file::ModelFile;
use crate::predicted::{Predicted, predicted};

/// What is identified again for an instrument that was set up anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refit {
    /// The measuring frames (for touches the place of the balls).
    pub frame: bool,
    /// The targets (the TCP).
    pub targets: bool,
}

impl Refit {
    /// Both.
    pub const ALL: Self = Self { frame: true, targets: true };

    fn any(self) -> bool {
        self.frame || self.targets
    }

    /// "frame", "targets".
    fn names(self) -> Vec<&'static str> {
        [(self.frame, "frame"), (self.targets, "targets")].into_iter().filter(|p| p.0).map(|p| p.1).collect()
    }
}

/// Errors of one part of the data.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Region {
    /// "q2 -60 to -32 deg", "distance from the middle 0 to 200 mm", "ball 2".
    pub region: String,
    /// Number of measurements.
    pub n: usize,
    /// Before.
    pub before: ErrorSummary,
    /// After.
    pub after: ErrorSummary,
}

/// Errors of one recording, and what was identified there.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SessionErrors {
    /// Name of the recording.
    pub recording: String,
    /// Session (from 1) of the model that it is; `null` where the model was not learnt on it.
    pub learnt: Option<u32>,
    /// What was identified again: "frame", "targets".
    pub refitted: Vec<&'static str>,
    /// From so many poses, which are not scored.
    pub from_poses: usize,
    /// Poses that were scored.
    pub poses: usize,
    /// Number of measurements that were scored.
    pub n: usize,
    /// Before.
    pub before: ErrorSummary,
    /// After.
    pub after: ErrorSummary,
}

impl SessionErrors {
    /// "a.csv: learnt as session 2", "b.csv: frame, targets identified from 25 poses, the other 75 scored".
    #[must_use]
    pub fn in_words(&self) -> String {
        let known = match (self.learnt, self.refitted.is_empty()) {
            (Some(_), true) => "the model was fitted to it".to_owned(),
            (None, true) => "in the measuring frame and with the tool of the model".to_owned(),
            (_, false) => format!(
                "{} identified from {} of its poses, the other {} scored",
                self.refitted.join(" and "),
                self.from_poses,
                self.poses
            ),
        };
        format!("{}: {known}", self.recording)
    }
}

/// A term that says nothing here, and why.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LeftOut {
    /// Name of the term.
    pub term: String,
    /// Effect of the term.
    pub effect: String,
    /// In words.
    pub reason: String,
    /// What the recordings would have to have.
    #[serde(skip)]
    pub needs: Option<&'static str>,
}

/// Position errors of the nominal arm and of the model.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Validation {
    /// The nominal arm with only the measuring frame and targets identified on this data.
    pub before: ErrorSummary,
    /// The model.
    pub after: ErrorSummary,
    /// Number of measurements that were scored.
    pub n: usize,
    /// How many of them are at joint angles that the model was not learnt at; `null` where its file does not say.
    pub beyond: Option<usize>,
    /// How far off the model says that it may be, beside what was found; `null` where its file does not say how uncertain it is.
    pub predicted: Option<Predicted>,
    /// Errors of each recording.
    pub sessions: Vec<SessionErrors>,
    /// Errors of each region.
    pub regions: Vec<Region>,
    /// Terms of the model that say nothing of these recordings.
    pub left_out: Vec<LeftOut>,
    /// Effects of a setup that jumped in the course of the model's only session, and is taken to be here as it was at its end.
    pub carried_over: Vec<String>,
    /// How far the cell file has the tool from where that of the model has it, mm, if it does; the model's is used.
    pub other_tool_mm: Option<f64>,
    /// Rows that were not used.
    pub rejected: Vec<Rejected>,
    /// Errors one by one, m: before, after.
    #[serde(skip)]
    pub errors: Vec<(f64, f64)>,
    /// What was scored.
    #[serde(skip)]
    pub data: Dataset,
    /// The model as it was scored, with what was identified again.
    #[serde(skip)]
    pub model: Model,
    /// The nominal arm as it was scored, and the same rows in its measuring frames.
    #[serde(skip)]
    pub nominal: (Model, Dataset),
}

impl Validation {
    /// Where the model had to say something of other joint angles, in a sentence.
    #[must_use]
    pub fn beyond_in_words(&self) -> Option<String> {
        self.beyond.filter(|n| *n > 0).map(|n| {
            let beyond = Support::of(&self.model.robot, &[]).beyond_in_words();
            format!("{n} of {} measurements are {beyond}.", self.n)
        })
    }

    /// One sentence for each reason for which terms say nothing here, and one for what is carried over; `title` gives the words of an effect's identifier.
    #[must_use]
    pub fn left_out_in_words(&self, title: impl Fn(&str) -> String) -> Vec<String> {
        let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
        for l in &self.left_out {
            let i = reasons.iter().position(|r| r.0 == l.reason).unwrap_or_else(|| {
                reasons.push((&l.reason, Vec::new()));
                reasons.len() - 1
            });
            if !reasons[i].1.contains(&l.effect.as_str()) {
                reasons[i].1.push(&l.effect);
            }
        }
        let named = |effects: &[&str]| effects.iter().map(|e| title(e)).collect::<Vec<_>>().join(", ");
        let carried: Vec<&str> = self.carried_over.iter().map(String::as_str).collect();
        let carried = (!carried.is_empty())
            .then(|| format!("As at the end of the session that the model was fitted to: {}.", named(&carried)));
        let left_out = |(reason, effects): (&str, Vec<&str>)| format!("Left out: {} ({reason}).", named(&effects));
        let other = self.other_tool_mm.map(|mm| {
            format!(
                "The cell file has the tool {mm:.3} mm from where the cell of the fit has it; the model's was used."
            )
        });
        reasons.into_iter().map(left_out).chain(carried).chain(other).collect()
    }
}

/// Tools of two cell files are the same within this, m.
const SAME_TOOL: f64 = 1e-6;

/// A recording beside the model: the session that it is there, its measuring frame, what is to be identified.
struct Place {
    learnt: Option<u32>,
    session: u32,
    /// Measuring frame of the model (from 0), and whether that is new.
    frame: Option<(usize, bool)>,
    refit: Refit,
    /// Points of the tool that are identified, the whole of it with [`Refit::targets`].
    own: Vec<Site>,
    /// Terms of a session of the model that hold here too.
    carried: Vec<Term>,
}

/// Scores a model on recordings. With `refit`, frame and targets of each recording are identified again from every fourth of its poses, and
/// the other poses are scored; without it only where the model does not know them.
///
/// # Errors
/// Recordings of another arm, or data that the model cannot predict.
pub fn validate(
    robot: &Robot,
    cell: &Cell,
    file: &ModelFile,
    recordings: &[Recording],
    joints: Option<JointSource>,
    refit: Option<Refit>,
) -> Result<Validation> {
    let Adapted { mut model, data, places, left_out, carried_over, known, joints } =
        adapted(file, cell, recordings, joints, refit, None)?;
    let rejected = data.rejected.clone();
    let poses: Vec<Vec<usize>> =
        (0..recordings.len()).map(|r| data.filtered(|o| o.recording == r).used_poses()).collect();
    let all = training_poses(&data, !ball_places::unknown_places(cell, &data).is_empty());
    let trains = |o: &Observation| places[o.recording].refit.any() && all.contains(&o.pose);
    let train = data.filtered(trains);
    let scored = data.filtered(|o| !trains(o));
    let mut own = Vec::new();
    if !train.observations.is_empty() {
        own = own_terms(&model, &train, &places);
        model = refitted(model, &train, &places)?;
    }
    let forward = Forward::new(model, Vec::new())?;
    crate::fit::check_observations(&forward, &scored)?;
    let after = position_errors(&forward, &scored);
    // the nominal arm of these recordings alone
    let plain = Dataset::build(recordings, joints, Some(&known))?
        .filtered(|o| scored.observations.binary_search_by_key(&o.row, |s| s.row).is_ok());
    let choice = Choice::from(ParameterSet::Nominal).with_own(OwnSetup::all(recordings.len()));
    let nominal = identify(robot, cell, &plain, choice)?;
    let before = position_errors(&Forward::new(nominal.model.clone(), Vec::new())?, &plain);
    let pairs: Vec<(f64, f64)> = before.iter().copied().zip(after.iter().copied()).collect();
    let sessions = places.iter().enumerate().map(|(r, place)| {
        let (n, before, after) =
            before_and_after(scored.observations.iter().zip(&pairs).filter(|(o, _)| o.recording == r).map(|(_, p)| p));
        let from_poses = if place.refit.any() { poses[r].iter().filter(|p| all.contains(p)).count() } else { 0 };
        SessionErrors {
            recording: data.names[r].clone(),
            learnt: place.learnt,
            refitted: place.refit.names(),
            from_poses,
            poses: poses[r].len() - from_poses,
            n,
            before,
            after,
        }
    });
    let visited = file.visited();
    let beyond: Vec<bool> = scored.observations.iter().map(|o| visited.beyond(&o.state.q).is_some()).collect();
    let model = forward.into_model();
    let predicted = match &file.uncertainty {
        Some(u) => {
            let learnt: Vec<bool> = places.iter().map(|p| p.learnt.is_some()).collect();
            predicted(&model, u, (&own, &train), &scored, (&learnt, &beyond))?
        }
        None => None,
    };
    let off = (cell.tool.tcp - file.model.cell.tool.tcp).norm();
    Ok(Validation {
        other_tool_mm: (off > SAME_TOOL).then_some(off * 1e3),
        before: ErrorSummary::of(&before),
        after: ErrorSummary::of(&after),
        n: pairs.len(),
        beyond: (!visited.is_empty()).then(|| beyond.iter().filter(|b| **b).count()),
        predicted,
        sessions: sessions.collect(),
        regions: regions(robot, &scored, &pairs, &beyond),
        left_out,
        carried_over,
        rejected,
        errors: pairs,
        data: scored,
        model,
        nominal: (nominal.model, plain),
    })
}

/// A model beside recordings that it is to predict.
pub(crate) struct Adapted {
    /// With terms for what belongs to these recordings and is to be identified, at zero.
    pub model: Model,
    /// The recordings in the model's sessions and measuring frames.
    pub data: Dataset,
    places: Vec<Place>,
    /// Terms that say nothing of these recordings.
    pub(crate) left_out: Vec<LeftOut>,
    /// Effects that are here as they were at the end of the model's only session.
    carried_over: Vec<String>,
    known: Vec<References>,
    joints: JointSource,
}

impl Adapted {
    /// Whether the model was learnt on one of the recordings.
    pub fn is_known(&self) -> bool {
        self.places.iter().any(|p| p.learnt.is_some())
    }

    /// The model with what belongs to the recordings identified on all of their rows.
    pub fn identified(&self) -> Result<Model> {
        if self.places.iter().any(|p| p.refit.any()) {
            refitted(self.model.clone(), &self.data, &self.places)
        } else {
            Ok(self.model.clone())
        }
    }
}

/// The model of `file` made ready for `recordings`. With `setup_of` those that it was not fitted to have the tool and
/// the balls of that session (from 1), whatever else is new. A tool that no fit has identified is identified in any
/// case.
pub(crate) fn adapted(
    file: &ModelFile,
    cell: &Cell,
    recordings: &[Recording],
    joints: Option<JointSource>,
    refit: Option<Refit>,
    setup_of: Option<u32>,
) -> Result<Adapted> {
    let joints = joints.unwrap_or(file.joints);
    let fingerprints: Vec<String> = recordings.iter().map(crate::repeated::fingerprint).collect();
    let mut places = places(file, cell, recordings, &fingerprints, refit);
    for (place, recording) in places.iter_mut().zip(recordings) {
        place.refit.targets &= setup_of.is_none();
        place.own = own_tool(file, recording, place);
        place.refit.targets |= !place.own.is_empty();
        place.carried = carried(file, place, setup_of);
    }
    let framed = places.iter().filter_map(|p| p.frame);
    let known: Vec<References> = framed
        .map(
            |(frame, new)| {
                if new { References::default() } else { file.references.get(frame).cloned().unwrap_or_default() }
            },
        )
        .collect();
    let mut data = Dataset::build(recordings, joints, Some(&known))?;
    data = data.in_sessions(&places.iter().map(|p| Some(p.session)).collect::<Vec<_>>());

    let mut model = file.model.clone();
    let left_out = leave_out(&mut model, &data, &places);
    let mut carried_over = Vec::new();
    for t in places.iter().flat_map(|p| &p.carried) {
        // not what a session always had
        let jumped = file.model.terms.iter().any(|of| of.name == t.name && of.after_its_session().is_some());
        if jumped && !carried_over.contains(&t.effect) {
            carried_over.push(t.effect.clone());
        }
        model.terms.push(t.clone());
    }
    data.in_frames(&places.iter().map(|p| p.frame.map(|f| f.0)).collect::<Vec<_>>(), model.frames.len());
    for place in &places {
        add_own(&mut model, cell, &data, place);
    }
    data.references.resize(model.frames.len(), References::default());
    // before a frame is looked for by what the cell may not have
    crate::fit::check_observations(&Forward::new(model.clone(), Vec::new())?, &data)?;
    Ok(Adapted { model, data, places, left_out, carried_over, known, joints })
}

/// Position errors (m) of one session that the model does not know: what is its own is identified from every fourth of its poses, and
/// the others are scored. All observations of `data` are of that session.
pub(crate) fn score_session(model: &Model, data: &Dataset) -> Result<Vec<f64>> {
    let Some(first) = data.observations.first() else { return Ok(Vec::new()) };
    let session = first.state.session.unwrap_or(1);
    let framed = first.measured.is_framed();
    let measured = data.observations.iter().map(|o| o.measured);
    let (frame, own) = (framed.then_some((first.frame, true)), tool_sites(&model.cell, measured));
    let place = Place { learnt: None, session, frame, refit: Refit::ALL, own, carried: Vec::new() };
    let mut model = model.clone();
    model.terms.retain(|t| t.basis.session.is_none_or(|own| own == session));
    leave_out(&mut model, data, std::slice::from_ref(&place));
    model.terms.retain(|t| !matches!(t.site, Site::Frame { frame, .. } if framed && frame == first.frame + 1));
    let cell = model.cell.clone();
    add_own(&mut model, &cell, data, &place);
    let poses = training_poses(data, !ball_places::unknown_places(&cell, data).is_empty());
    let model = refitted(model, &data.filtered(|o| poses.contains(&o.pose)), std::slice::from_ref(&place))?;
    Ok(position_errors(&Forward::new(model, Vec::new())?, &data.filtered(|o| !poses.contains(&o.pose))))
}

/// Where each recording belongs. One that the model was learnt on has its frame there; of the others, those whose frame cannot be one of
/// the model's get one of their own.
fn places(
    file: &ModelFile,
    cell: &Cell,
    recordings: &[Recording],
    fingerprints: &[String],
    refit: Option<Refit>,
) -> Vec<Place> {
    let frames = file.model.frames.len();
    let framed = |r: &Recording| r.rows.iter().any(|row| row.measured.is_framed());
    let learnt: Vec<Option<u32>> = fingerprints.iter().map(|f| file.session_of(f)).collect();
    let strangers = recordings.iter().zip(&learnt).filter(|(r, l)| framed(r) && l.is_none()).count();
    // as the contract has it: in that frame, where there is no doubt which one; files of before there were sessions go by order
    let by_order_only = file.sessions.iter().all(|s| s.fingerprint.is_empty());
    let as_they_are = frames == 1 || (by_order_only && strangers == recordings.len() && strangers <= frames);
    let (mut next_frame, mut next_session, mut by_order) = (frames, file.sessions.len(), 0);
    recordings
        .iter()
        .zip(learnt)
        .map(|(recording, learnt)| {
            let own = |learnt: u32| file.sessions.get(learnt as usize - 1).and_then(|s| s.frame).map(|f| f - 1);
            let mut asked = refit.unwrap_or_default();
            let known_frame = match learnt {
                Some(k) => own(k),
                None if frames == 1 => Some(0),
                None if as_they_are && framed(recording) => {
                    by_order += 1;
                    Some(by_order - 1)
                }
                None => None,
            };
            if framed(recording) && known_frame.is_none() {
                asked = Refit::ALL;
            }
            // where sockets stood in another session is never known
            let touched = recording.rows.iter().any(|r| matches!(r.measured, Measured::Touch { .. }));
            let unplaced = !recording.places.is_empty() || !cell.balls_fix_base(|_| true);
            if touched && learnt.is_none() && (unplaced || !file.identified(|s| matches!(s, Site::Base(_)))) {
                asked.frame = true;
            }
            let new_frame = framed(recording) && (asked.frame || known_frame.is_none());
            let frame = if new_frame {
                next_frame += 1;
                Some((next_frame - 1, true))
            } else {
                known_frame.filter(|_| framed(recording)).map(|f| (f, false))
            };
            let session = learnt.unwrap_or_else(|| {
                next_session += 1;
                u32::try_from(next_session).unwrap_or(u32::MAX)
            });
            Place { learnt, session, frame, refit: asked, own: Vec::new(), carried: Vec::new() }
        })
        .collect()
}

/// What measurements tell of the tool: its TCP, with poses its direction, its targets.
fn tool_sites(cell: &Cell, measured: impl Iterator<Item = Measured> + Clone) -> Vec<Site> {
    let (motions, targets) = told_of_tool(cell.tool.targets.len(), measured);
    let of_target = |target| trical_model::Axis::ALL.map(|axis| Site::Target { target, axis });
    motions.iter().map(|m| Site::Tool(*m)).chain(targets.into_iter().flat_map(of_target)).collect()
}

/// What is to be identified of the tool of a recording: all of it where that is asked for, else what the model does not
/// know.
fn own_tool(file: &ModelFile, recording: &Recording, place: &Place) -> Vec<Site> {
    let mut sites = tool_sites(&file.model.cell, recording.rows.iter().map(|r| r.measured));
    let alike = |a: &Site, b: &Site| match (a, b) {
        (Site::Tool(Motion::Along(_)), Site::Tool(Motion::Along(_)))
        | (Site::Tool(Motion::About(_)), Site::Tool(Motion::About(_))) => true,
        (Site::Target { target: a, .. }, Site::Target { target: b, .. }) => a == b,
        _ => false,
    };
    sites.retain(|s| place.refit.targets || (place.learnt.is_none() && !file.identified(|known| alike(s, known))));
    sites
}

/// Terms of a session of the model as they hold in another one: jumps of the setup in the course of the only session
/// (or of `setup_of`), and with `setup_of` the tool and the balls of that session. What is identified anew is not taken
/// from elsewhere.
fn carried(file: &ModelFile, place: &Place, setup_of: Option<u32>) -> Vec<Term> {
    let anew = |t: &Term| match t.site {
        Site::Tool(_) | Site::Target { .. } => place.own.contains(&t.site),
        Site::Fixture(_) => place.refit.frame,
        Site::Frame { frame, .. } => place.frame != Some((frame - 1, false)),
        _ => false,
    };
    let carry = |t: &Term| {
        let only = file.sessions.len() == 1;
        let there = setup_of.is_some() && t.basis.session == setup_of;
        let setup = there && t.basis.place.is_none() && t.scope() == Scope::Setup && t.basis.shape == Shape::One;
        // of several sessions, what they share is not the end of one
        let kept = if setup { Some(t.clone()) } else { t.after_its_session().filter(|_| only || there) };
        kept.filter(|t| !anew(t)).map(|t| Term { basis: t.basis.in_session(place.session), ..t })
    };
    if place.learnt.is_some() { Vec::new() } else { file.model.terms.iter().filter_map(carry).collect() }
}

/// Takes out of the model what says nothing of these recordings: what happened in the course of another session, and what needs something
/// that they do not have. What one of them lacks and another has stays.
fn leave_out(model: &mut Model, data: &Dataset, places: &[Place]) -> Vec<LeftOut> {
    let mut out = Vec::new();
    model.terms.retain(|t| {
        let is_elsewhere = |p: &Place| match t.basis.session {
            Some(own) => p.session != own,
            // a model file of before there were sessions
            None => t.scope() == Scope::Course && places.iter().all(|p| p.learnt.is_none()),
        };
        let lacks = |p: &Place| p.learnt.is_none() && is_elsewhere(p) && !p.carried.iter().any(|c| c.name == t.name);
        let elsewhere = places.iter().all(is_elsewhere);
        let is_lacked = places.iter().any(lacks);
        let missing = if is_lacked || elsewhere || matches!(t.basis.of, trical_model::Variable::Reading { .. }) {
            None
        } else {
            data.observations.iter().find_map(|o| t.basis.missing(&o.state, &o.measured))
        };
        let reason = if is_lacked {
            let of = match t.scope() {
                Scope::Course => "happened in the course of another session",
                _ => "belongs to another session",
            };
            let here = places.iter().zip(&data.names).filter(|(p, _)| lacks(p)).map(|(_, name)| name.as_str());
            let of_some = || format!("in {}: {of}", here.collect::<Vec<_>>().join(", "));
            Some(if elsewhere { of.to_owned() } else { of_some() })
        } else {
            missing.map(|what| format!("needs {what}, which these recordings do not have"))
        };
        if let Some(reason) = reason {
            out.push(LeftOut { term: t.name.clone(), effect: t.effect.clone(), reason, needs: missing });
        }
        !elsewhere && missing.is_none()
    });
    out
}

/// Adds to the model what belongs to the session of one recording and is to be identified there.
fn add_own(model: &mut Model, cell: &Cell, data: &Dataset, place: &Place) {
    let any = |f: &dyn Fn(&Measured) -> bool| {
        data.observations.iter().any(|o| o.state.session == Some(place.session) && f(&o.measured))
    };
    let own = Basis::CONSTANT.in_session(place.session);
    let mut add = |name: String, effect: &str, site: Site| {
        let new = Term::new(name, effect, site, own);
        if !model.terms.iter().any(|t| t.site == new.site && t.basis == new.basis) {
            model.terms.push(new);
        }
    };
    let unknown: Vec<_> = ball_places::unknown_places(cell, data);
    let mut unknown_here = unknown.into_iter().filter(|p| p.session == Some(place.session)).peekable();
    if place.refit.frame && unknown_here.peek().is_none() && any(&|m| matches!(m, Measured::Touch { .. })) {
        for m in Motion::ALL {
            add(format!("balls_{}_s{}", m.name(), place.session), "balls", Site::Fixture(m));
        }
    }
    for site in &place.own {
        let (name, effect) = match site {
            Site::Target { target, axis } => (format!("target{target}_{}", axis.name()), "target"),
            Site::Tool(m) => (format!("tool_{}", m.name()), "tool"),
            _ => continue,
        };
        add(format!("{name}_s{}", place.session), effect, *site);
    }
    if place.refit.frame {
        for t in unknown_here.flat_map(|p| ball_places::terms(cell, data, p)) {
            if !model.terms.iter().any(|have| have.site == t.site && have.basis == t.basis) {
                model.terms.push(t);
            }
        }
    }
    if let Some((frame, true)) = place.frame {
        model.frames.resize(model.frames.len().max(frame + 1), Pose::identity());
        let name = |m: Motion| format!("frame{}_{}", frame + 1, m.name());
        let site = |motion| Site::Frame { frame: frame + 1, motion };
        model.terms.extend(Motion::ALL.map(|m| Term::new(name(m), "frame", site(m), Basis::CONSTANT)));
    }
}

/// Identifies what belongs to the sessions that are refitted (of lengths the base), everything else of the model kept.
fn refitted(mut model: Model, train: &Dataset, places: &[Place]) -> Result<Model> {
    let free = own_terms(&model, train, places);
    initial_guess_of_sessions(&mut model, train, &free)?;
    Ok(refit(model, free, train)?.into_model())
}

/// Indices of the terms that are identified for the sessions that are refitted.
fn own_terms(model: &Model, train: &Dataset, places: &[Place]) -> Vec<usize> {
    let lengths = train.has(|m| matches!(m, Measured::Distance { .. }));
    let base = lengths && places.iter().any(|p| p.refit.frame);
    let own = |t: &Term| {
        t.basis.session.is_some_and(|s| places.iter().any(|p| p.session == s && p.refit.any()))
            || matches!(t.site, Site::Frame { frame, .. } if places.iter().any(|p| p.frame == Some((frame - 1, true))))
    };
    (0..model.terms.len())
        .filter(|k| {
            let t = &model.terms[*k];
            let carried = places.iter().any(|p| p.carried.contains(t));
            (own(t) && !carried && !matches!(t.site, Site::Payload(_)) && t.scope() == Scope::Setup)
                || (base && t.basis.is_constant() && matches!(t.site, Site::Base(_)))
        })
        .collect()
}

/// "q2 -32.0 to 10.5 deg", "q1 0.0 to 900.0 mm" where joint 1 slides.
fn stretch(robot: &Robot, joint: usize, ends: [f64; 2]) -> String {
    let (scale, unit) = robot.joints.get(joint).map_or_else(JointKind::default, |j| j.kind).unit();
    // no "-0.0"
    let [low, high] = ends.map(|q| (q * scale * 10.0).round() / 10.0 + 0.0);
    format!("q{} {low:.1} to {high:.1} {unit}", joint + 1)
}

/// How many errors, and what they are before and after.
fn before_and_after<'a>(pairs: impl Iterator<Item = &'a (f64, f64)>) -> (usize, ErrorSummary, ErrorSummary) {
    let (before, after): (Vec<f64>, Vec<f64>) = pairs.copied().unzip();
    (before.len(), ErrorSummary::of(&before), ErrorSummary::of(&after))
}

/// How far each place that was seen is from the middle of them all, m.
fn from_the_middle(data: &Dataset) -> Vec<Option<f64>> {
    let places: Vec<Option<nalgebra::Vector3<f64>>> = data
        .observations
        .iter()
        .map(|o| match o.measured {
            Measured::Point { position, .. } | Measured::Pose { position, .. } => Some(position.into()),
            _ => None,
        })
        .collect();
    let middle = crate::rigid::median_point(&places.iter().flatten().copied().collect::<Vec<_>>());
    places.iter().map(|p| p.map(|p| (p - middle).norm())).collect()
}

/// Errors by joint angle (of joints that move), ball, and place; and, where some are `beyond` the angles that the model was learnt at, of these and the others.
fn regions(robot: &Robot, data: &Dataset, errors: &[(f64, f64)], beyond: &[bool]) -> Vec<Region> {
    let mut out = Vec::new();
    let mut add = |region: String, pick: &dyn Fn(usize) -> bool| {
        let chosen = errors.iter().enumerate().filter(|(i, _)| pick(*i)).map(|(_, e)| e);
        let (n, before, after) = before_and_after(chosen);
        if n > 0 {
            out.push(Region { region, n, before, after });
        }
    };
    let o = &data.observations;
    if beyond.contains(&true) {
        add("joint angles that the model was fitted at".into(), &|i| !beyond[i]);
        add("other joint angles".into(), &|i| beyond[i]);
    }
    let resting = hardly_moving(robot, data);
    for joint in (0..data.dof).filter(|joint| !resting.iter().any(|(k, _)| k == joint)) {
        let q: Vec<f64> = o.iter().map(|o| o.state.q[joint]).collect();
        let mut sorted = q.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        // quarters of the measurements, each wide enough to be told from the next: most may have been made at one angle
        let mut ends = vec![sorted[0]];
        for k in 1..=4 {
            let end = sorted[(k * (n - 1)) / 4];
            if end - ends[ends.len() - 1] >= little(robot, joint) {
                ends.push(end);
            } else if k == 4 && ends.len() > 1 {
                // the last of all belongs to the stretch before it
                ends.pop();
                ends.push(end);
            }
        }
        let last = ends.len() - 1;
        for (k, low_high) in ends.windows(2).enumerate().filter(|_| last > 1) {
            let (low, high) = (low_high[0], low_high[1]);
            let name = stretch(robot, joint, [low, high]);
            add(name, &|i| q[i] >= low && (q[i] < high || (k + 1 == last && q[i] <= high)));
        }
    }
    for ball in ball_places::touched(data, |_| true) {
        add(format!("ball {}", ball + 1), &|i| matches!(o[i].measured, Measured::Touch { ball: b, .. } if b == ball));
    }
    let stood = ball_places::ball_places(data);
    for place in stood.iter().filter(|_| stood.len() > 1) {
        let name = format!("place {}", ball_places::name(data, *place));
        add(name, &|i| place_of(&o[i]) == Some(*place));
    }
    let off = from_the_middle(data);
    if off.iter().any(Option::is_some) {
        for (low, high) in [(0.0, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, f64::INFINITY)] {
            let name = if high.is_finite() {
                format!("{:.0} to {:.0} mm from the middle", low * 1e3, high * 1e3)
            } else {
                format!("more than {:.0} mm from the middle", low * 1e3)
            };
            add(name, &|i| off[i].is_some_and(|off| (low..high).contains(&off)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_model::{Row, State};

    #[test]
    fn regions_of_a_rail_are_in_mm_without_negative_zeros_and_a_joint_at_rest_has_none() {
        let text = include_str!("../../trical-model/tests/data/arm.toml");
        let mut robot = Robot::parse(text, "arm.toml").unwrap();
        robot.joints[0].kind = JointKind::Prismatic;
        let row = |k: u32| Row {
            state: State::at(&[0.1 * f64::from(k), -1e-7, 0.2 - 0.1 * f64::from(k)]),
            measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
            seq: None,
            line: k as usize + 2,
        };
        let rows: Vec<Row> = (0..5).map(row).collect();
        let recording = Recording { name: "r".into(), joints: 6, rows, ..Recording::default() };
        let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
        let regions = regions(&robot, &data, &[(1e-3, 1e-4); 5], &[false; 5]);
        let names: Vec<&str> = regions.iter().map(|r| r.region.as_str()).collect();
        assert_eq!(
            names,
            [
                "q1 0.0 to 100.0 mm",
                "q1 100.0 to 200.0 mm",
                "q1 200.0 to 300.0 mm",
                "q1 300.0 to 400.0 mm",
                "q3 -11.5 to -5.7 deg",
                "q3 -5.7 to 0.0 deg",
                "q3 0.0 to 5.7 deg",
                "q3 5.7 to 11.5 deg",
                "ball 1"
            ]
        );
    }

    #[test]
    fn a_joint_that_mostly_rests_has_no_stretches_without_a_width() {
        let robot = Robot::parse(include_str!("../../trical-model/tests/data/arm.toml"), "arm.toml").unwrap();
        let stretches = |at: [f64; 8]| -> Vec<String> {
            let row = |(k, q): (usize, f64)| Row {
                state: State::at(&[0.2 * k as f64, q.to_radians()]),
                measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
                seq: None,
                line: k + 2,
            };
            let rows = at.into_iter().enumerate().map(row).collect();
            let recording = Recording { name: "r".into(), joints: 6, rows, ..Recording::default() };
            let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
            let all = regions(&robot, &data, &[(1e-3, 1e-4); 8], &[false; 8]);
            all.into_iter().filter(|r| r.region.starts_with("q2")).map(|r| format!("{} ({})", r.region, r.n)).collect()
        };
        assert!(stretches([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 40.0]).is_empty());
        let two = stretches([0.0, 0.0, 0.0, 0.0, 10.0, 10.0, 20.0, 40.0]);
        assert_eq!(two, ["q2 0.0 to 10.0 deg (4)", "q2 10.0 to 40.0 deg (4)"]);
    }
}
