//! Which effect: the one list from which the identifiers, their names, the modules of `effects` and the catalogue come.
//!
//! A new effect is one line here and the file `effects/<name>.rs` that the line names.

use std::fmt;

use serde::{Serialize, Serializer};

/// Calls a macro with every effect: the name (of its file, and in model files and reports: fixed) and the identifier. The order is
/// that of `trical effects`.
macro_rules! for_each_effect {
    ($macro:ident) => {
        $macro! {
            lost_motion_direction LostMotionDirection,
            lost_motion_gravity LostMotionGravity,
            load_friction LoadFriction,
            joint_harmonic JointHarmonic,
            gear_ripple GearRipple,
            encoder_error EncoderError,
            gear_ratio GearRatio,
            joint_coupling JointCoupling,
            nonlinear_stiffness NonlinearStiffness,
            cross_axis_compliance CrossAxisCompliance,
            axis_twist AxisTwist,
            axis_wobble AxisWobble,
            rail_error RailError,
            gravity_direction GravityDirection,
            payload Payload,
            thermal_growth ThermalGrowth,
            thermal_zero_drift ThermalZeroDrift,
            joint_zero_shift JointZeroShift,
            fixture_shift FixtureShift,
            fixture_drift FixtureDrift,
            tool_shift ToolShift,
            tool_drift ToolDrift,
            frame_drift FrameDrift,
            ball_position BallPosition,
            indicator_gain IndicatorGain,
            indicator_skew IndicatorSkew,
            indicator_drift IndicatorDrift,
            late_joint_reading LateJointReading,
        }
    };
}
pub(crate) use for_each_effect;

macro_rules! declare_ids {
    ($($name:ident $id:ident,)+) => {
        /// An effect of the catalogue. Serialized and displayed as its name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum EffectId {
            $(#[doc = concat!("`", stringify!($name), "`")] $id,)+
        }

        impl EffectId {
            /// All of them, in the order of the catalogue.
            pub const ALL: [Self; [$(stringify!($name)),+].len()] = [$(Self::$id),+];

            /// Its name: fixed, since model files and reports have it.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$id => stringify!($name),)+
                }
            }
        }
    };
}
for_each_effect!(declare_ids);

impl EffectId {
    /// The effect of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|id| id.name() == name)
    }
}

impl fmt::Display for EffectId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for EffectId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// What a candidate blames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Cause {
    /// An effect of the catalogue.
    Effect(EffectId),
    /// Something at a place that has no name.
    Unexplained,
    /// The noise of an indicator that was nulled at every touch.
    ReadingNoise,
    /// The noise of read joints.
    JointReadingNoise,
}

impl Cause {
    /// The effect, if it has a name.
    #[must_use]
    pub fn effect(self) -> Option<EffectId> {
        match self {
            Self::Effect(id) => Some(id),
            _ => None,
        }
    }

    /// As terms of a model have it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Effect(id) => id.name(),
            Self::Unexplained => UNEXPLAINED,
            Self::ReadingNoise => "reading_noise",
            Self::JointReadingNoise => "joint_reading_noise",
        }
    }
}

/// What terms without a name have for the name of their effect.
pub const UNEXPLAINED: &str = "unexplained";

impl From<EffectId> for Cause {
    fn from(id: EffectId) -> Self {
        Self::Effect(id)
    }
}
