//! Whole calibrations by the hundred, without hardware (the paper's simulation), and platforms of balls compared.

pub mod places;
mod platform;
pub mod simulation;
mod touches;

use plotters::style::RGBColor;
use rayon::prelude::*;
use serde_json::Value;
use trical_ident::ParameterSet;
use trical_model::interrupt::{Shared, checkpoint, shared};
use trical_model::{Cell, Forward, Model, Robot};
use trical_plan::predict::tool_rows;
use trical_plan::{
    Candidate, CollisionModel, Criterion, PlanOptions, Sphere, ValidationOptions, generate, poses_in_sphere,
    poses_in_workspace,
};

use crate::error::{Error, Result};
use crate::figures::plots::{self, Band};
use crate::page::{Figure, Made, Section, render};
use simulation::{Nature, Outcome, Poses};

pub use platform::{Platforms, platforms};
pub use touches::touches;

/// How true arms are drawn and what they are asked, as people give it.
#[derive(Clone, Debug)]
pub struct Common {
    /// True arms drawn for each setting.
    pub trials: u64,
    /// Seed of all chance: the same seed gives the same bytes.
    pub seed: u64,
    /// Candidates a ball.
    pub pool: usize,
    /// What chosen touches are best for.
    pub criterion: Criterion,
    /// With [`Criterion::Region`]: the whole workspace instead of the sphere.
    pub whole_workspace: bool,
    /// Parameters to identify; geometry alone where the arm has no masses.
    pub set: ParameterSet,
    /// Standard deviation of every length of a true arm.
    pub length_mm: f64,
    /// Standard deviation of every angle of a true arm.
    pub angle_deg: f64,
    /// Least and largest compliance of its joints.
    pub compliance_deg_per_nm: Vec<f64>,
    /// Noise of an indicator.
    pub indicator_mm: f64,
    /// Noise of the procedure, along each axis.
    pub procedure_mm: f64,
    /// Noise of each coordinate of a ball's known place.
    pub ballbar_mm: f64,
}

impl Default for Common {
    /// The paper's numbers.
    fn default() -> Self {
        Self {
            trials: 40,
            seed: 1,
            pool: 100,
            criterion: Criterion::Determinant,
            whole_workspace: false,
            set: ParameterSet::Compliance,
            length_mm: 1.0,
            angle_deg: 1.0,
            compliance_deg_per_nm: vec![1e-3, 1e-1],
            indicator_mm: 0.001,
            procedure_mm: 0.010,
            ballbar_mm: 0.001,
        }
    }
}

/// A setting that makes no sense.
#[derive(Debug, thiserror::Error)]
#[error("{name}: {problem}")]
pub struct WrongSetting {
    /// The field of [`Common`] or [`Platforms`], or `per_ball`.
    pub name: &'static str,
    /// What was found, and what was expected.
    pub problem: String,
}

impl From<WrongSetting> for Error {
    fn from(e: WrongSetting) -> Self {
        Self::Input(e.to_string())
    }
}

/// Whether settings make sense.
type Checked<T = ()> = std::result::Result<T, WrongSetting>;

fn wrong<T>(name: &'static str, problem: String) -> Checked<T> {
    Err(WrongSetting { name, problem })
}

impl Common {
    /// Whether these numbers make sense.
    ///
    /// # Errors
    /// Where they do not.
    pub fn check(&self) -> Checked {
        self.nature().map(|_| ())
    }

    fn nature(&self) -> Checked<Nature> {
        let at_least_0 = [
            ("length_mm", self.length_mm),
            ("angle_deg", self.angle_deg),
            ("indicator_mm", self.indicator_mm),
            ("procedure_mm", self.procedure_mm),
            ("ballbar_mm", self.ballbar_mm),
        ];
        for (name, value) in at_least_0 {
            if !(value.is_finite() && (0.0..=20.0).contains(&value)) {
                return wrong(name, format!("found {value}, expected 0 to 20"));
            }
        }
        let [low, high] = match self.compliance_deg_per_nm.as_slice() {
            [a, b] if *a > 0.0 && a <= b && b.is_finite() => [a.to_radians(), b.to_radians()],
            other => {
                let problem = format!("found {other:?}, expected a least and a largest one above 0");
                return wrong("compliance_deg_per_nm", problem);
            }
        };
        if self.trials == 0 {
            return wrong("trials", "found 0, expected 1 or more".into());
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
        if robot.require_masses().is_err() { ParameterSet::Geometry } else { self.set }
    }

    fn options(&self, known: &Model) -> PlanOptions {
        PlanOptions {
            seed: self.seed,
            pool_per_ball: self.pool,
            per_ball: 1,
            parameters: Some(known.terms.clone()),
            criterion: self.criterion,
            whole_workspace: self.whole_workspace,
            ..PlanOptions::default()
        }
    }
}

/// How a study ended, to be told, written and drawn.
pub struct Study {
    /// The numbers for people; the first row is the header.
    pub table: Vec<Vec<String>>,
    /// Every trial, or every platform, as text.
    pub csv: String,
    /// The curves.
    pub svg: String,
    /// The answer in a sentence or two.
    pub verdict: String,
    /// What else is to be said.
    pub notes: Vec<String>,
    /// The numbers for machines.
    pub json: Value,
    title: &'static str,
    sections: Vec<Section>,
}

/// Panels in one drawing, for a file, and in a figure each, for a page of any width.
fn drawn(x: &str, y: &str, panels: &[(String, Vec<Band>)], caption: &str) -> Result<(String, Vec<Figure>)> {
    let figure = |(k, one): (usize, &[(String, Vec<Band>)])| {
        let caption = if k == 0 { caption.to_owned() } else { String::new() };
        Ok(Figure::new(caption, plots::panels(x, y, one)?))
    };
    Ok((plots::panels(x, y, panels)?, panels.chunks(1).enumerate().map(figure).collect::<Result<_>>()?))
}

impl Study {
    /// The report.
    pub fn html(&self, made: &Made) -> Result<String> {
        render(self.title, &self.verdict, &self.sections, made)
    }
}

/// The part of the work that is done when `done` of `of` are.
fn share(done: usize, of: usize) -> f64 {
    done as f64 / of.max(1) as f64
}

/// Trials on all processors, in order; each is asked whether it is still wanted.
fn trials<T: Send>(count: u64, one: impl Fn(u64) -> Result<T> + Sync) -> Result<Vec<T>> {
    let trial = |stop: &Shared, k| {
        stop.part(|| {
            checkpoint()?;
            one(k)
        })
    };
    let done = shared(|stop| (0..count).into_par_iter().map(|k| trial(stop, k)).collect::<Result<Vec<T>>>());
    // a fit that was stopped has given up, which is no result
    checkpoint()?;
    done
}

/// Where errors are looked at: poses that the nominal arm takes without meeting anything.
fn poses(robot: &Robot, cell: &Cell, seed: u64) -> Result<Poses> {
    let model = CollisionModel::new(robot, cell)?;
    let sphere = Sphere::above(&cell.balls).ok_or_else(|| Error::Input("the cell has no [balls]".into()))?;
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
        pool.extend(generate::generate(&model, ball, options, &trical_model::Task::silent())?.0);
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
        let at =
            |share: f64| v.get(((v.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN);
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        Self { mean, low: at(0.1), high: at(0.9) }
    }
}

const SPHERE: fn(&Outcome) -> f64 = |o| o.sphere[0];
const WORKSPACE: fn(&Outcome) -> f64 = |o| o.workspace[0];

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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_spread_is_the_mean_and_the_middle_four_fifths() {
        let s = Spread::of((0..=100).rev().map(f64::from));
        assert_eq!((s.mean, s.low, s.high), (50.0, 10.0, 90.0));
        let one = Spread::of(std::iter::once(3.0));
        assert_eq!((one.mean, one.low, one.high), (3.0, 3.0, 3.0));
        assert!(Spread::of(std::iter::empty()).mean.is_nan());
    }

    #[test]
    fn a_wrong_setting_is_named_beside_its_problem() {
        let per_ball = Common::default().check_touches(&[5, 101]).unwrap_err();
        assert_eq!(per_ball.name, "per_ball");
        assert_eq!(per_ball.problem, "found [5, 101], expected numbers of 1 to 100, the pool of a ball");
        assert!(Common::default().check_touches(&[1, 100]).is_ok() && Common::default().check_touches(&[0]).is_err());
        let platforms = |balls: usize, side_mm: f64| {
            Platforms { touches: 45, balls: vec![balls], side_mm: vec![side_mm], ..Platforms::default() }.check()
        };
        assert!(platforms(3, 21.0).is_ok() && platforms(45, 21.0).is_ok());
        for (balls, side, name) in
            [(2, 21.0, "balls"), (46, 21.0, "balls"), (3, 20.0, "side_mm"), (3, f64::NAN, "side_mm")]
        {
            let e = platforms(balls, side).unwrap_err();
            assert_eq!(e.name, name);
            assert_eq!(Error::from(e).to_string().split(':').next(), Some(name));
        }
    }

    #[test]
    fn trials_come_back_in_their_order_and_one_that_fails_ends_them() {
        assert_eq!(trials(200, |k| Ok(k * k)).unwrap(), (0..200).map(|k| k * k).collect::<Vec<u64>>());
        let failed = trials(200, |k| if k == 7 { Err(Error::Input("seven".into())) } else { Ok(k) });
        assert_eq!(failed.unwrap_err().to_string(), "seven");
    }

    #[test]
    fn numbers_of_a_study_are_taken_in_si_and_refused_where_they_make_no_sense() {
        let nature = Common {
            length_mm: 2.0,
            angle_deg: 9.0,
            indicator_mm: 3.0,
            procedure_mm: 4.0,
            ballbar_mm: 5.0,
            compliance_deg_per_nm: vec![0.5, 1.0],
            ..Common::default()
        }
        .nature()
        .unwrap();
        assert_eq!([nature.length, nature.indicator, nature.procedure, nature.ballbar], [2e-3, 3e-3, 4e-3, 5e-3]);
        assert_eq!((nature.angle, nature.compliance[0]), (9.0_f64.to_radians(), 0.5_f64.to_radians()));
        assert!((nature.compliance[1] - 1.0_f64.to_radians()).abs() < 1e-12);
        let refused = |c: Common| c.check().unwrap_err().to_string();
        assert!(refused(Common { procedure_mm: -1.0, ..Common::default() }).starts_with("procedure_mm: found -1"));
        assert!(refused(Common { angle_deg: f64::NAN, ..Common::default() }).starts_with("angle_deg: found NaN"));
        assert!(refused(Common { trials: 0, ..Common::default() }).starts_with("trials"));
        for bad in [vec![], vec![1.0], vec![2.0, 1.0], vec![0.0, 1.0], vec![1.0, f64::INFINITY]] {
            assert!(
                refused(Common { compliance_deg_per_nm: bad, ..Common::default() })
                    .starts_with("compliance_deg_per_nm")
            );
        }
    }
}
