//! Files of other programs, by the readers of the programs.

use crate::arrays::{self, MM_PER_M};
use crate::work::refused;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use stylet_files::dicom::{dose, plan};
use stylet_files::{Progress, read_voxels};

/// Reads a label volume (NIfTI-1, NRRD, MetaImage, DICOM RT Structure Set on the images in its folder, Segmentation).
///
/// :returns: a dict: ``labels``, ``uint8`` indexed by voxel, the first axis fastest; ``names``, ``{label: name}``;
///     ``patient_from_voxel``, shape (3, 4): ``m @ (i, j, k, 1)`` is the centre of a voxel in the patient (RAS), mm.
/// :raises ValueError: what is wrong with the file.
#[pyfunction]
pub fn read_labels(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let voxels = py
        .detach(|| read_voxels(&path, &Progress::default()))
        .map_err(refused)?;
    let (columns_m, origin_m) = (voxels.frame.columns_m(), voxels.frame.origin_m);
    let row = |a: usize| [columns_m[(a, 0)], columns_m[(a, 1)], columns_m[(a, 2)], origin_m[a]];
    let dict = PyDict::new(py);
    dict.set_item("labels", arrays::volume(py, voxels.labels, voxels.dims)?)?;
    dict.set_item("names", voxels.names)?;
    dict.set_item(
        "patient_from_voxel",
        arrays::table(py, [row(0), row(1), row(2)].into_iter(), MM_PER_M),
    )?;
    Ok(dict)
}

/// Reads a DICOM RT Plan of a permanent implant.
///
/// :returns: a dict: ``seeds_mm`` and ``axes`` (NaN without one), shape (N, 3), patient frame (RAS); ``strength_u``,
///     shape (N,); ``holes``, a list; ``source``, ``prescription_gy``, ``label``; ``notes``, remarks of the reader.
/// :raises ValueError: what is wrong with the file.
#[pyfunction]
pub fn read_plan(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let plan = py.detach(|| plan::of_file(&path)).map_err(refused)?;
    let seeds = plan.seeds.iter();
    let axes = seeds.clone().map(|seed| seed.axis.unwrap_or([f64::NAN; 3]));
    let dict = PyDict::new(py);
    dict.set_item("label", plan.label)?;
    dict.set_item("source", plan.source.model)?;
    dict.set_item("prescription_gy", plan.prescription_gy)?;
    dict.set_item(
        "seeds_mm",
        arrays::table(py, seeds.clone().map(|seed| seed.position_m), MM_PER_M),
    )?;
    dict.set_item("axes", arrays::table(py, axes, 1.0))?;
    let strengths = seeds.clone().map(|seed| seed.strength_u).collect();
    dict.set_item("strength_u", arrays::column(py, strengths))?;
    dict.set_item("holes", seeds.map(|seed| seed.hole.as_str()).collect::<Vec<_>>())?;
    dict.set_item("notes", plan.notes)?;
    Ok(dict)
}

/// Reads a DICOM RT Dose.
///
/// :returns: a dict: ``dose_gy``, indexed [x, y, z]; ``origin_mm``, centre of voxel [0, 0, 0] in the patient (RAS);
///     ``spacing_mm``; ``notes``, remarks of the reader.
/// :raises ValueError: what is wrong with the file.
#[pyfunction]
pub fn read_dose(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let dose = py.detach(|| dose::of_file(&path)).map_err(refused)?;
    let dict = PyDict::new(py);
    dict.set_item("dose_gy", arrays::volume(py, dose.dose_gy, dose.dims)?)?;
    dict.set_item("origin_mm", dose.origin_m.map(|m| m * MM_PER_M))?;
    dict.set_item("spacing_mm", dose.spacing_m.map(|m| m * MM_PER_M))?;
    dict.set_item("notes", dose.notes)?;
    Ok(dict)
}
