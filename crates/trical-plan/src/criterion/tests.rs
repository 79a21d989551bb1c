#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::choose::choose_for;

fn case(n: usize, p: usize, groups: usize, seed: u64) -> (Candidates, Vec<f64>) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut number = |size: f64| size * (rng.random::<f64>() - 0.5);
    // columns of very different units
    let jacobian = (0..3 * n * p).map(|k| number(10_f64.powi((k % p) as i32 - 2))).collect();
    let region = (0..3 * 20 * p).map(|k| number(10_f64.powi((k % p) as i32 - 2))).collect();
    (Candidates::new(p, jacobian, (0..n).map(|i| i % groups).collect()).unwrap(), region)
}

/// The three figures without any whitening: dense matrices in columns of unit root mean square over the pool.
fn directly(c: &Candidates, goal: &Goal<'_>, chosen: &[usize]) -> f64 {
    let p = c.columns();
    let all = c.matrix();
    let scale: Vec<f64> = all.column_iter().map(|x| (c.len() as f64).sqrt() / x.norm()).collect();
    let rows: Vec<f64> = chosen.iter().flat_map(|i| c.rows(*i).to_vec()).collect();
    let mut j = DMatrix::from_row_slice(rows.len() / p, p, &rows);
    for (mut column, s) in j.column_iter_mut().zip(&scale) {
        column *= *s;
    }
    match goal {
        Goal::Variances => j.tr_mul(&j).try_inverse().unwrap().trace().sqrt(),
        Goal::Weakest => 1.0 / j.singular_values().min(),
        Goal::Region(rows) => {
            let mut k = DMatrix::from_row_slice(rows.len() / p, p, rows);
            for (mut column, s) in k.column_iter_mut().zip(&scale) {
                column *= *s;
            }
            let covariance = j.tr_mul(&j).try_inverse().unwrap();
            ((&k * covariance * k.transpose()).trace() * 3.0 / k.nrows() as f64).sqrt()
        }
        Goal::Determinant => panic!("is compared elsewhere"),
    }
}

#[test]
fn figures_are_what_dense_algebra_gives() {
    let (c, region) = case(40, 6, 2, 1);
    let white = White::of(&c);
    let chosen: Vec<usize> = (0..8).map(|k| 5 * k).collect();
    for goal in [Goal::Variances, Goal::Weakest, Goal::Region(&region)] {
        let figure = Aim::of(&goal, &white).unwrap().figure(&white, &chosen);
        let direct = directly(&c, &goal, &chosen);
        assert!((figure - direct).abs() < 1e-7 * direct, "{goal:?}: {figure} {direct}");
    }
}

#[test]
fn each_goal_is_nearly_the_best_where_all_sets_can_be_tried() {
    for seed in 0..6 {
        let (c, region) = case(14, 5, 2, 10 + seed);
        for goal in [Goal::Variances, Goal::Weakest, Goal::Region(&region)] {
            let choice = choose_for(&c, &[2, 2], &goal, seed, 5).unwrap();
            assert!((choice.figure / directly(&c, &goal, &choice.indices) - 1.0).abs() < 1e-6);
            let mut best = f64::INFINITY;
            for a in 0..7 {
                for b in 0..a {
                    for d in 0..7 {
                        for e in 0..d {
                            best = best.min(directly(&c, &goal, &[2 * a, 2 * b, 2 * d + 1, 2 * e + 1]));
                        }
                    }
                }
            }
            assert!(choice.figure < 1.03 * best, "{goal:?}, seed {seed}: {} {best}", choice.figure);
        }
    }
}

#[test]
fn each_goal_is_served_best_by_its_own_choice() {
    let (c, region) = case(150, 10, 3, 3);
    let goals = [Goal::Variances, Goal::Weakest, Goal::Region(&region)];
    let choices: Vec<_> = goals.iter().map(|g| choose_for(&c, &[6, 6, 6], g, 1, 4).unwrap()).collect();
    for (g, own) in goals.iter().zip(&choices) {
        for other in &choices {
            assert!(own.figure <= directly(&c, g, &other.indices) * (1.0 + 1e-6), "{g:?}");
        }
        assert!(own.random_figure > 1.05 * own.figure, "{g:?}");
    }
}

#[test]
fn a_region_that_does_not_fit_is_none() {
    let (c, region) = case(20, 5, 1, 4);
    assert!(choose_for(&c, &[6], &Goal::Region(&region[1..]), 1, 1).is_none());
    assert!(choose_for(&c, &[6], &Goal::Region(&[]), 1, 1).is_none());
    assert!(choose_for(&c, &[6], &Goal::Region(&vec![0.0; region.len()]), 1, 1).is_none());
    assert!(choose_for(&c, &[6], &Goal::Region(&vec![f64::NAN; region.len()]), 1, 1).is_none());
}
