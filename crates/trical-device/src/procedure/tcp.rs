//! The tool centre point from one ball touched in several orientations, and the first world frame from three balls.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use thiserror::Error;
use trical_model::Pose;

/// A touch with the pose of the flange that the nominal model gives for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlangeTouch {
    /// Flange in the base frame.
    pub base_from_flange: Pose,
    /// The ball's centre relative to the TCP, in the axes of the flange, m.
    pub reading: Vector3<f64>,
}

/// Why no TCP or frame could be found.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TcpError {
    /// Too few touches.
    #[error("{found} touches of the ball; expected four or more in different orientations")]
    TooFew {
        /// Number of touches.
        found: usize,
    },
    /// The orientations do not tell the TCP from the ball.
    #[error("the touches do not fix the TCP: expected orientations that differ about at least two axes")]
    Degenerate,
    /// The three balls lie on a line.
    #[error("the three balls lie on a line; expected a triangle")]
    NoTriangle,
}

/// What the touches of one ball say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TcpFit {
    /// TCP in the flange's frame, m.
    pub tcp_in_flange: [f64; 3],
    /// Centre of the ball in the base frame, m.
    pub ball_in_base: [f64; 3],
    /// Root mean square of the distances left, m.
    pub rms: f64,
}

/// TCP and ball from touches of one ball: `p + R (tcp + r) = ball` for each, by linear least squares.
///
/// # Errors
/// Fewer than four touches, or orientations that do not differ enough.
pub fn tcp_from_touches(touches: &[FlangeTouch]) -> Result<TcpFit, TcpError> {
    if touches.len() < 4 {
        return Err(TcpError::TooFew { found: touches.len() });
    }
    let rows = 3 * touches.len();
    let mut matrix = DMatrix::zeros(rows, 6);
    let mut right = DVector::zeros(rows);
    for (at, touch) in touches.iter().enumerate() {
        let Pose { rotation, translation } = touch.base_from_flange;
        matrix.fixed_view_mut::<3, 3>(3 * at, 0).copy_from(&rotation);
        matrix.fixed_view_mut::<3, 3>(3 * at, 3).copy_from(&-Matrix3::identity());
        let known = -(translation + rotation * touch.reading);
        right.fixed_rows_mut::<3>(3 * at).copy_from(&known);
    }
    let svd = matrix.clone().svd(true, true);
    let largest = svd.singular_values.max();
    // below this ratio an error of 0.01 mm in a reading becomes more than 1 mm of the TCP
    if svd.singular_values.min() < 0.01 * largest {
        return Err(TcpError::Degenerate);
    }
    let solution = svd.solve(&right, 0.0).map_err(|_| TcpError::Degenerate)?;
    let residual = &matrix * &solution - &right;
    let part = |from: usize| [solution[from], solution[from + 1], solution[from + 2]];
    Ok(TcpFit {
        tcp_in_flange: part(0),
        ball_in_base: part(3),
        rms: (residual.norm_squared() / touches.len() as f64).sqrt(),
    })
}

/// World frame from the centres of three balls in the base frame: origin in ball 1, x to ball 2, y towards ball 3.
///
/// Gives `base_from_world`.
///
/// # Errors
/// The balls lie on a line.
pub fn base_from_balls([first, second, third]: &[Vector3<f64>; 3]) -> Result<Pose, TcpError> {
    let x = (second - first).try_normalize(1e-6).ok_or(TcpError::NoTriangle)?;
    let z = x.cross(&(third - first)).try_normalize(1e-6).ok_or(TcpError::NoTriangle)?;
    let y = z.cross(&x);
    Ok(Pose { rotation: Matrix3::from_columns(&[x, y, z]), translation: *first })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::Rotation3;

    const TCP: [f64; 3] = [0.018, -0.012, 0.118];
    const BALL: [f64; 3] = [0.4, 0.1, 0.05];

    fn touch(roll: f64, pitch: f64, yaw: f64, reading: [f64; 3]) -> FlangeTouch {
        let rotation = *Rotation3::from_euler_angles(roll, pitch, yaw).matrix();
        let reading = Vector3::from(reading);
        let translation = Vector3::from(BALL) - rotation * (Vector3::from(TCP) + reading);
        FlangeTouch { base_from_flange: Pose { rotation, translation }, reading }
    }

    #[test]
    fn four_orientations_give_the_tcp_exactly() {
        let touches = [
            touch(3.0, 0.0, 0.0, [1e-5, 0.0, 0.0]),
            touch(2.6, 0.3, 0.5, [0.0, -2e-5, 0.0]),
            touch(-2.8, -0.4, 1.5, [0.0; 3]),
            touch(2.9, 0.5, -1.0, [0.0, 0.0, 3e-5]),
        ];
        let fit = tcp_from_touches(&touches).unwrap();
        for (found, truth) in fit.tcp_in_flange.iter().chain(&fit.ball_in_base).zip(TCP.iter().chain(&BALL)) {
            assert!((found - truth).abs() < 1e-12, "{fit:?}");
        }
        assert!(fit.rms < 1e-12);
    }

    #[test]
    fn the_scatter_is_that_of_one_touch_however_many_there_are() {
        let mut touches: Vec<FlangeTouch> = [(3.0, 0.0, 0.0), (2.6, 0.3, 0.5), (-2.8, -0.4, 1.5), (2.9, 0.5, -1.0)]
            .iter()
            .map(|(roll, pitch, yaw)| touch(*roll, *pitch, *yaw, [0.0; 3]))
            .collect();
        touches[1].reading = Vector3::new(2e-5, 0.0, 0.0);
        let once = tcp_from_touches(&touches).unwrap().rms;
        let twice = tcp_from_touches(&touches.repeat(2)).unwrap().rms;
        assert!(once > 1e-6 && once < 2e-5 && (once - twice).abs() < 1e-12, "{once} {twice}");
    }

    #[test]
    fn orientations_about_one_axis_are_refused() {
        let touches: Vec<FlangeTouch> = (0..5).map(|i| touch(0.0, 0.0, 0.4 * f64::from(i), [0.0; 3])).collect();
        assert_eq!(tcp_from_touches(&touches), Err(TcpError::Degenerate));
        assert_eq!(tcp_from_touches(&touches[..3]), Err(TcpError::TooFew { found: 3 }));
    }

    #[test]
    fn the_world_frame_of_three_balls() {
        let of = |balls: [[f64; 3]; 3]| base_from_balls(&balls.map(Vector3::from));
        let Pose { rotation, translation } = of([[0.1, 0.2, 0.3], [0.1, 0.5, 0.3], [-0.2, 0.2, 0.3]]).unwrap();
        assert_eq!(translation, Vector3::new(0.1, 0.2, 0.3));
        let expected = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert!((rotation - expected).amax() < 1e-12, "{rotation:?}");
        assert_eq!(of([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), Err(TcpError::NoTriangle));
    }
}
