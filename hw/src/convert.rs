//! Conversion of encoder counts and driver units to SI and back.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Returns the counts of an encoder of this `step`, rounding half a step away from zero. Saturates.
/// Returns zero if `value` is not a number or `step` is not positive.
pub fn counts_from_si(value: f64, step: f64) -> i64 {
    if step > 0.0 { (value / step).round() as i64 } else { 0 }
}

/// Returns the value in the middle of the encoder step `counts`.
pub fn si_from_counts(counts: i64, step: f64) -> f64 {
    counts as f64 * step
}

/// Returns the nearest position that encoders of `step_m` resolve; the position itself when the
/// step is zero.
pub fn quantise(position_m: &Vector3<f64>, step_m: f64) -> Vector3<f64> {
    if step_m > 0.0 {
        position_m.map(|x| si_from_counts(counts_from_si(x, step_m), step_m))
    } else {
        *position_m
    }
}

/// Converts a driver's millimetres to metres.
pub fn metres_from_millimetres(position_mm: &Vector3<f64>) -> Vector3<f64> {
    position_mm * 1e-3
}

/// Converts newton metres to a driver's millinewton metres.
pub fn millinewton_metres_from_newton_metres(torque_nm: &Vector3<f64>) -> Vector3<f64> {
    torque_nm * 1e3
}

/// Returns position (m) and orientation of a driver's homogeneous transform: column-major, in
/// millimetres. `None` if it is not finite or its upper block is not close to a rotation.
pub fn pose_from_column_major_mm(transform: &[f64; 16]) -> Option<(Vector3<f64>, UnitQuaternion<f64>)> {
    let &[xx, xy, xz, _, yx, yy, yz, _, zx, zy, zz, _, px, py, pz, _] = transform;
    let rotation = Matrix3::new(xx, yx, zx, xy, yy, zy, xz, yz, zz);
    let orientation = orientation_from_matrix(&rotation)?;
    let tip = metres_from_millimetres(&Vector3::new(px, py, pz));
    let finite = transform.iter().all(|x| x.is_finite());
    finite.then_some((tip, orientation))
}

/// Returns the orientation of a driver's matrix; `None` if it is not close to a rotation.
pub fn orientation_from_matrix(rotation: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let defect = (rotation.transpose() * rotation - Matrix3::identity()).norm();
    // Numbers that are not finite fail the first comparison.
    let proper = defect <= 1e-3 && rotation.determinant() > 0.0;
    proper.then(|| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantised_position_is_within_half_a_step_and_on_the_grid() {
        let step = 3e-5;
        for i in -1000..1000 {
            let p = Vector3::new(f64::from(i) * 1.37e-6, 0.1, -f64::from(i) * 2.1e-5);
            let q = quantise(&p, step);
            assert!((q - p).amax() <= 0.5 * step * (1.0 + 1e-9));
            assert_eq!(quantise(&q, step), q, "a position on the grid stays where it is");
        }
    }

    #[test]
    fn counts_survive_the_round_trip() {
        for counts in [-123_456, -1, 0, 1, 7, 99_999] {
            assert_eq!(counts_from_si(si_from_counts(counts, 3e-5), 3e-5), counts);
        }
        assert_eq!(counts_from_si(f64::NAN, 3e-5), 0);
        assert_eq!(counts_from_si(1.0, 0.0), 0);
        assert_eq!(counts_from_si(f64::INFINITY, 1.0), i64::MAX);
    }

    #[test]
    fn driver_transform_is_column_major_in_millimetres() {
        let r = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
        let m = r.to_rotation_matrix();
        let mut t = [0.0; 16];
        for column in 0..3 {
            for row in 0..3 {
                t[4 * column + row] = m[(row, column)];
            }
        }
        (t[12], t[13], t[14], t[15]) = (10.0, -20.0, 30.0, 1.0);
        let (tip, q) = pose_from_column_major_mm(&t).unwrap();
        assert!((tip - Vector3::new(0.01, -0.02, 0.03)).norm() < 1e-15);
        assert!(q.angle_to(&r) < 1e-9);

        t[0] = f64::NAN;
        assert!(pose_from_column_major_mm(&t).is_none());
        assert!(
            pose_from_column_major_mm(&[0.0; 16]).is_none(),
            "an uncalibrated driver"
        );
    }
}
