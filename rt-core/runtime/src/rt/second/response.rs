//! The tissue loop's response to the second device: the contact near one pose, for a loop faster than the tissue.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use stylet_hw::Wrench;

/// Largest distance from the solved pose at which the contact is extrapolated, m: 1 m/s for one tissue tick.
const FARTHEST_M: f64 = 5e-3;
/// Largest rotation, likewise.
const FARTHEST_RAD: f64 = 0.2;

/// A contact and its derivative at one pose, once in each tissue tick.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct ProbeResponse {
    /// When the tissue tick began, `CLOCK_MONOTONIC`, ns.
    pub time_ns: u64,
    /// Tissue ticks made so far.
    pub tick: u64,
    /// Edge of the elements that the contact was solved in, µm; 0 without a probe in the body.
    pub edge_um: u32,
    /// The held tool touches tissue.
    pub touches: bool,
    /// The step has not converged, and the hand would feel it.
    pub unsolved: bool,
    /// Tip of the solved pose, scene frame, m.
    pub tip_in_scene: Vector3<f64>,
    /// Its orientation.
    pub world_from_tool: UnitQuaternion<f64>,
    /// Force and torque about the tip on the hand at that pose.
    pub wrench: Wrench,
    /// Decrease of the wrench (force, then torque) with a motion of the tip (m, then rotation about the scene's axes,
    /// rad).
    pub stiffness: SMatrix<f64, 6, 6>,
}

/// The contact extrapolated to another pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Felt {
    /// Wrench on the hand.
    pub wrench: Wrench,
    /// Energy in the springs of the contact.
    pub stored_j: f64,
}

impl ProbeResponse {
    /// Extrapolates to the device's pose. The contact pushes and never pulls, and is no stiffer than the device can
    /// render.
    pub fn at(&self, tip: &Vector3<f64>, world_from_tool: &UnitQuaternion<f64>, max_stiffness_n_per_m: f64) -> Felt {
        if !self.touches {
            return Felt::default();
        }
        let moved_m = no_longer(tip - self.tip_in_scene, FARTHEST_M);
        let turned_rad = no_longer(
            (world_from_tool * self.world_from_tool.inverse()).scaled_axis(),
            FARTHEST_RAD,
        );
        let motion = SVector::<f64, 6>::from_iterator(moved_m.iter().chain(turned_rad.iter()).copied());
        let along = self.stiffness.fixed_view::<3, 3>(0, 0);
        let size = along.norm();
        let share = if size > max_stiffness_n_per_m {
            max_stiffness_n_per_m / size
        } else {
            1.0
        };
        let fall = self.stiffness * motion * share;
        let force_n = self.wrench.force_n - fall.fixed_rows::<3>(0);
        let torque_nm = self.wrench.torque_nm - fall.fixed_rows::<3>(3);
        let Some(outward) = self.wrench.force_n.try_normalize(1e-9) else {
            return Felt::default();
        };
        // Values that are not numbers reach the gate, which turns the force off.
        if force_n.dot(&outward) <= 0.0 {
            return Felt::default();
        }
        Felt {
            stored_j: stored_j(&(along * share), &outward, &force_n),
            wrench: Wrench { force_n, torque_nm },
        }
    }
}

/// Energy of a spring as stiff as the contact along its force.
fn stored_j(stiffness: &Matrix3<f64>, outward: &Vector3<f64>, force_n: &Vector3<f64>) -> f64 {
    let along = outward.dot(&(stiffness * outward));
    if along > 0.0 {
        force_n.norm_squared() / (2.0 * along)
    } else {
        0.0
    }
}

fn no_longer(v: Vector3<f64>, limit: f64) -> Vector3<f64> {
    let size = v.norm();
    if size > limit { v * (limit / size) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 N upwards, 400 N/m in every direction.
    fn pressed() -> ProbeResponse {
        let mut stiffness = SMatrix::zeros();
        for axis in 0..3 {
            stiffness[(axis, axis)] = 400.0;
            stiffness[(axis + 3, axis + 3)] = 0.5;
        }
        ProbeResponse {
            touches: true,
            wrench: Wrench::from_force(Vector3::y() * 2.0),
            stiffness,
            ..ProbeResponse::default()
        }
    }

    fn force(at: &ProbeResponse, tip: Vector3<f64>, most: f64) -> Vector3<f64> {
        at.at(&tip, &UnitQuaternion::identity(), most).wrench.force_n
    }

    #[test]
    fn the_contact_pushes_as_its_springs_say_and_never_pulls() {
        let pressed = pressed();
        let deeper = force(&pressed, Vector3::new(0.0, -1e-3, 0.0), 1e4);
        assert!((deeper - Vector3::new(0.0, 2.4, 0.0)).norm() < 1e-12, "{deeper}");
        for out_m in [5e-3, 6e-3, 0.1] {
            assert_eq!(force(&pressed, Vector3::new(0.0, out_m, 0.0), 1e4), Vector3::zeros());
        }
        // Before anything presses, there is no direction for the contact to push in.
        let begun = ProbeResponse {
            wrench: Wrench::zero(),
            ..pressed
        };
        assert_eq!(force(&begun, Vector3::new(0.0, -1e-3, 0.0), 1e4), Vector3::zeros());
        let apart = ProbeResponse {
            touches: false,
            ..pressed
        };
        assert_eq!(
            apart.at(&Vector3::zeros(), &UnitQuaternion::identity(), 1e4),
            Felt::default()
        );
    }

    #[test]
    fn it_is_carried_on_no_farther_and_no_stiffer_than_it_may_be() {
        let pressed = pressed();
        let far = force(&pressed, Vector3::new(0.0, -1.0, 0.0), 1e4);
        assert!((far.y - (2.0 + 400.0 * FARTHEST_M)).abs() < 1e-9, "{far}");
        // The norm of three springs of 400 N/m is 692.8 N/m.
        let soft = force(&pressed, Vector3::new(0.0, -1e-3, 0.0), 346.4);
        assert!((soft.y - 2.2).abs() < 1e-4, "{soft}");
        let stored = pressed.at(&Vector3::zeros(), &UnitQuaternion::identity(), 1e4).stored_j;
        assert!((stored - 0.5 * 2.0 * 2.0 / 400.0).abs() < 1e-12, "{stored}");
    }

    #[test]
    fn a_turn_is_answered_by_a_torque() {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.1);
        let felt = pressed().at(&Vector3::zeros(), &turned, 1e4);
        assert!((felt.wrench.torque_nm - Vector3::new(-0.05, 0.0, 0.0)).norm() < 1e-12);
    }
}
