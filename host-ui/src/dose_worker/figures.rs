//! Figures of merit of a dose: measures of the structures with their limits, and the histogram of
//! the target.

use stylet_dose::criteria::{DoseStructure, Figure};
use stylet_dose::{DoseKernel, DosePoints, Dvh, Seed};
use stylet_host::link::SceneModel;
use stylet_shm_schema::{SceneHeader, StructureInfo, role};

/// Most cells of one structure in its histogram.
const MOST_POINTS: usize = 60_000;

/// Returns the evaluated structure of each label.
fn evaluated(scene: &SceneHeader) -> Vec<Option<DoseStructure>> {
    let of = |structure: &StructureInfo| DoseStructure::of(&structure.name.read(), structure.role & role::TARGET != 0);
    scene.structures().iter().map(of).collect()
}

/// Computes the histograms of the target, then of the other evaluated structures of the scene.
pub(super) fn dvhs(scene: &SceneModel, kernel: &DoseKernel, seeds: &[Seed]) -> Vec<(DoseStructure, Dvh)> {
    let header = &scene.header;
    let all = [DoseStructure::Target, DoseStructure::Urethra, DoseStructure::Rectum];
    let evaluated = evaluated(header);
    let points_of = |which: DoseStructure| {
        let is_in = |label: u8| {
            let place = usize::from(label).checked_sub(1);
            place.and_then(|place| *evaluated.get(place)?) == Some(which)
        };
        cell_centres(scene, is_in)
    };
    all.into_iter()
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

/// Returns centres of cells at rest, in the scene frame; an even selection if there are more than
/// [`MOST_POINTS`].
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
    let figures = |(which, dvh): &(DoseStructure, Dvh)| which.figures(dvh, prescription_gy);
    dvhs.iter().flat_map(figures).collect()
}

pub(super) fn curve(dvh: &Dvh, prescription_gy: f64) -> Vec<[f64; 2]> {
    const STEPS: usize = 120;
    let at = |i: usize| 3.0 * i as f64 / STEPS as f64;
    let share = |x: f64| dvh.at_least_m3(x * prescription_gy) / dvh.volume_m3();
    (0..=STEPS).map(|i| [at(i), share(at(i))]).collect()
}
