//! True arms for a virtual cell, drawn by chance.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::choice::ParameterSet;
use trical_ident::rigid::rigid_from_points;
use trical_ident::touches::model_of_touches;
use trical_model::ik::nearest_solution;
use trical_model::pose::{angles_zyx, rotation_x, rotation_z};
use trical_model::{Forward, Joints, MAX_JOINTS, Model, Motion, Parameter, Pose, Site, State};

use super::error::{Result, TruthError};

/// A true arm drawn by chance: errors as arms of this size have them (0.3 mm and 0.1 deg in the chain, more in base and tool,
/// compliances of 0.002 to 0.02 deg/Nm), on the paper's parameters, the twist of axis 3 and nothing else.
///
/// # Errors
/// An arm that makes no sense, or balls that the device does not reach.
pub fn draw_truth(nominal: &Model, seed: u64) -> Result<Model> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut draw = |sd: f64| -> f64 {
        let x: f64 = StandardNormal.sample(&mut rng);
        x * sd
    };
    let mut model = model_of_touches(&nominal.robot, &nominal.cell, ParameterSet::Compliance)?;
    for t in &mut model.terms {
        t.value = match t.site {
            Site::Base(Motion::Along(_)) => draw(0.5e-3),
            Site::Base(Motion::About(_)) => draw(0.05_f64.to_radians()),
            Site::Tool(_) => draw(0.3e-3),
            Site::Link { parameter: Parameter::A | Parameter::D, .. } => draw(0.3e-3),
            Site::Link { .. } => draw(0.1_f64.to_radians()),
            _ => (0.002 + 0.018 * draw(0.5).abs().min(1.0)).to_radians(),
        };
    }
    set_up(&mut model, || draw(0.1e-3))?;
    Ok(model)
}

/// The place of the base as the set-up of a cell leaves it: the three balls are touched once, in one orientation, before
/// anything else (paper, procedure), so that `cell.toml` is right there to about 0.1 mm.
fn set_up(model: &mut Model, mut rest: impl FnMut() -> f64) -> Result<()> {
    let nominal = Forward::new(Model::nominal(model.robot.clone(), model.cell.clone()), Vec::new())?;
    let truth = Forward::new(model.clone(), Vec::new())?;
    let (mut ws, mut true_ws) = (nominal.workspace(), truth.workspace());
    // the first orientation, from vertical to leaning, in which the device reaches all balls
    let home = State::at(&[0.0; MAX_JOINTS]);
    let balls = model.cell.balls.clone();
    let reached = (0..7).find_map(|lean| {
        (0..24).find_map(|turn| {
            let down = rotation_z(f64::from(turn) * 15.0_f64.to_radians())
                * rotation_x((180.0 - 10.0 * f64::from(lean)).to_radians());
            balls
                .iter()
                .map(|ball| {
                    let at = Pose { rotation: down, translation: *ball };
                    nearest_solution(&nominal, &at, &home, &mut ws).ok()
                })
                .collect::<Option<Vec<Joints>>>()
        })
    });
    let Some(reached) = reached else {
        return Err(TruthError::OutOfReach);
    };
    let pairs: Vec<_> = balls
        .iter()
        .zip(&reached)
        .map(|(ball, q)| {
            let seen = truth.world_from_tool(&State::at(q), &mut true_ws).translation;
            (ball + Vector3::new(rest(), rest(), rest()), seen)
        })
        .collect();
    let Some(shift) = rigid_from_points(&pairs) else { return Ok(()) };
    // all links have moved from where they seemed to be: the base with them
    let links = truth.world_from_links(&State::at(&[0.0; MAX_JOINTS]), &mut true_ws);
    let Some(base) = links.first() else { return Ok(()) };
    let base = shift.compose(base);
    let reference = &model.cell.world_from_base;
    let move_by = base.translation - reference.translation;
    let turn_by = angles_zyx(&(base.rotation * reference.rotation.transpose()));
    for t in &mut model.terms {
        match t.site {
            Site::Base(Motion::Along(a)) => t.value = move_by[a.index()],
            Site::Base(Motion::About(a)) => t.value = turn_by[2 - a.index()],
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_data::arm;

    #[test]
    fn a_seed_draws_one_arm_and_another_seed_another_of_the_size_of_real_ones() {
        let values = |seed| -> Vec<(String, f64)> {
            draw_truth(&arm(), seed).unwrap().terms.into_iter().map(|t| (t.name, t.value)).collect()
        };
        let (one, two) = (values(1), values(2));
        assert_eq!(one, values(1));
        assert!(one.iter().zip(&two).all(|(a, b)| a.0 == b.0 && a.1 != b.1));
        let of =
            |start: &str| one.iter().filter(|(n, _)| n.starts_with(start)).map(|(_, v)| v.abs()).collect::<Vec<_>>();
        assert!(of("a_").iter().all(|v| (1e-7..2e-3).contains(v)), "{:?}", of("a_"));
        assert!(of("alpha_").iter().all(|v| (1e-6..0.01).contains(v)), "{:?}", of("alpha_"));
        assert!(of("c_").iter().all(|v| (0.002..0.0201).contains(&v.to_degrees())), "{:?}", of("c_"));
    }

    #[test]
    fn a_cell_that_was_set_up_has_its_balls_where_the_arm_finds_them() {
        let nominal = arm();
        let truth = draw_truth(&nominal, 3).unwrap();
        let [plain, real] = [&nominal, &truth].map(|m| Forward::new(m.clone(), Vec::new()).unwrap());
        let (mut ws, mut real_ws) = (plain.workspace(), real.workspace());
        let home = State::at(&[0.0; MAX_JOINTS]);
        let mut off = Vec::new();
        for ball in &nominal.cell.balls {
            let down = Pose { rotation: rotation_x(std::f64::consts::PI), translation: *ball };
            let Ok(q) = nearest_solution(&plain, &down, &home, &mut ws) else { continue };
            off.push((real.world_from_tool(&State::at(&q), &mut real_ws).translation - ball).norm());
        }
        // a base that nobody had set up would leave a millimetre and more
        assert!(!off.is_empty() && off.iter().all(|v| *v < 0.8e-3), "{off:?}");
    }
}
