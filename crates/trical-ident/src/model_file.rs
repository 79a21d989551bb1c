//! Model files (`calibrated.toml`, `improved.toml`): everything that a prediction needs.

use std::path::Path;

use serde::{Deserialize, Serialize};
use trical_model::error::{parse_toml, read_text};
use trical_model::pose::{quaternion_from_rotation, rotation_from_quaternion};
use trical_model::{
    Basis, Cell, Forward, Joints, Model, ModelError, Pose, Robot, Scope, Site, Support, Term, Variable,
};

use crate::dataset::references::References;
use crate::dataset::repeated::Fingerprint;
use crate::dataset::{Dataset, JointSource};
use crate::date::newest;
use crate::error::{IdentError, Result};
use crate::fit::degenerate::little;
use crate::fit::identifiability::plausibly_moved;
use crate::fit::identify::Identified;
use crate::fit::residuals::orientation_errors;
use crate::units::{unit, unit_of_turning};

/// A model as it is kept in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    /// Robot, cell, measuring frames and terms.
    pub model: Model,
    /// Which joint angles it was fitted to, and wants.
    pub joints: JointSource,
    /// References of each measuring frame.
    pub references: Vec<References>,
    /// The recordings that it came from, one session each: terms of [`Basis::session`] k belong to the k-th.
    pub sessions: Vec<Session>,
    /// How uncertain its terms are together, where that was kept.
    pub uncertainty: Option<Uncertainty>,
}

/// How uncertain the terms of a model are together, and how far measurements scattered about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    /// Names of terms.
    pub names: Vec<String>,
    /// Their correlation, row by row.
    pub correlation: Vec<f64>,
    /// Standard deviation of each coordinate that was measured, about the model, m.
    pub noise: f64,
    /// The same of each component of a measured rotation, rad; `None` where no pose was measured.
    pub rotation_noise: Option<f64>,
    /// How far what happened in the course of the sessions moved a coordinate from where it began, root mean square, m: it may have stayed so, or as much
    /// may happen, unforeseen, in the course of another one.
    pub course: f64,
    /// How far the effects that were found move a coordinate, or what was held at nominal since joints hardly move may do, root mean square, m: at
    /// joint angles that the model was not fitted at they may be otherwise by as much.
    pub effects: f64,
}

impl Uncertainty {
    /// Of a fit; `None` where it has too many parameters to be kept, or none that the data determine.
    #[must_use]
    pub fn of(fitted: &Identified) -> Option<Self> {
        let p = fitted.free.len();
        let c = |i: usize, j: usize| fitted.covariance[i * p + j];
        let at = |i: usize, j: usize| c(i, j) / (c(i, i) * c(j, j)).sqrt();
        let correlation: Vec<f64> = (0..p * p).map(|k| at(k / p, k % p)).collect();
        let square: f64 = fitted.errors().unwrap_or_default().iter().map(|e| e * e).sum();
        let scalars: usize =
            fitted.data.observations.iter().map(|o| trical_model::residual_rows(&o.measured).min(3)).sum();
        let noise = (square / scalars.saturating_sub(p).max(1) as f64).sqrt();
        let known = p <= CORRELATED && noise > 0.0 && correlation.iter().all(|c| c.is_finite());
        let names = fitted.free.iter().map(|k| fitted.model.terms[*k].name.clone()).collect();
        let course =
            moved(&fitted.model, &fitted.data, &|t| t.scope() == Scope::Course).map_or(0.0, |m| m.from_beginning);
        let rotation_noise = rotation_noise(fitted);
        let effects = plausibly_moved(&fitted.model, &fitted.data, &fitted.held()).unwrap_or(0.0);
        known.then_some(Self { names, correlation, noise, rotation_noise, course, effects })
    }

    /// The same of a model with effects, without which a coordinate was off by `plain`, m.
    #[must_use]
    pub fn of_effects(self, plain: f64) -> Self {
        Self { effects: (plain * plain - self.noise * self.noise).max(self.effects.powi(2)).sqrt(), ..self }
    }
}

/// Root mean square of each component of a measured rotation about the model, rad; `None` where no pose was measured.
fn rotation_noise(fitted: &Identified) -> Option<f64> {
    let forward = Forward::new(fitted.model.clone(), Vec::new()).ok()?;
    let angles = orientation_errors(&forward, &fitted.data);
    let square: f64 = angles.iter().map(|a| a * a).sum();
    Some((square / (3 * angles.len()) as f64).sqrt()).filter(|sd| *sd > 0.0)
}

/// How far terms moved a coordinate, root mean square over the recordings, m.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// About its middle in each recording.
    pub about_middle: f64,
    /// From where it is without them.
    pub from_beginning: f64,
}

/// How far such terms moved a coordinate.
///
/// # Errors
/// None for a model that was fitted.
pub fn moved(model: &Model, data: &Dataset, such: &dyn Fn(&Term) -> bool) -> Result<Moved> {
    let mut without = model.clone();
    without.terms.iter_mut().filter(|t| such(t)).for_each(|t| t.value = 0.0);
    let [with, without] = [model.clone(), without].map(|model| Forward::new(model, Vec::new()));
    let (with, without) = (with?, without?);
    let (mut here, mut there) = (with.workspace(), without.workspace());
    // sum, sum of squares and number, of each recording and row
    let mut sums = vec![[(0.0, 0.0, 0.0); 3]; data.names.len()];
    for o in &data.observations {
        let rows = with.residual(&o.state, &o.measured, o.frame, &mut here);
        without.residual(&o.state, &o.measured, o.frame, &mut there);
        for (k, (sum, squares, count)) in sums[o.recording].iter_mut().enumerate().take(rows) {
            let moved = here.residual()[k] - there.residual()[k];
            *sum += moved;
            *squares += moved * moved;
            *count += 1.0;
        }
    }
    let each = || sums.iter().flatten().filter(|(_, _, n)| *n > 0.0);
    let about: f64 = each().map(|(sum, squares, n)| squares - sum * sum / n).sum();
    let from: f64 = each().map(|(_, squares, _)| squares).sum();
    let count = each().map(|s| s.2).sum::<f64>().max(1.0);
    Ok(Moved { about_middle: (about.max(0.0) / count).sqrt(), from_beginning: (from / count).sqrt() })
}

/// A joint that has another zero in the newest session than in the others keeps it: the arm's becomes that one, and the others differ. Without dates
/// nothing says which is the newest, and of two sessions not even which is the odd one: the arm's is then the middle of both, give or take half of the
/// difference.
fn take_present_zeros(model: &mut Model, names: &[String]) {
    let newest = newest(names.iter().map(String::as_str));
    let number = |session: usize| u32::try_from(session + 1).unwrap_or(u32::MAX);
    let mut of_sessions = Vec::new();
    for t in &mut model.terms {
        let Some(session) = t.basis.session.filter(|_| matches!(t.site, Site::Joint { .. })) else { continue };
        if t.basis != Basis::CONSTANT.in_session(session) {
            continue;
        }
        let share = match newest {
            Some(newest) if names.len() > 1 && session == number(newest) => 1.0,
            None if names.len() == 2 => 0.5,
            _ => continue,
        };
        for other in (0..names.len()).map(number) {
            let value = if other == session { (1.0 - share) * t.value } else { -share * t.value };
            if value != 0.0 {
                let basis = Basis::CONSTANT.in_session(other);
                of_sessions.push(Term { name: format!("{}_session_{other}", t.name), value, basis, ..t.clone() });
            }
        }
        (t.basis, t.value) = (Basis::CONSTANT, share * t.value);
        t.sd = t.sd.map(|sd| libm::hypot(sd, (1.0 - share) * t.value / share));
    }
    model.terms.extend(of_sessions);
}

/// Beyond so many terms their correlation is not kept: the file would be longer than many recordings.
const CORRELATED: usize = 1000;

impl ModelFile {
    /// Whether a fit has identified something at such a site in all sessions; of a model that no fit made everything is
    /// taken as it stands.
    pub(crate) fn identified(&self, such: impl Fn(&Site) -> bool) -> bool {
        let mut fitted = self.model.terms.iter().filter(|t| t.sd.is_some()).peekable();
        fitted.peek().is_none() || fitted.any(|t| t.basis.is_constant() && such(&t.site))
    }
}

/// A recording that a model was learnt on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Session {
    /// Its name.
    pub recording: String,
    /// What tells it from others.
    pub fingerprint: Fingerprint,
    /// Its measuring frame, counted from 1, if it has one.
    pub frame: Option<usize>,
    /// Names of the places where its balls stood: terms of [`Basis::place`] k belong to the k-th.
    pub places: Vec<String>,
    /// Joint angles that it visited.
    pub visited: Support,
    /// Mean temperature, degC, where it was recorded.
    pub temp_c: Option<f64>,
}

/// The newest version of model files: sessions came with 2, and with 3 what goes with the sense of motion is positive as it is told.
const FORMAT_VERSION: u32 = 3;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format_version: u32,
    program: String,
    joints: JointSource,
    /// Version 1 had names only.
    #[serde(default, skip_serializing)]
    recordings: Vec<String>,
    robot: toml::Table,
    cell: toml::Table,
    #[serde(default, rename = "session", skip_serializing_if = "Vec::is_empty")]
    sessions: Vec<SessionFile>,
    #[serde(default, rename = "frame", skip_serializing_if = "Vec::is_empty")]
    frames: Vec<FrameFile>,
    #[serde(default, rename = "term")]
    terms: Vec<TermFile>,
    /// Last, since it may be long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    uncertainty: Option<UncertaintyFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct UncertaintyFile {
    /// Standard deviation of each coordinate about the model.
    noise_mm: f64,
    /// The same of each component of a pose's rotation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    noise_deg: Option<f64>,
    /// What happened in the course of the sessions, of each coordinate.
    #[serde(default)]
    course_mm: f64,
    /// What the effects that were found move, of each coordinate.
    #[serde(default)]
    effects_mm: f64,
    names: Vec<String>,
    /// Correlation of the terms: of each with those before it, the first's row is empty; seven decimals.
    correlation: Vec<Vec<f64>>,
}

impl UncertaintyFile {
    fn of(u: &Uncertainty) -> Self {
        let p = u.names.len();
        let rounded = |c: f64| (c * 1e7).round() / 1e7;
        let row = |i: usize| (0..i).map(|j| rounded(u.correlation[i * p + j])).collect();
        Self {
            noise_mm: u.noise * 1e3,
            noise_deg: u.rotation_noise.map(f64::to_degrees),
            course_mm: u.course * 1e3,
            effects_mm: u.effects * 1e3,
            names: u.names.clone(),
            correlation: (0..p).map(row).collect(),
        }
    }

    fn read(self) -> Option<Uncertainty> {
        let p = self.names.len();
        let shaped = self.correlation.len() == p && self.correlation.iter().enumerate().all(|(i, row)| row.len() == i);
        let fine = self.correlation.iter().flatten().all(|c| c.abs() <= 1.0)
            && self.noise_mm > 0.0
            && self.course_mm >= 0.0
            && self.effects_mm >= 0.0
            && self.noise_deg.is_none_or(|sd| sd > 0.0);
        let all = [self.noise_mm, self.course_mm, self.effects_mm, self.noise_deg.unwrap_or(1.0)];
        let finite = all.iter().all(|x| x.is_finite());
        (shaped && fine && finite).then(|| {
            let at = |i: usize, j: usize| match i.cmp(&j) {
                std::cmp::Ordering::Equal => 1.0,
                std::cmp::Ordering::Greater => self.correlation[i][j],
                std::cmp::Ordering::Less => self.correlation[j][i],
            };
            let correlation = (0..p * p).map(|k| at(k / p, k % p)).collect();
            Uncertainty {
                correlation,
                noise: self.noise_mm * 1e-3,
                rotation_noise: self.noise_deg.map(f64::to_radians),
                course: self.course_mm * 1e-3,
                effects: self.effects_mm * 1e-3,
                names: self.names,
            }
        })
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SessionFile {
    recording: String,
    #[serde(default)]
    fingerprint: String,
    /// Of its measurements, 8 hexadecimal digits each: a part of the recording is known again.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    marks: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    frame: Option<usize>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    places: Vec<String>,
    /// For each joint the stretches of its angle modulo a turn that were visited, deg; mm of sliding joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    visited: Vec<Vec<[f64; 2]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    temp_c: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameFile {
    /// `frame_from_world`, before the terms at this frame.
    xyz_mm: [f64; 3],
    quaternion_wxyz: [f64; 4],
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    references_mm: Vec<[f64; 3]>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TermFile {
    name: String,
    effect: String,
    /// Coefficient in `unit`: what is added to nominal, where the sense of motion counts what is lost in it.
    value: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sd: Option<f64>,
    unit: String,
    site: Site,
    #[serde(default = "constant", skip_serializing_if = "Basis::is_constant")]
    basis: Basis,
}

/// Refuses what is no model file, or one of a later version.
fn check_kind(text: &str) -> std::result::Result<(), String> {
    if !text.contains("[[term]]") && !text.contains("format_version") {
        return Err("is not a model file (calibrated.toml or improved.toml, as trical identify writes it)".into());
    }
    match text.parse::<toml::Table>().ok().and_then(|t| t.get("format_version")?.as_integer()) {
        Some(v) if v > i64::from(FORMAT_VERSION) => {
            Err(format!("format_version is {v}: written by a newer TriCal than this one"))
        }
        _ => Ok(()),
    }
}

/// Marks of measurements as a session has them; what is no number there tells nothing.
fn marks_of(text: &str) -> Vec<u32> {
    let each = text.as_bytes().chunks(8).filter_map(|c| std::str::from_utf8(c).ok());
    each.filter_map(|mark| u32::from_str_radix(mark, 16).ok()).collect()
}

impl SessionFile {
    fn read(self, robot: &Robot) -> Session {
        Session {
            visited: Support::from_stretches(robot, &self.visited),
            recording: self.recording,
            fingerprint: Fingerprint { whole: self.fingerprint, marks: marks_of(&self.marks) },
            frame: self.frame,
            places: self.places,
            temp_c: self.temp_c.filter(|t| t.is_finite()),
        }
    }
}

impl FrameFile {
    fn read(&self) -> std::result::Result<(Pose, References), String> {
        let Self { xyz_mm, quaternion_wxyz, references_mm } = self;
        if xyz_mm.iter().chain(quaternion_wxyz).any(|v| !v.is_finite()) {
            return Err("[[frame]] holds a number that is not finite".into());
        }
        let length = quaternion_wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (length - 1.0).abs() > 1e-2 || xyz_mm.iter().any(|x| x.abs() > 1e9) {
            return Err(format!(
                "[[frame]] has quaternion_wxyz of length {length:.4} and xyz_mm {xyz_mm:?}, expected length 1 and a place"
            ));
        }
        let rotation = rotation_from_quaternion(*quaternion_wxyz);
        let translation = nalgebra::Vector3::from(*xyz_mm) * 1e-3;
        let seen = |p: &[f64; 3]| p.iter().all(|x| x.is_finite()).then(|| p.map(|x| x * 1e-3));
        Ok((Pose { rotation, translation }, References::at(references_mm.iter().map(seen).collect())))
    }
}

impl TermFile {
    /// A term of a file of this version, of an arm. Earlier builds wrote what a joint that slides does as if it turned: the factor is that of
    /// the unit that stands there.
    fn read(self, robot: &Robot, format_version: u32) -> std::result::Result<Term, String> {
        let mut term = Term::new(self.name, self.effect, self.site, self.basis);
        let told = unit(robot, &term);
        let known = [told.clone(), unit_of_turning(&term)].into_iter().find(|u| u.name == self.unit);
        let Some(u) = known else {
            return Err(format!("term {} has unit '{}', expected '{}'", term.name, self.unit, told.name));
        };
        if !self.value.is_finite() {
            return Err(format!("term {} has value {}, expected a finite number", term.name, self.value));
        }
        if let Some(sd) = self.sd.filter(|sd| !(sd.is_finite() && *sd >= 0.0)) {
            return Err(format!("term {} has sd {sd}, expected 0 or more", term.name));
        }
        term.basis.check().map_err(|problem| format!("term {}: its basis {problem}", term.name))?;
        let per_si = if format_version < 3 { u.per_si.abs() } else { u.per_si };
        term.value = self.value / per_si;
        term.sd = self.sd.map(|s| s / per_si.abs());
        Ok(term)
    }
}

fn constant() -> Basis {
    Basis::CONSTANT
}

fn table(text: &str) -> toml::Table {
    text.parse().unwrap_or_default()
}

impl ModelFile {
    /// A model that was fitted to `data`. The arm is as it was in the newest session, where the dates in the names of the recordings say which that is.
    #[must_use]
    pub fn of(mut model: Model, data: &Dataset) -> Self {
        take_present_zeros(&mut model, &data.names);
        let each = data.names.iter().zip(&data.fingerprints).zip(&data.frame_of_recording).enumerate();
        let poses = |recording: usize| -> Vec<Joints> {
            data.observations.iter().filter(|o| o.recording == recording).map(|o| o.state.q).collect()
        };
        let sessions = each.map(|(k, ((name, fingerprint), frame))| Session {
            recording: name.clone(),
            fingerprint: fingerprint.clone(),
            frame: frame.map(|f| f + 1),
            places: data.places.get(k).cloned().unwrap_or_default(),
            visited: Support::of(&model.robot, &poses(k)),
            temp_c: data.filtered(|o| o.recording == k).mean_temp_c(),
        });
        let sessions = sessions.collect();
        Self { model, joints: data.joints, references: data.references.clone(), sessions, uncertainty: None }
    }

    /// A model that was identified, with how uncertain its terms are together.
    #[must_use]
    pub fn of_fit(fitted: &Identified) -> Self {
        Self { uncertainty: Uncertainty::of(fitted), ..Self::of(fitted.model.clone(), &fitted.data) }
    }

    /// A model that no recording says anything about: drawn by chance, or nominal.
    #[must_use]
    pub fn unmeasured(model: Model) -> Self {
        Self { model, joints: JointSource::Read, references: Vec::new(), sessions: Vec::new(), uncertainty: None }
    }

    /// Names of the recordings that it came from.
    #[must_use]
    pub fn recordings(&self) -> Vec<&str> {
        self.sessions.iter().map(|s| s.recording.as_str()).collect()
    }

    /// Joint angles that its recordings visited, of those joints whose angle a term of the arm is a function of, and of those that hardly moved:
    /// geometry and compliance hold everywhere, but what only a joint's motion could show was kept at nominal. Empty where the file does not say.
    #[must_use]
    pub fn visited(&self) -> Support {
        let all = self.sessions.iter().fold(Support::default(), |all, s| all.with(&s.visited));
        let follows = |t: &Term, joint| {
            t.basis.of == Variable::Joint { joint } || t.basis.beside.is_some_and(|b| b.joint == joint)
        };
        let followed = |joint| self.model.terms.iter().any(|t| t.scope() == Scope::Arm && follows(t, joint));
        let rests = |joint| all.stroke(joint).is_some_and(|stroke| stroke < little(&self.model.robot, joint - 1));
        all.of_joints(|joint| rests(joint) || followed(joint))
    }

    /// Session (from 1) that a recording with this fingerprint is, or is a part of.
    #[must_use]
    pub fn session_of(&self, fingerprint: &Fingerprint) -> Option<u32> {
        let k = self.sessions.iter().position(|s| fingerprint.is_of(&s.fingerprint))?;
        u32::try_from(k + 1).ok()
    }

    /// The text of the file.
    ///
    /// # Errors
    /// A model that TOML cannot hold (never for one that was fitted).
    pub fn to_toml(&self) -> Result<String> {
        let m = &self.model;
        let frames = m
            .frames
            .iter()
            .enumerate()
            .map(|(k, f)| FrameFile {
                xyz_mm: (f.translation * 1e3).into(),
                quaternion_wxyz: quaternion_from_rotation(&f.rotation),
                references_mm: self
                    .references
                    .get(k)
                    .map(|r| r.positions.iter().map(|p| p.map_or([f64::NAN; 3], |p| p.map(|x| x * 1e3))).collect())
                    .unwrap_or_default(),
            })
            .collect();
        let terms = m
            .terms
            .iter()
            .map(|t| {
                let u = unit(&m.robot, t);
                TermFile {
                    name: t.name.clone(),
                    effect: t.effect.clone(),
                    value: t.value * u.per_si,
                    sd: t.sd.map(|s| s * u.per_si.abs()),
                    unit: u.name,
                    site: t.site,
                    basis: t.basis,
                }
            })
            .collect();
        let file = File {
            format_version: FORMAT_VERSION,
            program: format!("trical {}", env!("CARGO_PKG_VERSION")),
            joints: self.joints,
            recordings: Vec::new(),
            sessions: self
                .sessions
                .iter()
                .map(|s| SessionFile {
                    recording: s.recording.clone(),
                    fingerprint: s.fingerprint.whole.clone(),
                    marks: s.fingerprint.marks.iter().map(|mark| format!("{mark:08x}")).collect(),
                    frame: s.frame,
                    places: s.places.clone(),
                    visited: s.visited.stretches(),
                    temp_c: s.temp_c,
                })
                .collect(),
            robot: table(&m.robot.to_toml()),
            cell: table(&m.cell.to_toml()),
            frames,
            terms,
            uncertainty: self.uncertainty.as_ref().map(UncertaintyFile::of),
        };
        toml::to_string(&file).map_err(|e| IdentError::WrongModel(format!("the model cannot be written: {e}")))
    }

    /// The model with further terms: `[[term]]` tables as a model file has them.
    ///
    /// # Errors
    /// Text that is anything else, or terms at sites that the arm does not have.
    pub fn with_terms(&self, text: &str) -> Result<Self> {
        let mut more: toml::Table = parse_toml(text, "terms")?;
        let Some(toml::Value::Array(terms)) = more.remove("term").filter(|_| more.is_empty()) else {
            return Err(IdentError::WrongModel("terms: expected [[term]] tables and nothing else".into()));
        };
        let mut whole = table(&self.to_toml()?);
        match whole.entry("term").or_insert_with(|| toml::Value::Array(Vec::new())) {
            toml::Value::Array(own) => own.extend(terms),
            other => *other = toml::Value::Array(terms),
        }
        Self::parse(&whole.to_string(), "terms")
    }

    /// Writes the file whole, then renames it into place.
    ///
    /// # Errors
    /// The operating system's, with the file's name.
    pub fn save(&self, path: &Path) -> Result<()> {
        write_whole(path, self.to_toml()?.as_bytes())
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// A sentence that names the file and what is wrong with it.
    pub fn load(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let text = read_text(path)?;
        Self::parse(&text, &name)
    }

    /// Reads the text of a model file.
    ///
    /// # Errors
    /// As [`ModelFile::load`].
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let bad = |problem: String| IdentError::WrongModel(format!("{name}: {problem}"));
        check_kind(text).map_err(bad)?;
        let file: File = parse_toml(text, name)?;
        let part = |t: &toml::Table| toml::to_string(t).map_err(|e| bad(e.to_string()));
        let robot = Robot::parse(&part(&file.robot)?, &format!("{name} [robot]"))?;
        let cell = Cell::parse(&part(&file.cell)?, &format!("{name} [cell]"))?;
        let frames =
            file.frames.iter().map(FrameFile::read).collect::<std::result::Result<Vec<_>, _>>().map_err(bad)?;
        let (frames, references): (Vec<Pose>, Vec<References>) = frames.into_iter().unzip();
        let terms = file
            .terms
            .into_iter()
            .map(|t| t.read(&robot, file.format_version))
            .collect::<std::result::Result<_, _>>()
            .map_err(bad)?;
        if let Some((k, s)) =
            file.sessions.iter().enumerate().find(|(_, s)| s.frame.is_some_and(|f| !(1..=frames.len()).contains(&f)))
        {
            return Err(bad(format!(
                "[[session]] {} has frame {}, expected one of the {} frames",
                k + 1,
                s.frame.unwrap_or(0),
                frames.len()
            )));
        }
        let uncertainty = match file.uncertainty.map(UncertaintyFile::read) {
            Some(None) => {
                return Err(bad(
                    "[uncertainty] is damaged: expected noise_mm above 0 and a triangle of correlations between -1 and 1, one row a name"
                        .into(),
                ));
            }
            read => read.flatten(),
        };
        let sessions = if file.sessions.is_empty() {
            file.recordings.into_iter().map(|recording| Session { recording, ..Session::default() }).collect()
        } else {
            file.sessions.into_iter().map(|s| s.read(&robot)).collect()
        };
        let model = Model { robot, cell, frames, terms };
        if let Err(e @ ModelError::NoSuchSite { .. }) = Forward::new(model.clone(), Vec::new()) {
            return Err(bad(e.to_string()));
        }
        Ok(Self { model, joints: file.joints, references, sessions, uncertainty })
    }

    /// Refuses a model of another arm than `robot`.
    ///
    /// # Errors
    /// What differs.
    pub fn require_robot(&self, robot: &Robot, name: &str) -> Result<()> {
        let own = &self.model.robot;
        let far = |a: &Pose, b: &Pose| {
            (a.rotation - b.rotation).amax() > 1e-9 || (a.translation - b.translation).amax() > 1e-9
        };
        let differs = if own.dof() != robot.dof() {
            Some(format!("{} joints instead of {}", own.dof(), robot.dof()))
        } else if far(&own.root_from_zero, &robot.root_from_zero) {
            Some("another [root]".into())
        } else if far(&own.last_from_flange, &robot.last_from_flange) {
            Some("another [flange]".into())
        } else {
            own.joints.iter().zip(&robot.joints).enumerate().find_map(|(i, (a, b))| {
                let close = |x: f64, y: f64| (x - y).abs() < 1e-9;
                let same = close(a.alpha, b.alpha)
                    && close(a.a, b.a)
                    && close(a.beta, b.beta)
                    && close(a.d, b.d)
                    && close(a.theta_offset, b.theta_offset)
                    && a.kind == b.kind;
                (!same).then(|| format!("other nominal parameters at joint {}", i + 1))
            })
        };
        match differs {
            None => Ok(()),
            Some(what) if own.name == robot.name => Err(IdentError::WrongModel(format!(
                "{name} was made with another robot file of '{}': it has {what}; expected the file that it was made with",
                own.name
            ))),
            Some(what) => Err(IdentError::WrongModel(format!(
                "{name} is a model of '{}', not of '{}': it has {what}",
                own.name, robot.name
            ))),
        }
    }
}

/// Writes a file whole or not at all ([`trical_recording::whole`]).
///
/// # Errors
/// The operating system's, with the file's name.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    trical_recording::whole::write_whole(path, bytes)
        .map_err(|source| trical_recording::RecordError::Io { path: path.to_owned(), action: "write", source }.into())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn where_references_were_seen_comes_back_and_those_never_seen_stay_unknown() {
        let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let mut model = Model::nominal(robot, Cell::bare());
        model.frames = vec![Pose { translation: nalgebra::Vector3::new(1.5, -0.25, 0.5), ..Pose::identity() }];
        let references = vec![References::at(vec![Some([0.5, -0.25, 1.0]), None])];
        let file = ModelFile { model, joints: JointSource::Read, references, sessions: Vec::new(), uncertainty: None };
        let text = file.to_toml().unwrap();
        assert!(text.contains("500.0") && text.contains("-250.0"), "{text}");
        let again = ModelFile::parse(&text, "m.toml").unwrap();
        assert_eq!(again.references, file.references);
        assert_eq!(again.model.frames[0].translation, file.model.frames[0].translation);
    }
}
