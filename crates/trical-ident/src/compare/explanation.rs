//! What may have changed: for each explanation the terms of the model that tell it.

use std::ops::Range;

use trical_model::{Axis, Basis, Model, Motion, Scope, Site, Term};

use super::settings::{EXPANSION, FEW};
use crate::dataset::{Dataset, told_of_tool};
use crate::model_file::{ModelFile, Uncertainty};

/// Something that may have changed.
pub(super) struct Explanation {
    pub what: String,
    pub scope: Scope,
    /// Terms of the model that tell it; of a wrong measurement none.
    pub terms: Range<usize>,
    /// Index of the one measurement that is wrong.
    pub measurement: Option<usize>,
}

impl Explanation {
    /// Whether the arm or its setup changed, and not one measurement is wrong.
    pub fn is_of_machine(&self) -> bool {
        self.measurement.is_none()
    }
}

/// The old model with a term for each number that may have changed.
pub(super) struct Explained {
    pub model: Model,
    pub explanations: Vec<Explanation>,
    /// Terms of the old calibration, with their places in its covariance.
    pub calibrated: Vec<(usize, usize)>,
    /// Terms that are new in any case, such as a tracker's frame.
    pub new: Vec<usize>,
    /// Terms of what differs from day to day without anything having changed, and by how much.
    pub of_the_day: Vec<(usize, Daily)>,
    /// Of each measurement, whether it is at joint angles that the calibration was not fitted at.
    pub beyond: Vec<bool>,
}

/// How much something differs from day to day.
#[derive(Clone, Copy)]
pub(super) enum Daily {
    /// Its coefficient has this standard deviation.
    Sd(f64),
    /// All such together move a coordinate by what happened in the course of the sessions of the calibration ([`Uncertainty::course`]).
    Course,
}

impl Explained {
    /// `warmer` is by how much another temperature it may have been measured at, K.
    pub fn of(model: Model, data: &Dataset, file: &ModelFile, old: &Uncertainty, warmer: f64) -> Self {
        let here = |t: &Term| {
            t.basis.session.is_some_and(|s| data.observations.iter().any(|o| o.state.session == Some(s)))
                || matches!(t.site, Site::Frame { frame, .. } if data.observations.iter().any(|o| o.frame + 1 == frame))
        };
        let (mut calibrated, mut new) = (Vec::new(), Vec::new());
        for (k, t) in model.terms.iter().enumerate() {
            match old.names.iter().position(|n| *n == t.name) {
                Some(place) => calibrated.push((k, place)),
                // a load of its own is known from the cell file
                None if here(t) && t.scope() == Scope::Setup && !matches!(t.site, Site::Payload(_)) => new.push(k),
                None => {}
            }
        }
        let visited = file.visited();
        let beyond = data.observations.iter().map(|o| visited.beyond(&o.state.q).is_some()).collect();
        let mut out = Self { model, explanations: Vec::new(), calibrated, new, of_the_day: Vec::new(), beyond };
        out.add_of_the_day(warmer, file);
        for joint in 1..=out.model.robot.dof() {
            let name = format!("joint {joint}");
            out.add(name.clone(), Scope::Arm, vec![(name, Site::Joint { joint })]);
        }
        out.add("tool".into(), Scope::Setup, tool_sites(&out.model, data));
        // where the frame or the balls' places are new, they take up whatever the base did
        if out.new.iter().all(|k| matches!(out.model.terms[*k].site, Site::Tool(_) | Site::Target { .. })) {
            let base =
                |motions: &[Motion]| motions.iter().map(|m| (format!("base {}", m.name()), Site::Base(*m))).collect();
            out.add("base".into(), Scope::Setup, base(&Motion::ALL[..3]));
            out.add("base (place and direction)".into(), Scope::Setup, base(&Motion::ALL));
        }
        if data.observations.len() <= FEW {
            let end = out.model.terms.len();
            out.explanations.extend(data.observations.iter().enumerate().map(|(row, o)| Explanation {
                what: format!("the measurement of line {}", o.line),
                scope: Scope::Reading,
                terms: end..end,
                measurement: Some(row),
            }));
        }
        out
    }

    /// Growth with temperature, and wherever something happened in the course of the calibration's sessions that the model says nothing of here.
    fn add_of_the_day(&mut self, warmer: f64, file: &ModelFile) {
        let is_left = |t: &&Term| t.scope() == Scope::Course && self.model.terms.iter().all(|m| m.name != t.name);
        let mut days = vec![(Site::Links, Daily::Sd(EXPANSION * warmer))];
        for t in file.model.terms.iter().filter(is_left) {
            if days.iter().all(|(site, daily)| *site != t.site || matches!(daily, Daily::Sd(_))) {
                days.push((t.site, Daily::Course));
            }
        }
        for (site, daily) in days {
            self.of_the_day.push((self.model.terms.len(), daily));
            self.model.terms.push(Term::new("of the day", "of the day", site, Basis::CONSTANT));
        }
    }

    fn add(&mut self, what: String, scope: Scope, sites: Vec<(String, Site)>) {
        let first = self.model.terms.len();
        let term = |(name, site)| Term::new(name, "change", site, Basis::CONSTANT);
        self.model.terms.extend(sites.into_iter().map(term));
        self.explanations.push(Explanation { what, scope, terms: first..self.model.terms.len(), measurement: None });
    }
}

/// What measurements see of the tool, by its names: the TCP, with poses its direction, targets.
fn tool_sites(model: &Model, data: &Dataset) -> Vec<(String, Site)> {
    let (motions, targets) = told_of_tool(model.cell.tool.targets.len(), data.observations.iter().map(|o| o.measured));
    let site = |target, axis: Axis| (format!("target {target} {}", axis.name()), Site::Target { target, axis });
    let of_target = |target| Axis::ALL.map(|axis| site(target, axis));
    let motions = motions.iter().map(|m| (format!("tool {}", m.name()), Site::Tool(*m)));
    motions.chain(targets.into_iter().flat_map(of_target)).collect()
}
