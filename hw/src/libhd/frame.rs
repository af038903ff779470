//! Torques of the gimbal joints that produce a torque in space.

use nalgebra::{UnitQuaternion, Vector3};

/// Returns the torques of the gimbal joints (turn, lift, roll; N m) that add up to `torque_nm` in
/// the device's frame.
///
/// Each joint gives the part of the torque that lies along its axis, so that the power at the
/// joints equals the power in space. The joints turn about -y, -x and -z of the frames they carry,
/// as the driver counts their angles: right, down and clockwise are positive. The sign of the
/// torques follows the angles by inference; the vendor does not state it.
pub fn gimbal_torque_nm(
    torque_nm: &Vector3<f64>,
    device_from_stylus: &UnitQuaternion<f64>,
    [_, lift_rad, roll_rad]: [f64; 3],
) -> [f64; 3] {
    let before_roll = device_from_stylus * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_rad);
    let before_lift = before_roll * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lift_rad);
    let turn = -(before_lift * Vector3::y());
    let lift = -(before_roll * Vector3::x());
    let roll = -(device_from_stylus * Vector3::z());
    [turn.dot(torque_nm), lift.dot(torque_nm), roll.dot(torque_nm)]
}

/// Returns the same direction, with no joint over its limit.
pub fn within_joint_limits(torque_nm: [f64; 3], limits_nm: &[f64; 3]) -> [f64; 3] {
    let excess = torque_nm
        .iter()
        .zip(limits_nm)
        .map(|(torque, limit)| torque.abs() / limit)
        .fold(1.0, f64::max);
    torque_nm.map(|torque| torque / excess)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis_turn(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(axis * angle)
    }

    /// Returns the forward kinematics of the gimbal on a forearm of any orientation.
    fn stylus(forearm: &UnitQuaternion<f64>, [turn, lift, roll]: [f64; 3]) -> UnitQuaternion<f64> {
        forearm * axis_turn(-Vector3::y(), turn) * axis_turn(-Vector3::x(), lift) * axis_turn(-Vector3::z(), roll)
    }

    #[test]
    fn joint_torques_do_the_work_of_the_torque_in_space() {
        let forearm = UnitQuaternion::from_euler_angles(0.2, -0.4, 0.9);
        let (angles, torque) = ([0.3, -0.6, 1.1], Vector3::new(0.05, -0.08, 0.02));
        let device_from_stylus = stylus(&forearm, angles);
        let joints = gimbal_torque_nm(&torque, &device_from_stylus, angles);
        for joint in 0..3 {
            let mut moved = angles;
            moved[joint] += 1e-6;
            let turned = (stylus(&forearm, moved) * device_from_stylus.inverse()).scaled_axis();
            let work_in_space = torque.dot(&turned) / 1e-6;
            assert!((joints[joint] - work_in_space).abs() < 1e-7, "joint {joint}");
        }
    }

    #[test]
    fn joint_limits_keep_the_direction() {
        let limited = within_joint_limits([0.4, 0.1, 0.0], &[0.2, 0.2, 0.05]);
        assert!((limited[0] - 0.2).abs() < 1e-12 && (limited[1] - 0.05).abs() < 1e-12 && limited[2] == 0.0);
        assert_eq!(
            within_joint_limits([0.1, 0.1, 0.01], &[0.2, 0.2, 0.05]),
            [0.1, 0.1, 0.01]
        );
    }
}
