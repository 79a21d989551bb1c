//! Bearing and link give way across the axis: a rotation about the joint's origin, in proportion to the moment there. At joint 1 it
//! is base and table.

use trical_model::{Axis, Basis, Shape, Site, Variable};

use super::{Asked, Effect, NO_MASSES, Size, joint_site};
use crate::diagnose::recorded::Recorded;

pub const EFFECT: Effect = Effect {
    name: "cross_axis_compliance",
    site: "joint",
    form: "bearing and link give way across the axis: rotation k M_perp",
    needs: "masses",
    typical: "1e-5 to 4e-4 rad/Nm",
    rivals: "payload, axis_wobble; mostly absorbed by the geometry",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let of = |joint| {
        let basis = Basis::new(Variable::Moment { joint, axis: Axis::X }, Shape::Linear);
        EFFECT.candidate(
            joint_site(joint),
            format!("the gravity moment across axis {joint} tilts it"),
            Size { typical: 5e-5, large: 4e-4 },
            vec![(format!("cross_{joint}"), Site::Across { joint }, basis, 1)],
        )
    };
    r.joints().map(of).collect::<Vec<_>>().into()
}
