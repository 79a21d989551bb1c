//! Which measurements tell rival explanations apart (Atkinson and Fedorov 1975: T-optimality).
//!
//! Each rival has been fitted to what is known, and predicts every candidate; two rivals differ there by delta. Measured anew,
//! the parameters that both share take up a part of the difference, as far as the earlier data lets them. What is left,
//! `lambda^2 = min_x sum |delta_i - J_i x|^2 + x' I x`, with I the information of the earlier data, is the noncentrality of the
//! test between the two: all in units of the noise, `lambda` is how many standard deviations the new set sets them apart.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::candidates::{Candidates, inverse};

/// A set that sets rivals apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrimination {
    /// The chosen candidates, rising.
    pub indices: Vec<usize>,
    /// The smallest lambda of any two rivals.
    pub lambda: f64,
    /// Lambda of each pair of rivals, and which.
    pub pairs: Vec<(usize, usize, f64)>,
}

/// `k` candidates that best set the rivals apart: the smallest lambda of any two of them is as large as adding and swapping one
/// at a time can make it. No chance is in it.
///
/// - `jacobians`: three rows of each candidate for the parameters that all rivals share, in units of the noise.
/// - `information`: J'J of what was measured before (p x p, row by row), in the same units; empty for nothing.
/// - `rivals`: for each rival 3 N numbers, what it predicts at the candidates after its fit to what was measured before, in
///   units of the noise. Only differences count: the common part may be left out.
///
/// `None` where sizes do not fit, a number is not finite, there are fewer than two rivals, `k` is 0 or there are fewer
/// candidates than `k`.
#[must_use]
pub fn choose_to_discriminate(
    jacobians: &Candidates,
    information: &[f64],
    rivals: &[Vec<f64>],
    k: usize,
) -> Option<Discrimination> {
    let (n, p) = (jacobians.len(), jacobians.columns());
    let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
    let fits = information.is_empty() || information.len() == p * p;
    if rivals.len() < 2 || k == 0 || k > n || !fits || !finite(information) {
        return None;
    }
    if rivals.iter().any(|r| r.len() != 3 * n || !finite(r)) {
        return None;
    }
    let mut search = Search::new(jacobians, information, rivals)?;
    let mut chosen: Vec<usize> = Vec::with_capacity(k);
    while chosen.len() < k {
        let (_, j) = search.best(&chosen)?;
        search.change(j, 1.0);
        chosen.push(j);
    }
    for _ in 0..50 {
        let mut swapped = false;
        for slot in 0..k {
            // exactly, not by small steps: swaps must not run in circles on rounding
            let i = chosen[slot];
            let before = search.lambda2(&chosen)?;
            let mut rest = chosen.clone();
            rest.remove(slot);
            search.set(&rest);
            let Some((_, j)) = search.best(&rest) else { continue };
            rest.insert(slot, j);
            let after = search.lambda2(&rest)?;
            if j != i && least(&after) > least(&before) * (1.0 + 1e-9) + 1e-12 {
                chosen = rest;
                swapped = true;
            }
        }
        if !swapped {
            break;
        }
    }
    let squares = search.lambda2(&chosen)?;
    chosen.sort_unstable();
    let pairs: Vec<(usize, usize, f64)> =
        search.pairs.iter().zip(&squares).map(|((a, b), x)| (*a, *b, x.max(0.0).sqrt())).collect();
    Some(Discrimination { indices: chosen, lambda: least(&squares).max(0.0).sqrt(), pairs })
}

/// The smallest lambda^2 of a set that was chosen otherwise (at random, by hand), for comparison; `None` as above.
#[must_use]
pub fn lambda_of(jacobians: &Candidates, information: &[f64], rivals: &[Vec<f64>], chosen: &[usize]) -> Option<f64> {
    let n = jacobians.len();
    if rivals.len() < 2 || rivals.iter().any(|r| r.len() != 3 * n) || chosen.iter().any(|i| *i >= n) {
        return None;
    }
    if !information.is_empty() && information.len() != jacobians.columns().pow(2) {
        return None;
    }
    let search = Search::new(jacobians, information, rivals)?;
    Some(least(&search.lambda2(chosen)?).max(0.0).sqrt())
}

fn least(squares: &[f64]) -> f64 {
    squares.iter().copied().fold(f64::INFINITY, f64::min)
}

struct Search {
    /// Three rows of each candidate as columns, p x 3 N, columns scaled to unit root mean square.
    z: DMatrix<f64>,
    /// Information of the earlier data in the same coordinates, with a little of everything.
    prior: DMatrix<f64>,
    pairs: Vec<(usize, usize)>,
    /// Difference of each pair at all candidates.
    delta: Vec<Vec<f64>>,
    /// Of the present set: information, and J' delta of each pair.
    a: DMatrix<f64>,
    b: Vec<DVector<f64>>,
}

impl Search {
    fn new(jacobians: &Candidates, information: &[f64], rivals: &[Vec<f64>]) -> Option<Self> {
        let (n, p) = (jacobians.len(), jacobians.columns());
        let mut j = jacobians.matrix();
        let mut prior =
            if information.is_empty() { DMatrix::zeros(p, p) } else { DMatrix::from_row_slice(p, p, information) };
        let root = (n as f64).sqrt();
        for c in 0..p {
            // a column that moves nothing here may still be known from before
            let length = j.column(c).norm() / root;
            let scale = if length > 0.0 { 1.0 / length } else { 1.0 };
            j.column_mut(c).scale_mut(scale);
            prior.column_mut(c).scale_mut(scale);
            prior.row_mut(c).scale_mut(scale);
        }
        let most = prior.diagonal().max().max(1.0);
        for c in 0..p {
            prior[(c, c)] += 1e-10 * most;
        }
        let pairs: Vec<(usize, usize)> =
            (0..rivals.len()).flat_map(|a| (a + 1..rivals.len()).map(move |b| (a, b))).collect();
        let delta: Vec<Vec<f64>> =
            pairs.iter().map(|(a, b)| rivals[*a].iter().zip(&rivals[*b]).map(|(x, y)| x - y).collect()).collect();
        let b = vec![DVector::zeros(p); pairs.len()];
        Some(Self { z: j.transpose(), a: prior.clone(), prior, pairs, delta, b })
    }

    fn difference(&self, pair: usize, i: usize) -> Vector3<f64> {
        Vector3::from_fn(|r, _| self.delta[pair][3 * i + r])
    }

    /// Adds (1) or removes (-1) a candidate.
    fn change(&mut self, i: usize, sign: f64) {
        let block = self.z.columns(3 * i, 3).clone_owned();
        self.a.gemm(sign, &block, &block.transpose(), 1.0);
        for pair in 0..self.pairs.len() {
            let d = self.difference(pair, i);
            self.b[pair] += &block * d * sign;
        }
    }

    fn set(&mut self, chosen: &[usize]) {
        self.a = self.prior.clone();
        self.b.iter_mut().for_each(|b| b.fill(0.0));
        chosen.iter().for_each(|i| self.change(*i, 1.0));
    }

    /// lambda^2 of each pair by a set.
    fn lambda2(&self, chosen: &[usize]) -> Option<Vec<f64>> {
        let mut a = self.prior.clone();
        for i in chosen {
            let block = self.z.columns(3 * i, 3);
            a.gemm(1.0, &block, &block.transpose(), 1.0);
        }
        let factor = a.cholesky()?;
        Some(
            (0..self.pairs.len())
                .map(|pair| {
                    let mut b = DVector::zeros(self.z.nrows());
                    for i in chosen {
                        b += self.z.columns(3 * i, 3) * self.difference(pair, *i);
                    }
                    let x = factor.solve(&b);
                    // as a sum of squares: a difference of two would lose what is small
                    let left: f64 = chosen
                        .iter()
                        .map(|i| (self.difference(pair, *i) - self.z.columns(3 * i, 3).tr_mul(&x)).norm_squared())
                        .sum();
                    left + x.dot(&(&self.prior * &x))
                })
                .collect(),
        )
    }

    /// The candidate that adds most to the smallest lambda^2 (and, where that is equal, to their sum), and what is reached.
    ///
    /// With x the best parameters of the present set, adding j adds `e' (1 + J_j A^-1 J_j')^-1 e`, `e = delta_j - J_j x`.
    fn best(&self, chosen: &[usize]) -> Option<(f64, usize)> {
        let now = self.lambda2(chosen)?;
        let inverse = inverse(&self.a)?;
        let x: Vec<DVector<f64>> = self.b.iter().map(|b| &inverse * b).collect();
        let w = &inverse * &self.z;
        let mut best: Option<(f64, f64, usize)> = None;
        for j in (0..self.z.ncols() / 3).filter(|j| !chosen.contains(j)) {
            let block = self.z.columns(3 * j, 3);
            let spread: Matrix3<f64> = Matrix3::identity() + block.tr_mul(&w.columns(3 * j, 3));
            let Some(back) = spread.try_inverse() else { continue };
            let (mut lowest, mut sum) = (f64::INFINITY, 0.0);
            for pair in 0..self.pairs.len() {
                let e = self.difference(pair, j) - block.tr_mul(&x[pair]);
                let reached = now[pair] + e.dot(&(back * e));
                lowest = lowest.min(reached);
                sum += reached;
            }
            if best.is_none_or(|b| lowest > b.0 || (lowest >= b.0 && sum > b.1)) {
                best = Some((lowest, sum, j));
            }
        }
        best.map(|(lowest, _, j)| (lowest, j))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn numbers(rng: &mut Pcg64Mcg, n: usize) -> Vec<f64> {
        (0..n).map(|_| rng.random::<f64>() - 0.5).collect()
    }

    /// n candidates, p columns, some rivals, and information of 20 earlier rows.
    fn case(n: usize, p: usize, rivals: usize, seed: u64) -> (Candidates, Vec<f64>, Vec<Vec<f64>>) {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let c = Candidates::new(p, numbers(&mut rng, 3 * p * n), vec![0; n]).unwrap();
        let old = DMatrix::from_row_slice(20, p, &numbers(&mut rng, 20 * p));
        let information = old.tr_mul(&old).as_slice().to_vec();
        let rivals = (0..rivals).map(|_| numbers(&mut rng, 3 * n)).collect();
        (c, information, rivals)
    }

    /// lambda^2 by a dense least-squares problem with the earlier data as rows: another way to the same number.
    fn by_least_squares(c: &Candidates, information: &[f64], a: &[f64], b: &[f64], chosen: &[usize]) -> f64 {
        let p = c.columns();
        let old = DMatrix::from_row_slice(p, p, information).cholesky().unwrap().l().transpose();
        let mut rows = old.transpose().as_slice().to_vec();
        let mut right = vec![0.0; p];
        for i in chosen {
            rows.extend_from_slice(c.rows(*i));
            right.extend((0..3).map(|r| a[3 * i + r] - b[3 * i + r]));
        }
        let (j, d) = (DMatrix::from_row_slice(right.len(), p, &rows), DVector::from_vec(right));
        let x = j.clone().svd(true, true).solve(&d, 1e-14).unwrap();
        (d - j * x).norm()
    }

    #[test]
    fn lambda_is_what_a_fit_of_old_and_new_data_leaves() {
        let (c, information, rivals) = case(30, 6, 2, 1);
        let found = choose_to_discriminate(&c, &information, &rivals, 5).unwrap();
        let direct = by_least_squares(&c, &information, &rivals[0], &rivals[1], &found.indices);
        assert!((found.lambda - direct).abs() < 1e-7 * direct, "{} {direct}", found.lambda);
    }

    #[test]
    fn is_the_best_set_where_all_can_be_tried() {
        for seed in 0..8 {
            let (c, information, rivals) = case(12, 4, 2, seed);
            let found = choose_to_discriminate(&c, &information, &rivals, 3).unwrap();
            let mut best = 0.0_f64;
            for i in 0..12 {
                for j in 0..i {
                    for k in 0..j {
                        best = best.max(lambda_of(&c, &information, &rivals, &[i, j, k]).unwrap());
                    }
                }
            }
            // one at a time is not all at once: within 2 percent
            assert!(found.lambda > 0.98 * best && found.lambda < best * (1.0 + 1e-9), "{} {best}", found.lambda);
        }
    }

    #[test]
    fn sets_three_rivals_apart_better_than_chance() {
        let (c, information, rivals) = case(200, 10, 3, 3);
        let found = choose_to_discriminate(&c, &information, &rivals, 8).unwrap();
        assert_eq!(found.pairs.len(), 3);
        let mut rng = Pcg64Mcg::seed_from_u64(9);
        for _ in 0..500 {
            let set: Vec<usize> = (0..8).map(|k| 25 * k + rng.random_range(0..25)).collect();
            assert!(lambda_of(&c, &information, &rivals, &set).unwrap() < found.lambda);
        }
    }

    #[test]
    fn a_difference_that_the_parameters_make_up_is_none() {
        let (c, _, _) = case(40, 5, 2, 4);
        // the second rival differs by a change of the parameters, of which nothing is known from before
        let x = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0, 1.0]);
        let differs: Vec<f64> = (c.matrix() * &x).as_slice().to_vec();
        let rivals = vec![vec![0.0; 120], differs];
        let found = choose_to_discriminate(&c, &[], &rivals, 6).unwrap();
        assert!(found.lambda < 1e-3, "{}", found.lambda);
        // known from before, it cannot be: then the difference is seen
        let known: Vec<f64> = (DMatrix::<f64>::identity(5, 5) * 1e12).as_slice().to_vec();
        assert!(choose_to_discriminate(&c, &known, &rivals, 6).unwrap().lambda > 1.0);
    }

    #[test]
    fn what_does_not_fit_is_none() {
        let (c, information, rivals) = case(10, 4, 2, 5);
        assert!(choose_to_discriminate(&c, &information, &rivals[..1], 3).is_none());
        assert!(choose_to_discriminate(&c, &information[1..], &rivals, 3).is_none());
        assert!(choose_to_discriminate(&c, &information, &rivals, 11).is_none());
        assert!(choose_to_discriminate(&c, &information, &rivals, 0).is_none());
        assert!(choose_to_discriminate(&c, &information, &[vec![f64::NAN; 30], vec![0.0; 30]], 3).is_none());
    }
}
