//! Noise of measurements that follow each other, where it is correlated: drifting air, a stem that sticks, a tracker's long waves.
//!
//! Effects that change slowly look like such noise, and noise like them. So both are explanations of the same residuals: the noise as
//! a process that keeps a share of itself from one measurement to the next, beside a white part; what the residuals say is
//! judged after a filter that makes such noise white (Kalman 1960; generalised least squares).

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use trical_ident::dataset::{Dataset, Observation};
use trical_ident::dense::Mat;
use trical_model::{Measured, residual_rows};

use crate::settings::{AUTOCORRELATIONS, CORRELATED_NATS, CORRELATION_LENGTHS, WHITE_SHARES};

/// Where the best of them is looked for first, as indices into both.
const FIRST: [(usize, usize); 3] = [(3, 0), (5, 2), (7, 3)];

/// Columns that are made white at once.
const AT_ONCE: usize = 8;

/// How noise is correlated from one measurement to the next: AR(1), beside a white part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrelatedNoise {
    /// The correlated part keeps this share of itself from one measurement to the next.
    pub kept: f64,
    /// Share of the variance that is white.
    pub white: f64,
}

impl CorrelatedNoise {
    /// White noise.
    pub const WHITE: Self = Self { kept: 0.0, white: 1.0 };

    /// What to tell of it, if anything.
    #[must_use]
    pub fn caution(&self) -> Option<String> {
        (*self != Self::WHITE).then(|| {
            format!(
                "noise is correlated from one measurement to the next (correlation {:.2}); probabilities and standard deviations take that into \
                 account",
                self.kept * (1.0 - self.white)
            )
        })
    }

    /// The correlation of the greatest likelihood; `nats` says how likely the residuals are with one, of recordings of `length` measurements.
    /// None where white noise is about as likely.
    ///
    /// # Errors
    /// Those of `nats`.
    pub fn likeliest<E>(length: usize, mut nats: impl FnMut(Self) -> Result<f64, E>) -> Result<(Self, f64), E> {
        let longest = length as f64 / CORRELATION_LENGTHS;
        let count = AUTOCORRELATIONS.iter().filter(|kept| -libm::log(**kept).recip() <= longest).count();
        let at = |(k, w): (usize, usize)| Self { kept: AUTOCORRELATIONS[k], white: WHITE_SHARES[w] };
        let none = nats(Self::WHITE)?;
        let mut known: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for place in FIRST.into_iter().filter(|p| p.0 < count) {
            known.insert(place, nats(at(place))?);
        }
        let best = |known: &BTreeMap<(usize, usize), f64>| {
            known.iter().max_by(|a, b| a.1.total_cmp(b.1)).map_or((FIRST[0], f64::MIN), |(place, n)| (*place, *n))
        };
        // the likelihood has one hill; where nothing is on it at all, white noise stays
        while best(&known).1 > none - 2.0 * CORRELATED_NATS {
            let (k, w) = best(&known).0;
            let beside = [(k.wrapping_sub(1), w), (k + 1, w), (k, w.wrapping_sub(1)), (k, w + 1)];
            let new: Vec<_> = beside
                .into_iter()
                .filter(|p| p.0 < count && p.1 < WHITE_SHARES.len() && !known.contains_key(p))
                .collect();
            if new.is_empty() {
                break;
            }
            for place in new {
                known.insert(place, nats(at(place))?);
            }
        }
        let (place, most) = best(&known);
        Ok(if most > none + CORRELATED_NATS { (at(place), most - CORRELATED_NATS) } else { (Self::WHITE, none) })
    }
}

/// Which measurements are correlated: those of one recording and one target, in their order.
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

/// What the filter does to one scalar.
#[derive(Clone, Copy)]
struct Step {
    /// Standard deviation of what cannot be foreseen.
    root: f64,
    /// Share of that in the next forecast.
    gain: f64,
    /// The scalar before it in its chain.
    before: Option<usize>,
}

/// The filter `W` that makes such noise white: of a column with an entry for every scalar of the data, what could not be foreseen from
/// the measurements before. It is the inverse root of the noise's correlations: `W'W` is their inverse.
#[derive(Clone)]
pub struct Filter {
    /// Of the noise that it makes white.
    pub correlation: CorrelatedNoise,
    steps: Vec<Step>,
}

impl Filter {
    /// For noise of a correlation in the data.
    #[must_use]
    pub fn new(correlation: CorrelatedNoise, data: &Dataset) -> Self {
        let CorrelatedNoise { kept, white } = correlation;
        let mut steps: Vec<Step> = Vec::new();
        // first scalar of the last measurement of each chain, and the variance of the correlated part as it is predicted after it
        let mut ends: BTreeMap<Chain, (usize, f64)> = BTreeMap::new();
        for o in data.observations.iter().filter(|_| correlation != CorrelatedNoise::WHITE) {
            let rows = residual_rows(&o.measured);
            let chain = Chain::of(o, rows);
            let end = ends.get(&chain);
            let variance = end.map_or(1.0 - white, |e| e.1);
            let total = variance + white;
            let gain = variance / total;
            let first = steps.len();
            steps.extend((0..rows).map(|k| Step { root: total.sqrt(), gain, before: end.map(|e| e.0 + k) }));
            let next = kept * kept * variance * (1.0 - gain) + (1.0 - kept * kept) * (1.0 - white);
            ends.insert(chain, (first, next));
        }
        Self { correlation, steps }
    }

    /// Whether there is anything to do.
    #[must_use]
    pub fn works(&self) -> bool {
        !self.steps.is_empty()
    }

    /// Logarithm of the determinant of the noise's correlations.
    #[must_use]
    pub fn log_determinant(&self) -> f64 {
        2.0 * self.steps.iter().map(|s| libm::log(s.root)).sum::<f64>()
    }

    /// `W` times a column.
    pub fn apply(&self, column: &mut [f64]) {
        let mut rows: Vec<[f64; 1]> = column.iter().map(|v| [*v]).collect();
        self.whiten(&mut rows);
        column.iter_mut().zip(&rows).for_each(|(v, row)| *v = row[0]);
    }

    /// `W` times each column, some at a time: each row hangs on one before it, so that several take hardly longer than one.
    pub fn apply_to_all(&self, columns: &mut Mat) {
        let mut rows = vec![[0.0; AT_ONCE]; if self.works() { columns.nrows() } else { 0 }];
        for first in (0..columns.ncols()).step_by(AT_ONCE).take_while(|_| self.works()) {
            let some = first..columns.ncols().min(first + AT_ONCE);
            for (k, column) in some.clone().enumerate() {
                rows.iter_mut().zip(columns.col(column)).for_each(|(row, v)| row[k] = *v);
            }
            self.whiten(&mut rows);
            for (k, column) in some.enumerate() {
                rows.iter().zip(columns.col_mut(column)).for_each(|(row, v)| *v = row[k]);
            }
        }
    }

    fn whiten<const N: usize>(&self, rows: &mut [[f64; N]]) {
        let mut forecasts = vec![[0.0; N]; self.steps.len()];
        for (at, step) in self.steps.iter().enumerate() {
            if let Some(b) = step.before {
                let gain = self.steps[b].gain * self.steps[b].root;
                let (before, new) = (forecasts[b], rows[b]);
                forecasts[at] = std::array::from_fn(|k| self.correlation.kept * (before[k] + gain * new[k]));
            }
            let (forecast, of_one) = (forecasts[at], 1.0 / step.root);
            rows[at] = std::array::from_fn(|k| (rows[at][k] - forecast[k]) * of_one);
        }
    }

    /// `W'` times a column.
    pub fn apply_transposed(&self, column: &mut [f64]) {
        let mut of_forecasts = vec![0.0; self.steps.len()];
        for (row, step) in self.steps.iter().enumerate().rev() {
            let next = self.correlation.kept * of_forecasts[row];
            let new = column[row] / step.root + step.gain * next;
            if let Some(b) = step.before {
                of_forecasts[b] = next - new;
            }
            column[row] = new;
        }
    }
}

/// Turns the world axes of a touch's scalars (and of their columns, one scalar after the other) into the device's, whose noise it is: `tool`
/// is its orientation in the world.
pub fn in_device_axes(tool: &Matrix3<f64>, scalars: &mut [f64]) {
    let width = scalars.len() / 3;
    for column in 0..width {
        let turned = tool.tr_mul(&Vector3::from_fn(|k, _| scalars[k * width + column]));
        (0..3).for_each(|k| scalars[k * width + column] = turned[k]);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use trical_model::{Recording, Row, State};

    use trical_ident::dataset::JointSource;

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

    /// Wherever the hill is, it is climbed to its top, and white noise stays where there is none.
    #[test]
    fn the_likeliest_is_found_wherever_it_is() {
        let place = |c: CorrelatedNoise| {
            let k = AUTOCORRELATIONS.iter().position(|kept| *kept == c.kept)?;
            Some((k, WHITE_SHARES.iter().position(|white| *white == c.white)?))
        };
        for top in (0..AUTOCORRELATIONS.len()).flat_map(|k| (0..WHITE_SHARES.len()).map(move |w| (k, w))) {
            let nats = |height: f64| {
                move |c: CorrelatedNoise| {
                    let apart = |p: (usize, usize)| (p.0.abs_diff(top.0).pow(2) + p.1.abs_diff(top.1).pow(2)) as f64;
                    Ok::<_, ()>(place(c).map_or(0.0, |p| height - 0.5 * apart(p)))
                }
            };
            let (found, most) = CorrelatedNoise::likeliest(100_000, nats(50.0)).unwrap();
            assert_eq!((place(found), most), (Some(top), 50.0 - CORRELATED_NATS));
            let (found, most) = CorrelatedNoise::likeliest(100_000, nats(0.9 * CORRELATED_NATS)).unwrap();
            assert_eq!((found, most), (CorrelatedNoise::WHITE, 0.0));
        }
        // too few measurements for slow noise
        let slow = |c: CorrelatedNoise| Ok::<_, ()>(100.0 * c.kept);
        let (found, _) = CorrelatedNoise::likeliest(45, slow).unwrap();
        assert!(found.kept > 0.7 && found.kept < 0.85, "{found:?}");
    }

    /// As many points of two targets in turn.
    fn points(count: usize) -> Dataset {
        let row = |k| Row {
            state: State::at(&[0.1 * f64::from(k); 6]),
            measured: Measured::Point { target: usize::from(k % 2 == 1), position: [0.0; 3] },
            seq: None,
            line: 2,
        };
        let rows = (0..u16::try_from(count).unwrap()).map(row).collect();
        Dataset::build(
            &[Recording { name: "made".into(), joints: 6, rows, ..Recording::default() }],
            JointSource::Read,
            None,
        )
        .unwrap()
    }

    fn nats(correlation: CorrelatedNoise, sequence: &[[f64; 3]], data: &Dataset) -> f64 {
        let filter = Filter::new(correlation, data);
        let mut white = sequence.concat();
        filter.apply(&mut white);
        let square: f64 = white.iter().map(|v| v * v).sum();
        let n = white.len() as f64;
        -0.5 * (n * square.ln() + filter.log_determinant())
    }

    fn likeliest(kept: f64, white: f64) -> CorrelatedNoise {
        // two chains, each of which is such noise
        let [a, b] = [noise(kept, white, 600), noise(kept, white, 1200)[600..].to_vec()];
        let both: Vec<[f64; 3]> = a.into_iter().zip(b).flat_map(|(a, b)| [a, b]).collect();
        let data = points(both.len());
        CorrelatedNoise::likeliest(600, |m| Ok::<f64, ()>(nats(m, &both, &data))).unwrap().0
    }

    #[test]
    fn correlated_noise_is_told_from_white_noise() {
        assert_eq!(likeliest(0.0, 1.0), CorrelatedNoise::WHITE);
        let (sequence, data) = (noise(0.95, 0.0, 200), points(200));
        let short = CorrelatedNoise::likeliest(100, |m| Ok::<f64, ()>(nats(m, &sequence, &data))).unwrap().0;
        assert!(short.kept <= 0.9, "{short:?}: ten spans are what is known of noise");
        let one = likeliest(0.6, 0.0);
        assert!((one.kept - 0.6).abs() < 0.11 && one.white < 0.3, "{one:?}");
        let mixed = likeliest(0.95, 0.5);
        assert!((mixed.kept - 0.95).abs() < 0.06 && (mixed.white - 0.5).abs() < 0.25, "{mixed:?}");
    }

    /// The filter is that of the whole covariance matrix of each chain; the transposed filter is its transpose.
    #[test]
    fn the_filter_is_the_inverse_root_of_the_covariance() {
        let data = points(8);
        let filter = Filter::new(CorrelatedNoise { kept: 0.7, white: 0.3 }, &data);
        let of = |apply: &dyn Fn(&mut [f64])| {
            let mut all = nalgebra::DMatrix::<f64>::identity(24, 24);
            all.column_iter_mut().for_each(|mut c| apply(c.as_mut_slice()));
            all
        };
        let w = of(&|c| filter.apply(c));
        assert!((of(&|c| filter.apply_transposed(c)) - w.transpose()).amax() < 1e-12);
        // scalars of one axis and one target are correlated
        let covariance = nalgebra::DMatrix::from_fn(24, 24, |i: usize, j: usize| {
            let apart = i.abs_diff(j) / 6;
            match i.abs_diff(j) % 6 {
                0 if apart == 0 => 1.0,
                0 => 0.7 * 0.7_f64.powi(i32::try_from(apart).unwrap()),
                _ => 0.0,
            }
        });
        assert!((&w * &covariance * w.transpose() - nalgebra::DMatrix::identity(24, 24)).amax() < 1e-12);
        assert!((filter.log_determinant() - covariance.determinant().ln()).abs() < 1e-12);
    }
}
