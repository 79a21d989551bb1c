//! Bearing and link give way across the axis: a rotation about a point of it, in proportion to the moment there. The point may be the
//! joint's origin or its foot; at joint 1 it is the foot, since base and table are what gives way.

use trical_model::{Axis, Basis, Shape, Site, Variable};

use super::{Asked, Effect, NO_MASSES, Pivot, Size, joint_site};
use crate::diagnose::recorded::Recorded;

pub const EFFECT: Effect = Effect {
    name: "cross_axis_compliance",
    site: "joint",
    form: "bearing and link give way across the axis: rotation k M_perp about the joint's origin or its foot (joint 1: base and table, its foot)",
    needs: "masses",
    typical: "1e-5 to 4e-4 rad/Nm on a small arm, less on one that carries more",
    rivals: "payload, axis_wobble; mostly absorbed by the geometry",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    if !r.masses {
        return Asked::lacking(NO_MASSES);
    }
    let of = |joint, pivot: Pivot| {
        let axis = Axis::X;
        let moment = match pivot {
            Pivot::Origin => Variable::Moment { joint, axis },
            Pivot::Foot => Variable::FootMoment { joint, axis },
        };
        EFFECT.candidate(
            joint_site(joint),
            format!("the gravity moment across axis {joint} tilts it{}", pivot.words()),
            Size { typical: 5e-5 / r.strength(), large: 4e-4 / r.strength() },
            vec![(
                format!("cross_{}{joint}", pivot.name()),
                Site::Across { joint },
                Basis::new(moment, Shape::Linear),
                1,
            )],
        )
    };
    let pivots = |joint| match Pivot::of(r, joint) {
        both if joint == 1 => &both[both.len() - 1..],
        any => any,
    };
    let all = r.joints().flat_map(|joint| pivots(joint).iter().map(move |pivot| (joint, *pivot)));
    all.map(|(joint, pivot)| of(joint, pivot)).collect::<Vec<_>>().into()
}
