//! What the hand that holds the probe feels, between two ticks of the tissue as well.

use super::shape::ProbePose;
use serde::{Deserialize, Serialize};

/// Force of the tissue on the probe along x, y, z, N, and its torque about the tip, N m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench(pub [f64; 6]);

impl Wrench {
    /// The force, N.
    pub fn force_n(&self) -> [f64; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    /// The torque about the tip, N m.
    pub fn torque_nm(&self) -> [f64; 3] {
        [self.0[3], self.0[4], self.0[5]]
    }
}

/// The answer of the tissue to a pose, and how it goes on beside it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeResponse {
    /// The pose that was answered.
    pub pose: ProbePose,
    /// There.
    pub wrench: Wrench,
    /// How the wrench changes with the motion of the probe, as [`ProbePose::motion_to`] has it; row after row. No row has energy to give: it is
    /// symmetric and nowhere positive.
    pub stiffness: [[f64; 6]; 6],
    /// Pads that are pressed.
    pub contacts: u32,
}

impl ProbeResponse {
    /// A probe that touches nothing.
    pub fn nothing(pose: ProbePose) -> Self {
        ProbeResponse {
            pose,
            wrench: Wrench::default(),
            stiffness: [[0.0; 6]; 6],
            contacts: 0,
        }
    }

    /// The wrench at a pose close to that of the answer. The force does not turn round: a probe that is lifted faster than
    /// the next answer comes feels nothing, not a pull.
    pub fn wrench_at(&self, pose: &ProbePose) -> Wrench {
        let motion = self.pose.motion_to(pose);
        let mut wrench = self.wrench;
        for (value, row) in wrench.0.iter_mut().zip(&self.stiffness) {
            *value += row.iter().zip(motion).map(|(k, m)| k * m).sum::<f64>();
        }
        let along: f64 = (0..3).map(|c| wrench.0[c] * self.wrench.0[c]).sum();
        // What is no number does not press either.
        if along > 0.0 { wrench } else { Wrench::default() }
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
