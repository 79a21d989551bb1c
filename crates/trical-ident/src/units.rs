//! Coefficients as people read them: units, and values beside nominal.

use trical_model::{Model, Motion, Parameter, Payload, Place, Pose, Shape, Site, Term, Variable};

/// A coefficient's unit and how many of it one SI unit is.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// "deg", "mm", "deg/Nm", "mm/K" ...
    pub name: String,
    /// Multiply an SI coefficient by this. Below zero where the sense of motion counts: a gap is what it measures, positive, though it
    /// adds to the angle against the sense.
    pub per_si: f64,
}

/// The unit of a term's coefficient.
#[must_use]
pub fn unit(term: &Term) -> Unit {
    let unit = magnitude(term);
    Unit { per_si: if term.basis.sense.is_some() { -unit.per_si } else { unit.per_si }, ..unit }
}

/// The unit, whatever the sense of motion does.
fn magnitude(term: &Term) -> Unit {
    let deg = 1.0_f64.to_degrees();
    let (site, site_factor) = match term.site {
        Site::Link { parameter: Parameter::A | Parameter::D, .. }
        | Site::Base(Motion::Along(_))
        | Site::Tool(Motion::Along(_))
        | Site::Fixture(Motion::Along(_))
        | Site::Frame { motion: Motion::Along(_), .. }
        | Site::Target { .. }
        | Site::Ball { .. }
        | Site::Anchor { .. }
        | Site::LengthZero { .. } => ("mm", 1e3),
        Site::Links => ("", 1.0),
        Site::Gravity(_) => ("m/s2", 1.0),
        Site::Payload(Payload::Mass) => ("kg", 1.0),
        Site::Payload(Payload::Moment(_)) => ("kg mm", 1e3),
        Site::AllJoints | Site::Joint { .. }
            if matches!(term.basis.of, Variable::Joint { .. } | Variable::Lag { .. })
                && term.basis.shape == Shape::Linear =>
        {
            return Unit { name: "1".into(), per_si: 1.0 };
        }
        _ => ("deg", deg),
    };
    let power = match term.basis.shape {
        Shape::Linear | Shape::Absolute | Shape::Hinge { .. } => 1,
        Shape::SignedSquare => 2,
        Shape::Cube => 3,
        _ => 0,
    };
    let (of, of_factor): (&str, f64) = match term.basis.of {
        Variable::Nothing => ("", 1.0),
        Variable::Joint { .. } | Variable::Inclination { .. } | Variable::Lag { .. } => ("deg", deg),
        Variable::Moment { .. }
        | Variable::FootMoment { .. }
        | Variable::PartMoment { .. }
        | Variable::Torque { .. } => ("Nm", 1.0),
        Variable::Time => ("s", 1.0),
        Variable::Seq => ("pose", 1.0),
        Variable::Temperature { .. } => ("K", 1.0),
        Variable::Reading { .. } => ("mm", 1e3),
    };
    if power == 0 || of.is_empty() {
        let name = if site.is_empty() { "1" } else { site };
        return Unit { name: name.into(), per_si: site_factor };
    }
    if site == of && power == 1 {
        return Unit { name: "1".into(), per_si: 1.0 };
    }
    let exponent = if power == 1 { String::new() } else { power.to_string() };
    let top = if site.is_empty() { "1" } else { site };
    Unit { name: format!("{top}/{of}{exponent}"), per_si: site_factor / of_factor.powi(power) }
}

/// A parameter as it is shown: in its unit, absolute where that means something, beside nominal.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Shown {
    /// Name.
    pub name: String,
    /// Where it acts.
    pub site: Place,
    /// Value in `unit`.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Standard deviation in `unit`.
    pub sd: Option<f64>,
    /// What robot.toml and cell.toml say; `null` where they say nothing.
    pub nominal: Option<f64>,
}

/// How a term is shown. Geometry and places are absolute; rotations of base and tool, and all other coefficients, are
/// what is added to nominal; a measuring frame's rotation is shown as ZYX angles of `frame_from_world`.
#[must_use]
pub fn shown(model: &Model, term: &Term) -> Shown {
    let u = unit(term);
    let constant = term.basis.is_constant();
    let link = |k: usize| model.robot.joints.get(k);
    let cell = &model.cell;
    let mut value = term.value * u.per_si;
    let nominal: Option<f64> = match term.site {
        // where balls stood at a place that nobody measured has no nominal
        Site::Fixture(_) if term.effect == "place" => None,
        // how far a place's second socket is from its first
        Site::Ball { ball, axis } if term.effect == "place" => {
            let at = |ball: Option<&nalgebra::Vector3<f64>>| ball.map(|b| b[axis.index()]);
            at(cell.balls.get(ball - 1)).zip(at(cell.balls.first())).map(|(this, first)| this - first)
        }
        _ if !constant => Some(0.0),
        Site::Link { link: k, parameter } => match parameter {
            Parameter::Alpha => link(k).map(|j| j.alpha),
            Parameter::A => link(k).map(|j| j.a),
            Parameter::Beta => link(k).map(|j| j.beta),
            Parameter::Theta => link(k.wrapping_sub(1)).map(|j| j.theta_offset),
            Parameter::D => link(k.wrapping_sub(1)).map(|j| j.d),
        },
        Site::Base(Motion::Along(a)) => Some(cell.world_from_base.translation[a.index()]),
        Site::Tool(Motion::Along(a)) => Some(cell.tool.tcp[a.index()]),
        Site::Target { target, axis } => cell.tool.targets.get(target - 1).map(|t| t[axis.index()]),
        Site::Ball { ball, axis } => cell.balls.get(ball - 1).map(|t| t[axis.index()]),
        Site::Anchor { anchor, axis } => cell.anchors.get(anchor - 1).map(|t| t[axis.index()]),
        Site::Frame { frame, motion } => {
            if let Some(pose) = frame_pose(model, frame) {
                value = match motion {
                    Motion::Along(a) => pose.translation[a.index()] * 1e3,
                    Motion::About(a) => trical_model::pose::angles_zyx(&pose.rotation)[2 - a.index()].to_degrees(),
                };
            }
            None
        }
        _ => Some(0.0),
    }
    .map(|n| n * u.per_si);
    if !matches!(term.site, Site::Frame { .. }) {
        value += nominal.unwrap_or(0.0);
    }
    Shown {
        name: term.name.clone(),
        site: Place::of(&term.site),
        value,
        unit: u.name,
        sd: term.sd.map(|s| s * u.per_si.abs()),
        nominal,
    }
}

/// `frame_from_world` with the constant terms.
fn frame_pose(model: &Model, frame: usize) -> Option<Pose> {
    trical_model::Forward::new(model.clone(), Vec::new()).ok()?.frame_from_world(frame.checked_sub(1)?)
}
