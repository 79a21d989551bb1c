//! Effects of the catalogue, hidden in a virtual arm.

use trical_ident::dataset::{Dataset, JointSource};
use trical_model::{Joints, MAX_JOINTS, Measured, Model, Place, Recording, Row, Shape, State, Term, trig};

use super::error::{Result, TruthError};
use crate::candidate::Candidate;
use crate::catalogue::catalogue;
use crate::covariates::Covariates;
use crate::diagnosis::Coefficient;
use crate::effect_id::{Cause, EffectId};
use crate::effects::ripple;
use crate::findings::coefficient;

/// Adds to a model what is asked for: `effect`, `effect@site`, `effect@site*size`, where size is in typical sizes
/// and may be negative. For ripples the site is `joint/cycles`, for steps `site/seconds`.
///
/// # Errors
/// An effect or a site that the catalogue does not have.
pub fn hide(model: &mut Model, wishes: &[String]) -> Result<()> {
    let candidates = all(model)?;
    for wish in wishes {
        let (name, size) = match wish.split_once('*') {
            Some((name, size)) => {
                let size = size.parse().ok().filter(|s: &f64| s.is_finite());
                (name, size.ok_or_else(|| wrong(wish, "a number behind *", &candidates))?)
            }
            None => (wish.as_str(), 1.0),
        };
        let (effect, site) = name.split_once('@').map_or((name, None), |(e, s)| (e, Some(s)));
        let (site, detail) =
            site.map_or((None, None), |s| s.split_once('/').map_or((Some(s), None), |(a, b)| (Some(a), Some(b))));
        let detail: Option<f64> =
            detail.map(|d| d.parse().map_err(|_| wrong(wish, "a number behind /", &candidates))).transpose()?;
        let found = if EffectId::named(effect) == Some(EffectId::GearRipple) {
            let joint = site.and_then(|s| s.parse().ok()).filter(|j| (1..=model.robot.dof()).contains(j));
            let joint = joint.ok_or_else(|| TruthError::Wish {
                wish: wish.clone(),
                problem: format!("expected gear_ripple@JOINT/CYCLES; the arm has joints 1 to {}", model.robot.dof()),
            })?;
            ripple(joint, detail.unwrap_or(100.0), model.robot.dof())
        } else {
            let id = EffectId::named(effect).map(Cause::Effect);
            let found = candidates.iter().find(|c| Some(c.cause) == id && site.is_none_or(|s| c.site.is_called(s)));
            let found = found.ok_or_else(|| wrong(wish, "EFFECT@SITE", &candidates))?;
            match (found.step(), detail) {
                (Some(_), Some(at)) => found.with_shape(Shape::Step { at }),
                _ => found.clone(),
            }
        };
        model.terms.extend(terms(&found, size));
    }
    Ok(())
}

/// The effects of the catalogue that a model has, each with its place and its coefficients: what is hidden in a true arm.
#[must_use]
pub fn hidden_in(model: &Model) -> Vec<(EffectId, Place, Vec<Coefficient>)> {
    let candidates = all(model).unwrap_or_default();
    let mut found: Vec<(EffectId, Place, Vec<Coefficient>)> = Vec::new();
    for term in &model.terms {
        let Some(effect) = EffectId::named(&term.effect) else { continue };
        let asked = candidates.iter().find(|c| c.terms.iter().any(|t| t.does_as(term)));
        let place = asked.map_or_else(|| Place::of(&term.site), |c| c.site);
        match found.iter_mut().find(|(e, p, _)| (*e, *p) == (effect, place)) {
            Some((_, _, coefficients)) => coefficients.push(coefficient(&model.robot, term)),
            None => found.push((effect, place, vec![coefficient(&model.robot, term)])),
        }
    }
    found
}

/// Terms of a typical size, each by its own scale.
fn terms(c: &Candidate, size: f64) -> impl Iterator<Item = Term> {
    let first = c.scales.first().copied().unwrap_or(1.0);
    c.terms.iter().zip(c.signs.iter().zip(&c.scales)).map(move |(term, (sign, scale))| {
        let sign = if *sign < 0 { -1.0 } else { 1.0 };
        Term { value: size * sign * c.typical * scale / first, ..term.clone() }
    })
}

fn wrong(wish: &str, expected: &str, candidates: &[Candidate]) -> TruthError {
    let says = |problem: String| TruthError::Wish { wish: wish.to_owned(), problem };
    let effect = wish.split(['@', '*']).next().unwrap_or_default();
    let mut sites: Vec<String> =
        candidates.iter().filter(|c| c.cause.name() == effect).map(|c| c.site.to_string()).collect();
    if !sites.is_empty() {
        sites.sort();
        sites.dedup();
        return says(format!("expected {expected}; this arm can have {effect} at {}", sites.join(", ")));
    }
    let mut names: Vec<&str> = candidates.iter().map(|c| c.cause.name()).collect();
    names.push(EffectId::GearRipple.name());
    names.sort_unstable();
    names.dedup();
    says(format!("no such effect; known are {}", names.join(", ")))
}

/// Every candidate of the catalogue: it is asked with a recording that has all that one can have.
fn all(model: &Model) -> Result<Vec<Candidate>> {
    let dof = model.robot.dof();
    let rows = (0..60_u32)
        .map(|k| {
            let turn = f64::from(k);
            let lag = |joint: usize| if (k as usize + joint).is_multiple_of(2) { 1e-4 } else { -1e-4 };
            let mut q: Joints = [0.0; MAX_JOINTS];
            let mut commanded = q;
            let mut dir = [0; MAX_JOINTS];
            for joint in 0..dof {
                q[joint] = 0.7 * trig::sin(turn * (1.0 + 0.13 * joint as f64));
                commanded[joint] = q[joint] + lag(joint);
                dir[joint] = if lag(joint) > 0.0 { 1 } else { -1 };
            }
            let state = State {
                q,
                q_commanded: Some(commanded),
                dir: Some(dir),
                t: Some(60.0 * turn),
                seq: Some(turn),
                temp_c: Some(20.0 + 0.1 * turn),
                payload_kg: Some(0.0),
                ..State::at(&[])
            };
            let reading = [trig::sin(turn) * 2e-3, trig::sin(1.7 * turn) * 2e-3, trig::cos(2.3 * turn) * 2e-3];
            let measured = Measured::Touch { ball: k as usize % model.cell.balls.len().max(1), reading };
            Row { state, measured, seq: None, line: 0 }
        })
        .collect();
    let recording = Recording { name: "catalogue".into(), joints: dof, rows, ..Recording::default() };
    let data = Dataset::build(&[recording], JointSource::Read, None)?;
    // poses enough for a curve of many waves: what can be hidden does not go by what these could show
    let mut covariates = Covariates::new(model, &data, 1e-5);
    covariates.poses = 600;
    Ok(catalogue(&covariates, &[]).0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use trical_model::{Axis, Cell, Robot};

    fn model() -> Model {
        let robot = Robot::parse(include_str!("../../../../cells/irb120/robot.toml"), "robot.toml").unwrap();
        let cell = Cell::parse(include_str!("../../../../cells/irb120/cell.toml"), "cell.toml").unwrap();
        Model::nominal(robot, cell)
    }

    #[test]
    fn every_effect_of_the_list_can_be_hidden_and_moves_the_tool_or_the_reading() {
        let list = include_str!("../../../../docs/effects.md");
        let names: Vec<&str> = list.lines().filter_map(|l| l.strip_prefix("| `")?.split('`').next()).collect();
        assert!(names.len() > 20, "{names:?}");
        // two are not the arm's (see what they are refused with), and this arm has no rail
        for name in names.into_iter().filter(|n| !["late_joint_reading", "frame_drift", "rail_error"].contains(n)) {
            let mut with = model();
            let before = with.terms.len();
            hide(&mut with, &[name.to_owned()]).or_else(|_| hide(&mut with, &[format!("{name}@3")])).unwrap();
            assert!(with.terms[before..].iter().any(|t| t.value != 0.0 && t.effect == name), "{name}");
        }
    }

    #[test]
    fn sites_sizes_and_steps() {
        let mut with = model();
        let wishes = ["lost_motion_direction@3*2", "joint_zero_shift@2/600*-1", "gear_ripple@4/100"];
        hide(&mut with, &wishes.map(String::from)).unwrap();
        let of = |effect: &str| with.terms.iter().filter(|t| t.effect == effect).cloned().collect::<Vec<_>>();
        assert_eq!(of("gear_ripple").len(), 2);
        assert!(
            of("joint_zero_shift")[0].value < 0.0 && format!("{:?}", of("joint_zero_shift")[0].basis).contains("600")
        );
        assert!(format!("{:?}", of("lost_motion_direction")[0].site).contains('3'));
        hide(&mut with, &["joint_coupling@3".into(), "indicator_drift@y".into()]).unwrap();
        let places: Vec<Place> = hidden_in(&with).iter().map(|(_, place, _)| *place).skip(3).collect();
        assert_eq!(places, [Place::Coupling { joint: 3, from: 2 }, Place::Axis(Axis::Y)]);
        let (effect, place, coefficients) = hidden_in(&with).remove(0);
        assert_eq!((effect, place, coefficients.len()), (EffectId::LostMotionDirection, Place::Joint(3), 1));
        assert!(coefficients[0].value > 0.0 && coefficients[0].unit == "deg", "{coefficients:?}");
        let says = |wish: &str| hide(&mut model(), &[wish.to_owned()]).unwrap_err().to_string();
        assert!(says("backlash").contains("known are") && says("backlash").contains("lost_motion_direction"));
        assert!(says("lost_motion_direction@9").contains("at joint 1, joint 2"));
        assert!(says("gear_ripple@9").contains("the arm has joints 1 to 6"), "{}", says("gear_ripple@9"));
        assert!(says("lost_motion_direction*x").contains("a number behind *"));
    }
}
