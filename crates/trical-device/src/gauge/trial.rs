//! For a person with a cable in hand: how still the gauge stands, whether its axes follow their stems, mastering.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use thiserror::Error;

use super::{AXES, Gauge, GaugeError, bare_url, open_gauge, settled_reading, with_zero};

/// A stem has been pushed when its axis moves by more than this, m.
const ENOUGH: f64 = 0.5e-3;

/// What readings of one axis say, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTrial {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// From the least to the largest.
    pub spread: f64,
    /// Smallest difference between two different readings.
    pub step: Option<f64>,
}

impl AxisTrial {
    /// Of the readings of an axis.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let sd = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt();
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let spread = sorted.last().copied().unwrap_or(mean) - sorted.first().copied().unwrap_or(mean);
        let steps = sorted.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-10);
        Self { mean, sd, spread, step: steps.min_by(f64::total_cmp) }
    }
}

/// How a gauge answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// What the device says of itself.
    pub says: Vec<String>,
    /// Each reading, m.
    pub readings: Vec<[f64; 3]>,
    /// s for a reading of all three axes.
    pub seconds_each: f64,
    /// What they say, x, y, z.
    pub axes: [AxisTrial; 3],
}

/// Why a stem did not answer, or does not touch.
#[derive(Debug, Error)]
pub enum StemError {
    /// The gauge failed.
    #[error(transparent)]
    Gauge(#[from] GaugeError),
    /// Another axis moved.
    #[error(
        "axis {found} moved by {moved_mm:.3} mm, expected axis {expected}: exchange the channels or ports in the URL"
    )]
    OtherAxis {
        /// The axis that moved.
        found: char,
        /// By how much, mm.
        moved_mm: f64,
        /// The axis that was asked for.
        expected: char,
    },
    /// Mastering without a calibrator.
    #[error(
        "the stem along {axis} reads {reading_mm:+.3} mm on the calibrator and the same in the air: it touches nothing there"
    )]
    InTheAir {
        /// The axis.
        axis: char,
        /// What it reads both times, mm.
        reading_mm: f64,
    },
    /// None moved.
    #[error("axis {axis} did not move by {} mm within {seconds:.0} s: is its transmitter alive?", ENOUGH * 1e3)]
    Still {
        /// The axis that was asked for.
        axis: char,
        /// How long it was given, s.
        seconds: f64,
    },
}

/// Reads so many times as fast as the gauge answers.
///
/// # Errors
/// What [`Gauge::describe`] and [`Gauge::read`] say, or cancellation.
pub fn trial(gauge: &mut dyn Gauge, count: usize, cancel: &AtomicBool) -> Result<Trial, GaugeError> {
    let says = gauge.describe()?;
    let begin = Instant::now();
    let mut readings = Vec::new();
    for _ in 0..count {
        if cancel.load(Ordering::Relaxed) {
            return Err(GaugeError::Cancelled);
        }
        readings.push(gauge.read()?);
    }
    let seconds_each = begin.elapsed().as_secs_f64() / count.max(1) as f64;
    let axes = std::array::from_fn(|k| AxisTrial::of(&readings.iter().map(|r: &[f64; 3]| r[k]).collect::<Vec<_>>()));
    Ok(Trial { says, readings, seconds_each, axes })
}

/// Waits until an axis (from 0) moves by more than half a millimetre, and no other by as much; by how much it did, m.
///
/// # Errors
/// Another axis moved, or none did in time; what the gauge says, or cancellation.
pub fn stem_answers(gauge: &mut dyn Gauge, axis: usize, wait: Duration, cancel: &AtomicBool) -> Result<f64, StemError> {
    let name = |k: usize| AXES.get(k).copied().unwrap_or('?');
    let before = gauge.read()?;
    let begin = Instant::now();
    while begin.elapsed() < wait {
        if cancel.load(Ordering::Relaxed) {
            return Err(GaugeError::Cancelled.into());
        }
        let now = gauge.read()?;
        let by: [f64; 3] = std::array::from_fn(|k| now[k] - before[k]);
        let (most, far) =
            by.iter().enumerate().fold((0, 0.0), |b, (k, x)| if x.abs() > b.1 { (k, x.abs()) } else { b });
        if far > ENOUGH {
            if most != axis {
                return Err(StemError::OtherAxis { found: name(most), moved_mm: by[most] * 1e3, expected: name(axis) });
            }
            return Ok(by[most]);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Err(StemError::Still { axis: name(axis), seconds: wait.as_secs_f64() })
}

/// A gauge that was mastered.
#[derive(Clone, Debug, PartialEq)]
pub struct Mastering {
    /// What it shows on the calibrator, m.
    pub zero: [f64; 3],
    /// Its URL from now on.
    pub url: String,
    /// Warnings of the device.
    pub warnings: Vec<String>,
}

/// Reads a gauge whose three stems are on the calibrator; an earlier mastering in its URL does not count.
///
/// # Errors
/// What [`open_gauge`] and [`settled_reading`] say.
pub fn master(url: &str, cancel: &AtomicBool) -> Result<Mastering, GaugeError> {
    let mut gauge = open_gauge(&bare_url(url))?;
    let settle = gauge.settle();
    let zero = settled_reading(gauge.as_mut(), &settle, cancel)?;
    Ok(Mastering { zero, url: with_zero(url, zero), warnings: gauge.take_warnings() })
}

/// Whether all three stems touch the calibrator: each reads another value there than in the air. Both m.
///
/// # Errors
/// [`StemError::InTheAir`] names the first that does not.
pub fn check_on_calibrator(in_the_air: &[f64; 3], on_calibrator: &[f64; 3]) -> Result<(), StemError> {
    for ((axis, air), reading) in AXES.iter().zip(in_the_air).zip(on_calibrator) {
        if (air - reading).abs() < ENOUGH {
            return Err(StemError::InTheAir { axis: *axis, reading_mm: reading * 1e3 });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn mean_scatter_and_finest_step_of_an_axis() {
        let axis = AxisTrial::of(&[1e-3, 1.001e-3, 1.001e-3, 1.003e-3]);
        assert!((axis.mean - 1.00125e-3).abs() < 1e-12 && (axis.spread - 3e-6).abs() < 1e-12);
        assert!((axis.step.unwrap() - 1e-6).abs() < 1e-12);
        // 0.25, 0.25, 1.25, 1.75 um off: sqrt(4.75 / 3)
        assert!((axis.sd - (4.75_f64 / 3.0).sqrt() * 1e-6).abs() < 1e-12, "{axis:?}");
        assert_eq!(AxisTrial::of(&[2e-3, 2e-3]).step, None);
    }

    #[test]
    fn stems_in_the_air_are_no_mastering() {
        let air = [6e-3; 3];
        assert!(check_on_calibrator(&air, &[1e-3, -2e-3, 0.0]).is_ok());
        let said = check_on_calibrator(&air, &[1e-3, 5.9e-3, 0.0]).unwrap_err().to_string();
        assert!(said.contains("the stem along y reads +5.900 mm on the calibrator"), "{said}");
    }

    #[test]
    fn a_mastering_is_taken_out_of_a_url_and_nothing_else() {
        assert_eq!(bare_url("uwave:///dev/x?x=00&zero_mm=1,2,3&flip=z"), "uwave:///dev/x?x=00&flip=z");
        assert_eq!(bare_url("itn:///dev/x?zero_mm=1,2,3"), "itn:///dev/x");
    }
}
