//! The tissue loop's scene: built by another thread, swapped in as a whole.

use crate::rt::shown::Shown;
use stylet_sim::limits::Limits;
use stylet_sim::migration::Migration;
use stylet_sim::needle::LayerKind;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{MaterialPoint, TissueError, TissueModel, TissueSpec};

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    /// Lattice, surface and structures.
    pub scene: Scene,
    /// Layer of each structure of the scene.
    pub layers: Vec<LayerKind>,
    /// What is known of the tissue model.
    pub spec: TissueSpec,
    /// The body as it deforms.
    pub tissue: Box<dyn TissueModel>,
    /// Current limits of the tissue.
    pub limits: Limits,
    /// Migration of dropped seeds; off in a new world.
    pub migration: Migration,
    /// Seeds take room in their track.
    pub seeds_take_room: bool,
    /// Detects and corrects folds near the tip. Seeds and forces are the same without it, and the tissue loop is
    /// faster.
    pub looks_near_tip: bool,
    /// Destination of snapshots, in a run that shows any.
    pub shown: Option<Shown>,
}

impl World {
    /// Sets up the tissue model of `scene`, at rest.
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
            seeds_take_room: true,
            looks_near_tip: true,
            shown: None,
        })
    }

    /// Sets the limits from the next step on.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits.clone_from(&limits);
        self.tissue.set_limits(limits);
    }

    /// Returns the layer of a point of the body.
    pub fn layer(&self, point: &MaterialPoint) -> LayerKind {
        let structure = usize::from(self.scene.structure_at(point.element, point.local));
        self.layers.get(structure).copied().unwrap_or_default()
    }
}
