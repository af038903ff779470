//! Figures of merit of a dose: measures of the structures with their limits, and the histogram of the target.

use stylet_anatomy::Organ;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Metric, Seed};
use stylet_host::link::SceneModel;
use stylet_shm_schema::{SceneHeader, role};

/// Cells of one structure that its histogram is made of, at most.
const MOST_POINTS: usize = 60_000;

/// One measure of one structure, ready to be shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of the structure, for people.
    pub structure: String,
    /// What is measured.
    pub metric: Metric,
    /// Its value in Gy, or in percent of the structure.
    pub value: f64,
    /// Its limit, where there is one.
    pub limit: Option<Limit>,
}

/// Limit of a measure, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// The value should be this or more.
    AtLeast(f64),
    /// The value should be this or less.
    AtMost(f64),
}

impl Limit {
    /// Whether a value keeps the limit.
    pub fn is_met(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
        }
    }
}

/// A structure whose dose is evaluated, known by its role or by a word in its name; limits after the ABS and AAPM TG-137
/// guidance for I-125 at 145 Gy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DoseStructure {
    Target,
    Urethra,
    Rectum,
}

impl DoseStructure {
    fn of(scene: &SceneHeader, place: usize) -> Option<Self> {
        let structure = scene.structures().get(place)?;
        let name = structure.name.read();
        if structure.role & role::TARGET != 0 {
            Some(Self::Target)
        } else if Organ::Urethra.is_mentioned_in(&name) {
            Some(Self::Urethra)
        } else {
            Organ::RectalWall.is_mentioned_in(&name).then_some(Self::Rectum)
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

/// Histograms of the target, then of the other evaluated structures that the scene has.
pub(super) fn dvhs(scene: &SceneModel, kernel: &DoseKernel, seeds: &[Seed]) -> Vec<(DoseStructure, Dvh)> {
    let header = &scene.header;
    let evaluated = [DoseStructure::Target, DoseStructure::Urethra, DoseStructure::Rectum];
    let points_of = |which: DoseStructure| {
        let is_in = |label: u8| label > 0 && DoseStructure::of(header, usize::from(label) - 1) == Some(which);
        cell_centres(scene, is_in)
    };
    evaluated
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

/// Middles of cells at rest, scene frame; an even selection where there are more than [`MOST_POINTS`].
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

pub(super) fn figures(dvhs: &[(DoseStructure, Dvh)], prescription_gy: f64) -> Vec<Figure> {
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

pub(super) fn curve(dvh: &Dvh, prescription_gy: f64) -> Vec<[f64; 2]> {
    const STEPS: usize = 120;
    let at = |i: usize| 3.0 * i as f64 / STEPS as f64;
    let share = |x: f64| dvh.at_least_m3(x * prescription_gy) / dvh.volume_m3();
    (0..=STEPS).map(|i| [at(i), share(at(i))]).collect()
}
