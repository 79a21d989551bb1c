//! Several readings of one thing at one pose: they share what the arm did there, and are one measurement.

use trical_model::{Measured, State};

use crate::dataset::{Dataset, Observation};

/// How far readings of one pose differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Standard deviation of one reading, m, of each coordinate.
    pub sd: f64,
    /// How many readings a pose has, where it has several (mean).
    pub readings: f64,
    /// How many coordinates of readings tell it beyond those of the means.
    pub freedom: usize,
}

/// Readings of the same thing that were taken one after the other, the arm standing, as one: their mean. An error of the arm that is the same in
/// all of them counts once then. Besides, how far they differ; `None` where each pose was read once.
#[must_use]
pub fn averaged(data: &Dataset) -> (Dataset, Option<Scatter>) {
    let mut groups: Vec<Vec<Observation>> = Vec::new();
    for o in &data.observations {
        let here = groups.iter_mut().rev().take_while(|g| g.first().is_some_and(|first| first.pose == o.pose));
        match here.into_iter().find(|g| g.first().is_some_and(|first| is_same(first, o))) {
            Some(group) => group.push(*o),
            None => groups.push(vec![*o]),
        }
    }
    if groups.len() == data.observations.len() {
        return (data.clone(), None);
    }
    let (mut squares, mut freedom, mut several) = (0.0, 0, Vec::new());
    let mut means = Vec::with_capacity(groups.len());
    for group in &groups {
        let Some(first) = group.first() else { continue };
        let one = mean_of(first, group);
        if group.len() > 1 {
            several.push(group.len() as f64);
            let of_mean = one.measured.lengths().1;
            freedom += (group.len() - 1) * of_mean.len();
            let all = group.iter().flat_map(|o| o.measured.lengths().1.iter().zip(of_mean));
            squares += all.map(|(v, mean)| (v - mean) * (v - mean)).sum::<f64>();
        }
        means.push(one);
    }
    let scatter = Scatter {
        sd: (squares / freedom.max(1) as f64).sqrt(),
        readings: several.iter().sum::<f64>() / several.len() as f64,
        freedom,
    };
    (Dataset { observations: means, rejected: data.rejected.clone(), ..data.shell() }, Some(scatter))
}

/// Whether two observations of a pose are of the same thing, the arm having come the same way with the same load.
fn is_same(a: &Observation, b: &Observation) -> bool {
    let came = |o: &Observation| (o.frame, o.recording, o.state.dir, o.state.payload_kg, o.state.place);
    a.measured.blank() == b.measured.blank() && came(a) == came(b)
}

fn mean_of(first: &Observation, group: &[Observation]) -> Observation {
    let mean = |of: &dyn Fn(&State) -> Option<f64>| {
        let all: Vec<f64> = group.iter().filter_map(|o| of(&o.state)).collect();
        of(&first.state).map(|_| all.iter().sum::<f64>() / all.len() as f64)
    };
    let state = State { t: mean(&|s| s.t), seq: mean(&|s| s.seq), temp_c: mean(&|s| s.temp_c), ..first.state };
    let length = |k: usize| group.iter().map(|o| o.measured.lengths().1[k]).sum::<f64>() / group.len() as f64;
    let three = || std::array::from_fn(length);
    let measured = match first.measured {
        Measured::Touch { ball, .. } => Measured::Touch { ball, reading: three() },
        Measured::Point { target, .. } => Measured::Point { target, position: three() },
        Measured::Distance { anchor, .. } => Measured::Distance { anchor, length: length(0) },
        Measured::Pose { quaternion, .. } => {
            Measured::Pose { position: three(), quaternion: turned(group, quaternion) }
        }
        other @ Measured::Reference { .. } => other,
    };
    Observation { state, measured, ..*first }
}

/// Mean of orientations that hardly differ, each with the sign that is nearer to the first.
fn turned(group: &[Observation], first: [f64; 4]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for o in group {
        let Measured::Pose { quaternion: q, .. } = o.measured else { continue };
        let along: f64 = q.iter().zip(&first).map(|(a, b)| a * b).sum();
        sum.iter_mut().zip(q).for_each(|(sum, q)| *sum += q * along.signum());
    }
    let norm = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
    sum.map(|v| v / norm)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Recording, Row};

    use super::*;
    use crate::dataset::JointSource;

    /// Joint 1 (rad), sense of all joints, target and x (mm), one row each, 10 s after the one before.
    fn read(rows: &[(f64, i8, usize, f64)]) -> Dataset {
        let row = |(k, (q, dir, target, x)): (usize, &(f64, i8, usize, f64))| {
            let t = Some(10.0 * k as f64);
            let state = State { dir: Some([*dir; 9]), t, ..State::at(&[*q, 0.5, 0.0, 0.0, 0.0, 0.0]) };
            let measured = Measured::Point { target: *target, position: [x * 1e-3, 0.0, 0.0] };
            Row { state, measured, seq: None, line: k + 2 }
        };
        let rows = rows.iter().enumerate().map(row).collect();
        let recording = Recording { name: "r.csv".into(), joints: 6, rows, ..Recording::default() };
        Dataset::build(&[recording], JointSource::Read, None).unwrap()
    }

    #[test]
    fn readings_of_one_thing_at_one_pose_are_one_and_those_of_another_or_from_another_side_are_not() {
        let (a, b) = (0.1, 0.2);
        let data = read(&[
            (a, 1, 0, 10.0),
            (a, 1, 1, 50.0),
            (a, 1, 0, 13.0),
            (a, 1, 0, 16.0),
            (a, -1, 0, 20.0),
            (b, 1, 0, 30.0),
            (a, 1, 0, 40.0),
        ]);
        let (means, scatter) = averaged(&data);
        let seen: Vec<(usize, f64, f64)> = means
            .observations
            .iter()
            .map(|o| (o.line, (o.measured.lengths().1[0] * 1e6).round() * 1e-3, o.state.t.unwrap()))
            .collect();
        assert_eq!(seen, [(2, 13.0, 50.0 / 3.0), (3, 50.0, 10.0), (6, 20.0, 40.0), (7, 30.0, 50.0), (8, 40.0, 60.0)]);
        // 3 mm along one of three axes
        let scatter = scatter.unwrap();
        assert_eq!((scatter.readings, scatter.freedom), (3.0, 6));
        assert!((scatter.sd - 3e-3 / 3.0_f64.sqrt()).abs() < 1e-9, "{}", scatter.sd);
        let (again, none) = averaged(&means);
        assert!(none.is_none() && again.observations.len() == 5);
    }
}
