use trical_model::Scope;

use super::*;
use crate::diagnosis::{Evidence, Rival};
use crate::probability::Replicated;
use crate::test_data::arm;

fn finding(effect: EffectId, joint: usize, [place, family, name]: [f64; 3], [before, after]: [f64; 2]) -> Finding {
    let described = effect.effect();
    Finding {
        effect,
        site: Place::Joint(joint),
        located: String::new(),
        family: described.family,
        scope: described.scope,
        session: None,
        between_two: false,
        confidence: name,
        place_confidence: place,
        family_confidence: family,
        share: 0.1,
        replicated: Replicated::default(),
        summary: String::new(),
        action: described.action,
        corrected: described.scope == Scope::Arm,
        lambda: 9.0,
        coefficients: Vec::new(),
        evidence: Evidence {
            delta_bic: 20.0,
            p_value: 0.0,
            holdout_rms_before_mm: before,
            holdout_rms_after_mm: after,
            forward_rms_before_mm: before,
            forward_rms_after_mm: after,
        },
        rivals: vec![Rival { effect: EffectId::LoadFriction, site: Place::Joint(joint), delta_bic: 1.0 }],
        next_measurements: None,
    }
}

const SURE: [f64; 3] = [0.99; 3];

fn told(findings: &[Finding], unexplained: &[Unexplained], models: [(usize, f64); 2]) -> Verdict {
    of(findings, unexplained, models, Given { robot: &arm().robot, several: false })
}

#[test]
fn where_nothing_is_found_nothing_is_claimed_of_the_model() {
    // 59 mm are left where a recording does not say which target it measured
    for left in [0.006, 59.3] {
        let verdict = told(&[], &[], [(15, left); 2]);
        assert_eq!(verdict.summary, "Nothing found: no known effect shows in what is left.");
        let row = verdict.rows.last().map(|r| (r.text.as_str(), r.after_mm));
        assert_eq!(row, Some(("Nothing found: no known effect shows in what is left", left)));
    }
}

#[test]
fn what_likely_findings_do_not_take_of_the_error_has_no_name() {
    let likely = finding(EffectId::GearRatio, 2, SURE, [0.05, 0.02]);
    let of = |share| {
        let verdict = told(&[Finding { share, ..likely.clone() }], &[], [(15, 0.05), (16, 0.02)]);
        [verdict.named_share, verdict.unnamed_share]
    };
    assert_eq!([of(0.7), of(1.0)], [[0.7, 0.3], [1.0, 0.0]]);
    let nothing = told(&[], &[], [(15, 0.05); 2]);
    assert_eq!([nothing.named_share, nothing.unnamed_share], [0.0, 0.0]);
}

#[test]
fn an_error_that_grows_over_all_poses_is_not_told_as_a_gain() {
    let said = |errors| summary(&finding(EffectId::GearRatio, 2, SURE, errors));
    assert!(said([0.5, 0.3]).ends_with(
        "with it in the model the error at poses that the fit did not see goes from 0.500 to 0.300 mm rms."
    ));
    // as many digits as a verdict has
    assert!(said([0.0279, 0.0056]).ends_with("from 0.0279 to 0.0056 mm rms."));
    let more = said([1.312, 1.371]);
    assert!(more.contains("but over all of them the error goes from 1.312 to 1.371 mm rms."), "{more}");
}

#[test]
fn what_is_sure_comes_before_what_is_larger_and_is_not() {
    let findings =
        [finding(EffectId::JointHarmonic, 3, [0.31; 3], [0.9, 0.6]), finding(EffectId::GearRatio, 2, SURE, [0.6, 0.4])];
    let verdict = told(&findings, &[], [(31, 0.9), (40, 0.4)]);
    let order: Vec<&[usize]> = verdict.rows.iter().map(|r| &r.findings[..]).filter(|f| !f.is_empty()).collect();
    assert_eq!(order, [&[2][..], &[1]]);
}

#[test]
fn alike_findings_of_several_joints_are_one_row_and_the_table_goes_from_the_plain_to_the_whole_model() {
    let findings = [
        finding(EffectId::EncoderError, 2, SURE, [0.5, 0.3]),
        finding(EffectId::LateJointReading, 1, SURE, [0.9, 0.5]),
        finding(EffectId::EncoderError, 1, [0.99, 0.99, 0.97], [0.3, 0.1]),
        finding(EffectId::GearRipple, 4, SURE, [0.1, 0.1]),
    ];
    let verdict = told(&findings, &[], [(31, 0.9), (90, 0.1)]);
    let said: Vec<(&str, String, String)> = verdict
        .rows
        .iter()
        .map(|r| (r.text.as_str(), format!("{:.2}", r.before_mm), format!("{:.2}", r.after_mm)))
        .collect();
    let row = |text, before: &str, after: &str| (text, before.to_owned(), after.to_owned());
    assert_eq!(
        said,
        [
            row("Plain model, 31 parameters", "0.90", "0.90"),
            row("Joints read before the arm had settled at joint 1", "0.90", "0.50"),
            row("Encoder error at joints 1 and 2", "0.50", "0.10"),
            row("Also: gear ripple at joint 4 (99 %)", "0.10", "0.10"),
            row("Whole model, 90 parameters", "0.10", "0.10"),
        ]
    );
    assert_eq!(verdict.rows[2].confidence, Some([0.97, 0.99]));
    assert_eq!((&verdict.rows[2].findings[..], &verdict.rows[3].findings[..]), (&[1, 3][..], &[4][..]));
    assert!(verdict.rows[2].corrected && !verdict.rows[1].corrected);
    // shortened, what is left out goes into the row of the rest
    let short = verdict.shortened(1, MOST_NAMED_IN_REST);
    assert_eq!(short.len(), 4);
    assert_eq!(short[2].findings, [1, 3, 4]);
    assert!((short[2].before_mm - 0.5).abs() < 1e-12 && (short[2].after_mm - 0.1).abs() < 1e-12);
}

#[test]
fn what_happens_at_one_place_in_several_sessions_is_one_row() {
    let jump = |joint, session, errors| Finding {
        session: Some(session),
        ..finding(EffectId::JointZeroShift, joint, SURE, errors)
    };
    let said = |findings: &[Finding]| {
        let rows = told(findings, &[], [(31, 0.5), (34, 0.1)]).rows;
        rows[1..rows.len() - 1].iter().map(|r| r.text.clone()).collect::<Vec<_>>()
    };
    // the second of two alike jumps may take all of the error
    let twice = [jump(4, 1, [0.5, 0.51]), jump(4, 2, [0.51, 0.1])];
    assert_eq!(said(&twice), ["Joint zero that jumped at joint 4, in sessions 1 and 2"]);
    let two_joints = [jump(4, 1, [0.5, 0.3]), jump(5, 1, [0.3, 0.1])];
    assert_eq!(said(&two_joints), ["Joint zero that jumped at joints 4 and 5 in session 1"]);
    let apart = [jump(4, 1, [0.5, 0.3]), jump(5, 2, [0.3, 0.1])];
    assert_eq!(
        said(&apart),
        ["Joint zero that jumped at joint 4 in session 1", "Joint zero that jumped at joint 5 in session 2"]
    );
}

#[test]
fn what_is_told_by_its_family_or_its_place_is_one_row_with_all_that_it_may_be() {
    let of = |effect, joint, confidences| finding(effect, joint, confidences, [0.5, 0.4]);
    let findings = [
        of(EffectId::JointHarmonic, 4, [0.9, 0.9, 0.3]),
        of(EffectId::AxisWobble, 2, [0.9, 0.4, 0.4]),
        of(EffectId::JointHarmonic, 2, [0.9, 0.8, 0.2]),
        of(EffectId::CrossAxisCompliance, 2, [0.8, 0.2, 0.2]),
        of(EffectId::AxisWobble, 3, [0.9, 0.4, 0.05]),
    ];
    let rows = told(&findings, &[], [(31, 0.5), (60, 0.1)]).rows;
    let said: Vec<_> = rows[1..4].iter().map(|r| (r.text.as_str(), r.perhaps.as_deref(), r.confidence)).collect();
    let [bearing, link] = [EffectId::AxisWobble, EffectId::CrossAxisCompliance].map(|e| e.effect().title);
    let at_2 = format!("perhaps {bearing} (40 %) or {link} (20 %)");
    assert_eq!(
        said,
        [
            (
                "Gear or encoder error at joints 2 and 4",
                Some("perhaps eccentric gear or encoder (20 to 30 %)"),
                Some([0.8, 0.9])
            ),
            ("Something at joint 2", Some(&at_2[..]), Some([0.8, 0.9])),
            ("Something at joint 3", None, Some([0.9, 0.9])),
        ]
    );
}

#[test]
fn what_is_less_than_half_sure_is_not_said_as_a_fact() {
    let said = |confidences| {
        let verdict =
            told(&[finding(EffectId::LostMotionDirection, 3, confidences, [0.5, 0.1])], &[], [(31, 0.5), (32, 0.1)]);
        let row = verdict.rows[1].clone();
        (row.text, row.perhaps.unwrap_or_default(), row.action.is_some())
    };
    let rival = "if not, friction that grows with the load".to_owned();
    let text = |t: &str| t.to_owned();
    assert_eq!(said(SURE), (text("Backlash or friction wind-up at joint 3"), String::new(), true));
    assert_eq!(said([0.9, 0.8, 0.7]), (text("Backlash or friction wind-up at joint 3"), rival, true));
    let name = |p| format!("perhaps backlash or friction wind-up ({p} %)");
    assert_eq!(said([0.9, 0.8, 0.4]), (text("Lost motion at joint 3"), name(40), false));
    assert_eq!(said([0.9, 0.2, 0.1]), (text("Something at joint 3"), name(10), false));
    assert_eq!(said([0.3, 0.2, 0.1]), (text("Perhaps backlash or friction wind-up at joint 3"), String::new(), false));
    assert_eq!(said([0.05, 0.02, 0.01]).0, "1 smaller or less sure finding");
}

#[test]
fn rows_that_together_gain_less_than_one_by_one_end_at_the_whole_model() {
    let findings = [
        finding(EffectId::EncoderError, 2, SURE, [0.5, 0.1]),
        finding(EffectId::GearRipple, 1, SURE, [0.5, 0.2]),
        // with this one the error at unseen poses is larger
        finding(EffectId::JointHarmonic, 3, SURE, [0.3, 0.4]),
    ];
    let verdict = told(&findings, &[], [(31, 0.5), (90, 0.3)]);
    let after: Vec<String> = verdict.rows.iter().map(|r| format!("{:.2}", r.after_mm)).collect();
    // 0.24 and 0.21 mm^2 share the 0.16 mm^2 that both take together
    assert_eq!(after, ["0.50", "0.41", "0.30", "0.30", "0.30"]);
}

#[test]
fn effects_are_told_by_their_titles() {
    let titles = ["tool_shift", "unexplained", "new_effect"].map(title_of);
    assert_eq!(titles, ["tool that slipped", "curves of no known cause", "new_effect"]);
}

#[test]
fn a_name_that_is_next_to_impossible_is_not_told() {
    let unsure = finding(EffectId::CrossAxisCompliance, 4, [0.8, 0.7, 0.01], [0.5, 0.1]);
    let row = told(&[unsure], &[], [(31, 0.5), (32, 0.1)]).rows[1].clone();
    assert_eq!((row.text.as_str(), row.perhaps), ("Elasticity at joint 4", None));
}

#[test]
fn places_that_cannot_be_told_apart_are_all_told() {
    let mut ball = finding(EffectId::BallPosition, 1, [0.32; 3], [0.5, 0.3]);
    let other = |ball| Rival { effect: EffectId::BallPosition, site: Place::Ball(ball), delta_bic: 0.2 };
    (ball.site, ball.rivals) = (Place::Ball(1), vec![other(2), other(3)]);
    let verdict = told(&[ball], &[], [(31, 0.5), (34, 0.3)]);
    let row = &verdict.rows[1];
    assert!(row.text.starts_with("Perhaps ") && row.text.ends_with("at ball 1"), "{}", row.text);
    assert_eq!(row.perhaps.as_deref(), Some("if not, at ball 2 or at ball 3"));
}

#[test]
fn sure_findings_without_a_row_of_their_own_are_named_by_what_they_are_together() {
    // as on an IRB 120: each ripple is small, and sure
    let ripple = |joint, p, before| finding(EffectId::GearRipple, joint, [p; 3], [before, before - 0.001]);
    let mut findings = vec![
        finding(EffectId::LateJointReading, 1, SURE, [0.5, 0.1]),
        finding(EffectId::NonlinearStiffness, 2, [0.6; 3], [0.1, 0.09]),
    ];
    findings.extend((1..=6).map(|joint| ripple(joint, 0.97 + 0.004 * joint as f64, 0.09 - 0.002 * joint as f64)));
    let verdict = told(&findings, &[curve(1, "q4", "all of q4", true, [0.09, 0.088])], [(31, 0.5), (90, 0.07)]);
    let rest = verdict
        .shortened(1, MOST_NAMED_IN_REST)
        .into_iter()
        .find(|r| r.kind == RowKind::Rest)
        .unwrap_or_else(|| unreachable!());
    assert_eq!(
        rest.text,
        "Also: joint stiffness that changes with the load at joint 2 (60 %), gear ripple at joints 1 to 6 (97 to 99 %), curves of no \
         known cause"
    );
    assert_eq!(rest.findings, [2, 3, 4, 5, 6, 7, 8]);
    assert!(rest.corrected);
    // and what is to be done about those that the model does not correct
    let moves = finding(EffectId::FrameDrift, 1, SURE, [0.1, 0.0999]);
    let verdict = told(&[findings[0].clone(), moves], &[], [(31, 0.5), (90, 0.0999)]);
    let rest = verdict.rows.into_iter().find(|r| r.kind == RowKind::Rest).unwrap_or_else(|| unreachable!());
    assert!(rest.text.contains("; fasten the instrument, let it warm up"), "{}", rest.text);
    // of what is not the arm's nothing is corrected
    let late = [1, 2].map(|joint| finding(EffectId::LateJointReading, joint, SURE, [0.5, 0.499]));
    assert!(
        told(&late, &[], [(31, 0.5), (33, 0.499)])
            .shortened(0, MOST_NAMED_IN_REST)
            .iter()
            .all(|r| r.kind != RowKind::Rest || !r.corrected)
    );
}

fn curve(joint: usize, variable: &str, region: &str, modelled: bool, [before, after]: [f64; 2]) -> Unexplained {
    Unexplained {
        site: Place::Joint(joint),
        variable: variable.into(),
        region: region.into(),
        rms_mm: 0.03,
        holdout_rms_before_mm: before,
        holdout_rms_after_mm: after,
        curve: Vec::new(),
        curve_units: (String::new(), String::new()),
        modelled,
    }
}

#[test]
fn what_has_no_name_stands_in_the_table_at_its_size_with_what_to_do() {
    let unexplained = [
        curve(2, "q4", "q4 < 10 deg", true, [0.3, 0.25]),
        curve(3, "q4", "all of q4, with q3", true, [0.5, 0.3]),
        // in the place of what the model has, and hardly better
        curve(6, "q6", "all of q6", false, [0.5, 0.195]),
        curve(5, "q4", "all of q4, every 0.04 deg", false, [0.2, 0.19]),
        curve(1, "seq", "all of seq", true, [0.25, 0.2]),
    ];
    let (heavy, mut bare) = (arm().robot, arm().robot);
    bare.joints.iter_mut().for_each(|j| j.mass = None);
    let with = |masses, several| Given { robot: if masses { &heavy } else { &bare }, several };
    let rows = |given: Given<'_>| of(&[], &unexplained, [(31, 0.5), (60, 0.2)], given).rows;
    let said: Vec<(String, bool)> = rows(with(true, false)).into_iter().map(|r| (r.text, r.corrected)).collect();
    let row = |text: &str, corrected| (text.to_owned(), corrected);
    assert_eq!(
        said,
        [
            row("Plain model, 31 parameters", true),
            row(
                "No known cause: smooth curves at joints 2 and 3, the largest at joint 3 over the angles of joints 3 and 4",
                true
            ),
            row("No known cause: change in the course of a session at joint 1", false),
            row(
                "Of what is left, 0.030 mm rms at joint 5 goes with the angle of joint 4, the same every 0.04 deg",
                false
            ),
            row("Whole model, 60 parameters", true),
        ]
    );
    // as on a UR10: 0.004 mm of 0.074 mm
    let small = Unexplained { rms_mm: 0.01, ..curve(5, "q4", "all of q4", false, [0.2, 0.19]) };
    let kinds = |left: Unexplained| {
        told(&[], &[left], [(31, 0.5), (60, 0.2)]).rows.into_iter().map(|r| r.kind).collect::<Vec<_>>()
    };
    assert_eq!(kinds(small), [RowKind::Plain, RowKind::Whole]);
    let actions = |given: Given<'_>| rows(given).into_iter().filter_map(|r| r.action).collect::<Vec<_>>();
    assert_eq!(actions(with(true, false)), [OTHER_ANGLES[0], IN_THE_COURSE]);
    assert_eq!(actions(with(true, true)), [OTHER_ANGLES[1], IN_THE_COURSE]);
    assert_eq!(actions(with(false, false)), [GIVE_MASSES, IN_THE_COURSE]);
    let own = [curve(4, "q4", "q4 from -20.0 to 20.0 deg", true, [0.5, 0.3])];
    let row = of(&[], &own, [(31, 0.5), (60, 0.3)], with(true, false)).rows[1].clone();
    assert_eq!(row.text, "No known cause: smooth curve at joint 4 over the angle of joint 4");
    assert_eq!(row.action, Some(OWN_ANGLE[0]));
    for variable in ["dir4", "travel4"] {
        let moves = [curve(4, variable, "all moves", true, [0.5, 0.3])];
        let rows = of(&[], &moves, [(31, 0.5), (60, 0.3)], with(true, true)).rows;
        assert_eq!(rows[1].action, Some(LAST_MOVES), "{variable}");
    }
}

#[test]
fn causes_stand_before_curves_and_of_a_shortened_table_errors_follow_each_other() {
    let findings = [
        finding(EffectId::LateJointReading, 1, SURE, [0.5, 0.4]),
        finding(EffectId::GearRatio, 3, SURE, [0.3, 0.2]),
        finding(EffectId::AxisTwist, 3, SURE, [0.2, 0.15]),
    ];
    let nameless = curve(1, "q4", "all of q4", true, [0.4, 0.3]);
    let verdict = told(&findings, &[nameless], [(31, 0.5), (90, 0.15)]);
    let kinds = |rows: &[VerdictRow]| rows.iter().map(|r| r.kind).collect::<Vec<_>>();
    use RowKind::{Curves, Finding, Plain, Rest, Whole};
    assert_eq!(kinds(&verdict.rows), [Plain, Finding, Finding, Finding, Curves, Whole]);
    let short = verdict.shortened(2, 0);
    assert_eq!(kinds(&short), [Plain, Finding, Finding, Rest, Whole]);
    assert_eq!(short[..3], verdict.rows[..3]);
    assert!(short.windows(2).all(|rows| (rows[0].after_mm - rows[1].before_mm).abs() < 1e-12), "{short:?}");
    assert_eq!(short[3].text, "Also: curves of no known cause; 1 more finding");
    assert_eq!(verdict.shortened(2, 1)[3].text.matches("twist").count(), 1);
}
