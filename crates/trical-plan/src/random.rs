//! Random numbers that depend on nothing but the seed and what they are for, so that threads do not change a plan.

use nalgebra::Matrix3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_model::pose::{rotation_from_quaternion, rotation_x, rotation_y, rotation_z};
use trical_model::trig;

/// A generator for one purpose: `stream` and `index` tell it from all others of the same seed.
#[must_use]
pub fn generator(seed: u64, stream: u64, index: u64) -> Pcg64Mcg {
    // SplitMix64 of each part in turn: neighbouring numbers must not give neighbouring sequences
    let mix = |x: u64| {
        let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    };
    Pcg64Mcg::seed_from_u64(mix(mix(mix(seed) ^ stream) ^ index))
}

pub(crate) fn uniform(rng: &mut Pcg64Mcg, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Uniform over all rotations (Shoemake 1992).
pub(crate) fn any_rotation(rng: &mut Pcg64Mcg) -> Matrix3<f64> {
    let u: [f64; 3] = std::array::from_fn(|_| rng.random::<f64>());
    let (r1, r2) = ((1.0 - u[0]).sqrt(), u[0].sqrt());
    let (t1, t2) = (std::f64::consts::TAU * u[1], std::f64::consts::TAU * u[2]);
    rotation_from_quaternion([trig::cos(t2) * r2, trig::sin(t1) * r1, trig::cos(t1) * r1, trig::sin(t2) * r2])
}

/// Axes of a tool in {w} whose z axis is within `tilt` of straight down, uniform over that cap, turned about it by an angle
/// within `spin`, rad.
pub(crate) fn downward(rng: &mut Pcg64Mcg, tilt: f64, spin: [f64; 2]) -> Matrix3<f64> {
    let lean = libm::acos(uniform(rng, trig::cos(tilt), 1.0).clamp(-1.0, 1.0));
    let around = uniform(rng, -std::f64::consts::PI, std::f64::consts::PI);
    let turn = uniform(rng, spin[0], spin[1]);
    // half a turn about x points z down; the azimuth is taken back so that the spin alone says how the device is turned
    rotation_z(around) * rotation_y(lean) * rotation_z(-around) * rotation_x(std::f64::consts::PI) * rotation_z(turn)
}
