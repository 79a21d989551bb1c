//! The cell as data: where the base stands, what the flange carries, where the balls are.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result, parse_toml_of, read_text};
use crate::pose::{Pose, angles_zyx, rotation_zyx};
use crate::robot::{check_version, tidy};

/// What the flange carries.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// Tool centre point in the flange frame {n}, m.
    pub tcp: Vector3<f64>,
    /// Orientation of the tool's axes in the flange frame; the identity for a touching device.
    pub rotation: Matrix3<f64>,
    /// Targets for an optical instrument, in the flange frame, m. Never empty: without a list it holds the TCP.
    pub targets: Vec<Vector3<f64>>,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of gravity in the flange frame, m.
    pub cog: Vector3<f64>,
}

/// Base, tool and balls, nominal.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// {0} in the world frame {w}.
    pub world_from_base: Pose,
    /// The tool.
    pub tool: Tool,
    /// Centres of the balls in {w}, m; empty where the cell has none.
    pub balls: Vec<Vector3<f64>>,
    /// Fixed points from which distances are measured, in {w}, m.
    pub anchors: Vec<Vector3<f64>>,
    /// Sections that other crates read (geometry for collision checks), as they stand in the file.
    pub geometry: Option<toml::Table>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CellFile {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    format_version: Option<u32>,
    base: BaseFile,
    tool: ToolFile,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    balls: Option<BallsFile>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    anchors: Option<PointsFile>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    geometry: Option<toml::Table>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BaseFile {
    xyz_mm: [f64; 3],
    zyx_deg: [f64; 3],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolFile {
    tcp_mm: [f64; 3],
    #[serde(default)]
    zyx_deg: [f64; 3],
    #[serde(default)]
    targets_mm: Vec<[f64; 3]>,
    #[serde(default)]
    mass_kg: f64,
    #[serde(default)]
    cog_mm: [f64; 3],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BallsFile {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distances_mm: Option<Distances>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    positions_mm: Option<Vec<[f64; 3]>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PointsFile {
    positions_mm: Vec<[f64; 3]>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Distances {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    d12: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    d13: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    d23: Option<f64>,
}

impl Distances {
    /// The balls in {w}, m: one for no distance, two on x for `d12`, three for all.
    ///
    /// # Errors
    /// What is wrong, in words.
    fn balls(self) -> std::result::Result<Vec<Vector3<f64>>, String> {
        let [d12, d13, d23] = match [self.d12, self.d13, self.d23] {
            [None, None, None] => return Ok(vec![Vector3::zeros()]),
            [Some(d12), None, None] if d12.is_finite() && d12 > 0.0 && d12 < 1e6 => {
                return Ok(vec![Vector3::zeros(), Vector3::new(d12 * 1e-3, 0.0, 0.0)]);
            }
            [Some(d12), None, None] => return Err(format!("found d12 = {d12}, expected a distance above 0")),
            [Some(d12), Some(d13), Some(d23)] => [d12, d13, d23],
            some => {
                let has = |(d, name): (&Option<f64>, &'static str)| d.map(|_| name);
                let found: Vec<_> = some.iter().zip(["d12", "d13", "d23"]).filter_map(has).collect();
                return Err(format!(
                    "found {}, expected d12, d13 and d23 of three balls, or d12 of two",
                    found.join(" and ")
                ));
            }
        };
        let triangle = balls_from_distances(d12 * 1e-3, d13 * 1e-3, d23 * 1e-3);
        triangle.map(|balls| balls.to_vec()).ok_or_else(|| {
            format!(
                "d12 = {d12}, d13 = {d13}, d23 = {d23} form no triangle: each must be shorter than the other two together"
            )
        })
    }
}

/// The three balls in {w} from their three distances (m): origin in ball 1, x to ball 2, y towards ball 3.
///
/// `p3 = (x, y, 0)`, `x = (d12^2 + d13^2 - d23^2) / (2 d12)`, `y = sqrt(d13^2 - x^2)` (paper, section on the world frame).
/// `None` where the distances form no triangle.
#[must_use]
pub fn balls_from_distances(d12: f64, d13: f64, d23: f64) -> Option<[Vector3<f64>; 3]> {
    let x = (d12 * d12 + d13 * d13 - d23 * d23) / (2.0 * d12);
    let y2 = d13 * d13 - x * x;
    // a flat triangle gives no plane: ask for a height of at least a thousandth of its side
    (d12 > 0.0 && d13 > 0.0 && d23 > 0.0 && y2 > (1e-3 * d13).powi(2))
        .then(|| [Vector3::zeros(), Vector3::new(d12, 0.0, 0.0), Vector3::new(x, y2.sqrt(), 0.0)])
}

impl Cell {
    /// The same without what only collision checks need, which may be large.
    #[must_use]
    pub fn without_geometry(&self) -> Self {
        Self {
            world_from_base: self.world_from_base,
            tool: self.tool.clone(),
            balls: self.balls.clone(),
            anchors: self.anchors.clone(),
            geometry: None,
        }
    }

    /// No cell at all: the arm's foot is {w}, the flange is the tool, and there is nothing to measure.
    #[must_use]
    pub fn bare() -> Self {
        Self {
            world_from_base: Pose::identity(),
            tool: Tool {
                tcp: Vector3::zeros(),
                rotation: Matrix3::identity(),
                targets: vec![Vector3::zeros()],
                mass: 0.0,
                cog: Vector3::zeros(),
            },
            balls: Vec::new(),
            anchors: Vec::new(),
            geometry: None,
        }
    }

    /// Whether three of the balls `of` (0-based) are not on one line (by more than a millimetre): they then fix where the arm's base
    /// stands in {w}. Without, as with two printed sockets, {w} is only a name.
    #[must_use]
    pub fn balls_fix_base(&self, of: impl Fn(usize) -> bool) -> bool {
        let balls: Vec<_> = self.balls.iter().enumerate().filter(|(k, _)| of(*k)).map(|(_, p)| p).collect();
        let Some((first, rest)) = balls.split_first() else { return false };
        let far = rest.iter().map(|p| *p - *first).max_by(|a, b| a.norm().total_cmp(&b.norm()));
        let Some(along) = far.and_then(|v| v.try_normalize(1e-3)) else { return false };
        rest.iter().any(|p| (*p - *first).cross(&along).norm() > 1e-3)
    }

    /// Reads `cell.toml`.
    ///
    /// # Errors
    /// A sentence that names the file, the line or field, what was found and what is expected.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&read_text(path)?, &path.display().to_string())
    }

    /// Reads the text of a `cell.toml`; `file` is its name for messages.
    ///
    /// # Errors
    /// As [`Cell::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self> {
        let raw: CellFile = parse_toml_of("cell", text, file)?;
        check_version(raw.format_version, file)?;
        let bad = |place: &str, problem: String| ModelError::Input {
            file: file.to_owned(),
            place: place.to_owned(),
            problem,
        };
        let finite = |place: &str, v: &[f64; 3]| {
            if v.iter().all(|x| x.is_finite() && x.abs() < 1e6) {
                Ok(Vector3::from(*v))
            } else {
                Err(bad(place, format!("found {v:?}, expected three finite numbers")))
            }
        };
        let points = |place: &str, list: &[[f64; 3]]| {
            list.iter().map(|p| Ok(finite(place, p)? * 1e-3)).collect::<Result<Vec<_>>>()
        };
        if !(raw.tool.mass_kg.is_finite() && (0.0..1e4).contains(&raw.tool.mass_kg)) {
            return Err(bad("[tool] mass_kg", format!("found {}, expected a mass of 0 to 10000 kg", raw.tool.mass_kg)));
        }
        let tcp = finite("[tool] tcp_mm", &raw.tool.tcp_mm)? * 1e-3;
        let mut targets = points("[tool] targets_mm", &raw.tool.targets_mm)?;
        if targets.is_empty() {
            targets.push(tcp);
        }
        let balls = match &raw.balls {
            None => Vec::new(),
            Some(BallsFile { distances_mm: None, positions_mm: None }) => vec![Vector3::zeros()],
            Some(BallsFile { distances_mm: Some(d), positions_mm: None }) => {
                finite("[balls] distances_mm", &[d.d12, d.d13, d.d23].map(Option::unwrap_or_default))?;
                d.balls().map_err(|problem| bad("[balls] distances_mm", problem))?
            }
            Some(BallsFile { distances_mm: None, positions_mm: Some(p) }) => points("[balls] positions_mm", p)?,
            Some(_) => {
                return Err(bad("[balls]", "expected either distances_mm or positions_mm".into()));
            }
        };
        let zyx = finite("[base] zyx_deg", &raw.base.zyx_deg)?;
        let tool_zyx = finite("[tool] zyx_deg", &raw.tool.zyx_deg)?;
        Ok(Self {
            world_from_base: Pose {
                rotation: rotation_zyx(zyx.x.to_radians(), zyx.y.to_radians(), zyx.z.to_radians()),
                translation: finite("[base] xyz_mm", &raw.base.xyz_mm)? * 1e-3,
            },
            tool: Tool {
                tcp,
                rotation: rotation_zyx(tool_zyx.x.to_radians(), tool_zyx.y.to_radians(), tool_zyx.z.to_radians()),
                targets,
                mass: raw.tool.mass_kg,
                cog: finite("[tool] cog_mm", &raw.tool.cog_mm)? * 1e-3,
            },
            balls,
            anchors: points("[anchors] positions_mm", &raw.anchors.map_or_else(Vec::new, |a| a.positions_mm))?,
            geometry: raw.geometry,
        })
    }

    /// The cell as the text of a `cell.toml`, balls as positions.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mm = |v: &Vector3<f64>| [v.x, v.y, v.z].map(|x| tidy(x * 1e3));
        let zyx = |r: &Matrix3<f64>| angles_zyx(r).map(|a| tidy(a.to_degrees()));
        let list = |points: &[Vector3<f64>]| points.iter().map(mm).collect::<Vec<_>>();
        let file = CellFile {
            format_version: None,
            base: BaseFile {
                xyz_mm: mm(&self.world_from_base.translation),
                zyx_deg: zyx(&self.world_from_base.rotation),
            },
            tool: ToolFile {
                tcp_mm: mm(&self.tool.tcp),
                zyx_deg: zyx(&self.tool.rotation),
                targets_mm: list(&self.tool.targets),
                mass_kg: self.tool.mass,
                cog_mm: mm(&self.tool.cog),
            },
            balls: (!self.balls.is_empty())
                .then(|| BallsFile { distances_mm: None, positions_mm: Some(list(&self.balls)) }),
            anchors: (!self.anchors.is_empty()).then(|| PointsFile { positions_mm: list(&self.anchors) }),
            geometry: self.geometry.clone(),
        };
        toml::to_string(&file).unwrap_or_default()
    }
}
