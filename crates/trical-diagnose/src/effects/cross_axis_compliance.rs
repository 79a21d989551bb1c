//! Bearing and link give way across the axis: a rotation about a point of it, in proportion to the moment there. The point may be the
//! joint's origin, its foot or between them; at joint 1 it is the foot, since base and table are what gives way.

use trical_model::{Axis, Basis, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, NO_MASSES, Pivot, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::CrossAxisCompliance,
    title: "bearing or link that tilts under load",
    family: Family::Elasticity,
    scope: Scope::Arm,
    site: "joint",
    form: "bearing and link give way across the axis: rotation k M_perp about the joint's origin, its foot or between (joint 1: base and table, its foot)",
    needs: "masses",
    typical: "1e-5 to 4e-4 rad/Nm on a small arm, less on one that carries more",
    rivals: "payload, axis_wobble; mostly absorbed by the geometry",
    coefficients: &[("cross", "tilt for each Nm", "")],
    action: "Tighten the bolts of base and bearing, and have the bearing checked.",
    remedy: Remedy::SignOfTorque,
    follows_torque: false,
    ask,
};

/// Shares of the way from the origin to the foot at which a tilt is tried; finer ones where one of these is chosen.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let of = |joint, name: &str, place: &str, moment| {
        let basis = Basis::new(moment, Shape::Linear);
        EFFECT.candidate(
            Place::Joint(joint),
            format!("the gravity moment across axis {joint} tilts it{place}"),
            Size { typical: 5e-5 / r.strength(), large: 4e-4 / r.strength() },
            vec![(format!("cross_{name}{joint}"), Site::Across { joint }, basis, 1)],
        )
    };
    let axis = Axis::X;
    let mut out = Vec::new();
    for joint in r.joints() {
        let pivots = Pivot::of(r, joint);
        // base and table give way at the foot, whatever else may
        for pivot in if joint == 1 { &pivots[pivots.len() - 1..] } else { pivots } {
            let moment = match pivot {
                Pivot::Origin => Variable::Moment { joint, axis },
                Pivot::Foot => Variable::FootMoment { joint, axis },
            };
            out.push(of(joint, pivot.name(), pivot.words(), moment));
        }
        if joint > 1 && pivots.len() > 1 {
            out.extend(BETWEEN.map(|share| {
                let moment = Variable::PartMoment { joint, axis, share };
                of(joint, "between_", "", moment).with_share(share)
            }));
        }
    }
    out.into()
}
