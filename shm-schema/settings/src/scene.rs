//! Built-in scenes by name, and size limits of a scene.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Scenes that the core can build without a file; a request to load one takes its index in this list.
pub const BUILTIN_SCENES: [&str; 3] = ["paper", "pelvis", "full"];

/// Most nodes of the displacement grid, given the time that a tissue tick may spend on it.
pub const MAX_NODES: usize = 8192;

/// Most cells of the label grid.
pub const MAX_LABEL_CELLS: usize = 2 << 20;

/// A regular grid over the body at rest, x fastest: node (i, j, k) lies at `origin_m + (i, j, k) spacing_m`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct GridInfo {
    /// Nodes along x, y, z; all zero for no grid.
    pub dims: [u32; 3],
    /// Zero.
    #[serde(skip)]
    pub reserved: u32,
    /// Position of node (0, 0, 0), scene frame, m.
    pub origin_m: [f64; 3],
    /// Distance between neighbouring nodes, m.
    pub spacing_m: f64,
}

impl GridInfo {
    /// Total number of nodes; `None` if absurdly large.
    pub fn node_count(&self) -> Option<usize> {
        let [x, y, z] = self.dims.map(u64::from);
        let nodes = x.checked_mul(y)?.checked_mul(z)?;
        (nodes <= 64_000_000).then_some(nodes as usize)
    }
}

/// Most structures in a scene.
pub const MAX_STRUCTURES: usize = 255;

/// Most needles that may stay in the tissue while another moves.
pub const MAX_LEFT_NEEDLES: usize = 4;
