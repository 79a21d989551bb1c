//! What is measured at one pose, and how its motion becomes a change of the residual.

use nalgebra::{Matrix3, Vector3};

type V3 = Vector3<f64>;

/// The measured quantity's geometry at one pose, from which derivatives are taken.
pub(crate) struct Target {
    /// The measured point in {w}.
    pub point: V3,
    pub map: Map,
}

/// How a velocity of the measured point (and of the tool) becomes a change of the residual.
pub(crate) enum Map {
    World,
    Frame(Matrix3<f64>),
    Length(V3),
    Pose {
        frame: Matrix3<f64>,
        rotation: Matrix3<f64>,
    },
    /// Velocity and angular velocity in {w} as they are.
    Twist,
}

impl Map {
    #[inline]
    pub fn apply(&self, dp: &V3, dw: &V3) -> [f64; 6] {
        match self {
            Self::World => [dp.x, dp.y, dp.z, 0.0, 0.0, 0.0],
            Self::Twist => [dp.x, dp.y, dp.z, dw.x, dw.y, dw.z],
            Self::Frame(r) => {
                let v = r * dp;
                [v.x, v.y, v.z, 0.0, 0.0, 0.0]
            }
            Self::Length(u) => [u.dot(dp), 0.0, 0.0, 0.0, 0.0, 0.0],
            Self::Pose { frame, rotation } => {
                let (v, w) = (frame * dp, rotation * dw);
                [v.x, v.y, v.z, w.x, w.y, w.z]
            }
        }
    }

    /// A change of the residual given in the measuring frame itself.
    #[inline]
    pub fn in_frame(&self, dp: &V3, dw_world_of_frame: &V3) -> [f64; 6] {
        match self {
            Self::World | Self::Length(_) | Self::Twist => [0.0; 6],
            Self::Frame(_) => [dp.x, dp.y, dp.z, 0.0, 0.0, 0.0],
            Self::Pose { frame, rotation } => {
                let w = rotation * (frame.transpose() * dw_world_of_frame);
                [dp.x, dp.y, dp.z, w.x, w.y, w.z]
            }
        }
    }
}

/// Sums over gravity moments of `elastic (x) turn` and `elastic (x) carry` (see [`crate::chain::Moment`]): columns to x, y, z.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Through {
    /// Of moments about joints behind: they turn with what moves.
    pub turn: [[f64; 6]; 3],
    /// Of moments about joints before: what moves is a load to them.
    pub carry: [[f64; 6]; 3],
}
