//! Tests and criteria, each written once.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::settings::OUTSIDE;

/// Upper tail of the F distribution with `k` and `freedom` degrees of freedom; 1 where there is no such distribution.
fn f_tail(f: f64, k: f64, freedom: f64) -> f64 {
    FisherSnedecor::new(k, freedom).map_or(1.0, |d| d.sf(f))
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
    if p < (-1.0_f64).exp() { OUTSIDE / (-1.0_f64.exp() * p * p.ln()) } else { OUTSIDE }
}

/// By how many nats `k` numbers that bring a sum of squares from `before` to `after` are better than none (half a difference of BIC).
#[must_use]
pub fn bic_nats(freedom: f64, before: f64, after: f64, k: f64) -> f64 {
    0.5 * freedom * (before / after.max(1e-300)).ln() - 0.5 * k * freedom.max(1.0).ln()
}

#[cfg(test)]
mod tests {
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
    fn a_p_value_of_one_in_a_hundred_is_worth_odds_of_eight_at_most() {
        assert!((odds_outside_catalogue(0.01) / OUTSIDE - 7.988).abs() < 1e-3);
        assert!((odds_outside_catalogue(0.5) - OUTSIDE).abs() < 1e-15, "no evidence, no other odds");
    }

    #[test]
    fn a_number_pays_half_the_logarithm_of_the_count() {
        assert!((bic_nats(100.0, 1.0, 1.0, 1.0) + 0.5 * 100.0_f64.ln()).abs() < 1e-12);
    }
}
