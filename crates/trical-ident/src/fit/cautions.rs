//! What about a fit should make its owner look twice, though nothing is wrong with the arithmetic.

use trical_model::{
    Axis, Basis, Joint, JointKind, Measured, Model, Motion, Parameter, Robot, Site, Term, Variable, trig,
};

use crate::dataset::Dataset;
use crate::fit::choice::{Elasticity, NEAR_PARALLEL, measured_torques};
use crate::fit::degenerate::hardly_moving;
use crate::fit::weak_priors::SOFTEST;

/// A base farther from where the cell file has it is more likely a mistake than a measurement, m and rad.
const FAR: f64 = 0.1;
const TURNED: f64 = 0.35;

/// Lengths of an arm that come out farther from its robot file are another arm's, m.
const ANOTHER_ARM: f64 = 0.02;

/// No identified arm is off by so much on average, mm and deg.
const NO_ARM_MM: f64 = 5.0;
const NO_ARM_DEG: f64 = 2.0;

/// More than this is left of few arms, mm.
const MUCH_MM: f64 = 1.0;

/// Fewer numbers measured for each parameter than this leave little to check the fit with.
const FEW: f64 = 2.0;

/// Balls that lean by more than this against those of the first session are worth a word: gravity then has another direction by 2 % of itself, rad.
const LEANS: f64 = 0.02;

/// Joints are beyond their limits by more than this, rad (a prismatic one: m), before it is worth a word.
const BEYOND: f64 = 0.02;

/// Joints of the recordings that lie beyond the arm's limits.
#[must_use]
pub fn beyond_limits(robot: &Robot, data: &Dataset) -> Option<String> {
    let beyond = |q: f64, [low, high]: [f64; 2]| (low - q).max(q - high);
    let joints = (0..robot.dof()).filter_map(|k| {
        let limits = robot.joints[k].limits;
        let worst = data
            .observations
            .iter()
            .map(|o| o.state.q[k])
            .max_by(|a, b| beyond(*a, limits).total_cmp(&beyond(*b, limits)))?;
        let (per_si, unit) = robot.joints[k].kind.unit();
        (beyond(worst, limits) > BEYOND).then(|| {
            let [low, high] = limits.map(|l| l * per_si);
            format!("joint {} at {:.1} {unit} (limits {low:.0} to {high:.0})", k + 1, worst * per_si)
        })
    });
    let all: Vec<String> = joints.collect();
    (!all.is_empty()).then(|| {
        format!(
            "joints were recorded beyond their limits, {}: does the robot file belong to this arm, with the right signs and zero positions?",
            all.join(", ")
        )
    })
}

/// A joint that turns farther than this, rad, has limits in other units.
const TURNS_SO_FAR: f64 = 20.0;

/// And one that slides farther than this, m.
const SLIDES_SO_FAR: f64 = 200.0;

/// An arm that weighs more than this, kg, for each cubed metre of its lengths has masses in other units: table-top arms and those of 11 t have 25
/// to 90.
const WEIGHS_SO_MUCH: f64 = 3000.0;

/// What of the robot file has other units than it should.
#[must_use]
pub fn odd_units(robot: &Robot) -> Vec<String> {
    odd_limits(robot).into_iter().chain(odd_masses(robot)).collect()
}

fn odd_masses(robot: &Robot) -> Option<String> {
    let mass: f64 = robot.joints.iter().filter_map(|j| j.mass).sum();
    let length: f64 = robot.joints.iter().map(|j| j.a.abs() + j.d.abs()).sum();
    (mass > WEIGHS_SO_MUCH * length.powi(3)).then(|| {
        format!("the links weigh {mass:.0} kg by the robot file, of an arm whose lengths are {length:.2} m together: is mass_kg in g?")
    })
}

fn odd_limits(robot: &Robot) -> Option<String> {
    let far = |j: &Joint| match j.kind {
        JointKind::Revolute => j.limits.iter().any(|l| l.abs() > TURNS_SO_FAR),
        JointKind::Prismatic => j.limits.iter().any(|l| l.abs() > SLIDES_SO_FAR),
    };
    let (k, joint) = robot.joints.iter().enumerate().find(|(_, j)| far(j))?;
    let (per_si, unit) = joint.kind.unit();
    let [low, high] = joint.limits.map(|l| l * per_si);
    Some(match joint.kind {
        JointKind::Revolute => format!(
            "joint {} turns from {low:.0} to {high:.0} {unit} by the robot file, {:.0} turns: are its limits in deg where the file has rad?",
            k + 1,
            (high - low) / 360.0
        ),
        JointKind::Prismatic => format!(
            "joint {} slides from {low:.0} to {high:.0} {unit} by the robot file: are its limits in mm where the file has m?",
            k + 1
        ),
    })
}

/// Errors that are left after identification and that no arm has: what was given does not go together.
#[must_use]
pub fn no_arm(mm: f64, deg: Option<f64>) -> Vec<String> {
    let mut out = Vec::new();
    if mm > NO_ARM_MM {
        out.push(format!(
            "after identification the tool is still {mm:.0} mm off, more than any arm: are units, signs and columns of the recording \
             right, and are robot and cell file those of this arm?"
        ));
    }
    if let Some(deg) = deg.filter(|deg| *deg > NO_ARM_DEG) {
        out.push(format!(
            "after identification the tool's orientation is still {deg:.0} deg off, more than any arm: are qw, qx, qy, qz in the columns \
             of their names, and do they turn the tool into the measuring frame, not back?"
        ));
    }
    out
}

/// Intervals that are so many times as wide as by the scatter alone are told.
const MUCH_WIDER: f64 = 2.0;

/// What to say of errors that neighbouring measurements share; `design_effect` is by how much variances grow for them.
#[must_use]
pub fn shared_errors(design_effect: f64) -> Option<String> {
    let wider = design_effect.sqrt();
    (wider > MUCH_WIDER).then(|| {
        format!(
            "neighbouring measurements have errors in common, so the model lacks something of the arm: the standard deviations are {wider:.1} times \
             what the scatter of single measurements would say"
        )
    })
}

/// What to look at where much is left, mm, and nothing is known that explains it.
#[must_use]
pub fn much_left(robot: &Robot, mm: f64) -> Option<String> {
    let reach: f64 = robot.joints.iter().map(|j| libm::hypot(j.a, j.d)).sum();
    let deg = (mm * 1e-3 / reach.max(1e-3)).to_degrees();
    (MUCH_MM..=NO_ARM_MM).contains(&mm).then(|| {
        format!(
            "{mm:.1} mm is left that neither the arm's geometry nor any known effect explains. With the arm stretched out, {deg:.2} deg \
             of joint 1 makes as much. Look at the measurements before the arm: measure one pose five times. If that scatters as \
             much, something is loose (tool, balls, instrument), or joints are read while the arm still moves. If it repeats, check \
             the robot file (is it this arm, with its joints in their order and signs?), the units, and whether tool, balls or base \
             were moved during the recording: each such part is a session or a `place` of its own."
        )
    })
}

/// In one sentence each; `rows` numbers were measured for so many `parameters`.
#[must_use]
pub fn cautions(model: &Model, rows: usize, parameters: usize) -> Vec<String> {
    let mut out = Vec::new();
    let (mut shift, mut turn) = (0.0_f64, 0.0_f64);
    for t in model.terms.iter().filter(|t| t.basis == Basis::CONSTANT) {
        match t.site {
            Site::Base(Motion::Along(_)) => shift = libm::hypot(shift, t.value),
            Site::Base(Motion::About(_)) => turn = libm::hypot(turn, t.value),
            _ => {}
        }
    }
    if shift > FAR || turn > TURNED {
        out.push(format!(
            "the base comes out {:.0} mm and {:.0} deg from where the cell file has it: are the balls numbered as in the cell, \
             and the signs of the indicators right?",
            shift * 1e3,
            turn.to_degrees()
        ));
    }
    let length = |t: &&Term| matches!(t.site, Site::Link { parameter: Parameter::A | Parameter::D, .. });
    let lengths = model.terms.iter().filter(|t| t.basis == Basis::CONSTANT).filter(length);
    if let Some(t) =
        lengths.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs())).filter(|t| t.value.abs() > ANOTHER_ARM)
    {
        out.push(format!(
            "{} comes out {:.0} mm from what the robot file has: is it the file of this arm, and are places in mm and joints in deg?",
            t.name,
            t.value.abs() * 1e3
        ));
    }
    out.extend(too_soft(model));
    out.extend(leaning(model));
    if (rows as f64) < FEW * parameters as f64 {
        out.push(format!(
            "{rows} numbers were measured for {parameters} parameters: the error at these very measurements says little about the \
             error elsewhere"
        ));
    }
    out
}

/// What to say of a joint that gives way as none does: its compliance has taken up something else.
fn too_soft(model: &Model) -> Option<String> {
    let is_sure = |t: &&Term| t.value.abs() > SOFTEST && t.sd.is_some_and(|sd| t.value.abs() > 3.0 * sd);
    let against = |t: &&Term| t.sd.is_some_and(|sd| t.value < -3.0 * sd);
    let soft = || model.terms.iter().filter(|t| t.gives_way().is_some());
    let Some(t) = soft().find(is_sure) else {
        return soft().find(against).map(|t| {
            let torques = if matches!(t.basis.of, Variable::Torque { .. }) { ", or torques of the other sign" } else { "" };
            format!(
                "the compliance {} comes out at {:.4} deg/Nm, and no joint moves against its load: something else changes with the load or the inclination \
                 (a load that the cell file does not have, a base that is not level{torques})",
                t.name,
                t.value.to_degrees()
            )
        });
    };
    Some(format!(
        "the compliance {} comes out at {:.2} deg/Nm, and no joint is that soft: a loose flange or device, whose error changes with its inclination, \
         can look like this",
        t.name,
        t.value.to_degrees()
    ))
}

/// What to say of a session whose balls lean against those of the first. These have the world frame, along whose z gravity acts in every session:
/// touches alone cannot tell whether the balls were put down otherwise, or the arm.
fn leaning(model: &Model) -> Option<String> {
    let by_gravity = |t: &Term| {
        use Variable::{FootMoment, Inclination, Moment, PartMoment};
        matches!(t.basis.of, Moment { .. } | FootMoment { .. } | PartMoment { .. } | Inclination { .. })
    };
    let leans = |session: u32| {
        let of = model.terms.iter().filter(|t| t.effect == "balls" && t.basis.session == Some(session));
        let about = of.filter(|t| matches!(t.site, Site::Fixture(Motion::About(Axis::X | Axis::Y))));
        about.map(|t| t.value).fold(0.0, libm::hypot)
    };
    let sessions: std::collections::BTreeSet<u32> = model.terms.iter().filter_map(|t| t.basis.session).collect();
    let (session, leans) =
        sessions.into_iter().map(|s| (s, leans(s))).max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, by)| *by > LEANS)?;
    model.terms.iter().any(by_gravity).then(|| {
        format!(
            "the balls of recording {session} are tilted by {:.1} deg relative to those of the first. Gravity is taken along the z axis of the first recording's \
             balls in all of them, which is right where the arm stood as before and those balls stood level: give the recording whose balls stood level first; \
             where the arm itself was mounted otherwise, identify its recordings apart, or it gives way in a wrong direction by {:.0} %",
            leans.to_degrees(),
            trig::sin(leans) * 100.0
        )
    })
}

/// What to say where links without masses are taken to weigh alike.
pub const EVEN_MASSES: &str = "the robot has no masses: its links are assumed to have the same mass (2.5 kg, halfway to the next joint), so that \
                               compliance is right in shape but not in size";

/// What to say of an arm of which neither masses nor torques are known.
#[must_use]
pub fn without_masses(elasticity: Elasticity, model: &Model) -> Option<String> {
    if elasticity != Elasticity::Inclination {
        return None;
    }
    let mut sag: Vec<usize> = Vec::new();
    for t in &model.terms {
        if let (Variable::Inclination { .. }, Site::Joint { joint }) = (t.basis.of, t.site)
            && !sag.contains(&joint)
        {
            sag.push(joint);
        }
    }
    let cure = "mass_kg and cog_mm of every link in robot.toml would give it";
    Some(if sag.is_empty() {
        format!("the robot has no masses, so that compliance was left out ({cure})")
    } else {
        format!(
            "the robot has no masses, so that compliance was left out ({cure}); the measurements show that {} way to gravity, which \
             was identified as a function of the links' inclination (sag_...) and holds for the load of these recordings",
            if let [joint] = sag[..] {
                format!("joint {joint} gives")
            } else {
                format!("joints {} give", numbers(&sag))
            },
        )
    })
}

/// What to say of loads that were recorded and have no part in the model.
#[must_use]
pub fn loads_left_out(elasticity: Elasticity, robot: &Robot, data: &Dataset) -> Option<String> {
    if elasticity == Elasticity::NotAsked {
        return None;
    }
    let (all, states) = (data.observations.len(), data.observations.iter().map(|o| &o.state));
    let with = states.clone().filter(|s| s.torques.is_some()).count();
    if with > 0 && with < all {
        return Some(format!(
            "{} of {all} measurements have no joint torques (tau1_nm ...): those of the others were not used",
            all - with
        ));
    }
    let measured = measured_torques(states.clone());
    let same: Vec<usize> = (1..=robot.dof()).filter(|joint| !measured[joint - 1]).collect();
    if with > 0 && !same.is_empty() {
        return Some(format!(
            "the torques of joint{} {} are the same in all measurements, so that no sensor measured them: they were not used",
            if same.len() > 1 { "s" } else { "" },
            numbers(&same)
        ));
    }
    let mut payloads = states.filter_map(|s| s.payload_kg);
    let first = payloads.next();
    let changes = payloads.any(|kg| Some(kg) != first);
    (changes && elasticity == Elasticity::Inclination).then(|| {
        "payload_kg changes, but without masses of the links or joint torques (tau1_nm ...) the model cannot follow it: how the arm gives way under \
         the payload is left as an error"
            .into()
    })
}

/// What to say of points of which nobody says which target they are, where the cell has several.
#[must_use]
pub fn which_target(data: &Dataset, targets: usize) -> Option<String> {
    let mut points = data.observations.iter().filter_map(|o| match o.measured {
        Measured::Point { target, .. } => Some(target),
        _ => None,
    });
    (targets > 1 && points.next() == Some(0) && points.all(|target| target == 0)).then(|| {
        format!(
            "the cell has {targets} targets on the tool (targets_mm), and every point is taken as target 1: where others were measured, the \
             column `target` has to say which"
        )
    })
}

/// Axes of consecutive joints that are nearer than this have no side that a common normal points to, m.
const SAME_LINE: f64 = 1e-3;

/// What to say of consecutive joints that turn about the same line.
#[must_use]
pub fn coincident(robot: &Robot) -> Option<String> {
    let turns = |k: usize| robot.joints[k].kind == JointKind::Revolute;
    let same = |k: &usize| {
        let next = &robot.joints[*k];
        turns(k - 1) && turns(*k) && trig::sin(next.alpha).abs() < NEAR_PARALLEL && next.a.abs() < SAME_LINE
    };
    let first = (1..robot.dof()).find(same)?;
    Some(format!(
        "joints {first} and {} turn about the same line by the robot file. If the second axis stands beside the first, the model has that \
         offset in one direction only (a_{first}): what is perpendicular to it remains as an error that turns with joint {first}",
        first + 1
    ))
}

/// What to say of joints that hardly move: what cannot be told without their motion was held.
#[must_use]
pub fn held(robot: &Robot, data: &Dataset, names: &[&str]) -> Option<String> {
    let joints: Vec<usize> = hardly_moving(robot, data).into_iter().map(|(k, _)| k + 1).collect();
    (!joints.is_empty() && !names.is_empty()).then(|| {
        format!(
            "joint{} {} hardly move{} (less than 1 deg or 5 mm): parameters that only {} motion could determine were kept at nominal: {}",
            if joints.len() > 1 { "s" } else { "" },
            numbers(&joints),
            if joints.len() > 1 { "" } else { "s" },
            if joints.len() > 1 { "their" } else { "its" },
            names.join(", ")
        )
    })
}

/// What to say of parameters that weak priors kept near nominal.
#[must_use]
pub fn near_nominal(names: &[&str]) -> Option<String> {
    (!names.is_empty()).then(|| {
        format!(
            "the measurements do not determine {} well: kept near nominal by priors (standard deviation 2 mm, 0.2 deg, or 0.3 deg under the largest load); more varied poses would determine them",
            names.join(", ")
        )
    })
}

fn numbers(joints: &[usize]) -> String {
    listed(&joints.iter().map(ToString::to_string).collect::<Vec<_>>(), "and")
}

/// "1, 3 and 4": `word` stands before the last.
#[must_use]
pub fn listed(all: &[String], word: &str) -> String {
    match all.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} {word} {last}", before.join(", ")),
        _ => all.concat(),
    }
}

/// What to say where more parameters were determined, of `fitted`, than a third of the independent poses of the arm.
#[must_use]
pub fn too_many(parameters: f64, fitted: usize, folds: &crate::fit::folds::Folds) -> Option<String> {
    let blocks = folds.blocks();
    (3.0 * parameters > blocks as f64).then(|| {
        let determined = format!("{parameters:.0}");
        let effective = if determined == fitted.to_string() {
            String::new()
        } else {
            format!(" ({determined} effective: priors determine the rest)")
        };
        format!(
            "{fitted} parameters{effective} were determined from {blocks} independent poses of the arm ({} measured), fewer than three for \
             each: where nothing was measured the model may be wrong; measure more poses",
            folds.poses().len()
        )
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Cell, Robot, Shape, Term};

    use super::*;

    #[test]
    fn errors_that_no_arm_has_are_told() {
        assert!(no_arm(4.9, None).is_empty() && no_arm(0.4, Some(1.9)).is_empty());
        assert!(no_arm(53.2, Some(0.1))[0].contains("still 53 mm off"));
        assert!(no_arm(3.0, Some(26.4))[0].contains("still 26 deg off"));
    }

    #[test]
    fn limits_in_degrees_and_masses_in_grams_are_told() {
        let robot = Robot::parse(include_str!("../../../trical-model/tests/data/arm.toml"), "arm.toml").unwrap();
        assert!(odd_units(&robot).is_empty());
        let mut odd = robot.clone();
        odd.joints[1].limits = [-166.0, 166.0];
        odd.joints.iter_mut().for_each(|j| j.mass = j.mass.map(|m| m * 1e3));
        let said = odd_units(&odd);
        assert!(said[0].starts_with("joint 2 turns from -9511 to 9511 deg by the robot file, 53 turns"), "{said:?}");
        assert!(said.len() == 2 && said[1].ends_with("is mass_kg in g?"), "{said:?}");
        let mut rail = robot.clone();
        (rail.joints[0].kind, rail.joints[0].limits) = (JointKind::Prismatic, [0.0, 900.0]);
        let said = odd_units(&rail);
        assert!(said.len() == 1 && said[0].starts_with("joint 1 slides from 0 to 900000 mm"), "{said:?}");
    }

    #[test]
    fn much_that_is_left_says_what_to_look_at_and_in_angles_of_this_arm() {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        assert!(much_left(&robot, 0.9).is_none() && much_left(&robot, 5.1).is_none());
        // 290 + 270 + 310 (of 70 and 302) + 72 mm
        let said = much_left(&robot, 3.0).unwrap();
        assert!(said.starts_with("3.0 mm is left") && said.contains("0.18 deg of joint 1"), "{said}");
        assert!(said.contains("measure one pose five times") && said.contains("robot file"), "{said}");
    }

    #[test]
    fn joints_that_turn_about_the_same_line_are_told() {
        let arm = include_str!("../../../../cells/irb120/robot.toml");
        assert_eq!(coincident(&Robot::parse(arm, "robot.toml").unwrap()), None);
        // an arm on a turntable below its first joint
        let joint = arm.find("[[joint]]").unwrap();
        let turntable = "[[joint]]\nalpha_deg = 0.0\na_mm = 0.0\nd_mm = 100.0\ntheta_offset_deg = 0.0\nlimits_deg = [-180.0, 180.0]\n\n";
        let arm: String = [&arm[..joint], turntable, &arm[joint..]].concat();
        let bare = arm
            .lines()
            .filter(|l| !l.starts_with("mass_kg") && !l.starts_with("cog_mm"))
            .collect::<Vec<_>>()
            .join("\n");
        let said = coincident(&Robot::parse(&bare, "robot.toml").unwrap()).unwrap();
        assert!(said.starts_with("joints 1 and 2 turn about the same line") && said.contains("a_1"), "{said}");
    }

    #[test]
    fn a_base_far_away_and_few_rows_are_told() {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
        let mut model = Model::nominal(robot, cell);
        let mut term = Term::new("base_z", "geometry", Site::Base(Motion::Along(Axis::Z)), Basis::CONSTANT);
        term.value = 0.05;
        model.terms.push(term);
        assert!(cautions(&model, 135, 31).is_empty());
        model.terms[0].value = 0.303;
        assert!(cautions(&model, 135, 31)[0].contains("303 mm"));
        assert!(cautions(&model, 36, 31)[1].contains("36 numbers"));
        // a recording in inches
        let length = Site::Link { link: 2, parameter: Parameter::A };
        model.terms[0] = Term { value: -0.259, ..Term::new("a_2", "geometry", length, Basis::CONSTANT) };
        assert!(cautions(&model, 135, 31)[0].starts_with("a_2 comes out 259 mm from what the robot file has"));
        model.terms[0].value = 0.015;
        assert!(cautions(&model, 135, 31).is_empty());
        // a joint that gives way as none does, if that is sure
        let soft = |sd| {
            let basis = Basis::torque(6, Shape::Linear);
            let term = Term::new("c_6", "compliance", Site::Joint { joint: 6 }, basis);
            Term { value: -0.01, sd: Some(sd), ..term }
        };
        let before = std::mem::replace(&mut model.terms[0], soft(1e-3));
        assert!(
            cautions(&model, 135, 31)[0]
                .starts_with("the compliance c_6 comes out at -0.57 deg/Nm, and no joint is that soft")
        );
        model.terms[0] = soft(1e-2);
        assert!(cautions(&model, 135, 31).is_empty());
        // or moves against its load
        model.terms[0] = Term { value: -1e-4, ..soft(2e-5) };
        assert!(
            cautions(&model, 135, 31)[0]
                .starts_with("the compliance c_6 comes out at -0.0057 deg/Nm, and no joint moves against its load")
        );
        model.terms[0] = Term { value: 1e-4, ..soft(2e-5) };
        assert!(cautions(&model, 135, 31).is_empty());
        model.terms[0] = before;
        // a plate that leans, in the second session
        let about_x = Site::Fixture(Motion::About(Axis::X));
        let of_two = |deg: f64| Term {
            value: deg.to_radians(),
            ..Term::new("balls_rx_s2", "balls", about_x, Basis::CONSTANT.in_session(2))
        };
        model.terms.push(of_two(5.0));
        assert!(cautions(&model, 135, 31).is_empty(), "nothing follows gravity");
        let soft = Basis::torque(2, Shape::Linear);
        model.terms.push(Term::new("c_2", "compliance", Site::Joint { joint: 2 }, soft));
        let said = cautions(&model, 135, 31).remove(0);
        assert!(
            said.starts_with("the balls of recording 2 are tilted by 5.0 deg") && said.ends_with("by 9 %"),
            "{said}"
        );
        model.terms[1] = of_two(1.0);
        assert!(cautions(&model, 135, 31).is_empty());
    }
}
