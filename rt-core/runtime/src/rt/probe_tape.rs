//! What the tissue loop writes of the probe to its flight recording: where the second hand had it in each tick, and what it did to the hand.

use crate::rt::recorder::Last;
use crate::rt::tissue_tape::TAPE_TICKS;
use serde::{Deserialize, Serialize};
use stylet_sim::probe::{BodyProbe, ProbeMemory, ProbePose};

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeEntry {
    /// Where it was.
    pub pose: ProbePose,
    /// Force and torque of the tissue on it.
    pub wrench: [f64; 6],
}

/// Room for one probe, made with it.
pub struct ProbeTape {
    /// Each with the number of its tick.
    pub entries: Last<(u64, ProbeEntry)>,
    /// For both checkpoints and the end.
    pub memories: [ProbeMemory; 3],
}

impl ProbeTape {
    /// Blank, for that probe.
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
