//! The part of a URDF that kinematics and gravity need, with the line that each thing stands on.
//!
//! By quick-xml, not by the crate `urdf-rs` (0.10.0), which was tried on the URDFs of `tests.rs` and of makers. It reads what must be
//! refused: of the 25 broken files of `tests.rs` it reads 18, and in `xyz="0 x 0 0.3"` it passes over the word and takes three numbers,
//! which is another arm. It refuses what must be read: an `<inertial>` without `<inertia>`, a `<limit>` without `velocity`, a mesh without
//! a name, a gripper's limit that is no number. It keeps neither lines, for messages, nor places, for a corrected file. So every value
//! would have to be found, read and checked here before that crate could read it again; docs/dependencies.md has the rest.

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use crate::error::{Lines, ModelError, Result};
use crate::pose::{Pose, rotation_zyx};

type V3 = nalgebra::Vector3<f64>;

/// A robot of a few hundred links is 1 MB; meshes are files of their own.
const LARGEST: usize = 20_000_000;
const MOST_LINKS: usize = 10_000;
const DEEPEST: usize = 100;
/// Two turns: no file needs more, and 30 deg are beyond it.
const FARTHEST_TURN: f64 = 12.6;

/// What converters from SDF write as the limit of a joint that has none, rad or m.
pub(crate) const NO_LIMIT: f64 = 1e16;

/// Mass and centre of gravity in the link's frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Inertial {
    pub mass: f64,
    pub cog: V3,
}

#[derive(Debug)]
pub(crate) struct Link {
    pub name: String,
    pub line: usize,
    pub inertial: Inertial,
}

#[derive(Debug)]
pub(crate) struct Joint {
    pub name: String,
    pub line: usize,
    pub kind: String,
    pub parent: String,
    pub child: String,
    pub parent_from_joint: Pose,
    pub axis: V3,
    /// `<limit>`: line, lower, upper.
    pub limit: Option<(usize, Option<f64>, Option<f64>)>,
    pub mimics: Option<String>,
    /// Behind its start tag, and from where to where its `<origin>` tag stands: bytes of the file.
    pub opened_at: usize,
    pub origin_at: Option<(usize, usize)>,
    /// What is wrong with its axis or its limits: matters where the chain moves by it.
    pub problem: Option<ModelError>,
}

impl Joint {
    fn has(&mut self, problem: ModelError) {
        self.problem.get_or_insert(problem);
    }
}

#[derive(Debug, Default)]
pub(crate) struct Urdf {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
}

pub(crate) fn error(file: &str, line: usize, problem: impl Into<String>) -> ModelError {
    ModelError::Input { file: file.to_owned(), place: format!("line {line}"), problem: problem.into() }
}

/// One element with its line and, for messages, whose it is.
struct Element<'a> {
    file: &'a str,
    line: usize,
    /// "joint 'elbow': " or nothing.
    owner: String,
    tag: String,
    start: &'a BytesStart<'a>,
}

impl Element<'_> {
    fn error(&self, problem: impl std::fmt::Display) -> ModelError {
        error(self.file, self.line, format!("{}{problem}", self.owner))
    }

    fn get(&self, name: &str) -> Result<Option<String>> {
        let tag = &self.tag;
        for a in self.start.attributes() {
            let a = a.map_err(|e| self.error(format!("<{tag}> has a broken attribute: {e}")))?;
            if a.key.as_ref() == name {
                let value = a.normalized_value(XmlVersion::Implicit1_0);
                return value
                    .map(|v| Some(v.trim().to_owned()))
                    .map_err(|e| self.error(format!("<{tag}> {name} cannot be read: {e}")));
            }
        }
        Ok(None)
    }

    fn required(&self, name: &str) -> Result<String> {
        match self.get(name)? {
            Some(v) if !v.is_empty() => Ok(v),
            _ => Err(self.error(format!("<{}> has no {name}", self.tag))),
        }
    }

    /// A finite number no larger than `limit`; the unit is for messages.
    fn number(&self, name: &str, text: &str, limit: f64, unit: &str) -> Result<f64> {
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() && v.abs() <= limit => Ok(v),
            _ => Err(self.error(format!(
                "<{}> {name}: found '{text}', expected a number between -{limit} and {limit} {unit}",
                self.tag
            ))),
        }
    }

    fn three(&self, name: &str, limit: f64, unit: &str) -> Result<Option<V3>> {
        let Some(text) = self.get(name)? else { return Ok(None) };
        let parts: Vec<&str> = text.split_whitespace().collect();
        let [x, y, z] = parts[..] else {
            return Err(self.error(format!("<{}> {name}: found '{text}', expected three numbers", self.tag)));
        };
        let one = |t| self.number(name, t, limit, unit);
        Ok(Some(V3::new(one(x)?, one(y)?, one(z)?)))
    }

    /// `xyz` in m and `rpy` in rad (right angles in deg are beyond what is taken): `R = Rz(yaw) Ry(pitch) Rx(roll)`.
    fn origin(&self) -> Result<Pose> {
        if self.get("quat_xyzw")?.is_some() {
            return Err(self.error("<origin> quat_xyzw is not understood, expected rpy"));
        }
        let rpy = self.three("rpy", FARTHEST_TURN, "rad")?.unwrap_or_default();
        Ok(Pose {
            rotation: rotation_zyx(rpy.z, rpy.y, rpy.x),
            translation: self.three("xyz", 100.0, "m")?.unwrap_or_default(),
        })
    }
}

/// Reads the text of a URDF.
pub(crate) fn read(text: &str, file: &str) -> Result<Urdf> {
    if text.len() > LARGEST {
        let problem = format!("has {} bytes, expected a URDF of at most {LARGEST}", text.len());
        return Err(ModelError::unreadable(file, problem));
    }
    let mut reader = Reader::from_str(text);
    let mut lines = Lines::new(text.as_bytes());
    let mut urdf = Urdf::default();
    let mut path: Vec<String> = Vec::new();
    let mut seen_robot = false;
    loop {
        let event = reader.read_event();
        let line = lines.of(reader.buffer_position() as usize);
        let event = event.map_err(|e| error(file, line, format!("is not well-formed XML: {e}")))?;
        match event {
            Event::Start(ref start) | Event::Empty(ref start) => {
                let opens = matches!(event, Event::Start(_));
                if opens && path.len() >= DEEPEST {
                    return Err(error(file, line, format!("elements are nested more than {DEEPEST} deep")));
                }
                element(&mut urdf, &path, start, file, line)?;
                place(&mut urdf, &path, start.name().as_ref(), text, reader.buffer_position());
                seen_robot = true;
                if opens {
                    path.push(start.name().as_ref().to_owned());
                }
            }
            Event::End(_) => {
                path.pop();
            }
            Event::DocType(_) => {
                return Err(error(file, line, "has a DOCTYPE, which a URDF has no use for: entities are not expanded"));
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if !path.is_empty() {
        return Err(error(file, lines.of(text.len()), format!("ends within <{}>", path.join("> <"))));
    }
    if !seen_robot {
        return Err(ModelError::unreadable(file, "holds no <robot>"));
    }
    Ok(urdf)
}

/// Notes where a joint, or its origin, stands in the file: the tag that was just read ends at byte `end`.
fn place(urdf: &mut Urdf, path: &[String], tag: &str, text: &str, end: u64) {
    let end = usize::try_from(end).unwrap_or(usize::MAX).min(text.len());
    let Some(joint) = urdf.joints.last_mut() else { return };
    match (path, tag) {
        ([robot], "joint") if robot == "robot" => joint.opened_at = end,
        ([robot, owner], "origin") if robot == "robot" && owner == "joint" => {
            // no attribute holds a bare <
            joint.origin_at = text.get(..end).and_then(|t| t.rfind('<')).map(|begin| (begin, end));
        }
        _ => {}
    }
}

fn element(urdf: &mut Urdf, path: &[String], start: &BytesStart<'_>, file: &str, line: usize) -> Result<()> {
    let name = start.name();
    let tag = name.as_ref();
    if tag.starts_with("xacro:") {
        return Err(error(
            file,
            line,
            format!("<{tag}>: this is a xacro file, which must be expanded to a URDF first"),
        ));
    }
    let path: Vec<&str> = path.iter().map(String::as_str).collect();
    let mut e = Element { file, line, owner: String::new(), tag: tag.to_owned(), start };
    match (path.as_slice(), tag) {
        ([], "robot") => urdf.name = e.get("name")?.unwrap_or_default(),
        ([], _) => return Err(e.error(format!("found <{tag}>, expected <robot>: this is not a URDF"))),
        (["robot"], "link") => {
            if urdf.links.len() >= MOST_LINKS {
                return Err(e.error(format!("has more than {MOST_LINKS} links")));
            }
            urdf.links.push(Link { name: e.required("name")?, line, inertial: Inertial::default() });
        }
        (["robot"], "joint") => {
            if urdf.joints.len() >= MOST_LINKS {
                return Err(e.error(format!("has more than {MOST_LINKS} joints")));
            }
            let name = e.required("name")?;
            e.owner = format!("joint '{name}': ");
            urdf.joints.push(Joint {
                kind: e.required("type")?,
                name,
                line,
                parent: String::new(),
                child: String::new(),
                parent_from_joint: Pose::identity(),
                axis: V3::x(),
                limit: None,
                mimics: None,
                opened_at: 0,
                origin_at: None,
                problem: None,
            });
        }
        (["robot", "link", "inertial"], _) => {
            let Some(link) = urdf.links.last_mut() else { return Ok(()) };
            e.owner = format!("link '{}': ", link.name);
            return read_inertial(&mut link.inertial, &e);
        }
        (["robot", "joint"], _) => {
            let Some(joint) = urdf.joints.last_mut() else { return Ok(()) };
            e.owner = format!("joint '{}': ", joint.name);
            return read_joint(joint, &e);
        }
        _ => {}
    }
    Ok(())
}

/// An element of an `<inertial>`.
fn read_inertial(inertial: &mut Inertial, e: &Element<'_>) -> Result<()> {
    match e.tag.as_str() {
        "origin" => inertial.cog = e.origin()?.translation,
        "mass" => {
            let mass = e.number("value", &e.required("value")?, 1e5, "kg")?;
            if mass < 0.0 {
                return Err(e.error(format!("<mass> value: found {mass}, expected a mass of 0 to 100000 kg")));
            }
            inertial.mass = mass;
        }
        _ => {}
    }
    Ok(())
}

/// An element of a `<joint>`.
fn read_joint(joint: &mut Joint, e: &Element<'_>) -> Result<()> {
    match e.tag.as_str() {
        "parent" => joint.parent = e.required("link")?,
        "child" => joint.child = e.required("link")?,
        "origin" => joint.parent_from_joint = e.origin()?,
        "mimic" => joint.mimics = Some(e.required("joint")?),
        "axis" => match e.three("xyz", 1e6, "").map(|axis| axis.unwrap_or_else(V3::x)) {
            Ok(axis) if axis.norm() >= 1e-6 => joint.axis = axis.normalize(),
            Ok(_) => joint.has(e.error("<axis> xyz has no length, expected a direction")),
            Err(problem) => joint.has(problem),
        },
        "limit" => {
            let number = |name| -> Result<Option<f64>> {
                e.get(name)?.map(|t| e.number(name, &t, NO_LIMIT, "rad (m)")).transpose()
            };
            match number("lower").and_then(|lower| Ok((lower, number("upper")?))) {
                Ok((lower, upper)) => joint.limit = Some((e.line, lower, upper)),
                Err(problem) => joint.has(problem),
            }
        }
        _ => {}
    }
    Ok(())
}
