//! Friction that grows with the load: the joint stops short, more so the more it bears.

use trical_model::{Basis, Place, Scope, Shape, Site};

use super::effect::{Asked, Effect, Family, NO_MASSES, NO_SENSE, Remedy, arcsec, turning};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::LoadFriction,
    title: "friction that grows with the load",
    family: Family::LostMotion,
    scope: Scope::Arm,
    site: "joint",
    form: "stops short, more under load: D = -d_j (b + k |tau_j|)",
    needs: "sense of motion, masses",
    typical: "2 to 120 arcsec",
    rivals: "lost_motion_direction",
    coefficients: &[("friction_by_load", "wind-up for each Nm of load", ""), ("friction", "wind-up without load", "")],
    action: "Have lubrication and preload checked, or let programs approach from one side.",
    remedy: Remedy::BothSenses,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.direction {
        return Asked::lacking(NO_SENSE);
    }
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let of = |joint| {
        let at = Site::Joint { joint };
        let load = Basis { sense: Some(joint), ..Basis::torque(joint, Shape::Absolute) };
        let by_load = (format!("friction_by_load_{joint}"), at, load, -1);
        let always = (format!("friction_{joint}"), at, Basis::direction(joint), -1);
        let size = arcsec(30.0);
        // an axis that gravity does not turn has no load: what is left of the effect is another one
        let (scales, parts) = if r.unloaded(joint) {
            (vec![size / r.load(joint)], vec![by_load])
        } else {
            (vec![size, size / r.load(joint)], vec![always, by_load])
        };
        let located = format!("changes sign with the sense of joint {joint}'s last motion, and grows with its load");
        EFFECT.candidate_of_scales(Place::Joint(joint), located, arcsec(15.0), scales, parts)
    };
    turning(r).map(of).collect::<Vec<_>>().into()
}
