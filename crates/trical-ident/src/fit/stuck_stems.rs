//! Indicators that do not follow the arm: a stem that is stuck reads the same whatever the arm does. No row of it looks wrong by itself,
//! and a fit takes what it hides for noise.

use trical_model::touch::reading_at;
use trical_model::{Cell, Measured, Robot};

use crate::dataset::Dataset;
use crate::dataset::sample::sample;
use crate::error::{IdentError, Result};
use crate::fit::gross_errors::robust_fit_of_the_richest;
use crate::rigid::median;

/// With fewer touches two indicators alone do not determine an arm.
const FEWEST: usize = 30;

/// A stem is looked at where its readings spread less than a third of those of each other one: stems that follow are nulled alike.
const NARROW: f64 = 3.0;

/// It does not follow where the arm, fitted to the other two, says that it should be this many times farther from what it
/// reads than those two are, and than its own readings spread.
const FAR: f64 = 5.0;

/// Fits to the other two, each with this one's readings put to what the fit before says. Where it is stuck, three are enough.
const ROUNDS: usize = 6;

/// Refuses recordings with an indicator that does not follow.
///
/// # Errors
/// [`trical_recording::RecordError::File`] names recording and indicator. Data that cannot be fitted is left to the fit itself to tell of.
pub fn refuse_stuck_stems(robot: &Robot, cell: &Cell, data: &Dataset) -> Result<()> {
    for (recording, name) in data.names.iter().enumerate() {
        let readings: Vec<[f64; 3]> = data
            .observations
            .iter()
            .filter(|o| o.recording == recording)
            .filter_map(|o| if let Measured::Touch { reading, .. } = o.measured { Some(reading) } else { None })
            .collect();
        if readings.len() < FEWEST {
            continue;
        }
        let spread: [f64; 3] = std::array::from_fn(|axis| spread(readings.iter().map(|r| r[axis]).collect()));
        for axis in 0..3 {
            let narrow = (0..3).all(|other| other == axis || spread[axis] * NARROW < spread[other]);
            if !narrow {
                continue;
            }
            let Ok(Some((off, others))) = misses(robot, cell, data, recording, axis, spread[axis]) else { continue };
            return Err(IdentError::of_file(
                name,
                format!(
                    "indicator {} does not follow: its {} readings spread by {:.4} mm, but by the other two indicators, which agree \
                     to {:.3} mm, the arm was {:.3} mm from what it reads (medians); free its stem and measure again",
                    ["x", "y", "z"][axis],
                    readings.len(),
                    spread[axis] * 1e3,
                    others * 1e3,
                    off * 1e3
                ),
            ));
        }
    }
    Ok(())
}

/// The width that holds the middle eight tenths of some values.
fn spread(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = |tenths: usize| values.get(values.len() * tenths / 10).copied().unwrap_or_default();
    at(9) - at(1)
}

/// How far this indicator is from the arm that the other two say, and how far they are, m (medians); `None` where it follows.
fn misses(
    robot: &Robot,
    cell: &Cell,
    data: &Dataset,
    recording: usize,
    axis: usize,
    spread: f64,
) -> Result<Option<(f64, f64)>> {
    let data = sample(data).unwrap_or_else(|| data.clone());
    let mut filled = data.clone();
    for _ in 0..ROUNDS {
        let (forward, _) = robust_fit_of_the_richest(robot, cell, &filled)?;
        let mut ws = forward.workspace();
        let (mut off, mut others) = (Vec::new(), Vec::new());
        for (o, measured) in filled.observations.iter_mut().zip(&data.observations) {
            let (Measured::Touch { ball, reading }, Measured::Touch { reading: read, .. }) =
                (&mut o.measured, measured.measured)
            else {
                continue;
            };
            if o.recording != recording {
                continue;
            }
            let says = reading_at(&forward, &o.state, *ball, &mut ws);
            reading[axis] = says[axis];
            for k in 0..3 {
                let list = if k == axis { &mut off } else { &mut others };
                list.push((says[k] - read[k]).abs());
            }
        }
        let (off, others) = (median(&off), median(&others));
        if off > FAR * others.max(spread) {
            return Ok(Some((off, others)));
        }
    }
    Ok(None)
}
