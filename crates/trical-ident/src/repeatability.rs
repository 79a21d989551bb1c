//! How far repeat visits scatter, by ball, by sense of approach, and over the session.
//!
//! The formulas are those of ISO 9283 (pose repeatability, drift, variation by direction) as public analysers have them;
//! its cycles, loads and speeds are not prescribed here, so no conformity is claimed.

pub mod iso9283;

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Serialize;
use trical_model::{Cell, Forward, Joints, Measured, Model, Recording, Robot, Row};

use crate::error::{IdentError, Result};

/// A visit: where, when, from which side.
struct Visit {
    /// Ball or target, 0-based.
    of: usize,
    joints: Joints,
    /// m.
    at: Vector3<f64>,
    /// s
    t: Option<f64>,
    dir: Option<[i8; 9]>,
}

/// Scatter of visits.
#[derive(Clone, Debug, Serialize)]
pub struct Scatter {
    /// Number of visits.
    pub visits: usize,
    /// Mean distance from the barycentre.
    pub mean_mm: f64,
    /// Standard deviation.
    pub sd_mm: f64,
    /// RP = mean + 3 sd.
    pub rp_mm: f64,
    /// Largest distance.
    pub max_mm: f64,
}

/// Pose repeatability of ISO 9283: RP = mean(l) + 3 S.
pub(crate) fn scatter(points: &[Vector3<f64>]) -> Option<Scatter> {
    if points.len() < 2 {
        return None;
    }
    let n = points.len() as f64;
    let middle = barycentre(points);
    let l: Vec<f64> = points.iter().map(|p| (p - middle).norm()).collect();
    let mean = l.iter().sum::<f64>() / n;
    let sd = (l.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let max = l.iter().copied().fold(0.0, f64::max);
    Some(Scatter {
        visits: points.len(),
        mean_mm: mean * 1e3,
        sd_mm: sd * 1e3,
        rp_mm: (mean + 3.0 * sd) * 1e3,
        max_mm: max * 1e3,
    })
}

pub(crate) fn barycentre(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64
}

/// A place that was visited again.
#[derive(Clone, Debug, Serialize)]
pub struct Place {
    /// Number of the place, from 1.
    pub number: usize,
    /// Ball, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ball: Option<usize>,
    /// Target, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<usize>,
    /// Of all visits.
    #[serde(flatten)]
    pub scatter: Scatter,
    /// Scatter by sense of approach (signs of the joints' last motions), where there are two visits or more.
    pub by_sense: BTreeMap<String, Scatter>,
    /// Largest distance between the barycentres of two senses of approach.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between_senses_mm: Option<f64>,
}

/// Places of one ball or target.
#[derive(Clone, Debug, Serialize)]
pub struct OfBall {
    /// "ball 1" or "target 1".
    pub name: String,
    /// Places visited twice or more.
    pub places: usize,
    /// Number of visits.
    pub visits: usize,
    /// Mean RP of them.
    pub mean_rp_mm: f64,
    /// Largest RP of them.
    pub max_rp_mm: f64,
}

/// By how much a joint's sense of approach moves the tool.
#[derive(Clone, Debug, Serialize)]
pub struct OfJoint {
    /// Joint, from 1.
    pub joint: usize,
    /// Visits with one sense and the other, at places that have both.
    pub visits: [usize; 2],
    /// How far the two lie apart on average.
    pub difference_mm: f64,
    /// Standard deviation of the difference along one axis.
    pub sd_mm: f64,
}

/// How places wander in time.
#[derive(Clone, Debug, Serialize)]
pub struct Drift {
    /// Along each axis.
    pub mm_per_h: [f64; 3],
    /// Its standard deviation on each axis.
    pub sd_mm_per_h: f64,
    /// From first to last visit.
    pub hours: f64,
    /// Length of the way in that time.
    pub over_the_session_mm: f64,
    /// Whether it is longer than three standard deviations.
    pub seen: bool,
}

/// How far repeat visits of one recording scatter.
#[derive(Clone, Debug, Serialize)]
pub struct Repeatability {
    /// Its name.
    pub recording: String,
    /// Its rows.
    pub rows: usize,
    /// Places visited once.
    pub single_visits: usize,
    /// Places visited twice or more.
    pub places: Vec<Place>,
    /// By ball or target.
    pub by_ball: Vec<OfBall>,
    /// By the sense of each joint's last motion.
    pub by_joint_sense: Vec<OfJoint>,
    /// Over the session, where there are times.
    pub drift: Option<Drift>,
    /// What is not claimed.
    pub iso_9283: &'static str,
}

fn visits(recording: &Recording, robot: Option<Robot>, cell: Option<Cell>) -> Result<(Vec<Visit>, bool)> {
    let touches = recording.rows.iter().any(|r| matches!(r.measured, Measured::Touch { .. }));
    let forward = match (touches, robot, cell) {
        (false, ..) => None,
        (true, Some(robot), Some(cell)) if robot.dof() == recording.joints => {
            Some(Forward::new(Model::nominal(robot, cell), Vec::new())?)
        }
        (true, Some(robot), Some(_)) => {
            return Err(IdentError::NotEnough(format!(
                "{}: has {} joints, but {} has {}",
                recording.name,
                recording.joints,
                robot.name,
                robot.dof()
            )));
        }
        (true, ..) => {
            return Err(IdentError::NotEnough(format!(
                "{}: has touches; expected a robot and a cell, to compute positions from the joints",
                recording.name
            )));
        }
    };
    let mut ws = forward.as_ref().map(Forward::workspace);
    let mut all = Vec::new();
    for row in &recording.rows {
        let (of, at) = match (&row.measured, &forward, &mut ws) {
            (Measured::Touch { ball, reading }, Some(forward), Some(ws)) => {
                (*ball, forward.world_from_tool(&row.state, ws).apply(&Vector3::from(*reading)))
            }
            (Measured::Point { target, position }, ..) if !touches => (*target, Vector3::from(*position)),
            (Measured::Pose { position, .. }, ..) if !touches => (0, Vector3::from(*position)),
            _ => continue,
        };
        all.push(visit(row, of, at));
    }
    if all.is_empty() {
        return Err(IdentError::NotEnough(format!(
            "{}: has no touches and no measured points; expected ball, ix_mm ..., or x_mm, y_mm, z_mm",
            recording.name
        )));
    }
    Ok((all, touches))
}

fn visit(row: &Row, of: usize, at: Vector3<f64>) -> Visit {
    // what was commanded is the same at every visit; corrected touches have no command
    let joints = row.state.q_commanded.unwrap_or(row.state.q);
    Visit { of, joints, at, t: row.state.t, dir: row.state.dir }
}

/// Visits of one place: same ball, joints close to those of the place's first visit.
fn by_place(visits: &[Visit], same: f64) -> Vec<Vec<&Visit>> {
    let mut places: Vec<Vec<&Visit>> = Vec::new();
    for v in visits {
        let near = |p: &&mut Vec<&Visit>| {
            p.first().is_some_and(|f| f.of == v.of && f.joints.iter().zip(&v.joints).all(|(a, b)| (a - b).abs() < same))
        };
        match places.iter_mut().find(near) {
            Some(place) => place.push(v),
            None => places.push(vec![v]),
        }
    }
    places
}

/// Joints within which rows are visits of one place, deg: of touches the nominal arm says what other joints do, measured points are compared as they are.
const SAME_DEG: [f64; 2] = [1.0, 0.1];

/// How far repeat visits scatter. Rows of one ball (or target) whose joints differ by less than `same_deg` (1 deg, of measured points 0.1 deg, where it is
/// not given) are visits of one place; arm and cell are needed for touches: their place is where the nominal arm says that the ball is.
///
/// # Errors
/// Touches without arm and cell, nothing that was measured, or no place that was visited twice.
pub fn repeatability(
    recording: &Recording,
    robot: Option<Robot>,
    cell: Option<Cell>,
    same_deg: Option<f64>,
) -> Result<Repeatability> {
    let (visits, touches) = visits(recording, robot, cell)?;
    let same_deg = same_deg.unwrap_or(SAME_DEG[usize::from(!touches)]);
    let places = by_place(&visits, same_deg.to_radians());
    let single = places.iter().filter(|p| p.len() < 2).count();
    let repeated: Vec<Vec<&Visit>> = places.into_iter().filter(|p| p.len() >= 2).collect();
    if repeated.is_empty() {
        return Err(IdentError::NotEnough(format!(
            "{}: no place was visited twice within {} deg; expected poses that were visited several times",
            recording.name, same_deg
        )));
    }
    let told: Vec<Place> =
        repeated.iter().enumerate().filter_map(|(k, p)| place(k + 1, p, touches, recording.joints)).collect();
    Ok(Repeatability {
        recording: recording.name.clone(),
        rows: recording.rows.len(),
        single_visits: single,
        by_ball: by_ball(&told, touches),
        by_joint_sense: by_joint_sense(&repeated, recording.joints),
        drift: drift(&repeated),
        places: told,
        iso_9283: "formulas only; no conformity is claimed",
    })
}

fn points(visits: &[&Visit]) -> Vec<Vector3<f64>> {
    visits.iter().map(|v| v.at).collect()
}

fn place(number: usize, visits: &[&Visit], touches: bool, joints: usize) -> Option<Place> {
    let of = visits.first()?.of + 1;
    let mut senses: BTreeMap<String, Vec<Vector3<f64>>> = BTreeMap::new();
    for v in visits {
        let Some(dir) = v.dir else { continue };
        let sign = |d: &i8| match d.signum() {
            1 => '+',
            -1 => '-',
            _ => '0',
        };
        let signs = dir.iter().take(joints).map(sign).collect();
        senses.entry(signs).or_default().push(v.at);
    }
    let middles: Vec<Vector3<f64>> = senses.values().map(|p| barycentre(p)).collect();
    let between = (middles.len() > 1).then(|| {
        let pairs = middles.iter().flat_map(|a| middles.iter().map(move |b| (a - b).norm()));
        pairs.fold(0.0, f64::max) * 1e3
    });
    Some(Place {
        number,
        ball: touches.then_some(of),
        target: (!touches).then_some(of),
        scatter: scatter(&points(visits))?,
        by_sense: senses.into_iter().filter_map(|(signs, p)| Some((signs, scatter(&p)?))).collect(),
        between_senses_mm: between,
    })
}

fn by_ball(places: &[Place], touches: bool) -> Vec<OfBall> {
    let mut balls: BTreeMap<usize, Vec<&Scatter>> = BTreeMap::new();
    for p in places {
        balls.entry(p.ball.or(p.target).unwrap_or(0)).or_default().push(&p.scatter);
    }
    balls
        .into_iter()
        .map(|(of, all)| OfBall {
            name: format!("{} {of}", if touches { "ball" } else { "target" }),
            places: all.len(),
            visits: all.iter().map(|s| s.visits).sum(),
            mean_rp_mm: all.iter().map(|s| s.rp_mm).sum::<f64>() / all.len() as f64,
            max_rp_mm: all.iter().map(|s| s.rp_mm).fold(0.0, f64::max),
        })
        .collect()
}

/// For each joint: places that were approached with both senses, and by how much the two differ on average.
fn by_joint_sense(places: &[Vec<&Visit>], joints: usize) -> Vec<OfJoint> {
    let mut all = Vec::new();
    for joint in 0..joints {
        let (mut counts, mut sum, mut weight, mut square, mut free) = ([0, 0], Vector3::zeros(), 0.0, 0.0, 0.0);
        for place in places {
            let side = |sign: i8| -> Vec<Vector3<f64>> {
                place.iter().filter(|v| v.dir.is_some_and(|d| d[joint] == sign)).map(|v| v.at).collect()
            };
            let (plus, minus) = (side(1), side(-1));
            if plus.is_empty() || minus.is_empty() {
                continue;
            }
            counts[0] += plus.len();
            counts[1] += minus.len();
            let (a, b) = (barycentre(&plus), barycentre(&minus));
            // variance of a difference of means is s^2 (1/n + 1/m)
            let w = 1.0 / (1.0 / plus.len() as f64 + 1.0 / minus.len() as f64);
            sum += (a - b) * w;
            weight += w;
            square += plus.iter().map(|p| (p - a).norm_squared()).sum::<f64>();
            square += minus.iter().map(|p| (p - b).norm_squared()).sum::<f64>();
            free += 3.0 * (plus.len() + minus.len() - 2) as f64;
        }
        if weight > 0.0 {
            let variance = if free > 0.0 { square / free } else { f64::NAN };
            all.push(OfJoint {
                joint: joint + 1,
                visits: counts,
                difference_mm: (sum / weight).norm() * 1e3,
                sd_mm: (variance / weight).sqrt() * 1e3,
            });
        }
    }
    all
}

/// A straight line in time through the deviations of all visits from their places.
fn drift(places: &[Vec<&Visit>]) -> Option<Drift> {
    let mut pairs: Vec<(f64, Vector3<f64>)> = Vec::new();
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut used = 0;
    for place in places {
        let timed: Vec<(f64, Vector3<f64>)> = place.iter().filter_map(|v| Some((v.t?, v.at))).collect();
        if timed.len() < 2 {
            continue;
        }
        used += 1;
        let n = timed.len() as f64;
        let t0 = timed.iter().map(|v| v.0).sum::<f64>() / n;
        let p0 = barycentre(&timed.iter().map(|v| v.1).collect::<Vec<_>>());
        for (t, p) in timed {
            (first, last) = (first.min(t), last.max(t));
            pairs.push((t - t0, p - p0));
        }
    }
    let spread: f64 = pairs.iter().map(|(t, _)| t * t).sum();
    // one slope and a middle for each place; without freedom left nothing can be said
    let free = pairs.len().checked_sub(used + 1).filter(|f| *f > 0)? as f64;
    if spread <= 0.0 {
        return None;
    }
    let slope = pairs.iter().map(|(t, p)| p * *t).sum::<Vector3<f64>>() / spread;
    let left: f64 = pairs.iter().map(|(t, p)| (p - slope * *t).norm_squared()).sum();
    let sd = (left / (3.0 * free) / spread).sqrt();
    let per_hour = slope * 3600.0 * 1e3;
    Some(Drift {
        mm_per_h: per_hour.into(),
        sd_mm_per_h: sd * 3600.0 * 1e3,
        hours: (last - first) / 3600.0,
        over_the_session_mm: slope.norm() * (last - first) * 1e3,
        // three axes: the length of pure noise is sqrt(3) sd
        seen: slope.norm() > 3.0 * 3.0_f64.sqrt() * sd,
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use trical_model::State;

    use super::*;

    #[test]
    fn rp_of_four_points_by_hand() {
        // distances from the barycentre (origin): 1, 1, 2, 2 mm; mean 1.5, S = sqrt(4 * 0.25 / 3)
        let p = [[1.0, 0.0], [-1.0, 0.0], [0.0, 2.0], [0.0, -2.0]].map(|[x, y]| Vector3::new(x, y, 0.0) * 1e-3);
        let s = scatter(&p).unwrap();
        assert!((s.mean_mm - 1.5).abs() < 1e-12 && (s.sd_mm - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((s.rp_mm - (1.5 + 3.0 * (1.0_f64 / 3.0).sqrt())).abs() < 1e-12);
        assert!((s.max_mm - 2.0).abs() < 1e-12 && s.visits == 4);
        assert!(scatter(&p[..1]).is_none());
    }

    fn visit(place: f64, x: f64, t: f64, sense: i8) -> Visit {
        let mut dir = [0; 9];
        dir[1] = sense;
        Visit { of: 0, joints: [place; 9], at: Vector3::new(x, 0.0, 0.0), t: Some(t), dir: Some(dir) }
    }

    #[test]
    fn senses_and_drift_are_told_apart() {
        let mut all = Vec::new();
        for place in 0..3 {
            for (k, sense) in [1, -1, -1, 1, 1, -1, -1, 1].into_iter().enumerate() {
                let t = 7200.0 + 900.0 * k as f64;
                all.push(visit(f64::from(place), 10e-6 * f64::from(sense) + 4e-6 * t / 3600.0, t, sense));
            }
        }
        let places = by_place(&all, 0.01);
        assert_eq!(places.len(), 3);
        let joint = by_joint_sense(&places, 6);
        assert_eq!((joint.len(), joint[0].joint, joint[0].visits), (1, 2, [12, 12]));
        assert!((joint[0].difference_mm - 0.02).abs() < 1e-9, "{}", joint[0].difference_mm);
        // deviations from the mean of a side, 1 um a visit: squares 25 and 17 at each place, 54 degrees of freedom, weight 6
        assert!((joint[0].sd_mm - 1e-3 * (126.0_f64 / 54.0 / 6.0).sqrt()).abs() < 1e-9, "{}", joint[0].sd_mm);
        // the senses are balanced in time, so the line is the drift's own
        let d = drift(&places).unwrap();
        assert!((d.mm_per_h[0] - 0.004).abs() < 1e-9, "{:?}", d.mm_per_h);
        assert!((d.hours - 1.75).abs() < 1e-12 && !d.seen);
        let told = place(1, &places[0], true, 6).unwrap();
        assert_eq!(told.by_sense.keys().collect::<Vec<_>>(), ["0+0000", "0-0000"]);
        assert_eq!((told.number, told.ball, told.target), (1, Some(1), None));
        assert!((told.between_senses_mm.unwrap() - 0.02).abs() < 1e-9);
    }

    #[test]
    fn points_that_were_visited_again_are_places_and_touches_need_the_arm() {
        let row = |q: f64, measured| Row { state: State::at(&[q; 6]), measured, seq: None, line: 2 };
        let point = |q, x| row(q, Measured::Point { target: 0, position: [x, 0.0, 0.0] });
        let of = |rows: Vec<Row>| {
            let recording = Recording { name: "r.csv".into(), joints: 6, rows, ..Recording::default() };
            repeatability(&recording, None, None, Some(0.01))
        };
        let found = of(vec![point(0.1, 1e-3), point(0.5, 0.2), point(0.1, -1e-3)]).unwrap();
        assert_eq!((found.rows, found.single_visits, found.places.len()), (3, 1, 1));
        // half a degree apart they are other poses, unless it is said
        let rows = vec![point(0.1, 1e-3), point(0.1 + 0.5_f64.to_radians(), 5e-3)];
        let recording = Recording { name: "r.csv".into(), joints: 6, rows, ..Recording::default() };
        assert_eq!(repeatability(&recording, None, None, Some(1.0)).unwrap().places.len(), 1);
        let apart = repeatability(&recording, None, None, None).unwrap_err().to_string();
        assert!(apart.contains("no place was visited twice within 0.1 deg"), "{apart}");
        let touch = of(vec![row(0.1, Measured::Touch { ball: 0, reading: [0.0; 3] })]).unwrap_err().to_string();
        assert!(touch.contains("r.csv: has touches; expected a robot and a cell"), "{touch}");
        let lengths = of(vec![row(0.1, Measured::Distance { anchor: 0, length: 1.0 })]).unwrap_err().to_string();
        assert!(lengths.contains("r.csv: has no touches and no measured points"), "{lengths}");
    }
}
