//! Lines for needles: the body at rest that they are solved in, apart from the one that moves.

use crate::rt::world::WorldError;
use stylet_sim::line::{Line, LineError, QueueProgress, ReadyLine};
use stylet_sim::needle::LayerKind;
use stylet_sim::scene::{Scene, SceneError, SceneSource, TissueKind};
use stylet_sim::tissue::FemTissue;
use stylet_sim::tissue::fem::batch::BatchModel;

/// Why there is no line; the text is for people.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoLine {
    /// The scene cannot be built again.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its materials cannot be used.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The line itself.
    #[error(transparent)]
    Line(#[from] LineError),
}

/// A body at rest with its solver for eight loads at once.
pub struct LineBody {
    tissue: TissueKind,
    scene: Scene,
    layers: Vec<LayerKind>,
    batch: BatchModel<f32>,
}

impl LineBody {
    /// Builds the scene anew, for needles in that tissue; `None` where they slip by speed.
    pub fn of_source(source: &SceneSource, tissue: TissueKind) -> Result<Option<Self>, NoLine> {
        let Some(scene) = source.build()?.for_lines(tissue) else {
            return Ok(None);
        };
        let body = FemTissue::<f32>::new(&scene)
            .map_err(|problems| WorldError(problems.iter().map(ToString::to_string).collect()))?;
        Ok(Some(Self {
            tissue,
            layers: scene.structures.iter().map(LayerKind::of_structure).collect(),
            batch: BatchModel::new(&body.model),
            scene,
        }))
    }

    /// Solves for the line of a needle held like this, scene frame. `goes_on` is asked between slices of work.
    pub fn prepare(
        &self,
        generation: u64,
        tip_m: [f64; 3],
        direction: [f64; 3],
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Result<ReadyLine, NoLine> {
        let line = Line::into_body(&self.scene.lattice, tip_m, direction).ok_or(LineError::NoTissue)?;
        self.prepare_along(generation, line, &mut |_| goes_on())
    }

    /// Solves for a line that enters the body where it says. `report` is called between slices of work and ends it by
    /// returning false.
    pub fn prepare_along(
        &self,
        generation: u64,
        line: Line,
        report: &mut dyn FnMut(QueueProgress) -> bool,
    ) -> Result<ReadyLine, NoLine> {
        let lattice = &self.scene.lattice;
        let layer_of = |element: u32| {
            let structure = usize::from(lattice.structure(element));
            self.layers.get(structure).copied().unwrap_or_default()
        };
        let mut ready = ReadyLine::prepare(generation, &self.batch, lattice, &layer_of, line, report)?;
        if !self.tissue.adds_columns() {
            ready.body.answer.carry(&self.scene.body, self.scene.is_held());
        }
        Ok(ready)
    }
}
