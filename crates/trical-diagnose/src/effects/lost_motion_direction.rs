//! Friction winds the drive up, or teeth change flank with the sense of motion: the joint stops short by half a gap.

use trical_model::{Basis, Place, Scope, Site};

use super::effect::{Asked, Effect, Family, NO_SENSE, Remedy, Size, arcsec};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::LostMotionDirection,
    title: "backlash or friction wind-up",
    family: Family::LostMotion,
    scope: Scope::Arm,
    site: "joint",
    form: "friction wind-up, backlash: D = -(b/2) d_j",
    needs: "sense of motion",
    typical: "b 2 to 120 arcsec",
    rivals: "load_friction; invisible if every approach has one sense",
    coefficients: &[("half_gap", "half of the gap", "")],
    action: "Have the gear's preload checked, or let programs approach from one side.",
    remedy: Remedy::BothSenses,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.direction {
        return Asked::lacking(NO_SENSE);
    }
    let of = |joint| {
        EFFECT.candidate(
            Place::Joint(joint),
            format!("changes sign with the sense of joint {joint}'s last motion"),
            Size { typical: arcsec(15.0), large: arcsec(60.0) },
            vec![(format!("half_gap_{joint}"), Site::Joint { joint }, Basis::direction(joint), -1)],
        )
    };
    r.joints().map(of).collect::<Vec<_>>().into()
}
