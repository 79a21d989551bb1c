//! The procedure: rejection, baseline, rounds of selection and exact refit, proof, findings.

use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::folds::Folds;
use trical_ident::fit::identify::ErrorSummary;
use trical_ident::fit::residuals::position_errors;
use trical_ident::model_file::Uncertainty;
use trical_model::{Cell, Forward, Robot, Task};

use crate::candidate::Candidate;
use crate::cautions;
use crate::diagnosis::{Baseline, Diagnosis, Final, Grounds};
use crate::findings::noise_of;
use crate::options::Options;
use crate::proving::{Found, Proving};
use crate::rounds::{Rounds, arm_parameters};
use crate::settings::{ROUGHLY_SETTLED, SETTLED_SHARE};
use crate::verdict;

/// Diagnoses recordings of one arm, one session each.
///
/// # Errors
/// As [`trical_ident::fit::identify::identify`].
pub fn diagnose(robot: &Robot, cell: &Cell, data: &Dataset, options: &Options, task: &Task<'_>) -> Result<Diagnosis> {
    task.step(0.0, "checking rows")?;
    let mut rounds = Rounds::begin(robot, cell, data, options)?;
    let baseline = rounds.fitted.model.clone();
    select(&mut rounds, options.names_only, task)?;

    task.step(0.75, "proving")?;
    let unsearched = rounds.fit_whole(&baseline)?;
    rounds.shrink_curves()?;
    let effective = rounds.effective_parameters();
    rounds.fitted = rounds.fitted.with_shared_errors()?;
    let Rounds { kept, fitted, .. } = &rounds;
    let (design, probes) = rounds.design_with_probes(&rounds.fast_waves()?)?;
    let start = design.start();
    let proving = Proving::new(&rounds, &design, &probes, &start)?;
    // of all poses, where a sample was searched
    let all = Folds::of(&fitted.data);
    let of_sessions = rounds.by_session();
    let [plain_by_session, by_session] = *of_sessions.as_ref().unwrap_or(&[None; 2]);
    let of_places = rounds.by_place();
    let [plain_by_place, by_place] = *of_places.as_ref().unwrap_or(&[None; 2]);
    let held_out = proving.held_out(by_session, by_place);
    let usual = held_out.by_block.unwrap_or(ErrorSummary::of(&fitted.errors()?));
    let none = proving.prove(&[]);
    let Found { findings, grounds, mut unexplained, doubted } = proving.findings(none, task)?;
    proving.ask_probes(&mut unexplained, &doubted);

    task.step(0.95, "what the data cannot show")?;
    let errors = fitted.errors()?;
    let before_errors = position_errors(&Forward::new(baseline.clone(), Vec::new())?, &fitted.data);
    let [plain_lack_of_fit, lack_of_fit] = proving.lack_of_fit();
    let cautions = cautions::of(&rounds, robot, &baseline, effective, &all, unsearched.map(|u| u.to_string()))?
        .into_iter()
        .chain(cautions::another_zero(&grounds, &kept.names))
        .chain(cautions::elsewhere("in a session", &of_sessions))
        .chain(cautions::elsewhere("at a place of the balls", &of_places))
        .collect();
    let diagnosis = Diagnosis {
        verdict: verdict::of(
            &findings,
            &unexplained,
            [(arm_parameters(&baseline), none.blocks), (arm_parameters(&fitted.model), usual.rms_mm)],
            verdict::Given { robot, several: kept.names.len() > 1 },
        ),
        baseline: Baseline {
            parameters: arm_parameters(&baseline),
            rms_mm: ErrorSummary::of(&before_errors).rms_mm,
            noise_mm: noise_of(fitted, &errors),
            lack_of_fit_p: plain_lack_of_fit,
            holdout_rms_mm: none.blocks,
            by_session: plain_by_session,
            by_place: plain_by_place,
            reading_noise: rounds.reading_noise().map(Candidate::located).collect(),
        },
        blind_to: proving.blind_to(&findings),
        findings,
        after: Final {
            parameters: arm_parameters(&fitted.model),
            effective_parameters: effective,
            poses: all.poses().len(),
            blocks: all.blocks(),
            rms_mm: ErrorSummary::of(&errors).rms_mm,
            holdout_rms_mm: usual.rms_mm,
            holdout_mean_mm: usual.mean_mm,
            forward_mean_mm: held_out.forward.map_or(0.0, |e| e.mean_mm),
            held_out,
            lack_of_fit_p: lack_of_fit,
        },
        unexplained: (!unexplained.is_empty()).then(|| unexplained.remove(0)),
        more_unexplained: unexplained,
        cautions,
        rejected: fitted.data.rejected.clone(),
        model: fitted.model.clone(),
        uncertainty: Uncertainty::of(fitted).map(|u| {
            let plain = u.noise * ErrorSummary::of(&before_errors).rms_mm / ErrorSummary::of(&errors).rms_mm;
            u.of_effects(plain)
        }),
        data: fitted.data.clone(),
        before: baseline,
        grounds: Grounds {
            noise: fitted.noise.clone(),
            known: rounds.known.clone(),
            findings: grounds,
            sigma: rounds.touch_sigma(),
        },
    };
    task.step(1.0, "done")?;
    Ok(diagnosis)
}

/// Selection; then with rows restored that what was found, or one number more, explains; then with more to choose from where names do not say
/// all, until nothing changes; then only what pays at poses that the fit did not see.
fn select(rounds: &mut Rounds, names_only: bool, task: &Task<'_>) -> Result<()> {
    task.step(0.05, "curves of the joints")?;
    rounds.hold_curves()?;
    let mut is_exact = rounds.settle(true, ROUGHLY_SETTLED, &task.part(0.1, 0.35))?;
    if rounds.let_go_of_curves()? {
        is_exact = rounds.settle(true, ROUGHLY_SETTLED, &task.part(0.3, 0.35))?;
    }
    // with the large effects out of the way
    if rounds.hold_curves()? {
        is_exact = rounds.settle(true, ROUGHLY_SETTLED, &task.part(0.35, 0.45))?;
    }
    if rounds.take_back_rows()? | rounds.restore_rows()? {
        is_exact = rounds.settle(false, ROUGHLY_SETTLED, &task.part(0.45, 0.5))?;
    }
    task.step(0.5, "looking again without names")?;
    if (!names_only && rounds.widen()?) || !is_exact {
        rounds.settle(false, SETTLED_SHARE, &task.part(0.55, 0.7))?;
    }
    task.step(0.7, "what pays at unseen poses")?;
    rounds.release_curves()?;
    rounds.keep_what_pays()?;
    rounds.trade_curves()?;
    rounds.name_waves();
    rounds.name_curves()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Place, Shape, Variable};

    use super::*;
    use crate::diagnosis::{Finding, Unexplained};
    use crate::effect_id::EffectId;
    use crate::settings::{DOUBTED_BELOW, SEARCHED_POSES};
    use crate::test_data::{arm, touched, with_joint_2};

    #[test]
    fn poses_and_blocks_are_those_of_the_whole_data_where_a_sample_was_searched() {
        let (truth, many) = (arm(), SEARCHED_POSES + 400);
        let data = touched(&truth, u32::try_from(many).unwrap());
        let options = Options { names_only: true, ..Options::default() };
        let said = diagnose(&truth.robot, &truth.cell, &data, &options, &Task::silent()).unwrap();
        assert!(said.cautions.iter().any(|c| c.starts_with("effects were searched among")), "{:?}", said.cautions);
        assert_eq!((said.after.poses, said.after.blocks), (many, Folds::of(&data).blocks()));
    }

    #[test]
    fn an_encoders_curve_and_scattered_lines_beyond_it_are_one_finding() {
        let wave = |(cycles, size)| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles }), size);
        let curve = [3.0, 5.0, 7.0, 11.0].map(|cycles| (cycles, 2e-4));
        let hidden = [&curve[..], &[61.0, 88.0, 131.0].map(|cycles| (cycles, 3e-4))].concat().into_iter().map(wave);
        let (truth, data) = with_joint_2(&hidden.collect::<Vec<_>>());
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let found: Vec<(EffectId, &str)> = said
            .findings
            .iter()
            .filter(|f| f.site == Place::Joint(2))
            .map(|f| (f.effect, f.located.as_str()))
            .collect();
        let expected = "a curve of joint 2's own angle that repeats every turn, and single waves of 61, 88 and 131 cycles per turn";
        assert_eq!(found, [(EffectId::EncoderError, expected)]);
    }

    #[test]
    fn an_error_so_steep_that_no_model_can_have_it_is_told_with_its_period() {
        let steep = Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles: 9000.0 });
        let (truth, data) = with_joint_2(&[(steep, 2e-4)]);
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let found = said.unexplained.unwrap();
        assert_eq!((found.site, found.variable.as_str(), found.modelled), (Place::Joint(2), "q2", false));
        assert_eq!(found.region, "all of q2, every 0.0400 deg");
    }

    #[test]
    fn a_sure_curve_is_not_told_again_without_a_name_beside_a_doubted_effect_of_the_same_joint() {
        let wave = |cycles| (Basis::new(Variable::Joint { joint: 2 }, Shape::Sine { cycles }), 4e-4);
        let hidden = [&[2.0, 3.0, 4.0, 7.0].map(wave)[..], &[(Basis::direction(2), -1.3e-5)]].concat();
        let (truth, data) = with_joint_2(&hidden);
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let sure = |f: &Finding| (f.effect, f.confidence > DOUBTED_BELOW);
        let expected = [(EffectId::EncoderError, true), (EffectId::LostMotionDirection, false)];
        assert_eq!(said.findings.iter().map(sure).collect::<Vec<_>>(), expected);
        let again = |u: &&Unexplained| u.site == Place::Joint(2) && u.variable == "q2";
        assert!(!said.unexplained.iter().chain(&said.more_unexplained).any(|u| again(&u)), "{:?}", said.unexplained);
    }

    #[test]
    fn a_finding_lowers_the_error_at_poses_that_were_not_seen_and_what_could_not_be_asked_is_told() {
        let (truth, data) = with_joint_2(&[(Basis::direction(2), -4e-4)]);
        let said = diagnose(&truth.robot, &truth.cell, &data, &Options::default(), &Task::silent()).unwrap();
        let evidence = &said.findings[0].evidence;
        let [before, after] = [evidence.holdout_rms_before_mm, evidence.holdout_rms_after_mm];
        assert!(before == said.baseline.holdout_rms_mm && after < 0.5 * before, "{evidence:?}");
        assert!(said.after.held_out.forward.is_some() && said.findings.len() == 1);
        let [before, after] = [said.baseline.lack_of_fit_p, said.after.lack_of_fit_p];
        assert!(before < 1e-6 && after > 1e-3, "{before} {after}");
        // no thermometer, and a gap could have been seen
        let lacks = |id| said.blind_to.iter().any(|b| b.effect == id && b.lacks.is_some());
        assert!(lacks(EffectId::ThermalGrowth) && !lacks(EffectId::LostMotionDirection));
    }
}
