//! Which poses a fit must not see when it is scored: by pose, by block, forward in time, by session.
//!
//! Rows at the same joints are one pose. Poses that are nearer to each other than poses of this arm usually are make one block:
//! a cube of poses, a pallet, a short path. What a fit learns at one pose of a block it knows at the others, so a fold that cuts
//! a block scores the fit on what it has seen.

use std::f64::consts::TAU;

use nalgebra::SVector;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use trical_model::{Cell, MAX_JOINTS};

use crate::dataset::Dataset;
use crate::fit::ball_places::{place_of, unknown_places};

/// Folds of cross-validation.
pub const FOLDS: usize = 4;

/// Poses of a block are nearer to each other than this share of the usual distance to the nearest neighbour.
const NEAR: f64 = 0.5;

/// A block with more than this share of all poses is divided: else there would be nothing to fit.
const LARGEST: f64 = 1.0 / 8.0;

/// Intervals of a joint's angle that are left out in turn.
const INTERVALS: usize = 16;

/// Poses among which the usual distance is estimated.
const SAMPLE: usize = 400;

/// Beyond so many poses only those in the same cell of a grid are compared.
const COMPARED: usize = 16_000;

type Joints = SVector<f64, MAX_JOINTS>;

/// Poses and blocks of a data set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folds {
    /// Poses that have observations, in order.
    poses: Vec<usize>,
    /// Block of each of them, from 0.
    block: Vec<usize>,
    /// Session of each of them.
    session: Vec<usize>,
}

/// One split of the poses: those that are scored. All others are fitted.
pub type Split<'a> = Box<dyn Fn(usize) -> bool + 'a>;

impl Folds {
    /// Of the observations of `data`.
    #[must_use]
    pub fn of(data: &Dataset) -> Self {
        let (mut poses, mut session, mut joints) = (Vec::new(), Vec::new(), Vec::new());
        for o in &data.observations {
            if poses.last() != Some(&o.pose) {
                poses.push(o.pose);
                session.push(o.recording);
                joints.push(Joints::from(o.state.q));
            }
        }
        Self { block: blocks(&joints), poses, session }
    }

    /// The same poses, those at one unknown place of the balls as one block, and all others as one more. `None` where fewer than three places are
    /// unknown.
    #[must_use]
    pub fn at_places(&self, cell: &Cell, data: &Dataset) -> Option<Self> {
        let places = unknown_places(cell, data);
        if places.len() < 3 {
            return None;
        }
        let mut block = vec![places.len(); self.poses.len()];
        for o in &data.observations {
            let place = place_of(o).and_then(|here| places.iter().position(|p| *p == here));
            if let Some(place) = place {
                block[self.at(o.pose)] = place;
            }
        }
        Some(Self { block, ..self.clone() })
    }

    /// The same poses in blocks by the angle of a joint (rad, counted from 0), modulo a turn: intervals that have as many poses each.
    #[must_use]
    pub fn by_angle(&self, data: &Dataset, joint: usize) -> Self {
        let mut angles = vec![(0.0, 0); self.poses.len()];
        for o in &data.observations {
            let at = self.at(o.pose);
            angles[at] = (o.state.q[joint].rem_euclid(TAU), at);
        }
        angles.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut block = vec![0; self.poses.len()];
        for (rank, (_, at)) in angles.iter().enumerate() {
            block[*at] = INTERVALS * rank / angles.len();
        }
        Self { block, ..self.clone() }
    }

    /// Poses that have observations, in order.
    #[must_use]
    pub fn poses(&self) -> &[usize] {
        &self.poses
    }

    /// Number of blocks: so many independent poses were measured.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.block.iter().max().map_or(0, |b| b + 1)
    }

    fn at(&self, pose: usize) -> usize {
        self.poses.binary_search(&pose).unwrap_or(0)
    }

    /// Block of a pose, from 0.
    #[must_use]
    pub fn block_of(&self, pose: usize) -> usize {
        self.block.get(self.at(pose)).copied().unwrap_or(0)
    }

    /// Fold of each block when there are `folds`: the next block, in the order of time, goes to the fold with the fewest poses.
    #[must_use]
    pub fn fold_of_blocks(&self, folds: usize) -> Vec<usize> {
        let mut sizes = vec![0_usize; self.blocks()];
        for b in &self.block {
            sizes[*b] += 1;
        }
        let mut filled = vec![0_usize; folds.max(1)];
        sizes
            .iter()
            .map(|size| {
                let fold = (0..filled.len()).min_by_key(|f| (filled[*f], *f)).unwrap_or(0);
                filled[fold] += size;
                fold
            })
            .collect()
    }

    /// `folds` splits in which every pose is scored once, by a fit without its pose: pose k is in fold k mod `folds`.
    #[must_use]
    pub fn by_pose(&self, folds: usize) -> Vec<Split<'_>> {
        (0..folds).map(|f| -> Split<'_> { Box::new(move |pose| self.at(pose) % folds == f) }).collect()
    }

    /// `folds` splits in which every pose is scored once, by a fit without its block.
    #[must_use]
    pub fn by_block(&self, folds: usize) -> Vec<Split<'_>> {
        let fold = std::sync::Arc::new(self.fold_of_blocks(folds));
        (0..folds)
            .map(|f| -> Split<'_> {
                let fold = fold.clone();
                Box::new(move |pose| fold.get(self.block_of(pose)) == Some(&f))
            })
            .collect()
    }

    /// The last `percent` of the poses of each session, by a fit to those before. `None` where that leaves nothing on one side.
    #[must_use]
    pub fn forward(&self, percent: usize) -> Option<Split<'_>> {
        let sessions = self.sessions();
        let mut first = vec![usize::MAX; sessions];
        for (s, first) in first.iter_mut().enumerate() {
            let own: Vec<usize> = (0..self.poses.len()).filter(|k| self.session[*k] == s).collect();
            let held = own.len() * percent.min(100) / 100;
            if held == 0 || held == own.len() {
                return None;
            }
            *first = own[own.len() - held];
        }
        Some(Box::new(move |pose| {
            let k = self.at(pose);
            k >= first[self.session[k]]
        }))
    }

    /// Number of sessions.
    #[must_use]
    pub fn sessions(&self) -> usize {
        self.session.iter().max().map_or(0, |s| s + 1)
    }

    /// Session of a pose, from 0.
    #[must_use]
    pub fn session_of(&self, pose: usize) -> usize {
        self.session.get(self.at(pose)).copied().unwrap_or(0)
    }
}

/// Block of each pose: poses nearer than [`NEAR`] of the usual distance are one, as are those that others connect; blocks are numbered in
/// the order of their first poses. The usual distance is that of poses whose joints have the values of the recording in another,
/// random order: as spread as they are, but without clusters.
fn blocks(joints: &[Joints]) -> Vec<usize> {
    let n = joints.len();
    let near = NEAR * usual_distance(joints);
    let mut parent: Vec<usize> = (0..n).collect();
    let root = |parent: &mut Vec<usize>, mut k: usize| {
        while parent[k] != k {
            parent[k] = parent[parent[k]];
            k = parent[k];
        }
        k
    };
    let mut join = |a: usize, b: usize| {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b)] = a.min(b);
    };
    if n <= COMPARED {
        // sorted by the first joint that moves most, only neighbours within `near` along it are compared
        let axis = longest(joints.iter());
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| joints[*a][axis].total_cmp(&joints[*b][axis]));
        for (i, a) in order.iter().enumerate() {
            for b in order[i + 1..].iter().take_while(|b| joints[**b][axis] - joints[*a][axis] <= near) {
                if (joints[*a] - joints[*b]).norm() <= near {
                    join(*a, *b);
                }
            }
        }
    } else if near > 0.0 {
        let mut cells = std::collections::BTreeMap::new();
        for (k, q) in joints.iter().enumerate() {
            let cell: [i64; MAX_JOINTS] = std::array::from_fn(|i| (q[i] / near).floor() as i64);
            let first = *cells.entry(cell).or_insert(k);
            join(first, k);
        }
    }
    let mut members: std::collections::BTreeMap<usize, Vec<usize>> = std::collections::BTreeMap::new();
    for k in 0..n {
        let r = root(&mut parent, k);
        members.entry(r).or_default().push(k);
    }
    let largest = ((n as f64 * LARGEST) as usize).max(1);
    let mut whole: Vec<Vec<usize>> = members.into_values().flat_map(|m| divided(joints, m, largest)).collect();
    whole.sort_by_key(|m| m.iter().min().copied());
    let mut block = vec![0; n];
    for (b, members) in whole.iter().enumerate() {
        for k in members {
            block[*k] = b;
        }
    }
    block
}

/// The joint along which poses are spread most.
fn longest<'a>(poses: impl Iterator<Item = &'a Joints> + Clone) -> usize {
    let spread = |axis: usize| {
        let of = poses.clone().map(|q| q[axis]);
        of.clone().fold(f64::MIN, f64::max) - of.fold(f64::MAX, f64::min)
    };
    (0..MAX_JOINTS).max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(0)
}

/// A block of at most `largest` poses as it is; a larger one cut in two halves across its longest direction, and so on.
fn divided(joints: &[Joints], mut members: Vec<usize>, largest: usize) -> Vec<Vec<usize>> {
    if members.len() <= largest {
        return vec![members];
    }
    let axis = longest(members.iter().map(|k| &joints[*k]));
    members.sort_by(|a, b| joints[*a][axis].total_cmp(&joints[*b][axis]).then(a.cmp(b)));
    let rest = members.split_off(members.len() / 2);
    let mut out = divided(joints, members, largest);
    out.extend(divided(joints, rest, largest));
    out
}

/// Median distance to the nearest neighbour among poses whose joints are shuffled, each by itself, rad (prismatic joints: m).
fn usual_distance(joints: &[Joints]) -> f64 {
    let n = joints.len();
    let mut rng = Pcg64Mcg::seed_from_u64(20_261_122);
    let orders: Vec<Vec<usize>> = (0..MAX_JOINTS)
        .map(|_| {
            let mut order: Vec<usize> = (0..n).collect();
            order.shuffle(&mut rng);
            order
        })
        .collect();
    let shuffled: Vec<Joints> = (0..n).map(|k| Joints::from_fn(|axis, _| joints[orders[axis][k]][axis])).collect();
    let nearest = to_nearest(&shuffled, n.div_ceil(SAMPLE).max(1));
    crate::rigid::median(&nearest)
}

/// The distance from each `every`-th pose to its nearest neighbour among all, in no order.
fn to_nearest(poses: &[Joints], every: usize) -> Vec<f64> {
    // in the order of the joint that is spread most, a search ends where this joint alone is farther away than the nearest so far
    let axis = longest(poses.iter());
    let mut order: Vec<usize> = (0..poses.len()).collect();
    order.sort_by(|a, b| poses[*a][axis].total_cmp(&poses[*b][axis]));
    order
        .iter()
        .enumerate()
        .filter(|(_, a)| *a % every == 0)
        .map(|(at, a)| {
            let mut least = f64::INFINITY;
            let mut search = |others: &mut dyn Iterator<Item = &usize>| {
                for other in others {
                    let d = poses[*other] - poses[*a];
                    if d[axis] * d[axis] >= least {
                        break;
                    }
                    least = least.min(d.norm_squared());
                }
            };
            search(&mut order[at + 1..].iter());
            search(&mut order[..at].iter().rev());
            least.sqrt()
        })
        .filter(|d| d.is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use rand::RngExt;
    use trical_model::{Measured, Recording, Row, State};

    use super::*;
    use crate::dataset::JointSource;

    fn random(count: usize, seed: u64) -> Vec<Joints> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        (0..count).map(|_| Joints::from_fn(|i, _| if i < 6 { rng.random_range(-2.0..2.0) } else { 0.0 })).collect()
    }

    fn folds(joints: &[Joints]) -> Folds {
        let n = joints.len();
        Folds { poses: (0..n).collect(), block: blocks(joints), session: vec![0; n] }
    }

    #[test]
    fn the_nearest_neighbour_is_that_of_a_search_among_all() {
        let poses = random(200, 4);
        for every in [1, 7] {
            let mut expected: Vec<f64> = (0..200)
                .step_by(every)
                .map(|a| {
                    (0..200).filter(|b| *b != a).map(|b| (poses[a] - poses[b]).norm()).fold(f64::INFINITY, f64::min)
                })
                .collect();
            let mut found = to_nearest(&poses, every);
            found.sort_by(f64::total_cmp);
            expected.sort_by(f64::total_cmp);
            assert_eq!(found, expected);
        }
        assert!(to_nearest(&poses[..1], 1).is_empty());
    }

    #[test]
    fn poses_at_random_are_blocks_of_their_own() {
        let folds = folds(&random(600, 1));
        assert!(folds.blocks() > 560, "{} blocks", folds.blocks());
    }

    #[test]
    fn a_cube_of_poses_is_one_block_and_no_fold_cuts_it() {
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        let centres = random(24, 3);
        let mut joints = Vec::new();
        for c in &centres {
            for _ in 0..8 {
                joints.push(c + Joints::from_fn(|i, _| if i < 6 { rng.random_range(-0.05..0.05) } else { 0.0 }));
            }
        }
        let folds = folds(&joints);
        assert_eq!(folds.blocks(), 24);
        for split in folds.by_block(4) {
            for cube in 0..24 {
                let held = (0..8).filter(|k| split(cube * 8 + k)).count();
                assert!(held == 0 || held == 8, "{held} of 8 poses of a cube are scored");
            }
        }
    }

    #[test]
    fn one_path_is_divided_into_pieces() {
        let joints: Vec<Joints> =
            (0..200).map(|k| Joints::from_fn(|i, _| if i < 6 { f64::from(k) * 0.01 } else { 0.0 })).collect();
        let folds = folds(&joints);
        assert!(folds.blocks() >= 8, "{} blocks", folds.blocks());
        // pieces are connected: neighbours along the path change block as rarely as can be
        let changes = folds.block.windows(2).filter(|w| w[0] != w[1]).count();
        assert_eq!(changes + 1, folds.blocks());
    }

    #[test]
    fn poses_at_one_place_of_the_balls_are_one_block_and_two_places_are_too_few() {
        let touch = |place: usize| Measured::Touch { ball: place % 2, reading: [0.0; 3] };
        let at = |places: &[usize]| {
            let row = |(k, place): (usize, &usize)| Row {
                state: State { place: Some(*place), ..State::at(&[0.1 * f64::from(u8::try_from(k).unwrap()); 6]) },
                measured: touch(k),
                seq: None,
                line: k + 2,
            };
            let rows = places.iter().enumerate().map(row).collect();
            let places = (1..=4).map(|p| format!("p{p}")).collect();
            let recording = Recording { name: "r".into(), joints: 6, rows, places, ..Recording::default() };
            Dataset::build(&[recording], JointSource::Read, None).unwrap()
        };
        let text = "[base]\nxyz_mm = [0.0, 0.0, 0.0]\nzyx_deg = [0.0, 0.0, 0.0]\n[tool]\ntcp_mm = [0.0, 0.0, 100.0]\n\
                    [balls]\ndistances_mm = { d12 = 50.0 }\n";
        let cell = Cell::parse(text, "cell.toml").unwrap();
        let data = at(&[0, 0, 1, 1, 0, 2, 2]);
        let folds = Folds::of(&data);
        let places = folds.at_places(&cell, &data).map(|f| f.block);
        assert_eq!(places, Some(vec![0, 0, 1, 1, 0, 2, 2]));
        let two = at(&[0, 0, 1, 1]);
        assert_eq!(Folds::of(&two).at_places(&cell, &two), None);
    }

    #[test]
    fn blocks_by_angle_are_intervals_of_a_turn_with_as_many_poses_each() {
        // joint 2 goes through two turns of 32 poses each: both turns are in the same intervals
        let row = |k: u8| Row {
            state: State::at(&[0.0, f64::from(k) * TAU / 32.0, 0.0, 0.0, 0.0, 0.0]),
            measured: Measured::Touch { ball: 0, reading: [0.0; 3] },
            seq: None,
            line: usize::from(k) + 2,
        };
        let recording =
            Recording { name: "r".into(), joints: 6, rows: (0..64).map(row).collect(), ..Recording::default() };
        let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
        let angles = Folds::of(&data).by_angle(&data, 1);
        assert_eq!(angles.blocks(), 16);
        for pose in 0..32 {
            assert_eq!(angles.block_of(pose), angles.block_of(pose + 32), "{pose}");
            assert_eq!(angles.block_of(pose), pose / 2, "{pose}");
        }
    }

    #[test]
    fn every_pose_is_scored_once() {
        let folds = folds(&random(101, 4));
        for splits in [folds.by_pose(4), folds.by_block(4)] {
            for pose in 0..101 {
                assert_eq!(splits.iter().filter(|s| s(pose)).count(), 1);
            }
        }
        let last = folds.forward(25).map(|s| (0..101).filter(|p| s(*p)).collect::<Vec<_>>());
        assert_eq!(last, Some((76..101).collect()));
    }
}
