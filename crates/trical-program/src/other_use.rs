//! Targets whose numbers the program uses by themselves, too, so that a correction may do harm there.

use crate::frames::AT;
use crate::literal::Meant;

/// From this turn about y to 90 deg, single angles of a target are not to be used, rad. `R = Rz Ry Rx` of a tool that is turned by a small angle changes
/// its turns about z and x by up to 1/cos of its turn about y as much: 5.8 times here, and without limit at 90 deg.
const STEEP: f64 = 80.0_f64.to_radians();

/// What else a program does with the numbers of a target, and where (an offset). Of several, the least one counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OtherUse {
    /// They say how far a motion goes, or are a frame.
    NoPlace(u32),
    /// One of its angles is read or set by itself.
    OneAngle(u32),
}

impl OtherUse {
    /// Why a target stays as it is that is used so, if it has to; `angles` are the names of the turns about z, y and x.
    #[must_use]
    pub fn forbids(self, meant: &Meant, angles: [&str; 3]) -> Option<String> {
        let [z, y, x] = angles;
        match (self, meant) {
            (Self::NoPlace(at), _) => Some(format!(
                "is used in two ways: motions go to it, and it is an increment, an offset or a frame{AT}{at}, which a correction would change"
            )),
            (Self::OneAngle(at), Meant::Pose(pose)) if pose.rotation[(2, 0)].abs() > libm::sin(STEEP) => Some(format!(
                "its angles {z} and {x} change together near {y} = 90 deg, much more than the tool turns, and one of its angles is read or set by \
                 itself{AT}{at}"
            )),
            (Self::OneAngle(_), _) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use trical_model::Pose;
    use trical_model::pose::rotation_zyx;

    use super::*;

    #[test]
    fn single_angles_forbid_a_correction_within_ten_degrees_of_ninety_about_y() {
        for (b, is_forbidden) in
            [(79.9, false), (80.1, true), (90.0, true), (-85.0, true), (-79.0, false), (100.1, false)]
        {
            let rotation = rotation_zyx(0.4, f64::to_radians(b), -0.3);
            let meant = Meant::Pose(Pose { rotation, ..Pose::identity() });
            assert_eq!(OtherUse::OneAngle(7).forbids(&meant, ["A", "B", "C"]).is_some(), is_forbidden, "{b}");
        }
    }
}
