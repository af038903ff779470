//! The force of the tissue on the probe, and its stiffness between two ticks of the tissue.

use super::shape::ProbePose;
use serde::{Deserialize, Serialize};

/// Force of the tissue on the probe along x, y, z, N, and its torque about the tip, N m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench(pub [f64; 6]);

impl Wrench {
    /// Returns the force, N.
    pub fn force_n(&self) -> [f64; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    /// Returns the torque about the tip, N m.
    pub fn torque_nm(&self) -> [f64; 3] {
        [self.0[3], self.0[4], self.0[5]]
    }
}

/// Answer of the tissue to a pose, with the stiffness to extrapolate it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeResponse {
    /// The pose that was answered.
    pub pose: ProbePose,
    /// Wrench at that pose.
    pub wrench: Wrench,
    /// Change of the wrench with the motion of the probe, as [`ProbePose::motion_to`] has it; row after row. It is
    /// symmetric and nowhere positive, so no motion gains energy.
    pub stiffness: [[f64; 6]; 6],
    /// Pads that are pressed.
    pub contacts: u32,
}

impl ProbeResponse {
    /// Returns the answer to a probe that touches nothing.
    pub fn nothing(pose: ProbePose) -> Self {
        ProbeResponse {
            pose,
            wrench: Wrench::default(),
            stiffness: [[0.0; 6]; 6],
            contacts: 0,
        }
    }
}

impl Default for ProbeResponse {
    fn default() -> Self {
        Self::nothing(ProbePose {
            tip_m: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
        })
    }
}
