//! Arms from URDF: the chain between two links, converted exactly to Craig's modified Denavit-Hartenberg parameters.
//!
//! What moves becomes joints (revolute, continuous and prismatic; 1 to 9 of them), what is fixed becomes part of the link that
//! carries it, mass included. Branches off the chain (a gripper's fingers) count with their mass, at the zero position of
//! their joints. A continuous joint gets limits of one turn to either side. By the URDF's own rule a link without `<inertial>`
//! has no mass; an arm none of whose links has any is an arm of unknown masses.
//!
//! The conversion keeps flange poses to rounding (1e-12 of the arm's length): the first frame {0} stands on axis 1 beside the
//! root link, the last on the last axis beside the flange, and what Craig's four numbers cannot hold before the one and after
//! the other goes into [`Robot::root_from_zero`] and [`Robot::last_from_flange`]. A frame never stands farther from the
//! origin of its URDF joint than three lengths of the arm: where a common normal would (axes nearly parallel), Hayati's form
//! is used, with [`crate::Joint::beta`]. The same form holds for axes within 1e-4 rad of parallel.
//!
//! ```
//! let text = r#"<robot name="one joint"><link name="base"/><link name="arm"/>
//!   <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
//!     <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
//! let robot = trical_model::urdf::parse(text, "one.urdf", None, None)?.robot;
//! assert_eq!((robot.dof(), robot.joints[0].d), (1, 0.3));
//! # Ok::<(), trical_model::ModelError>(())
//! ```

mod mdh;
#[cfg(test)]
mod tests;
pub(crate) mod tree;
pub(crate) mod write;
pub(crate) mod xml;

use std::path::{Path, PathBuf};

use crate::error::{ModelError, Result, read_bytes, read_text};
use crate::robot::Robot;

pub(crate) use mdh::robot_from_axes;
pub(crate) use tree::Axes;
pub use write::write;

impl Robot {
    /// Reads `robot.toml`, or the arm of a URDF (`arm.urdf`, `arm.xml`), where links may be named behind a `#`:
    /// `arm.urdf#base_link:tool0` (see [`crate::urdf`]).
    ///
    /// # Errors
    /// A sentence that names the file, the line or field, what was found and what is expected.
    pub fn load(path: &Path) -> Result<Self> {
        if let Some(source) = UrdfPath::of(path) {
            return Ok(source.load()?.robot);
        }
        Self::parse(&read_text(path)?, &path.display().to_string())
    }
}

/// An arm from a URDF.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The arm in Craig's frames. Its name, and those of its joints, are the URDF's.
    pub robot: Robot,
    /// The link that a cell places in {w}.
    pub root: String,
    /// The link that carries the tool.
    pub tip: String,
}

impl Imported {
    /// The text of a robot.toml that says where the arm came from.
    #[must_use]
    pub fn to_toml(&self, source: &Path) -> String {
        let (root, tip, joints) = (&self.root, &self.tip, self.robot.joint_names.join(", "));
        format!("# The arm of {} from link {root} to link {tip}; joints: {joints}.\n", source.display())
            + &self.robot.to_toml()
    }
}

/// A URDF's path with the two links that were named behind a `#`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UrdfPath {
    /// The file.
    pub path: PathBuf,
    /// The link to start from; the root of the tree if it was not named.
    pub root: Option<String>,
    /// The link that carries the tool; the only end of the tree if it was not named.
    pub tip: Option<String>,
}

impl UrdfPath {
    /// `arm.urdf`, `arm.urdf#base_link:tool0`, `arm.urdf#:tool0`, `arm.xml#tool0`; `None` where the name says it is no URDF.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let named = |p: &Path| {
            p.extension().is_some_and(|e| ["urdf", "xml", "xacro"].iter().any(|x| e.eq_ignore_ascii_case(x)))
        };
        if named(path) {
            return Some(Self { path: path.to_owned(), root: None, tip: None });
        }
        let (file, links) = path.to_str()?.rsplit_once('#')?;
        let (root, tip) = links.split_once(':').unwrap_or(("", links));
        let some = |s: &str| (!s.is_empty()).then(|| s.to_owned());
        let path = PathBuf::from(file);
        named(&path).then(|| Self { path, root: some(root), tip: some(tip) })
    }

    /// Reads the arm.
    ///
    /// # Errors
    /// As [`parse`].
    pub fn load(&self) -> Result<Imported> {
        let text = read_xml(&self.path)?;
        parse(&text, &self.path.display().to_string(), self.root.as_deref(), self.tip.as_deref())
    }
}

/// Reads the text of a URDF. Of a file in ISO-8859-1 that says so, it is the same in UTF-8, and says that.
///
/// # Errors
/// One sentence that names the file.
pub(crate) fn read_xml(path: &Path) -> Result<String> {
    let problem = "is not UTF-8 text, nor does its first line say that it is in ISO-8859-1";
    in_utf8(read_bytes(path)?).ok_or_else(|| ModelError::unreadable(&path.display().to_string(), problem))
}

fn in_utf8(bytes: Vec<u8>) -> Option<String> {
    const LATIN: &str = "iso-8859-1";
    let bytes = match String::from_utf8(bytes) {
        Ok(text) => return Some(text),
        Err(e) => e.into_bytes(),
    };
    let text: String = bytes.iter().map(|b| char::from(*b)).collect();
    let end = text.find("?>").filter(|_| text.starts_with("<?xml"))?;
    let (declaration, rest) = text.split_at(end);
    let at = declaration.to_ascii_lowercase().find(LATIN)?;
    let behind = &declaration[at + LATIN.len()..];
    behind.starts_with(['"', '\'']).then(|| format!("{}UTF-8{behind}{rest}", &declaration[..at]))
}

/// Reads the arm between two links of a URDF (the root of the tree and its only end, if they are not named); `file` is its
/// name for messages.
///
/// # Errors
/// One sentence with file and line: XML that is not well-formed, a DOCTYPE, xacro; a link or joint twice, a joint whose link is
/// missing, a link in the air, a closed loop, a link that does not exist or does not descend from the other; floating, planar or
/// mimicking joints, more than nine; missing limits; numbers that are not finite, lengths beyond 100 m; more than 20 MB or
/// 10 000 links.
pub fn parse(text: &str, file: &str, root: Option<&str>, tip: Option<&str>) -> Result<Imported> {
    let urdf = xml::read(text, file)?;
    let serial = tree::serial(&urdf, file, root, tip)?;
    let name = if urdf.name.is_empty() { "URDF" } else { urdf.name.as_str() };
    let robot = Robot { joint_names: serial.names, ..robot_from_axes(&serial.joints, &serial.root_from_tip, name) };
    Ok(Imported { robot, root: serial.root, tip: serial.tip })
}
