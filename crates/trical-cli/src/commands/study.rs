//! `trical study`: whole calibrations by the hundred, without hardware (the paper's simulation), and platforms of balls compared.

use std::fmt::Write;
use std::path::PathBuf;

use nalgebra::Vector3;
use plotters::style::RGBColor;
use rayon::prelude::*;
use serde_json::json;
use trical_ident::{ParameterSet, model_of_touches, write_whole};
use trical_model::{Cell, Forward, Model, Robot};
use trical_plan::predict::tool_rows;
use trical_plan::{
    Candidate, CollisionModel, Criterion, PlanOptions, Sphere, ValidationOptions, choose_touches, generate,
    nominal_forward, poses_in_sphere, poses_in_workspace,
};

use crate::commands::plan::Best;
use crate::error::{CliError, Result};
use crate::input::RobotAndCell;
use crate::plots::{self, Band};
use crate::report::{Figure, Made, Section, render};
use crate::simulation::{Nature, Outcome, Poses, calibrate, draw_arm, draw_known, random_touches, touch};
use crate::{progress, say, table};

/// Arguments of `trical study`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(clap::Subcommand)]
enum Study {
    /// The paper's simulation: error against the number of touches, chosen against random ones, with and without noise
    Touches(TouchesArgs),
    /// Number, size and height of the ball platform against the error in the sphere and in the whole workspace
    Platform(PlatformArgs),
}

#[derive(clap::Args)]
struct Common {
    #[command(flatten)]
    cell: RobotAndCell,
    /// Folder for study.csv, study.svg and study.html
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// True arms drawn for each setting
    #[arg(long, value_name = "N", default_value_t = 40)]
    trials: u64,
    /// Seed of all chance: the same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Candidates a ball
    #[arg(long, value_name = "N", default_value_t = 100)]
    pool: usize,
    /// What chosen touches are best for
    #[arg(long, value_enum, ignore_case = true, default_value_t = Best::D)]
    criterion: Best,
    /// Parameters to identify: with 'complete', also the twists of near-parallel axes
    #[arg(long, value_enum, default_value_t = Set::Compliance)]
    set: Set,
    /// Standard deviation of every length of a true arm
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    length_mm: f64,
    /// Standard deviation of every angle of a true arm
    #[arg(long, value_name = "DEG", default_value_t = 1.0)]
    angle_deg: f64,
    /// Least and largest compliance of its joints
    #[arg(long, value_name = "LEAST,MOST", value_delimiter = ',', default_values_t = [1e-3, 1e-1])]
    compliance_deg_per_nm: Vec<f64>,
    /// Noise of an indicator
    #[arg(long, value_name = "MM", default_value_t = 0.001)]
    indicator_mm: f64,
    /// Noise of the procedure, along each axis
    #[arg(long, value_name = "MM", default_value_t = 0.010)]
    procedure_mm: f64,
    /// Noise of each coordinate of a ball's known place
    #[arg(long, value_name = "MM", default_value_t = 0.001)]
    ballbar_mm: f64,
    /// A machine-readable summary on standard output
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Set {
    Geometry,
    Compliance,
    Complete,
}

#[derive(clap::Args)]
struct TouchesArgs {
    #[command(flatten)]
    common: Common,
    /// Touches a ball, several settings
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [5, 8, 11, 15, 20, 30])]
    per_ball: Vec<usize>,
}

#[derive(clap::Args)]
struct PlatformArgs {
    #[command(flatten)]
    common: Common,
    /// Touches of all balls together
    #[arg(long, value_name = "N", default_value_t = 45)]
    touches: usize,
    /// Numbers of balls (3 or more: {w} is theirs), evenly on a circle
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [3, 6])]
    balls: Vec<usize>,
    /// Sizes of the platform: the side of the triangle that three balls on that circle make
    #[arg(long, value_name = "MM,MM,...", value_delimiter = ',', default_values_t = [100.0, 200.0, 300.0, 400.0])]
    side_mm: Vec<f64>,
    /// Heights above the balls of cell.toml
    #[arg(long, value_name = "MM,MM,...", value_delimiter = ',', allow_negative_numbers = true, default_values_t = [0.0, 150.0])]
    height_mm: Vec<f64>,
    /// How much higher every second ball is (a second plate)
    #[arg(long, value_name = "MM,MM,...", value_delimiter = ',', default_values_t = [0.0, 250.0])]
    raise_mm: Vec<f64>,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    match &args.study {
        Study::Touches(a) => touches(a),
        Study::Platform(a) => platform(a),
    }
}

impl Common {
    fn nature(&self) -> Result<Nature> {
        let at_least_0 = [
            ("--length-mm", self.length_mm),
            ("--angle-deg", self.angle_deg),
            ("--indicator-mm", self.indicator_mm),
            ("--procedure-mm", self.procedure_mm),
            ("--ballbar-mm", self.ballbar_mm),
        ];
        for (name, value) in at_least_0 {
            if !(value.is_finite() && (0.0..=20.0).contains(&value)) {
                return Err(CliError::Input(format!("{name}: found {value}, expected 0 to 20")));
            }
        }
        let [low, high] = match self.compliance_deg_per_nm.as_slice() {
            [a, b] if *a > 0.0 && a <= b && b.is_finite() => [a.to_radians(), b.to_radians()],
            other => {
                return Err(CliError::Input(format!(
                    "--compliance-deg-per-nm: found {other:?}, expected a least and a largest one above 0"
                )));
            }
        };
        if self.trials == 0 {
            return Err(CliError::Input("--trials: found 0, expected 1 or more".into()));
        }
        Ok(Nature {
            length: self.length_mm * 1e-3,
            angle: self.angle_deg.to_radians(),
            // a uniform draw needs a range
            compliance: [low, high * (1.0 + 1e-12)],
            indicator: self.indicator_mm * 1e-3,
            procedure: self.procedure_mm * 1e-3,
            ballbar: self.ballbar_mm * 1e-3,
        })
    }

    fn set(&self, robot: &Robot) -> ParameterSet {
        match self.set {
            _ if robot.require_masses().is_err() => ParameterSet::Geometry,
            Set::Geometry => ParameterSet::Geometry,
            Set::Compliance => ParameterSet::Compliance,
            Set::Complete => ParameterSet::Complete,
        }
    }

    fn options(&self, known: &Model) -> PlanOptions {
        let mut options = PlanOptions {
            seed: self.seed,
            pool_per_ball: self.pool,
            per_ball: 1,
            parameters: Some(known.terms.clone()),
            ..PlanOptions::default()
        };
        self.criterion.apply(&mut options);
        options
    }

    fn folder(&self) -> Result<()> {
        std::fs::create_dir_all(&self.out)
            .map_err(|e| CliError::Input(format!("{}: cannot be made: {e}", self.out.display())))
    }

    fn write(&self, csv: &str, figure: &str, title: &str, verdict: &str, sections: &[Section]) -> Result<()> {
        write_whole(&self.out.join("study.csv"), csv.as_bytes())?;
        write_whole(&self.out.join("study.svg"), figure.as_bytes())?;
        let html = render(title, verdict, sections, &Made::from(&self.cell.files()))?;
        Ok(write_whole(&self.out.join("study.html"), html.as_bytes())?)
    }
}

/// Where errors are looked at: poses that the nominal arm takes without meeting anything.
fn poses(robot: &Robot, cell: &Cell, seed: u64) -> Result<Poses> {
    let model = CollisionModel::new(robot, cell)?;
    let sphere = Sphere::above(&cell.balls).ok_or_else(|| CliError::Input("the cell has no [balls]".into()))?;
    let options = ValidationOptions { seed, ..ValidationOptions::default() };
    Ok(Poses {
        sphere: poses_in_sphere(&model, &sphere.centre, sphere.radius, 100, &options)?,
        workspace: poses_in_workspace(&model, 300, &options)?,
    })
}

fn pool(robot: &Robot, cell: &Cell, options: &PlanOptions) -> Result<Vec<Candidate>> {
    let model = CollisionModel::new(robot, cell)?;
    let mut pool = Vec::new();
    for ball in 0..cell.balls.len() {
        pool.extend(generate::generate(&model, ball, options, &mut |_| {})?.0);
    }
    Ok(pool)
}

/// How the free terms move the tool where the criterion looks.
fn region(forward: &Forward, poses: &Poses, options: &PlanOptions) -> Vec<f64> {
    if options.criterion != Criterion::Region {
        return Vec::new();
    }
    tool_rows(forward, if options.whole_workspace { &poses.workspace } else { &poses.sphere })
}

/// Mean, and where the middle four fifths lie.
#[derive(Clone, Copy, Debug)]
struct Spread {
    mean: f64,
    low: f64,
    high: f64,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut v: Vec<f64> = values.collect();
        v.sort_by(f64::total_cmp);
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a small count"
        )]
        let at =
            |share: f64| v.get(((v.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN);
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        Self { mean, low: at(0.1), high: at(0.9) }
    }
}

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

const SPHERE: fn(&Outcome) -> f64 = |o| o.sphere[0];
const WORKSPACE: fn(&Outcome) -> f64 = |o| o.workspace[0];

fn touches(args: &TouchesArgs) -> Result<()> {
    let common = &args.common;
    let nature = common.nature()?;
    let (robot, cell) = common.cell.load()?;
    common.folder()?;
    let most = args.per_ball.iter().copied().max().unwrap_or(0);
    if args.per_ball.is_empty() || args.per_ball.contains(&0) || most > common.pool {
        return Err(CliError::Input(format!(
            "--per-ball: found {:?}, expected numbers of 1 to {}, the pool of a ball",
            args.per_ball, common.pool
        )));
    }
    let set = common.set(&robot);
    let known = model_of_touches(&robot, &cell, set)?;
    let options = common.options(&known);
    let poses = poses(&robot, &cell, common.seed)?;
    let pool = pool(&robot, &cell, &options)?;
    let forward = nominal_forward(&robot, &cell, &options)?;
    let region = region(&forward, &poses, &options);
    let bar = progress::bar("study");
    let mut settings: Vec<Setting> = Vec::new();
    let jobs = 4 * args.per_ball.len() + 2;
    let mut numbers = args.per_ball.clone();
    numbers.sort_unstable();
    numbers.dedup();
    #[expect(clippy::cast_precision_loss, reason = "counts")]
    let tick = |done: usize| progress::at(&bar, done as f64 / jobs as f64, "");
    let trial = |arm: &str, touches: &[Candidate], nature: &Nature, k: u64| {
        let truth = match arm {
            ANY => draw_arm(&robot, &cell, nature, common.seed, k),
            _ => draw_known(&known, nature, common.seed, k),
        };
        let recording = touch(&truth, touches, nature, common.seed, k)?;
        calibrate(&robot, &cell, &truth, recording, set, &poses)
    };
    for per_ball in &numbers {
        let options = PlanOptions { per_ball: *per_ball, ..options.clone() };
        // fewer rows than parameters: nothing can be chosen, nothing identified
        let chosen = choose_touches(&forward, &pool, &options, &region).map(|c| c.touches);
        for (arm, design) in [(DESCRIBED, CHOSEN), (DESCRIBED, RANDOM), (ANY, CHOSEN), (ANY, RANDOM)] {
            let outcomes = (0..common.trials)
                .into_par_iter()
                .map(|k| match (&chosen, design) {
                    (Ok(t), CHOSEN) => trial(arm, t, &nature, k),
                    (Err(_), CHOSEN) => Ok(None),
                    _ => trial(arm, &random_touches(&pool, cell.balls.len(), *per_ball, common.seed, k)?, &nature, k),
                })
                .collect::<Result<Vec<_>>>()?;
            settings.push(Setting { arm, noisy: true, design, per_ball: *per_ball, outcomes });
            tick(settings.len());
        }
    }
    // without noise, with the most touches: what remains is what the parameters cannot describe
    let chosen = choose_touches(&forward, &pool, &PlanOptions { per_ball: most, ..options.clone() }, &region)?.touches;
    for arm in [DESCRIBED, ANY] {
        let outcomes = (0..common.trials)
            .into_par_iter()
            .map(|k| trial(arm, &chosen, &nature.silent(), k))
            .collect::<Result<Vec<_>>>()?;
        settings.push(Setting { arm, noisy: false, design: CHOSEN, per_ball: most, outcomes });
        tick(settings.len());
    }
    bar.finish_and_clear();
    tell_touches(args, &settings, &known)
}

fn tell_touches(args: &TouchesArgs, settings: &[Setting], known: &Model) -> Result<()> {
    let common = &args.common;
    let mut csv = String::from(
        "arm,noise,design,per_ball,trial,sphere_mean_mm,sphere_max_mm,workspace_mean_mm,workspace_max_mm,\
         residual_rms_mm,largest_parameter_error_si,touches\n",
    );
    let mut rows = vec![
        ["arm, noise, touches", "a ball", "sphere mean", "80 % within", "workspace mean", "80 % within", "gave up"]
            .map(String::from)
            .to_vec(),
    ];
    let shown = |x: f64| if x > 0.0 && x < 1e-3 { format!("{x:.1e}") } else { format!("{x:.4}") };
    for s in settings {
        for (k, o) in s.outcomes.iter().enumerate() {
            let noise = if s.noisy { "yes" } else { "no" };
            let _ = write!(csv, "{},{noise},{},{},{}", s.arm, s.design, s.per_ball, k + 1);
            let _ = match o {
                None => writeln!(csv, ",,,,,,,"),
                Some(o) => {
                    let parameter = if o.parameter.is_finite() { format!("{:e}", o.parameter) } else { String::new() };
                    writeln!(
                        csv,
                        ",{:e},{:e},{:e},{:e},{:e},{parameter},{}",
                        o.sphere[0], o.sphere[1], o.workspace[0], o.workspace[1], o.residual, o.touches
                    )
                }
            };
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
    let figure = plots::panels(
        "touches a ball",
        "mean position error, mm",
        &[("in the sphere".into(), panel(SPHERE)), ("in the whole workspace".into(), panel(WORKSPACE))],
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
        "Noise leaves errors that are larger after random touches than after chosen ones by a factor (touches a ball): in the \
         sphere {}; in the workspace {}.",
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
            figures: vec![Figure {
                caption: "Mean position error at poses that were not touched, and where four fifths of the arms lie."
                    .into(),
                svg: figure.clone(),
            }],
            ..Section::default()
        },
        Section { heading: "Numbers, mm".into(), tables: vec![rows.clone()], ..Section::default() },
    ];
    common.write(&csv, &figure, "TriCal: study of touches", &verdict, &sections)?;
    if common.json {
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
        return say(serde_json::to_string_pretty(&json!({
            "settings": list,
            "random_over_chosen": { "sphere": factors(&in_sphere), "workspace": factors(&in_workspace) },
            "random_over_chosen_any_arm": { "sphere": factors(&any_sphere), "workspace": factors(&any_workspace) },
            "largest_parameter_error_without_noise_si": recovered,
        }))?);
    }
    for line in table::lines(&rows) {
        say(line)?;
    }
    for line in [verdict, without].iter().flat_map(|t| table::wrapped(t, 108, "")) {
        say(line)?;
    }
    say(format!("Wrote study.csv, study.svg and study.html to {}", common.out.display()))
}

/// Where the balls of a platform are.
#[derive(Clone, Copy, Debug)]
struct Layout {
    balls: usize,
    side: f64,
    height: f64,
    raise: f64,
}

impl Layout {
    /// Evenly on a circle about the middle of the cell's own balls, every second one raised.
    fn cell(&self, cell: &Cell) -> Cell {
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        let (n, own) = (self.balls as f64, cell.balls.len() as f64);
        let middle = cell.balls.iter().sum::<Vector3<f64>>() / own;
        // the first ball lies as the cell's own first ball does
        let first = cell.balls.first().map_or(0.0, |b| (b.y - middle.y).atan2(b.x - middle.x));
        let radius = self.side / 3.0_f64.sqrt();
        let balls = (0..self.balls)
            .map(|k| {
                #[expect(clippy::cast_precision_loss, reason = "a count")]
                let angle = first + std::f64::consts::TAU * k as f64 / n;
                let up = self.height + if k % 2 == 1 { self.raise } else { 0.0 };
                middle + Vector3::new(radius * angle.cos(), radius * angle.sin(), up)
            })
            .collect();
        let mut out = Cell { balls, ..cell.clone() };
        // the drawn platform belongs to the drawn balls: another is derived
        if let Some(geometry) = &mut out.geometry {
            geometry.remove("obstacle");
        }
        out
    }

    fn name(&self) -> String {
        let mut name = format!("{} balls", self.balls);
        if self.height != 0.0 {
            let _ = write!(name, ", {:.0} mm higher", self.height * 1e3);
        }
        if self.raise != 0.0 {
            let _ = write!(name, ", every second {:.0} mm up", self.raise * 1e3);
        }
        name
    }
}

/// How a layout did; a reason where it could not be used.
struct Platform {
    layout: Layout,
    result: std::result::Result<(Spread, Spread, usize), String>,
}

fn platform(args: &PlatformArgs) -> Result<()> {
    let common = &args.common;
    let nature = common.nature()?;
    let (robot, cell) = common.cell.load()?;
    common.folder()?;
    if let Some(n) = args.balls.iter().find(|n| **n < 3 || **n > args.touches) {
        return Err(CliError::Input(format!(
            "--balls: found {n}, expected 3 (the least that say where {{w}} is) to {}, the number of touches",
            args.touches
        )));
    }
    if let Some(side) = args.side_mm.iter().find(|s| !(s.is_finite() && **s > 20.0)) {
        return Err(CliError::Input(format!("--side-mm: found {side}, expected more than 20")));
    }
    let poses = poses(&robot, &cell, common.seed)?;
    let set = common.set(&robot);
    let mut layouts = Vec::new();
    for balls in &args.balls {
        for height in &args.height_mm {
            for raise in &args.raise_mm {
                for side in &args.side_mm {
                    layouts.push(Layout {
                        balls: *balls,
                        side: side * 1e-3,
                        height: height * 1e-3,
                        raise: raise * 1e-3,
                    });
                }
            }
        }
    }
    let bar = progress::bar("platforms");
    let mut done = Vec::with_capacity(layouts.len());
    for layout in &layouts {
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        progress::at(&bar, done.len() as f64 / layouts.len() as f64, &layout.name());
        done.push(Platform { layout: *layout, result: try_layout(args, &robot, &cell, layout, &nature, set, &poses)? });
    }
    bar.finish_and_clear();
    tell_platforms(args, &done)
}

fn try_layout(
    args: &PlatformArgs,
    robot: &Robot,
    cell: &Cell,
    layout: &Layout,
    nature: &Nature,
    set: ParameterSet,
    poses: &Poses,
) -> Result<std::result::Result<(Spread, Spread, usize), String>> {
    let common = &args.common;
    let cell = layout.cell(cell);
    let known = model_of_touches(robot, &cell, set)?;
    let mut options = common.options(&known);
    options.per_ball = args.touches / layout.balls;
    options.pool_per_ball = common.pool.max(options.per_ball);
    // out of reach is a result, not an error
    let pool = match pool(robot, &cell, &options) {
        Ok(pool) => pool,
        Err(e) => return Ok(Err(e.to_string())),
    };
    let forward = nominal_forward(robot, &cell, &options)?;
    let region = region(&forward, poses, &options);
    let chosen = match choose_touches(&forward, &pool, &options, &region) {
        Ok(c) => c.touches,
        Err(e) => return Ok(Err(e.to_string())),
    };
    let outcomes = (0..common.trials)
        .into_par_iter()
        .map(|k| {
            let truth = draw_arm(robot, &cell, nature, common.seed, k);
            let recording = touch(&truth, &chosen, nature, common.seed, k)?;
            calibrate(robot, &cell, &truth, recording, set, poses)
        })
        .collect::<Result<Vec<_>>>()?;
    let good: Vec<Outcome> = outcomes.iter().flatten().copied().collect();
    if good.is_empty() {
        return Ok(Err("no fit succeeded: these touches do not determine the parameters".into()));
    }
    let spread = |of: fn(&Outcome) -> f64| Spread::of(good.iter().map(of));
    Ok(Ok((spread(SPHERE), spread(WORKSPACE), outcomes.len() - good.len())))
}

const CURVES: [RGBColor; 8] = [
    RGBColor(38, 102, 165),
    RGBColor(209, 102, 31),
    RGBColor(42, 157, 124),
    RGBColor(138, 95, 176),
    RGBColor(184, 144, 28),
    RGBColor(194, 71, 107),
    RGBColor(90, 120, 140),
    RGBColor(60, 60, 60),
];

fn tell_platforms(args: &PlatformArgs, done: &[Platform]) -> Result<()> {
    let common = &args.common;
    let mut csv = String::from(
        "balls,side_mm,height_mm,raise_mm,sphere_mean_mm,sphere_low_mm,sphere_high_mm,workspace_mean_mm,workspace_low_mm,\
         workspace_high_mm,gave_up,problem\n",
    );
    let mut rows = vec![
        ["platform", "side, mm", "sphere, mm", "80 % within", "workspace, mm", "80 % within"]
            .map(String::from)
            .to_vec(),
    ];
    let mut problems: Vec<String> = Vec::new();
    for p in done {
        let l = &p.layout;
        let (side, height, raise) = (l.side * 1e3, l.height * 1e3, l.raise * 1e3);
        let _ = write!(csv, "{},{side:.1},{height:.1},{raise:.1}", l.balls);
        match &p.result {
            Ok((s, w, failed)) => {
                let _ = writeln!(
                    csv,
                    ",{:e},{:e},{:e},{:e},{:e},{:e},{failed},",
                    s.mean, s.low, s.high, w.mean, w.low, w.high
                );
                rows.push(vec![
                    l.name(),
                    format!("{side:.0}"),
                    format!("{:.4}", s.mean),
                    format!("{:.4} to {:.4}", s.low, s.high),
                    format!("{:.4}", w.mean),
                    format!("{:.4} to {:.4}", w.low, w.high),
                ]);
            }
            Err(problem) => {
                let _ = writeln!(csv, ",,,,,,,,\"{}\"", problem.replace('"', "'"));
                rows.push(vec![l.name(), format!("{side:.0}"), "-".into(), "-".into(), "-".into(), "-".into()]);
                problems.push(format!("{}, side {side:.0} mm, cannot be used: {problem}.", l.name()));
            }
        }
    }
    let mut names: Vec<String> = Vec::new();
    for p in done {
        if !names.contains(&p.layout.name()) {
            names.push(p.layout.name());
        }
    }
    let panel = |of: fn(&(Spread, Spread, usize)) -> Spread| -> Vec<Band> {
        names
            .iter()
            .enumerate()
            .map(|(k, name)| Band {
                name: name.clone(),
                color: CURVES[k % CURVES.len()],
                points: done
                    .iter()
                    .filter(|p| p.layout.name() == *name)
                    .filter_map(|p| {
                        let s = of(p.result.as_ref().ok()?);
                        Some((p.layout.side * 1e3, s.mean, s.mean, s.mean))
                    })
                    .collect(),
            })
            .collect()
    };
    let figure = plots::panels(
        "side of the platform, mm",
        "mean position error, mm",
        &[("in the sphere".into(), panel(|r| r.0)), ("in the whole workspace".into(), panel(|r| r.1))],
    )?;
    let best = |of: fn(&(Spread, Spread, usize)) -> Spread| {
        done.iter()
            .filter_map(|p| Some((of(p.result.as_ref().ok()?).mean, &p.layout)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or_else(
                || "none could be used".into(),
                |(e, l)| format!("{}, side {:.0} mm: {e:.4} mm", l.name(), l.side * 1e3),
            )
    };
    let verdict = format!(
        "With {} touches in all, the best platform for the sphere is {}; for the whole workspace {}.",
        args.touches,
        best(|r| r.0),
        best(|r| r.1)
    );
    let mut sections = vec![
        Section {
            heading: "Platforms".into(),
            text: vec![format!(
                "{} true arms for each platform, drawn as by trical study touches, {} touches shared by the balls. The sphere and \
             the poses of the workspace are the same for all. Platform, posts and floor are derived from the balls; other \
             obstacles of cell.toml are left out.",
                common.trials, args.touches
            )],
            figures: vec![Figure {
                caption: "Mean position error at poses that were not touched.".into(),
                svg: figure.clone(),
            }],
            ..Section::default()
        },
        Section { heading: "Numbers".into(), tables: vec![rows.clone()], ..Section::default() },
    ];
    if !problems.is_empty() {
        let heading = "Platforms that cannot be used".into();
        sections.push(Section { heading, text: problems.clone(), ..Section::default() });
    }
    common.write(&csv, &figure, "TriCal: study of platforms", &verdict, &sections)?;
    if common.json {
        let list: Vec<serde_json::Value> = done
            .iter()
            .map(|p| {
                let l = &p.layout;
                let (s, w, problem) = match &p.result {
                    Ok((s, w, _)) => (Some(s.mean), Some(w.mean), None),
                    Err(e) => (None, None, Some(e)),
                };
                json!({
                    "balls": l.balls, "side_mm": l.side * 1e3, "height_mm": l.height * 1e3, "raise_mm": l.raise * 1e3,
                    "sphere_mean_mm": s, "workspace_mean_mm": w, "problem": problem,
                })
            })
            .collect();
        return say(serde_json::to_string_pretty(&json!({ "platforms": list }))?);
    }
    for line in table::lines(&rows) {
        say(line)?;
    }
    for line in problems.iter().chain([&verdict]).flat_map(|t| table::wrapped(t, 108, "")) {
        say(line)?;
    }
    say(format!("Wrote study.csv, study.svg and study.html to {}", common.out.display()))
}
