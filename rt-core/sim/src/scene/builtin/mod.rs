//! Scenes that need no file, drawn by formula in the paper's grid.

use super::{Labels, SceneProblem, Structure};

mod full;
mod paper;
mod pelvis;
mod shape;

/// Voxels of the paper's volume; 3 x 3 voxels of a slice make one element.
const VOXELS: [usize; 3] = [323, 187, 176];
const VOXELS_PER_ELEMENT: usize = 3;
const DIMS: [usize; 3] = [
    VOXELS[0] / VOXELS_PER_ELEMENT,
    VOXELS[1] / VOXELS_PER_ELEMENT,
    VOXELS[2],
];
/// 19,304 elements of this edge are 49 cc.
const SPACING_M: f64 = 1.3641e-3;

/// Returns the labels of a scene by name; `None` for a name that is not one.
pub(super) fn labels(name: &str) -> Option<Result<Labels, Vec<SceneProblem>>> {
    match name {
        "paper" => Some(Ok(paper::labels())),
        "pelvis" => Some(pelvis::Pelvis::default().labels()),
        "full" => Some(Ok(full::labels())),
        _ => None,
    }
}

/// Labels by the place of each cell's centre, in elements from the middle of the grid.
fn draw(structures: Vec<Structure>, label_at: impl Fn([f64; 3]) -> u8) -> Labels {
    let mut cells = Vec::with_capacity(DIMS.iter().product());
    for k in 0..DIMS[2] {
        for j in 0..DIMS[1] {
            for i in 0..DIMS[0] {
                let cell = [i, j, k];
                let from_middle = [0, 1, 2].map(|axis| cell[axis] as f64 + 0.5 - 0.5 * DIMS[axis] as f64);
                cells.push(label_at(from_middle));
            }
        }
    }
    Labels {
        dims: DIMS,
        spacing_m: SPACING_M,
        cells,
        structures,
    }
}

#[cfg(test)]
mod times {
    use crate::scene::{Lattice, Scene, Surface};
    use std::time::Instant;

    /// `cargo test --profile quick -p stylet-sim --lib time_to_cut -- --ignored --nocapture`
    #[test]
    #[ignore = "a measurement"]
    fn time_to_cut() {
        for name in stylet_settings::BUILTIN_SCENES {
            for _ in 0..3 {
                let start = Instant::now();
                let labels = super::labels(name).expect("known").expect("valid");
                let drawn = start.elapsed();
                let lattice = Lattice::from_checked_labels(&labels);
                let cut = start.elapsed() - drawn;
                let surface = Surface::of(&lattice, &labels.structures);
                let meshed = start.elapsed() - drawn - cut;
                let whole = Instant::now();
                let scene = Scene::builtin(name).expect("built in");
                println!(
                    "{name}: drawn {drawn:.1?}, cut {cut:.1?}, surface {meshed:.1?} ({} vertices); all {:.1?}, {} elements",
                    surface.vertex_elements.len(),
                    whole.elapsed(),
                    scene.lattice.element_count()
                );
            }
        }
    }
}
