//! The deformed gland, written by the tissue thread and copied to hosts by the bridge.

use crate::{MAX_LEFT_NEEDLES, MAX_SEEDS, SEED_LENGTH_M, SEED_RADIUS_M, SceneId, TOUCHING_M};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Deformed position of one surface vertex, scene frame; after the surface vertices of a snapshot, the displacement
/// from rest (m) of one node of the scene's [`crate::GridInfo`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Position of a vertex or displacement of a node, m.
    pub position_m: [f32; 3],
}

/// Cosine of the angle between two seeds of one track, at least.
const PARALLEL: f64 = 0.9;

/// Present pose of a seed.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct SeedPose {
    /// Middle of the seed in the body at its place in the scene, scene frame, m: if the body is moved, the seed is
    /// displaced by [`SnapshotHeader::body_moved_m`].
    pub position_m: [f64; 3],
    /// Unit vector along the seed; it turns with the tissue.
    pub axis: [f64; 3],
    /// Middle of the seed when the needle left it, half a seed behind the tip, in the body at its place in the scene.
    pub dropped_at_m: [f64; 3],
}

impl SeedPose {
    /// Returns whether both lie end to end in one track, to a tenth of a millimetre.
    pub fn touches(&self, other: &SeedPose) -> bool {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let apart_m = [0, 1, 2].map(|a| self.position_m[a] - other.position_m[a]);
        let along_m = dot(apart_m, self.axis);
        let beside_m2 = dot(apart_m, apart_m) - along_m * along_m;
        dot(self.axis, other.axis) > PARALLEL
            && beside_m2 < (2.0 * SEED_RADIUS_M).powi(2)
            && along_m.abs() < SEED_LENGTH_M + TOUCHING_M
    }
}

/// Returns the numbers, from 1, of the seeds that seed `number`, counted from 0, touches.
pub fn touching(seeds: &[SeedPose], number: usize) -> Vec<usize> {
    let others = seeds.iter().enumerate().filter(|(other, _)| *other != number);
    let touches = |pose: &SeedPose| seeds.get(number).is_some_and(|seed| seed.touches(pose));
    others
        .filter(|(_, pose)| touches(pose))
        .map(|(other, _)| other + 1)
        .collect()
}

/// Most points along a bent needle in a snapshot.
pub const MAX_BEND_POINTS: usize = 16;

/// A needle that stays in the tissue.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct LeftNeedlePose {
    /// Its number, by which it is taken again or drawn out.
    pub number: u64,
    /// Entry into the body at rest, scene frame, m.
    pub entry_m: [f64; 3],
    /// Unit vector from hub to tip.
    pub direction: [f64; 3],
    /// Position of its tip, scene frame, m.
    pub tip_m: [f64; 3],
}

/// Header of the vertices of one tissue tick, written by the tissue thread.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct SnapshotHeader {
    /// The run of the core.
    pub session_id: u64,
    /// Generation of the [`crate::SceneHeader`] that the vertices belong to.
    #[serde(skip)]
    pub scene_generation: u64,
    /// Number of the tissue tick.
    pub tissue_tick: u64,
    /// `CLOCK_MONOTONIC` at its end.
    pub time_ns: u64,
    /// Tip used by the tick, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Unit vector from hub to tip.
    pub needle_direction: [f64; 3],
    /// Position of the held element, scene frame, m.
    pub held_in_scene_m: [f64; 3],
    /// Largest constraint violation after this tick, in elements.
    pub residual: f64,
    /// Largest displacement of any element from rest, m.
    pub max_displacement_m: f64,
    /// Duration of the tick.
    pub work_ns: u64,
    /// Passes of the solver.
    #[serde(skip)]
    pub passes: u32,
    /// Elements moved by the tick.
    #[serde(skip)]
    pub moved_elements: u32,
    /// `u32::MAX` if the needle holds nothing.
    #[serde(skip)]
    pub held_element: u32,
    /// [`crate::Phase`] by number.
    pub phase: u32,
    /// Vertices of the surface; they come first.
    #[serde(skip)]
    pub vertex_count: u32,
    /// Nodes of the displacement grid; they follow the vertices.
    #[serde(skip)]
    pub node_count: u32,
    /// Number of `seeds` in use.
    #[serde(skip)]
    pub seed_count: u32,
    /// Number of `bend_m` in use; 0 for a needle that does not bend.
    #[serde(skip)]
    pub bend_count: u32,
    /// Distance along the needle between points of `bend_m`, m.
    pub bend_spacing_m: f64,
    /// Displacements of the shaft from a rigid needle, scene frame, m: from the tip back to the hand.
    #[serde(skip)]
    pub bend_m: [[f64; 3]; MAX_BEND_POINTS],
    /// Number of `left` in use.
    #[serde(skip)]
    pub left_count: u32,
    /// Zero.
    #[serde(skip)]
    pub reserved: u32,
    /// Displacement of the whole body by an exercise, from its place in the scene, m; vertices and displacements
    /// include it.
    pub body_moved_m: [f64; 3],
    /// Seeds in the order of the drops.
    #[serde(skip)]
    pub seeds: [SeedPose; MAX_SEEDS],
    /// Needles that stay in, in the order in which they were left.
    #[serde(skip)]
    pub left: [LeftNeedlePose; MAX_LEFT_NEEDLES],
}

impl SnapshotHeader {
    /// Displacements of the shaft from a rigid needle, m: from the tip back to the hand. Empty for a needle that does
    /// not bend.
    pub fn bends_m(&self) -> &[[f64; 3]] {
        self.bend_m.get(..self.bend_count as usize).unwrap_or(&[])
    }

    /// Returns the needles that stay in.
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
