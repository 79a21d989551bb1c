//! Anchors and tool point from measured lengths, in closed form and without a guess.
//!
//! With the flange at `(R, p)` in the base by nominal kinematics, the tool point `t` in the flange and an anchor `A` in the base,
//! `d^2 = |p + R t - A|^2` is, written out,
//!
//! `d^2 - |p|^2 = (|t|^2 + |A|^2) + 2 (R' p) . t - 2 p . A - 2 sum_ij R_ij A_i t_j`:
//!
//! linear in `t` (3), and for each anchor in `A` (3), the products `A_i t_j` (9) and `|t|^2 + |A|^2` (1). All anchors are solved
//! together; Gauss-Newton on the lengths themselves then finishes. Where there are too few lengths, or the orientations vary too
//! little for the products, the tool point of the cell is believed: then only `A` and one number for each anchor are unknown.

use nalgebra::{DMatrix, DVector, Vector3};
use trical_model::Pose;

/// One measured length.
#[derive(Clone, Copy, Debug)]
pub struct Length {
    /// The flange by nominal kinematics.
    pub base_from_flange: Pose,
    /// Which anchor, from 0.
    pub anchor: usize,
    /// m.
    pub length: f64,
}

/// Where the anchors and the tool point are.
#[derive(Clone, Debug)]
pub struct Trilaterated {
    /// Each anchor in the base, m; `None` where no length was measured from it.
    pub anchor_in_base: Vec<Option<Vector3<f64>>>,
    /// The tool point in the flange, m.
    pub tcp_in_flange: Vector3<f64>,
    /// Root of the mean square of what is left of the lengths, m.
    pub rms: f64,
}

type V3 = Vector3<f64>;

/// Least squares with columns of unit length; `None` where they are not independent.
fn solved(rows: &[(DVector<f64>, f64)]) -> Option<DVector<f64>> {
    let p = rows.first()?.0.len();
    if rows.len() < p {
        return None;
    }
    let mut a = DMatrix::from_fn(rows.len(), p, |i, j| rows[i].0[j]);
    let b = DVector::from_iterator(rows.len(), rows.iter().map(|r| r.1));
    let scale: Vec<f64> = (0..p).map(|j| a.column(j).norm()).collect();
    if scale.iter().any(|s| *s < 1e-12) {
        return None;
    }
    for (j, s) in scale.iter().enumerate() {
        a.column_mut(j).scale_mut(1.0 / s);
    }
    let svd = a.svd(true, true);
    let largest = svd.singular_values.max();
    // the noise of a length, relative to its size, is what an ill-conditioned system multiplies
    if svd.singular_values.min() < 1e-5 * largest {
        return None;
    }
    let x = svd.solve(&b, 0.0).ok()?;
    Some(DVector::from_fn(p, |j, _| x[j] / scale[j]))
}

/// Anchors and tool point from the linear system; anchors are those with lengths, in order.
fn quadratic_form(lengths: &[Length], index: &[usize]) -> Option<(Vec<V3>, V3)> {
    let n = index.len();
    let rows: Vec<_> = lengths
        .iter()
        .filter_map(|l| {
            let k = index.iter().position(|a| *a == l.anchor)?;
            let (r, p) = (l.base_from_flange.rotation, l.base_from_flange.translation);
            let mut row = DVector::zeros(3 + 13 * n);
            let back = r.transpose() * p;
            for i in 0..3 {
                row[i] = 2.0 * back[i];
                row[3 + 13 * k + i] = -2.0 * p[i];
                for j in 0..3 {
                    row[3 + 13 * k + 3 + 3 * i + j] = -2.0 * r[(i, j)];
                }
            }
            row[3 + 13 * k + 12] = 1.0;
            Some((row, l.length * l.length - p.norm_squared()))
        })
        .collect();
    let x = solved(&rows)?;
    let three = |at: usize| V3::new(x[at], x[at + 1], x[at + 2]);
    Some(((0..n).map(|k| three(3 + 13 * k)).collect(), three(0)))
}

/// Anchors where the tool point is known.
fn spheres(lengths: &[Length], index: &[usize], tcp: &V3) -> Option<Vec<V3>> {
    index
        .iter()
        .map(|anchor| {
            let rows: Vec<_> = lengths
                .iter()
                .filter(|l| l.anchor == *anchor)
                .map(|l| {
                    let x = l.base_from_flange.apply(tcp);
                    let row = DVector::from_row_slice(&[-2.0 * x.x, -2.0 * x.y, -2.0 * x.z, 1.0]);
                    (row, l.length * l.length - x.norm_squared())
                })
                .collect();
            let x = solved(&rows)?;
            Some(V3::new(x[0], x[1], x[2]))
        })
        .collect()
}

/// Gauss-Newton on the lengths; the tool point stays where it is unless `free_tool`.
fn refined(lengths: &[Length], index: &[usize], anchors: &mut [V3], tcp: &mut V3, free_tool: bool) -> f64 {
    let tool = if free_tool { 3 } else { 0 };
    let residual = |anchors: &[V3], tcp: &V3| -> Vec<(DVector<f64>, f64)> {
        lengths
            .iter()
            .filter_map(|l| {
                let k = index.iter().position(|a| *a == l.anchor)?;
                let v = l.base_from_flange.apply(tcp) - anchors[k];
                let u = v / v.norm().max(1e-9);
                let mut row = DVector::zeros(tool + 3 * anchors.len());
                let back = l.base_from_flange.rotation.transpose() * u;
                for i in 0..3 {
                    if free_tool {
                        row[i] = back[i];
                    }
                    row[tool + 3 * k + i] = -u[i];
                }
                Some((row, l.length - v.norm()))
            })
            .collect()
    };
    let rms = |rows: &[(DVector<f64>, f64)]| (rows.iter().map(|r| r.1 * r.1).sum::<f64>() / rows.len() as f64).sqrt();
    let mut rows = residual(anchors, tcp);
    let mut best = rms(&rows);
    for _ in 0..30 {
        let Some(step) = solved(&rows) else { break };
        let three = |at: usize| V3::new(step[at], step[at + 1], step[at + 2]);
        let new_tcp = if free_tool { *tcp + three(0) } else { *tcp };
        let moved: Vec<V3> = anchors.iter().enumerate().map(|(k, a)| a + three(tool + 3 * k)).collect();
        rows = residual(&moved, &new_tcp);
        let now = rms(&rows);
        if now.is_nan() || now >= best {
            break;
        }
        let small = step.amax() < 1e-12;
        best = now;
        anchors.copy_from_slice(&moved);
        *tcp = new_tcp;
        if small {
            break;
        }
    }
    best
}

/// Anchors and tool point. `tcp` is what the cell says of the tool point; it is used only where the lengths do not tell.
///
/// `None` where even then the lengths fix no point: fewer than four from an anchor, or all from places in one plane.
#[must_use]
pub fn trilaterate(lengths: &[Length], tcp: &Vector3<f64>) -> Option<Trilaterated> {
    let mut index: Vec<usize> = lengths.iter().map(|l| l.anchor).collect();
    index.sort_unstable();
    index.dedup();
    let (mut anchors, mut tool, free) = match quadratic_form(lengths, &index) {
        Some((anchors, tool)) => (anchors, tool, true),
        None => (spheres(lengths, &index, tcp)?, *tcp, false),
    };
    let rms = refined(lengths, &index, &mut anchors, &mut tool, free);
    let mut anchor_in_base = vec![None; index.last()? + 1];
    for (k, a) in index.iter().zip(&anchors) {
        anchor_in_base[*k] = Some(*a);
    }
    Some(Trilaterated { anchor_in_base, tcp_in_flange: tool, rms })
}

/// `world_from_base` that brings anchors in the base onto those of the cell. One anchor fixes the place, two a line, three all;
/// what is left open stays as near to `nominal` as can be.
#[must_use]
pub fn base_from_anchors(pairs: &[(Vector3<f64>, Vector3<f64>)], nominal: &Pose) -> Pose {
    // pairs: in {w}, in the base
    if let Some(pose) = crate::rigid::rigid_from_points(pairs) {
        return pose;
    }
    let Some((first_w, first_b)) = pairs.first() else { return *nominal };
    let mut rotation = nominal.rotation;
    if let Some((w, b)) = pairs.iter().skip(1).max_by(|x, y| (x.0 - first_w).norm().total_cmp(&(y.0 - first_w).norm()))
    {
        let (to, from) = (w - first_w, rotation * (b - first_b));
        if let Some(turn) = nalgebra::Rotation3::rotation_between(&from, &to) {
            rotation = turn.matrix() * rotation;
        }
    }
    Pose { rotation, translation: first_w - rotation * first_b }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// By themselves, before anything is refined.
    #[test]
    fn spheres_about_a_known_tool_point_meet_in_the_anchors() {
        let (tcp, anchors) = (V3::new(0.01, -0.02, 0.1), [V3::new(1.0, -0.5, 0.3), V3::new(-0.4, 0.9, -0.2)]);
        let at = |k: usize| {
            let turn = 0.4 * k as f64;
            let translation = V3::new(turn.cos(), turn.sin() * 0.5, 0.3 * (2.0 * turn).sin());
            Pose { rotation: trical_model::pose::rotation_zyx(turn, 0.7 * turn, -turn), translation }
        };
        let of = |k: usize, anchor: usize| {
            let base_from_flange = at(k);
            let length = (base_from_flange.apply(&tcp) - anchors[anchor]).norm();
            Length { base_from_flange, anchor, length }
        };
        let lengths: Vec<Length> = (0..16).map(|k| of(k, k % 2)).collect();
        let found = spheres(&lengths, &[0, 1], &tcp).unwrap();
        assert!(found.iter().zip(&anchors).all(|(a, b)| (a - b).norm() < 1e-12), "{found:?}");
    }
}
