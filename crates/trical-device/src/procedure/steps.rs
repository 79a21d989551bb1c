//! What a run would do, in words; and the checks of a plan before anything moves.

use trical_model::recording::Joints;

use super::options::FASTEST;
use super::{PlanEntry, ProcedureError, ProcedureOptions, Retreat, Violation};

/// The steps of a plan, one sentence each; nothing moves.
///
/// Entries that were done before are left out. A step that a limit or the guard refuses says so. `joints` of each joint
/// vector are shown.
#[must_use]
pub fn dry_run(plan: &[PlanEntry], options: &ProcedureOptions<'_>, joints: usize) -> Vec<String> {
    let mut steps = Vec::new();
    if let Some([x, y, z]) = options.tcp_in_flange {
        steps.push(format!("tell the controller the TCP: {:.4} {:.4} {:.4} mm", x * 1e3, y * 1e3, z * 1e3));
    }
    let mut stood: Option<&Joints> = None;
    for entry in plan {
        if options.skip.contains(&entry.index) {
            stood = None;
            continue;
        }
        let head = format!("touch {} (ball {})", entry.index + 1, entry.ball + 1);
        let count = entry.via.len();
        for (at, way) in ways(entry, stood).enumerate() {
            let (name, speed) = match at {
                at if at < count => (format!("via point {} of {count}", at + 1), options.travel_speed * 1e3),
                _ => ("the touch".to_owned(), options.touch_speed * 1e3),
            };
            let refused = check_way(way, options).err().map(|why| format!("; REFUSED: {why}")).unwrap_or_default();
            let to = degrees(way.1, joints);
            steps.push(format!("{head}: move to {name} at {speed:.0} mm/s: {to} deg{refused}"));
        }
        steps.push(format!(
            "{head}: read and correct in the tool's axes until the reading is below {:.4} mm (each correction {:.1} mm \
             at most, {:.1} mm in all, {} at most), then record the joints",
            options.epsilon * 1e3,
            options.limits.correction * 1e3,
            options.limits.total_correction * 1e3,
            options.limits.iterations
        ));
        steps.push(match options.retreat {
            Retreat::Whole => format!("{head}: go back the way it came, to via point 1"),
            Retreat::Approach => format!("{head}: go back to via point {count}"),
        });
        stood = stands_after(entry, options);
    }
    steps
}

/// Where the arm stands after an entry, as far as the plan says; where it stands before the first is not known here.
fn stands_after<'a>(entry: &'a PlanEntry, options: &ProcedureOptions<'_>) -> Option<&'a Joints> {
    match options.retreat {
        Retreat::Whole => entry.via.first(),
        Retreat::Approach => entry.via.last(),
    }
}

fn degrees(q: &Joints, joints: usize) -> String {
    q.iter().take(joints).map(|q| format!("{:.3}", q.to_degrees())).collect::<Vec<_>>().join(" ")
}

/// Whether joint values that a controller reports are numbers: nothing may start from a place that is none.
pub(super) fn check_finite(q: &Joints) -> Result<(), Violation> {
    match q.iter().position(|q| !q.is_finite()) {
        None => Ok(()),
        Some(joint) => Err(Violation::NoNumber { joint: joint + 1, value: q[joint] }),
    }
}

/// Whether an arm can stand at the joint values that a controller reports, before anything moves.
pub(super) fn check_standing(q: &Joints, options: &ProcedureOptions<'_>) -> Result<(), Violation> {
    check_joints(q, options).or_else(|outside| match outside {
        Violation::JointLimit { joint, value_deg, low_deg, high_deg }
            if value_deg < low_deg - SLACK_DEG || value_deg > high_deg + SLACK_DEG =>
        {
            Err(Violation::StandsOutside { joint, value_deg, low_deg, high_deg })
        }
        _ => Ok(()),
    })
}

/// An arm that stands at its stop may be read a little beyond, deg.
const SLACK_DEG: f64 = 0.5;

/// Whether joint values are finite and within the limits.
pub(super) fn check_joints(q: &Joints, options: &ProcedureOptions<'_>) -> Result<(), Violation> {
    let limits = options.limits.joints.iter().copied().chain(std::iter::repeat((f64::MIN, f64::MAX)));
    for (joint, (q, (low, high))) in q.iter().zip(limits).enumerate() {
        if !(low..=high).contains(q) {
            return Err(Violation::JointLimit {
                joint: joint + 1,
                value_deg: q.to_degrees(),
                low_deg: low.to_degrees(),
                high_deg: high.to_degrees(),
            });
        }
    }
    Ok(())
}

impl ProcedureOptions<'_> {
    /// Whether the collision model allows a motion; `touched` is the ball that the stems may meet on it.
    pub(super) fn allow(&self, from: &Joints, to: &Joints, touched: Option<usize>) -> Result<(), String> {
        self.guard.map_or(Ok(()), |guard| guard(from, to, touched))
    }
}

/// Motions of an entry up to its touch, as far as the plan says from where: from, to, and the ball that the stems may meet.
fn ways<'a>(
    entry: &'a PlanEntry,
    stood: Option<&'a Joints>,
) -> impl Iterator<Item = (Option<&'a Joints>, &'a Joints, Option<usize>)> {
    let to = entry.via.iter().map(|q| (q, None)).chain(std::iter::once((&entry.joints, Some(entry.ball))));
    let from = std::iter::once(stood).chain(entry.via.iter().map(Some));
    from.zip(to).map(|(from, (to, touched))| (from, to, touched))
}

/// Whether such a motion may be made.
fn check_way(
    (from, to, touched): (Option<&Joints>, &Joints, Option<usize>),
    options: &ProcedureOptions<'_>,
) -> Result<(), Violation> {
    check_joints(to, options)?;
    from.map_or(Ok(()), |from| options.allow(from, to, touched)).map_err(Violation::Guard)
}

/// Checks a plan and settings before anything moves.
pub(super) fn check_plan(plan: &[PlanEntry], options: &ProcedureOptions<'_>) -> Result<(), ProcedureError> {
    let positive = [
        ("epsilon", options.epsilon),
        ("travel speed", options.travel_speed),
        ("touch speed", options.touch_speed),
        ("correction limit", options.limits.correction),
        ("limit of all corrections", options.limits.total_correction),
    ];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(ProcedureError::Options(format!("{name} is {value}; expected a positive number")));
        }
    }
    for (name, value) in [("travel speed", options.travel_speed), ("touch speed", options.touch_speed)] {
        if value > FASTEST {
            let (value, limit) = (value * 1e3, FASTEST * 1e3);
            return Err(ProcedureError::Options(format!("{name} is {value:.0} mm/s, the limit is {limit:.0} mm/s")));
        }
    }
    let mut stood: Option<&Joints> = None;
    for entry in plan {
        if options.skip.contains(&entry.index) {
            stood = None;
            continue;
        }
        let wrong =
            |violation| ProcedureError::Plan { index: entry.index, ball: entry.ball, violation: Box::new(violation) };
        ways(entry, stood).try_for_each(|way| check_way(way, options)).map_err(wrong)?;
        stood = stands_after(entry, options);
    }
    let mut seen = std::collections::BTreeSet::new();
    plan.iter().find(|entry| !seen.insert(entry.index)).map_or(Ok(()), |twice| {
        Err(ProcedureError::Options(format!("the plan has two touches with number {}", twice.index + 1)))
    })
}
