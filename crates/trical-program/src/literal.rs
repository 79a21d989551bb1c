//! How each dialect writes a pose or joint values, both ways: numbers to pose, pose to numbers.

use nalgebra::{Matrix3, Vector3};
use trical_model::pose::{
    angles_zyx, quaternion_from_rotation, rotation_from_quaternion, rotation_vector, rotation_zyx,
};
use trical_model::{Joints, MAX_JOINTS, Pose};

/// The numbers of a target, in the order of the file's text or of the names in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// x, y, z in mm; unit quaternion w, x, y, z (ABB, CSV).
    Quaternion,
    /// x, y, z in mm; three angles in deg, `R = Rz(first) Ry(second) Rx(third)` (KUKA: A B C).
    Zyx,
    /// x, y, z in mm; three angles in deg, `R = Rz(third) Ry(second) Rx(first)` (FANUC: W P R).
    Xyz,
    /// x, y, z in m; rotation vector in rad (UR).
    RotationVector,
    /// Joint values, deg (mm for a joint that slides).
    JointsDeg,
    /// Joint values, rad (m for a joint that slides).
    JointsRad,
    /// Joint values, deg (mm for a joint that slides); a joint 3 that turns is counted from the horizontal, as if joint 2 were at zero (FANUC).
    JointsFanuc,
}

/// What a target's numbers say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meant {
    /// The tool's pose in the work object.
    Pose(Pose),
    /// Joint values, rad or m.
    Joints(Joints),
}

/// At most this many numbers: three and a quaternion, or the joints.
pub const MOST: usize = MAX_JOINTS;

/// A quaternion may be this far from unit length: texts round to three digits.
const QUATERNION_SLACK: f64 = 0.01;
/// A rotation that changes by less than this keeps its text, rad. At 1 m this is 0.02 um.
const SAME_TURN: f64 = 2e-8;

impl Shape {
    /// Whether the numbers are joint values.
    #[must_use]
    pub fn is_joints(self) -> bool {
        matches!(self, Self::JointsDeg | Self::JointsRad | Self::JointsFanuc)
    }

    /// How many numbers make one, of an arm of `dof` joints.
    #[must_use]
    pub fn count(self, dof: usize) -> usize {
        match self {
            Self::Quaternion => 7,
            Self::Zyx | Self::Xyz | Self::RotationVector => 6,
            _ => dof,
        }
    }

    /// Least number of digits behind the point of number `k`: 0.1 um, 1e-8 of a quaternion, 1e-6 deg.
    #[must_use]
    pub fn decimals(self, k: usize) -> usize {
        match self {
            Self::Quaternion if k < 3 => 4,
            Self::Quaternion | Self::JointsRad => 8,
            Self::Zyx | Self::Xyz if k < 3 => 4,
            Self::RotationVector => 8 - usize::from(k < 3),
            _ => 6,
        }
    }

    /// The pose or the joint values that numbers say.
    ///
    /// # Errors
    /// In words, where they say none.
    pub fn meant(self, v: &[f64], slides: &[bool]) -> Result<Meant, String> {
        let mm = Vector3::new(v[0], v[1], v[2]) * 1e-3;
        let rotation = match self {
            Self::Quaternion => {
                let q = [v[3], v[4], v[5], v[6]];
                let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
                if (norm - 1.0).abs() > QUATERNION_SLACK {
                    return Err(format!("the quaternion has length {norm:.4}, expected 1"));
                }
                rotation_from_quaternion(q)
            }
            Self::Zyx => rotation_zyx(v[3].to_radians(), v[4].to_radians(), v[5].to_radians()),
            Self::Xyz => rotation_zyx(v[5].to_radians(), v[4].to_radians(), v[3].to_radians()),
            Self::RotationVector => {
                let rotation = exp(&Vector3::new(v[3], v[4], v[5]));
                return Ok(Meant::Pose(Pose { rotation, translation: mm * 1e3 }));
            }
            _ => return Ok(Meant::Joints(self.joints(v, slides))),
        };
        Ok(Meant::Pose(Pose { rotation, translation: mm }))
    }

    fn joints(self, v: &[f64], slides: &[bool]) -> Joints {
        let mut q = [0.0; MAX_JOINTS];
        for (k, (to, from)) in q.iter_mut().zip(v).enumerate() {
            *to = match (self, slides.get(k) == Some(&true)) {
                (Self::JointsRad, _) => *from,
                (_, true) => from * 1e-3,
                _ => from.to_radians(),
            };
        }
        if self.counts_from_horizontal(slides) {
            q[2] += q[1];
        }
        q
    }

    /// Whether joint 3 is counted from the horizontal: not where it slides (FANUC's SCARA arms).
    fn counts_from_horizontal(self, slides: &[bool]) -> bool {
        self == Self::JointsFanuc && slides.get(2) != Some(&true)
    }

    /// The numbers of `new`, as near to the old ones as the same pose can be written; those that stay are `None`. Angles and
    /// quaternions stay or change together.
    #[must_use]
    pub fn numbers(self, new: &Meant, old: &[f64], old_meant: &Meant, slides: &[bool]) -> [Option<f64>; MOST] {
        let mut out = [None; MOST];
        match (new, old_meant) {
            (Meant::Pose(pose), Meant::Pose(before)) => {
                let unit = if self == Self::RotationVector { 1.0 } else { 1e3 };
                for (to, x) in out.iter_mut().zip(pose.translation.iter()) {
                    *to = Some(x * unit);
                }
                if rotation_vector(&(before.rotation.transpose() * pose.rotation)).norm() > SAME_TURN {
                    let near = self.rotation_numbers(&pose.rotation, old);
                    for (to, from) in out[3..].iter_mut().zip(near).take(self.count(0) - 3) {
                        *to = Some(from);
                    }
                }
            }
            (Meant::Joints(q), _) => {
                let mut q = *q;
                if self.counts_from_horizontal(slides) {
                    q[2] -= q[1];
                }
                for k in 0..old.len() {
                    out[k] = Some(match (self, slides.get(k) == Some(&true)) {
                        (Self::JointsRad, _) => q[k],
                        (_, true) => q[k] * 1e3,
                        _ => q[k].to_degrees(),
                    });
                }
            }
            _ => {}
        }
        // a number that is the same to the digits that count keeps its text
        for (k, to) in out.iter_mut().enumerate().take(old.len()) {
            let turns = !self.is_joints() && k >= 3;
            if !turns && to.is_some_and(|x| (x - old[k]).abs() <= 0.5 * 0.1_f64.powi(self.decimals(k) as i32)) {
                *to = None;
            }
        }
        out
    }

    fn rotation_numbers(self, r: &Matrix3<f64>, old: &[f64]) -> [f64; 4] {
        match self {
            Self::Quaternion => {
                let q = quaternion_from_rotation(r);
                // the sign that the program had
                let same = q.iter().zip(&old[3..]).map(|(a, b)| a * b).sum::<f64>() >= 0.0;
                if same { q } else { q.map(|x| -x) }
            }
            Self::RotationVector => {
                let v = rotation_vector(r);
                let angle = v.norm();
                let other = if angle > 1e-9 { v * (1.0 - std::f64::consts::TAU / angle) } else { v };
                let was = Vector3::new(old[3], old[4], old[5]);
                let v = if (other - was).norm() < (v - was).norm() { other } else { v };
                [v.x, v.y, v.z, 0.0]
            }
            _ => {
                let [z, y, x] = angles_zyx(r).map(f64::to_degrees);
                let order = |z: f64, y: f64, x: f64| if self == Self::Zyx { [z, y, x] } else { [x, y, z] };
                let near = |angles: [f64; 3]| {
                    let mut a = angles;
                    for (a, was) in a.iter_mut().zip(&old[3..6]) {
                        *a -= 360.0 * ((*a - was) / 360.0).round();
                    }
                    a
                };
                let far = |a: &[f64; 3]| a.iter().zip(&old[3..6]).map(|(a, b)| (a - b).abs()).sum::<f64>();
                // the same rotation written the other way
                let (one, two) = (near(order(z, y, x)), near(order(z + 180.0, 180.0 - y, x + 180.0)));
                let a = if far(&two) < far(&one) { two } else { one };
                [a[0], a[1], a[2], 0.0]
            }
        }
    }
}

/// The rotation of a rotation vector.
fn exp(v: &Vector3<f64>) -> Matrix3<f64> {
    nalgebra::Rotation3::new(*v).into_inner()
}
