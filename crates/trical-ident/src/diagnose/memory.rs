//! Noise of measurements that follow each other, where it remembers itself: drifting air, a stem that sticks, a tracker's long waves.
//!
//! Effects that change slowly look like such noise, and noise like them. So both are explanations of the same residuals: the noise as
//! a process that keeps a share of itself from one measurement to the next, beside a white part; what the residuals say is
//! judged after a filter that makes such noise white (Kalman 1960; generalised least squares).

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use trical_model::Measured;

use crate::dataset::Observation;

/// A memory must better the likelihood of white noise by so many nats, as what has no name must that of names.
const REMEMBERS: f64 = 5.0;

/// A process is noise where recordings hold so many of its spans (the measurements after which an e-th is left); beyond, it is a drift, and
/// the effects say of what.
const SPANS: f64 = 10.0;

/// Shares that may be kept from one measurement to the next, and shares of the variance that may be white.
const KEPT: [f64; 10] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98];
const WHITE: [f64; 6] = [0.0, 0.25, 0.5, 0.7, 0.85, 0.95];

/// Where the best of them is looked for first, as indices into both.
const FIRST: [(usize, usize); 3] = [(3, 0), (5, 2), (7, 3)];

/// How noise remembers itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory {
    /// What is kept of the part that remembers, from one measurement to the next.
    pub kept: f64,
    /// Share of the variance that remembers nothing.
    pub white: f64,
}

impl Memory {
    /// White noise.
    pub const NONE: Self = Self { kept: 0.0, white: 1.0 };

    /// What to tell of it, if anything.
    #[must_use]
    pub fn caution(&self) -> Option<String> {
        (*self != Self::NONE).then(|| {
            format!(
                "noise remembers itself: what no effect explains is alike in measurements that follow each other (correlation {:.2} from one \
                 to the next); effects were judged beside such noise, but standard deviations are stated as if it were white",
                self.kept * (1.0 - self.white)
            )
        })
    }

    /// The memory of the greatest likelihood; `nats` says how likely the residuals are with one, of recordings of `length` measurements.
    /// None where white noise is about as likely.
    ///
    /// # Errors
    /// Those of `nats`.
    pub fn likeliest<E>(length: usize, mut nats: impl FnMut(Self) -> Result<f64, E>) -> Result<(Self, f64), E> {
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let longest = length as f64 / SPANS;
        let count = KEPT.iter().filter(|kept| -kept.ln().recip() <= longest).count();
        let at = |(k, w): (usize, usize)| Self { kept: KEPT[k], white: WHITE[w] };
        let none = nats(Self::NONE)?;
        let mut known: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for place in FIRST.into_iter().filter(|p| p.0 < count) {
            known.insert(place, nats(at(place))?);
        }
        let best = |known: &BTreeMap<(usize, usize), f64>| {
            known.iter().max_by(|a, b| a.1.total_cmp(b.1)).map_or((FIRST[0], f64::MIN), |(place, n)| (*place, *n))
        };
        // the likelihood has one hill; where nothing is on it at all, white noise stays
        while best(&known).1 > none - 2.0 * REMEMBERS {
            let (k, w) = best(&known).0;
            let beside = [(k.wrapping_sub(1), w), (k + 1, w), (k, w.wrapping_sub(1)), (k, w + 1)];
            let new: Vec<_> =
                beside.into_iter().filter(|p| p.0 < count && p.1 < WHITE.len() && !known.contains_key(p)).collect();
            if new.is_empty() {
                break;
            }
            for place in new {
                known.insert(place, nats(at(place))?);
            }
        }
        let (place, most) = best(&known);
        Ok(if most > none + REMEMBERS { (at(place), most - REMEMBERS) } else { (Self::NONE, none) })
    }
}

/// Which measurements remember each other: those of one recording and one target, in their order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Chain {
    recording: usize,
    target: Option<usize>,
    rows: usize,
}

impl Chain {
    fn of(o: &Observation, rows: usize) -> Self {
        let target = match o.measured {
            Measured::Point { target, .. } => Some(target),
            Measured::Distance { anchor, .. } => Some(anchor),
            _ => None,
        };
        Self { recording: o.recording, target, rows }
    }
}

/// What the filter did to one scalar.
#[derive(Clone, Copy)]
struct Step {
    /// Standard deviation of what was not foreseen.
    root: f64,
    /// Share of that in the next forecast.
    gain: f64,
    /// The scalar before it in its chain.
    before: Option<usize>,
}

/// The filter that makes such noise white, row after row; and back.
pub struct Filter {
    memory: Memory,
    ends: BTreeMap<Chain, End>,
    steps: Vec<Step>,
}

/// Where a chain has come to.
struct End {
    /// Variance of the part that remembers, as foreseen.
    variance: f64,
    /// Forecast of every entry of both parts.
    forecast: [Vec<f64>; 2],
    /// Its first scalar.
    row: usize,
}

impl Filter {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(memory: Memory) -> Self {
        Self { memory, ends: BTreeMap::new(), steps: Vec::new() }
    }

    /// Whether there is anything to do.
    #[must_use]
    pub fn works(&self) -> bool {
        self.memory != Memory::NONE
    }

    /// Makes the next observation's `rows` scalars white: its residual, and its columns one scalar after the other. Those of touches, which
    /// are in world axes, are turned into the device's, whose noise it is: `tool` is its orientation in the world.
    pub fn next(&mut self, o: &Observation, rows: usize, tool: &Matrix3<f64>, mut parts: [&mut [f64]; 2]) {
        if rows == 0 || !self.works() {
            return;
        }
        if matches!(o.measured, Measured::Touch { .. }) {
            for values in &mut parts {
                let width = values.len() / rows;
                for column in 0..width {
                    let turned = tool.tr_mul(&Vector3::from_fn(|k, _| values[k * width + column]));
                    for k in 0..3 {
                        values[k * width + column] = turned[k];
                    }
                }
            }
        }
        let Memory { kept, white } = self.memory;
        let chain = Chain::of(o, rows);
        let (before, variance, mut forecast) = match self.ends.remove(&chain) {
            Some(e) => (Some(e.row), e.variance, e.forecast),
            None => (None, 1.0 - white, [0, 1].map(|k| vec![0.0; parts[k].len()])),
        };
        let total = variance + white;
        let gain = variance / total;
        let root = total.sqrt();
        for (values, forecast) in parts.into_iter().zip(&mut forecast) {
            for (v, a) in values.iter_mut().zip(forecast) {
                let new = *v - *a;
                *a = kept * (*a + gain * new);
                *v = new / root;
            }
        }
        let row = self.steps.len();
        self.steps.extend((0..rows).map(|k| Step { root, gain, before: before.map(|b| b + k) }));
        let variance = kept * kept * variance * (1.0 - gain) + (1.0 - kept * kept) * (1.0 - white);
        self.ends.insert(chain, End { variance, forecast, row });
    }

    /// Logarithm of the determinant of the noise's correlations.
    #[must_use]
    pub fn log_determinant(&self) -> f64 {
        2.0 * self.steps.iter().map(|s| s.root.ln()).sum::<f64>()
    }

    /// A whole column as it was, turned into the device's axes.
    pub fn undo(&self, column: &mut [f64]) {
        let mut forecasts = vec![0.0; self.steps.len()];
        for (row, step) in self.steps.iter().enumerate() {
            // what the scalar before left for this one
            if let Some(b) = step.before {
                let new = column[b] - forecasts[b];
                forecasts[row] = self.memory.kept * (forecasts[b] + self.steps[b].gain * new);
            }
            column[row] = column[row] * step.root + forecasts[row];
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use trical_model::State;

    /// Residuals that keep `kept` of the one before, with `white` beside.
    fn noise(kept: f64, white: f64, count: usize) -> Vec<[f64; 3]> {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        let mut any = move || {
            let mut sum = 0.0;
            for _ in 0..12 {
                sum += rng.random_range(-0.5..0.5);
            }
            sum
        };
        let mut slow = [0.0; 3].map(|_: f64| any());
        (0..count)
            .map(|_| {
                slow = slow.map(|v| kept * v + (1.0 - kept * kept).sqrt() * any());
                slow.map(|v| (1.0 - white).sqrt() * v + white.sqrt() * any())
            })
            .collect()
    }

    fn point(target: usize) -> Observation {
        Observation {
            state: State::at(&[0.0; 6]),
            measured: Measured::Point { target, position: [0.0; 3] },
            frame: 0,
            pose: 0,
            recording: 0,
            row: 1,
            line: 2,
        }
    }

    /// Filters a sequence as the points of two targets in turn.
    fn filtered(memory: Memory, sequence: &[[f64; 3]]) -> (Filter, Vec<f64>) {
        let mut filter = Filter::new(memory);
        let mut out = Vec::new();
        for (k, v) in sequence.iter().enumerate() {
            let (mut residual, mut columns) = (*v, v.map(|x| 2.0 * x));
            filter.next(&point(k % 2), 3, &Matrix3::identity(), [&mut residual, &mut columns]);
            assert!(residual.iter().zip(&columns).all(|(r, c)| (2.0 * r - c).abs() < 1e-12));
            out.extend(residual);
        }
        (filter, out)
    }

    fn nats(memory: Memory, sequence: &[[f64; 3]]) -> f64 {
        let (filter, white) = filtered(memory, sequence);
        let square: f64 = white.iter().map(|v| v * v).sum();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let n = white.len() as f64;
        -0.5 * (n * square.ln() + filter.log_determinant())
    }

    fn told(kept: f64, white: f64) -> Memory {
        // two chains, each of which is such noise
        let [a, b] = [noise(kept, white, 600), noise(kept, white, 1200)[600..].to_vec()];
        let both: Vec<[f64; 3]> = a.into_iter().zip(b).flat_map(|(a, b)| [a, b]).collect();
        Memory::likeliest(600, |m| Ok::<f64, ()>(nats(m, &both))).unwrap().0
    }

    #[test]
    fn noise_that_remembers_itself_is_told_from_noise_that_does_not() {
        assert_eq!(told(0.0, 1.0), Memory::NONE);
        let sequence = noise(0.95, 0.0, 100);
        let short = Memory::likeliest(100, |m| Ok::<f64, ()>(nats(m, &sequence))).unwrap().0;
        assert!(short.kept <= 0.9, "{short:?}: ten spans are what is known of noise");
        let one = told(0.6, 0.0);
        assert!((one.kept - 0.6).abs() < 0.11 && one.white < 0.3, "{one:?}");
        let mixed = told(0.95, 0.5);
        assert!((mixed.kept - 0.95).abs() < 0.06 && (mixed.white - 0.5).abs() < 0.25, "{mixed:?}");
    }

    /// The likelihood is that of the whole covariance matrix of one chain, decomposed at once.
    #[test]
    fn the_filter_is_the_inverse_root_of_the_covariance() {
        let memory = Memory { kept: 0.7, white: 0.3 };
        let mut filter = Filter::new(memory);
        let mut rows = Vec::new();
        for k in 0..6 {
            let mut unit = [[0.0; 6]; 3];
            unit[0][k] = 1.0;
            let mut columns: Vec<f64> = unit.concat();
            filter.next(&point(0), 3, &Matrix3::identity(), [&mut [0.0; 3], &mut columns]);
            rows.push(columns[..6].to_vec());
        }
        let w = nalgebra::DMatrix::from_fn(6, 6, |i, j| rows[i][j]);
        let covariance = nalgebra::DMatrix::from_fn(6, 6, |i, j| {
            let apart = i32::try_from(i.abs_diff(j)).unwrap();
            if apart == 0 { 1.0 } else { 0.7 * 0.7_f64.powi(apart) }
        });
        let identity = &w * &covariance * w.transpose();
        assert!((identity - nalgebra::DMatrix::identity(6, 6)).amax() < 1e-12);
        assert!((filter.log_determinant() - 3.0 * covariance.determinant().ln()).abs() < 1e-12);
    }

    #[test]
    fn what_was_filtered_can_be_undone() {
        let sequence = noise(0.5, 0.5, 20);
        let (filter, mut column) = filtered(Memory { kept: 0.8, white: 0.25 }, &sequence);
        filter.undo(&mut column);
        assert!(column.iter().zip(sequence.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
