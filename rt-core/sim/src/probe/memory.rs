//! State that a probe leaves from one tick to the next, for flight recordings; the rest follows from it.

use super::body::BodyProbe;
use super::shape::ProbePose;
use serde::{Deserialize, Serialize};

/// Everything that one tick of the probe leaves to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProbeMemory {
    /// Set while there is a probe.
    pub is_there: bool,
    /// Edge of the elements that it was solved for in, m.
    pub edge_m: f64,
    /// Pose of the last tick.
    pub(super) pose: Option<ProbePose>,
    /// Force on each point of the wall, N, and its direction.
    pub(super) pressed: Vec<(f64, [f64; 3])>,
    /// Loads that the body's displacement was made from, and those that the next is made from, N.
    pub(super) shared_n: Vec<f64>,
    pub(super) coming_n: Vec<f64>,
    /// Parts of the next that are made.
    pub(super) made: u64,
}

impl ProbeMemory {
    /// Makes room for the memory of a probe; it is empty.
    pub fn with_room(probe: &BodyProbe) -> Self {
        let mut memory = ProbeMemory::default();
        let rows = probe.ready().rows();
        memory.pressed = vec![(0.0, [0.0; 3]); probe.ready().wall.points.len()];
        (memory.shared_n, memory.coming_n) = (vec![0.0; rows], vec![0.0; rows]);
        memory
    }

    /// Removes the probe; keeps its room.
    pub fn clear(&mut self) {
        self.is_there = false;
    }
}
