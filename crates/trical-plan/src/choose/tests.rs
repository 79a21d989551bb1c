#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;

fn random_candidates(n: usize, columns: usize, groups: usize, seed: u64) -> Candidates {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    // of very different sizes, so that choosing matters
    let mut jacobian = Vec::new();
    for _ in 0..n {
        let size = rng.random::<f64>().powi(2) + 0.05;
        jacobian.extend((0..3 * columns).map(|_| size * (rng.random::<f64>() - 0.5)));
    }
    Candidates::new(columns, jacobian, (0..n).map(|i| i % groups).collect()).unwrap()
}

#[test]
fn beats_every_random_set() {
    let c = random_candidates(120, 12, 3, 1);
    let choice = choose(&c, &[6, 6, 6], 7, 3).unwrap();
    assert_eq!(choice.indices.len(), 18);
    for g in 0..3 {
        assert_eq!(choice.indices.iter().filter(|i| c.groups[**i] == g).count(), 6);
    }
    let white = White::of(&c);
    let members: Vec<Vec<usize>> = (0..3).map(|g| (0..120).filter(|i| i % 3 == g).collect()).collect();
    for k in 0..2000 {
        assert!(white.log_det(&random_set(&members, &[6, 6, 6], 99, k)) <= choice.log_det);
    }
}

#[test]
fn is_optimal_where_all_sets_can_be_tried() {
    // 2 of 7 and 2 of 7: 441 sets
    for seed in 0..10 {
        let c = random_candidates(14, 5, 2, seed);
        let choice = choose(&c, &[2, 2], seed, 5).unwrap();
        let white = White::of(&c);
        let mut best = f64::NEG_INFINITY;
        for a in 0..7 {
            for b in 0..a {
                for d in 0..7 {
                    for e in 0..d {
                        best = best.max(white.log_det(&[2 * a, 2 * b, 2 * d + 1, 2 * e + 1]));
                    }
                }
            }
        }
        // O1 = det^(1 / 2p)
        let share = ((choice.log_det - best) / 10.0).exp();
        assert!(share > 0.999_999, "seed {seed}: {share}");
    }
}

#[test]
fn a_few_starts_come_within_two_percent_of_many() {
    let c = random_candidates(90, 10, 3, 5);
    let few = choose(&c, &[5, 5, 5], 1, 3).unwrap();
    let many = choose(&c, &[5, 5, 5], 2, 300).unwrap();
    let share = ((few.log_det - many.log_det) / 20.0).exp();
    assert!(share >= 0.98, "{share}");
}

#[test]
fn does_not_depend_on_units() {
    let c = random_candidates(60, 6, 2, 3);
    let mut scaled = c.clone();
    for row in scaled.jacobian.chunks_exact_mut(6) {
        row[2] *= 1e4;
        row[5] *= 1e-6;
    }
    let (a, b) = (choose(&c, &[5, 5], 1, 4).unwrap(), choose(&scaled, &[5, 5], 1, 4).unwrap());
    assert!((a.log_det - b.log_det).abs() < 1e-9);
    assert_eq!(a.indices, b.indices);
}

#[test]
fn columns_that_others_make_up_are_found() {
    let c = random_candidates(20, 4, 1, 4);
    // 0, 1, 2 as they are, 3 = 0 - 2 x 1, 4 = 0, 5 = the old 3
    let jacobian = c.jacobian.chunks_exact(4).flat_map(|r| [r[0], r[1], r[2], r[0] - 2.0 * r[1], 0.0, r[3]]).collect();
    let c = Candidates::new(6, jacobian, c.groups.clone()).unwrap();
    assert_eq!(c.independent_columns(), vec![0, 1, 2, 5]);
}

#[test]
fn observability_of_orthogonal_columns_is_known_by_hand() {
    // two candidates with the unit matrix: columns of length sqrt 2, scaled to 1, all singular values 1
    let eye = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let c = Candidates::new(3, [eye, eye].concat(), vec![0, 0]).unwrap();
    let o = c.observability(&[0, 1]);
    assert!((o.o1 - 1.0 / 6.0_f64.sqrt()).abs() < 1e-12);
    assert!((o.condition - 1.0).abs() < 1e-12);
}

#[test]
fn too_few_candidates_are_no_choice() {
    let c = random_candidates(9, 5, 3, 4);
    assert!(choose(&c, &[4, 3, 3], 1, 1).is_none());
    assert!(Candidates::new(3, vec![f64::NAN; 9], vec![0]).is_none());
    assert!(Candidates::new(3, vec![0.0; 8], vec![0]).is_none());
}

#[test]
fn all_candidates_together_are_the_measure_of_a_log_determinant() {
    let c = random_candidates(12, 5, 2, 3);
    let all = choose(&c, &[6, 6], 1, 0).unwrap();
    assert_eq!(all.indices, (0..12).collect::<Vec<_>>());
    assert!(all.log_det.abs() < 1e-9, "{}", all.log_det);
}

#[test]
fn the_greedy_start_is_better_than_nearly_all_random_sets() {
    let c = random_candidates(120, 12, 3, 1);
    let white = White::of(&c);
    let members: Vec<Vec<usize>> = (0..3).map(|g| (0..120).filter(|i| i % 3 == g).collect()).collect();
    let greedy = white.log_det(&greedy(&white, &members, &[6, 6, 6]));
    let better = (0..500).filter(|k| white.log_det(&random_set(&members, &[6, 6, 6], 99, *k)) > greedy).count();
    assert!(better < 5, "{better} of 500 random sets are better");
}
