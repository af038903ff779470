//! Slices of shared memory loaned ahead, filled by the tissue thread, sent from here: no copy, no port in the loop.

use crate::bridge::ports::Ports;
use crate::rt::exchange::{SnapshotReturn, SnapshotSlot};
use stylet_shm_schema::service::{self, SNAPSHOTS_AHEAD};
use stylet_shm_schema::{SnapshotHeader, Vertex};

type Loan = service::Loan<Vertex, SnapshotHeader>;

/// How much one snapshot of a scene holds.
#[derive(Clone, Copy)]
pub struct SnapshotSize {
    /// Vertices of the surface.
    pub vertices: usize,
    /// Nodes of the displacement grid.
    pub nodes: usize,
}

impl SnapshotSize {
    /// Vertices and nodes together.
    pub fn total(self) -> usize {
        self.vertices + self.nodes
    }
}

/// The loans that are out, by the index that their slot carries.
pub struct SnapshotLoans {
    out: [Option<Loan>; 2 * SNAPSHOTS_AHEAD],
    slots: rtrb::Producer<SnapshotSlot>,
    filled: rtrb::Consumer<SnapshotReturn>,
}

impl SnapshotLoans {
    pub fn new(slots: rtrb::Producer<SnapshotSlot>, filled: rtrb::Consumer<SnapshotReturn>) -> Self {
        Self {
            out: std::array::from_fn(|_| None),
            slots,
            filled,
        }
    }

    /// Sends the slots that returned filled, then loans new ones for the scene that runs, where somebody takes them.
    pub fn pass(&mut self, ports: &Ports, scene_generation: u64, size: SnapshotSize) {
        while let Ok(back) = self.filled.pop() {
            let loan = self.out.get_mut(back.index as usize).and_then(Option::take);
            if let (Some(loan), true) = (loan, back.filled) {
                // A send that fails reaches nobody; the next snapshot is 5 ms away.
                let _ = loan.send();
            }
        }
        if !ports.has_viewers() {
            return;
        }
        while self.out.iter().flatten().count() < SNAPSHOTS_AHEAD {
            if !self.loan(ports, scene_generation, size) {
                return;
            }
        }
    }

    fn loan(&mut self, ports: &Ports, scene_generation: u64, size: SnapshotSize) -> bool {
        let Some(index) = self.out.iter().position(Option::is_none) else {
            return false;
        };
        let Some(mut loan) = ports.snapshots.loan(size.total()) else {
            return false;
        };
        let (header, vertices) = loan.parts();
        let slot = SnapshotSlot {
            index: index as u32,
            scene_generation,
            header,
            vertices,
            vertex_count: size.vertices,
            node_count: size.nodes,
        };
        let pushed = self.slots.push(slot).is_ok();
        self.out[index] = pushed.then_some(loan);
        pushed
    }
}
