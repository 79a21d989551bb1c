//! The report of a plan: the cell with the poses, what to expect, and what would not be seen.

use trical_model::{Cell, Forward, Model, Robot, State};
use trical_plan::{CollisionModel, Criterion, PredictedError, Sphere};

use crate::detectability;
use crate::error::Result;
use crate::evidence::{other_views, row, typical, used};
use crate::figures::picture::Scene;
use crate::figures::plots::span;
use crate::figures::turning_scene;
use crate::page::{self, Figure, Made, Section};
use crate::plan_summary::PlanSummary;
use crate::table::{counted, fixed, two_digits};

fn error_row(name: &str, p: Option<PredictedError>) -> Vec<String> {
    let number = |f: fn(&PredictedError) -> f64| p.map_or_else(|| "-".into(), |p| format!("{:.3}", f(&p) * 1e3));
    vec![name.into(), number(|p| p.mean_m), number(|p| p.rms_m), number(|p| p.worst_rms_m)]
}

/// Pictures of a plan.
pub fn pictures(robot: &Robot, cell: &Cell, summary: &PlanSummary) -> Result<Vec<Figure>> {
    let model = CollisionModel::new(robot, cell)?;
    let touches = &summary.plan.entries;
    let sphere = summary.options.sphere.or_else(|| Sphere::above(&cell.balls)).map(|s| (s.centre, s.radius));
    // the arm itself stands at the touch that is nearest to the middle of them all
    let shown = typical(&touches.iter().map(|e| e.joints).collect::<Vec<_>>());
    let scene = Scene { model: &model, touches, marks: &[], shown, sphere };
    let mut figures = vec![Figure::new(
        format!(
            "The cell with all {} poses, each in the colour of its ball: from base over the joints \
                 to the tool, the final approach to the ball drawn thick. Arm and device stand at one of \
                 them; the dashed circle is the sphere in which the arm is to be accurate. Point at a \
                 part to see its name.",
            touches.len()
        ),
        turning_scene::draw_turning(&scene, 900.0)?,
    )];
    figures.extend(other_views(&scene).figures);
    Ok(figures)
}

/// How far each joint's range and gravity torque are used, and the senses of approach.
fn coverage(robot: &Robot, cell: &Cell, summary: &PlanSummary) -> Result<Vec<Vec<String>>> {
    let forward = Forward::new(Model::nominal(robot.clone(), cell.clone()), Vec::new())?;
    let mut ws = forward.workspace();
    let torques: Option<Vec<_>> = robot
        .require_masses()
        .is_ok()
        .then(|| {
            let of = |q: &trical_model::Joints| forward.gravity_torques(&State::at(q), &mut ws).ok();
            summary.plan.entries.iter().map(|e| &e.joints).map(of).collect()
        })
        .flatten();
    let mut rows = vec![row([
        "joint",
        "lowest",
        "highest",
        "limits",
        "torque, Nm",
        "reached moving down",
        "reached moving up",
        "not moved",
    ])];
    for k in 0..robot.dof() {
        let mut cells = used(robot, k, span(summary.plan.entries.iter().map(|e| e.joints[k])));
        let torque = torques.as_ref().map_or_else(
            || "-".into(),
            |t| {
                let (a, b) = span(t.iter().map(|t| t[k]));
                format!("{} to {}", fixed(a, 1), fixed(b, 1))
            },
        );
        let [down, up] = summary.plan.expected.senses.get(k).copied().unwrap_or_default();
        let still = summary.plan.entries.len().saturating_sub(down + up);
        cells.extend([torque, down.to_string(), up.to_string(), still.to_string()]);
        rows.push(cells);
    }
    Ok(rows)
}

fn verdict(cell: &Cell, summary: &PlanSummary) -> String {
    let e = &summary.plan.expected;
    let touches = format!("{} of {}", counted(summary.plan.entries.len(), "touch"), counted(cell.balls.len(), "ball"));
    if !summary.determined() {
        return format!("{touches}: too few to determine the {} parameters.", summary.parameters.len());
    }
    let mean = |p: Option<PredictedError>| {
        p.map_or_else(|| "an unknown error".into(), |p| format!("{:.3} mm", p.mean_m * 1e3))
    };
    format!(
        "{touches}. With a noise of {} mm the expected position error is {} on average in the sphere and {} in the \
         whole workspace, if the model is complete. {} of the known effects would not be seen at one place or more.",
        summary.options.noise_m * 1e3,
        mean(e.in_sphere),
        mean(e.in_workspace),
        detectability::count(&summary.seen, &summary.lacking)
    )
}

/// What the choice was made for, and how much better it is than chance.
fn gain(criterion: Criterion, over_random: f64) -> String {
    let what = match criterion {
        Criterion::Determinant => "the standard deviations of the parameters are, taken together,",
        Criterion::Variances => "the sum of the parameters' variances is",
        Criterion::Weakest => "the standard deviation of what is known worst is",
        Criterion::Region => "the mean square error where the tool works is",
    };
    if over_random.is_finite() {
        format!(" With these touches {what} {} times smaller than with random ones.", two_digits(over_random))
    } else {
        String::new()
    }
}

/// Candidates of each ball that were refused.
fn refused(summary: &PlanSummary) -> Vec<Vec<String>> {
    let mut rows = vec![row(["ball", "tried", "kept", "refused because of", "most contacts between"])];
    for (k, r) in summary.plan.rejected.iter().enumerate() {
        let reasons: Vec<String> =
            r.reasons().iter().filter(|r| r.1 > 0).map(|(reason, n)| format!("{reason} {n}")).collect();
        let contact = r.contacts.iter().max_by_key(|c| *c.1).map_or_else(String::new, |(p, n)| format!("{p}: {n}"));
        let kept = r.attempts.saturating_sub(r.reasons().iter().map(|r| r.1).sum::<usize>());
        rows.push(vec![format!("{}", k + 1), r.attempts.to_string(), kept.to_string(), reasons.join(", "), contact]);
    }
    rows
}

fn parameters(summary: &PlanSummary) -> Vec<Vec<String>> {
    let mut rows = vec![row(["parameter", "nominal", "expected sd", "unit"])];
    rows.extend(summary.parameters.iter().map(|s| {
        vec![
            s.name.clone(),
            s.nominal.map_or_else(|| "-".into(), |n| fixed(n, 3)),
            two_digits(s.sd.unwrap_or(f64::NAN)),
            s.unit.clone(),
        ]
    }));
    rows
}

/// All effects at all sites, those that are seen least first.
fn all_effects(summary: &PlanSummary) -> Vec<Vec<String>> {
    let mut sorted: Vec<_> = summary.seen.iter().collect();
    sorted.sort_by(|a, b| a.lambda.total_cmp(&b.lambda));
    let cells =
        sorted.iter().map(|s| vec![s.effect.effect().title.to_owned(), s.site.to_string(), format!("{:.1}", s.lambda)]);
    std::iter::once(row(["effect", "site", "lambda"])).chain(cells).collect()
}

/// What would not be seen, and what would help.
fn not_seen(summary: &PlanSummary) -> Section {
    let mut advice = vec![row(["what would help", "to see"])];
    advice.extend(detectability::advice(&summary.seen).into_iter().map(|(remedy, what)| vec![remedy, what]));
    let mut text = vec![
        "Lambda is how large an effect of typical size would be in these measurements, in standard deviations of the \
         noise, after the fit of the parameters has absorbed what it can. An effect with lambda below 3 is not seen."
            .to_owned(),
    ];
    text.extend(summary.lacks());
    Section::new("What would not be seen").with_text(text).with_tables([advice])
}

/// The whole report.
pub fn render(robot: &Robot, cell: &Cell, summary: &PlanSummary, made: &Made) -> Result<String> {
    let e = &summary.plan.expected;
    let mut pictures = pictures(robot, cell, summary)?;
    let others = pictures.split_off(1);
    let expected = vec![
        row(["position error to be expected, mm", "mean", "rms", "rms at the worst pose"]),
        error_row("in the sphere", e.in_sphere),
        error_row("in the whole workspace", e.in_workspace),
    ];
    let dependent = (!e.dependent.is_empty())
        .then(|| format!("Cannot be told from others by these touches: {}.", e.dependent.join(", ")));
    let sections = [
        Section::new("The poses").with_figures(pictures),
        Section::new("From above and from the side").with_figures(others),
        Section::new("What to expect")
            .with_text([format!(
                "From the noise of the gauge alone, {} mm in each of its three readings. Errors of the \
                 model come on top, and grow where joints leave the ranges below.{}",
                summary.options.noise_m * 1e3,
                gain(e.criterion, e.gain_over_random)
            )])
            .with_tables([expected, coverage(robot, cell, summary)?]),
        not_seen(summary),
        Section::new("Candidates").with_tables([refused(summary)]),
        Section::new("Parameters").with_text(dependent).with_tables([parameters(summary)]),
        Section::new("All effects").with_tables([all_effects(summary)]).folded(true),
    ];
    page::render(&page::title("Plan", &robot.name, &[]), &verdict(cell, summary), &sections, made)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_diagnose::EffectId;
    use trical_model::Place;

    use super::*;
    use crate::detectability::Seen;
    use crate::test_data::{arm, behind, plan_summary};

    #[test]
    fn of_the_places_that_were_tried_those_that_were_not_refused_are_kept() {
        let rows = refused(&plan_summary());
        assert_eq!(rows.len(), 4);
        for row in &rows[1..] {
            let [tried, kept] = [1, 2].map(|k| row[k].parse::<usize>().unwrap());
            // the pool was full when the search ended
            assert!(kept == 30 && tried > kept, "{row:?}");
        }
    }

    #[test]
    fn what_is_better_than_by_chance_is_said() {
        let said = gain(Criterion::Region, 1.5);
        assert_eq!(
            said,
            " With these touches the mean square error where the tool works is 1.5 times smaller than with random ones."
        );
        assert_eq!(gain(Criterion::Weakest, f64::INFINITY), "");
    }

    #[test]
    fn a_joint_is_reached_moving_down_where_its_angle_at_the_approach_is_larger() {
        let (arm, mut summary) = (arm(), plan_summary());
        let rows = coverage(&arm.robot, &arm.cell, &summary).unwrap();
        for (k, row) in rows[1..].iter().enumerate() {
            // a milliradian and less is no motion
            let down = summary.plan.entries.iter().filter(|e| e.approach[k] > e.joints[k] + 1e-3).count();
            assert_eq!(row[5], down.to_string(), "joint {}", k + 1);
        }
        assert_eq!(rows[1][4], "0.0 to 0.0", "gravity has no torque about an upright axis");
        assert_ne!(rows[2][4], "0.0 to 0.0");
        summary.plan.expected.senses[1] = [1, 2];
        assert_eq!(coverage(&arm.robot, &arm.cell, &summary).unwrap()[2][5..], ["1", "2", "33"]);
    }

    #[test]
    fn the_verdict_has_the_mean_error_of_either_region_or_that_the_touches_are_too_few() {
        let (cell, mut summary) = (arm().cell, plan_summary());
        let of =
            |mm: f64| Some(PredictedError { mean_m: mm * 1e-3, rms_m: 2e-3 * mm, worst_rms_m: 3e-3 * mm, poses: 100 });
        (summary.plan.expected.in_sphere, summary.plan.expected.in_workspace) = (of(0.1), None);
        summary.options.noise_m = 2e-5;
        summary.seen.iter_mut().for_each(|s| s.lambda = 3.0);
        summary.lacking.truncate(2);
        let said = verdict(&cell, &summary);
        assert!(said.starts_with("36 touches of 3 balls. With a noise of 0.02 mm "), "{said}");
        assert!(said.contains("is 0.100 mm on average in the sphere and an unknown error in the whole"), "{said}");
        assert!(said.ends_with("complete. 2 of the known effects would not be seen at one place or more."), "{said}");
        assert_eq!(error_row("here", of(0.1)), ["here", "0.100", "0.200", "0.300"]);
        summary.plan.expected.sd[3] = f64::INFINITY;
        let parameters = summary.parameters.len();
        let few = format!("36 touches of 3 balls: too few to determine the {parameters} parameters.");
        assert_eq!(verdict(&cell, &summary), few);
    }

    #[test]
    fn what_is_seen_least_stands_first() {
        let mut summary = plan_summary();
        let of =
            |joint, lambda| Seen { effect: EffectId::GearRatio, site: Place::Joint(joint), lambda, remedy: "more" };
        summary.seen = vec![of(1, 4.0), of(2, 0.26), of(3, 2.0)];
        let rows = all_effects(&summary);
        assert_eq!([1, 2, 3].map(|k| rows[k][2].as_str()), ["0.3", "2.0", "4.0"]);
        assert_eq!(rows[1][1], "joint 2");
    }

    #[test]
    fn the_page_has_each_parameter_with_what_is_expected_of_it_and_what_cannot_be_told_or_seen() {
        let (arm, mut summary) = (arm(), plan_summary());
        let page = |summary: &PlanSummary| {
            let page = render(&arm.robot, &arm.cell, summary, &Made::by("x".into(), &[])).unwrap();
            page.replace('\u{a0}', " ")
        };
        summary.plan.expected.dependent.clear();
        summary.lacking.clear();
        let plain = page(&summary);
        assert!(!plain.contains("Cannot be told from others") && !plain.contains("such a recording lacks"));
        let own = &mut summary.parameters[0];
        (own.nominal, own.sd) = (Some(290.0), Some(0.031));
        summary.plan.expected.dependent = vec!["d_2".into(), "d_3".into()];
        summary.lacking = vec![(EffectId::ThermalGrowth, "a temperature")];
        let page = page(&summary);
        assert_eq!(behind(&page, &summary.parameters[0].name, 2), ["290.000", "0.031"]);
        assert!(page.contains("Cannot be told from others by these touches: d_2, d_3."));
        assert!(page.contains(": not visible, such a recording lacks a temperature."));
    }
}
