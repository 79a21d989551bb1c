//! Which frequencies the error of each joint has: a score test for every whole number of cycles per turn, on the residual of
//! the fit. Only a shortlist: what it finds is tried with the exact projection like every other candidate.

use pulp::Arch;
use rayon::prelude::*;
use trical_ident::dataset::Dataset;
use trical_ident::error::Result;
use trical_ident::fit::identify::Identified;
use trical_model::{Basis, Place, Shape, Site, Term, Variable, trig};

use crate::candidate::{Candidate, Physical};
use crate::covariates::name;
use crate::effect_id::{Cause, UNEXPLAINED};
use crate::effects::ripple;
use crate::linear::{Fitted, Linear};
use crate::settings::{FINEST_CYCLES, GEAR_CYCLES, PEAKS_PER_JOINT, UNNAMED_PRICE_NATS, UNNAMED_SIZE_RAD};
use crate::specification_test::Probes;

/// A joint's apparent angle error, pose by pose: `sum c r` and `sum c^2` over the rows of a pose, with `c` the joint's column.
struct Apparent {
    q: Vec<f64>,
    push: Vec<f64>,
    weight: Vec<f64>,
}

/// Ripples of gears that the residual of a fit suggests, `PEAKS_PER_JOINT` for each joint.
///
/// # Errors
/// None for a model that was fitted.
pub fn ripples(fitted: &Identified, data: &Dataset) -> Result<Vec<Candidate>> {
    let joints = apparent(fitted, data)?;
    let (from, to) = GEAR_CYCLES;
    let peaks: Vec<Vec<f64>> = joints.par_iter().map(|a| a.peaks(from, to, PEAKS_PER_JOINT)).collect();
    Ok(peaks
        .iter()
        .enumerate()
        // what slides has no turn that a gear could repeat in
        .filter(|(k, _)| !fitted.model.robot.slides(k + 1))
        .flat_map(|(k, cycles)| cycles.iter().map(move |n| ripple(k + 1, *n, joints_of(fitted))))
        .collect())
}

fn joints_of(fitted: &Identified) -> usize {
    fitted.model.robot.dof()
}

/// Errors that repeat faster than any gear turns, the strongest of each joint: no name is known for them.
///
/// # Errors
/// None for a model that was fitted.
pub fn fast(fitted: &Identified, data: &Dataset) -> Result<Vec<Candidate>> {
    let joints = apparent(fitted, data)?;
    let peaks: Vec<Vec<f64>> = joints.par_iter().map(|a| a.peaks(GEAR_CYCLES.1 + 1, FINEST_CYCLES, 1)).collect();
    let asked = (joints.len() as f64) * f64::from(FINEST_CYCLES);
    Ok(peaks
        .iter()
        .enumerate()
        .flat_map(|(k, cycles)| cycles.iter().map(move |n| (k + 1, *n)))
        .map(|(joint, cycles)| {
            let variable = Variable::Joint { joint };
            let every = every(fitted, joint, cycles);
            let term = |part: &str, shape| {
                let name = format!("fast_{part}_{joint}");
                Term::new(name, UNEXPLAINED, Site::Joint { joint }, Basis::new(variable, shape))
            };
            Candidate {
                physical: Physical::default(),
                cause: Cause::Unexplained,
                site: Place::Joint(joint),
                behaviour: format!("joint {joint} is off in a way that repeats every {every} of {}", name(variable)),
                terms: vec![term("sine", Shape::Sine { cycles }), term("cosine", Shape::Cosine { cycles })],
                signs: vec![0; 2],
                typical: 0.0,
                scales: vec![UNNAMED_SIZE_RAD; 2],
                log_prior: -libm::log(asked) - UNNAMED_PRICE_NATS,
            }
        })
        .collect())
}

/// How far joint `joint` moves until an error of so many cycles a turn (or every 2 pi m) repeats.
fn every(fitted: &Identified, joint: usize, cycles: f64) -> String {
    let period = std::f64::consts::TAU / cycles;
    if fitted.model.robot.slides(joint) {
        format!("{:.3} mm", period * 1e3)
    } else {
        format!("{:.4} deg", period.to_degrees())
    }
}

/// Adds the errors of [`fast`] to what is asked where nothing was modelled: such an error can be so steep that no model can have it (an
/// encoder with coarse steps jumps back at each).
pub fn ask_for(waves: &[Candidate], fitted: &Identified, probes: &mut Probes) {
    for wave in waves {
        let (Place::Joint(joint), Some(cycles)) = (wave.site, wave.cycles()) else { continue };
        let q = name(Variable::Joint { joint });
        let region = format!("all of {q}, every {}", every(fitted, joint, cycles));
        probes.add_best(f64::from(FINEST_CYCLES), q, region, wave.clone());
    }
}

fn apparent(fitted: &Identified, data: &Dataset) -> Result<Vec<Apparent>> {
    let columns: Vec<Candidate> = (1..=joints_of(fitted))
        .map(|joint| Candidate {
            physical: Physical::default(),
            cause: Cause::Unexplained,
            site: Place::Joint(joint),
            behaviour: String::new(),
            terms: vec![Term::new("constant", UNEXPLAINED, Site::Joint { joint }, Basis::CONSTANT)],
            signs: vec![0],
            typical: 0.0,
            scales: vec![1.0],
            log_prior: 0.0,
        })
        .collect();
    let linear =
        Linear::new(Fitted { parameters: 0, ..Fitted::all(&fitted.model) }, &columns, &[], data, &fitted.noise)?;
    let poses = data.used_poses();
    let mut angles = vec![[0.0; trical_model::MAX_JOINTS]; poses.len()];
    for o in &data.observations {
        if let Ok(k) = poses.binary_search(&o.pose) {
            angles[k] = o.state.q;
        }
    }
    Ok((0..columns.len())
        .map(|joint| {
            let mut a = Apparent {
                q: angles.iter().map(|q| q[joint]).collect(),
                push: vec![0.0; poses.len()],
                weight: vec![0.0; poses.len()],
            };
            for (row, pose) in linear.pose_of_row.iter().enumerate() {
                if let Ok(k) = poses.binary_search(pose) {
                    let c = linear.column_at(row, joint);
                    a.push[k] += c * linear.residual[row];
                    a.weight[k] += c * c;
                }
            }
            a
        })
        .collect())
}

/// Numbers that are summed beside each other, on every machine: the sums are the same to the last bit.
const LANES: usize = 8;

/// `(sum push sin)^2 + (sum push cos)^2` for `count` frequencies, the phases turned on from one to the next. All lengths are the
/// same multiple of [`LANES`].
struct Powers {
    count: usize,
    push: Vec<f64>,
    sin: Vec<f64>,
    cos: Vec<f64>,
    turn_sin: Vec<f64>,
    turn_cos: Vec<f64>,
}

impl pulp::NullaryFnOnce for Powers {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        let Self { count, push, mut sin, mut cos, turn_sin, turn_cos } = self;
        let mut powers = Vec::with_capacity(count);
        for _ in 0..count {
            let (mut s, mut c) = ([0.0; LANES], [0.0; LANES]);
            let turns = turn_sin.chunks_exact(LANES).zip(turn_cos.chunks_exact(LANES));
            let phases = sin.chunks_exact_mut(LANES).zip(cos.chunks_exact_mut(LANES));
            for ((push, (sin, cos)), (ts, tc)) in push.chunks_exact(LANES).zip(phases).zip(turns) {
                for k in 0..LANES {
                    s[k] += push[k] * sin[k];
                    c[k] += push[k] * cos[k];
                    (sin[k], cos[k]) = (sin[k] * tc[k] + cos[k] * ts[k], cos[k] * tc[k] - sin[k] * ts[k]);
                }
            }
            powers.push(s.iter().sum::<f64>().powi(2) + c.iter().sum::<f64>().powi(2));
        }
        powers
    }
}

impl Apparent {
    /// The `most` strongest frequencies between `from` and `to` cycles per turn, strongest first; neighbours count once.
    fn peaks(&self, from: u32, to: u32, most: usize) -> Vec<f64> {
        let n = self.q.len();
        let half: f64 = 0.5 * self.weight.iter().sum::<f64>();
        if half <= 0.0 {
            return Vec::new();
        }
        let of = |values: &mut dyn Iterator<Item = f64>| {
            let mut all: Vec<f64> = values.collect();
            all.resize(n.next_multiple_of(LANES), 0.0);
            all
        };
        let q = || self.q.iter();
        let count = (to - from + 1) as usize;
        let mut power = Arch::new().dispatch(Powers {
            count,
            push: of(&mut self.push.iter().copied()),
            sin: of(&mut q().map(|q| trig::sin(f64::from(from) * q))),
            cos: of(&mut q().map(|q| trig::cos(f64::from(from) * q))),
            turn_sin: of(&mut q().map(|q| trig::sin(*q))),
            turn_cos: of(&mut q().map(|q| trig::cos(*q))),
        });
        power.iter_mut().for_each(|p| *p /= half);
        let mut order: Vec<usize> = (0..power.len()).collect();
        order.sort_by(|a, b| power[*b].total_cmp(&power[*a]).then(a.cmp(b)));
        let mut peaks: Vec<usize> = Vec::new();
        for k in order {
            if peaks.iter().all(|p| p.abs_diff(k) > 1) {
                peaks.push(k);
            }
            if peaks.len() == most {
                break;
            }
        }
        peaks.into_iter().map(|k| f64::from(from) + k as f64).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Angles of `n` poses between -2 and 2 rad, and an apparent error of these waves (cycles, amplitude, phase) there.
    fn of(n: u32, waves: &[(f64, f64, f64)]) -> Apparent {
        let q: Vec<f64> =
            (0..n).map(|k| 2.0 * (f64::from(k) * 2.399_963).sin() * (f64::from(k) * 0.37).cos()).collect();
        let error = |q: &f64| waves.iter().map(|(cycles, size, phase)| size * (cycles * q + phase).cos()).sum::<f64>();
        Apparent { push: q.iter().map(error).collect(), weight: vec![1.0; q.len()], q }
    }

    #[test]
    fn the_cycles_of_a_wave_are_found_whatever_its_phase_and_the_number_of_poses() {
        for n in [96, 97, 103] {
            for phase in [0.0, 0.8, 1.6, 3.1] {
                for cycles in [10.0, 37.0, 150.0, 300.0] {
                    assert_eq!(of(n, &[(cycles, 1e-4, phase)]).peaks(10, 300, 1), [cycles], "{n} {phase}");
                }
            }
        }
    }

    #[test]
    fn of_several_waves_the_strongest_comes_first_and_a_peak_counts_once() {
        let peaks = of(900, &[(50.0, 1e-4, 0.3), (120.0, 3e-4, 1.0), (80.0, 2e-4, 2.0)]).peaks(10, 300, 3);
        assert_eq!(peaks, [120.0, 80.0, 50.0]);
        let many = of(900, &[(50.0, 1e-4, 0.3)]).peaks(10, 300, 5);
        assert!(many.iter().enumerate().all(|(k, a)| many[..k].iter().all(|b| (a - b).abs() > 1.5)), "{many:?}");
    }

    /// A wave in one joint's angle is suggested for that joint, first of all its waves.
    #[test]
    fn the_joint_that_has_a_wave_is_the_one_for_which_it_is_suggested() {
        let mut truth = crate::test_data::arm();
        let wave = Basis::new(Variable::Joint { joint: 3 }, Shape::Sine { cycles: 37.0 });
        truth.terms.push(Term { value: 1e-3, ..Term::new("w", UNEXPLAINED, Site::Joint { joint: 3 }, wave) });
        let data = crate::test_data::touched(&truth, 240);
        let fitted =
            trical_ident::identify(&truth.robot, &truth.cell, &data, trical_ident::ParameterSet::Geometry).unwrap();
        let of = |joint| {
            ripples(&fitted, &data).unwrap().into_iter().filter(|c| c.site == Place::Joint(joint)).collect::<Vec<_>>()
        };
        assert_eq!(of(3)[0].cycles(), Some(37.0));
        assert!((1..=6).all(|joint| of(joint).len() == PEAKS_PER_JOINT));
        // its push is the largest by far: a score for every joint, at its own angle
        let strongest = apparent(&fitted, &data).unwrap().iter().map(|a| power(a, 37.0)).collect::<Vec<_>>();
        assert!((0..6).all(|k| k == 2 || strongest[k] < 0.5 * strongest[2]), "{strongest:?}");
    }

    /// The score of one number of cycles, directly.
    fn power(a: &Apparent, cycles: f64) -> f64 {
        let sum = |wave: fn(f64) -> f64| a.q.iter().zip(&a.push).map(|(q, p)| p * wave(cycles * q)).sum::<f64>();
        (sum(f64::sin).powi(2) + sum(f64::cos).powi(2)) / a.weight.iter().sum::<f64>()
    }

    #[test]
    fn a_joint_that_moves_nothing_has_no_waves() {
        let still = Apparent { weight: vec![0.0; 40], ..of(40, &[(20.0, 1e-4, 0.0)]) };
        assert!(still.peaks(10, 300, 5).is_empty());
    }
}
