//! The coefficients of a finding, in words.

use trical_diagnose::{Coefficient, verdict};
use trical_model::{Site, Term};

use crate::table;

/// The coefficients of a finding in words with their standard deviations; of the sine and the cosine of a wave, the amplitude. Waves that may
/// as well not be there are counted.
pub(super) fn coefficients(all: &[Coefficient], terms: &[Term]) -> Vec<String> {
    let wave = |name: &str| {
        let term = terms.iter().find(|t| t.name == name)?;
        Some((term.site, term.basis.of, term.basis.shape.cycles()?))
    };
    let mut rest = all;
    let (mut told, mut lost) = (Vec::new(), 0);
    while let [a, after @ ..] = rest {
        rest = after;
        told.push(match (wave(&a.name), after) {
            (Some(w), [b, after @ ..]) if wave(&b.name) == Some(w) => {
                rest = after;
                let (size, sd) = amplitude([a.value, b.value], [a.sd, b.sd]);
                if sd.is_some_and(|sd| size < sd) {
                    lost += 1;
                    continue;
                }
                // as the spectrum has it
                let (factor, unit) = if a.unit == "deg" { (1e3, "mdeg") } else { (1.0, a.unit.as_str()) };
                let mut name = format!("amplitude at {} cycle{} a turn", w.2, if w.2 == 1.0 { "" } else { "s" });
                if !matches!(w.0, Site::Joint { .. }) {
                    name += &format!(" ({})", of_wave(&a.name));
                }
                table::estimate(&name, factor * size, sd.map(|sd| factor * sd), unit)
            }
            _ if all.len() == 1 => {
                let name = verdict::coefficient(&a.name);
                let twice = if name.starts_with("half") { ", the whole is twice that" } else { "" };
                table::estimate(&name, a.value, a.sd, &a.unit) + twice
            }
            _ => table::estimate(&verdict::coefficient(&a.name), a.value, a.sd, &a.unit),
        });
    }
    told.extend((lost > 0).then(|| {
        let their = if lost == 1 { "its standard deviation" } else { "their standard deviations" };
        format!("{} smaller than {their}", table::counted(lost, "more wave"))
    }));
    told
}

/// What a wave is of, in words: of "wobble_foot_x_sine_1_3" a tilt about x at the axis's foot.
fn of_wave(name: &str) -> String {
    let of = name.split("_sine").next().unwrap_or_default();
    match (of.strip_prefix("wobble_foot_"), of.strip_prefix("wobble_")) {
        (Some(axis), _) => format!("tilt about {axis}, at the foot of the axis"),
        (_, Some(axis)) => format!("tilt about {axis}"),
        _ => of.replace('_', " "),
    }
}

/// Size of a wave from its sine and cosine, with its standard deviation.
fn amplitude([sine, cosine]: [f64; 2], [s, c]: [Option<f64>; 2]) -> (f64, Option<f64>) {
    let size = sine.hypot(cosine);
    (size, s.zip(c).map(|(s, c)| (sine * s).hypot(cosine * c) / size.max(f64::MIN_POSITIVE)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use trical_model::{Basis, Shape, Variable};

    use super::*;

    #[test]
    fn a_wave_says_what_it_is_of() {
        let said = ["wobble_foot_x_sine_2_3", "wobble_y_sine_1_3", "rail_z_sine_1_1"].map(of_wave);
        assert_eq!(said, ["tilt about x, at the foot of the axis", "tilt about y", "rail z"]);
    }

    #[test]
    fn waves_within_their_standard_deviation_are_counted_and_not_named() {
        let wave = |name: &str, shape| {
            let basis = Basis::new(Variable::Joint { joint: 2 }, shape);
            Term::new(name, "gear_ripple", Site::Joint { joint: 2 }, basis)
        };
        let (mut terms, mut all) = (Vec::new(), Vec::new());
        for (cycles, size) in [(80.0, 0.004), (160.0, 0.0005), (240.0, 0.0009)] {
            for (name, shape, value) in [("s", Shape::Sine { cycles }, size), ("c", Shape::Cosine { cycles }, 0.0)] {
                let name = format!("{name}_{cycles}");
                terms.push(wave(&name, shape));
                all.push(Coefficient { name, value, unit: "deg".into(), sd: Some(0.001), cycles: None });
            }
        }
        let told = coefficients(&all, &terms);
        assert_eq!(told[1..], ["2 more waves smaller than their standard deviations"]);
        assert!(told[0].starts_with("amplitude at 80 cycles a turn = 4"), "{told:?}");
        assert_eq!(coefficients(&all[..4], &terms)[1], "1 more wave smaller than its standard deviation");
    }

    #[test]
    fn the_size_of_a_wave_does_not_depend_on_its_phase() {
        for k in 0..6 {
            let (s, c) = (0.7 * f64::from(k)).sin_cos();
            let (size, sd) = amplitude([0.02 * s, 0.02 * c], [Some(1e-3), Some(1e-3)]);
            assert!((size - 0.02).abs() < 1e-12 && (sd.unwrap() - 1e-3).abs() < 1e-12);
        }
        assert_eq!(amplitude([3.0, 4.0], [None, Some(1.0)]), (5.0, None));
    }
}
