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
fn a_wave_says_what_it_is_of() {
    let said = ["wobble_foot_x_sine_2_3", "wobble_y_sine_1_3", "rail_z_sine_1_1"].map(of_wave);
    assert_eq!(said, ["tilt about x, at the foot of the axis", "tilt about y", "rail z"]);
}

#[test]
fn waves_within_their_standard_deviation_are_counted_and_not_named() {
    let wave = |name: &str, shape| {
        let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
        Term::new(name, "gear_ripple", Site::Joint { joint: 2 }, basis)
    };
    let (mut terms, mut all) = (Vec::new(), Vec::new());
    for (cycles, size) in [(80.0, 0.004), (160.0, 0.0005), (240.0, 0.0009)] {
        for (name, shape, value) in [("s", Shape::Sine { cycles }, size), ("c", Shape::Cosine { cycles }, 0.0)] {
            let name = format!("{name}_{cycles}");
            terms.push(wave(&name, shape));
            all.push(Coefficient { name, value, unit: "deg".into(), sd: Some(0.001), cycles: None });
        }
    }
    let told = coefficients(&all, &terms);
    assert_eq!(told[1..], ["2 more waves smaller than their standard deviations"]);
    assert!(told[0].starts_with("amplitude at 80 cycles a turn = 4"), "{told:?}");
    assert_eq!(coefficients(&all[..4], &terms)[1], "1 more wave smaller than its standard deviation");
}

#[test]
fn the_size_of_a_wave_does_not_depend_on_its_phase() {
    for k in 0..6 {
        let (s, c) = (0.7 * f64::from(k)).sin_cos();
        let (size, sd) = amplitude([0.02 * s, 0.02 * c], [Some(1e-3), Some(1e-3)]);
        assert!((size - 0.02).abs() < 1e-12 && (sd.unwrap() - 1e-3).abs() < 1e-12);
    }
    assert_eq!(amplitude([3.0, 4.0], [None, Some(1.0)]), (5.0, None));
}

#[test]
fn steps_follow_each_other_also_where_one_of_them_makes_the_error_larger() {
    let steps = [("2", 0.638, 0.445), ("?", 0.445, 0.475), ("1", 0.512, 0.638)].map(|(n, b, a)| (n.to_owned(), b, a));
    let told: Vec<String> = chained(0.512, steps.into()).into_iter().map(|(name, _)| name).collect();
    assert_eq!(told, ["1", "2", "?"]);
}

#[test]
fn what_others_say_of_a_finding_is_theirs_where_it_is_left_out() {
    let mut model = crate::test_data::arm();
    let term = |name: &str, value| {
        let site = Site::Joint { joint: 2 };
        Term { value, sd: Some(1e-3), ..Term::new(name, "effect", site, Basis::CONSTANT) }
    };
    model.terms.extend([term("own", 2e-3), term("other", 1e-3), term("apart", 1e-3)]);
    let names = ["own", "other", "apart"].map(str::to_owned).to_vec();
    let correlation = vec![1.0, -0.8, 0.0, -0.8, 1.0, 0.0, 0.0, 0.0, 1.0];
    let known = Uncertainty { names, correlation, noise: 1e-5, rotation_noise: None, course: 0.0, effects: 0.0 };
    let left = |known: Option<&Uncertainty>| {
        let without = without(&|t| t.name == "own", &model, known);
        without.terms[without.terms.len() - 3..].iter().map(|t| (t.value * 1e6).round()).collect::<Vec<_>>()
    };
    assert_eq!(left(Some(&known)), [0.0, 2600.0, 1000.0]);
    assert_eq!(left(None), [0.0, 1000.0, 1000.0]);
}

#[test]
fn errors_without_a_finding_go_on_in_proportion_to_its_size() {
    let mut model = crate::test_data::arm();
    let own = Term::new("own", "effect", Site::Joint { joint: 2 }, Basis::CONSTANT);
    model.terms.push(Term { value: 0.5, ..own });
    let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
    let data = crate::test_data::data(&[(0..3).map(|k| (crate::test_data::pose(k), touch)).collect()]);
    let off_by = |value: f64| {
        let mut other = model.clone();
        other.terms.iter_mut().filter(|t| t.name == "own").for_each(|t| t.value = value);
        other
    };
    let with = six(&model, &data).unwrap();
    let gone = linear(&model, &off_by(0.0), &data, &with).unwrap();
    let tenth = linear(&model, &off_by(0.45), &data, &with).unwrap();
    let exact = six(&off_by(0.0), &data).unwrap();
    for k in 0..3 {
        let [gone, tenth, exact] = [gone[k], tenth[k], exact[k]].map(|r| r - with[k]);
        assert!((gone - tenth * 10.0).norm() < 1e-4 * gone.norm());
        assert!((gone - exact).norm() > 0.1 * gone.norm(), "half a radian is far");
    }
}

#[test]
fn a_finding_of_several_waves_is_drawn_over_the_cycle_of_the_largest() {
    let mut d = crate::test_data::diagnosis();
    let mut f = d.findings[0].clone();
    let wave = |name: &str, shape, value| {
        let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
        Term { value, ..Term::new(name, "gear_ripple", Site::Joint { joint: 2 }, basis) }
    };
    let mut over = |[sine, cosine]: [f64; 2], other: f64| {
        let waves = [
            wave("a", Shape::Sine { cycles: 20.0 }, other),
            wave("b", Shape::Cosine { cycles: 20.0 }, 0.0),
            wave("c", Shape::Sine { cycles: 10.0 }, sine),
            wave("d", Shape::Cosine { cycles: 10.0 }, cosine),
        ];
        f.coefficients =
            waves.iter().map(|t| Coefficient { name: t.name.clone(), ..f.coefficients[0].clone() }).collect();
        d.model.terms.retain(|t| t.effect != "gear_ripple");
        d.model.terms.extend(waves);
        revealing(&f, &d).unwrap()
    };
    // the amplitude counts, not the larger of the two coefficients
    let (label, x) = over([3e-4, -3e-4], 4e-4);
    assert_eq!(label, "joint 2 within a 36.00 deg cycle, deg");
    assert!(x.iter().all(|x| (0.0..36.0).contains(x)) && x.iter().any(|x| *x > 18.0));
    assert_eq!(over([3e-4, 0.0], 4e-4).0, "joint 2 within a 18.00 deg cycle, deg");
}

#[test]
fn of_many_findings_the_largest_are_told_one_by_one_and_the_others_in_one_section() {
    let mut d = crate::test_data::diagnosis();
    let one = d.findings[0].clone();
    let said = |d: &Diagnosis| {
        let (all, smaller) = (all_findings(d).unwrap(), smaller_findings(d));
        (all.heading, all.tables[0].len() - 1, smaller.map(|s| (s.heading, s.tables[0].len() - 1, s.after)))
    };
    d.findings = vec![one.clone(); SHOWN];
    assert_eq!(said(&d), ("All findings".to_owned(), SHOWN, None));
    d.findings.push(one);
    let (heading, largest, smaller) = said(&d);
    assert_eq!((heading.as_str(), largest), ("The largest findings", SHOWN));
    let (heading, rows, each) = smaller.unwrap();
    assert_eq!((heading.as_str(), rows, each.len()), ("1 smaller finding", 1, 1));
    assert!(each[0].starts_with(&format!("{}. Changes sign with", SHOWN + 1)), "{each:?}");
}

#[test]
fn behind_the_last_finding_that_is_of_some_size_or_likely_all_are_in_one_section() {
    let mut d = crate::test_data::diagnosis();
    let of = |(share, confidence)| Finding { share, confidence, ..d.findings[0].clone() };
    let large_unsure = of((0.2, 0.3));
    let small_sure = of((0.001, 0.9));
    let small_unsure = of((0.001, 0.3));
    let mut told = |findings: &[&Finding]| {
        d.findings = findings.iter().map(|f| (*f).clone()).collect();
        (all_findings(&d).unwrap().tables[0].len() - 1, smaller_findings(&d).map(|s| s.tables[0].len() - 1))
    };
    assert_eq!(told(&[&large_unsure, &small_unsure, &small_sure, &small_unsure, &small_unsure]), (3, Some(2)));
    assert_eq!(told(&[&small_unsure, &large_unsure]), (2, None));
    assert_eq!(told(&[&small_unsure, &small_unsure]), (1, Some(1)), "a page tells one at any rate");
}
