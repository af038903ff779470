//! Solves needle lines in a body at rest, apart from the moving one.

use crate::kept_probe::{self, KeptError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use stylet_sim::line::{Line, LineError, LineStations, QueueProgress, ReadyLine};
use stylet_sim::needle::LayerKind;
use stylet_sim::probe::{BodyProbe, NoWall, PADS_APART_M, ProbeQueue, ProbeShape, ReadyProbe, Wall};
use stylet_sim::scene::{Scene, SceneError, SceneSource};
use stylet_sim::tissue::fem::batch::BatchModel;
use stylet_sim::tissue::{FemTissue, MaterialPoint, TissueError, TissueSpec};

/// Reason why there is no line; the text is for people.
#[derive(Clone, Debug, thiserror::Error)]
pub enum NoLine {
    /// The scene cannot be built again.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its materials cannot be used.
    #[error(transparent)]
    World(#[from] TissueError),
    /// The line cannot be solved.
    #[error(transparent)]
    Line(#[from] LineError),
    /// A part that the first newton would accelerate without limit.
    #[error(
        "nothing holds the part of the body that the needle enters: let fat or something fixed lie beyond one of its faces (surroundings)"
    )]
    NothingHolds,
}

/// Reason why there is no probe; the text is for people.
#[derive(Debug, thiserror::Error)]
pub enum NoProbe {
    /// The body cannot be solved in.
    #[error(transparent)]
    Body(#[from] NoLine),
    /// There is no wall that the probe could press.
    #[error(transparent)]
    Wall(#[from] NoWall),
}

/// A body at rest with its solver for eight loads at once.
pub struct LineBody {
    adds_columns: bool,
    pub(crate) scene: Scene,
    /// Layer of each structure; bone has none.
    layers: Vec<Option<LayerKind>>,
    batch: BatchModel<f32>,
    /// Elements that nothing holds; empty where everything is held.
    is_loose: Vec<bool>,
}

impl LineBody {
    /// Builds the scene for needles in that tissue; `None` for a tissue model whose needles slip by speed.
    pub fn of_source(source: &SceneSource, tissue: impl Into<TissueSpec>) -> Result<Option<Self>, NoLine> {
        let tissue = tissue.into();
        let Some(scene) = source.build()?.for_lines(tissue) else {
            return Ok(None);
        };
        let body = FemTissue::<f32>::new(&scene).map_err(TissueError::from)?;
        Ok(Some(Self {
            adds_columns: tissue.adds_columns,
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

    /// As [`of_source`](Self::of_source), with the stiffness multiplied by `factor`.
    pub fn of_stiffened(
        source: &SceneSource,
        factor: f64,
        tissue: impl Into<TissueSpec>,
    ) -> Result<Option<Self>, NoLine> {
        Self::of_source(&source.stiffened(factor)?, tissue)
    }

    /// Solves for the line of a needle on this axis in the scene frame, and across it if the needle `bends`, that may
    /// come into use beside those of `others`. `goes_on` is polled between slices of work.
    pub fn prepare(
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

    /// Solves for the answers of an ultrasound probe in the rectum. `goes_on` gets the number of finished columns and
    /// of all.
    pub fn prepare_probe(
        &self,
        shape: ProbeShape,
        goes_on: &mut dyn FnMut([usize; 2]) -> bool,
    ) -> Result<BodyProbe, NoWall> {
        let wall = Wall::of(&self.scene, PADS_APART_M)?;
        let queue = ProbeQueue::new(&self.batch, &self.scene.body, wall, shape)?;
        Ok(BodyProbe::new(queue.prepare(&self.batch, goes_on)?))
    }

    /// Restores the answers of [`solve_in_cells`](Self::solve_in_cells) from a file; `None` if none are saved.
    pub fn kept_probe(&self, shape: ProbeShape, folder: &Path) -> Result<Option<BodyProbe>, KeptError> {
        let path = self.probe_file(&shape, folder);
        let Some(solved) = kept_probe::read(&path, &self.scene, &shape)? else {
            return Ok(None);
        };
        let wall = Wall::of(&self.scene, PADS_APART_M).ok().map(Wall::loaded_at_points);
        let ready = wall.and_then(|wall| ReadyProbe::of_solved(solved, &self.scene.body, wall, shape));
        ready
            .map(|ready| Some(BodyProbe::new(ready)))
            .ok_or(KeptError::Other(path))
    }

    /// Solves in the scene's own cells for the answers of a probe, loaded at its contact points; takes minutes on that
    /// many threads. `goes_on` gets the number of finished columns and of all. The answers do not depend on the number
    /// of threads.
    pub fn solve_in_cells(
        &self,
        shape: ProbeShape,
        threads: usize,
        goes_on: &mut dyn FnMut([usize; 2]) -> bool,
    ) -> Result<ReadyProbe, NoProbe> {
        let wall = Wall::of(&self.scene, PADS_APART_M)?.loaded_at_points();
        let rows = 3 * wall.loads();
        let body = FemTissue::<f32>::new(&self.scene.clone().in_cells())
            .map(|fem| BatchModel::new(&fem.model))
            .map_err(|problems| NoLine::World(problems.into()))?;
        let queue = ProbeQueue::new(&body, &self.scene.body, wall, shape)?;
        let (next, is_stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        let solved = Mutex::new(Vec::new());
        let work = |goes_on: &mut dyn FnMut() -> bool| {
            let mut room = queue.room(&body);
            loop {
                // SYNC: each batch is taken once; nothing else is carried.
                let batch = next.fetch_add(1, Ordering::Relaxed);
                if batch >= queue.batches() {
                    return;
                }
                let Some(answers) = queue.solve(&body, batch, &mut room, goes_on) else {
                    return;
                };
                solved.lock().unwrap_or_else(PoisonError::into_inner).push(answers);
            }
        };
        let ready = || solved.lock().unwrap_or_else(PoisonError::into_inner).len() * rows / queue.batches().max(1);
        // SYNC: nothing but the flag is carried.
        let is_wanted = || !is_stopped.load(Ordering::Relaxed);
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(|| work(&mut || is_wanted()));
            }
            work(&mut || {
                let goes_on = goes_on([ready(), rows]);
                is_stopped.store(!goes_on, Ordering::Relaxed);
                goes_on
            });
        });
        let solved = solved.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(queue.finish(solved)?)
    }

    /// Returns the file of saved answers.
    pub fn probe_file(&self, shape: &ProbeShape, folder: &Path) -> PathBuf {
        kept_probe::path(folder, &self.scene, shape)
    }

    /// Saves solved answers.
    pub fn keep_probe(&self, ready: &ReadyProbe, folder: &Path) -> Result<(), KeptError> {
        let path = self.probe_file(&ready.shape, folder);
        kept_probe::write(&path, &self.scene, &ready.shape, &ready.solved)
    }

    /// Element edges for a probe solved within seconds and for one that takes minutes, m.
    pub fn probe_edges_m(&self) -> [f64; 2] {
        [self.scene.body.spacing_m, self.scene.clone().in_cells().body.spacing_m]
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
        if !self.adds_columns {
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
