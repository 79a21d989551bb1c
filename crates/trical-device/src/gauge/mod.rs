//! Gauges: anything that says where the ball's centre is, relative to the TCP, in the device's axes.

pub mod line;
pub mod line_protocol;
mod open;
pub mod port;
pub mod trial;
pub mod uwave;
pub mod uwave_protocol;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use thiserror::Error;

use crate::url::UrlError;

pub use line::{LINE_GAUGES, LineGauge, LineKind, LineSettings};
pub use open::{bare_url, open_gauge, with_zero};
pub use port::{Port, PortInfo, SerialSettings, list_ports, open_serial};
pub use uwave::{UWave, UWaveSettings};

/// Names of the three axes of the device, for messages.
pub const AXES: [char; 3] = ['x', 'y', 'z'];

/// A device that reads three lengths.
pub trait Gauge: Send {
    /// What it is and where, for messages.
    fn name(&self) -> String;

    /// One reading as it comes: the ball's centre relative to the TCP in the device's axes, in m.
    ///
    /// # Errors
    /// The device does not answer, or answers that it has no value.
    fn read(&mut self) -> Result<[f64; 3], GaugeError>;

    /// When a reading of this gauge is taken as standing still.
    fn settle(&self) -> Settle {
        Settle::default()
    }

    /// Warnings since the last call (a low battery, say), each one sentence.
    fn take_warnings(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// What the device says of itself, one line each; for a person who tries the cable.
    ///
    /// # Errors
    /// The device does not answer, or answers something else.
    fn describe(&mut self) -> Result<Vec<String>, GaugeError> {
        Ok(Vec::new())
    }
}

/// Why a gauge gave no reading.
#[derive(Debug, Error)]
pub enum GaugeError {
    /// The URL cannot be used.
    #[error(transparent)]
    Url(#[from] UrlError),
    /// The port could not be opened.
    #[error("gauge port {port}: cannot be opened ({reason})")]
    Open {
        /// Path of the port.
        port: String,
        /// What the operating system said.
        reason: String,
    },
    /// The port failed while in use.
    #[error("gauge {gauge}: the port failed ({source})")]
    Io {
        /// Name of the gauge.
        gauge: String,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// No answer at all.
    #[error("gauge {gauge}, axis {axis}: no answer to {request:?} in {attempts} attempts of {seconds} s each")]
    Silent {
        /// Name of the gauge.
        gauge: String,
        /// Which axis was asked.
        axis: char,
        /// The request that was sent.
        request: String,
        /// How often.
        attempts: u32,
        /// Time-out of each attempt in s.
        seconds: f64,
    },
    /// An answer that is none.
    #[error("gauge {gauge}, axis {axis}: answered \"{found}\", expected {expected}")]
    Garbage {
        /// Name of the gauge.
        gauge: String,
        /// Which axis was asked.
        axis: char,
        /// What came, shortened.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// The receiver reports a status instead of a value.
    #[error("gauge {gauge}, axis {axis} (channel {channel:02}): {status}")]
    Status {
        /// Name of the gauge.
        gauge: String,
        /// Which axis was asked.
        axis: char,
        /// Channel of the transmitter.
        channel: u8,
        /// What the receiver says.
        status: uwave_protocol::Status,
    },
    /// The instrument reports an error of its own.
    #[error("gauge {gauge}, axis {axis}: the instrument answered \"{found}\" ({meaning})")]
    Instrument {
        /// Name of the gauge.
        gauge: String,
        /// Which axis was asked.
        axis: char,
        /// What came.
        found: String,
        /// What it means.
        meaning: &'static str,
    },
    /// The readings do not come to rest.
    #[error(
        "gauge {gauge}: readings still differ by {spread_mm:.4} mm on axis {axis} after {seconds:.1} s, expected {tolerance_mm:.4} mm or less"
    )]
    NotSettled {
        /// Name of the gauge.
        gauge: String,
        /// The axis that moves most.
        axis: char,
        /// Spread of the last readings in mm.
        spread_mm: f64,
        /// Spread that would be accepted in mm.
        tolerance_mm: f64,
        /// How long it was given, in s.
        seconds: f64,
    },
    /// The user asked to stop.
    #[error("stopped by the user while reading the gauge")]
    Cancelled,
}

/// When a reading is taken as standing still.
#[derive(Clone, Debug, PartialEq)]
pub struct Settle {
    /// Number of consecutive readings that must agree; at least 2, or a held value cannot be told from a moving one.
    pub repeats: usize,
    /// Pause between readings. Radio latency of the U-WAVE is not known \[I\]: keep it above 0.1 s with hardware.
    pub interval: Duration,
    /// Largest difference among the agreeing readings on each axis, m.
    pub tolerance: f64,
    /// How long to try.
    pub timeout: Duration,
}

impl Default for Settle {
    fn default() -> Self {
        Self { repeats: 3, interval: Duration::from_millis(200), tolerance: 1.1e-6, timeout: Duration::from_secs(10) }
    }
}

/// Reads until the last readings agree; gives their mean, m.
///
/// # Errors
/// What [`Gauge::read`] says, readings that do not come to rest, or cancellation.
pub fn settled_reading(gauge: &mut dyn Gauge, settle: &Settle, cancel: &AtomicBool) -> Result<[f64; 3], GaugeError> {
    let repeats = settle.repeats.max(2);
    let begin = Instant::now();
    let mut last: Vec<[f64; 3]> = Vec::with_capacity(repeats);
    loop {
        if cancel.load(Ordering::Relaxed) {
            return Err(GaugeError::Cancelled);
        }
        if last.len() == repeats {
            last.remove(0);
        }
        last.push(gauge.read()?);
        let spread = spread(&last);
        let (axis, worst) =
            spread.iter().enumerate().fold((0, 0.0), |best, (axis, &s)| if s > best.1 { (axis, s) } else { best });
        if last.len() == repeats && worst <= settle.tolerance {
            let count = last.len() as f64;
            return Ok(std::array::from_fn(|axis| last.iter().map(|r| r[axis]).sum::<f64>() / count));
        }
        if last.len() == repeats && begin.elapsed() >= settle.timeout {
            return Err(GaugeError::NotSettled {
                gauge: gauge.name(),
                axis: AXES.get(axis).copied().unwrap_or('?'),
                spread_mm: worst * 1e3,
                tolerance_mm: settle.tolerance * 1e3,
                seconds: begin.elapsed().as_secs_f64(),
            });
        }
        if !settle.interval.is_zero() {
            std::thread::sleep(settle.interval);
        }
    }
}

/// A gauge that reads relative to where it was mastered.
///
/// On the calibrator all three stems define the TCP: what the gauge shows there is taken off every reading. Not needed
/// where the indicators themselves were set to zero.
pub struct Mastered {
    /// As it shows.
    pub gauge: Box<dyn Gauge>,
    /// What it shows on the calibrator, m.
    pub zero: [f64; 3],
}

impl Gauge for Mastered {
    fn name(&self) -> String {
        self.gauge.name()
    }

    fn read(&mut self) -> Result<[f64; 3], GaugeError> {
        let reading = self.gauge.read()?;
        Ok(std::array::from_fn(|axis| reading[axis] - self.zero[axis]))
    }

    fn settle(&self) -> Settle {
        self.gauge.settle()
    }

    fn take_warnings(&mut self) -> Vec<String> {
        self.gauge.take_warnings()
    }

    fn describe(&mut self) -> Result<Vec<String>, GaugeError> {
        self.gauge.describe()
    }
}

fn spread(readings: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let values = readings.iter().map(|reading| reading[axis]);
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        high - low
    })
}

/// Bytes as text for a message: at most 60 characters, control characters escaped.
pub(crate) fn shorten(bytes: &[u8]) -> String {
    let text = bytes.get(..60).unwrap_or(bytes).escape_ascii();
    format!("{text}{}", if bytes.len() > 60 { "..." } else { "" })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    struct Scripted(Vec<[f64; 3]>);

    impl Gauge for Scripted {
        fn name(&self) -> String {
            "script".to_owned()
        }
        fn read(&mut self) -> Result<[f64; 3], GaugeError> {
            Ok(if self.0.len() > 1 { self.0.remove(0) } else { self.0[0] })
        }
    }

    #[test]
    fn a_reading_is_accepted_only_after_it_repeats() {
        let settle = Settle { repeats: 3, interval: Duration::ZERO, ..Settle::default() };
        let mut gauge = Scripted(vec![
            [0.0; 3],
            [1e-3, 0.0, 0.0],
            [1.5e-3, 0.0, 0.0],
            [2e-3, 0.0, 0.0],
            [2e-3, 1e-6, 0.0],
            [2e-3, 0.0, 0.0],
        ]);
        let value = settled_reading(&mut gauge, &settle, &AtomicBool::new(false)).unwrap();
        assert!((value[0] - 2e-3).abs() < 1e-12, "{value:?}");
    }

    #[test]
    fn a_mastered_gauge_reads_from_the_calibrator() {
        let gauge = Box::new(Scripted(vec![[1.5e-3, 2e-3, 2e-3]]));
        let reading = Mastered { gauge, zero: [1e-3, 2e-3, 3e-3] }.read().unwrap();
        for (found, expected) in reading.iter().zip([0.5e-3, 0.0, -1e-3]) {
            assert!((found - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn a_reading_that_never_rests_is_an_error_that_names_the_axis() {
        struct Restless(f64);
        impl Gauge for Restless {
            fn name(&self) -> String {
                "restless".to_owned()
            }
            fn read(&mut self) -> Result<[f64; 3], GaugeError> {
                self.0 += 1e-4;
                Ok([0.0, self.0, 0.0])
            }
        }
        let settle =
            Settle { timeout: Duration::from_millis(5), interval: Duration::from_millis(1), ..Settle::default() };
        let error = settled_reading(&mut Restless(0.0), &settle, &AtomicBool::new(false)).unwrap_err();
        assert!(error.to_string().contains("differ by 0.2000 mm on axis y"), "{error}");
        let error = settled_reading(&mut Restless(0.0), &settle, &AtomicBool::new(true)).unwrap_err();
        assert!(matches!(error, GaugeError::Cancelled));
    }
}
