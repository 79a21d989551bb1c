//! In which order to visit configurations: a short way through joint space.

use trical_model::Joints;

/// Time of a straight motion in joint space where every joint is as fast as any other: the largest |dq|, rad.
#[must_use]
pub fn travel(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// An order of `0..n` in which the sum of `cost(i, j)` over neighbours is small: nearest neighbour, then 2-opt and moves of
/// single stops until nothing gains. `cost` must be symmetric. `start(i)` is the cost of beginning with stop i.
pub(crate) fn order(n: usize, cost: impl Fn(usize, usize) -> f64, start: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut tour: Vec<usize> = Vec::with_capacity(n);
    let mut left: Vec<usize> = (0..n).collect();
    while !left.is_empty() {
        let to = |k: usize| tour.last().map_or_else(|| start(k), |last| cost(*last, k));
        let nearest = (0..left.len()).reduce(|a, b| if to(left[b]) < to(left[a]) { b } else { a });
        if let Some(k) = nearest {
            tour.push(left.remove(k));
        }
    }
    improve(&mut tour, &cost, &start);
    tour
}

const GAIN: f64 = 1e-9;

fn improve(tour: &mut Vec<usize>, cost: &impl Fn(usize, usize) -> f64, start: &impl Fn(usize) -> f64) {
    let n = tour.len();
    // the way into position i of a tour
    let into = |tour: &[usize], i: usize| match i {
        0 => start(tour[0]),
        i if i < tour.len() => cost(tour[i - 1], tour[i]),
        _ => 0.0,
    };
    for _ in 0..200 {
        let mut gained = false;
        // turn the part i..=j round
        for i in 0..n {
            for j in i + 1..n {
                let before = into(tour, i) + into(tour, j + 1);
                let first = if i == 0 { start(tour[j]) } else { cost(tour[i - 1], tour[j]) };
                let last = if j + 1 < n { cost(tour[i], tour[j + 1]) } else { 0.0 };
                if first + last + GAIN < before {
                    tour[i..=j].reverse();
                    gained = true;
                }
            }
        }
        // take one stop out and put it in elsewhere
        for i in 0..n {
            let length = |t: &[usize]| (0..t.len()).map(|k| into(t, k)).sum::<f64>();
            let now = length(tour);
            let stop = tour.remove(i);
            let best = (0..n)
                .map(|k| {
                    tour.insert(k, stop);
                    let l = length(tour);
                    tour.remove(k);
                    (l, k)
                })
                .reduce(|a, b| if b.0 < a.0 { b } else { a });
            match best {
                Some((l, k)) if l + GAIN < now => {
                    tour.insert(k, stop);
                    gained = true;
                }
                _ => tour.insert(i, stop),
            }
        }
        if !gained {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn stops_on_a_circle_are_visited_around_it() {
        // in a shuffled order; the best open tour leaves out one side
        let n = 20;
        let at = |k: usize| {
            let a = std::f64::consts::TAU * ((k * 7) % n) as f64 / n as f64;
            (a.cos(), a.sin())
        };
        let cost = |i: usize, j: usize| (at(i).0 - at(j).0).hypot(at(i).1 - at(j).1);
        let tour = order(n, cost, |_| 0.0);
        let length: f64 = tour.windows(2).map(|w| cost(w[0], w[1])).sum();
        let side = 2.0 * (std::f64::consts::PI / n as f64).sin();
        assert!((length - 19.0 * side).abs() < 1e-9, "{length}");
        let mut sorted = tour.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..n).collect::<Vec<_>>());
    }

    #[test]
    fn a_tour_begins_where_the_arm_stands() {
        let cost = |i: usize, j: usize| (i as f64 - j as f64).abs();
        assert_eq!(order(6, cost, |i| 5.0 - i as f64), vec![5, 4, 3, 2, 1, 0]);
        assert!(order(0, cost, |_| 0.0).is_empty());
    }
}
