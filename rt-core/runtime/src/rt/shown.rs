//! Destination of a scene's snapshots: memory that the bridge reads, or the host in the same process.

use stylet_shm_schema::{SnapshotHeader, Vertex};
#[cfg(not(target_family = "wasm"))]
use stylet_wall::board::Writer;

/// Header, and vertices and nodes of one snapshot.
pub type SnapshotHere = (SnapshotHeader, Vec<Vertex>);

/// The tissue loop's end. A write neither waits nor allocates.
pub enum Shown {
    /// Memory that the bridge reads.
    #[cfg(not(target_family = "wasm"))]
    Board(Writer<SnapshotHeader, Vertex>),
    /// The host in the same process.
    Here(triple_buffer::Input<SnapshotHere>),
}

impl Shown {
    /// Publishes what `fill` writes over an earlier snapshot.
    pub fn write(&mut self, fill: impl FnOnce(&mut SnapshotHeader, &mut [Vertex])) {
        match self {
            #[cfg(not(target_family = "wasm"))]
            Self::Board(board) => board.write(fill),
            Self::Here(here) => {
                let (header, values) = here.input_buffer_mut();
                fill(header, values);
                here.publish();
            }
        }
    }
}
