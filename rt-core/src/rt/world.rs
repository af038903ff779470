//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use crate::scene::Scene;
use crate::tissue::{ChainMail, Limits, TissueState};

/// Body, state and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    pub scene: Scene,
    pub model: ChainMail,
    pub state: TissueState,
}

impl World {
    pub fn new(scene: Scene, limits: Limits, generation: u64) -> Self {
        let model = ChainMail::new(&scene, limits);
        let state = TissueState::at_rest(&model);
        Self { generation, scene, model, state }
    }
}
