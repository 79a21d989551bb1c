//! Error against the number of touches, chosen and random, with and without noise.

use serde_json::{Value, json};
use trical_ident::model_of_touches;
use trical_model::{Cell, Model, Robot, Task};
use trical_plan::{Candidate, PlanOptions, choose_touches, nominal_forward};

use super::simulation::{Nature, Outcome, calibrate, draw_arm, draw_known, random_touches, touch};
use super::{
    CURVES, Checked, Common, SPHERE, Spread, Study, WORKSPACE, drawn, pool, poses, region, share, trials, wrong,
};
use crate::error::Result;
use crate::figures::plots::Band;
use crate::page::Section;
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

    /// The trials as rows of the CSV.
    fn trials(&self) -> impl Iterator<Item = Vec<String>> + '_ {
        let shown = |x: f64| if x.is_finite() { format!("{x:e}") } else { String::new() };
        self.outcomes.iter().enumerate().map(move |(k, o)| {
            let numbers = o.as_ref().map_or_else(
                || vec![String::new(); 7],
                |o| {
                    let [[a, b], [c, d]] = [o.sphere, o.workspace];
                    let errors = [a, b, c, d, o.residual, o.parameter].map(shown);
                    errors.into_iter().chain([o.touches.to_string()]).collect()
                },
            );
            let which = [self.arm, if self.noisy { "yes" } else { "no" }, self.design].map(String::from);
            let count = [self.per_ball, k + 1].map(|n| n.to_string());
            [&which[..], &count, &numbers].concat()
        })
    }

    /// The row of the table.
    fn row(&self) -> Vec<String> {
        let mut row = vec![
            format!("{}, {}, {}", self.arm, if self.noisy { "noise" } else { "no noise" }, self.design),
            self.per_ball.to_string(),
        ];
        for x in [self.spread(SPHERE), self.spread(WORKSPACE)] {
            row.extend([shown(x.mean), format!("{} to {}", shown(x.low), shown(x.high))]);
        }
        row.push(self.failed().to_string());
        row
    }

    fn json(&self) -> Value {
        json!({
            "arm": self.arm, "noise": self.noisy, "design": self.design, "per_ball": self.per_ball,
            "sphere_mean_mm": self.spread(SPHERE).mean, "workspace_mean_mm": self.spread(WORKSPACE).mean,
            "gave_up": self.failed(),
        })
    }
}

fn shown(x: f64) -> String {
    if x > 0.0 && x < 1e-3 { format!("{x:.1e}") } else { format!("{x:.4}") }
}

/// Arms in which every number of the table is changed.
const ANY: &str = "any";
/// Arms that the parameters can describe.
const DESCRIBED: &str = "described";
const CHOSEN: &str = "chosen";
const RANDOM: &str = "random";

impl Common {
    /// The most touches of a ball, where these numbers of them make sense.
    ///
    /// # Errors
    /// Where they do not.
    pub fn check_touches(&self, per_ball: &[usize]) -> Checked<usize> {
        match per_ball.iter().copied().max() {
            Some(most) if !per_ball.contains(&0) && most <= self.pool => Ok(most),
            _ => wrong(
                "per_ball",
                format!("found {per_ball:?}, expected numbers of 1 to {}, the pool of a ball", self.pool),
            ),
        }
    }
}

/// The paper's simulation: `per_ball` has the numbers of touches a ball that are tried.
///
/// # Errors
/// Numbers that make no sense; a cell without balls, or whose balls the arm cannot touch.
pub fn touches(robot: &Robot, cell: &Cell, common: &Common, per_ball: &[usize], task: &Task<'_>) -> Result<Study> {
    let nature = common.nature()?;
    let most = common.check_touches(per_ball)?;
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

/// Columns of the table that is shown.
const HEAD: [&str; 7] =
    ["arm, noise, touches", "a ball", "sphere mean", "80 % within", "workspace mean", "80 % within", "gave up"];

fn tell_touches(common: &Common, settings: &[Setting], known: &Model) -> Result<Study> {
    let rows: Vec<_> = [HEAD.map(String::from).to_vec()].into_iter().chain(settings.iter().map(Setting::row)).collect();
    let trials = [COLUMNS.map(String::from).to_vec()].into_iter().chain(settings.iter().flat_map(Setting::trials));
    let (svg, figures) = drawn(
        "touches a ball",
        "mean position error, mm",
        &[
            ("in the sphere".into(), curves(settings, SPHERE)),
            ("in the whole workspace".into(), curves(settings, WORKSPACE)),
        ],
        "Mean position error at poses that were not touched, and where four fifths of the arms lie.",
    )?;
    let ratios = |arm: &str| [SPHERE, WORKSPACE].map(|of| random_over_chosen(settings, arm, of));
    let (described, any) = (ratios(DESCRIBED), ratios(ANY));
    let [in_sphere, in_workspace] = described
        .each_ref()
        .map(|list| list.iter().map(|(n, f)| format!("{f:.2} ({n})")).collect::<Vec<_>>().join(", "));
    let verdict = format!(
        "Errors that noise leaves after random touches, divided by those after chosen ones (touches of each ball in brackets): in \
         the sphere {in_sphere}; in the workspace {in_workspace}."
    );
    let silent = |arm: &str| settings.iter().find(|s| !s.noisy && s.arm == arm);
    let recovered =
        silent(DESCRIBED).map_or(f64::NAN, |s| s.outcomes.iter().flatten().map(|o| o.parameter).fold(0.0, f64::max));
    let without = format!(
        "Without noise, an arm that the {} parameters describe comes back to {recovered:.0e} (largest difference of a \
         parameter, m, rad, rad/Nm); of any arm, in which every number of the table is changed, {} mm are left on average in \
         the workspace: what these parameters cannot describe.",
        known.terms.len(),
        shown(silent(ANY).map_or(f64::NAN, |s| s.spread(WORKSPACE).mean))
    );
    let text = vec![how_simulated(common), without.clone()];
    let sections = vec![
        Section::new("Error against touches").with_text(text).with_figures(figures),
        Section::new("Numbers, mm").with_tables([rows.clone()]),
    ];
    let factors = |[sphere, workspace]: &[Vec<(usize, f64)>; 2]| {
        let list = |list: &[(usize, f64)]| -> Vec<Value> {
            list.iter().map(|(n, f)| json!({ "per_ball": n, "factor": f })).collect()
        };
        json!({ "sphere": list(sphere), "workspace": list(workspace) })
    };
    let json = json!({
        "settings": settings.iter().map(Setting::json).collect::<Vec<_>>(),
        "random_over_chosen": factors(&described),
        "random_over_chosen_any_arm": factors(&any),
        "largest_parameter_error_without_noise_si": recovered,
    });
    let title = "TriCal: study of touches";
    Ok(Study { csv: csv(trials), table: rows, svg, verdict, notes: vec![without], json, title, sections })
}

/// How the arms of a study were drawn.
fn how_simulated(common: &Common) -> String {
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
    )
}

/// Error against touches: a curve for each kind of arm and design.
fn curves(settings: &[Setting], of: fn(&Outcome) -> f64) -> Vec<Band> {
    let curve = |arm: &str, design: &str| -> Vec<(f64, f64, f64, f64)> {
        settings
            .iter()
            .filter(|s| s.noisy && s.design == design && s.arm == arm)
            .map(|s| (s, s.spread(of)))
            .filter(|(_, x)| x.mean.is_finite())
            .map(|(s, x)| {
                let n = s.per_ball as f64;
                // bands of the arms that are described; those of any arm would cover them
                if arm == DESCRIBED { (n, x.mean, x.low, x.high) } else { (n, x.mean, x.mean, x.mean) }
            })
            .collect()
    };
    [
        (DESCRIBED, CHOSEN, "chosen: noise alone", CURVES[0]),
        (DESCRIBED, RANDOM, "random: noise alone", CURVES[1]),
        (ANY, CHOSEN, "chosen: any arm", CURVES[2]),
        (ANY, RANDOM, "random: any arm", CURVES[3]),
    ]
    .into_iter()
    .map(|(arm, design, name, color)| Band { name: name.into(), color, points: curve(arm, design) })
    .collect()
}

/// Touches of each ball, and the error after random ones divided by that after chosen ones.
fn random_over_chosen(settings: &[Setting], arm: &str, of: fn(&Outcome) -> f64) -> Vec<(usize, f64)> {
    let designed =
        |design: &'static str| settings.iter().filter(move |s| s.noisy && s.arm == arm && s.design == design);
    designed(RANDOM)
        .filter_map(|r| {
            let chosen = designed(CHOSEN).find(|s| s.per_ball == r.per_ball)?;
            Some((r.per_ball, r.spread(of).mean / chosen.spread(of).mean))
        })
        .filter(|r| r.1.is_finite())
        .collect()
}
