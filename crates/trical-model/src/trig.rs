//! Sine and cosine together, without branches, so that several are computed at once: the kernels of fdlibm (Sun Microsystems
//! 1993) after a reduction by quarter turns in two parts. As accurate as the C library's (below 1 ulp, and 1e-26 absolute
//! where the result is near 0), and the same bits on every machine.

use std::f64::consts::FRAC_2_PI;

use pulp::{Arch, NullaryFnOnce};

/// Beyond this (rad) quarter turns are counted by `libm`.
const FAR: f64 = 1e5;

/// The first 33 bits of a quarter turn, and the rest.
const QUARTER: (f64, f64) = (1.570_796_326_734_125_6, 6.077_100_506_506_192e-11);

/// Added and taken away, leaves a whole number.
const WHOLE: f64 = 6_755_399_441_055_744.0;

const SINE: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];

const COSINE: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Of an angle below [`FAR`].
#[inline(always)]
fn near(x: f64) -> (f64, f64) {
    let counted = x * FRAC_2_PI + WHOLE;
    let quarters = counted - WHOLE;
    let coarse = x - quarters * QUARTER.0;
    let fine = quarters * QUARTER.1;
    // what is left, and its rounding
    let y = coarse - fine;
    let rest = (coarse - y) - fine;
    let z = y * y;
    let v = z * y;
    let [s1, s2, s3, s4, s5, s6] = SINE;
    let r = s2 + z * (s3 + z * (s4 + z * (s5 + z * s6)));
    let sine = y - ((z * (0.5 * rest - v * r) - rest) - v * s1);
    let [c1, c2, c3, c4, c5, c6] = COSINE;
    let r = z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * (c5 + z * c6)))));
    let half = 0.5 * z;
    let w = 1.0 - half;
    let cosine = w + (((1.0 - w) - half) + (z * r - y * rest));
    // the last bits of the sum count quarter turns
    let bits = counted.to_bits();
    let swap = (bits & 1).wrapping_neg();
    let (s, c) = (sine.to_bits(), cosine.to_bits());
    let (s, c) = ((s & !swap) | (c & swap), (c & !swap) | (s & swap));
    (f64::from_bits(s ^ ((bits & 2) << 62)), f64::from_bits(c ^ ((bits.wrapping_add(1) & 2) << 62)))
}

/// Sine and cosine of an angle, rad.
#[inline]
#[must_use]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if x.abs() < FAR { near(x) } else { libm::sincos(x) }
}

/// Sine of an angle, rad.
#[inline]
#[must_use]
pub fn sin(x: f64) -> f64 {
    sin_cos(x).0
}

/// Cosine of an angle, rad.
#[inline]
#[must_use]
pub fn cos(x: f64) -> f64 {
    sin_cos(x).1
}

/// Of several angles, side by side, by the widest vectors that the processor has: each step is the same for any width, and so are the bits.
#[inline]
pub(crate) fn all_sin_cos(x: &[f64], turns: &mut [(f64, f64)]) {
    Arch::new().dispatch(Near { x, turns });
    if !x.iter().all(|x| x.abs() < FAR) {
        for (x, turn) in x.iter().zip(turns) {
            *turn = sin_cos(*x);
        }
    }
}

struct Near<'a> {
    x: &'a [f64],
    turns: &'a mut [(f64, f64)],
}

impl NullaryFnOnce for Near<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (x, turn) in self.x.iter().zip(self.turns) {
            *turn = near(*x);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    // the one of windows-gnu asks the processor, and is off by thousands of last places
    #[cfg(not(all(windows, target_env = "gnu")))]
    #[test]
    fn agrees_with_the_c_library_to_the_last_place() {
        // units in the last place, at least those of 1e-10
        let ulp = |x: f64, y: f64| (x - y).abs() / (y.abs().max(1e-10) * f64::EPSILON);
        let (mut x, mut k) = (0.0_f64, 0_u64);
        let mut worst = 0.0_f64;
        while x < 1.2e5 {
            for x in [x, -x] {
                let (s, c) = sin_cos(x);
                let (cs, cc) = x.sin_cos();
                worst = worst.max(ulp(s, cs)).max(ulp(c, cc));
            }
            k += 1;
            // dense about 0, then ever wider, never on a pattern
            x += 1e-5 + x * 1.7e-4 * (f64::from(u32::try_from(k % 97).unwrap()) / 97.0);
        }
        assert!(k > 50_000, "{k}");
        assert!(worst <= 1.0, "{worst}");
    }

    #[test]
    fn quarter_turns_and_what_is_no_angle() {
        for k in -4000..4000_i32 {
            let x = f64::from(k) * std::f64::consts::FRAC_PI_2;
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs() < 1e-16 && (c - x.cos()).abs() < 1e-16, "{k}: {s} {c}");
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert!(sin_cos(-0.0).0.is_sign_negative());
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
        // any number of them side by side has the bits of each alone
        for n in 0..12 {
            let near: Vec<f64> = (0..n).map(|k| f64::from(k) * 7.3 - 31.0).collect();
            let mut turns = vec![(0.0, 0.0); near.len()];
            all_sin_cos(&near, &mut turns);
            assert!(near.iter().zip(&turns).all(|(x, turn)| *turn == sin_cos(*x)), "{turns:?}");
        }
        let far = [0.3, 2e5, f64::NAN, -1.0];
        let mut turns = [(0.0, 0.0); 4];
        all_sin_cos(&far, &mut turns);
        for k in [0, 1, 3] {
            assert_eq!(turns[k], sin_cos(far[k]));
        }
        assert!(turns[2].0.is_nan());
    }
}
