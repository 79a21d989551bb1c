//! What a run would do, in words; and the checks of a plan before anything moves.

use trical_model::recording::Joints;

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
        let mut from = stood;
        let count = entry.via.len();
        let stops = entry.via.iter().enumerate().map(|(at, q)| (format!("via point {} of {count}", at + 1), q));
        for (name, q) in stops.chain(std::iter::once(("the touch".to_owned(), &entry.joints))) {
            let speed = if name == "the touch" { options.touch_speed } else { options.travel_speed };
            let touched = (name == "the touch").then_some(entry.ball);
            let refused = check_joints(q, options)
                .and_then(|()| from.map_or(Ok(()), |from| check_guard(from, q, touched, options)))
                .map_or_else(|violation| format!("; REFUSED: {violation}"), |()| String::new());
            steps.push(format!(
                "{head}: move to {name} at {:.0} mm/s: {} deg{refused}",
                speed * 1e3,
                degrees(q, joints)
            ));
            from = Some(q);
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

/// Whether the collision model allows a motion; `touched` is the ball that the stems may meet on it.
pub(super) fn check_guard(
    from: &Joints,
    to: &Joints,
    touched: Option<usize>,
    options: &ProcedureOptions<'_>,
) -> Result<(), Violation> {
    options.guard.map_or(Ok(()), |guard| guard(from, to, touched)).map_err(Violation::Guard)
}

/// As [`check_guard`], for the way from where the arm is.
pub(super) fn check_way(
    from: &Joints,
    to: &Joints,
    touched: Option<usize>,
    options: &ProcedureOptions<'_>,
) -> Result<(), Violation> {
    options.guard.map_or(Ok(()), |guard| guard(from, to, touched)).map_err(Violation::NoWay)
}

/// Checks a plan and settings before anything moves.
pub(super) fn check_plan(plan: &[PlanEntry], options: &ProcedureOptions<'_>) -> Result<(), ProcedureError> {
    let positive = [
        ("epsilon", options.epsilon),
        ("travel speed", options.travel_speed),
        ("touch speed", options.touch_speed),
        ("rotation speed", options.rotation_speed),
        ("correction limit", options.limits.correction),
        ("limit of all corrections", options.limits.total_correction),
        ("arrival tolerance", options.limits.arrival),
    ];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(ProcedureError::Options(format!("{name} is {value}; expected a positive number")));
        }
    }
    for (name, value) in [("travel speed", options.travel_speed), ("touch speed", options.touch_speed)] {
        if value > options.limits.speed {
            return Err(ProcedureError::Options(format!(
                "{name} is {:.0} mm/s, the limit is {:.0} mm/s",
                value * 1e3,
                options.limits.speed * 1e3
            )));
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
        let mut from = stood;
        let ways = entry.via.iter().map(|q| (q, None));
        for (q, touched) in ways.chain(std::iter::once((&entry.joints, Some(entry.ball)))) {
            check_joints(q, options).map_err(wrong)?;
            if let Some(from) = from {
                check_guard(from, q, touched, options).map_err(wrong)?;
            }
            from = Some(q);
        }
        stood = stands_after(entry, options);
    }
    let mut seen = std::collections::BTreeSet::new();
    match plan.iter().find(|entry| !seen.insert(entry.index)) {
        Some(twice) => {
            Err(ProcedureError::Options(format!("the plan has two touches with number {}", twice.index + 1)))
        }
        None => Ok(()),
    }
}
