//! A drive that gives way readily under little torque and stiffens, softly or from one stiffness to the next (as data sheets of
//! strain-wave gears have it), or the other way round. Shapes are scanned;
//! a size is half of what the joint gives way in proportion to its torque, at the torque that it usually bears.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_MASSES, Remedy, Size, turning};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::NonlinearStiffness,
    title: "joint stiffness that changes with the load",
    family: Family::Elasticity,
    scope: Scope::Arm,
    site: "joint",
    form: "D = k tanh(tau_j / T), k clip(tau_j / T), k tau_j |tau_j|, k tau_j^3",
    needs: "masses",
    typical: "15 to 50 % of c tau",
    rivals: "lost_motion_gravity",
    coefficients: &[("stiffness", "deflection that is not in proportion", "")],
    action: "Let the calibrated model correct it.",
    remedy: Remedy::SignOfTorque,
    follows_torque: true,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let mut out = Vec::new();
    for joint in turning(r) {
        let load = r.load(joint);
        let usual = r.compliance(joint) * load;
        let shapes = [
            ("square", Shape::SignedSquare),
            ("cube", Shape::Cube),
            ("soft_sixth", Shape::SoftSign { scale: load / 6.0 }),
            ("soft_third", Shape::SoftSign { scale: load / 3.0 }),
            ("soft_two_thirds", Shape::SoftSign { scale: load / 1.5 }),
            ("soft", Shape::SoftSign { scale: 1.25 * load }),
            ("soft_twice", Shape::SoftSign { scale: 2.5 * load }),
            ("kink_third", Shape::Clip { at: load / 3.0 }),
            ("kink_half", Shape::Clip { at: load / 2.0 }),
            ("kink_two_thirds", Shape::Clip { at: load / 1.5 }),
            ("kink_below", Shape::Clip { at: 0.85 * load }),
            ("kink", Shape::Clip { at: load }),
            ("kink_above", Shape::Clip { at: 1.2 * load }),
        ];
        for (name, shape) in shapes {
            let at_load = shape.at(load).0.abs();
            out.push(EFFECT.candidate(
                Place::Joint(joint),
                format!("joint {joint}'s deflection is not proportional to its torque"),
                Size { typical: 0.25 * usual / at_load, large: 0.5 * usual / at_load },
                vec![(format!("stiffness_{name}_{joint}"), Site::Joint { joint }, Basis::torque(joint, shape), 0)],
            ));
        }
    }
    out.into()
}
