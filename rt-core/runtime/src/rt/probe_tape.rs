//! The probe in the tissue loop's flight recording: its pose in each tick, and its force on the hand.

use crate::rt::recorder::Last;
use crate::rt::tissue_tape::TAPE_TICKS;
use serde::{Deserialize, Serialize};
use stylet_sim::probe::{BodyProbe, ProbeMemory, ProbePose};

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeEntry {
    /// Pose of the probe.
    pub pose: ProbePose,
    /// Force and torque of the tissue on it.
    pub wrench: [f64; 6],
}

/// Room for one probe, allocated with it.
pub struct ProbeTape {
    /// Entries, each with the number of its tick.
    pub entries: Last<(u64, ProbeEntry)>,
    /// State at both checkpoints and at the end.
    pub memories: [ProbeMemory; 3],
}

impl ProbeTape {
    /// Returns a blank tape for that probe.
    pub fn new(probe: &BodyProbe) -> Box<Self> {
        let pose = ProbePose {
            tip_m: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
        };
        let blank = ProbeEntry { pose, wrench: [0.0; 6] };
        Box::new(Self {
            entries: Last::new(&(0, blank), TAPE_TICKS),
            memories: std::array::from_fn(|_| ProbeMemory::with_room(probe)),
        })
    }
}
