//! RAPID's `tooldata` and `wobjdata`.

use nalgebra::Vector3;
use trical_model::Pose;
use trical_model::pose::rotation_from_quaternion;

use crate::frames::{Frame, Frames};
use crate::scan::Setup;

/// Takes over a tool or a work object that a motion of another module is meant with, if that module declares it;
/// what is another one here gets a name of its own.
pub(super) fn take_over(is_tool: bool, setup: &mut Setup, known: &mut Frames, theirs: &Frames, file: &str) {
    let (known, theirs) = (known.of_mut(is_tool), theirs.of(is_tool));
    let Some(name) = setup.slot(is_tool) else { return };
    let Some(value) = theirs.get(name) else { return };
    if known.get(name).is_some_and(|own| own != value) {
        *name = format!("{name} of {file}");
    }
    known.entry(name.clone()).or_insert_with(|| value.clone());
}

fn pose(v: &[f64]) -> Result<Pose, &'static str> {
    let [x, y, z, a, b, c, d] = v else { return Err("a position and a quaternion") };
    if ([a, b, c, d].iter().map(|q| *q * *q).sum::<f64>().sqrt() - 1.0).abs() > 0.01 {
        return Err("a quaternion of length 1");
    }
    Ok(Pose { rotation: rotation_from_quaternion([*a, *b, *c, *d]), translation: Vector3::new(*x, *y, *z) * 1e-3 })
}

/// A tool, of the truth values and numbers of its `tooldata`.
///
/// # Errors
/// In words: not of the right shape, or held still while the robot carries the work.
pub(super) fn tool(truth: &[bool], v: &[f64], name: &str) -> Result<Frame, String> {
    if v.len() < 11 || truth.len() != 1 {
        return Err(format!(
            "the tooldata '{name}' cannot be read; expected [TRUE,[[x,y,z],[q1,q2,q3,q4]],[mass,[x,y,z],...]]"
        ));
    }
    if !truth[0] {
        return Err(format!("the tool '{name}' is stationary (robhold FALSE), which is not supported"));
    }
    let parent_from_frame = pose(&v[..7]).map_err(|e| format!("the tooldata '{name}': expected {e}"))?;
    // -1 means that nobody has said
    let mass = v[7].max(0.0);
    Ok(Frame { parent_from_frame, mass, cog: Vector3::new(v[8], v[9], v[10]) * 1e-3 })
}

/// A work object in the controller's world, of the truth values and numbers of its `wobjdata`.
///
/// # Errors
/// In words: not of the right shape, or moved by a machine.
pub(super) fn work_object(truth: &[bool], v: &[f64], name: &str) -> Result<Frame, String> {
    let ([robhold, fixed, ..], 14) = (truth, v.len()) else {
        return Err(format!(
            "the wobjdata '{name}' cannot be read; expected [FALSE,TRUE,\"\",[[x,y,z],[q1,q2,q3,q4]],[[x,y,z],[q1,q2,q3,q4]]]"
        ));
    };
    if *robhold {
        return Err(format!("the work object '{name}' is held by the robot (robhold TRUE), which is not supported"));
    }
    if !fixed {
        return Err(format!(
            "the work object '{name}' is moved by a mechanical unit (ufprog FALSE), which is not supported"
        ));
    }
    let part = |v: &[f64]| pose(v).map_err(|e| format!("the wobjdata '{name}': expected {e}"));
    Ok(Frame::massless(part(&v[..7])?.compose(&part(&v[7..])?)))
}
