//! A dose grid as `host-ui dose` writes it.

use super::table::{self, LineError, PLACE};
use std::path::Path;
use stylet_files::FileError;

/// Doses on a regular grid of places in RAS; x runs fastest.
pub struct DoseFile {
    /// Places along x, y, z.
    pub dims: [usize; 3],
    /// The first place, in m.
    pub origin_m: [f64; 3],
    /// Distances between places along x, y, z, in m.
    pub spacing_m: [f64; 3],
    /// Doses in Gy.
    pub dose_gy: Vec<f64>,
}

/// A dose grid as `host-ui dose` writes it: every place of a regular grid, x fastest.
pub fn read_dose(path: &Path) -> Result<DoseFile, FileError> {
    let rows = table::read(path, &[PLACE.as_slice(), &["dose_gy"]].concat(), |row| {
        let dose = row
            .number("dose_gy")?
            .ok_or_else(|| LineError::new("dose_gy is empty"))?;
        Ok((row.position_m()?, dose))
    })?;
    grid_of(&rows).ok_or_else(|| {
        FileError::of(
            path,
            "its places are no grid with x running fastest, as dose_grid.csv has them",
        )
    })
}

fn grid_of(rows: &[([f64; 3], f64)]) -> Option<DoseFile> {
    let origin_m = rows.first()?.0;
    let near = |a: f64, b: f64| (a - b).abs() < 2e-7;
    let first_off = |from: usize, axis: usize| (from..rows.len()).find(|&r| !near(rows[r].0[axis], origin_m[axis]));
    let stride_y = first_off(0, 1).unwrap_or(rows.len());
    let stride_z = first_off(0, 2).unwrap_or(rows.len());
    if stride_y > stride_z || !stride_z.is_multiple_of(stride_y) || !rows.len().is_multiple_of(stride_z) {
        return None;
    }
    let dims = [stride_y, stride_z / stride_y, rows.len() / stride_z];
    let last = rows.last()?.0;
    let spacing_m = [0, 1, 2].map(|a| match dims[a] {
        // One layer has no distance to the next; it is as thick as the grid is fine.
        1 => (last[0] - origin_m[0]) / (dims[0].max(2) - 1) as f64,
        n => (last[a] - origin_m[a]) / (n - 1) as f64,
    });
    let fits = |(r, (place, _)): (usize, &([f64; 3], f64))| {
        let at = [r % stride_y, r / stride_y % dims[1], r / stride_z];
        (0..3).all(|a| near(place[a], origin_m[a] + at[a] as f64 * spacing_m[a]))
    };
    let is_grid = spacing_m.iter().all(|s| *s > 0.0) && rows.iter().enumerate().all(fits);
    is_grid.then(|| DoseFile {
        dims,
        origin_m,
        spacing_m,
        dose_gy: rows.iter().map(|r| r.1).collect(),
    })
}
