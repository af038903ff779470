//! The dose computed in the background, against the formula.

use super::*;
use bytemuck::Zeroable;
use std::time::{Duration, Instant};
use stylet_dose::report::Judge;
use stylet_implant::plan::Anatomy;
use stylet_shm_schema::{SceneHeader, role};

fn pose(z_m: f64) -> SeedPose {
    SeedPose {
        position_m: [0.02, 0.02, z_m],
        axis: [0.0, 0.0, 1.0],
        dropped_at_m: [0.02, 0.02, z_m],
    }
}

fn in_tissue(poses: &[SeedPose]) -> DoseRequest {
    let planned = Prescribed {
        strength_u: 0.5,
        ..Default::default()
    };
    DoseRequest::in_tissue(poses, &planned)
}

fn scene() -> Arc<SceneModel> {
    let mut header = SceneHeader::zeroed();
    header.labels.dims = [20, 20, 20];
    (header.labels.origin_m, header.labels.spacing_m) = ([1e-3; 3], 2e-3);
    (header.target_lower_m, header.target_upper_m) = ([0.0; 3], [0.04; 3]);
    header.structure_count = 1;
    header.structures[0].role = role::TARGET;
    (header.spacing_m, header.body_triangle_count) = (2e-3, 12);
    // A box through the middles of the outermost elements.
    let corner = |n: u32| [n & 1, n >> 1 & 1, n >> 2].map(|far| if far == 1 { 0.039 } else { 0.001 });
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Arc::new(SceneModel::new(
        header,
        (0..8).map(corner).collect(),
        triangles,
        vec![1; 8000],
    ))
}

fn wait(worker: &mut DoseWorker, scene: &Arc<SceneModel>, poses: &[SeedPose]) -> Arc<DoseResult> {
    let start = Instant::now();
    loop {
        worker.take(Some(scene), &in_tissue(poses));
        if let Some(picture) = worker.latest()
            && picture.seeds == poses.len()
            && !worker.is_computing()
        {
            return picture.clone();
        }
        assert!(start.elapsed() < Duration::from_secs(20), "no dose arrived");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn the_shell_of_a_seed_lies_where_the_formula_gives_that_dose() {
    let (scene, poses) = (scene(), [pose(0.02)]);
    let mut worker = DoseWorker::default();
    let picture = wait(&mut worker, &scene, &poses);
    let source = Source::parse(include_str!("../../dose/sources/i125_6711.toml")).expect("checked in");
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let shell = &picture.shells[0];
    assert!(!shell.points_m.is_empty());
    // At most a voxel from the formula's surface: one voxel nearer to the seed the dose is higher,
    // one farther it is lower.
    let level_gy = 0.5 * 145.0;
    for p in &shell.points_m {
        let out: Vec<f64> = (0..3).map(|a| f64::from(p[a]) - poses[0].position_m[a]).collect();
        let r = out.iter().map(|c| c * c).sum::<f64>().sqrt();
        let dose_at = |r_m: f64| {
            let place = [0, 1, 2].map(|a| poses[0].position_m[a] + out[a] / r * r_m);
            kernel.exact_at_gy(&seed_of(&poses[0], 0.5), place)
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

/// Guards against a D90 of 139.0 Gy in the window and of 137.6 Gy on the page.
#[test]
fn figures_are_those_of_the_debrief() {
    let (scene, poses) = (scene(), [pose(0.012), pose(0.02), pose(0.028)]);
    let window = wait(&mut DoseWorker::default(), &scene, &poses);
    let seeds = poses.map(|pose| seed_of(&pose, 0.5));
    let structures = Anatomy::of(&scene).unwrap().structures();
    let judge = Judge::new(structures, None, &[], window.prescription_gy, &seeds, 1000).unwrap();
    let kernel = DoseKernel::new(&Source::known(USUAL_SOURCE).unwrap(), Interval::ALL);
    let page = judge.figures(&judge.judge(&kernel, &seeds));
    assert_eq!(window.figures, page);
    assert!(page[0].value > 1.0 && page[1].value > 0.1, "{page:?}");
}

#[test]
fn dose_is_recomputed_only_when_seeds_change() {
    let scene = scene();
    let mut worker = DoseWorker::default();
    let first = wait(&mut worker, &scene, &[pose(0.02)]).number;
    let same = wait(&mut worker, &scene, &[pose(0.0201)]).number;
    assert_eq!(first, same, "a tenth of a millimetre");
    worker.take(Some(&scene), &in_tissue(&[pose(0.023)]));
    assert!(worker.is_computing());
    let two = wait(&mut worker, &scene, &[pose(0.023), pose(0.03)]);
    assert_eq!(two.seeds, 2);
    worker.take(Some(&scene), &in_tissue(&[]));
    assert!(worker.latest().is_none(), "no seeds, no dose");
}
