//! Tools and work objects: those that a program declares, those of a file that gives them, and what is known without.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;
use trical_model::error::{parse_toml, read_text};
use trical_model::pose::{rotation_from_quaternion, rotation_zyx};
use trical_model::{Cell, Pose, Tool};

use crate::error::ProgramError;

/// A tool as a program declares it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolFrame {
    /// The tool's centre point and axes in the flange.
    pub flange_from_tool: Pose,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of gravity in the flange frame, m.
    pub cog: Vector3<f64>,
}

impl ToolFrame {
    /// A tool without a known mass.
    #[must_use]
    pub fn massless(flange_from_tool: Pose) -> Self {
        Self { flange_from_tool, mass: 0.0, cog: Vector3::zeros() }
    }

    /// A tool whose centre point is given in this one.
    #[must_use]
    pub fn compose(&self, in_tool: &Self) -> Self {
        Self { flange_from_tool: self.flange_from_tool.compose(&in_tool.flange_from_tool), ..*self }
    }

    /// Whether this is the tool of the cell: the same place to 0.01 mm, the same axes to 0.01 deg.
    #[must_use]
    pub fn is_of(&self, cell: &Cell) -> bool {
        let p = &self.flange_from_tool;
        (p.translation - cell.tool.tcp).amax() < 1e-5 && (p.rotation - cell.tool.rotation).amax() < 2e-4
    }

    /// As a cell's tool.
    #[must_use]
    pub fn tool(&self) -> Tool {
        Tool {
            tcp: self.flange_from_tool.translation,
            rotation: self.flange_from_tool.rotation,
            targets: vec![self.flange_from_tool.translation],
            mass: self.mass,
            cog: self.cog,
        }
    }
}

/// Tools or frames by their names; one that is nothing usable says why.
pub type Named<T> = BTreeMap<String, Result<T, String>>;

/// Tools and work objects by lower-case name.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Tools.
    pub tools: Named<ToolFrame>,
    /// Work objects (bases, user frames) in the controller's world.
    pub frames: Named<Pose>,
    /// The controller's world in the arm's foot, where it is not the foot itself.
    pub world: Option<Pose>,
}

impl Frames {
    /// The flange as a tool and the controller's world as a frame, by the names that a controller has for them.
    #[must_use]
    pub fn predefined(flange: &str, world: &str) -> Self {
        let flange = (flange.to_owned(), Ok(ToolFrame::massless(Pose::identity())));
        Self { tools: [flange].into(), frames: [(world.to_owned(), Ok(Pose::identity()))].into(), world: None }
    }

    /// With these as [`Self::predefined`]: no program changes them.
    pub fn predefine(&mut self, flange: &str, world: &str) {
        let Self { tools, frames, .. } = Self::predefined(flange, world);
        self.tools.extend(tools);
        self.frames.extend(frames);
    }
}

/// Stands between a name and the offset in the text where it is given; a report says the line instead.
pub const AT: &str = " at byte ";

/// The name of what a program gives without one: of the first that is the same, else `name`, under which it is kept.
pub fn named<T: PartialEq>(known: &mut Named<T>, name: String, new: Result<T, String>) -> String {
    if let Some((first, _)) = known.iter().find(|(first, old)| new.is_ok() && **old == new && first.contains(AT)) {
        return first.clone();
    }
    known.insert(name.clone(), new);
    name
}

/// Stands between the names of frames whose product is meant, each in the one before it.
pub const TIMES: &str = " : ";

/// Looks a frame up `elsewhere` that is not `known`; of a product, each of its frames.
pub fn find<T: Clone>(
    known: &mut Named<T>,
    name: Option<&String>,
    elsewhere: &dyn Fn(&str) -> Option<Result<T, String>>,
    compose: fn(&T, &T) -> T,
) {
    let Some(name) = name.filter(|name| !known.contains_key(*name)) else { return };
    let parts = name.split(TIMES).map(|part| known.get(part).cloned().or_else(|| elsewhere(part)));
    let all = parts.reduce(|a, b| match (a, b) {
        (Some(Err(why)), _) | (_, Some(Err(why))) => Some(Err(why)),
        (Some(Ok(a)), Some(Ok(b))) => Some(Ok(compose(&a, &b))),
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
        for (name, f) in &raw.frames {
            let place = format!("[frames.{name}]");
            if f.mass_kg.is_some() || f.cog_mm.is_some() {
                return Err(bad(&place, "mass_kg and cog_mm belong to tools".into()));
            }
            if out.frames.insert(name.to_lowercase(), Ok(f.pose().map_err(|e| bad(&place, e))?)).is_some() {
                return Err(bad(&place, TWICE.into()));
            }
        }
        for (name, f) in &raw.tools {
            let place = format!("[tools.{name}]");
            let mass = f.mass_kg.unwrap_or(0.0);
            let cog = f.cog_mm.unwrap_or_default();
            if !(mass.is_finite() && (0.0..1e4).contains(&mass)) || cog.iter().any(|c| !c.is_finite() || c.abs() > 1e6)
            {
                return Err(bad(&place, format!("found {mass} kg at {cog:?} mm, expected a mass and its place")));
            }
            let flange_from_tool = f.pose().map_err(|e| bad(&place, e))?;
            let tool = ToolFrame { flange_from_tool, mass, cog: Vector3::from(cog) * 1e-3 };
            if out.tools.insert(name.to_lowercase(), Ok(tool)).is_some() {
                return Err(bad(&place, TWICE.into()));
            }
        }
        Ok(out)
    }

    /// These, and those of `other` that these do not have.
    pub fn or(&mut self, other: &Self) {
        for (name, tool) in &other.tools {
            self.tools.entry(name.clone()).or_insert_with(|| tool.clone());
        }
        for (name, frame) in &other.frames {
            self.frames.entry(name.clone()).or_insert_with(|| frame.clone());
        }
        self.world = self.world.or(other.world);
    }
}
