//! The parameters that a plan is to make visible.

use trical_model::{Axis, Basis, JointKind, Motion, Parameter, Robot, Shape, Site, Term};

/// What identification usually asks for, most wanted first: base, tool position, twists, lengths, offsets, and the compliance
/// of each joint where the arm's masses are known.
///
/// For an arm of the IRB 120 kind those of them that are independent are the 31 parameters of the paper; the dependent ones
/// (d_2 beside d_3 of parallel axes, d_6 beside the tool) are left out when the choice is made.
#[must_use]
pub fn usual_parameters(robot: &Robot) -> Vec<Term> {
    let n = robot.dof();
    let constant = |name: String, effect: &str, site| Term::new(name, effect, site, Basis::CONSTANT);
    let mut terms: Vec<Term> = Motion::ALL
        .iter()
        .map(|m| constant(format!("base_{}", m.name()), "base", Site::Base(*m)))
        .chain(Axis::ALL.map(|a| constant(format!("tool_{}", a.name()), "tool", Site::Tool(Motion::Along(a)))))
        .collect();
    let mut link = |letter: &str, link, parameter| {
        terms.push(constant(format!("{letter}_{link}"), "geometry", Site::Link { link, parameter }));
    };
    (1..n).for_each(|k| link("alpha", k, Parameter::Alpha));
    (1..n).for_each(|k| link("a", k, Parameter::A));
    // from the wrist inwards: of parallel axes the outermost offset is kept, as in the paper
    (2..n).rev().for_each(|k| link("d", k, Parameter::D));
    (2..n).for_each(|k| link("theta", k, Parameter::Theta));
    if robot.require_masses().is_ok() {
        for joint in (1..=n).filter(|j| robot.joints[j - 1].kind == JointKind::Revolute) {
            let basis = Basis::torque(joint, Shape::Linear);
            terms.push(Term::new(format!("c_{joint}"), "compliance", Site::Joint { joint }, basis));
        }
    }
    terms
}
