//! The imaged object: labels of the body at rest, the tissue of each, and the metal in it.

use crate::{Bend, Tissue};
use nalgebra::Vector3;
use stylet_shm_schema::{GridInfo, HapticState, LeftNeedlePose, SceneHeader, SeedPose, SnapshotHeader};
pub use stylet_shm_schema::{SEED_LENGTH_M, SEED_RADIUS_M};

/// Radius of a needle, 18 G, m.
pub const NEEDLE_RADIUS_M: f64 = 0.635e-3;
/// Drawn length of a needle, m.
const NEEDLE_M: f64 = 0.15;

/// Body at rest.
#[derive(Clone, Debug)]
pub struct Body {
    /// Grid of the cells; its nodes are their centres.
    pub grid: GridInfo,
    /// Label of each cell, x fastest; 0 is outside.
    pub cells: Vec<u8>,
    /// Tissue of each label.
    pub tissues: [Tissue; 256],
}

impl Body {
    /// Creates a body; `None` unless the cells fit the grid.
    pub fn new(grid: GridInfo, cells: Vec<u8>, tissues: [Tissue; 256]) -> Option<Self> {
        let fits = grid.node_count() == Some(cells.len()) && grid.dims.iter().all(|&d| d > 0) && grid.spacing_m > 0.0;
        fits.then_some(Self { grid, cells, tissues })
    }

    /// Creates the body of a scene, its tissues by the names of its structures.
    pub fn of_scene(header: &SceneHeader, labels: &[u8]) -> Option<Self> {
        let mut tissues = [Tissue::OUTSIDE; 256];
        for (slot, structure) in tissues[1..].iter_mut().zip(header.structures()) {
            *slot = Tissue::of(structure);
        }
        Self::new(header.labels, labels.to_vec(), tissues)
    }

    /// Returns the lower corner of the grid's cells, scene frame, m.
    pub fn corner_m(&self) -> Vector3<f64> {
        Vector3::from(self.grid.origin_m).add_scalar(-0.5 * self.grid.spacing_m)
    }

    /// Returns the edges of the grid, m.
    pub fn size_m(&self) -> Vector3<f64> {
        Vector3::from(self.grid.dims).map(|d| f64::from(d) * self.grid.spacing_m)
    }
}

/// Present pose of a seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Centre, scene frame, m.
    pub middle_m: Vector3<f64>,
    /// Unit vector along it.
    pub axis: Vector3<f64>,
}

/// Present shape of a needle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Needle {
    /// Places along its axis from the tip back, scene frame, m.
    pub points_m: Vec<Vector3<f64>>,
}

/// Metal in the body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metal {
    /// All seeds.
    pub seeds: Vec<Seed>,
    /// All needles.
    pub needles: Vec<Needle>,
}

impl Metal {
    /// Returns the seeds, which an exercise moves with the body, the needles that stay in, and the
    /// moving one after its first tick.
    pub fn of(
        seeds: &[SeedPose],
        body_moved_m: [f64; 3],
        left: &[LeftNeedlePose],
        bend: &Bend,
        state: Option<&HapticState>,
    ) -> Self {
        let seeds = seeds.iter().map(|seed| Seed {
            middle_m: Vector3::from(seed.position_m) + Vector3::from(body_moved_m),
            axis: seed.axis.into(),
        });
        let left = left.iter().map(|left| {
            let tip = Vector3::from(left.tip_m);
            vec![tip, tip - Vector3::from(left.direction) * NEEDLE_M]
        });
        let moving = state.filter(|s| s.tick > 0).map(|s| {
            let points_m = bend.points_m(s.tip_in_scene_m, s.needle_direction, NEEDLE_M);
            points_m.into_iter().map(Vector3::from).collect()
        });
        Self {
            seeds: seeds.collect(),
            needles: left.chain(moving).map(|points_m| Needle { points_m }).collect(),
        }
    }

    /// Returns the metal of a snapshot, with the needle of the newest state.
    pub fn of_snapshot(header: &SnapshotHeader, state: Option<&HapticState>) -> Self {
        let mut bend = Bend::default();
        bend.take(header);
        let seeds = header.seeds.get(..header.seed_count as usize).unwrap_or(&[]);
        Self::of(seeds, header.body_moved_m, header.left(), &bend, state)
    }
}
