//! Error against the number of touches, chosen and random, with and without noise.

use serde_json::json;
use trical_ident::model_of_touches;
use trical_model::{Cell, Model, Robot, Task};
use trical_plan::{Candidate, PlanOptions, choose_touches, nominal_forward};

use super::simulation::{Nature, Outcome, calibrate, draw_arm, draw_known, random_touches, touch};
use super::{CURVES, Common, SPHERE, Spread, Study, WORKSPACE, drawn, pool, poses, region, share, trials};
use crate::error::{Error, Result};
use crate::page::Section;
use crate::plots::Band;
use crate::table::csv;

/// Trials of one setting.
struct Setting {
    arm: &'static str,
    noisy: bool,
    design: &'static str,
    per_ball: usize,
    outcomes: Vec<Option<Outcome>>,
}

impl Setting {
    fn spread(&self, of: fn(&Outcome) -> f64) -> Spread {
        Spread::of(self.outcomes.iter().flatten().map(of))
    }

    fn failed(&self) -> usize {
        self.outcomes.iter().filter(|o| o.is_none()).count()
    }
}

/// Arms in which every number of the table is changed.
const ANY: &str = "any";
/// Arms that the parameters can describe.
const DESCRIBED: &str = "described";
const CHOSEN: &str = "chosen";
const RANDOM: &str = "random";

/// The paper's simulation: `per_ball` has the numbers of touches a ball that are tried.
///
/// # Errors
/// Numbers that make no sense; a cell without balls, or whose balls the arm cannot touch.
pub fn touches(robot: &Robot, cell: &Cell, common: &Common, per_ball: &[usize], task: &Task<'_>) -> Result<Study> {
    let nature = common.nature()?;
    let most = per_ball.iter().copied().max().unwrap_or(0);
    if per_ball.is_empty() || per_ball.contains(&0) || most > common.pool {
        return Err(Error::Input(format!(
            "per_ball: found {:?}, expected numbers of 1 to {}, the pool of a ball",
            per_ball, common.pool
        )));
    }
    let set = common.set(robot);
    let known = model_of_touches(robot, cell, set)?;
    let options = common.options(&known);
    let poses = poses(robot, cell, common.seed)?;
    let pool = pool(robot, cell, &options)?;
    let forward = nominal_forward(robot, cell, &options)?;
    let region = region(&forward, &poses, &options);
    let mut settings: Vec<Setting> = Vec::new();
    let jobs = 4 * per_ball.len() + 2;
    let mut numbers = per_ball.to_vec();
    numbers.sort_unstable();
    numbers.dedup();
    let trial = |arm: &str, touches: &[Candidate], nature: &Nature, k: u64| {
        let truth = match arm {
            ANY => draw_arm(robot, cell, nature, common.seed, k),
            _ => draw_known(&known, nature, common.seed, k),
        };
        let recording = touch(&truth, touches, nature, common.seed, k)?;
        calibrate(robot, cell, &truth, recording, set, &poses)
    };
    for per_ball in &numbers {
        let options = PlanOptions { per_ball: *per_ball, ..options.clone() };
        // fewer rows than parameters: nothing can be chosen, nothing identified
        let chosen = choose_touches(&forward, &pool, &options, &region).map(|c| c.touches);
        for (arm, design) in [(DESCRIBED, CHOSEN), (DESCRIBED, RANDOM), (ANY, CHOSEN), (ANY, RANDOM)] {
            let outcomes = trials(common.trials, |k| match (&chosen, design) {
                (Ok(t), CHOSEN) => trial(arm, t, &nature, k),
                (Err(_), CHOSEN) => Ok(None),
                _ => trial(arm, &random_touches(&pool, cell.balls.len(), *per_ball, common.seed, k)?, &nature, k),
            })?;
            settings.push(Setting { arm, noisy: true, design, per_ball: *per_ball, outcomes });
            task.step(share(settings.len(), jobs), "")?;
        }
    }
    // without noise, with the most touches: what remains is what the parameters cannot describe
    let chosen = choose_touches(&forward, &pool, &PlanOptions { per_ball: most, ..options.clone() }, &region)?.touches;
    for arm in [DESCRIBED, ANY] {
        let outcomes = trials(common.trials, |k| trial(arm, &chosen, &nature.silent(), k))?;
        settings.push(Setting { arm, noisy: false, design: CHOSEN, per_ball: most, outcomes });
        task.step(share(settings.len(), jobs), "")?;
    }
    tell_touches(common, &settings, &known)
}

/// Columns of the study's CSV, one row for each trial.
const COLUMNS: [&str; 12] = [
    "arm",
    "noise",
    "design",
    "per_ball",
    "trial",
    "sphere_mean_mm",
    "sphere_max_mm",
    "workspace_mean_mm",
    "workspace_max_mm",
    "residual_rms_mm",
    "largest_parameter_error_si",
    "touches",
];

fn tell_touches(common: &Common, settings: &[Setting], known: &Model) -> Result<Study> {
    let mut trials = vec![COLUMNS.map(String::from).to_vec()];
    let mut rows = vec![
        ["arm, noise, touches", "a ball", "sphere mean", "80 % within", "workspace mean", "80 % within", "gave up"]
            .map(String::from)
            .to_vec(),
    ];
    let shown = |x: f64| if x > 0.0 && x < 1e-3 { format!("{x:.1e}") } else { format!("{x:.4}") };
    for s in settings {
        for (k, o) in s.outcomes.iter().enumerate() {
            let noise = if s.noisy { "yes" } else { "no" };
            let shown = |x: f64| if x.is_finite() { format!("{x:e}") } else { String::new() };
            let numbers = o.as_ref().map_or_else(
                || vec![String::new(); 7],
                |o| {
                    let [[a, b], [c, d]] = [o.sphere, o.workspace];
                    let errors = [a, b, c, d, o.residual, o.parameter].map(shown);
                    errors.into_iter().chain([o.touches.to_string()]).collect()
                },
            );
            let which = [s.arm, noise, s.design].map(String::from);
            let count = [s.per_ball, k + 1].map(|n| n.to_string());
            trials.push([&which[..], &count, &numbers].concat());
        }
        let (sphere, workspace) = (s.spread(SPHERE), s.spread(WORKSPACE));
        rows.push(vec![
            format!("{}, {}, {}", s.arm, if s.noisy { "noise" } else { "no noise" }, s.design),
            s.per_ball.to_string(),
            shown(sphere.mean),
            format!("{} to {}", shown(sphere.low), shown(sphere.high)),
            shown(workspace.mean),
            format!("{} to {}", shown(workspace.low), shown(workspace.high)),
            s.failed().to_string(),
        ]);
    }
    let curve = |arm: &str, design: &str, of: fn(&Outcome) -> f64| -> Vec<(f64, f64, f64, f64)> {
        settings
            .iter()
            .filter(|s| s.noisy && s.design == design && s.arm == arm)
            .map(|s| (s, s.spread(of)))
            .filter(|(_, x)| x.mean.is_finite())
            .map(|(s, x)| {
                let n = f64::from(u32::try_from(s.per_ball).unwrap_or(0));
                // bands of the arms that are described; those of any arm would cover them
                if arm == DESCRIBED { (n, x.mean, x.low, x.high) } else { (n, x.mean, x.mean, x.mean) }
            })
            .collect()
    };
    let panel = |of| -> Vec<Band> {
        [
            (DESCRIBED, CHOSEN, "chosen: noise alone", CURVES[0]),
            (DESCRIBED, RANDOM, "random: noise alone", CURVES[1]),
            (ANY, CHOSEN, "chosen: any arm", CURVES[2]),
            (ANY, RANDOM, "random: any arm", CURVES[3]),
        ]
        .into_iter()
        .map(|(arm, design, name, color)| Band { name: name.into(), color, points: curve(arm, design, of) })
        .collect()
    };
    let (svg, figures) = drawn(
        "touches a ball",
        "mean position error, mm",
        &[("in the sphere".into(), panel(SPHERE)), ("in the whole workspace".into(), panel(WORKSPACE))],
        "Mean position error at poses that were not touched, and where four fifths of the arms lie.",
    )?;
    let factor = |arm: &str, of: fn(&Outcome) -> f64| {
        let find = |design: &str, n: usize| {
            settings.iter().find(|s| s.noisy && s.arm == arm && s.design == design && s.per_ball == n)
        };
        let ratios: Vec<(usize, f64)> = settings
            .iter()
            .filter(|s| s.noisy && s.arm == arm && s.design == RANDOM)
            .filter_map(|r| Some((r.per_ball, r.spread(of).mean / find(CHOSEN, r.per_ball)?.spread(of).mean)))
            .filter(|r| r.1.is_finite())
            .collect();
        ratios
    };
    let silent: Vec<&Setting> = settings.iter().filter(|s| !s.noisy).collect();
    let recovered = silent
        .iter()
        .find(|s| s.arm == DESCRIBED)
        .map_or(f64::NAN, |s| s.outcomes.iter().flatten().map(|o| o.parameter).fold(0.0, f64::max));
    let left = silent.iter().find(|s| s.arm == ANY).map_or(f64::NAN, |s| s.spread(WORKSPACE).mean);
    let (in_sphere, in_workspace) = (factor(DESCRIBED, SPHERE), factor(DESCRIBED, WORKSPACE));
    let (any_sphere, any_workspace) = (factor(ANY, SPHERE), factor(ANY, WORKSPACE));
    let words =
        |list: &[(usize, f64)]| list.iter().map(|(n, f)| format!("{f:.2} ({n})")).collect::<Vec<_>>().join(", ");
    let verdict = format!(
        "Errors that noise leaves after random touches, divided by those after chosen ones (touches of each ball in brackets): in \
         the sphere {}; in the workspace {}.",
        words(&in_sphere),
        words(&in_workspace)
    );
    let without = format!(
        "Without noise, an arm that the {} parameters describe comes back to {recovered:.0e} (largest difference of a \
         parameter, m, rad, rad/Nm); of any arm, in which every number of the table is changed, {} mm are left on average in \
         the workspace: what these parameters cannot describe.",
        known.terms.len(),
        shown(left)
    );
    let sections = [
        Section {
            heading: "Error against touches".into(),
            text: vec![
                format!(
                    "{} true arms for each setting. Every length differs from nominal by {} mm and every angle by {} deg (standard \
                 deviations), compliances lie between {} and {} deg/Nm; noise: indicator {} mm, procedure {} mm, balls {} mm. \
                 Noise alone: arms that the parameters describe, the bands hold the middle four fifths of them. Any arm: every \
                 number of the table is changed, also those that no parameter stands for.",
                    common.trials,
                    common.length_mm,
                    common.angle_deg,
                    common.compliance_deg_per_nm[0],
                    common.compliance_deg_per_nm[1],
                    common.indicator_mm,
                    common.procedure_mm,
                    common.ballbar_mm
                ),
                without.clone(),
            ],
            figures,
            ..Section::default()
        },
        Section { heading: "Numbers, mm".into(), tables: vec![rows.clone()], ..Section::default() },
    ];
    let list: Vec<serde_json::Value> = settings
        .iter()
        .map(|s| {
            json!({
                "arm": s.arm, "noise": s.noisy, "design": s.design, "per_ball": s.per_ball,
                "sphere_mean_mm": s.spread(SPHERE).mean, "workspace_mean_mm": s.spread(WORKSPACE).mean,
                "gave_up": s.failed(),
            })
        })
        .collect();
    let factors =
        |list: &[(usize, f64)]| list.iter().map(|(n, f)| json!({ "per_ball": n, "factor": f })).collect::<Vec<_>>();
    let json = json!({
        "settings": list,
        "random_over_chosen": { "sphere": factors(&in_sphere), "workspace": factors(&in_workspace) },
        "random_over_chosen_any_arm": { "sphere": factors(&any_sphere), "workspace": factors(&any_workspace) },
        "largest_parameter_error_without_noise_si": recovered,
    });
    let title = "TriCal: study of touches";
    let csv = csv(trials);
    Ok(Study { table: rows, csv, svg, verdict, notes: vec![without], json, title, sections: sections.into() })
}
