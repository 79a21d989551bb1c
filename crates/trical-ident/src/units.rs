//! Coefficients as people read them: units, and values beside nominal.

use trical_model::{
    Axis, JointKind, Model, Motion, Parameter, Payload, Place, Pose, Robot, Shape, Site, Term, Variable,
};

/// A coefficient's unit and how many of it one SI unit is.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// "deg", "mm", "deg/Nm", "mm/K" ...
    pub name: String,
    /// Multiply an SI coefficient by this. Below zero where the sense of motion counts: a gap is what it measures, positive, though it
    /// adds to the angle against the sense.
    pub per_si: f64,
}

/// The unit of a term's coefficient: that of a joint which slides is a length.
#[must_use]
pub fn unit(robot: &Robot, term: &Term) -> Unit {
    let unit = magnitude(term, &|joint| robot.kind(joint));
    Unit { per_si: if term.basis.sense.is_some() { -unit.per_si } else { unit.per_si }, ..unit }
}

/// As [`unit`], as model files had it before joints that slide were told in mm: every joint turns.
pub(crate) fn unit_of_turning(term: &Term) -> Unit {
    let unit = magnitude(term, &|_| JointKind::Revolute);
    Unit { per_si: if term.basis.sense.is_some() { -unit.per_si } else { unit.per_si }, ..unit }
}

/// The unit, whatever the sense of motion does, of an arm whose joints (from 1) move as `kind` says.
fn magnitude(term: &Term, kind: &dyn Fn(usize) -> JointKind) -> Unit {
    let deg = 1.0_f64.to_degrees();
    let of_joint = |joint: usize| {
        let (per_si, name) = kind(joint).unit();
        (name, per_si)
    };
    // what a joint bears along its axis: a force, where it slides
    let load = |joint: usize| if kind(joint) == JointKind::Prismatic { ("N", 1.0) } else { ("Nm", 1.0) };
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
        Site::Joint { joint } => of_joint(joint),
        // of each joint its own
        Site::AllJoints
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
        Variable::Joint { joint } | Variable::Lag { joint } => of_joint(joint),
        Variable::Inclination { .. } => ("deg", deg),
        Variable::Torque { joint }
        | Variable::Moment { joint, axis: Axis::Z }
        | Variable::FootMoment { joint, axis: Axis::Z } => load(joint),
        Variable::Moment { .. } | Variable::FootMoment { .. } | Variable::PartMoment { .. } => ("Nm", 1.0),
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
    let u = unit(&model.robot, term);
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::Basis;

    use super::*;

    #[test]
    fn what_a_joint_that_slides_does_is_told_in_mm_and_by_mm() {
        let joint = |kind: &str, limits: &str| {
            format!("[[joint]]\n{kind}alpha_deg = 0\na_mm = 0\nd_mm = 0\ntheta_offset_deg = 0\n{limits}\n")
        };
        let slides = joint("kind = \"prismatic\"\n", "limits_mm = [0, 900]");
        let robot =
            Robot::parse(&format!("name = \"rail\"\n{slides}{}", joint("", "limits_deg = [-90, 90]")), "rail.toml")
                .unwrap();
        let of = |joint: usize, basis: Basis| {
            let u = unit(&robot, &Term::new("x", "x", Site::Joint { joint }, basis));
            (u.name, (u.per_si * 1e6).round() / 1e6)
        };
        let by = |of: Variable| Basis::new(of, Shape::Linear);
        let is = |name: &str, per_si: f64| (name.to_owned(), per_si);
        assert_eq!(of(1, Basis::CONSTANT), is("mm", 1e3));
        assert_eq!(of(2, Basis::CONSTANT), is("deg", 57.29578));
        assert_eq!(of(1, Basis::direction(1)), is("mm", -1e3));
        assert_eq!(of(1, by(Variable::Temperature { reference_c: 20.0 })), is("mm/K", 1e3));
        assert_eq!(of(1, by(Variable::Torque { joint: 1 })), is("mm/N", 1e3));
        let along = |joint: usize| by(Variable::Joint { joint });
        assert_eq!((of(1, along(1)), of(2, along(2))), (is("1", 1.0), is("1", 1.0)));
        assert_eq!((of(2, along(1)), of(1, along(2))), (is("deg/mm", 0.057_296), is("mm/deg", 17.453_293)));
    }

    #[test]
    fn the_turn_of_a_measuring_frame_is_told_by_its_angles_about_x_y_and_z() {
        let robot = Robot::parse(include_str!("../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let angles = [0.1, -0.2, 0.4];
        let mut model = Model::nominal(robot, trical_model::Cell::bare());
        let rotation = trical_model::pose::rotation_zyx(angles[2], angles[1], angles[0]);
        model.frames = vec![Pose { rotation, translation: nalgebra::Vector3::new(1.5, -0.3, 0.2) }];
        let told = |motion| {
            let term = Term::new("f", "frame", Site::Frame { frame: 1, motion }, Basis::CONSTANT);
            let told = shown(&model, &term);
            assert_eq!(told.nominal, None);
            (told.unit, (told.value * 1e6).round() / 1e6)
        };
        for (k, axis) in Axis::ALL.into_iter().enumerate() {
            let deg = (angles[k].to_degrees() * 1e6).round() / 1e6;
            assert_eq!(told(Motion::About(axis)), ("deg".to_owned(), deg));
            assert_eq!(told(Motion::Along(axis)), ("mm".to_owned(), [1500.0, -300.0, 200.0][k]));
        }
    }
}
