//! Dose of the seeds that lie in the tissue or are planned, computed on a thread of its own whenever they have changed.

use crate::view::mesh::{self, SurfaceVertex};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use stylet_dose::decay::Interval;
use stylet_dose::isodose::isodose;
use stylet_dose::{DoseGrid, DoseKernel, DosePoints, Dvh, Metric, Seed, Source};
use stylet_host::link::SceneModel;
use stylet_implant::plan::exchange::USUAL_SOURCE;
use stylet_shm_schema::{SceneHeader, SeedPose, role};

/// Doses that are drawn, as shares of the prescription.
pub const LEVELS: [f64; 4] = [0.5, 1.0, 1.5, 2.0];
/// Sources without a prescription of their own are drawn against this (I-125, AAPM TG-137).
const USUAL_PRESCRIPTION_GY: f64 = 145.0;
/// A seed that has moved less has the same dose as before, as far as one can see.
const SAME_PLACE_M: f64 = 0.2e-3;
/// Around the target, and between the voxels of what is drawn.
const MARGIN_M: f64 = 0.012;
const SPACING_M: f64 = 1.5e-3;
/// Cells of one structure that its histogram is made of, at most.
const MOST_POINTS: usize = 60_000;

/// A surface of one dose.
#[derive(Clone, Debug, Default)]
pub struct Shell {
    /// Which of [`LEVELS`].
    pub level: usize,
    pub points_m: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    /// As the card takes them: made here, because that takes longer than a frame has.
    pub vertices: Vec<SurfaceVertex>,
    pub indices: Vec<u32>,
}

/// One measure of one structure, ready to be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    pub structure: String,
    pub metric: Metric,
    /// Gy, or percent of the structure.
    pub value: f64,
    /// What it should be, and whether it must be at least or at most that.
    pub limit: Option<Limit>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    AtLeast(f64),
    AtMost(f64),
}

impl Limit {
    pub fn is_met(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
        }
    }
}

/// Whose dose it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoseOf {
    Tissue,
    Plan,
}

/// Seeds whose dose is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    pub of: DoseOf,
    /// Model of their source.
    pub source: String,
    /// Otherwise what is usual for it.
    pub prescription_gy: Option<f64>,
    pub seeds: Vec<Seed>,
}

impl Wanted {
    /// Of seeds as they lie, all of one strength and of the usual source.
    pub fn in_tissue(poses: &[SeedPose], strength_u: f64) -> Self {
        Self {
            of: DoseOf::Tissue,
            source: USUAL_SOURCE.to_owned(),
            prescription_gy: None,
            seeds: poses.iter().map(|p| seed(p, strength_u)).collect(),
        }
    }

    fn is_same(&self, other: &Self) -> bool {
        (self.of, &self.source, self.prescription_gy) == (other.of, &other.source, other.prescription_gy)
            && is_same(&self.seeds, &other.seeds)
    }
}

/// What is known of the dose of one set of seeds.
#[derive(Clone, Debug)]
pub struct DosePicture {
    pub number: u64,
    pub of: DoseOf,
    pub seeds: usize,
    /// Nuclide and model.
    pub source: String,
    pub prescription_gy: f64,
    pub shells: Vec<Shell>,
    pub figures: Vec<Figure>,
    /// Cumulative histogram of the target: share of the prescription, share of the volume.
    pub target_dvh: Vec<[f64; 2]>,
}

struct Request {
    number: u64,
    wanted: Wanted,
    scene: Arc<SceneModel>,
}

/// One set of seeds at a time; the newest waits until the one before is done.
pub struct DoseDesk {
    requests: Sender<Request>,
    pictures: Receiver<DosePicture>,
    computing: bool,
    asked: Option<(u64, u64, Wanted)>,
    number: u64,
    latest: Option<Arc<DosePicture>>,
    lost: bool,
}

impl DoseDesk {
    /// Without a thread there is no dose, and [`DoseDesk::trouble`] says so.
    pub fn new() -> Self {
        let (requests, work) = channel();
        let (done, pictures) = channel();
        let spawned = std::thread::Builder::new()
            .name("dose".to_owned())
            .spawn(move || compute_all(&work, &done));
        Self {
            requests,
            pictures,
            computing: false,
            asked: None,
            number: 0,
            latest: None,
            lost: spawned.is_err(),
        }
    }

    pub fn latest(&self) -> Option<&Arc<DosePicture>> {
        self.latest.as_ref()
    }

    pub fn is_computing(&self) -> bool {
        self.computing
    }

    pub fn trouble(&self) -> Option<&'static str> {
        self.lost.then_some("the dose is not computed: its thread has ended")
    }

    /// Asks for a new dose where seeds came, went or moved.
    pub fn take(&mut self, scene: Option<&Arc<SceneModel>>, wanted: &Wanted) {
        match self.pictures.try_recv() {
            Ok(picture) => {
                self.computing = false;
                // What was computed for seeds that are all gone by now is no longer true.
                self.latest = (picture.seeds > 0 && !wanted.seeds.is_empty()).then(|| Arc::new(picture));
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => self.lost = true,
        }
        // The dose of the plan says nothing of the seeds in the tissue.
        self.latest = self.latest.take().filter(|picture| picture.of == wanted.of);
        let Some(scene) = scene else { return };
        if wanted.seeds.is_empty() {
            (self.latest, self.asked) = (None, None);
            return;
        }
        let key = (scene.header.session_id, scene.header.generation);
        let known = self
            .asked
            .as_ref()
            .is_some_and(|(session, generation, asked)| (*session, *generation) == key && asked.is_same(wanted));
        if known || self.computing || self.lost {
            return;
        }
        self.number += 1;
        let request = Request {
            number: self.number,
            wanted: wanted.clone(),
            scene: scene.clone(),
        };
        self.computing = self.requests.send(request).is_ok();
        self.asked = Some((key.0, key.1, wanted.clone()));
    }
}

impl Default for DoseDesk {
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

fn compute_all(work: &Receiver<Request>, done: &Sender<DosePicture>) {
    let mut known: Option<(String, Source, DoseKernel)> = None;
    while let Ok(request) = work.recv() {
        let model = &request.wanted.source;
        if known.as_ref().is_none_or(|(name, _, _)| name != model) {
            // The usual one is part of the program; a test reads it.
            let Some(source) = Source::known(model).or_else(|| Source::known(USUAL_SOURCE)) else {
                return;
            };
            let kernel = DoseKernel::new(&source, Interval::ALL);
            known = Some((model.clone(), source, kernel));
        }
        let Some((_, source, kernel)) = &known else { return };
        if done.send(picture(&request, source, kernel)).is_err() {
            return;
        }
    }
}

fn picture(request: &Request, source: &Source, kernel: &DoseKernel) -> DosePicture {
    let seeds = &request.wanted.seeds;
    let usual_gy = source.prescription_gy.unwrap_or(USUAL_PRESCRIPTION_GY);
    let prescription_gy = request.wanted.prescription_gy.unwrap_or(usual_gy);
    let header = &request.scene.header;
    let low = header.target_lower_m.map(|c| c - MARGIN_M);
    let high = header.target_upper_m.map(|c| c + MARGIN_M);
    let mut shells = Vec::new();
    // A box that is no box has no shells; the figures do not need it.
    if let Ok(mut grid) = DoseGrid::covering(low, high, SPACING_M) {
        grid.add(kernel, seeds);
        shells.extend((0..LEVELS.len()).map(|level| shell(&grid, level, prescription_gy)));
    }
    let dvhs = dvhs(&request.scene, kernel, seeds);
    let target = dvhs.first();
    DosePicture {
        number: request.number,
        of: request.wanted.of,
        seeds: seeds.len(),
        source: if source.model == request.wanted.source {
            format!("{} {}", source.nuclide, source.model)
        } else {
            format!("{} {} (for {})", source.nuclide, source.model, request.wanted.source)
        },
        prescription_gy,
        shells,
        figures: figures(&dvhs, prescription_gy),
        target_dvh: target.map_or(Vec::new(), |(_, dvh)| curve(dvh, prescription_gy)),
    }
}

fn shell(grid: &DoseGrid, level: usize, prescription_gy: f64) -> Shell {
    let surface = isodose(grid, LEVELS[level] * prescription_gy);
    let points_m: Vec<[f32; 3]> = surface.points_m.iter().map(|p| p.map(|c| c as f32)).collect();
    let triangles: Vec<[u32; 3]> = surface.triangles.iter().map(|t| t.map(|i| i as u32)).collect();
    Shell {
        level,
        indices: mesh::indices(&triangles, points_m.len()),
        vertices: mesh::Surface::new(&points_m, &triangles).into_vertices(),
        points_m,
        triangles,
    }
}

/// What is judged in a structure, by a word in its name or by being the target; limits after the ABS and AAPM TG-137
/// guidance for I-125 at 145 Gy.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Judged {
    Target,
    Urethra,
    Rectum,
}

impl Judged {
    fn of(scene: &SceneHeader, place: usize) -> Option<Self> {
        let structure = scene.structures().get(place)?;
        let name = structure.name.read().to_lowercase();
        if structure.role & role::TARGET != 0 {
            Some(Self::Target)
        } else if name.contains("urethra") {
            Some(Self::Urethra)
        } else {
            name.contains("rect").then_some(Self::Rectum)
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Target => "target",
            Self::Urethra => "urethra",
            Self::Rectum => "rectum",
        }
    }

    fn metrics(self, prescription_gy: f64) -> Vec<(Metric, Option<Limit>)> {
        let dose = |share: f64| Metric::DoseToShare(share);
        let volume = |share: f64| Metric::VolumeAtShare(share);
        match self {
            Self::Target => vec![
                (dose(0.9), Some(Limit::AtLeast(prescription_gy))),
                (volume(1.0), Some(Limit::AtLeast(95.0))),
                (volume(1.5), Some(Limit::AtMost(60.0))),
            ],
            Self::Urethra => vec![
                (dose(0.1), Some(Limit::AtMost(1.5 * prescription_gy))),
                (dose(0.3), Some(Limit::AtMost(1.3 * prescription_gy))),
            ],
            Self::Rectum => vec![(Metric::DoseToVolume { m3: 2e-6 }, Some(Limit::AtMost(prescription_gy)))],
        }
    }
}

/// Target first, then what else is judged, where the scene has it.
fn dvhs(scene: &SceneModel, kernel: &DoseKernel, seeds: &[Seed]) -> Vec<(Judged, Dvh)> {
    let header = &scene.header;
    let judged = [Judged::Target, Judged::Urethra, Judged::Rectum];
    let points_of = |which: Judged| {
        let is_in = |label: u8| label > 0 && Judged::of(header, usize::from(label) - 1) == Some(which);
        cell_centres(scene, is_in)
    };
    judged
        .into_iter()
        .filter_map(|which| {
            let points_m = points_of(which);
            let mut points = DosePoints::new(&points_m);
            points.add(kernel, seeds);
            let cell_m3 = header.labels.spacing_m.powi(3);
            let dvh = Dvh::new(points.dose_gy(), &vec![cell_m3; points_m.len()])?;
            Some((which, dvh))
        })
        .collect()
}

/// Middles of cells at rest; where there are very many, every so many of them.
fn cell_centres(scene: &SceneModel, is_in: impl Fn(u8) -> bool) -> Vec<[f64; 3]> {
    let grid = &scene.header.labels;
    let [nx, ny, _] = grid.dims.map(|d| d as usize);
    let cells: Vec<usize> = (0..scene.labels.len()).filter(|&n| is_in(scene.labels[n])).collect();
    let every = cells.len().div_ceil(MOST_POINTS).max(1);
    let place = |n: usize| {
        let at = [n % nx, n / nx % ny, n / nx / ny];
        [0, 1, 2].map(|a| grid.origin_m[a] + at[a] as f64 * grid.spacing_m)
    };
    cells.into_iter().step_by(every).map(place).collect()
}

fn figures(dvhs: &[(Judged, Dvh)], prescription_gy: f64) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (which, dvh) in dvhs {
        for (metric, limit) in which.metrics(prescription_gy) {
            // A structure smaller than the volume asked for has no such figure.
            if let Some(value) = metric.of(dvh, prescription_gy).main() {
                figures.push(Figure {
                    structure: which.name().to_owned(),
                    metric,
                    value,
                    limit,
                });
            }
        }
    }
    figures
}

fn curve(dvh: &Dvh, prescription_gy: f64) -> Vec<[f64; 2]> {
    const STEPS: usize = 120;
    let at = |i: usize| 3.0 * i as f64 / STEPS as f64;
    let share = |x: f64| dvh.at_least_m3(x * prescription_gy) / dvh.volume_m3();
    (0..=STEPS).map(|i| [at(i), share(at(i))]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use std::time::{Duration, Instant};

    fn pose(z_m: f64) -> SeedPose {
        SeedPose {
            position_m: [0.02, 0.02, z_m],
            axis: [0.0, 0.0, 1.0],
            dropped_at_m: [0.02, 0.02, z_m],
        }
    }

    fn scene() -> Arc<SceneModel> {
        let mut header = SceneHeader::zeroed();
        header.labels.dims = [20, 20, 20];
        (header.labels.origin_m, header.labels.spacing_m) = ([1e-3; 3], 2e-3);
        (header.target_lower_m, header.target_upper_m) = ([0.0; 3], [0.04; 3]);
        header.structure_count = 1;
        header.structures[0].role = role::TARGET;
        let model = SceneModel {
            header,
            rest_m: Vec::new(),
            triangles: Vec::new(),
            labels: vec![1; 8000],
        };
        Arc::new(model)
    }

    fn wait(desk: &mut DoseDesk, scene: &Arc<SceneModel>, poses: &[SeedPose]) -> Arc<DosePicture> {
        let start = Instant::now();
        loop {
            desk.take(Some(scene), &Wanted::in_tissue(poses, 0.5));
            if let Some(picture) = desk.latest()
                && picture.seeds == poses.len()
                && !desk.is_computing()
            {
                return picture.clone();
            }
            assert!(start.elapsed() < Duration::from_secs(20), "no dose came");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    #[test]
    fn the_shell_of_a_seed_lies_where_the_formula_gives_that_dose() {
        let (scene, poses) = (scene(), [pose(0.02)]);
        let mut desk = DoseDesk::new();
        let picture = wait(&mut desk, &scene, &poses);
        let source = Source::parse(include_str!("../../sources/i125_6711.toml")).expect("checked in");
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let shell = &picture.shells[0];
        assert!(!shell.points_m.is_empty());
        // No farther from the formula's surface than a voxel: one voxel nearer to the seed there is more, one farther less.
        let level_gy = 0.5 * 145.0;
        for p in &shell.points_m {
            let out: Vec<f64> = (0..3).map(|a| f64::from(p[a]) - poses[0].position_m[a]).collect();
            let r = out.iter().map(|c| c * c).sum::<f64>().sqrt();
            let dose_at = |r_m: f64| {
                let place = [0, 1, 2].map(|a| poses[0].position_m[a] + out[a] / r * r_m);
                kernel.exact_at_gy(&seed(&poses[0], 0.5), place)
            };
            let (nearer, farther) = (dose_at(r - SPACING_M), dose_at(r + SPACING_M));
            assert!(
                nearer > level_gy && farther < level_gy,
                "{nearer} to {farther} Gy about {p:?}"
            );
        }
        assert_eq!(picture.figures.len(), 3, "{:?}", picture.figures);
        assert!(picture.figures.iter().all(|f| f.structure == "target"));
    }

    #[test]
    fn it_is_computed_again_only_when_a_seed_has_moved_or_come_or_gone() {
        let scene = scene();
        let mut desk = DoseDesk::new();
        let first = wait(&mut desk, &scene, &[pose(0.02)]).number;
        let same = wait(&mut desk, &scene, &[pose(0.0201)]).number;
        assert_eq!(first, same, "a tenth of a millimetre");
        desk.take(Some(&scene), &Wanted::in_tissue(&[pose(0.023)], 0.5));
        assert!(desk.is_computing());
        let two = wait(&mut desk, &scene, &[pose(0.023), pose(0.03)]);
        assert_eq!(two.seeds, 2);
        desk.take(Some(&scene), &Wanted::in_tissue(&[], 0.5));
        assert!(desk.latest().is_none(), "no seeds, no dose");
    }
}
