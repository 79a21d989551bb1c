//! The gear ratio is not what the controller believes.

use trical_model::{Basis, Place, Shape, Site, Variable};

use super::{Asked, Effect, Size};
use crate::covariates::Recorded;

pub const EFFECT: Effect = Effect {
    name: "gear_ratio",
    site: "joint",
    form: "a wrong ratio: D = k q_j",
    needs: "-",
    typical: "1e-4 to 1e-3",
    rivals: "joint_harmonic with n = 1",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    let of = |joint| {
        let basis = Basis::new(Variable::Joint { joint }, Shape::Linear);
        EFFECT.candidate(
            Place::Joint(joint),
            format!("in proportion to joint {joint}'s angle"),
            Size { typical: 5e-4, large: 1e-3 },
            vec![(format!("ratio_{joint}"), Site::Joint { joint }, basis, 0)],
        )
    };
    r.joints().map(of).collect::<Vec<_>>().into()
}
