//! Dose of the placed or planned seeds, computed on a separate thread whenever they change.

mod figures;

use figures::Counted;
use std::sync::{Arc, Mutex, PoisonError};
use stylet_base::job::{Job, JobUpdate};
pub use stylet_dose::criteria::Figure;
use stylet_dose::decay::Interval;
use stylet_dose::isodose::isodose;
use stylet_dose::{DoseGrid, DoseKernel, Seed, Source};
use stylet_host::link::SceneModel;
use stylet_implant::plan::ImplantPlan;
use stylet_implant::plan::exchange::USUAL_SOURCE;
use stylet_implant::score::seed_of;
use stylet_shm_schema::{Prescribed, SceneId, SeedPose};
use stylet_surfaces::mesh::{self, SurfaceVertex};

/// Drawn dose levels, as shares of the prescription.
pub const LEVELS: [f64; 4] = [0.5, 1.0, 1.5, 2.0];
/// Prescription assumed for sources without one (I-125, AAPM TG-137).
const USUAL_PRESCRIPTION_GY: f64 = 145.0;
/// Movement of a seed below which its dose looks the same.
const SAME_PLACE_M: f64 = 0.2e-3;
/// Margin of the grid around the box of the target.
const MARGIN_M: f64 = 0.012;
/// Voxel spacing for isodose surfaces.
const SPACING_M: f64 = 1.5e-3;

/// Isodose surface.
#[derive(Clone, Debug, Default)]
pub struct IsodoseShell {
    /// Index into [`LEVELS`].
    pub level: usize,
    /// Vertices, in the frame of the scene's body.
    pub points_m: Vec<[f32; 3]>,
    /// Triangles, as indices into `points_m`.
    pub triangles: Vec<[u32; 3]>,
    /// Vertices for the graphics card, made here because that takes longer than a frame.
    pub vertices: Vec<SurfaceVertex>,
    /// Indices for the graphics card.
    pub indices: Vec<u32>,
}

/// Seeds of a dose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoseOf {
    /// Seeds in the tissue.
    Tissue,
    /// Seeds of the plan.
    Plan,
}

impl DoseOf {
    /// Returns whose dose it is, in a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tissue => "delivered",
            Self::Plan => "planned",
        }
    }
}

/// Seeds whose dose is requested.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseRequest {
    /// Choice of seeds.
    pub of: DoseOf,
    /// Model of their source.
    pub source: String,
    /// Prescribed dose; without one, that of the source.
    pub prescription_gy: Option<f64>,
    /// Displacement of the body by an exercise, m.
    pub body_moved_m: [f64; 3],
    /// Place, axis and strength of each seed, in the frame of the scene's body.
    pub seeds: Vec<Seed>,
}

impl DoseRequest {
    /// Creates a request for placed seeds, with the planned source, strength and prescription, or
    /// the usual source if unknown.
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
            seeds: poses.iter().map(|p| seed_of(p, planned.strength_u)).collect(),
        }
    }

    /// Creates a request for the seeds of a plan. They follow the template, however the body was
    /// moved.
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
    /// Number that grows with every result.
    pub number: u64,
    /// Choice of seeds.
    pub of: DoseOf,
    /// Number of seeds.
    pub seeds: usize,
    /// Displacement of the body at the time, m.
    pub body_moved_m: [f64; 3],
    /// Nuclide and model.
    pub source: String,
    /// Dose to which the levels refer.
    pub prescription_gy: f64,
    /// Shells, one for each of [`LEVELS`]; none if the target has no extent.
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
    /// Returns the offset from the scene's body to the place where this dose is drawn, m. Placed
    /// seeds follow the body, planned seeds do not.
    pub fn shift_m(&self, body_moved_m: [f64; 3]) -> [f64; 3] {
        match self.of {
            DoseOf::Tissue => body_moved_m,
            DoseOf::Plan => self.body_moved_m,
        }
    }
}

/// Computes doses on a thread: one set of seeds at a time, then the newest request.
#[derive(Default)]
pub struct DoseWorker {
    /// The dose being computed.
    computing: Option<Job<DoseResult>>,
    /// What a dose leaves for the next one.
    kept: Arc<Mutex<Kept>>,
    /// Session, generation of the scene, and the last request.
    requested: Option<(SceneId, DoseRequest)>,
    number: u64,
    latest: Option<Arc<DoseResult>>,
    /// True once a thread has ended without its dose.
    lost: bool,
}

impl DoseWorker {
    /// Returns the newest result, while it answers the last request.
    pub fn latest(&self) -> Option<&Arc<DoseResult>> {
        self.latest.as_ref()
    }

    /// Returns whether a dose is being computed.
    #[cfg(test)]
    fn is_computing(&self) -> bool {
        self.computing.is_some()
    }

    /// Returns the reason why there is no dose, if there is none.
    pub fn trouble(&self) -> Option<&'static str> {
        self.lost.then_some("The dose is not computed: its thread has ended.")
    }

    /// Takes a finished result, and requests a new one if seeds were added, removed or moved. Never
    /// waits.
    pub fn take(&mut self, scene: Option<&Arc<SceneModel>>, request: &DoseRequest) {
        match self.computing.as_ref().map(Job::poll) {
            Some(JobUpdate::Message(result)) => {
                self.computing = None;
                // If all its seeds have been removed since, a dose is obsolete.
                self.latest = (result.seeds > 0 && !request.seeds.is_empty()).then(|| Arc::new(result));
            }
            Some(JobUpdate::Ended) => (self.computing, self.lost) = (None, true),
            Some(JobUpdate::Pending) | None => {}
        }
        // The dose of the plan does not describe the seeds in the tissue.
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
        if known || self.computing.is_some() || self.lost {
            return;
        }
        self.number += 1;
        let task = DoseTask {
            number: self.number,
            request: request.clone(),
            scene: scene.clone(),
        };
        let kept = Arc::clone(&self.kept);
        self.computing = Some(Job::begin("dose", move |result, _| {
            // A dose that failed left the kernel and the volumes as they were.
            let kept = &mut *kept.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(dose) = kept.dose(&task) {
                // The window may have closed; the dose is then dropped.
                let _ = result.send(dose);
            }
        }));
        self.requested = Some((key, request.clone()));
    }
}

fn is_same(a: &[Seed], b: &[Seed]) -> bool {
    let near = |a: &Seed, b: &Seed| {
        let d2: f64 = (0..3).map(|i| (a.position_m[i] - b.position_m[i]).powi(2)).sum();
        d2.sqrt() < SAME_PLACE_M && a.strength_u == b.strength_u
    };
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| near(a, b))
}

/// Kernel of a source and volumes of a scene, which take longer than a dose.
#[derive(Default)]
struct Kept {
    known: Option<(String, Source, DoseKernel)>,
    counted: Option<(SceneId, Counted)>,
}

impl Kept {
    /// Computes a dose; `None` without any source.
    fn dose(&mut self, task: &DoseTask) -> Option<DoseResult> {
        let model = &task.request.source;
        if self.known.as_ref().is_none_or(|(name, _, _)| name != model) {
            // The usual source is part of the program; a test reads it.
            let source = Source::known(model).or_else(|| Source::known(USUAL_SOURCE))?;
            let kernel = DoseKernel::new(&source, Interval::ALL);
            self.known = Some((model.clone(), source, kernel));
        }
        let scene = task.scene.header.id();
        if self.counted.as_ref().is_none_or(|(of, _)| *of != scene) {
            self.counted = Some((scene, Counted::of(&task.scene)));
        }
        let ((_, source, kernel), (_, counted)) = (self.known.as_ref()?, self.counted.as_ref()?);
        Some(compute(task, source, kernel, counted))
    }
}

fn compute(task: &DoseTask, source: &Source, kernel: &DoseKernel, counted: &Counted) -> DoseResult {
    let seeds = &task.request.seeds;
    let usual_gy = source.prescription_gy.unwrap_or(USUAL_PRESCRIPTION_GY);
    let prescription_gy = task.request.prescription_gy.unwrap_or(usual_gy);
    let header = &task.scene.header;
    let low = header.target_lower_m.map(|c| c - MARGIN_M);
    let high = header.target_upper_m.map(|c| c + MARGIN_M);
    let mut shells = Vec::new();
    // A box without extent has no shells, but it has figures.
    if let Ok(mut grid) = DoseGrid::covering(low, high, SPACING_M) {
        grid.add(kernel, seeds);
        shells.extend((0..LEVELS.len()).map(|level| shell(&grid, level, prescription_gy)));
    }
    let (figures, target_dvh) = counted.figures(kernel, seeds, prescription_gy);
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
        figures,
        target_dvh,
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
