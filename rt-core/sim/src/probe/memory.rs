//! What a probe leaves from one tick to the next, for flight recordings; the rest follows from it.

use super::body::BodyProbe;
use super::shape::ProbePose;
use serde::{Deserialize, Serialize};

/// Everything that one tick of the probe leaves to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ProbeMemory {
    /// There is one.
    pub is_there: bool,
    /// Edge of the elements that it was solved for in, m.
    pub edge_m: f64,
    /// Where the last tick had it.
    pub(super) pose: Option<ProbePose>,
    /// How hard each point of the wall is pressed, N, and where to.
    pub(super) pressed: Vec<(f64, [f64; 3])>,
    /// Loads that the body's displacement was made from, and those that the next is made from, N.
    pub(super) shared_n: Vec<f64>,
    pub(super) coming_n: Vec<f64>,
    /// Parts of the next that are made.
    pub(super) made: u64,
}

impl ProbeMemory {
    /// Room for that of a probe; there is none yet.
    pub fn with_room(probe: &BodyProbe) -> Self {
        let mut memory = ProbeMemory::default();
        let rows = probe.ready().rows();
        memory.pressed = vec![(0.0, [0.0; 3]); probe.ready().wall.points.len()];
        (memory.shared_n, memory.coming_n) = (vec![0.0; rows], vec![0.0; rows]);
        memory
    }

    /// No probe; keeps its room.
    pub fn clear(&mut self) {
        self.is_there = false;
    }
}
