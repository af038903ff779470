//! The deformed gland, as the tissue thread writes it and the bridge copies it to hosts.

use crate::{MAX_LEFT_NEEDLES, MAX_SEEDS, SceneId};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Deformed position of one surface vertex, scene frame; behind the surface vertices of a snapshot, the displacement
/// from rest (m) of one node of the scene's [`crate::GridInfo`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Position of a vertex or displacement of a node, m.
    pub position_m: [f32; 3],
}

/// Where a seed is now.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct SeedPose {
    /// Centre of the seed in the body as the scene has it: where the body is moved besides, the seed is
    /// [`SnapshotHeader::body_moved_m`] from there. Scene frame, m.
    pub position_m: [f64; 3],
    /// Unit vector along the seed; it turns with the tissue.
    pub axis: [f64; 3],
    /// Where the tip was when the seed left it, in the body as the scene has it.
    pub dropped_at_m: [f64; 3],
}

/// Places along a bent needle in a snapshot at most.
pub const MAX_BEND_POINTS: usize = 16;

/// A needle that stays in the tissue.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct LeftNeedlePose {
    /// Its number, by which it is taken up again or drawn out.
    pub number: u64,
    /// Where it enters the body at rest, scene frame, m.
    pub entry_m: [f64; 3],
    /// Unit vector from hub to tip.
    pub direction: [f64; 3],
    /// Where its tip is, scene frame, m.
    pub tip_m: [f64; 3],
}

/// Header of the vertices of one tissue tick, written by the tissue thread.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SnapshotHeader {
    /// The run of the core.
    pub session_id: u64,
    /// Which [`crate::SceneHeader`] the vertices belong to.
    pub scene_generation: u64,
    /// Number of the tissue tick.
    pub tissue_tick: u64,
    /// `CLOCK_MONOTONIC` at its end.
    pub time_ns: u64,
    /// Tip that the tick used, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Unit vector from hub to tip.
    pub needle_direction: [f64; 3],
    /// Where the held element is, scene frame, m.
    pub held_in_scene_m: [f64; 3],
    /// Largest constraint violation after this tick, in elements.
    pub residual: f64,
    /// Largest displacement of any element from rest, m.
    pub max_displacement_m: f64,
    /// Time that the tick took.
    pub work_ns: u64,
    /// Passes of the solver.
    pub passes: u32,
    /// Elements that the tick moved.
    pub moved_elements: u32,
    /// `u32::MAX` when the needle holds nothing.
    pub held_element: u32,
    /// [`crate::Phase`] by number.
    pub phase: u32,
    /// Vertices of the surface; they come first.
    pub vertex_count: u32,
    /// Nodes of the displacement grid; they follow the vertices.
    pub node_count: u32,
    /// How many of `seeds` count.
    pub seed_count: u32,
    /// How many of `bend_m` count; 0 for a needle that does not bend.
    pub bend_count: u32,
    /// Distance along the needle from one of `bend_m` to the next, m.
    pub bend_spacing_m: f64,
    /// Places of the shaft less where a rigid needle would have them, scene frame, m: from the tip back to the hand.
    pub bend_m: [[f64; 3]; MAX_BEND_POINTS],
    /// How many of `left` count.
    pub left_count: u32,
    /// Zero.
    pub reserved: u32,
    /// How far an exercise has moved all of the body from where the scene has it, m; vertices and displacements are with it.
    pub body_moved_m: [f64; 3],
    /// In the order of the drops.
    pub seeds: [SeedPose; MAX_SEEDS],
    /// Needles that stay in, in the order in which they were left.
    pub left: [LeftNeedlePose; MAX_LEFT_NEEDLES],
}

impl SnapshotHeader {
    /// Places of the shaft less where a rigid needle would have them, m: from the tip back to the hand. None for a needle that does
    /// not bend.
    pub fn bends_m(&self) -> &[[f64; 3]] {
        self.bend_m.get(..self.bend_count as usize).unwrap_or(&[])
    }

    /// Needles that stay in.
    pub fn left(&self) -> &[LeftNeedlePose] {
        &self.left[..(self.left_count as usize).min(MAX_LEFT_NEEDLES)]
    }

    /// Identity of the scene that the vertices belong to.
    pub fn scene_id(&self) -> SceneId {
        SceneId {
            session_id: self.session_id,
            generation: self.scene_generation,
        }
    }
}

impl Default for SnapshotHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}
