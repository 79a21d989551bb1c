//! An arm in its cell as URDF.

use std::fmt::Write;

use crate::cell::Cell;
use crate::pose::{Pose, angles_zyx, rotation_x, rotation_y, rotation_z};
use crate::robot::{Joint, JointKind, Robot};

type V3 = nalgebra::Vector3<f64>;

fn escaped(text: &str) -> String {
    let visible = text.replace(char::is_control, " ");
    visible.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn origin(pose: &Pose) -> String {
    let [z, y, x] = angles_zyx(&pose.rotation);
    let t = &pose.translation;
    // adding zero turns -0 into 0
    let f = |v: f64| v + 0.0;
    format!("<origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/>", f(t.x), f(t.y), f(t.z), f(x), f(y), f(z))
}

fn link(out: &mut String, name: &str, mass: f64, cog: &V3) {
    if mass > 0.0 {
        let place = origin(&Pose { translation: *cog, ..Pose::identity() });
        let _ = writeln!(
            out,
            "  <link name=\"{name}\">\n    <inertial>\n      {place}\n      <mass value=\"{mass}\"/>\n      \
             <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>\n    </inertial>\n  </link>"
        );
    } else {
        let _ = writeln!(out, "  <link name=\"{name}\"/>");
    }
}

fn fixed(out: &mut String, name: &str, parent: &str, child: &str, pose: &Pose) {
    let _ = writeln!(
        out,
        "  <joint name=\"{name}\" type=\"fixed\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    {}\n  \
         </joint>",
        origin(pose)
    );
}

/// `{i-1} from {i}` at the joint's zero.
pub(crate) fn at_zero(j: &Joint) -> Pose {
    let r = rotation_x(j.alpha) * rotation_y(j.beta);
    Pose { rotation: r * rotation_z(j.theta_offset), translation: V3::new(j.a, 0.0, 0.0) + r * V3::new(0.0, 0.0, j.d) }
}

/// The text of a URDF: links `world`, `base_link`, `link_1` ... `link_n` (Craig's frames), `flange`, `tcp`; joints `joint_1` ...
/// `joint_n`, each about (along) the z axis of its link. Lengths are in m, angles in rad, as URDF wants them. Masses and centres
/// of gravity are written where the robot has them; moments of inertia, greatest torques and speeds are not known, and zero.
/// `remarks` go into a comment at the top.
#[must_use]
pub fn write(robot: &Robot, cell: &Cell, remarks: &[String]) -> String {
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n");
    if !remarks.is_empty() {
        out.push_str("<!--\n");
        for r in remarks {
            // two hyphens may not stand in a comment
            let _ = writeln!(out, "  {}", escaped(r).replace("--", "- -"));
        }
        out.push_str("-->\n");
    }
    let _ = writeln!(out, "<robot name=\"{}\">", escaped(&robot.name));
    // MuJoCo would melt fixed links together and refuse bodies without inertia; others pass over this
    let _ = writeln!(
        out,
        "  <mujoco>\n    <compiler fusestatic=\"false\" boundmass=\"1e-9\" boundinertia=\"1e-9\"/>\n  </mujoco>"
    );
    link(&mut out, "world", 0.0, &V3::zeros());
    link(&mut out, "base_link", 0.0, &V3::zeros());
    fixed(&mut out, "world_to_base", "world", "base_link", &cell.world_from_base);
    let mut parent = "base_link".to_owned();
    for (i, j) in robot.joints.iter().enumerate() {
        let child = format!("link_{}", i + 1);
        link(&mut out, &child, j.mass.unwrap_or(0.0), &j.cog);
        let pose = if i == 0 { robot.root_from_zero.compose(&at_zero(j)) } else { at_zero(j) };
        let kind = if j.kind == JointKind::Prismatic { "prismatic" } else { "revolute" };
        let _ = writeln!(
            out,
            "  <joint name=\"joint_{}\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    {}\n    \
             <axis xyz=\"0 0 1\"/>\n    <limit lower=\"{}\" upper=\"{}\" effort=\"0\" velocity=\"0\"/>\n  </joint>",
            i + 1,
            origin(&pose),
            j.limits[0],
            j.limits[1]
        );
        parent = child;
    }
    link(&mut out, "flange", cell.tool.mass, &cell.tool.cog);
    fixed(&mut out, "last_to_flange", &parent, "flange", &robot.last_from_flange);
    link(&mut out, "tcp", 0.0, &V3::zeros());
    let tool = Pose { rotation: cell.tool.rotation, translation: cell.tool.tcp };
    fixed(&mut out, "flange_to_tcp", "flange", "tcp", &tool);
    out.push_str("</robot>\n");
    out
}
