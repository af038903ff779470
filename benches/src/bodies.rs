//! The body that is measured: the gland at any spacing.

use stylet_sim::scene::{Labels, Scene};

/// Edge of the tip patch. Odd numbers of elements of 2.5, 1.5 and 1.0714 mm fill it exactly.
pub const PATCH_M: f64 = 7.5e-3;

/// Spacings at which the patch is a whole, odd number of elements wide.
pub const SPACINGS_M: [f64; 3] = [PATCH_M / 3.0, PATCH_M / 5.0, PATCH_M / 7.0];

/// Returns the paper's gland cut again with elements of `spacing_m`.
pub fn gland(spacing_m: f64) -> Scene {
    let paper = Scene::builtin("paper").expect("built in");
    let (low, high) = paper.lattice.bounds_m();
    let dims = [0, 1, 2].map(|a| ((high[a] - low[a]) / spacing_m).ceil() as usize);
    // Centred, so that the gland's two sides are cut alike.
    let origin = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a] - dims[a] as f64 * spacing_m));
    let cells = cells(dims).map(|cell| {
        let [i, j, k] = [0, 1, 2].map(|a| {
            let centre = origin[a] + (cell[a] as f64 + 0.5) * spacing_m;
            (centre / paper.lattice.spacing_m) as usize
        });
        u8::from(paper.lattice.element_of_cell(i, j, k).is_some())
    });
    let labels = Labels {
        dims,
        spacing_m,
        cells: cells.collect(),
        structures: Vec::new(),
    };
    Scene::from_labels("gland", &labels).expect("as valid as the paper's")
}

/// Iterates over all cells, x fastest.
pub fn cells(dims: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let [nx, ny, nz] = dims;
    (0..nx * ny * nz).map(move |n| [n % nx, n / nx % ny, n / (nx * ny)])
}
