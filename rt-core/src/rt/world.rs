//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use crate::needle::LayerKind;
use crate::scene::Scene;
use crate::tissue::{ChainMailTissue, Limits, TissueModel};

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    pub scene: Scene,
    /// What each structure of the scene is to the needle.
    pub layers: Vec<LayerKind>,
    pub tissue: Box<dyn TissueModel>,
}

impl World {
    pub fn new(scene: Scene, limits: Limits, generation: u64) -> Self {
        Self {
            generation,
            layers: scene.structures.iter().map(LayerKind::of_structure).collect(),
            tissue: Box::new(ChainMailTissue::new(&scene, limits)),
            scene,
        }
    }

    /// The layer that an element belongs to.
    pub fn layer(&self, element: u32) -> LayerKind {
        let structure = usize::from(self.scene.lattice.structure(element));
        self.layers.get(structure).copied().unwrap_or_default()
    }
}
