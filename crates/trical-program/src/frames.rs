//! Tools and work objects: those that a program declares, those of a file that gives them, and what is known without.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;
use trical_model::error::{parse_toml, read_text};
use trical_model::pose::{rotation_from_quaternion, rotation_zyx};
use trical_model::{Cell, Pose, Tool};

use crate::error::ProgramError;

/// A tool, or a work object (base, user frame), as a program declares it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The tool's centre point and axes in the flange; the work object in the controller's world.
    pub parent_from_frame: Pose,
    /// Mass of a tool, kg.
    pub mass: f64,
    /// Centre of gravity of a tool in the flange frame, m.
    pub cog: Vector3<f64>,
}

impl Frame {
    /// A work object, or a tool without a known mass.
    #[must_use]
    pub fn massless(parent_from_frame: Pose) -> Self {
        Self { parent_from_frame, mass: 0.0, cog: Vector3::zeros() }
    }

    /// One that is given in this one.
    #[must_use]
    pub fn compose(&self, inner: &Self) -> Self {
        Self { parent_from_frame: self.parent_from_frame.compose(&inner.parent_from_frame), ..*self }
    }

    /// Whether this is the tool of the cell: the same place to 0.01 mm, the same axes to 0.01 deg.
    #[must_use]
    pub fn is_of(&self, cell: &Cell) -> bool {
        let p = &self.parent_from_frame;
        (p.translation - cell.tool.tcp).amax() < 1e-5 && (p.rotation - cell.tool.rotation).amax() < 2e-4
    }

    /// As a cell's tool.
    #[must_use]
    pub fn tool(&self) -> Tool {
        Tool {
            tcp: self.parent_from_frame.translation,
            rotation: self.parent_from_frame.rotation,
            targets: vec![self.parent_from_frame.translation],
            mass: self.mass,
            cog: self.cog,
        }
    }
}

/// Tools or frames by their names; one that is nothing usable says why.
pub type Named = BTreeMap<String, Result<Frame, String>>;

/// Tools and work objects by lower-case name.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Tools.
    pub tools: Named,
    /// Work objects (bases, user frames) in the controller's world.
    pub frames: Named,
    /// The controller's world in the arm's foot, where it is not the foot itself.
    pub world: Option<Pose>,
}

impl Frames {
    /// The flange as a tool and the controller's world as a frame, by the names that a controller has for them.
    #[must_use]
    pub fn predefined(flange: &str, world: &str) -> Self {
        let [tools, frames] =
            [flange, world].map(|name| [(name.to_owned(), Ok(Frame::massless(Pose::identity())))].into());
        Self { tools, frames, world: None }
    }

    /// With these as [`Self::predefined`]: no program changes them.
    pub fn predefine(&mut self, flange: &str, world: &str) {
        let Self { tools, frames, .. } = Self::predefined(flange, world);
        self.tools.extend(tools);
        self.frames.extend(frames);
    }

    /// The tools, or the frames.
    #[must_use]
    pub fn of(&self, is_tool: bool) -> &Named {
        if is_tool { &self.tools } else { &self.frames }
    }

    /// As [`Self::of`], to add to them.
    pub fn of_mut(&mut self, is_tool: bool) -> &mut Named {
        if is_tool { &mut self.tools } else { &mut self.frames }
    }

    /// What has this name is nothing usable, neither as a tool nor as a frame.
    pub fn refuse(&mut self, name: &str, why: &str) {
        for known in [&mut self.tools, &mut self.frames] {
            known.insert(name.to_owned(), Err(why.to_owned()));
        }
    }
}

impl Frames {
    /// The name of a tool that nobody knows: with it a routine, which is in none of the files read, goes to what a program gives to it.
    pub fn tool_of_unread(&mut self, routine: &str) -> String {
        let name = format!("(the tool of {routine})");
        let why = format!(
            "is given to '{routine}', which is in none of the files read: with which tool it goes there is not known"
        );
        self.tools.entry(name.clone()).or_insert(Err(why));
        name
    }
}

/// Stands between a name and the offset in the text where it is given; a report says the line instead.
pub const AT: &str = " at byte ";

/// The name of what a program gives without one: of the first that is the same, else `name`, under which it is kept.
pub fn named(known: &mut Named, name: String, new: Result<Frame, String>) -> String {
    if let Some((first, _)) = known.iter().find(|(first, old)| new.is_ok() && **old == new && first.contains(AT)) {
        return first.clone();
    }
    known.insert(name.clone(), new);
    name
}

/// Keeps what a program declares; of what it declares otherwise elsewhere nobody knows which holds, as `twice` says.
pub fn declare(known: &mut Named, name: String, new: Result<Frame, String>, twice: &str) {
    let differs = known.get(&name).is_some_and(|before| *before != new);
    known.insert(name, if differs { Err(twice.to_owned()) } else { new });
}

/// How the name begins of a tool that stands still while the robot carries the work.
pub const STANDING: &str = "#tcp : ";

/// Stands between the names of frames whose product is meant, each in the one before it.
pub const TIMES: &str = " : ";

/// Looks a frame up `elsewhere` that is not `known`; of a product, each of its frames.
pub fn find(known: &mut Named, name: Option<&String>, elsewhere: &dyn Fn(&str) -> Option<Result<Frame, String>>) {
    let Some(name) = name.filter(|name| !known.contains_key(*name)) else { return };
    let parts = name.split(TIMES).map(|part| known.get(part).cloned().or_else(|| elsewhere(part)));
    let all = parts.reduce(|a, b| match (a, b) {
        (Some(Err(why)), _) | (_, Some(Err(why))) => Some(Err(why)),
        (Some(Ok(a)), Some(Ok(b))) => Some(Ok(a.compose(&b))),
        _ => None,
    });
    known.extend(all.flatten().map(|frame| (name.clone(), frame)));
}

const TWICE: &str = "is given twice: controllers do not distinguish upper and lower case";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    world: Option<FrameFile>,
    #[serde(default)]
    tools: BTreeMap<String, FrameFile>,
    #[serde(default)]
    frames: BTreeMap<String, FrameFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameFile {
    xyz_mm: [f64; 3],
    zyx_deg: Option<[f64; 3]>,
    quaternion: Option<[f64; 4]>,
    mass_kg: Option<f64>,
    cog_mm: Option<[f64; 3]>,
}

impl FrameFile {
    fn pose(&self) -> Result<Pose, String> {
        if self.xyz_mm.iter().any(|x| !x.is_finite() || x.abs() > 1e6) {
            return Err(format!("xyz_mm: found {:?}, expected three numbers", self.xyz_mm));
        }
        let rotation = match (self.zyx_deg, self.quaternion) {
            (None, None) => Matrix3::identity(),
            (Some([z, y, x]), None) if [z, y, x].iter().all(|a| a.is_finite()) => {
                rotation_zyx(z.to_radians(), y.to_radians(), x.to_radians())
            }
            (None, Some(q)) if (q.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.0).abs() < 0.01 => {
                rotation_from_quaternion(q)
            }
            (None, Some(q)) => return Err(format!("quaternion: found {q:?}, expected w, x, y, z of length 1")),
            _ => return Err("expected either zyx_deg (three numbers) or quaternion".into()),
        };
        Ok(Pose { rotation, translation: Vector3::from(self.xyz_mm) * 1e-3 })
    }

    fn frame(&self, is_tool: bool) -> Result<Frame, String> {
        if !is_tool && (self.mass_kg.is_some() || self.cog_mm.is_some()) {
            return Err("mass_kg and cog_mm belong to tools".into());
        }
        let (mass, cog) = (self.mass_kg.unwrap_or(0.0), self.cog_mm.unwrap_or_default());
        if !(mass.is_finite() && (0.0..1e4).contains(&mass)) || cog.iter().any(|c| !c.is_finite() || c.abs() > 1e6) {
            return Err(format!("found {mass} kg at {cog:?} mm, expected a mass and its place"));
        }
        Ok(Frame { mass, cog: Vector3::from(cog) * 1e-3, ..Frame::massless(self.pose()?) })
    }
}

impl Frames {
    /// Reads a file of tools and frames: `[world]`, `[tools.NAME]`, `[frames.NAME]`, each with `xyz_mm` and `zyx_deg` or `quaternion`
    /// (w, x, y, z); tools may have `mass_kg` and `cog_mm` (in the flange).
    ///
    /// # Errors
    /// One sentence with file and place.
    pub fn load(path: &Path) -> Result<Self, ProgramError> {
        let text = read_text(path).map_err(|e| ProgramError::Input(e.to_string()))?;
        Self::parse(&text, &path.display().to_string())
    }

    /// As [`Self::load`], of a text; `file` is for messages.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, ProgramError> {
        let raw: File = parse_toml(text, file).map_err(|e| ProgramError::Input(e.to_string()))?;
        let bad = |place: &str, problem: String| ProgramError::Input(format!("{file}, {place}: {problem}"));
        let mut out = Self::default();
        if let Some(world) = &raw.world {
            out.world = Some(world.pose().map_err(|e| bad("[world]", e))?);
        }
        for (is_tool, what, all) in [(false, "frames", &raw.frames), (true, "tools", &raw.tools)] {
            for (name, f) in all {
                let bad = |problem| bad(&format!("[{what}.{name}]"), problem);
                let frame = f.frame(is_tool).map_err(bad)?;
                if out.of_mut(is_tool).insert(name.to_lowercase(), Ok(frame)).is_some() {
                    return Err(bad(TWICE.into()));
                }
            }
        }
        Ok(out)
    }

    /// These, and those of `other` that these do not have.
    pub fn or(&mut self, other: &Self) {
        for is_tool in [true, false] {
            for (name, frame) in other.of(is_tool) {
                self.of_mut(is_tool).entry(name.clone()).or_insert_with(|| frame.clone());
            }
        }
        self.world = self.world.or(other.world);
    }
}
