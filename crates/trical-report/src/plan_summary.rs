//! A plan and all that can be said of it: the summary for people and for machines.

use std::collections::BTreeMap;

use serde_json::json;
use trical_diagnose::verdict::capital;
use trical_ident::{Shown, shown};
use trical_model::Model;
use trical_plan::{Plan, PlanOptions, PredictedError, Rejected};

use crate::detectability::{self, Lacking, Seen};
use crate::error::Result;
use crate::table::{self, counted, plural, two_digits};

/// A plan and all that can be said of it.
pub struct PlanSummary {
    /// The plan.
    pub plan: Plan,
    /// What it was made with.
    pub options: PlanOptions,
    /// The parameters, each with the standard deviation to be expected.
    pub parameters: Vec<Shown>,
    /// What it would show.
    pub seen: Vec<Seen>,
    /// What no such recording can show, and why.
    pub lacking: Vec<Lacking>,
    /// Balls of the cell.
    pub balls: usize,
}

impl PlanSummary {
    /// `model` has the terms to identify.
    pub fn new(model: &Model, plan: Plan, options: PlanOptions) -> Result<Self> {
        let mut known = model.clone();
        known.terms.retain(|t| plan.expected.parameters.contains(&t.name));
        for t in &mut known.terms {
            let at = plan.expected.parameters.iter().position(|n| *n == t.name);
            t.sd = at.and_then(|k| plan.expected.sd.get(k).copied());
        }
        let parameters = known.terms.iter().map(|t| shown(&known, t)).collect();
        // with fewer numbers than parameters everything is taken up by them
        let determined = plan.expected.sd.iter().all(|s| s.is_finite());
        let (seen, lacking) = if determined {
            detectability::seen(&known, &plan.entries, options.noise_m)?
        } else {
            (Vec::new(), Vec::new())
        };
        Ok(Self { plan, options, parameters, seen, lacking, balls: model.cell.balls.len() })
    }

    /// Whether these touches determine the parameters.
    pub fn determined(&self) -> bool {
        self.plan.expected.sd.iter().all(|s| s.is_finite())
    }

    fn pool(&self) -> usize {
        let refused: usize = rejected(&self.plan).values().sum();
        self.plan.rejected.iter().map(|r| r.attempts).sum::<usize>() - refused
    }

    /// The summary of `--json`.
    pub fn json(&self) -> serde_json::Value {
        let e = &self.plan.expected;
        let error = |p: &Option<PredictedError>| {
            p.map(
                |p| json!({ "mean_mm": p.mean_m * 1e3, "rms_mm": p.rms_m * 1e3, "worst_rms_mm": p.worst_rms_m * 1e3 }),
            )
        };
        let parameters: Vec<serde_json::Value> = self
            .parameters
            .iter()
            .map(|s| json!({ "name": s.name, "site": s.site, "unit": s.unit, "sd": s.sd, "nominal": s.nominal }))
            .collect();
        let by_ball: Vec<serde_json::Value> = self
            .plan
            .rejected
            .iter()
            .enumerate()
            .map(|(k, r)| {
                let reasons: BTreeMap<&str, usize> = r.reasons().into_iter().collect();
                json!({ "ball": k + 1, "attempts": r.attempts, "rejected": reasons, "contacts": r.contacts })
            })
            .collect();
        json!({
            "touches": self.plan.entries.len(),
            "pool": self.pool(),
            "rejected": rejected(&self.plan),
            "by_ball": by_ball,
            "criterion": e.criterion,
            "gain_over_random": e.gain_over_random,
            "determined": self.determined(),
            "parameters": parameters,
            "not_identifiable": e.dependent,
            "observability": { "o1": e.o1, "condition": e.condition },
            "expected": {
                "noise_mm": self.options.noise_m * 1e3,
                "sphere": error(&e.in_sphere),
                "workspace": error(&e.in_workspace),
            },
            "senses": e.senses,
            "travel_rad": e.travel_rad,
            "blind_to": detectability::blind_json(&self.seen, &self.lacking),
        })
    }

    /// The summary for people.
    pub fn lines(&self) -> Vec<String> {
        let e = &self.plan.expected;
        let mut out = vec![format!(
            "{} of {}, chosen from {}{}",
            counted(self.plan.entries.len(), "touch"),
            counted(self.balls, "ball"),
            self.pool(),
            if e.gain_over_random.is_finite() {
                format!(" ({} times better than a random choice)", two_digits(e.gain_over_random))
            } else {
                String::new()
            }
        )];
        for (reason, n) in rejected(&self.plan).iter().filter(|r| *r.1 > 0) {
            out.push(format!("  {n:>6} {} dropped: {reason}", plural(*n, "candidate")));
        }
        if !self.determined() {
            out.push(format!(
                "These touches do not determine the {} parameters: more are needed to identify them",
                self.parameters.len()
            ));
            return out;
        }
        out.push(format!(
            "With noise of {} mm, {} parameters are expected with standard deviations of",
            self.options.noise_m * 1e3,
            self.parameters.len()
        ));
        let names: Vec<String> = self
            .parameters
            .iter()
            .map(|s| format!("{} {} {}", s.name, two_digits(s.sd.unwrap_or(f64::NAN)), s.unit))
            .collect();
        out.extend(names.chunks(5).map(|c| format!("  {}", c.join(", "))));
        out.push("Position error expected from this noise alone, mm (errors of the model come on top):".into());
        for (name, p) in [("in the sphere", e.in_sphere), ("in the whole workspace", e.in_workspace)] {
            out.push(p.map_or_else(
                || format!("  {name}: not known, the arm reaches too few poses there"),
                |p| format!("  {name}: mean {:.3}, at the worst pose {:.3} rms", p.mean_m * 1e3, p.worst_rms_m * 1e3),
            ));
        }
        let advice = detectability::advice(&self.seen);
        if !advice.is_empty() {
            out.push(
                "Effects that this plan would not show, with lambda: their typical size in standard deviations of the noise (3 is just visible):".into(),
            );
        }
        for (remedy, what) in advice {
            out.extend(table::wrapped(&what, 108, "  "));
            out.extend(table::wrapped(&format!("would help: {remedy}"), 108, "    "));
        }
        out.extend(self.lacks().flat_map(|lacks| table::wrapped(&lacks, 108, "")));
        out
    }

    /// What no such recording shows, a sentence each.
    pub fn lacks(&self) -> impl Iterator<Item = String> {
        let said = |(effect, lacks): &Lacking| {
            format!("{}: not visible, such a recording lacks {lacks}.", capital(effect.effect().title))
        };
        self.lacking.iter().map(said)
    }
}

/// Why candidates were dropped, counted over all balls.
pub fn rejected(plan: &Plan) -> BTreeMap<String, usize> {
    let mut all = Rejected::default();
    plan.rejected.iter().for_each(|r| all.add(r));
    all.reasons().into_iter().map(|(reason, n)| (reason.to_owned(), n)).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_diagnose::EffectId;
    use trical_model::Place;

    use super::*;
    use crate::test_data::{plan, plan_summary};

    #[test]
    fn each_parameter_has_the_standard_deviation_that_is_expected_of_it() {
        let (model, mut plan, options) = plan();
        let names = plan.expected.parameters.clone();
        // in another order than the model's, and one of them cannot be told apart
        plan.expected.parameters.reverse();
        plan.expected.sd = (1..).map(|k| f64::from(k) * 1e-6).take(names.len()).collect();
        let (left_out, _) = (plan.expected.parameters.remove(0), plan.expected.sd.remove(0));
        let summary = PlanSummary::new(&model, plan, options).unwrap();
        let told: Vec<&str> = summary.parameters.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(told, names[..names.len() - 1]);
        assert_eq!(left_out, names[names.len() - 1]);
        let last = summary.parameters.last().unwrap();
        let per_si = if last.unit == "mm" { 1e3 } else { 1.0_f64.to_degrees() };
        assert!((last.sd.unwrap() - 2e-6 * per_si).abs() < 1e-12, "{last:?}");
    }

    #[test]
    fn touches_come_from_what_was_kept_and_errors_are_told_in_mm() {
        let mut summary = plan_summary();
        let error = PredictedError { mean_m: 1e-4, rms_m: 2e-4, worst_rms_m: 3e-4, poses: 100 };
        (summary.plan.expected.in_sphere, summary.plan.expected.in_workspace) = (Some(error), None);
        summary.plan.expected.gain_over_random = 1.5;
        let lines = summary.lines();
        assert_eq!(lines[0], "36 touches of 3 balls, chosen from 90 (1.5 times better than a random choice)");
        let has = |text: &str| lines.iter().any(|l| l == text);
        assert!(has("  in the sphere: mean 0.100, at the worst pose 0.300 rms"), "{lines:?}");
        assert!(has("  in the whole workspace: not known, the arm reaches too few poses there"), "{lines:?}");
        let json = summary.json();
        assert_eq!((&json["pool"], &json["determined"]), (&json!(90), &json!(true)));
        assert_eq!(json["expected"]["sphere"], json!({ "mean_mm": 0.1, "rms_mm": 0.2, "worst_rms_mm": 0.3 }));
        assert_eq!(json["expected"]["workspace"], json!(null));
        assert_eq!(json["by_ball"][2]["ball"], 3);
    }

    #[test]
    fn reasons_for_which_nothing_was_dropped_are_not_told_and_the_others_over_all_balls() {
        let mut summary = plan_summary();
        let of = |unreachable| Rejected { attempts: 40, unreachable, ..Rejected::default() };
        summary.plan.rejected = vec![of(4), of(7)];
        let dropped: Vec<String> = summary.lines().into_iter().filter(|l| l.contains("dropped")).collect();
        assert_eq!(dropped, ["      11 candidates dropped: out of reach"]);
        assert_eq!(summary.pool(), 69);
    }

    #[test]
    fn touches_that_do_not_determine_the_parameters_promise_nothing() {
        let (model, mut plan, options) = plan();
        plan.expected.sd[0] = f64::INFINITY;
        let summary = PlanSummary::new(&model, plan, options).unwrap();
        assert!(summary.seen.is_empty() && summary.json()["determined"] == false);
        let lines = summary.lines();
        assert!(lines.last().unwrap().starts_with("These touches do not determine the "), "{lines:?}");
        assert!(!lines.iter().any(|l| l.contains("expected")), "{lines:?}");
        assert!(plan_summary().lines().iter().any(|l| l.contains("are expected with standard deviations of")));
    }

    #[test]
    fn what_such_a_recording_could_not_show_is_told_with_what_would_help_or_what_it_lacks() {
        let mut summary = plan_summary();
        let (ratio, growth) = (EffectId::GearRatio, EffectId::ThermalGrowth);
        let of = |lambda| Seen { effect: ratio, site: Place::Joint(2), lambda, remedy: "more touches" };
        summary.lacking = vec![(growth, "a temperature")];
        let told = |summary: &PlanSummary, text: &str| summary.lines().iter().any(|l| l.contains(text));
        for (lambda, hidden) in [(3.1, false), (2.9, true)] {
            summary.seen = vec![of(lambda)];
            assert_eq!(told(&summary, "Effects that this plan would not show"), hidden);
            assert_eq!(told(&summary, "    would help: more touches"), hidden);
            let blind = summary.json()["blind_to"].clone();
            assert_eq!(blind.as_array().unwrap().len(), if hidden { 2 } else { 1 });
            assert_eq!(blind.as_array().unwrap().last().unwrap()["lacks"], "a temperature");
        }
        assert!(told(&summary, "not visible, such a recording lacks a temperature."));
    }
}
