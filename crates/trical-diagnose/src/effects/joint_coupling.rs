//! One joint moves another: bevel gears of a wrist (5 by 4, 6 by 5, 6 by 4), a parallelogram (3 by 2).

use std::collections::BTreeSet;

use trical_model::{Basis, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Remedy, Size};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::JointCoupling,
    title: "coupling between joints",
    family: Family::Transmission,
    scope: Scope::Arm,
    site: "joint, from",
    form: "wrist gears, parallelogram: D = k q_i for joint 5 with 4, 6 with 5, 6 with 4, 3 with 2; on a rail also one joint further on",
    needs: "-",
    typical: "2e-4 to 2e-3",
    rivals: "gear_ratio",
    coefficients: &[("coupling", "coupling factor", "")],
    action: "Correct the coupling factor in the controller, or let the calibrated model do so.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

/// Of an arm that stands still. On a rail they are one further on; those that are counted with the rail's joint are asked too, since a drive may
/// run through any joint before.
const PAIRS: [(usize, usize); 4] = [(5, 4), (6, 5), (6, 4), (3, 2)];

fn ask(r: &Covariates<'_>) -> Asked {
    let of = |(joint, from)| {
        let basis = Basis::new(Variable::Joint { joint: from }, Shape::Linear);
        EFFECT.candidate(
            Place::Coupling { joint, from },
            format!("joint {joint} moves in proportion to joint {from}'s angle"),
            Size { typical: 8e-4, large: 2e-3 },
            vec![(format!("coupling_{joint}_from_{from}"), Site::Joint { joint }, basis, 0)],
        )
    };
    let pairs: BTreeSet<(usize, usize)> = (0..=usize::from(r.model.robot.is_on_rail()))
        .flat_map(|rail| PAIRS.map(|(joint, from)| (joint + rail, from + rail)))
        .collect();
    pairs.into_iter().filter(|p| p.0 <= r.dof()).map(of).collect::<Vec<_>>().into()
}
