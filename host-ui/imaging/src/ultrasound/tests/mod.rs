//! Pictures against closed forms and a slow computation of the same.

mod metal;
mod pose;
mod speckle;
mod speed;
mod texture;
mod twin;

use super::{Plane, Pose, Probe, Scanner, View};
use crate::{Body, Gpu, Tissue};
use nalgebra::Vector3;
use stylet_shm_schema::GridInfo;
use stylet_surfaces::field::Field;

const SPACING_M: f64 = 1e-3;

/// Returns the device that gives the same pictures everywhere.
fn scanner() -> Scanner {
    Scanner::new(Gpu::headless(true).expect("Mesa's software driver"))
}

/// Returns a block of tissues, a cell each millimetre, by a function of the place (m); the probe's
/// axis lies in its lower part.
fn block(tissue: [Tissue; 3], label: impl Fn(Vector3<f64>) -> u8) -> Body {
    let dims = [120, 100, 90];
    let grid = GridInfo {
        dims,
        reserved: 0,
        origin_m: [-60e-3, -20e-3, -45e-3].map(|c| c + 0.5 * SPACING_M),
        spacing_m: SPACING_M,
    };
    let [wide, high, _] = dims.map(|d| d as usize);
    let place = |n: usize| {
        let at = Vector3::new(n % wide, n / wide % high, n / wide / high);
        at.map(|c| c as f64 * SPACING_M) + Vector3::from(grid.origin_m)
    };
    let cells = (0..dims.iter().product::<u32>() as usize)
        .map(|n| label(place(n)))
        .collect();
    let mut tissues = [tissue[0]; 256];
    tissues[..3].copy_from_slice(&tissue);
    Body::new(grid, cells, tissues).expect("cells of the grid")
}

/// Returns displacements every 8 mm over the block.
fn field(displacement: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Field {
    let info = GridInfo {
        dims: [16, 14, 13],
        reserved: 0,
        origin_m: [-60e-3, -20e-3, -48e-3],
        spacing_m: 8e-3,
    };
    let place = |n: usize| {
        let at = Vector3::new(n % 16, n / 16 % 14, n / 16 / 14);
        at.map(|c| c as f64 * info.spacing_m) + Vector3::from(info.origin_m)
    };
    let nodes: Vec<[f32; 3]> = (0..16 * 14 * 13)
        .map(|n| displacement(place(n)).map(|c| c as f32).into())
        .collect();
    Field::of(info, &nodes).expect("one for each node")
}

fn plane(view: View) -> Plane {
    Plane {
        pose: Pose {
            middle_m: Vector3::zeros(),
            axis: Vector3::z(),
            up: Vector3::y(),
        },
        view,
        probe: Probe::default(),
        depth_m: 60e-3,
        pixels: [640, 480],
    }
}
