//! What measurements can and cannot tell: independent parameters, dependence in words, covariance, observability.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_model::{Forward, MAX_JOINTS, Measured, Model, Site, State, Term, Variable, residual_rows, trig};

use crate::dataset::Dataset;
use crate::dense::{Mat, dot, singular_values, singular_values_of_products, weakest};
use crate::error::Result;
use crate::fit::ball_places::unknown_places;
use crate::fit::choice::{Choice, ParameterSet, candidates};
use crate::fit::degenerate::hardly_moving;
use crate::fit::noise::Noise;
use crate::fit::priors::PriorKnowledge;
use crate::fit::rank::Triangle;
use crate::fit::residuals::factor;
use crate::fit::weak_priors::plausible;
use crate::rigid::median;

/// Upper triangular `R` (p x p) of the QR factorization of the weighted Jacobian, accumulated block by block so that memory
/// does not grow with the rows. Priors count as measurements of the parameters themselves.
#[must_use]
pub fn r_factor(forward: &Forward, data: &Dataset, noise: &Noise, known: &[PriorKnowledge]) -> Mat {
    let p = forward.free().len();
    let r = factor(forward, data, noise, known);
    r.leading(p, p)
}

/// Observability of the parameters from the singular values of the weighted Jacobian with columns of unit length.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Observability {
    /// O1 (Borm & Menq): (product of singular values)^(1/p) / sqrt(m).
    pub o1: f64,
    /// O2 (Driels & Pathre): smallest over largest; the inverse condition number.
    pub o2: f64,
    /// O3 (Nahvi): the smallest.
    pub o3: f64,
    /// O4 (Nahvi & Hollerbach), the noise amplification index: smallest squared over largest.
    pub o4: f64,
    /// O5 (Sun & Hollerbach): 1 / sum of 1 / s.
    pub o5: f64,
    /// Condition number of the scaled Jacobian.
    pub condition: f64,
    /// Number of scalars measured.
    pub rows: usize,
}

/// Below this condition, what is reported needs no factor of the rows themselves: their products keep ten digits.
pub(crate) const WELL_CONDITIONED: f64 = 1e3;

/// Whether these singular values (columns of unit length, largest first) are within [`WELL_CONDITIONED`].
pub(crate) fn is_well_conditioned(singular: &[f64]) -> bool {
    singular.last().zip(singular.first()).is_some_and(|(small, large)| *large < WELL_CONDITIONED * small)
}

/// Lengths of the columns of `R`, and the singular values of `R` with columns of unit length, largest first. `None` where a
/// column is zero or not finite, or the iteration for the values failed.
#[must_use]
pub fn spectrum(r: &Mat) -> Option<(Vec<f64>, Vec<f64>)> {
    let p = r.ncols();
    let scale = column_lengths(r);
    let reference = median(&scale);
    if scale.iter().any(|s| *s < 1e-12 * reference || *s <= 0.0 || !s.is_finite()) {
        return None;
    }
    let scaled = Mat::from_fn(p, p, |i, j| r[(i, j)] / scale[j]);
    // half the work of singular values, which have all digits where columns are nearly dependent
    let of_products = singular_values_of_products(&scaled);
    let s = if is_well_conditioned(&of_products) { of_products } else { singular_values(&scaled) };
    Some((scale, s))
}

fn column_lengths(r: &Mat) -> Vec<f64> {
    (0..r.ncols()).map(|j| (0..=j).map(|i| r[(i, j)].powi(2)).sum::<f64>().sqrt()).collect()
}

/// Observability indices, and covariance of the parameters for unit weights (p x p, row by row, SI).
///
/// # Errors
/// Never for a model from [`independent_terms`]; a singular `R` gives an infinite condition.
#[must_use]
pub fn observability(r: &Mat, rows: usize) -> (Observability, Vec<f64>) {
    let p = r.ncols();
    let Some((scale, s)) = spectrum(r) else {
        let nothing = Observability { o1: 0.0, o2: 0.0, o3: 0.0, o4: 0.0, o5: 0.0, condition: f64::INFINITY, rows };
        return (nothing, vec![f64::INFINITY; p * p]);
    };
    (indices(&s, rows), covariance(r, &scale))
}

/// The indices from the singular values of the scaled Jacobian of `rows` scalars, largest first.
pub(crate) fn indices(s: &[f64], rows: usize) -> Observability {
    let (pf, m) = (s.len().max(1) as f64, rows.max(1) as f64);
    let largest = s.first().copied().unwrap_or(0.0);
    let smallest = s.last().copied().unwrap_or(0.0);
    Observability {
        o1: libm::exp(s.iter().map(|x| libm::log(x.max(1e-300))).sum::<f64>() / pf) / m.sqrt(),
        o2: smallest / largest,
        o3: smallest,
        o4: smallest * smallest / largest,
        o5: 1.0 / s.iter().map(|x| 1.0 / x).sum::<f64>(),
        condition: largest / smallest,
        rows,
    }
}

/// `(R'R)^-1`, row by row, by back substitution on the columns of unit length.
pub(crate) fn covariance(r: &Mat, scale: &[f64]) -> Vec<f64> {
    let p = r.ncols();
    // row i of the inverse, which is upper triangular: X[i, j] for j >= i
    let mut inverse = vec![0.0; p * p];
    for i in (0..p).rev() {
        let (upper, lower) = inverse.split_at_mut((i + 1) * p);
        let row = &mut upper[i * p..];
        row[i] = 1.0;
        for k in i + 1..p {
            let u = r[(i, k)] / scale[k];
            let below = &lower[(k - i - 1) * p..(k - i) * p];
            for (x, y) in row[k..].iter_mut().zip(&below[k..]) {
                *x -= u * y;
            }
        }
        let diagonal = r[(i, i)] / scale[i];
        for x in &mut row[i..] {
            *x /= diagonal;
        }
    }
    let mut out = vec![0.0; p * p];
    for i in 0..p {
        for j in 0..=i {
            let sum: f64 =
                inverse[i * p + i..(i + 1) * p].iter().zip(&inverse[j * p + i..(j + 1) * p]).map(|(a, b)| a * b).sum();
            out[i * p + j] = sum / (scale[i] * scale[j]);
            out[j * p + i] = out[i * p + j];
        }
    }
    out
}

/// A parameter that was left out because others do the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dependent {
    /// Its name.
    pub name: String,
    /// Parameters that move together with it.
    pub with: Vec<String>,
    /// Whether they do so only as long as some joints hardly move, as in this data: then it is held at its nominal value.
    pub held: bool,
}

/// Poses at which structure is judged: joint values at random within (one turn of) the limits, joints of `resting` (from 0) where they are.
fn random_states(model: &Model, count: usize, resting: &[(usize, f64)]) -> Vec<State> {
    let mut rng = Pcg64Mcg::seed_from_u64(20_260_101);
    (0..count)
        .map(|_| {
            let q: Vec<f64> = model
                .robot
                .joints
                .iter()
                .map(|j| {
                    let low = j.limits[0].max(-std::f64::consts::PI);
                    let high = j.limits[1].min(std::f64::consts::PI);
                    rng.random_range(low.min(high - 1e-3)..high)
                })
                .collect();
            let mut s = State::at(&q);
            for (joint, at) in resting {
                s.q[*joint] = *at;
            }
            let torques: [f64; MAX_JOINTS] =
                std::array::from_fn(|k| 20.0 * trig::sin(q.get(k).copied().unwrap_or(0.3) * 7.3));
            s.torques = Some(torques);
            s.q_commanded = Some(s.q);
            s.dir = Some([1; MAX_JOINTS]);
            s.t = Some(0.0);
            s.temp_c = Some(20.0);
            s
        })
        .collect()
}

/// How far parameters of geometry with these names move a coordinate of the tool, each as far from nominal as is plausible: root mean square over
/// poses at random, m.
///
/// # Errors
/// As [`Forward::new`].
pub(crate) fn plausibly_moved(model: &Model, data: &Dataset, names: &[&str]) -> Result<f64> {
    const POSES: usize = 100;
    let mut terms = candidates(model, data, &Choice::from(ParameterSet::Geometry))?;
    terms.retain(|t| names.contains(&t.name.as_str()));
    if terms.is_empty() {
        return Ok(0.0);
    }
    let (p, model) = (terms.len(), Model { terms, ..model.clone() });
    let plausible = plausible(&model, data);
    let forward = Forward::new(model, (0..p).collect())?;
    let (mut ws, mut block, mut square) = (forward.workspace(), vec![0.0; 6 * p], 0.0);
    let anywhere = Measured::Pose { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0] };
    for state in random_states(forward.model(), POSES, &[]) {
        forward.linearize(&state, &anywhere, 0, &mut ws, &mut block);
        let each = block[..3 * p].iter().zip(plausible.iter().cycle());
        square += each.map(|(x, sd)| (x * sd.unwrap_or(0.0)).powi(2)).sum::<f64>();
    }
    Ok((square / (3 * POSES) as f64).sqrt())
}

/// A sort of measurement: what, its measuring frame, its session, its place of the balls.
type Sort = (Measured, usize, Option<u32>, Option<usize>);

/// One measurement of each sort that the data has: target, anchor, frame, session. Touches are one sort, since which ball it is changes no
/// derivative, unless the set of balls is `turned`: then they differ by ball and place.
fn sorts(data: &Dataset, turned: bool) -> Vec<Sort> {
    let mut seen: Vec<Sort> = Vec::new();
    for o in &data.observations {
        let blank = match o.measured {
            Measured::Touch { ball, .. } => Measured::Touch { ball: if turned { ball } else { 0 }, reading: [0.0; 3] },
            Measured::Reference { .. } => continue,
            other => other.blank(),
        };
        let sort = (blank, o.frame, o.state.session, o.state.place.filter(|_| turned));
        if !seen.contains(&sort) {
            seen.push(sort);
        }
    }
    seen
}

/// The independent ones among the candidates of `set`, in order of preference, and what was left out.
///
/// Independence is structural: it is judged on the nominal arm at random poses, with the sorts of measurement that the data
/// has, so that it does not depend on where the data happens to be. Joints that hardly move in the data stay where they are, and what
/// cannot be told without their motion is held. Where balls stood at unknown places, parameters of the arm that do the same are all
/// kept, since what is usual of an arm then counts as known ([`crate::fit::ball_places`]).
///
/// # Errors
/// A robot without masses where compliance is asked for.
pub fn independent_terms(nominal: &Model, data: &Dataset, choice: &Choice) -> Result<(Vec<Term>, Vec<Dependent>)> {
    let all = candidates(nominal, data, choice)?;
    let resting = hardly_moving(&nominal.robot, data);
    if resting.is_empty() {
        return independent_of(nominal, data, all, &resting);
    }
    let (free, _) = independent_of(nominal, data, all.clone(), &[])?;
    let (kept, mut dependent) = independent_of(nominal, data, all, &resting)?;
    for d in &mut dependent {
        d.held = free.iter().any(|t| t.name == d.name);
    }
    Ok((kept, dependent))
}

/// The independent ones of `terms` while joints of `resting` (from 0) stay where they are, and the others.
fn independent_of(
    nominal: &Model,
    data: &Dataset,
    terms: Vec<Term>,
    resting: &[(usize, f64)],
) -> Result<(Vec<Term>, Vec<Dependent>)> {
    let (mut columns, height) = columns_at_random_states(nominal, data, &terms, resting)?;
    let mut triangle = Triangle::default();
    let mut dependent = Vec::new();
    let named = |c: usize, with: Vec<String>| Dependent { name: terms[c].name.clone(), with, held: false };
    // a tool that only shifts all unknown places stays where the cell file has it, and not one of the places, of which the cell file
    // knows nothing: the others, and the tool, would be off by as much as that one is
    let mut order: Vec<_> = columns.chunks_exact_mut(height.max(1)).enumerate().collect();
    order.sort_by_key(|(c, _)| match terms[*c].effect.as_str() {
        "frame" | "base" => 0,
        "place" => 1,
        _ => 2,
    });
    // torques of a joint that stays where it is say how soft it is only where other joints do not, and it may carry many times as much elsewhere
    let at_rest =
        |t: &Term| matches!(t.basis.of, Variable::Torque { joint } if resting.iter().any(|(k, _)| k + 1 == joint));
    for (c, column) in order {
        if at_rest(&terms[c]) {
            dependent.push(named(c, Vec::new()));
            continue;
        }
        let norm = dot(column, column).sqrt();
        if norm < 1e-9 {
            if terms[c].effect != "compliance" {
                dependent.push(named(c, Vec::new()));
            }
            continue;
        }
        column.iter_mut().for_each(|x| *x /= norm);
        if let Err(mut shares) = triangle.keep(c, column) {
            shares.sort_unstable_by_key(|(k, _)| *k);
            let with = shares.iter().filter(|(_, s)| s.abs() > 1e-3).map(|(k, _)| terms[*k].name.clone()).collect();
            dependent.push(named(c, with));
        }
    }
    let mut kept = triangle.kept;
    // what is usual of an arm shares out what touches at unknown places leave open between parameters that do the same: one that stands
    // for both would have to be unusual
    let placed = !unknown_places(&nominal.cell, data).is_empty();
    let of_arm =
        |name: &String| terms.iter().any(|t| t.name == *name && matches!(t.effect.as_str(), "geometry" | "tool"));
    let shared = |d: &Dependent| placed && of_arm(&d.name) && d.with.iter().any(of_arm);
    kept.extend((0..terms.len()).filter(|k| dependent.iter().any(|d| d.name == terms[*k].name && shared(d))));
    kept.sort_unstable();
    dependent.retain(|d| !shared(d));
    Ok((kept.into_iter().map(|k| terms[k].clone()).collect(), dependent))
}

/// Derivatives of every sort of measurement to `terms` at random states of the nominal arm, column by column, and the height of a column:
/// twice as many rows as columns.
fn columns_at_random_states(
    nominal: &Model,
    data: &Dataset,
    terms: &[Term],
    resting: &[(usize, f64)],
) -> Result<(Vec<f64>, usize)> {
    let p = terms.len();
    let model = Model {
        robot: nominal.robot.clone(),
        cell: nominal.cell.without_geometry(),
        frames: nominal.frames.clone(),
        terms: terms.to_vec(),
    };
    let mut forward = Forward::new(model.clone(), (0..p).collect())?;
    let mut ws = forward.workspace();
    let mut jacobian = vec![0.0; 6 * p];
    let turned = terms.iter().any(|t| matches!(t.site, Site::Fixture(_)));
    let sorts = sorts(data, turned);
    let rows_of_a_state: usize = sorts.iter().map(|(m, ..)| residual_rows(m)).sum();
    let states = (2 * p).div_ceil(rows_of_a_state.max(1)).max(24);
    let height = states * rows_of_a_state;
    let mut columns = vec![0.0; p * height];
    let mut row = 0;
    let states = random_states(nominal, states, resting);
    // rows of one session together: columns of the others are zero there
    for (measured, frame, session, place) in &sorts {
        for state in &states {
            let state = State { session: *session, place: *place, ..*state };
            // a pose's orientation is compared with itself: derivatives are wanted, not residuals
            let measured = match measured {
                Measured::Pose { position, .. } => Measured::Pose {
                    position: *position,
                    quaternion: forward.orientation_seen(&state, *frame, &mut ws),
                },
                // a ball of a set that may be turned is where it is touched, or a turn of the set would look unlike one of the base
                Measured::Touch { ball, .. } if turned && place.is_none() => {
                    let mut touching = model.clone();
                    touching.cell.balls[*ball] = forward.world_from_tool(&state, &mut ws).translation;
                    forward = Forward::new(touching, (0..p).collect())?;
                    *measured
                }
                other => *other,
            };
            forward.check(&state, &measured, *frame)?;
            let rows = forward.linearize(&state, &measured, *frame, &mut ws, &mut jacobian);
            for k in 0..rows {
                for c in 0..p {
                    columns[c * height + row + k] = jacobian[k * p + c];
                }
            }
            row += rows;
        }
    }
    Ok((columns, height))
}

/// The smallest singular direction of `R` (scaled columns) where the data cannot tell parameters apart: names of those that
/// move together, or `None` where the condition is below `limit`.
#[must_use]
pub fn weakest_direction(r: &Mat, names: &[String], limit: f64) -> Option<Vec<String>> {
    let p = r.ncols();
    if p == 0 {
        return None;
    }
    let scale = column_lengths(r);
    let reference = median(&scale);
    if let Some(k) = scale.iter().position(|s| *s < 1e-12 * reference || !s.is_finite()) {
        return Some(vec![names[k].clone()]);
    }
    let scaled = Mat::from_fn(p, p, |i, j| r[(i, j)] / scale[j]);
    let (s, v) = weakest(&scaled)?;
    if s[p - 1] * limit > s[0] {
        return None;
    }
    let largest = v.iter().map(|x| x.abs()).fold(0.0, f64::max);
    Some((0..p).filter(|i| v[*i].abs() > 0.2 * largest).map(|i| names[i].clone()).collect())
}
