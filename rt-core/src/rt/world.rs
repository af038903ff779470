//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use crate::scene::Scene;
use crate::tissue::{ChainMailTissue, FemTissue, Limits, TissueKind, TissueModel};

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    pub scene: Scene,
    pub tissue: Box<dyn TissueModel>,
    /// As the tissue was last given them.
    pub limits: Limits,
}

impl World {
    /// Errors are for people.
    pub fn new(scene: Scene, limits: Limits, generation: u64) -> Result<Self, String> {
        let tissue: Box<dyn TissueModel> = match scene.tissue {
            TissueKind::ChainMail => Box::new(ChainMailTissue::new(&scene, limits.clone())),
            TissueKind::Fem => {
                let words = |problems: Vec<_>| problems.iter().map(ToString::to_string).collect::<Vec<_>>();
                let fem = FemTissue::<f32>::new(&scene).map_err(|p| words(p).join("\n"))?;
                Box::new(fem)
            }
        };
        Ok(Self {
            generation,
            tissue,
            scene,
            limits,
        })
    }

    pub fn set_limits(&mut self, limits: Limits) {
        self.limits.clone_from(&limits);
        self.tissue.set_limits(limits);
    }
}
