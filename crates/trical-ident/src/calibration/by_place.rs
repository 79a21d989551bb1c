//! What a calibration is worth at a place of the balls that it never saw, and which physics it should have by that measure.
//!
//! The arm is identified from all places but one. Of that place only the pose of the balls is unknown: it is identified from half of the
//! touches there, and the other half is scored. Distances between balls there, as that arm measures them, are a check.

use nalgebra::Vector3;
use serde::Serialize;
use trical_model::{Cell, Forward, Measured, Model, Robot, Site};

use crate::dataset::{Dataset, Observation};
use crate::error::Result;
use crate::fit::ball_places::{self, BallPlace, place_of, terms, training_poses, unknown_places};
use crate::fit::choice::{Choice, ParameterSet};
use crate::fit::identify::{ErrorSummary, Fit, identify, refit};
use crate::fit::initial_guess::initial_guess_of_sessions;
use crate::fit::residuals::position_errors;
use crate::rigid::median_point;

/// Fewer places than this cannot choose: an arm that is identified from one says little of the next. All that is usual is then added.
const PLACES: usize = 3;

/// At fewer poses than this the place of the balls is not found from half of them.
const POSES: usize = 4;

/// A place whose errors are so many times those of the middle place is told: balls moved there, or some rows belong to another one.
const BEYOND_OTHERS: f64 = 3.0;

/// A richer model has to lower the mean error at places that it did not see by so much.
const WORTH: f64 = 0.99;

/// Distance between two balls at a place, as the arm that was identified at the other places measures it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredDistance {
    /// Name of the place.
    pub place: String,
    /// The two balls, from 1.
    pub balls: [usize; 2],
    /// By the cell file, mm.
    pub cell_mm: f64,
    /// By the arm, mm.
    pub measured_mm: f64,
}

/// Errors at places that the fit did not see.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ByPlace {
    /// Position errors, m, in the order of places.
    pub errors: Vec<f64>,
    /// Distances between balls.
    pub distances: Vec<MeasuredDistance>,
    /// What each place is like.
    pub places: Vec<OfPlace>,
}

/// What the arm that the other places say is worth at one place.
#[derive(Clone, Debug, PartialEq)]
pub struct OfPlace {
    /// Name of the place.
    pub place: String,
    /// How many poses were measured there.
    pub poses: usize,
    /// Line of the first of them.
    pub line: usize,
    /// Root of the mean square, mm; `None` where the poses are too few to find the place and to score it.
    pub rms_mm: Option<f64>,
}

/// Places that make one look twice, in a sentence each: of few poses, and those whose rows disagree.
#[must_use]
pub fn doubtful_places(places: &[OfPlace]) -> Vec<String> {
    let few = |p: &&OfPlace| p.rms_mm.is_none();
    let alone = places.iter().filter(few).map(|p| {
        format!(
            "place {} has {} pose{}, the first in line {}: too few to find where the balls stood and to check it; is the name right?",
            p.place,
            p.poses,
            if p.poses == 1 { "" } else { "s" },
            p.line
        )
    });
    let mut errors: Vec<f64> = places.iter().filter_map(|p| p.rms_mm).collect();
    errors.sort_by(f64::total_cmp);
    let middle = errors.get(errors.len().saturating_sub(1) / 2).copied().unwrap_or(0.0);
    let disagree = places.iter().filter_map(|p| {
        let rms = p.rms_mm.filter(|rms| errors.len() >= PLACES && *rms > BEYOND_OTHERS * middle)?;
        Some(format!(
            "the model fitted at the other places misses place {} by {rms:.3} mm rms (median of the places: {middle:.3} mm): did \
             the balls move there, or have rows of it the wrong place or ball? What was measured after a move needs a name of its own",
            p.place
        ))
    });
    alone.chain(disagree).collect()
}

/// Physics beyond geometry that was tried because places are held out, and what it was worth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TriedByPlace {
    /// What was added, in words; "nothing" for what was asked.
    pub added: &'static str,
    /// Mean error at places held out, mm; `null` where there are too few places to tell.
    pub mean_mm: Option<f64>,
    /// Whether the calibration has it.
    pub kept: bool,
}

/// Scores every place by `fit` to the others; nothing where there are none.
///
/// # Errors
/// As the fit.
pub fn score_places(cell: &Cell, data: &Dataset, fit: Fit<'_>) -> Result<ByPlace> {
    let mut out = ByPlace::default();
    let places = unknown_places(cell, data);
    for place in places.iter().copied().filter(|_| places.len() > 1) {
        let others = fit(&data.filtered(|o| place_of(o) != Some(place)))?;
        let here = data.filtered(|o| place_of(o) == Some(place));
        let poses = here.used_poses().len();
        let errors = if poses < POSES { Vec::new() } else { score_place(&others.model, &here, place)? };
        out.places.push(OfPlace {
            place: ball_places::name(data, place),
            poses,
            line: here.observations.first().map_or(0, |o| o.line),
            rms_mm: (!errors.is_empty()).then(|| ErrorSummary::of(&errors).rms_mm),
        });
        out.errors.extend(errors);
        out.distances.extend(distances(&others.model, &here, place)?);
    }
    Ok(out)
}

/// Errors (m) at one place by a model that does not know where the balls stood there; all observations of `data` are of that place.
fn score_place(model: &Model, data: &Dataset, place: BallPlace) -> Result<Vec<f64>> {
    let mut model = model.clone();
    model.terms.retain(|t| !matches!(t.site, Site::Fixture(_) | Site::Ball { .. }) || !t.basis.is_local());
    model.terms.extend(terms(&model.cell, data, place));
    let own: Vec<usize> = (0..model.terms.len()).filter(|k| model.terms[*k].effect == "place").collect();
    let poses = training_poses(data, true);
    let mut errors = Vec::new();
    for half in [true, false] {
        let trains = |o: &Observation| poses.contains(&o.pose) == half;
        let train = data.filtered(trains);
        let mut fitted = model.clone();
        initial_guess_of_sessions(&mut fitted, &train, &own)?;
        let forward = refit(fitted, own.clone(), &train)?;
        errors.extend(position_errors(&forward, &data.filtered(|o| !trains(o))));
    }
    Ok(errors)
}

/// Distances between the balls of one place as the model's arm measures them.
fn distances(model: &Model, data: &Dataset, place: BallPlace) -> Result<Vec<MeasuredDistance>> {
    let forward = Forward::new(model.clone(), Vec::new())?;
    let mut ws = forward.workspace();
    let mut seen: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); model.cell.balls.len()];
    for o in &data.observations {
        if let Measured::Touch { ball, reading } = o.measured
            && let Some(points) = seen.get_mut(ball)
        {
            let tool = forward.world_from_tool(&o.state, &mut ws);
            points.push(tool.apply(&Vector3::from(reading)));
        }
    }
    let middle = |ball: usize| median_point(&seen[ball]);
    let balls: Vec<usize> = (0..seen.len()).filter(|b| !seen[*b].is_empty()).collect();
    let pairs = balls.iter().flat_map(|a| balls.iter().filter(move |b| a < b).map(move |b| (*a, *b)));
    Ok(pairs
        .map(|(a, b)| MeasuredDistance {
            place: ball_places::name(data, place),
            balls: [a + 1, b + 1],
            cell_mm: (model.cell.balls[a] - model.cell.balls[b]).norm() * 1e3,
            measured_mm: (middle(a) - middle(b)).norm() * 1e3,
        })
        .collect())
}

/// Robot and parameters with the physics that lowers the error at places held out, and what was tried. Nothing is added where `choice` asks
/// for less than compliance, and all where fewer than three places cannot tell. What may be added: harmonics of each joint's error over its own angle
/// (once and twice a turn), and, for a robot without masses, sag under links that are taken to weigh alike.
///
/// # Errors
/// None that a fit of `choice` would not have.
pub fn choose(
    robot: &Robot,
    cell: &Cell,
    data: &Dataset,
    choice: &Choice,
) -> Result<(Robot, Choice, Vec<TriedByPlace>)> {
    let as_asked = (robot.clone(), choice.clone(), Vec::new());
    let places = unknown_places(cell, data).len();
    if choice.set() < ParameterSet::Compliance || places == 0 {
        return Ok(as_asked);
    }
    let even = robot.with_even_masses();
    let waves = choice.clone().with_waves();
    let mut candidates = vec![("nothing", robot, choice.clone()), ("harmonics of each joint", robot, waves.clone())];
    if let Some(even) = &even {
        candidates.push(("sag with equal link masses", even, choice.clone()));
        candidates.push(("sag with equal link masses, harmonics of each joint", even, waves));
    }
    if places < PLACES {
        return Ok(candidates.pop().map_or(as_asked, |(added, robot, choice)| {
            (robot.clone(), choice, vec![TriedByPlace { added, mean_mm: None, kept: true }])
        }));
    }
    let mut tried = Vec::new();
    for (added, robot, choice) in &candidates {
        let fit = |data: &Dataset| identify(robot, cell, data, choice.clone());
        let mean = score_places(cell, data, &fit).map(|s| ErrorSummary::of(&s.errors).mean_mm);
        tried.push(TriedByPlace { added, mean_mm: mean.ok(), kept: false });
    }
    let error = |k: usize| tried[k].mean_mm.unwrap_or(f64::INFINITY);
    let best = (0..tried.len()).min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap_or(0);
    let best = if error(best) < WORTH * error(0) { best } else { 0 };
    tried[best].kept = true;
    let (_, robot, choice) = candidates.swap_remove(best);
    Ok((robot.clone(), choice, tried))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_whose_rows_disagree_and_one_of_few_poses_are_told() {
        let of =
            |place: &str, poses: usize, rms_mm: Option<f64>| OfPlace { place: place.into(), poses, line: 7, rms_mm };
        let usual = [of("a", 20, Some(0.2)), of("b", 20, Some(0.3)), of("c", 20, Some(0.5))];
        assert!(doubtful_places(&usual).is_empty());
        let moved = [&usual[..2], &[of("c", 20, Some(0.7)), of("d", 20, Some(1.2))]].concat();
        let said = doubtful_places(&moved);
        assert!(
            said.len() == 1 && said[0].contains("misses place d by 1.200 mm rms (median of the places: 0.300 mm)"),
            "{said:?}"
        );
        // of two places nothing tells which
        assert!(doubtful_places(&[of("a", 20, Some(0.2)), of("b", 20, Some(1.3))]).is_empty());
        let said = doubtful_places(&[&usual[..], &[of("lfet", 1, None)]].concat());
        assert!(said.len() == 1 && said[0].starts_with("place lfet has 1 pose, the first in line 7"), "{said:?}");
    }
}
