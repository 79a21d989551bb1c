//! Friction winds the drive up, or teeth change flank with the sense of motion: the joint stops short by half a gap.

use trical_model::{Basis, Place, Site};

use super::{Asked, Effect, NO_SENSE, Size, arcsec};
use crate::covariates::Recorded;

pub const EFFECT: Effect = Effect {
    name: "lost_motion_direction",
    site: "joint",
    form: "friction wind-up, backlash: D = -(b/2) d_j",
    needs: "sense of motion",
    typical: "b 2 to 120 arcsec",
    rivals: "load_friction; invisible if every approach has one sense",
    ask,
};

fn ask(r: &Recorded<'_>) -> Asked {
    if !r.direction {
        return Asked::lacking(NO_SENSE);
    }
    let of = |joint| {
        EFFECT.candidate(
            Place::Joint(joint),
            format!("changes sign with the sense of joint {joint}'s last motion"),
            Size { typical: arcsec(15.0), large: arcsec(60.0) },
            vec![(format!("half_gap_{joint}"), Site::Joint { joint }, Basis::direction(joint), -1)],
        )
    };
    r.joints().map(of).collect::<Vec<_>>().into()
}
