//! An arm on a rail as the arm alone, the rail standing somewhere: what a program means that gives the rail a place of its own.

use crate::basis::{Basis, Variable};
use crate::error::Result;
use crate::forward::{Forward, Model};
use crate::recording::State;
use crate::robot::Robot;
use crate::term::{Parameter, Site, Term};

impl Robot {
    /// Whether joint 1 slides and carries an arm all of whose joints turn.
    #[must_use]
    pub fn is_on_rail(&self) -> bool {
        self.dof() > 4 && self.slides(1) && (2..=self.dof()).all(|k| !self.slides(k))
    }
}

impl Model {
    /// The arm that joint 1 carries while that stands at `at` (m, or rad): its joints are counted from 1 again, and its root is where the rail has
    /// brought it, by all that the model knows of the rail. Terms that need the sense or the load of joint 1 are left out.
    ///
    /// # Errors
    /// A model that makes no sense.
    pub fn on_rail(&self, at: f64) -> Result<Self> {
        let mut rail = Self { cell: crate::Cell::bare(), frames: Vec::new(), ..self.clone() };
        rail.terms.retain(|t| is_of_rail(&t.site) && missing_nothing(&t.basis));
        let forward = Forward::new(rail, Vec::new())?;
        let mut ws = forward.workspace();
        let carriage = forward.world_from_joints(&State::at(&[at]), &mut ws).into_iter().next();
        let mut robot = self.robot.clone();
        robot.root_from_zero = carriage.unwrap_or(robot.root_from_zero);
        robot.joints.remove(0);
        let terms = self.terms.iter().filter(|t| !is_of_rail(&t.site)).filter_map(|t| carried(t, at)).collect();
        Ok(Self { robot, terms, ..self.clone() })
    }
}

/// Whether a site belongs to joint 1 and what is before it.
fn is_of_rail(site: &Site) -> bool {
    match site {
        Site::Link { link, parameter } => match parameter {
            Parameter::Alpha | Parameter::A | Parameter::Beta => *link == 0,
            Parameter::Theta | Parameter::D => *link == 1,
        },
        Site::Joint { joint } | Site::Tilt { joint, .. } | Site::Across { joint } => *joint == 1,
        _ => false,
    }
}

fn missing_nothing(basis: &Basis) -> bool {
    let of_load =
        matches!(basis.of, Variable::Moment { .. } | Variable::FootMoment { .. } | Variable::PartMoment { .. });
    !of_load
        && basis.sense.is_none()
        && basis.missing(&State::at(&[]), &crate::Measured::Point { target: 0, position: [0.0; 3] }).is_none()
}

/// A term of the arm with its joints counted from the first that the rail carries.
fn carried(term: &Term, at: f64) -> Option<Term> {
    let mut t = term.clone();
    t.site = match term.site {
        Site::Link { link, parameter } => Site::Link { link: link - 1, parameter },
        Site::Joint { joint } => Site::Joint { joint: joint - 1 },
        Site::Tilt { joint, axis } => Site::Tilt { joint: joint - 1, axis },
        Site::Across { joint } => Site::Across { joint: joint - 1 },
        site => site,
    };
    let less = |joint: usize| joint.checked_sub(1).filter(|j| *j > 0);
    if let Some(beside) = term.basis.beside {
        match less(beside.joint) {
            Some(joint) => t.basis.beside = Some(crate::basis::Beside { joint, ..beside }),
            None => {
                t.value *= beside.shape.at(at).0;
                t.basis.beside = None;
            }
        }
    }
    if let Some(sense) = term.basis.sense {
        t.basis.sense = Some(less(sense)?);
    }
    t.basis.of = match term.basis.of {
        Variable::Joint { joint: 1 } => {
            t.value *= term.basis.shape.at(at).0;
            t.basis.shape = crate::Shape::One;
            Variable::Nothing
        }
        Variable::Joint { joint } => Variable::Joint { joint: less(joint)? },
        Variable::Moment { joint, axis } => Variable::Moment { joint: less(joint)?, axis },
        Variable::FootMoment { joint, axis } => Variable::FootMoment { joint: less(joint)?, axis },
        Variable::PartMoment { joint, axis, share } => Variable::PartMoment { joint: less(joint)?, axis, share },
        Variable::Torque { joint } => Variable::Torque { joint: less(joint)? },
        Variable::Lag { joint } => Variable::Lag { joint: less(joint)? },
        Variable::Inclination { first, last } => Variable::Inclination { first: less(first)?, last: less(last)? },
        other => other,
    };
    Some(t)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{Axis, Cell, Shape};

    const RAIL: &str = r#"<robot name="rail"><link name="f"/><link name="c"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="l4"/>
      <joint name="E1" type="prismatic"><origin xyz="0 0 0"/><axis xyz="-1 0 0"/><parent link="f"/><child link="c"/><limit lower="0" upper="6" effort="0" velocity="1"/></joint>
      <joint name="A1" type="revolute"><origin xyz="0 0 0.4"/><axis xyz="0 0 -1"/><parent link="c"/><child link="l1"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>
      <joint name="A2" type="revolute"><origin xyz="0.6 0 0"/><axis xyz="0 1 0"/><parent link="l1"/><child link="l2"/><limit lower="-2" upper="2" effort="0" velocity="1"/></joint>
      <joint name="A3" type="revolute"><origin xyz="1.4 0 0"/><axis xyz="0 1 0"/><parent link="l2"/><child link="l3"/><limit lower="-2" upper="2" effort="0" velocity="1"/></joint>
      <joint name="A4" type="revolute"><origin xyz="0.3 0.1 0.065"/><axis xyz="-1 0 0"/><parent link="l3"/><child link="l4"/><limit lower="-6" upper="6" effort="0" velocity="1"/></joint></robot>"#;

    #[test]
    fn the_arm_on_the_rail_is_where_the_whole_arm_is() {
        let mut robot = crate::urdf::parse(RAIL, "rail.urdf", None, None).unwrap().robot;
        robot.joints.iter_mut().for_each(|j| j.mass = Some(7.0));
        assert!(robot.is_on_rail());
        let mut model = Model::nominal(robot, Cell::bare());
        let mut add = |site, basis, value| {
            let n = model.terms.len();
            model.terms.push(Term { value, ..Term::new(format!("t{n}"), "geometry", site, basis) });
        };
        let link = |link, parameter| Site::Link { link, parameter };
        add(link(0, Parameter::Alpha), Basis::CONSTANT, 2e-3);
        add(link(1, Parameter::D), Basis::CONSTANT, 3e-3);
        add(link(1, Parameter::Alpha), Basis::CONSTANT, -1e-3);
        add(link(3, Parameter::A), Basis::CONSTANT, 2e-3);
        // scale and yaw of the rail, a joint that turns with where the rail stands, one that gives way, sag, an encoder
        let of = |variable, shape| Basis::new(variable, shape);
        add(Site::Joint { joint: 1 }, of(Variable::Joint { joint: 1 }, Shape::Linear), 1e-4);
        add(Site::Tilt { joint: 1, axis: Axis::Y }, of(Variable::Joint { joint: 1 }, Shape::SignedSquare), 1e-5);
        add(Site::Joint { joint: 2 }, of(Variable::Joint { joint: 1 }, Shape::Linear), 1e-4);
        add(Site::Joint { joint: 3 }, Basis::torque(3, Shape::Linear), 1e-6);
        add(
            Site::Joint { joint: 3 },
            of(Variable::Inclination { first: 3, last: 4 }, Shape::Cosine { cycles: 1.0 }),
            4e-4,
        );
        add(Site::Joint { joint: 5 }, of(Variable::Joint { joint: 5 }, Shape::Sine { cycles: 2.0 }), 1e-3);
        for at in [0.0, 1.7, 5.2] {
            let part = model.on_rail(at).unwrap();
            assert_eq!((part.robot.dof(), part.terms.len()), (4, 6));
            let (a, b) = (Forward::new(model.clone(), Vec::new()).unwrap(), Forward::new(part, Vec::new()).unwrap());
            let (mut wa, mut wb) = (a.workspace(), b.workspace());
            for k in 0..10 {
                let q: Vec<f64> = (0..4).map(|j| 1.5 * (1.1 * f64::from(k) + 0.7 * f64::from(j)).sin()).collect();
                let whole: Vec<f64> = std::iter::once(at).chain(q.iter().copied()).collect();
                let p = a.world_from_tool(&State::at(&whole), &mut wa);
                let r = b.world_from_tool(&State::at(&q), &mut wb);
                let off = (p.translation - r.translation).norm().max((p.rotation - r.rotation).norm());
                // the loads of the whole arm are those before its rail turns
                assert!(off < 1e-9, "at {at}: {off}");
            }
        }
    }
}
