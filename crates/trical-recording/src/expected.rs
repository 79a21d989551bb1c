//! Which arm a recording should be of.

use trical_model::Robot;

/// What is known of the arm before its recording is read.
#[derive(Clone, Copy, Debug, Default)]
pub struct Expected<'a> {
    /// How many joints it has; `None`: as many as the file has.
    pub joints: Option<usize>,
    /// What its description calls them, joint 1 first; empty where nothing says so.
    pub names: &'a [String],
}

impl From<Option<usize>> for Expected<'_> {
    fn from(joints: Option<usize>) -> Self {
        Self { joints, names: &[] }
    }
}

impl<'a> From<&'a Robot> for Expected<'a> {
    fn from(robot: &'a Robot) -> Self {
        Self { joints: Some(robot.dof()), names: &robot.joint_names }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_robot_its_joints_are_expected_by_their_names() {
        let mut robot = Robot::empty("arm");
        robot.joint_names = vec!["a".into(), "b".into()];
        let expected = Expected::from(&robot);
        assert_eq!((expected.joints, expected.names), (Some(0), &robot.joint_names[..]));
    }
}
