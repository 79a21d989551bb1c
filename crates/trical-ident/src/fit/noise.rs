//! How uncertain measurements are: a standard deviation for each kind of scalar of each recording.

use trical_model::Measured;

use crate::dataset::Dataset;

/// Below this (m, rad) a residual is rounding.
const SMALLEST: f64 = 1e-12;

/// Kinds of scalars that share a standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Touch,
    Point,
    Distance,
    Position,
    Rotation,
}

fn kind(measured: &Measured, row: usize) -> Kind {
    match measured {
        Measured::Touch { .. } => Kind::Touch,
        Measured::Point { .. } | Measured::Reference { .. } => Kind::Point,
        Measured::Distance { .. } => Kind::Distance,
        Measured::Pose { .. } if row < 3 => Kind::Position,
        Measured::Pose { .. } => Kind::Rotation,
    }
}

/// Scalars that the noise of each recording borrows from all that are of their kind, where there are several.
const BORROWED: f64 = 12.0;

/// Standard deviations, per recording.
#[derive(Clone, Debug)]
pub struct Noise {
    sigma: Vec<[f64; 5]>,
}

impl Noise {
    /// What is usual before the data has spoken: 0.01 mm for touches, points and distances; 0.05 mm and 0.1 mrad for poses.
    #[must_use]
    pub fn usual(recordings: usize) -> Self {
        Self { sigma: vec![[1e-5, 1e-5, 1e-5, 5e-5, 1e-4]; recordings] }
    }

    /// Usual noise, but that of touches of printed sockets, whose play is some tenths of a millimetre: 0.2 mm.
    #[must_use]
    pub fn of_sockets(recordings: usize) -> Self {
        let mut noise = Self::usual(recordings);
        noise.sigma.iter_mut().for_each(|s| s[Kind::Touch as usize] = 2e-4);
        noise
    }

    /// Standard deviation of scalar `row` of a measurement of recording `recording`, m or rad.
    #[inline]
    #[must_use]
    pub fn sigma(&self, recording: usize, measured: &Measured, row: usize) -> f64 {
        self.sigma[recording][kind(measured, row) as usize]
    }

    /// Re-estimates each group's standard deviation from weighted residuals (`residuals` in units of the present sigma,
    /// one slice of 6 an observation), each group paying its share of the `parameters` that were fitted. Returns by which
    /// factor all of them grew, if it is one factor (there is but one group): then no fit would come out otherwise.
    pub fn update(&mut self, data: &Dataset, residuals: &[([f64; 6], usize)], parameters: usize) -> Option<f64> {
        let mut squares = Squares::new(self.sigma.len());
        for (o, (r, rows)) in data.observations.iter().zip(residuals) {
            squares.add(o.recording, &o.measured, &r[..*rows]);
        }
        self.update_from(&squares, parameters)
    }

    /// As [`Noise::update`], from sums of squares.
    pub(crate) fn update_from(&mut self, squares: &Squares, parameters: usize) -> Option<f64> {
        let share = (1.0 - parameters as f64 / squares.count()).max(0.1);
        let (mut factor, mut groups) = (1.0, 0);
        let all = self.of_all(squares);
        for (sigma, sums) in self.sigma.iter_mut().zip(&squares.sums) {
            for ((s, (square, n)), (of_all, n_all)) in sigma.iter_mut().zip(sums).zip(&all) {
                if *n > 0.0 {
                    groups += 1;
                }
                if *n >= 6.0 {
                    let before = *s;
                    // what a fit with much of its own makes of a small session looks exact
                    let (square, n) = if n_all > n {
                        (square + BORROWED * of_all / (n_all * *s * *s), n + BORROWED)
                    } else {
                        (*square, *n)
                    };
                    *s = (*s * (square / (n * share)).sqrt()).max(SMALLEST);
                    factor = *s / before;
                }
            }
        }
        (groups <= 1).then_some(factor)
    }

    /// Of all recordings, by kind of scalar: sum of squares, SI, and number.
    fn of_all(&self, squares: &Squares) -> [(f64, f64); 5] {
        let mut all = [(0.0, 0.0); 5];
        for (sigma, sums) in self.sigma.iter().zip(&squares.sums) {
            for (of_all, (s, (square, n))) in all.iter_mut().zip(sigma.iter().zip(sums)) {
                of_all.0 += square * s * s;
                of_all.1 += n;
            }
        }
        all
    }

    /// Re-estimates each group's standard deviation from the median of its absolute weighted residuals, so that gross
    /// errors do not count.
    pub fn update_robustly(&mut self, data: &Dataset, residuals: &[([f64; 6], usize)]) {
        let mut groups: Vec<[Vec<f64>; 5]> = vec![std::array::from_fn(|_| Vec::new()); self.sigma.len()];
        for (o, (r, rows)) in data.observations.iter().zip(residuals) {
            for (k, v) in r.iter().enumerate().take(*rows) {
                groups[o.recording][kind(&o.measured, k) as usize].push(v.abs());
            }
        }
        for (sigma, groups) in self.sigma.iter_mut().zip(&groups) {
            for (s, values) in sigma.iter_mut().zip(groups) {
                if values.len() >= 6 {
                    *s = (*s * crate::rigid::median(values) / 0.6745).max(SMALLEST);
                }
            }
        }
    }
}

impl Noise {
    /// Whether no standard deviation differs by more than this fraction.
    pub(crate) fn is_near(&self, other: &Self, fraction: f64) -> bool {
        self.sigma.iter().flatten().zip(other.sigma.iter().flatten()).all(|(a, b)| (a - b).abs() <= fraction * b)
    }
}

/// Sums of squared weighted residuals, per recording and kind of scalar.
#[derive(Clone, Debug)]
pub(crate) struct Squares {
    sums: Vec<[(f64, f64); 5]>,
}

impl Squares {
    pub fn new(recordings: usize) -> Self {
        Self { sums: vec![[(0.0, 0.0); 5]; recordings] }
    }

    /// The scalars of one measurement.
    pub fn add(&mut self, recording: usize, measured: &Measured, weighted: &[f64]) {
        for (k, v) in weighted.iter().enumerate() {
            let s = &mut self.sums[recording][kind(measured, k) as usize];
            s.0 += v * v;
            s.1 += 1.0;
        }
    }

    /// Those of another part of the data.
    pub fn join(&mut self, other: &Self) {
        for (a, b) in self.sums.iter_mut().flatten().zip(other.sums.iter().flatten()) {
            a.0 += b.0;
            a.1 += b.1;
        }
    }

    /// Sum of all squares.
    pub fn total(&self) -> f64 {
        self.sums.iter().flatten().map(|s| s.0).sum()
    }

    /// Number of scalars.
    pub fn count(&self) -> f64 {
        self.sums.iter().flatten().map(|s| s.1).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_that_is_fitted_exactly_has_the_noise_of_the_others_in_part_and_one_alone_its_own() {
        let touch = Measured::Touch { ball: 0, reading: [0.0; 3] };
        let updated = |of: &[(usize, f64)]| {
            let mut squares = Squares::new(of.len());
            for (recording, (rows, weighted)) in of.iter().enumerate() {
                (0..*rows).for_each(|_| squares.add(recording, &touch, &[*weighted; 3]));
            }
            let mut noise = Noise::usual(of.len());
            noise.update_from(&squares, 0);
            (0..of.len()).map(|recording| noise.sigma(recording, &touch, 0)).collect::<Vec<_>>()
        };
        assert_eq!(updated(&[(6, 2.0)]), [2e-5]);
        let [many, few] = updated(&[(100, 1.0), (6, 0.0)])[..] else { unreachable!() };
        // 12 of 30 scalars, each with the variance of 300 of 318
        assert!((few - 1e-5 * (0.4_f64 * 300.0 / 318.0).sqrt()).abs() < 1e-12, "{few}");
        assert!((many - 1e-5).abs() < 2e-8, "{many}");
    }

    #[test]
    fn noise_is_near_where_no_standard_deviation_differs_by_more_than_the_share() {
        let of = |one: f64| {
            let mut noise = Noise::usual(2);
            noise.sigma[1][0] *= one;
            noise
        };
        assert!(
            of(1.0).is_near(&of(1.0), 1e-4)
                && of(1.00009).is_near(&of(1.0), 1e-4)
                && of(0.99991).is_near(&of(1.0), 1e-4)
        );
        assert!(!of(1.0002).is_near(&of(1.0), 1e-4) && !of(0.9998).is_near(&of(1.0), 1e-4));
    }
}
