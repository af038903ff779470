//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use stylet_shm_schema::{SnapshotHeader, Vertex};
use stylet_sim::limits::Limits;
use stylet_sim::migration::Migration;
use stylet_sim::needle::LayerKind;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{MaterialPoint, TissueError, TissueModel, TissueSpec};
use stylet_wall::board::Writer;

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    /// Lattice, surface and structures.
    pub scene: Scene,
    /// What each structure of the scene is to the needle.
    pub layers: Vec<LayerKind>,
    /// What is known of the tissue model.
    pub spec: TissueSpec,
    /// The body as it deforms.
    pub tissue: Box<dyn TissueModel>,
    /// Limits that the tissue keeps now.
    pub limits: Limits,
    /// What seeds do after they were dropped; off in a new world.
    pub migration: Migration,
    /// Tissue near the tip is looked at and opened where it folds. Seeds and forces are the same without, and the tissue loop is faster.
    pub looks_near_tip: bool,
    /// Where snapshots go, in a run that shows any.
    pub shown: Option<Writer<SnapshotHeader, Vertex>>,
}

impl World {
    /// Sets up the tissue model of a scene, at rest.
    pub fn new(
        scene: Scene,
        tissue: impl Into<TissueSpec>,
        limits: Limits,
        generation: u64,
    ) -> Result<Self, TissueError> {
        let spec = tissue.into();
        let scene = scene.for_tissue(spec);
        Ok(Self {
            generation,
            layers: scene.structures.iter().map(LayerKind::of_structure).collect(),
            tissue: (spec.build)(&scene, &limits)?,
            spec,
            scene,
            limits,
            migration: Migration::default(),
            looks_near_tip: true,
            shown: None,
        })
    }

    /// Limits from the next step on.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits.clone_from(&limits);
        self.tissue.set_limits(limits);
    }

    /// The layer that a point of the body belongs to.
    pub fn layer(&self, point: &MaterialPoint) -> LayerKind {
        let structure = usize::from(self.scene.structure_at(point.element, point.local));
        self.layers.get(structure).copied().unwrap_or_default()
    }
}
