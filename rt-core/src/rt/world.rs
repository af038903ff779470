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
        Self {
            generation,
            scene,
            model,
            state,
        }
    }

    pub fn set_limits(&mut self, limits: Limits) {
        self.model.limits = limits;
    }

    /// Every element to its place at rest, at once.
    pub fn return_to_rest(&mut self) {
        for component in &mut self.state.u {
            component.fill(0.0);
        }
        self.state.max_displacement = 0.0;
    }
}
