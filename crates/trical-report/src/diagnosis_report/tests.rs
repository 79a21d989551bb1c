#![allow(clippy::unwrap_used)]

use super::*;

#[test]
fn an_error_falls_only_where_it_does() {
    let falls = whole("this", ", at the same balls", [0.5, 0.1], 2);
    assert!(falls.contains("did not see, at the same balls, falls from 0.50 to 0.10 mm rms"), "{falls}");
    assert_eq!(
        whole("this", "", [2.981, 2.979], 2),
        "2.98 mm rms is left at poses that the fit did not see: nothing was found that lowers it."
    );
    assert!(alone("A free curve", [0.2, 0.1], 3).ends_with("did not see from 0.200 to 0.100 mm rms."));
    assert!(alone("A free curve", [0.1, 0.2], 3).contains("there the error is 0.200 mm rms with it, 0.100 without"));
}

#[test]
fn a_report_counts_what_the_model_has_beside_the_claims_of_its_summary() {
    let row = |kind, findings: &[usize]| VerdictRow {
        kind,
        text: String::new(),
        perhaps: None,
        confidence: None,
        before_mm: 0.2,
        after_mm: 0.1,
        action: None,
        corrected: true,
        findings: findings.into(),
    };
    let (two, one, curves) = (row(RowKind::Finding, &[1, 3]), row(RowKind::Finding, &[2]), row(RowKind::Curves, &[]));
    assert_eq!(modelled(&[&one], 1, false), "this");
    assert_eq!(modelled(&[&two, &one], 4, false), "these and 1 smaller finding");
    assert_eq!(modelled(&[&two, &one], 15, true), "these, 12 smaller findings and curves of no known cause");
    assert_eq!(modelled(&[&two, &curves], 3, true), "these and 1 smaller finding");
}

#[test]
fn of_what_a_finding_could_also_be_each_is_told_once_and_never_itself() {
    let names = ["payload", "a", "a", "b", "c", "d"].map(String::from);
    assert_eq!(first_of(names.into_iter(), "payload"), "a; b; c; 1 more");
    assert_eq!(first_of(["a", "b"].map(String::from).into_iter(), ""), "a; b");
    assert_eq!(first_of(std::iter::once("payload".to_owned()), "payload"), "");
}

#[test]
fn touches_that_decide_are_offered_only_where_they_can_be_planned() {
    assert_eq!(could_also_be("a; b", false, false).unwrap(), "In this data it could also be: a; b.");
    let offered = could_also_be("a", false, true).unwrap();
    assert!(offered.ends_with("a. `trical diagnose --next 8` plans touches that decide."), "{offered}");
    assert!(could_also_be("", false, true).is_none());
    // what is sure needs none
    assert_eq!(could_also_be("a", true, true).unwrap(), "Much less likely: a.");
}

#[test]
fn a_curve_is_drawn_over_what_its_region_is_said_of() {
    let robot = crate::test_data::arm().robot;
    let said = |variable: &str, region: &str| {
        let unit = if region.starts_with("seq") { "pose" } else { "deg" };
        let (variable, region) = (variable.to_owned(), region.to_owned());
        let u = Unexplained {
            site: Place::Joint(3),
            variable,
            region,
            rms_mm: 0.0,
            holdout_rms_before_mm: 0.0,
            holdout_rms_after_mm: 0.0,
            curve: Vec::new(),
            curve_units: (unit.to_owned(), "deg".to_owned()),
            modelled: false,
        };
        along(&u, &robot) + &by_sense(&u, &robot)
    };
    assert_eq!(
        said("dir2", "seq from 0 to 900"),
        "number of the pose, changing sign with the sense of joint 2's last motion"
    );
    assert_eq!(said("q2", "q2 < -32 deg"), "angle of joint 2, deg");
    assert_eq!(said("q4", "all of q4, with q1"), "angle of joint 4, deg");
    assert_eq!(said("travel3", "all moves, in proportion to the last one"), "moves of joint 3: the last one, deg");
    assert_eq!(said("dir3", "all moves, in proportion to the last one"), "moves of joint 3: the last one, deg");
}

#[test]
fn joints_and_links_have_errors_and_a_joint_has_one() {
    let said = [Place::Links, Place::Joints, Place::Tool, Place::Joint(3)].map(is_off);
    assert_eq!(
        said,
        ["The links have errors", "The joints have errors", "The tool has an error", "Joint 3 has an error"]
    );
}

#[test]
fn steps_follow_each_other_also_where_one_of_them_makes_the_error_larger() {
    let steps = [("2", 0.638, 0.445), ("?", 0.445, 0.475), ("1", 0.512, 0.638)].map(|(n, b, a)| (n.to_owned(), b, a));
    let told: Vec<String> = chained(0.512, steps.into()).into_iter().map(|(name, _)| name).collect();
    assert_eq!(told, ["1", "2", "?"]);
}

#[test]
fn of_many_findings_twelve_are_told_one_by_one_and_the_others_in_one_section() {
    let mut d = crate::test_data::diagnosis();
    let one = d.findings[0].clone();
    let said = |d: &Diagnosis| {
        let (all, smaller) = (all_findings(d).unwrap(), more_findings(d));
        (all.heading, all.tables[0].len() - 1, smaller.map(|s| (s.heading, s.tables[0].len() - 1, s.after)))
    };
    d.findings = vec![one.clone(); SHOWN];
    assert_eq!(said(&d), ("All findings".to_owned(), SHOWN, None));
    d.findings.push(one);
    let (heading, largest, smaller) = said(&d);
    assert_eq!((heading.as_str(), largest), ("The main findings", SHOWN));
    let (heading, rows, each) = smaller.unwrap();
    assert_eq!((heading.as_str(), rows, each.len()), ("1 more finding", 1, 1));
    assert!(each[0].starts_with(&format!("{}. Changes sign with", SHOWN + 1)), "{each:?}");
}

#[test]
fn findings_that_are_small_and_of_no_sure_family_are_in_one_section() {
    let mut d = crate::test_data::diagnosis();
    let of = |(share, confidence, family_confidence)| Finding {
        share,
        confidence,
        family_confidence,
        ..d.findings[0].clone()
    };
    let large_unsure = of((0.2, 0.3, 0.3));
    let small_sure = of((0.001, 0.9, 0.9));
    let of_sure_family = of((0.001, 0.6, 0.9));
    let small_unsure = of((0.001, 0.6, 0.7));
    let mut told = |findings: &[&Finding]| {
        d.findings = findings.iter().map(|f| (*f).clone()).collect();
        let numbers = |s: Section| {
            s.tables[0][1..].iter().map(|r| r[0].split_once('.').unwrap().0.to_owned()).collect::<String>()
        };
        let main = all_findings(&d).unwrap();
        let beside_the_arm = main.figures[0].svg.matches("<li value=").count();
        assert_eq!(beside_the_arm, main.tables[0].len() - 1);
        let of_last = format!("<li value=\"{}\">", main.tables[0].last().unwrap()[0].split_once('.').unwrap().0);
        assert!(main.figures[0].svg.contains(&of_last), "{of_last}");
        (numbers(main), more_findings(&d).map(numbers).unwrap_or_default())
    };
    let said = |told: &str, more: &str| (told.to_owned(), more.to_owned());
    assert_eq!(told(&[&large_unsure, &small_unsure, &small_sure, &small_unsure, &of_sure_family]), said("135", "24"));
    assert_eq!(told(&[&small_unsure, &large_unsure]), said("2", "1"));
    assert_eq!(told(&[&small_unsure, &small_unsure]), said("1", "2"), "a page tells one at any rate");
}
