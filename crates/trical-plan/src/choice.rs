//! The subset of candidates that tells most about the parameters: D-optimal (O1), by greedy growth and exchange (Fedorov).

use nalgebra::{DMatrix, DVector};

/// Information of a set: sum of `J'J` with columns scaled to comparable length, and a trace that keeps it regular.
fn information(blocks: &[DMatrix<f64>], set: &[usize], p: usize) -> DMatrix<f64> {
    let mut m = DMatrix::identity(p, p) * 1e-9;
    for k in set {
        m += blocks[*k].transpose() * &blocks[*k];
    }
    m
}

fn log_det(m: &DMatrix<f64>) -> f64 {
    m.clone().cholesky().map_or(f64::NEG_INFINITY, |c| 2.0 * c.l().diagonal().iter().map(|d| d.ln()).sum::<f64>())
}

/// Chooses `wanted[g]` candidates of each group `g`, so that the determinant of their information is large. `blocks` are
/// the Jacobians of the candidates (rows x parameters), `group` says to which group each belongs. Returns indices in order.
#[must_use]
pub fn choose(blocks: &[DMatrix<f64>], group: &[usize], wanted: &[usize]) -> Vec<usize> {
    let Some(p) = blocks.first().map(DMatrix::ncols) else { return Vec::new() };
    // columns of comparable length
    let mut scale = DVector::<f64>::zeros(p);
    for b in blocks {
        for j in 0..p {
            scale[j] += b.column(j).norm_squared();
        }
    }
    let scaled: Vec<DMatrix<f64>> =
        blocks.iter().map(|b| DMatrix::from_fn(b.nrows(), p, |i, j| b[(i, j)] / scale[j].max(1e-300).sqrt())).collect();
    let mut set: Vec<usize> = Vec::new();
    let count = |set: &[usize], g: usize| set.iter().filter(|k| group[**k] == g).count();
    let gain = |inverse: &DMatrix<f64>, k: usize| {
        let b = &scaled[k];
        let m = DMatrix::identity(b.nrows(), b.nrows()) + b * inverse * b.transpose();
        m.determinant()
    };
    let total: usize = wanted.iter().sum();
    while set.len() < total {
        let Some(inverse) = information(&scaled, &set, p).try_inverse() else { break };
        let best = (0..blocks.len())
            .filter(|k| !set.contains(k) && count(&set, group[*k]) < wanted[group[*k]])
            .map(|k| (k, gain(&inverse, k)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        match best {
            Some((k, _)) => set.push(k),
            None => break,
        }
    }
    // exchange, one for one within a group, as long as the determinant grows
    for _ in 0..20 {
        let mut changed = false;
        for i in 0..set.len() {
            let own = set[i];
            let others: Vec<usize> = set.iter().copied().filter(|k| *k != own).collect();
            let Some(inverse) = information(&scaled, &others, p).try_inverse() else { continue };
            let now = gain(&inverse, own);
            let best = (0..blocks.len())
                .filter(|k| group[*k] == group[own] && !set.contains(k))
                .map(|k| (k, gain(&inverse, k)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((k, g)) = best
                && g > now * (1.0 + 1e-9)
            {
                set[i] = k;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    set.sort_unstable();
    set
}

/// Logarithm of the determinant of the information of a set, for comparisons.
#[must_use]
pub fn log_information(blocks: &[DMatrix<f64>], set: &[usize]) -> f64 {
    blocks.first().map_or(f64::NEG_INFINITY, |b| log_det(&information(blocks, set, b.ncols())))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_choice_beats_random_sets() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let blocks: Vec<DMatrix<f64>> =
            (0..60).map(|_| DMatrix::from_fn(3, 8, |_, _| rng.random_range(-1.0..1.0))).collect();
        let group: Vec<usize> = (0..60).map(|k| k % 3).collect();
        let set = choose(&blocks, &group, &[4, 4, 4]);
        assert_eq!(set.len(), 12);
        for g in 0..3 {
            assert_eq!(set.iter().filter(|k| group[**k] == g).count(), 4);
        }
        let ours = log_information(&blocks, &set);
        for _ in 0..200 {
            let random: Vec<usize> = (0..3)
                .flat_map(|g| (0..4).map(move |i| (g, i)))
                .map(|(g, _)| g + 3 * rng.random_range(0..20))
                .collect();
            assert!(log_information(&blocks, &random) < ours);
        }
    }
}
