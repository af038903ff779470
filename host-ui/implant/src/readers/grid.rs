//! A dose grid in the format of `host-ui dose`.

use super::table::{self, LineError, PLACE};
use std::path::Path;
use stylet_files::dicom::dose::{DoseKind, ReadDose};
use stylet_files::open::Format;
use stylet_files::{FileError, Progress, Sink, bytes, dicom, image, lines_of, nrrd};

/// Number of bytes that distinguish a DICOM file from a table.
const START_BYTES: u64 = 160;
/// Pair of an NRRD header that gives the unit of a dose.
const UNITS_LINE: &str = "dose_units";

/// Returns every place of a dose (RAS), x fastest, in m.
pub fn places_m(dose: &ReadDose) -> impl Iterator<Item = [f64; 3]> + '_ {
    let [nx, ny, nz] = dose.dims;
    (0..nx * ny * nz).map(move |n| {
        let at = [n % nx, n / nx % ny, n / nx / ny];
        [0, 1, 2].map(|a| dose.origin_m[a] + at[a] as f64 * dose.spacing_m[a])
    })
}

/// Interpolates a dose linearly between the eight voxels around a place; `None` outside of the
/// centres of the outermost.
pub fn at_gy(dose: &ReadDose, place_m: [f64; 3]) -> Option<f64> {
    let (mut low, mut share) = ([0; 3], [0.0; 3]);
    for a in 0..3 {
        let at = (place_m[a] - dose.origin_m[a]) / dose.spacing_m[a];
        let last = (dose.dims[a] - 1) as f64;
        // A part in a million of a voxel is rounding.
        if !(-1e-6..=last + 1e-6).contains(&at) {
            return None;
        }
        let at = at.clamp(0.0, last);
        low[a] = (at as usize).min(dose.dims[a].saturating_sub(2));
        share[a] = at - low[a] as f64;
    }
    let [nx, ny, _] = dose.dims;
    let corner = |n: usize| {
        let up = [n & 1, n >> 1 & 1, n >> 2];
        let weight: f64 = (0..3)
            .map(|a| if up[a] == 1 { share[a] } else { 1.0 - share[a] })
            .product();
        if weight == 0.0 {
            return 0.0;
        }
        let at = [0, 1, 2].map(|a| low[a] + up[a]);
        weight * dose.dose_gy[(at[2] * ny + at[1]) * nx + at[0]]
    };
    Some((0..8).map(corner).sum())
}

/// Reads a dose from an RT Dose, a volume (NRRD, NIfTI, MetaImage) or a table, detected by the content.
pub fn read_any_dose(path: &Path) -> Result<ReadDose, FileError> {
    let kind = DoseKind::of_lines(lines_of(path));
    match Format::of(&bytes::start(path, START_BYTES).unwrap_or_default()) {
        Some(Format::Dicom) => dicom::dose::of_file(path),
        Some(_) => read_volume(path, kind),
        None => read_table(path, kind),
    }
}

/// Returns whether a file is an NRRD volume that `host-ui convert` wrote as a dose.
pub fn is_dose_volume(path: &Path) -> bool {
    let is_nrrd = bytes::start(path, START_BYTES).is_some_and(|start| nrrd::is_nrrd(&start));
    is_nrrd && lines_of(path)(UNITS_LINE).is_some()
}

fn read_volume(path: &Path, kind: DoseKind) -> Result<ReadDose, FileError> {
    let refused = |why| FileError::of(path, why);
    let progress = Progress::default();
    let volume = image::read_volume(path, Sink::exact(&progress), &progress)?;
    let mut dose = dicom::dose::of_volume(&volume, kind).map_err(refused)?;
    if !is_dose_volume(path) {
        dose.notes
            .push("it does not say its unit; its values are taken as Gy".to_owned());
    }
    Ok(dose)
}

/// Reads a dose grid in the format of `host-ui dose`: every place of a regular grid, x fastest.
fn read_table(path: &Path, kind: DoseKind) -> Result<ReadDose, FileError> {
    let (rows, _) = table::read(path, &[PLACE.as_slice(), &["dose_gy"]].concat(), &[], |row| {
        let dose = row
            .number("dose_gy")?
            .ok_or_else(|| LineError::new("dose_gy is empty"))?;
        Ok((row.position_m()?, dose))
    })?;
    grid_of(&rows, kind).ok_or_else(|| {
        FileError::of(
            path,
            "its places are not a grid with x running fastest, like those of dose_grid.csv",
        )
    })
}

fn grid_of(rows: &[([f64; 3], f64)], kind: DoseKind) -> Option<ReadDose> {
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
        // One layer has no distance to the next; its thickness is the pitch of the grid.
        1 => (last[0] - origin_m[0]) / (dims[0].max(2) - 1) as f64,
        n => (last[a] - origin_m[a]) / (n - 1) as f64,
    });
    let fits = |(r, (place, _)): (usize, &([f64; 3], f64))| {
        let at = [r % stride_y, r / stride_y % dims[1], r / stride_z];
        (0..3).all(|a| near(place[a], origin_m[a] + at[a] as f64 * spacing_m[a]))
    };
    let is_grid = spacing_m.iter().all(|s| *s > 0.0) && rows.iter().enumerate().all(fits);
    is_grid.then(|| ReadDose {
        dims,
        origin_m,
        spacing_m,
        dose_gy: rows.iter().map(|r| r.1).collect(),
        notes: kind.remarks(),
        kind,
        uid: String::new(),
        plan: None,
        structure_set: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use std::collections::BTreeMap;
    use stylet_files::{VoxelFrame, Voxels};

    /// Guards against doses that could be compared as NRRD and not in the other formats of volumes.
    #[test]
    fn every_format_of_volumes_holds_the_same_dose() {
        let steps = Matrix3::from_diagonal(&Vector3::new(2e-3, 2.5e-3, 3e-3));
        let voxels = Voxels {
            dims: [3, 4, 2],
            labels: (0..24).map(|n| 10 * n).collect(),
            frame: VoxelFrame::new(steps, Vector3::new(0.01, -0.02, 0.03), "test").unwrap(),
            names: BTreeMap::new(),
            also: Vec::new(),
            overlap: None,
        };
        let folder = tempfile::tempdir().unwrap();
        for name in ["dose.nrrd", "dose.nii.gz", "dose.mha"] {
            let path = folder.path().join(name);
            stylet_files::convert::write_labels(&voxels, &path, None).unwrap();
            let dose = read_any_dose(&path).unwrap();
            assert_eq!(dose.dims, voxels.dims, "{name}");
            assert_eq!(
                dose.dose_gy,
                (0..24).map(|n| f64::from(10 * n)).collect::<Vec<_>>(),
                "{name}"
            );
            let (origin, expected) = (dose.origin_m, [0.01, -0.02, 0.03]);
            assert!(
                (0..3).all(|a| (origin[a] - expected[a]).abs() < 1e-8),
                "{name}: {origin:?}"
            );
            assert!((dose.spacing_m[1] - 2.5e-3).abs() < 1e-9, "{name}");
            assert!(dose.notes.iter().any(|note| note.contains("taken as Gy")), "{name}");
        }
    }
}
