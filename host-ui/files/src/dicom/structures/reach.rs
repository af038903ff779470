//! Continuation of the grid of the images to contours beyond them, so that no volume is cut off.

use super::super::super::element::short;
use super::super::super::overlap::in_cc;
use super::super::images::Grid;
use super::Contoured;
use super::raster::{planes, slabs};
use super::solid::Solid;
use crate::element::voxel_count;
use crate::error::ContentError;

/// Share of a voxel by which a contour may reach beyond a centre; rounding is not more.
const ROUNDED: f64 = 1e-6;

/// Returns the grid, with whole voxels added on each side until it covers every structure.
pub fn continued(grid: Grid, structures: &[Contoured]) -> Result<Grid, ContentError> {
    let (mut low, mut high) = ([0.0_f64; 3], grid.dims.map(|d| d as f64 - 1.0));
    for structure in structures {
        for at in extent(structure, &grid)? {
            for a in 0..3 {
                // Voxels whose centre is reached.
                low[a] = low[a].min((at[a] - ROUNDED).ceil());
                high[a] = high[a].max((at[a] + ROUNDED).floor());
            }
        }
    }
    let dims = [0, 1, 2].map(|a| (high[a] - low[a]) as usize + 1);
    if dims == grid.dims {
        return Ok(grid);
    }
    voxel_count(&dims.map(|d| d as u64)).map_err(|why| why.within("its contours reach far beyond its images"))?;
    let mut frame = grid.frame.clone();
    frame.origin_m = grid.frame.place_m(low);
    Ok(Grid { dims, frame })
}

/// Returns the lowest and the highest corner of a structure, in voxels.
fn extent(structure: &Contoured, grid: &Grid) -> Result<[[f64; 3]; 2], ContentError> {
    let Some(planes) = planes(structure, grid) else {
        return Ok(Solid::across(structure, grid.frame.spacing_m[2])?.extent(&grid.frame));
    };
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut take = |at: [f64; 3], axes: std::ops::Range<usize>| {
        for a in axes {
            (low[a], high[a]) = (low[a].min(at[a]), high[a].max(at[a]));
        }
    };
    let corners = structure.contours.iter().flatten();
    corners.for_each(|corner| take(grid.frame.index_of(*corner), 0..2));
    let heights: Vec<f64> = planes.iter().map(|(height, _)| *height).collect();
    for [from, to] in slabs(&heights, 1.0) {
        // A centre on the upper face belongs to the next slab.
        for z in [from, to - 3.0 * ROUNDED] {
            take([0.0, 0.0, z], 2..3);
        }
    }
    Ok([low, high])
}

/// Reports the volume of each structure beyond the images.
pub fn beyond(images: &Grid, grid: &Grid, labels: &[u8], structures: &[Contoured]) -> Option<String> {
    if images.dims == grid.dims {
        return None;
    }
    let first = grid.frame.index_of(images.frame.origin_m).map(|at| at.round() as usize);
    let mut outside = vec![0_usize; structures.len() + 1];
    for (n, label) in labels.iter().enumerate() {
        let at = [
            n % grid.dims[0],
            n / grid.dims[0] % grid.dims[1],
            n / grid.dims[0] / grid.dims[1],
        ];
        let is_inside = (0..3).all(|a| (first[a]..first[a] + images.dims[a]).contains(&at[a]));
        outside[usize::from(*label)] += usize::from(!is_inside);
    }
    let voxel_m3 = grid.frame.spacing_m.iter().product::<f64>();
    let with = structures.iter().zip(&outside[1..]).filter(|(_, count)| **count > 0);
    let each: Vec<String> = with
        .map(|(structure, count)| format!("{} with {}", short(&structure.name), in_cc(*count as f64 * voxel_m3)))
        .collect();
    (!each.is_empty()).then(|| {
        format!(
            "contours reach beyond the images, and the grid is continued there: {}",
            each.join(", ")
        )
    })
}
