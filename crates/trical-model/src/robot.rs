//! The arm as data: nominal modified Denavit-Hartenberg parameters, limits, masses.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::error::{ModelError, Result, parse_toml_of};
use crate::pose::{Pose, angles_zyx, rotation_zyx};
use crate::recording::MAX_JOINTS;
use crate::trig;

/// Mass of every link of [`Robot::with_even_masses`], kg: a collaborative arm of seven joints weighs 15 to 20 kg.
pub const EVEN_MASS: f64 = 2.5;

/// How a joint moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Turns about z; its variable adds to theta (rad).
    #[default]
    Revolute,
    /// Slides along z; its variable adds to d (m).
    Prismatic,
}

impl JointKind {
    /// The unit in which its variable is told, and how many of them are one rad (m).
    #[must_use]
    pub const fn unit(self) -> (f64, &'static str) {
        match self {
            Self::Revolute => (1.0_f64.to_degrees(), "deg"),
            Self::Prismatic => (1e3, "mm"),
        }
    }
}

/// One joint and the link behind it, Craig's convention:
/// `T(i-1, i) = Rx(alpha) Tx(a) Ry(beta) Rz(theta + theta_offset) Tz(d)`, where beta is zero unless two axes are nearly parallel.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// alpha_{i-1}, rad.
    pub alpha: f64,
    /// a_{i-1}, m.
    pub a: f64,
    /// Hayati's beta_{i-1}, rad: what the other four cannot hold where axes i-1 and i are nearly parallel; else 0.
    pub beta: f64,
    /// d_i, m.
    pub d: f64,
    /// Added to the joint's angle, rad.
    pub theta_offset: f64,
    /// Lower and upper limit of the joint's variable, rad (m for a prismatic joint).
    pub limits: [f64; 2],
    /// Mass of link i, kg, where known.
    pub mass: Option<f64>,
    /// Centre of gravity of link i in frame {i}, m.
    pub cog: Vector3<f64>,
}

/// A serial arm, base to flange.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Its name, for people and to tell model files apart.
    pub name: String,
    /// The joints, base first: 1 to 9.
    pub joints: Vec<Joint>,
    /// {0} in the frame of the arm's foot, which is what a cell places in {w}: the identity, unless the arm comes from a
    /// description whose first axis is not the z axis of its foot.
    pub root_from_zero: Pose,
    /// The flange, which carries the tool, in the frame {n} of the last joint: the identity for an arm in Craig's frames.
    pub last_from_flange: Pose,
    /// What the description that it comes from calls its joints; empty where nothing says so, and not kept in files.
    pub joint_names: Vec<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    format_version: Option<u32>,
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    root: Option<PoseFile>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    flange: Option<PoseFile>,
    joint: Vec<JointFile>,
}

/// A constant transform: `R = Rz(a) Ry(b) Rx(c)` as for the base of a cell.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseFile {
    xyz_mm: [f64; 3],
    zyx_deg: [f64; 3],
}

impl PoseFile {
    fn of(pose: &Pose) -> Option<Self> {
        let t = &pose.translation;
        (*pose != Pose::identity()).then(|| Self {
            xyz_mm: [t.x, t.y, t.z].map(|x| tidy(x * 1e3)),
            // an angle below rounding is none
            zyx_deg: angles_zyx(&pose.rotation).map(|a| if a.abs() < 1e-15 { 0.0 } else { tidy(a.to_degrees()) }),
        })
    }

    fn pose(&self) -> Option<Pose> {
        let fine = |v: &[f64; 3], limit: f64| v.iter().all(|x| x.is_finite() && x.abs() <= limit);
        let [z, y, x] = self.zyx_deg.map(f64::to_radians);
        (fine(&self.xyz_mm, 1e5) && fine(&self.zyx_deg, 720.0)).then(|| Pose {
            rotation: if self.zyx_deg == [0.0; 3] { Matrix3::identity() } else { rotation_zyx(z, y, x) },
            translation: Vector3::from(self.xyz_mm) * 1e-3,
        })
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointFile {
    #[serde(default, skip_serializing_if = "is_revolute")]
    kind: JointKind,
    alpha_deg: f64,
    a_mm: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    beta_deg: f64,
    d_mm: f64,
    theta_offset_deg: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    limits_deg: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    limits_mm: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mass_kg: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cog_mm: Option<[f64; 3]>,
}

impl JointFile {
    /// The joint; else which field is wrong, and how.
    fn read(&self) -> std::result::Result<Joint, (&'static str, String)> {
        for (field, value, limit) in [
            ("alpha_deg", self.alpha_deg, 360.0),
            ("a_mm", self.a_mm, 1e5),
            ("beta_deg", self.beta_deg, 360.0),
            ("d_mm", self.d_mm, 1e5),
            ("theta_offset_deg", self.theta_offset_deg, 720.0),
        ] {
            if !value.is_finite() || value.abs() > limit {
                return Err((field, format!("found {value}, expected a number between -{limit} and {limit}")));
            }
        }
        let (limits, unit, field) = match (self.kind, self.limits_deg, self.limits_mm) {
            (JointKind::Revolute, Some(l), None) => (l, 1.0_f64.to_radians(), "limits_deg"),
            (JointKind::Prismatic, None, Some(l)) => (l, 1e-3, "limits_mm"),
            (JointKind::Revolute, ..) => {
                return Err(("limits_deg", "a revolute joint needs limits_deg (and no limits_mm)".into()));
            }
            (JointKind::Prismatic, ..) => {
                return Err(("limits_mm", "a prismatic joint needs limits_mm (and no limits_deg)".into()));
            }
        };
        if !(limits[0] < limits[1] && limits.iter().all(|l| l.abs() <= FARTHEST)) {
            let [low, high] = limits;
            return Err((
                field,
                format!("found [{low}, {high}], expected a lower and a higher number, at most {FARTHEST}"),
            ));
        }
        if let Some(m) = self.mass_kg.filter(|m| !(m.is_finite() && (0.0..1e5).contains(m))) {
            return Err(("mass_kg", format!("found {m}, expected a mass of 0 to 100000 kg")));
        }
        if self.mass_kg.is_some_and(|m| m > 0.0) && self.cog_mm.is_none() {
            return Err(("cog_mm", "is missing, and a mass_kg is given".into()));
        }
        let cog = self.cog_mm.unwrap_or([0.0; 3]);
        if cog.iter().any(|c| !c.is_finite() || c.abs() > 1e5) {
            return Err(("cog_mm", "expected three finite numbers".into()));
        }
        Ok(Joint {
            kind: self.kind,
            alpha: self.alpha_deg.to_radians(),
            a: self.a_mm * 1e-3,
            beta: self.beta_deg.to_radians(),
            d: self.d_mm * 1e-3,
            theta_offset: self.theta_offset_deg.to_radians(),
            limits: limits.map(|l| l * unit),
            mass: self.mass_kg,
            cog: Vector3::from(cog) * 1e-3,
        })
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_revolute(kind: &JointKind) -> bool {
    *kind == JointKind::Revolute
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// No joint goes farther, deg or mm: whoever looks for all solutions tries every whole turn within its limits.
pub(crate) const FARTHEST: f64 = 1e6;

/// The newest version of the file formats that this program knows.
pub const FORMAT_VERSION: u32 = 1;

/// Refuses a file that a newer program wrote.
pub(crate) fn check_version(version: Option<u32>, file: &str) -> Result<()> {
    match version {
        Some(v) if v > FORMAT_VERSION => Err(ModelError::Input {
            file: file.to_owned(),
            place: "format_version".into(),
            problem: format!(
                "is {v}: written by a newer TriCal than this one, which reads up to version {FORMAT_VERSION}"
            ),
        }),
        _ => Ok(()),
    }
}

impl Robot {
    /// An arm without joints yet, for those who build one.
    #[must_use]
    pub fn empty(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            joints: Vec::new(),
            root_from_zero: Pose::identity(),
            last_from_flange: Pose::identity(),
            joint_names: Vec::new(),
        }
    }

    /// Which joints slide, joint 1 first.
    #[must_use]
    pub fn prismatic(&self) -> [bool; MAX_JOINTS] {
        std::array::from_fn(|k| self.slides(k + 1))
    }

    /// How a joint, from 1, moves; one that the arm does not have turns.
    #[must_use]
    pub fn kind(&self, joint: usize) -> JointKind {
        joint.checked_sub(1).and_then(|k| self.joints.get(k)).map_or_else(JointKind::default, |j| j.kind)
    }

    /// Whether a joint, from 1, slides.
    #[must_use]
    pub fn slides(&self, joint: usize) -> bool {
        self.kind(joint) == JointKind::Prismatic
    }

    /// Reads the text of a `robot.toml`; `file` is its name for messages.
    ///
    /// # Errors
    /// As [`Robot::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self> {
        let raw: RobotFile = parse_toml_of("robot", text, file)?;
        check_version(raw.format_version, file)?;
        let bad = |place: String, problem: String| ModelError::Input { file: file.to_owned(), place, problem };
        if raw.joint.is_empty() || raw.joint.len() > MAX_JOINTS {
            return Err(bad(
                "[[joint]]".into(),
                format!("{} joints found, expected 1 to {MAX_JOINTS}", raw.joint.len()),
            ));
        }
        let joint = |(i, j): (usize, &JointFile)| {
            j.read().map_err(|(field, problem)| bad(format!("joint {}, {field}", i + 1), problem))
        };
        let joints = raw.joint.iter().enumerate().map(joint).collect::<Result<_>>()?;
        let pose = |table: Option<PoseFile>, name: &str| match table {
            None => Ok(Pose::identity()),
            Some(p) => p.pose().ok_or_else(|| {
                bad(
                    name.into(),
                    "expected xyz_mm between -100000 and 100000 and zyx_deg between -720 and 720, all finite".into(),
                )
            }),
        };
        Ok(Self {
            name: raw.name,
            joints,
            root_from_zero: pose(raw.root, "[root]")?,
            last_from_flange: pose(raw.flange, "[flange]")?,
            joint_names: Vec::new(),
        })
    }

    /// The robot as the text of a `robot.toml`.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let joint = self
            .joints
            .iter()
            .map(|j| {
                let prismatic = j.kind == JointKind::Prismatic;
                JointFile {
                    kind: j.kind,
                    alpha_deg: tidy(j.alpha.to_degrees()),
                    a_mm: tidy(j.a * 1e3),
                    beta_deg: tidy(j.beta.to_degrees()),
                    d_mm: tidy(j.d * 1e3),
                    theta_offset_deg: tidy(j.theta_offset.to_degrees()),
                    limits_deg: (!prismatic).then(|| j.limits.map(|l| tidy(l.to_degrees()))),
                    limits_mm: prismatic.then(|| j.limits.map(|l| tidy(l * 1e3))),
                    mass_kg: j.mass,
                    cog_mm: j.mass.map(|_| [j.cog.x, j.cog.y, j.cog.z].map(|c| tidy(c * 1e3))),
                }
            })
            .collect();
        let file = RobotFile {
            format_version: Some(FORMAT_VERSION),
            name: self.name.clone(),
            root: PoseFile::of(&self.root_from_zero),
            flange: PoseFile::of(&self.last_from_flange),
            joint,
        };
        toml::to_string(&file).unwrap_or_default()
    }

    /// Number of joints.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Whether every link has a mass, so that gravity torques can be had.
    ///
    /// # Errors
    /// [`ModelError::NoMasses`] names the first joint that has none.
    pub fn require_masses(&self) -> Result<()> {
        match self.joints.iter().position(|j| j.mass.is_none()) {
            Some(i) => Err(ModelError::NoMasses { robot: self.name.clone(), joint: i + 1 }),
            None => Ok(()),
        }
    }

    /// The same arm with links of [`EVEN_MASS`], the centre of each halfway to the next joint's origin: a first idea of how its own weight
    /// bends an arm whose file has no masses. `None` where some link has a mass.
    #[must_use]
    pub fn with_even_masses(&self) -> Option<Self> {
        if self.joints.iter().any(|j| j.mass.is_some()) {
            return None;
        }
        let mut even = self.clone();
        let next = |i: usize| match self.joints.get(i + 1) {
            Some(j) => Vector3::new(j.a, -trig::sin(j.alpha) * j.d, trig::cos(j.alpha) * j.d),
            None => self.last_from_flange.translation,
        };
        for (i, joint) in even.joints.iter_mut().enumerate() {
            joint.mass = Some(EVEN_MASS);
            joint.cog = 0.5 * next(i);
        }
        Some(even)
    }

    /// Whether `q` lies within the joint limits, up to `tolerance` (rad or m).
    #[must_use]
    pub fn within_limits(&self, q: &[f64], tolerance: f64) -> bool {
        self.joints.iter().zip(q).all(|(j, q)| *q >= j.limits[0] - tolerance && *q <= j.limits[1] + tolerance)
    }
}

/// Removes the last digits that a change of units leaves behind (a few units in the last place), so that files read well.
#[must_use]
pub fn tidy(x: f64) -> f64 {
    let r = (x * 1e9).round() / 1e9;
    // adding zero turns -0 into 0
    (if (r - x).abs() <= 8.0 * f64::EPSILON * x.abs() { r } else { x }) + 0.0
}
