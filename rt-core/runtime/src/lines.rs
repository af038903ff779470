//! Lines for needles: the body at rest that they are solved in, apart from the one that moves.

use crate::rt::world::WorldError;
use std::sync::Arc;
use stylet_sim::line::{Line, LineError, LineStations, QueueProgress, ReadyLine};
use stylet_sim::needle::LayerKind;
use stylet_sim::probe::{BodyProbe, NoWall, PADS_APART_M, ProbePose, ProbeQueue, ProbeShape, Wall};
use stylet_sim::scene::{Scene, SceneError, SceneSource, TissueKind};
use stylet_sim::tissue::fem::batch::BatchModel;
use stylet_sim::tissue::{FemTissue, MaterialPoint};

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
    /// A part that would fly off at the first newton.
    #[error(
        "nothing holds the part of the body that the needle enters: let fat or something fixed lie beyond one of its faces (surroundings)"
    )]
    NothingHolds,
}

/// A body at rest with its solver for eight loads at once.
pub struct LineBody {
    tissue: TissueKind,
    scene: Scene,
    /// By structure; bone is none.
    layers: Vec<Option<LayerKind>>,
    batch: BatchModel<f32>,
    /// By element; empty where everything is held.
    is_loose: Vec<bool>,
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
            layers: scene
                .structures
                .iter()
                .map(|structure| (!structure.material.fixed).then(|| LayerKind::of_structure(structure)))
                .collect(),
            batch: BatchModel::new(&body.model),
            is_loose: loose_elements(&body),
            scene,
        }))
    }

    /// The same with tissue that is so many times as stiff as that of the scene.
    pub fn of_stiffened(source: &SceneSource, factor: f64, tissue: TissueKind) -> Result<Option<Self>, NoLine> {
        Self::of_source(&source.stiffened(factor)?, tissue)
    }

    /// Solves for the line of a needle held like this, scene frame, across it as well where the needle `bends`. `goes_on` is asked between slices of work.
    pub fn prepare(
        &self,
        generation: u64,
        tip_m: [f64; 3],
        direction: [f64; 3],
        bends: bool,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Result<ReadyLine, NoLine> {
        self.prepare_beside(generation, tip_m, direction, bends, &[], goes_on)
    }

    /// The same for a needle that may come beside those of `others`.
    pub fn prepare_beside(
        &self,
        generation: u64,
        tip_m: [f64; 3],
        direction: [f64; 3],
        bends: bool,
        others: &[Arc<LineStations>],
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Result<ReadyLine, NoLine> {
        let line = Line::into_body(&self.scene.lattice, tip_m, direction).ok_or(LineError::NoTissue)?;
        self.prepare_along(generation, line, bends, others, &mut |_| goes_on())
    }

    /// Solves for what an ultrasound probe in the rectum can press. `goes_on` is given how many columns are ready, and of how many.
    pub fn prepare_probe(
        &self,
        shape: ProbeShape,
        goes_on: &mut dyn FnMut([usize; 2]) -> bool,
    ) -> Result<BodyProbe, NoWall> {
        let wall = Wall::of(&self.scene, PADS_APART_M)?;
        let queue = ProbeQueue::new(&self.batch, wall, shape)?;
        Ok(BodyProbe::new(queue.prepare(&self.batch, goes_on)?))
    }

    /// Where a probe lies below the target, pressed so far above where it meets the wall.
    pub fn probe_below_target(&self, probe: &BodyProbe, pressed_m: f64, beyond_m: f64) -> ProbePose {
        let ready = probe.ready();
        ready
            .wall
            .pose_below_target(&self.scene, &ready.shape, pressed_m, beyond_m)
    }

    /// Solves for a line that enters the body where it says. `report` is called between slices of work and ends it by
    /// returning false.
    pub fn prepare_along(
        &self,
        generation: u64,
        line: Line,
        bends: bool,
        others: &[Arc<LineStations>],
        report: &mut dyn FnMut(QueueProgress) -> bool,
    ) -> Result<ReadyLine, NoLine> {
        let inside_m = 0.25 * self.scene.body.spacing_m;
        let first = MaterialPoint::at_rest(&self.scene.body, line.point_m(inside_m, [0.0; 2]));
        let is_loose = |point: MaterialPoint| self.is_loose.get(point.element as usize).copied();
        if first.and_then(is_loose).unwrap_or(false) {
            return Err(NoLine::NothingHolds);
        }
        let lattice = &self.scene.lattice;
        let layer_of = |element: u32| {
            let structure = usize::from(lattice.structure(element));
            self.layers
                .get(structure)
                .copied()
                .unwrap_or(Some(LayerKind::default()))
        };
        let mut ready = ReadyLine::prepare(generation, &self.batch, lattice, &layer_of, line, bends, others, report)?;
        if !self.tissue.adds_columns() {
            ready.body.answer.carry();
        }
        Ok(ready)
    }
}

fn loose_elements(body: &FemTissue<f32>) -> Vec<bool> {
    let elements = 0..body.model.element_count() as u32;
    let is_loose: Vec<bool> = elements.map(|element| !body.model.is_held(element)).collect();
    if is_loose.contains(&true) { is_loose } else { Vec::new() }
}
