//! Mass or centre of gravity of the tool are not what the cell file says: every joint gives way accordingly.

use trical_model::{Axis, Basis, Payload, Place, Scope, Site};

use super::effect::{Asked, Effect, Family, NO_MASSES, Part, Remedy};
use crate::candidate::Physical;
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::Payload,
    title: "wrong load on the flange",
    family: Family::Load,
    scope: Scope::Setup,
    site: "tool",
    form: "wrong mass or centre of gravity: D_i = c_i (dtau_i/dm, dtau_i/d(m r))",
    needs: "masses",
    typical: "0.2 to 1 kg, 10 to 50 mm",
    rivals: "compliance, cross_axis_compliance",
    coefficients: &[
        ("payload_mass", "mass beyond that in cell.toml", ""),
        ("payload_moment", "mass times distance beyond that in cell.toml", "along"),
    ],
    action: "Weigh the tool; correct cell.toml and the controller.",
    remedy: Remedy::KnownPayload,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let mut parts: Vec<Part> = vec![("payload_mass".into(), Site::Payload(Payload::Mass), Basis::CONSTANT, 0)];
    parts.extend(
        Axis::ALL
            .iter()
            .map(|a| (format!("payload_moment_{}", a.name()), Site::Payload(Payload::Moment(*a)), Basis::CONSTANT, 0)),
    );
    let mut candidate = EFFECT.candidate_of_scales(
        Place::Tool,
        "the load on the flange differs from that in cell.toml".into(),
        0.03,
        // kg; kg m
        vec![0.5 * r.strength(), 0.05 * r.strength(), 0.05 * r.strength(), 0.05 * r.strength()],
        parts,
    );
    // no tool weighs less than nothing
    let tool = r.model.cell.tool.mass;
    candidate.physical = Physical::when(move |c| c.first().is_none_or(|mass| *mass >= -tool));
    vec![candidate].into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::with_joint_2;

    #[test]
    fn a_flange_that_would_pull_upward_is_no_load() {
        let (truth, data) = with_joint_2(&[]);
        let asked = ask(&Covariates::new(&truth, &data, 1e-5)).candidates;
        let tool = truth.cell.tool.mass;
        let allows = |mass: f64| asked[0].physical.allows(&[mass, 0.0, 0.0, 0.0]);
        assert!(tool > 0.0 && allows(2.0) && allows(-0.9 * tool) && !allows(-1.1 * tool));
    }
}
