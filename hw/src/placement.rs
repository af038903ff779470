//! Place of a device in the world.

use core::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Convention of a maker for the axes of a device and of its handle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Rotation from the device's frame to the world, for an operator who sits before the perineum
    /// of a patient on the back. World z (superior) points away from the operator, world y
    /// (anterior) up, world x (the patient's right) to the operator's left.
    world_from_device: Quaternion<f64>,
    /// Rotation from the tool's frame, whose z is the needle towards its tip, to the frame of the
    /// handle.
    handle_from_tool: Quaternion<f64>,
}

impl Axes {
    /// OpenHaptics: x to the operator's right, y up, z towards the operator; the stylus points along its own -z.
    pub const OPEN_HAPTICS: Self = Self {
        world_from_device: Quaternion::new(0.0, 0.0, 1.0, 0.0),
        handle_from_tool: Quaternion::new(0.0, 0.0, 1.0, 0.0),
    };
    /// Force Dimension: x towards the operator, y to the operator's right, z up; the handle points along its own -x
    /// (CHAI3D 3.3, which turns the axes of a Phantom into these and those of a Force Dimension device not at all).
    pub const FORCE_DIMENSION: Self = Self {
        world_from_device: Quaternion::new(0.5, -0.5, 0.5, 0.5),
        handle_from_tool: Quaternion::new(0.5, 0.5, -0.5, -0.5),
    };
    /// Haply: x to the operator's right, y forward, z up (docs.haply.co, "Basis Permutation"). The
    /// direction of a VerseGrip in its own frame is unpublished. Its orientation counts from the
    /// first one, which is assumed to be straight ahead.
    pub const HAPLY: Self = Self {
        world_from_device: Quaternion::new(0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2),
        handle_from_tool: Quaternion::new(0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    };
}

/// Pose of the device's frame in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Origin of the device's frame, m.
    pub origin_in_world: Vector3<f64>,
    /// Rotation from the device's frame to the world.
    pub world_from_device: UnitQuaternion<f64>,
    /// Rotation from the tool's frame, whose z is the needle, to the frame of the handle.
    pub handle_from_tool: UnitQuaternion<f64>,
}

impl Placement {
    /// Creates a placement between the operator and the patient; see [`Axes`].
    pub fn facing_patient(axes: Axes, origin_in_world: Vector3<f64>) -> Self {
        Self {
            origin_in_world,
            world_from_device: UnitQuaternion::from_quaternion(axes.world_from_device),
            handle_from_tool: UnitQuaternion::from_quaternion(axes.handle_from_tool),
        }
    }

    /// Returns tip (m) and tool in the world, from a tip and a handle in the device's frame.
    pub fn pose(
        &self,
        tip_in_device: &Vector3<f64>,
        device_from_handle: &UnitQuaternion<f64>,
    ) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let tip_in_world = self.origin_in_world + self.world_from_device * tip_in_device;
        let world_from_tool = self.world_from_device * device_from_handle * self.handle_from_tool;
        (tip_in_world, world_from_tool)
    }

    /// Rotates a force or a torque from the world into the device's frame.
    pub fn to_device(&self, vector_in_world: &Vector3<f64>) -> Vector3<f64> {
        self.world_from_device.inverse_transform_vector(vector_in_world)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the tip after moves of 1, 2 and 3 along right, up and away, and the needle at rest.
    fn moved(axes: Axes, [right, up, away]: [Vector3<f64>; 3]) -> (Vector3<f64>, Vector3<f64>) {
        let placement = Placement::facing_patient(axes, Vector3::zeros());
        let (tip, tool) = placement.pose(&(right + up * 2.0 + away * 3.0), &UnitQuaternion::identity());
        assert!((placement.to_device(&tip) - (right + up * 2.0 + away * 3.0)).norm() < 1e-12);
        (tip, tool * Vector3::z())
    }

    #[test]
    fn right_is_minus_x_up_is_y_and_away_is_z() {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let makers = [
            (Axes::OPEN_HAPTICS, [x, y, -z]),
            (Axes::FORCE_DIMENSION, [y, z, -x]),
            (Axes::HAPLY, [x, z, y]),
        ];
        for (axes, frame) in makers {
            let (tip, needle) = moved(axes, frame);
            assert!((tip - Vector3::new(-1.0, 2.0, 3.0)).norm() < 1e-12, "{axes:?}: {tip}");
            assert!((needle - z).norm() < 1e-12, "{axes:?}: {needle}");
        }
    }
}
