//! A URDF with its arm corrected: the file as it was given, but for the origins of the joints that move.

use crate::error::{ModelError, Result};
use crate::forward::{Forward, Model};
use crate::pose::{Pose, angles_zyx};
use crate::recording::State;
use crate::robot::Robot;
use crate::term::Site;
use crate::trig;

use crate::urdf::tree::{self, Place};
use crate::urdf::{UrdfPath, parse, read_xml, robot_from_axes, xml};

/// The corrected file may differ from the model by this, m and rad: rounding of Euler angles.
const SAME: f64 = 1e-8;

/// The text of a URDF with the constant terms of `model` built into the origins of those joints of the chain from `root` to `tip` that move.
/// Everything else stays as it is, to the byte: names, fixed joints, meshes, inertials, limits, comments. Its links move as those of the
/// model's rigid part do: poses of the flange are the same to rounding.
///
/// # Errors
/// As [`crate::urdf::parse`]; a file whose arm is not the model's.
pub fn corrected(text: &str, file: &str, root: Option<&str>, tip: Option<&str>, model: &Model) -> Result<String> {
    let (origins, urdf) = origins(text, file, root, tip, model)?;
    let mut out = text.to_owned();
    let mut edits: Vec<(usize, Pose)> = origins.into_iter().map(|o| (o.index, o.parent_from_joint)).collect();
    // from the end, so that what is before stays where it was
    edits.sort_by_key(|(index, _)| std::cmp::Reverse(*index));
    for (index, pose) in edits {
        let joint = &urdf.joints[index];
        match joint.origin_at {
            Some((from, to)) => {
                let end = if text[from..to].ends_with("/>") { "/>" } else { ">" };
                out.replace_range(from..to, &format!("{}{end}", origin(&pose)));
            }
            None => out.insert_str(joint.opened_at, &format!("{}/>", origin(&pose))),
        }
    }
    // what was written is read again: it must be the arm
    let again = parse(&out, file, root, tip)?.robot;
    let apart = apart(&again, model)?;
    if apart > SAME {
        let problem =
            format!("corrected, its flange would be {apart:.1e} m (rad) from the model's; nothing was written");
        return Err(ModelError::unreadable(file, problem));
    }
    Ok(out)
}

/// An `<origin>` tag without its end, to 1e-12 m and rad.
fn origin(pose: &Pose) -> String {
    let [yaw, pitch, roll] = angles_zyx(&pose.rotation);
    let t = &pose.translation;
    // adding zero turns -0 into 0
    let [x, y, z, roll, pitch, yaw] = [t.x, t.y, t.z, roll, pitch, yaw].map(|v| (v * 1e12).round() / 1e12 + 0.0);
    format!("<origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"")
}

/// As [`corrected`], of a file whose arm may be named behind a `#`; it is in UTF-8, whatever the given one is in.
///
/// # Errors
/// As [`corrected`].
pub fn corrected_file(given: &UrdfPath, model: &Model) -> Result<String> {
    let text = read_xml(&given.path)?;
    corrected(&text, &given.path.display().to_string(), given.root.as_deref(), given.tip.as_deref(), model)
}

/// A joint that moves, and where it stands at zero in the link that carries it.
pub(super) struct Origin {
    /// Which joint of the file.
    index: usize,
    /// The corrected origin.
    parent_from_joint: Pose,
}

/// The corrected origins, joint 1 first.
fn origins(
    text: &str,
    file: &str,
    root: Option<&str>,
    tip: Option<&str>,
    model: &Model,
) -> Result<(Vec<Origin>, xml::Urdf)> {
    let urdf = xml::read(text, file)?;
    let serial = tree::serial(&urdf, file, root, tip)?;
    let nominal = robot_from_axes(&serial.joints, &serial.root_from_tip, &model.robot.name);
    if nominal.dof() != model.robot.dof()
        || apart(&nominal, &Model::nominal(model.robot.clone(), crate::Cell::bare()))? > SAME
    {
        let problem = format!(
            "is not the arm of the model ({}); expected the URDF that it was calibrated with",
            model.robot.name
        );
        return Err(ModelError::unreadable(file, problem));
    }
    let (before, after) = (links(&Model { terms: Vec::new(), ..model.clone() })?, links(&arm_alone(model))?);
    let mut out = Vec::with_capacity(before.len());
    let mut parent = Pose::identity();
    for ((Place { index, root_from_joint, carried }, before), after) in serial.places.iter().zip(&before).zip(&after) {
        // the link keeps its place in Craig's frame, and so does everything that is fixed to it
        let now = after.compose(&before.inverse().compose(root_from_joint));
        let carrier = parent.compose(carried);
        out.push(Origin { index: *index, parent_from_joint: carrier.inverse().compose(&now) });
        parent = now;
    }
    Ok((out, urdf))
}

/// The model of the arm itself that does not change with the pose.
pub(super) fn arm_alone(model: &Model) -> Model {
    let mut still = Model { cell: crate::Cell::bare(), frames: Vec::new(), ..model.clone() };
    let of_arm = |site: &Site| {
        matches!(
            site,
            Site::Link { .. }
                | Site::Joint { .. }
                | Site::Tilt { .. }
                | Site::AllJoints
                | Site::Links
                | Site::Across { .. }
        )
    };
    still.terms.retain(|t| t.basis.is_constant() && of_arm(&t.site));
    still
}

/// Frames {1} to {n} with all joints at zero, in the frame of the arm's root.
pub(super) fn links(model: &Model) -> Result<Vec<Pose>> {
    let forward = Forward::new(Model { cell: crate::Cell::bare(), frames: Vec::new(), ..model.clone() }, Vec::new())?;
    let mut ws = forward.workspace();
    Ok(forward.world_from_joints(&State::at(&[]), &mut ws))
}

/// How far the flanges of an arm and of the model's arm are from each other at some poses, m or rad.
pub(super) fn apart(robot: &Robot, model: &Model) -> Result<f64> {
    let (a, b) = (
        Forward::new(Model::nominal(robot.clone(), crate::Cell::bare()), Vec::new())?,
        Forward::new(arm_alone(model), Vec::new())?,
    );
    let (mut wa, mut wb) = (a.workspace(), b.workspace());
    let mut most = 0.0_f64;
    for k in 0..12_u32 {
        let q: Vec<f64> = (0..robot.dof() as u32).map(|j| trig::sin(1.3 * f64::from(k) + 2.1 * f64::from(j))).collect();
        let (p, r) = (a.world_from_flange(&State::at(&q), &mut wa), b.world_from_flange(&State::at(&q), &mut wb));
        most = most.max((p.translation - r.translation).norm()).max((p.rotation - r.rotation).norm());
    }
    Ok(most)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]
    use super::*;
    use crate::axis::Axis;
    use crate::basis::Basis;
    use crate::term::{Parameter, Term};

    /// What a maker's file has: comments, meshes, fixed joints between, an axis that is not z, an origin that is not there, one with an end tag.
    const GIVEN: &str = r#"<?xml version="1.0"?>
<!-- by the maker -->
<robot name="arm">
  <link name="world"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0.1 0.2 0.3" rpy="0 0 0.5"/></joint>
  <link name="base"><visual><origin xyz="1 2 3"/><geometry><mesh filename="package://a/b.stl"/></geometry></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="1"/></joint>
  <link name="l1"><inertial><mass value="3"/><origin xyz="0 0 0.1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="up" type="revolute">
    <origin  rpy="0.1 0.2 0.3" xyz="0.05 0 0.4"></origin>
    <parent link="l1"/><child link="l2"/><axis xyz="0 -1 0"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>
  <link name="l2"/>
  <joint name="bolt" type="fixed"><parent link="l2"/><child link="l2b"/><origin xyz="0.3 0.01 0" rpy="0.2 0 0"/></joint>
  <link name="l2b"/>
  <joint name="slide" type="prismatic"><parent link="l2b"/><child link="l3"/><origin xyz="0.1 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="1" effort="9" velocity="1"/></joint>
  <link name="l3"/>
  <joint name="wrist" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0.2"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>
  <link name="l4"/>
  <joint name="flange" type="fixed"><parent link="l4"/><child link="tool0"/><origin xyz="0 0 0.08" rpy="0 1.5 0"/></joint>
  <link name="tool0"/>
</robot>
"#;

    fn term(name: &str, site: Site, value: f64) -> Term {
        Term { value, ..Term::new(name, "geometry", site, Basis::CONSTANT) }
    }

    #[test]
    fn the_given_file_is_kept_but_for_the_origins_of_its_moving_joints_and_moves_as_the_model_does() {
        let nominal = parse(GIVEN, "arm.urdf", None, None).unwrap().robot;
        let mut model = Model::nominal(nominal, crate::Cell::bare());
        for (k, parameter) in [Parameter::Alpha, Parameter::A, Parameter::Beta].into_iter().enumerate() {
            for link in 0..4 {
                let value = 1e-3 * (1.0 + f64::from(u32::try_from(k + link).unwrap()));
                model.terms.push(term(&format!("{parameter:?}{link}"), Site::Link { link, parameter }, value));
            }
        }
        for link in 1..=4 {
            for parameter in [Parameter::D, Parameter::Theta] {
                model.terms.push(term(&format!("{parameter:?}{link}"), Site::Link { link, parameter }, -2e-3));
            }
        }
        model.terms.push(term("tilt", Site::Tilt { joint: 2, axis: Axis::X }, 3e-3));
        // what belongs to the cell or changes with the pose is not the file's
        model.terms.push(term("tool", Site::Tool(crate::Motion::Along(Axis::X)), 0.1));
        let written = corrected(GIVEN, "arm.urdf", None, None, &model).unwrap();
        let again = parse(&written, "arm.urdf", None, None).unwrap();
        assert!(apart(&again.robot, &model).unwrap() < 1e-11);
        assert!(apart(&again.robot, &Model::nominal(model.robot.clone(), crate::Cell::bare())).unwrap() > 1e-3);
        // line by line: only those of the four joints differ
        let differ = written.lines().zip(GIVEN.lines()).filter(|(a, b)| a != b).count();
        assert_eq!((differ, written.lines().count()), (4, GIVEN.lines().count()), "{written}");
        assert!(written.contains("<axis xyz=\"0 1 0.2\"/>") && written.contains("filename=\"package://a/b.stl\""));
        let other = GIVEN.replace("xyz=\"0.3 0.01 0\"", "xyz=\"0.31 0.01 0\"");
        let refused = corrected(&other, "other.urdf", None, None, &model).unwrap_err().to_string();
        assert!(refused.contains("other.urdf") && refused.contains("is not the arm of the model"), "{refused}");
    }
}
