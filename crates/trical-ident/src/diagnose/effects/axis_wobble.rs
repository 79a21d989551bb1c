//! Bearing run-out: the axis tilts as the joint turns, once or twice a turn.

use trical_model::{Axis, Basis, Shape, Site, Variable};

use super::{Asked, Effect, Size, deg, joint_site};
use crate::diagnose::recorded::Recorded;

pub const EFFECT: Effect = Effect {
    name: "axis_wobble",
    site: "joint",
    form: "bearing run-out: the axis tilts about x and y with sin(n q_j), cos(n q_j), n = 1, 2",
    needs: "-",
    typical: "0.003 to 0.03 deg",
    rivals: "joint_harmonic, axis_twist, geometry",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    let mut out = Vec::new();
    for joint in r.joints() {
        for k in 1..=2_u8 {
            let cycles = f64::from(k);
            let q = Variable::Joint { joint };
            let mut parts = Vec::new();
            for axis in [Axis::X, Axis::Y] {
                let at = Site::Tilt { joint, axis };
                let a = axis.name();
                parts.push((format!("wobble_{a}_sine_{k}_{joint}"), at, Basis::new(q, Shape::Sine { cycles }), 0));
                parts.push((format!("wobble_{a}_cosine_{k}_{joint}"), at, Basis::new(q, Shape::Cosine { cycles }), 0));
            }
            out.push(EFFECT.candidate(
                joint_site(joint),
                format!("axis {joint} tilts {k} time{} a turn", if k == 1 { "" } else { "s" }),
                Size { typical: deg(0.01), large: deg(0.03) },
                parts,
            ));
        }
    }
    out.into()
}
