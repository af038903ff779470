//! Small bodies that the tests of scene and tissue share.

use super::{Labels, Structure};
use crate::limits::AxisLimits;
use stylet_random::Random;

fn labels(dims: [usize; 3], is_tissue: impl Fn([usize; 3]) -> bool) -> Labels {
    let [nx, ny, _] = dims;
    let cell = |n: usize| [n % nx, n / nx % ny, n / (nx * ny)];
    let count = dims.iter().product();
    Labels {
        dims,
        spacing_m: 1.5e-3,
        cells: (0..count).map(|n| u8::from(is_tissue(cell(n)))).collect(),
        structures: Vec::new(),
    }
}

pub fn block(dims: [usize; 3]) -> Labels {
    labels(dims, |_| true)
}

/// Returns a block with a tunnel through it along z and a notch in its side: neither convex nor simply connected.
pub fn with_hole() -> Labels {
    labels([14, 12, 10], |[i, j, k]| {
        let tunnel = (5..9).contains(&i) && (4..8).contains(&j);
        let notch = i < 6 && (3..7).contains(&k) && j < 3;
        !tunnel && !notch
    })
}

/// Returns a U whose arms meet only at one end: straight lines between them leave the body.
pub fn horseshoe() -> Labels {
    labels([13, 4, 15], |[i, _, k]| k < 4 || !(4..9).contains(&i))
}

pub fn two_parts() -> Labels {
    labels([15, 8, 8], |[i, _, _]| i != 7)
}

/// Keeps cells at random, so that every way cubes can meet occurs.
pub fn speckle(seed: u64) -> Labels {
    let mut random = Random(seed);
    let keep: Vec<bool> = (0..9 * 9 * 9).map(|_| random.unit() < 0.6).collect();
    labels([9, 9, 9], |[i, j, k]| keep[i + 9 * j + 81 * k])
}

/// Returns a stiff layer, anisotropic, in soft tissue.
pub fn layers() -> Labels {
    let mut labels = labels([12, 9, 10], |_| true);
    for (n, cell) in labels.cells.iter_mut().enumerate() {
        if (4..7).contains(&(n % 12)) || n / 108 == 7 {
            *cell = 2;
        }
    }
    labels.structures = vec![Structure::soft("soft", 1), Structure::soft("stiff", 2)];
    let axis = |min_stretch, max_stretch, shear_deg| AxisLimits {
        min_stretch,
        max_stretch,
        shear_deg,
    };
    labels.structures[1].material.limits = Some([axis(0.9, 1.1, 5.0), axis(0.95, 1.02, 10.0), axis(0.8, 1.3, 3.0)]);
    labels
}

/// Returns soft tissue between a fixed wall and a fixed bar.
pub fn bone() -> Labels {
    let mut labels = labels([12, 9, 10], |_| true);
    for (n, cell) in labels.cells.iter_mut().enumerate() {
        let (i, j, k) = (n % 12, n / 12 % 9, n / 108);
        if k == 0 || (i > 8 && (6..8).contains(&j)) {
            *cell = 2;
        }
    }
    labels.structures = vec![Structure::soft("soft", 1), Structure::soft("bone", 2)];
    labels.structures[1].material.fixed = true;
    labels
}
