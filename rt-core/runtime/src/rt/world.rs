//! The scene as the tissue loop owns it: built by another thread, swapped in whole.

use stylet_shm_schema::{SnapshotHeader, Vertex};
use stylet_sim::limits::Limits;
use stylet_sim::migration::Migration;
use stylet_sim::needle::LayerKind;
use stylet_sim::scene::{Scene, TissueKind};
use stylet_sim::tissue::{ChainMailTissue, FemTissue, MaterialPoint, TissueModel};
use stylet_wall::board::Writer;

/// Why a tissue model cannot be set up: every problem, one a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct WorldError(pub Vec<String>);

/// Body, tissue and surface of one scene.
pub struct World {
    /// Rises with each scene of a run.
    pub generation: u64,
    /// Lattice, surface and structures.
    pub scene: Scene,
    /// What each structure of the scene is to the needle.
    pub layers: Vec<LayerKind>,
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
    /// Sets up the tissue model that `scene` asks for, at rest.
    pub fn new(scene: Scene, limits: Limits, generation: u64) -> Result<Self, WorldError> {
        let tissue: Box<dyn TissueModel> = match scene.tissue() {
            TissueKind::ChainMail | TissueKind::Paper => Box::new(ChainMailTissue::new(&scene, limits.clone())),
            TissueKind::Fem => {
                let texts = |problems: Vec<_>| problems.iter().map(ToString::to_string).collect();
                Box::new(FemTissue::<f32>::new(&scene).map_err(|p| WorldError(texts(p)))?)
            }
        };
        Ok(Self {
            generation,
            layers: scene.structures.iter().map(LayerKind::of_structure).collect(),
            tissue,
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
