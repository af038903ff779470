//! Isodose surfaces: triangles around all that gets a dose.

use super::DoseGrid;
use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};

/// A surface in the frame of the grid (m), normals outwards by the order of the corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Isodose {
    pub points_m: Vec<[f64; 3]>,
    pub triangles: Vec<[usize; 3]>,
}

/// The surface on which the dose is `level_gy`; closed along the faces of the grid where the dose there is higher.
///
/// Naive surface nets on the logarithm of the dose, which is nearly linear between voxels where the dose itself is not.
pub fn isodose(grid: &DoseGrid, level_gy: f64) -> Isodose {
    // One layer of nothing around the grid, so that the surface closes.
    let dims = grid.dims().map(|d| d as u32 + 2);
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
    let strides = [1, dims[0] as usize, (dims[0] * dims[1]) as usize];
    Isodose {
        points_m: buffer
            .positions
            .iter()
            .map(|p| place(&onto_surface(&field, strides, *p)))
            .collect(),
        triangles: buffer
            .indices
            .chunks_exact(3)
            .map(|t| [0, 1, 2].map(|c| t[c] as usize))
            .collect(),
    }
}

/// A net's points lie within the surface where it is curved; one step of Newton's method puts them onto it.
fn onto_surface(field: &[f32], strides: [usize; 3], p: [f32; 3]) -> [f32; 3] {
    let low = p.map(|v| v.floor());
    let t = [0, 1, 2].map(|a| p[a] - low[a]);
    let first: usize = (0..3).map(|a| low[a] as usize * strides[a]).sum();
    let (mut value, mut slope) = (0.0, [0.0; 3]);
    for corner in 0..8 {
        let up = [corner & 1, corner >> 1 & 1, corner >> 2];
        let at = field[first + (0..3).map(|a| up[a] * strides[a]).sum::<usize>()];
        if at.abs() >= NOTHING {
            // At a face of the grid the surface follows the face.
            return p;
        }
        let weight = |a: usize| if up[a] == 1 { t[a] } else { 1.0 - t[a] };
        value += at * weight(0) * weight(1) * weight(2);
        for a in 0..3 {
            let sign = if up[a] == 1 { 1.0 } else { -1.0 };
            slope[a] += at * sign * weight((a + 1) % 3) * weight((a + 2) % 3);
        }
    }
    let square: f32 = slope.iter().map(|s| s * s).sum();
    if square == 0.0 {
        return p;
    }
    // Not out of the neighbourhood where the slope means something.
    [0, 1, 2].map(|a| p[a] - (value * slope[a] / square).clamp(-0.5, 0.5))
}

/// Logarithm of the level over the dose where there is no dose.
const NOTHING: f32 = 50.0;
