//! What a plan could not show: the length of each effect's signature over the planned touches, known before any is measured.

use serde_json::{Value, json};
use trical_diagnose::EffectId;
use trical_diagnose::catalogue::catalogue;
use trical_diagnose::covariates::Covariates;
use trical_diagnose::effects::ripple;
use trical_diagnose::linear::Design;
use trical_ident::Noise;
use trical_ident::touches::planned;
use trical_model::{Forward, Measured, Model, Place, State};
use trical_plan::PlanEntry;

use crate::error::Result;

/// Signatures below this many standard deviations are not seen.
pub const VISIBLE: f64 = 3.0;
/// Time of one touch, s (paper: a fix costs about 20 s).
const TOUCH_TIME: f64 = 20.0;
/// Of the frequencies that a gear's ripple may have, cycles per turn, some are looked at: they differ little.
const RIPPLES: [f64; 3] = [31.0, 100.0, 241.0];

/// An effect at a place, and how visible it would be.
pub struct Seen {
    /// Which.
    pub effect: EffectId,
    /// Where.
    pub site: Place,
    /// Length of the signature of a typical size after the parameters have taken up what they can, in standard deviations of
    /// the noise; the most visible form of the effect.
    pub lambda: f64,
    /// What would make it visible.
    pub remedy: &'static str,
}

/// An effect, and what recordings lack to show it.
pub type Lacking = (EffectId, &'static str);

/// What measurements of a plan would see: every effect of the catalogue that such a recording could be asked about, and the
/// effects that it could not, with what is missing. `model` has the terms that are to be identified; `noise` in m.
pub fn seen(model: &Model, plan: &[PlanEntry], noise: f64) -> Result<(Vec<Seen>, Vec<Lacking>)> {
    let touch = |(k, e): (usize, &PlanEntry)| {
        let t = Some(TOUCH_TIME * (k + 1) as f64);
        (State { dir: Some(e.senses()), t, ..State::at(&e.joints) }, e.ball)
    };
    let data = planned(&model.robot, plan.iter().enumerate().map(touch))?;
    let (mut candidates, untestable) = catalogue(&Covariates::new(model, &data, noise), &[]);
    let joints = model.robot.dof();
    candidates.extend((1..=joints).flat_map(|joint| RIPPLES.map(|cycles| ripple(joint, cycles, joints))));
    let weights = Noise::usual(1);
    let sigma = weights.sigma(0, &Measured::Touch { ball: 0, reading: [0.0; 3] }, 0);
    let design = Design::new(model, &candidates, &data, &weights)?;
    let state = design.start();
    let no_torque = no_torque(model, plan)?;
    let mut all: Vec<Seen> = Vec::new();
    for (k, c) in candidates.iter().enumerate() {
        let Some(id) = c.cause.effect() else { continue };
        let lambda = design.lambda_of_size(&state, k, c.typical) * sigma / noise;
        match all.iter_mut().find(|s| s.effect == id && s.site == c.site) {
            Some(s) => s.lambda = s.lambda.max(lambda),
            None => {
                let upright = c.site.joint().is_some_and(|j| no_torque.get(j.wrapping_sub(1)) == Some(&true));
                let effect = id.effect();
                let remedy = if upright && effect.follows_torque { UPRIGHT } else { effect.remedy.words() };
                all.push(Seen { effect: id, site: c.site, lambda, remedy });
            }
        }
    }
    Ok((all, untestable.into_iter().map(|u| (u.effect, u.lacks)).collect()))
}

/// Where gravity has no moment about an axis.
const UPRIGHT: &str = "nothing (and not needed: gravity has no torque about this axis)";

/// For each joint, whether gravity has no moment about its axis at any of the touches.
fn no_torque(model: &Model, plan: &[PlanEntry]) -> Result<Vec<bool>> {
    let n = model.robot.dof();
    if model.robot.require_masses().is_err() {
        return Ok(vec![false; n]);
    }
    let forward = Forward::new(Model::nominal(model.robot.clone(), model.cell.clone()), Vec::new())?;
    let mut ws = forward.workspace();
    let mut most = vec![0.0_f64; n];
    for e in plan {
        let torques = forward.gravity_torques(&State::at(&e.joints), &mut ws)?;
        most.iter_mut().zip(&torques).for_each(|(m, t)| *m = m.max(t.abs()));
    }
    Ok(most.into_iter().map(|m| m < 1e-6).collect())
}

/// The effects that would not be seen, each with its sites and their lambda, by what would help.
pub fn advice(seen: &[Seen]) -> Vec<(String, String)> {
    type Sites = (EffectId, Vec<String>);
    let mut list: Vec<(&'static str, Vec<Sites>)> = Vec::new();
    for s in seen.iter().filter(|s| s.lambda < VISIBLE) {
        let k = list.iter().position(|l| l.0 == s.remedy).unwrap_or_else(|| {
            list.push((s.remedy, Vec::new()));
            list.len() - 1
        });
        let effects = &mut list[k].1;
        let k = effects.iter().position(|e| e.0 == s.effect).unwrap_or_else(|| {
            effects.push((s.effect, Vec::new()));
            effects.len() - 1
        });
        effects[k].1.push(format!("{}: {:.1}", s.site, s.lambda));
    }
    list.into_iter()
        .map(|(remedy, effects)| {
            let named = |(e, sites): &Sites| format!("{} ({})", e.effect().title, sites.join(", "));
            let what: Vec<String> = effects.iter().map(named).collect();
            (remedy.to_owned(), what.join("; "))
        })
        .collect()
}

/// How many effects would not be seen at one place or more, those included that no such recording shows.
pub fn count(seen: &[Seen], lacking: &[Lacking]) -> usize {
    let faint = seen.iter().filter(|s| s.lambda < VISIBLE).map(|s| s.effect);
    let mut hidden: Vec<EffectId> = faint.chain(lacking.iter().map(|l| l.0)).collect();
    hidden.sort_unstable();
    hidden.dedup();
    hidden.len()
}

/// As `docs/formats.md` has it.
pub fn blind_json(seen: &[Seen], lacking: &[Lacking]) -> Vec<Value> {
    seen.iter()
        .filter(|s| s.lambda < VISIBLE)
        .map(|s| json!({ "effect": s.effect, "site": s.site, "lambda": s.lambda, "advice": s.remedy }))
        .chain(lacking.iter().map(|(effect, lacks)| json!({ "effect": effect, "lambda": 0.0, "lacks": lacks })))
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::{arm, pose};
    use trical_model::{Axis, Basis, Motion, Site, Term};

    fn plan() -> Vec<PlanEntry> {
        let of = |k: u8| PlanEntry {
            index: k.into(),
            ball: usize::from(k % 3),
            joints: pose(k).q,
            approach: pose(k + 100).q,
            via: Vec::new(),
        };
        (0..30).map(of).collect()
    }

    /// The parameters of a tool, so that something is taken up.
    fn model() -> Model {
        let mut model = arm();
        let term =
            |a: Axis| Term::new(format!("tool_{}", a.name()), "tool", Site::Tool(Motion::Along(a)), Basis::CONSTANT);
        model.terms = Axis::ALL.map(term).to_vec();
        model
    }

    #[test]
    fn twice_the_noise_hides_twice_as_well_and_what_a_tool_takes_up_is_not_seen() {
        let (quiet, lacking) = seen(&model(), &plan(), 1e-5).unwrap();
        let (loud, _) = seen(&model(), &plan(), 2e-5).unwrap();
        assert!(!quiet.is_empty());
        for (a, b) in quiet.iter().zip(&loud) {
            assert!(
                (a.effect, a.site) == (b.effect, b.site) && (a.lambda - 2.0 * b.lambda).abs() <= 1e-9 * a.lambda,
                "{}",
                a.lambda
            );
        }
        // each effect once at each place, and those that a plan cannot have said
        for (k, a) in quiet.iter().enumerate() {
            assert!(quiet[..k].iter().all(|b| (a.effect, a.site) != (b.effect, b.site)));
        }
        let words = serde_json::to_string(&blind_json(&loud, &lacking)).unwrap();
        assert!(words.contains("\"lacks\"") && !words.contains(":null"), "{words}");
    }

    /// The most visible of the ripples that are looked at, for each joint by itself.
    #[test]
    fn of_the_forms_of_an_effect_at_a_place_the_most_visible_counts() {
        let (model, plan, noise) = (model(), plan(), 1e-5);
        let touch = |e: &PlanEntry| (State::at(&e.joints), Measured::Touch { ball: e.ball, reading: [0.0; 3] });
        let data = crate::test_data::data(&[plan.iter().map(touch).collect()]);
        let all = seen(&model, &plan, noise).unwrap().0;
        for joint in 1..=6 {
            let forms = RIPPLES.map(|cycles| ripple(joint, cycles, 6));
            let design = Design::new(&model, &forms, &data, &Noise::usual(1)).unwrap();
            let state = design.start();
            // the usual noise of an indicator is that of this plan
            let most = (0..3).map(|k| design.lambda_of_size(&state, k, forms[k].typical)).fold(0.0, f64::max);
            let own: Vec<f64> = all
                .iter()
                .filter(|s| s.effect == EffectId::GearRipple && s.site == Place::Joint(joint))
                .map(|s| s.lambda)
                .collect();
            assert!(own.len() == 1 && (own[0] - most).abs() <= 1e-9 * most, "joint {joint}: {own:?} {most}");
        }
    }

    #[test]
    fn gravity_has_no_torque_about_the_upright_axis_alone() {
        let model = model();
        assert_eq!(no_torque(&model, &plan()).unwrap(), [true, false, false, false, false, false]);
        let mut light = model.clone();
        light.robot.joints.iter_mut().for_each(|j| j.mass = None);
        assert_eq!(no_torque(&light, &plan()).unwrap(), [false; 6]);
        let upright = seen(&model, &plan(), 1e-5).unwrap().0;
        let told = |joint: usize| upright.iter().any(|s| s.site == Place::Joint(joint) && s.remedy == UPRIGHT);
        assert!(told(1) && !told(2));
    }

    #[test]
    fn what_is_hidden_is_told_by_what_would_help_and_counted_once_an_effect() {
        let of = |effect, joint, lambda, remedy| Seen { effect, site: Place::Joint(joint), lambda, remedy };
        let list = [
            of(EffectId::LostMotionDirection, 1, 2.9, "more"),
            of(EffectId::LostMotionDirection, 2, 3.0, "more"),
            of(EffectId::GearRatio, 3, 0.2, "other"),
            of(EffectId::LostMotionDirection, 4, 1.0, "more"),
            of(EffectId::GearRatio, 5, 0.1, "more"),
        ];
        let told = advice(&list);
        assert_eq!(told.len(), 2);
        let [lost, ratio] = [EffectId::LostMotionDirection, EffectId::GearRatio].map(|e| e.effect().title);
        assert_eq!(told[0], ("more".into(), format!("{lost} (joint 1: 2.9, joint 4: 1.0); {ratio} (joint 5: 0.1)")));
        assert_eq!(told[1], ("other".into(), format!("{ratio} (joint 3: 0.2)")));
        assert_eq!((count(&list, &[]), blind_json(&list, &[]).len()), (2, 4));
        assert_eq!(count(&list, &[(EffectId::GearRatio, "x"), (EffectId::Payload, "y")]), 3);
    }
}
