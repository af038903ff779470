//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use crate::scene::Scene;
use crate::tissue::{ChainMailTissue, Limits, TissueModel};

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    pub scene: Scene,
    pub tissue: Box<dyn TissueModel>,
}

impl World {
    pub fn new(scene: Scene, limits: Limits, generation: u64) -> Self {
        Self {
            generation,
            tissue: Box::new(ChainMailTissue::new(&scene, limits)),
            scene,
        }
    }
}
