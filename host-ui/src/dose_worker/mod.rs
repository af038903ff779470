//! Dose of the seeds that lie in the tissue or are planned, computed on a thread of its own whenever they have changed.

mod figures;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
pub use stylet_dose::criteria::{Figure, Limit};
use stylet_dose::decay::Interval;
use stylet_dose::isodose::isodose;
use stylet_dose::{DoseGrid, DoseKernel, Seed, Source};
use stylet_host::link::SceneModel;
use stylet_implant::plan::ImplantPlan;
use stylet_implant::plan::exchange::USUAL_SOURCE;
use stylet_shm_schema::{Prescribed, SceneId, SeedPose};
use stylet_surfaces::mesh::{self, SurfaceVertex};

/// Doses that are drawn, as shares of the prescription.
pub const LEVELS: [f64; 4] = [0.5, 1.0, 1.5, 2.0];
/// Sources without a prescription of their own are drawn against this (I-125, AAPM TG-137).
const USUAL_PRESCRIPTION_GY: f64 = 145.0;
/// A seed that has moved less has, for the eye, the same dose as before.
const SAME_PLACE_M: f64 = 0.2e-3;
/// The grid reaches this far beyond the box of the target.
const MARGIN_M: f64 = 0.012;
/// Distance of the voxels that isodose surfaces are made from.
const SPACING_M: f64 = 1.5e-3;

/// An isodose surface.
#[derive(Clone, Debug, Default)]
pub struct IsodoseShell {
    /// Which of [`LEVELS`].
    pub level: usize,
    /// Vertices, in the body as the scene has it.
    pub points_m: Vec<[f32; 3]>,
    /// Three places in `points_m` each.
    pub triangles: Vec<[u32; 3]>,
    /// Vertices for the graphics card, made here because that takes longer than a frame has.
    pub vertices: Vec<SurfaceVertex>,
    /// Indices for the graphics card.
    pub indices: Vec<u32>,
}

/// Which seeds a dose is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoseOf {
    /// Seeds that lie in the tissue.
    Tissue,
    /// Seeds of the plan.
    Plan,
}

/// Seeds whose dose is requested.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseRequest {
    /// Which seeds they are.
    pub of: DoseOf,
    /// Model of their source.
    pub source: String,
    /// Prescribed dose; without one that of the source.
    pub prescription_gy: Option<f64>,
    /// How far an exercise has moved the body, m.
    pub body_moved_m: [f64; 3],
    /// Place, axis and strength of each, in the body as the scene has it.
    pub seeds: Vec<Seed>,
}

impl DoseRequest {
    /// Request for seeds as they lie: of the source, strength and prescription of what they were planned as, or of the usual source
    /// where that is not known.
    pub fn in_tissue(poses: &[SeedPose], planned: &Prescribed) -> Self {
        let source = planned.source.read();
        Self {
            of: DoseOf::Tissue,
            source: if source.is_empty() {
                USUAL_SOURCE.to_owned()
            } else {
                source
            },
            prescription_gy: (planned.dose_gy > 0.0).then_some(planned.dose_gy),
            body_moved_m: [0.0; 3],
            seeds: poses.iter().map(|p| seed(p, planned.strength_u)).collect(),
        }
    }

    /// Request for the seeds of a plan: they stay where the template is, whichever way the body was moved.
    pub fn of_plan(plan: &ImplantPlan, seeds: &[Seed], body_moved_m: [f64; 3]) -> Self {
        let in_body = |seed: &Seed| Seed {
            position_m: [0, 1, 2].map(|a| seed.position_m[a] - body_moved_m[a]),
            ..*seed
        };
        Self {
            of: DoseOf::Plan,
            source: plan.source.clone(),
            prescription_gy: Some(plan.prescription_gy),
            body_moved_m,
            seeds: seeds.iter().map(in_body).collect(),
        }
    }

    fn is_same(&self, other: &Self) -> bool {
        (self.of, &self.source, self.prescription_gy) == (other.of, &other.source, other.prescription_gy)
            && is_same(&self.seeds, &other.seeds)
    }
}

/// Dose of one set of seeds.
#[derive(Clone, Debug)]
pub struct DoseResult {
    /// Rises with every result.
    pub number: u64,
    /// Which seeds it is of.
    pub of: DoseOf,
    /// Number of seeds.
    pub seeds: usize,
    /// How far the body was moved then, m.
    pub body_moved_m: [f64; 3],
    /// Nuclide and model.
    pub source: String,
    /// Dose that the levels are shares of.
    pub prescription_gy: f64,
    /// One for each of [`LEVELS`]; none where the target has no extent.
    pub shells: Vec<IsodoseShell>,
    /// Measures of the structures, with their limits.
    pub figures: Vec<Figure>,
    /// Cumulative histogram of the target: share of the prescription, share of the volume.
    pub target_dvh: Vec<[f64; 2]>,
}

struct DoseTask {
    number: u64,
    request: DoseRequest,
    scene: Arc<SceneModel>,
}

impl DoseResult {
    /// From the body as the scene has it to where this dose is drawn, m. Seeds in the tissue go with the body, those of a plan do not.
    pub fn shift_m(&self, body_moved_m: [f64; 3]) -> [f64; 3] {
        match self.of {
            DoseOf::Tissue => body_moved_m,
            DoseOf::Plan => self.body_moved_m,
        }
    }
}

/// The thread that computes doses: one set of seeds at a time, then the newest that was requested meanwhile.
pub struct DoseWorker {
    tasks: Sender<DoseTask>,
    results: Receiver<DoseResult>,
    computing: bool,
    /// Session, generation of the scene, and what was requested last.
    requested: Option<(SceneId, DoseRequest)>,
    number: u64,
    latest: Option<Arc<DoseResult>>,
    /// The thread has ended.
    lost: bool,
}

impl DoseWorker {
    /// Starts the thread. Where that fails there is no dose, and [`DoseWorker::trouble`] says so.
    pub fn new() -> Self {
        let (tasks, work) = channel();
        let (done, results) = channel();
        let spawned = std::thread::Builder::new()
            .name("dose".to_owned())
            .spawn(move || compute_all(&work, &done));
        Self {
            tasks,
            results,
            computing: false,
            requested: None,
            number: 0,
            latest: None,
            lost: spawned.is_err(),
        }
    }

    /// The newest result, while it still holds for what was requested last.
    pub fn latest(&self) -> Option<&Arc<DoseResult>> {
        self.latest.as_ref()
    }

    /// Whether a dose is being computed.
    #[cfg(test)]
    fn is_computing(&self) -> bool {
        self.computing
    }

    /// Why there is no dose, where that is so.
    pub fn trouble(&self) -> Option<&'static str> {
        self.lost.then_some("the dose is not computed: its thread has ended")
    }

    /// Takes a result that is ready, and requests a new one where seeds were added, removed or moved. Never waits.
    pub fn take(&mut self, scene: Option<&Arc<SceneModel>>, request: &DoseRequest) {
        match self.results.try_recv() {
            Ok(result) => {
                self.computing = false;
                // A dose of seeds that were all removed meanwhile no longer holds.
                self.latest = (result.seeds > 0 && !request.seeds.is_empty()).then(|| Arc::new(result));
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => self.lost = true,
        }
        // The dose of the plan says nothing of the seeds in the tissue.
        self.latest = self.latest.take().filter(|result| result.of == request.of);
        let Some(scene) = scene else { return };
        if request.seeds.is_empty() {
            (self.latest, self.requested) = (None, None);
            return;
        }
        let key = scene.header.id();
        let known = self
            .requested
            .as_ref()
            .is_some_and(|(scene, last)| *scene == key && last.is_same(request));
        if known || self.computing || self.lost {
            return;
        }
        self.number += 1;
        let task = DoseTask {
            number: self.number,
            request: request.clone(),
            scene: scene.clone(),
        };
        self.computing = self.tasks.send(task).is_ok();
        self.requested = Some((key, request.clone()));
    }
}

impl Default for DoseWorker {
    fn default() -> Self {
        Self::new()
    }
}

fn seed(pose: &SeedPose, strength_u: f64) -> Seed {
    Seed {
        position_m: pose.position_m,
        axis: Some(pose.axis),
        strength_u,
    }
}

fn is_same(a: &[Seed], b: &[Seed]) -> bool {
    let near = |a: &Seed, b: &Seed| {
        let d2: f64 = (0..3).map(|i| (a.position_m[i] - b.position_m[i]).powi(2)).sum();
        d2.sqrt() < SAME_PLACE_M && a.strength_u == b.strength_u
    };
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| near(a, b))
}

fn compute_all(work: &Receiver<DoseTask>, done: &Sender<DoseResult>) {
    let mut known: Option<(String, Source, DoseKernel)> = None;
    while let Ok(task) = work.recv() {
        let model = &task.request.source;
        if known.as_ref().is_none_or(|(name, _, _)| name != model) {
            // The usual one is part of the program; a test reads it.
            let Some(source) = Source::known(model).or_else(|| Source::known(USUAL_SOURCE)) else {
                return;
            };
            let kernel = DoseKernel::new(&source, Interval::ALL);
            known = Some((model.clone(), source, kernel));
        }
        let Some((_, source, kernel)) = &known else { return };
        if done.send(compute(&task, source, kernel)).is_err() {
            return;
        }
    }
}

fn compute(task: &DoseTask, source: &Source, kernel: &DoseKernel) -> DoseResult {
    let seeds = &task.request.seeds;
    let usual_gy = source.prescription_gy.unwrap_or(USUAL_PRESCRIPTION_GY);
    let prescription_gy = task.request.prescription_gy.unwrap_or(usual_gy);
    let header = &task.scene.header;
    let low = header.target_lower_m.map(|c| c - MARGIN_M);
    let high = header.target_upper_m.map(|c| c + MARGIN_M);
    let mut shells = Vec::new();
    // A box without extent has no shells; the figures do not need it.
    if let Ok(mut grid) = DoseGrid::covering(low, high, SPACING_M) {
        grid.add(kernel, seeds);
        shells.extend((0..LEVELS.len()).map(|level| shell(&grid, level, prescription_gy)));
    }
    let dvhs = figures::dvhs(&task.scene, kernel, seeds);
    let target = dvhs.first();
    DoseResult {
        number: task.number,
        of: task.request.of,
        seeds: seeds.len(),
        body_moved_m: task.request.body_moved_m,
        source: if source.model == task.request.source {
            format!("{} {}", source.nuclide, source.model)
        } else {
            format!("{} {} (for {})", source.nuclide, source.model, task.request.source)
        },
        prescription_gy,
        shells,
        figures: figures::figures(&dvhs, prescription_gy),
        target_dvh: target.map_or(Vec::new(), |(_, dvh)| figures::curve(dvh, prescription_gy)),
    }
}

fn shell(grid: &DoseGrid, level: usize, prescription_gy: f64) -> IsodoseShell {
    let surface = isodose(grid, LEVELS[level] * prescription_gy);
    let points_m: Vec<[f32; 3]> = surface.points_m.iter().map(|p| p.map(|c| c as f32)).collect();
    let triangles: Vec<[u32; 3]> = surface.triangles.iter().map(|t| t.map(|i| i as u32)).collect();
    IsodoseShell {
        level,
        indices: mesh::indices(&triangles, points_m.len()),
        vertices: mesh::Surface::new(&points_m, &triangles).into_vertices(),
        points_m,
        triangles,
    }
}

#[cfg(test)]
mod tests;
