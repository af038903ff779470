//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use stylet_sim::limits::Limits;
use stylet_sim::needle::LayerKind;
use stylet_sim::scene::Scene;
use stylet_sim::scene::TissueKind;
use stylet_sim::tissue::{ChainMailTissue, FemTissue, TissueModel};

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    pub scene: Scene,
    /// What each structure of the scene is to the needle.
    pub layers: Vec<LayerKind>,
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
            layers: scene.structures.iter().map(LayerKind::of_structure).collect(),
            tissue,
            scene,
            limits,
        })
    }

    pub fn set_limits(&mut self, limits: Limits) {
        self.limits.clone_from(&limits);
        self.tissue.set_limits(limits);
    }

    /// The layer that an element belongs to.
    pub fn layer(&self, element: u32) -> LayerKind {
        let structure = usize::from(self.scene.lattice.structure(element));
        self.layers.get(structure).copied().unwrap_or_default()
    }
}
