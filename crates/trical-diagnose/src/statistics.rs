//! Tests and criteria, each written once.

use crate::settings::OUTSIDE;

/// Upper tail of the F distribution with `k` and `freedom` degrees of freedom; 1 where there is no such distribution.
fn f_tail(f: f64, k: f64, freedom: f64) -> f64 {
    if !(f > 0.0 && k > 0.0 && freedom > 0.0 && f.is_finite() && k.is_finite() && freedom.is_finite()) {
        return if f == f64::INFINITY { 0.0 } else { 1.0 };
    }
    let total = freedom + k * f;
    incomplete_beta((freedom / 2.0, k / 2.0), (freedom / total, k * f / total))
}

/// Regularized incomplete beta function of `a`, `b` at `x`, with `y = 1 - x`: by its continued fraction (NIST Handbook of Mathematical Functions
/// 8.17.22, by Lentz's method), not by a library whose logarithms are those of the C library, which have other digits on other processors.
fn incomplete_beta((a, b): (f64, f64), (x, y): (f64, f64)) -> f64 {
    let shift = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let front = libm::exp(shift + a * libm::log(x) + b * libm::log(y));
    if x > (a + 1.0) / (a + b + 2.0) {
        1.0 - front * beta_fraction((b, a), y) / b
    } else {
        front * beta_fraction((a, b), x) / a
    }
}

fn beta_fraction((a, b): (f64, f64), x: f64) -> f64 {
    let not_zero = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / not_zero(1.0 - (a + b) * x / (a + 1.0));
    let mut all = d;
    // it ends after some multiples of the root of `a` or `b`
    for m in (1..100_000).map(f64::from) {
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for numerator in [even, odd] {
            d = 1.0 / not_zero(1.0 + numerator * d);
            c = not_zero(1.0 + numerator / c);
            change = c * d;
            all *= change;
        }
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    all
}

/// The F statistic of `k` numbers that remove `dss` of the sum of squares `ss`, with `freedom` left.
fn f_statistic(ss: f64, dss: f64, k: f64, freedom: f64) -> f64 {
    (dss / k) / ((ss - dss).max(1e-300) / freedom)
}

/// F test of the coefficients of an effect: `rank` numbers that remove `dss` of `ss`, where `freedom` independent scalars are left
/// before. The statistic is multiplied by `temper`, the share of the rows that is independent, although `freedom` counts independent
/// scalars alone.
#[must_use]
pub fn f_test_of_effect(ss: f64, dss: f64, rank: f64, freedom: f64, temper: f64) -> f64 {
    let k = rank.max(1.0);
    let left = freedom - k;
    f_tail(f_statistic(ss, dss, k, left) * temper, k, left.max(1.0))
}

/// F test of a probe: `rank` numbers that remove `dss` of `ss`, where `freedom` independent scalars are left before. Other than
/// [`f_test_of_effect`] it does not multiply the statistic by the share of independent rows: which of the two is right is open.
#[must_use]
pub fn f_test_of_probe(ss: f64, dss: f64, rank: usize, freedom: f64) -> f64 {
    let k = rank as f64;
    if rank == 0 || freedom <= 2.0 * k {
        return 1.0;
    }
    f_tail(f_statistic(ss, dss, k, freedom - k), k, freedom - k)
}

/// Odds that a place does something that is not in the catalogue: prior odds times the largest Bayes factor that the p-value
/// of a probe allows, `1 / (-e p ln p)` (Sellke, Bayarri & Berger 2001).
#[must_use]
pub fn odds_outside_catalogue(p_value: f64) -> f64 {
    let p = p_value.max(1e-300);
    if p < libm::exp(-1.0_f64) { OUTSIDE / (-libm::exp(1.0_f64) * p * libm::log(p)) } else { OUTSIDE }
}

/// By how many nats `k` numbers that bring a sum of squares from `before` to `after` are better than none (half a difference of BIC).
#[must_use]
pub fn bic_nats(freedom: f64, before: f64, after: f64, k: f64) -> f64 {
    0.5 * freedom * libm::log(before / after.max(1e-300)) - 0.5 * k * libm::log(freedom.max(1.0))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use statrs::distribution::{ContinuousCDF, FisherSnedecor};

    use super::*;

    #[test]
    fn the_two_f_tests_agree_where_all_rows_are_independent() {
        // 95 % point of F(2, 60) by the tables: 3.150
        let dss = |f: f64| 100.0 * 2.0 * f / (60.0 + 2.0 * f);
        let (effect, probe) =
            (f_test_of_effect(100.0, dss(3.1504), 2.0, 62.0, 1.0), f_test_of_probe(100.0, dss(3.1504), 2, 62.0));
        assert!((effect - 0.05).abs() < 1e-4, "{effect}");
        assert!((effect - probe).abs() < 1e-12, "{effect} {probe}");
        assert!(f_test_of_effect(100.0, dss(3.1504), 2.0, 62.0, 0.5) > 0.2);
    }

    #[test]
    fn tails_of_f_are_those_of_a_library() {
        for (f, k, freedom) in
            [(0.2, 1.0, 3.0), (3.0, 2.5, 40.0), (9.0, 8.0, 700.0), (40.0, 31.0, 2000.0), (0.9, 3.0, 1e5)]
        {
            let expected = FisherSnedecor::new(k, freedom).unwrap().sf(f);
            assert!((f_tail(f, k, freedom) / expected - 1.0).abs() < 1e-9, "{f} {k} {freedom}: {expected}");
        }
        assert_eq!([f_tail(0.0, 1.0, 5.0), f_tail(2.0, 0.0, 5.0), f_tail(f64::NAN, 1.0, 5.0)], [1.0; 3]);
        assert_eq!(f_tail(f64::INFINITY, 1.0, 5.0), 0.0);
    }

    #[test]
    fn a_p_value_of_one_in_a_hundred_is_worth_odds_of_eight_at_most() {
        assert!((odds_outside_catalogue(0.01) / OUTSIDE - 7.988).abs() < 1e-3);
        assert!((odds_outside_catalogue(0.5) - OUTSIDE).abs() < 1e-15, "no evidence, no other odds");
    }

    #[test]
    fn a_number_pays_half_the_logarithm_of_the_count() {
        assert!((bic_nats(100.0, 1.0, 1.0, 1.0) + 0.5 * 100.0_f64.ln()).abs() < 1e-12);
    }
}
