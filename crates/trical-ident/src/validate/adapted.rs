//! A model beside recordings: which sessions of it they are, what belongs to them and is identified there, what of it says nothing of them.

use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Payload, Pose, Recording, Scope, Shape, Site, Term, Tool,
};

use crate::dataset::references::References;
use crate::dataset::repeated::Fingerprint;
use crate::dataset::{Dataset, JointSource, told_of_tool};
use crate::error::Result;
use crate::fit::ball_places::{self, training_poses};
use crate::fit::identify::refit;
use crate::fit::initial_guess::initial_guess_of_sessions;
use crate::fit::residuals::position_errors;
use crate::model_file::ModelFile;

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

    pub(crate) fn any(self) -> bool {
        self.frame || self.targets
    }

    /// "frame", "targets".
    pub(crate) fn names(self) -> Vec<&'static str> {
        [(self.frame, "frame"), (self.targets, "targets")].into_iter().filter(|p| p.0).map(|p| p.1).collect()
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

/// A recording beside the model: the session that it is there, its measuring frame, what is to be identified.
pub(crate) struct Place {
    pub learnt: Option<u32>,
    session: u32,
    /// Measuring frame of the model (from 0), and whether that is new.
    frame: Option<(usize, bool)>,
    pub refit: Refit,
    /// Points of the tool that are identified, the whole of it with [`Refit::targets`].
    own: Vec<Site>,
    /// Terms of a session of the model that hold here too.
    carried: Vec<Term>,
}

/// A model beside recordings that it is to predict.
pub(crate) struct Adapted {
    /// With terms for what belongs to these recordings and is to be identified, at zero.
    pub model: Model,
    /// The recordings in the model's sessions and measuring frames.
    pub data: Dataset,
    pub places: Vec<Place>,
    /// Terms that say nothing of these recordings.
    pub left_out: Vec<LeftOut>,
    /// Effects that are here as they were at the end of the model's only session.
    pub carried_over: Vec<String>,
    pub known: Vec<References>,
    pub joints: JointSource,
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
    let mut places = places(file, cell, recordings, refit);
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
    crate::fit::residuals::check_observations(&Forward::new(model.clone(), Vec::new())?, &data)?;
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
fn places(file: &ModelFile, cell: &Cell, recordings: &[Recording], refit: Option<Refit>) -> Vec<Place> {
    let frames = file.model.frames.len();
    let framed = |r: &Recording| r.rows.iter().any(|row| row.measured.is_framed());
    let learnt: Vec<Option<u32>> = recordings.iter().map(|r| file.session_of(&Fingerprint::of(r))).collect();
    let strangers = recordings.iter().zip(&learnt).filter(|(r, l)| framed(r) && l.is_none()).count();
    // as the contract has it: in that frame, where there is no doubt which one; files of before there were sessions go by order
    let by_order_only = file.sessions.iter().all(|s| s.fingerprint.whole.is_empty());
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
    let of_target = |target| Axis::ALL.map(|axis| Site::Target { target, axis });
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

/// What a session carries by its cell file beside what the model's cell has: no recording is needed to know it.
fn other_load(model: &Tool, cell: &Tool, session: u32) -> Vec<Term> {
    let moment = (cell.cog - model.cog) * cell.mass;
    let mass = (String::new(), Payload::Mass, cell.mass - model.mass);
    let moments = Axis::ALL.map(|axis| (format!("_{}", axis.name()), Payload::Moment(axis), moment[axis.index()]));
    let basis = Basis::CONSTANT.in_session(session);
    let term = |(name, what, value)| Term {
        value,
        ..Term::new(format!("payload{name}_s{session}"), "payload", Site::Payload(what), basis)
    };
    std::iter::once(mass).chain(moments).filter(|(.., value)| *value != 0.0).map(term).collect()
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
    if place.learnt.is_none() {
        model.terms.extend(other_load(&model.cell.tool, &cell.tool, place.session));
    }
    if let Some((frame, true)) = place.frame {
        model.frames.resize(model.frames.len().max(frame + 1), Pose::identity());
        let name = |m: Motion| format!("frame{}_{}", frame + 1, m.name());
        let site = |motion| Site::Frame { frame: frame + 1, motion };
        model.terms.extend(Motion::ALL.map(|m| Term::new(name(m), "frame", site(m), Basis::CONSTANT)));
    }
}

/// Identifies what belongs to the sessions that are refitted (of lengths the base), everything else of the model kept.
pub(crate) fn refitted(mut model: Model, train: &Dataset, places: &[Place]) -> Result<Model> {
    let free = own_terms(&model, train, places);
    initial_guess_of_sessions(&mut model, train, &free)?;
    Ok(refit(model, free, train)?.into_model())
}

/// Indices of the terms that are identified for the sessions that are refitted.
pub(crate) fn own_terms(model: &Model, train: &Dataset, places: &[Place]) -> Vec<usize> {
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
