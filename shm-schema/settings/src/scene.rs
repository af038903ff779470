//! Built-in scenes by name, and the sizes that a scene may have.

use bytemuck::{Pod, Zeroable};

/// Scenes that the core can draw without a file; a request to load one takes its place in this list.
pub const BUILTIN_SCENES: [&str; 3] = ["paper", "pelvis", "full"];

/// Nodes of the displacement grid at most: what a tissue tick may spend on it.
pub const MAX_NODES: usize = 8192;

/// Cells of the label grid at most.
pub const MAX_LABEL_CELLS: usize = 2 << 20;

/// A regular grid over the body at rest, x fastest: node (i, j, k) lies at `origin_m + (i, j, k) spacing_m`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GridInfo {
    /// Nodes along x, y, z; all zero for no grid.
    pub dims: [u32; 3],
    /// Zero.
    pub reserved: u32,
    /// Place of node (0, 0, 0), scene frame, m.
    pub origin_m: [f64; 3],
    /// Distance between neighbouring nodes, m.
    pub spacing_m: f64,
}

impl GridInfo {
    /// Nodes in all; `None` when there are absurdly many.
    pub fn node_count(&self) -> Option<usize> {
        let [x, y, z] = self.dims.map(u64::from);
        let nodes = x.checked_mul(y)?.checked_mul(z)?;
        (nodes <= 64_000_000).then_some(nodes as usize)
    }
}

/// Structures in a scene at most.
pub const MAX_STRUCTURES: usize = 255;

/// Needles that may stay in the tissue while another moves, at most.
pub const MAX_LEFT_NEEDLES: usize = 4;
