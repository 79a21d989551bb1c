//! Bearing run-out: the axis tilts as the joint turns, once or twice a turn.

use trical_model::{Axis, Basis, Parameter, Place, Scope, Shape, Site, Variable};

use super::effect::{Asked, Effect, Family, Pivot, Remedy, Size, WAVES, deg, turning};
use crate::candidate::{Candidate, Physical};
use crate::covariates::Covariates;
use crate::effect_id::EffectId;

pub const EFFECT: Effect = Effect {
    id: EffectId::AxisWobble,
    title: "bearing run-out",
    family: Family::Geometry,
    scope: Scope::Arm,
    site: "joint",
    form: "bearing run-out: the axis tilts about x and y, at the joint's origin or its foot, with sin(n q_j), cos(n q_j), n = 1, 2",
    needs: "-",
    typical: "0.003 to 0.03 deg",
    rivals: "joint_harmonic, axis_twist, geometry",
    coefficients: WAVES,
    action: "Let the calibrated model correct it; where it grows, have the bearing checked.",
    remedy: Remedy::WiderRange,
    follows_torque: false,
    ask,
};

fn ask(r: &Covariates<'_>) -> Asked {
    let mut out = Vec::new();
    for joint in turning(r) {
        for k in 1..=2 {
            out.extend(Pivot::of(r, joint).iter().map(|pivot| wobble(joint, k, *pivot)));
        }
    }
    out.into()
}

/// A tilt `k` times a turn.
fn wobble(joint: usize, k: u8, pivot: Pivot) -> Candidate {
    let cycles = f64::from(k);
    let q = Variable::Joint { joint };
    let mut parts = Vec::new();
    for (axis, parameter) in [(Axis::X, Parameter::Alpha), (Axis::Y, Parameter::Beta)] {
        let at = match pivot {
            Pivot::Origin => Site::Tilt { joint, axis },
            Pivot::Foot => Site::Link { link: joint - 1, parameter },
        };
        let name = |of| format!("wobble_{}{}_{of}_{k}_{joint}", pivot.name(), axis.name());
        parts.push((name("sine"), at, Basis::new(q, Shape::Sine { cycles }), 0));
        parts.push((name("cosine"), at, Basis::new(q, Shape::Cosine { cycles }), 0));
    }
    let mut candidate = EFFECT.candidate(
        Place::Joint(joint),
        format!("axis {joint} tilts{} {} a turn", pivot.words(), if k == 1 { "once" } else { "twice" }),
        Size { typical: deg(0.01), large: deg(0.03) },
        parts,
    );
    if k == 1 {
        candidate.physical = Physical::when(is_no_twist);
    }
    candidate
}

/// A tilt that turns with the joint is how the next axis stands on its link: geometry, or a twist of near-parallel axes. A tilt in
/// a plane is one half that turns with the joint and one that turns against it, of which the geometry may have taken up some of
/// the first. Coefficients: sine and cosine of the tilt about x, then about y.
fn is_no_twist(c: &[f64]) -> bool {
    let [xs, xc, ys, yc] = c else { return true };
    let with = libm::hypot(xc + ys, yc - xs);
    let against = libm::hypot(xc - ys, yc + xs);
    with <= 2.5 * against
}

#[cfg(test)]
mod tests {
    use super::is_no_twist;

    #[test]
    fn a_tilt_in_a_plane_is_a_wobble_and_one_that_turns_with_the_joint_is_not() {
        for k in 0..12 {
            let (plane, phase) = (0.5 * f64::from(k), 0.7 * f64::from(k));
            let (px, py) = (plane.cos(), plane.sin());
            let (s, c) = phase.sin_cos();
            assert!(is_no_twist(&[px * s, px * c, py * s, py * c]));
            // fixed on the link at angle plane: its x part is cos(q + plane), its y part sin(q + plane)
            assert!(!is_no_twist(&[-py, px, px, py]));
        }
    }
}
