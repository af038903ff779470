//! Isodose surfaces: triangles around the region above a dose.

use super::DoseGrid;
use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use rayon::prelude::*;

/// Surface in the frame of the grid (m), normals outwards by the order of the corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Isodose {
    /// Corners, in m.
    pub points_m: Vec<[f64; 3]>,
    /// Triangles, as indices into `points_m`.
    pub triangles: Vec<[usize; 3]>,
}

/// Returns the surface on which the dose is `level_gy`; closed along the faces of the grid where
/// the dose there is higher.
///
/// Uses naive surface nets on the logarithm of the dose, which is nearly linear between voxels,
/// unlike the dose itself.
pub fn isodose(grid: &DoseGrid, level_gy: f64) -> Isodose {
    // An empty border, so that the surface closes; the crate makes no faces in the last layer.
    let dims = grid.dims().map(|d| d as u32 + 3);
    let shape = RuntimeShape::<u32, 3>::new(dims);
    let mut field = vec![NOTHING; shape.usize()];
    let [nx, ny, _] = grid.dims();
    for (row, doses) in grid.dose_gy().chunks(nx).enumerate() {
        let first = shape.linearize([1, (row % ny) as u32 + 1, (row / ny) as u32 + 1]) as usize;
        for (value, dose) in field[first..first + nx].iter_mut().zip(doses) {
            *value = ((level_gy / dose.max(f64::MIN_POSITIVE)).ln() as f32).clamp(-NOTHING, NOTHING);
        }
    }
    let mut buffer = SurfaceNetsBuffer::default();
    surface_nets(&field, &shape, [0; 3], dims.map(|d| d - 1), &mut buffer);
    let (origin, spacing) = (grid.centre_m([0; 3]), grid.spacing_m());
    let place = |p: &[f32; 3]| [0, 1, 2].map(|a| origin[a] + (f64::from(p[a]) - 1.0) * spacing[a]);
    Isodose {
        points_m: buffer
            .positions
            .par_iter()
            .map(|p| onto_surface(grid, level_gy, place(p)))
            .collect(),
        triangles: buffer
            .indices
            .chunks_exact(3)
            .map(|t| [0, 1, 2].map(|c| t[c] as usize))
            .collect(),
    }
}

/// Moves a point of the net onto the surface by Newton's method; on a curved surface such points
/// lie inside.
fn onto_surface(grid: &DoseGrid, level_gy: f64, start_m: [f64; 3]) -> [f64; 3] {
    let spacing = grid.spacing_m();
    let (low, high) = (grid.centre_m([0; 3]), grid.centre_m(grid.dims().map(|d| d - 1)));
    let mut p = start_m;
    for _ in 0..NEWTON_STEPS {
        if (0..3).any(|a| p[a] < low[a] || p[a] > high[a]) {
            // Along a face of the grid the surface follows the face.
            return start_m;
        }
        let above = |p: [f64; 3]| (grid.at_gy(p) / level_gy).max(f64::MIN_POSITIVE).ln();
        let slope_per_voxel = [0, 1, 2].map(|a| {
            let beside = |voxels: f64| {
                let mut q = p;
                q[a] += voxels * spacing[a];
                above(q)
            };
            (beside(PROBE) - beside(-PROBE)) / (2.0 * PROBE)
        });
        let square: f64 = slope_per_voxel.iter().map(|s| s * s).sum();
        let value = above(p);
        if square < 1e-12 {
            return p;
        }
        for a in 0..3 {
            p[a] -= (value * slope_per_voxel[a] / square).clamp(-0.5, 0.5) * spacing[a];
        }
    }
    p
}

const NEWTON_STEPS: usize = 2;
/// Distance in voxels for the difference quotient of the slope.
const PROBE: f64 = 0.25;

/// Logarithm of the level over the dose at zero dose.
const NOTHING: f32 = 50.0;
