//! Comparison of two doses.

use crate::arrays::{self, M_PER_MM};
use crate::work::refused;
use numpy::{PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use stylet_dose::DoseGrid;
use stylet_dose::gamma::Criterion;

/// Returns the gamma of each voxel of a dose against another (Low et al., Med. Phys. 25, 656, 1998), in the shape of
/// `dose_gy`; NaN where it is not compared. It is at most 2, and below 1 where both agree.
///
/// :param dose_gy, other_gy: ``float64``, indexed [x, y, z]; `other_gy` is interpolated.
/// :param spacing_mm, origin_mm: edges of a voxel, and centre of voxel [0, 0, 0], of `dose_gy`.
/// :param other_spacing_mm, other_origin_mm: those of `other_gy`, if they differ.
/// :param percent, distance_mm: the tolerance, such as 3 % and 3 mm.
/// :param of_gy: dose that the percent are of (global); each voxel's own without it (local).
/// :param least_gy: voxels below are not compared.
#[pyfunction]
#[pyo3(signature = (dose_gy, other_gy, spacing_mm, *, origin_mm=[0.0; 3], other_spacing_mm=None, other_origin_mm=None,
    percent=3.0, distance_mm=3.0, of_gy=None, least_gy=0.0))]
#[allow(clippy::too_many_arguments)]
pub fn gamma<'py>(
    py: Python<'py>,
    dose_gy: PyReadonlyArray3<'py, f64>,
    other_gy: PyReadonlyArray3<'py, f64>,
    spacing_mm: [f64; 3],
    origin_mm: [f64; 3],
    other_spacing_mm: Option<[f64; 3]>,
    other_origin_mm: Option<[f64; 3]>,
    percent: f64,
    distance_mm: f64,
    of_gy: Option<f64>,
    least_gy: f64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    for (name, value) in [("percent", percent), ("distance_mm", distance_mm)] {
        if !(value > 0.0 && value <= 100.0) {
            return Err(refused(format!(
                "{name} is {value}; it must be above 0 and at most 100"
            )));
        }
    }
    let grid = |array: &PyReadonlyArray3<'py, f64>, origin_mm: [f64; 3], spacing_mm: [f64; 3]| {
        let (cells, dims) = arrays::cells(array);
        let [origin_m, spacing_m] = [origin_mm, spacing_mm].map(|mm| mm.map(|mm| mm * M_PER_MM));
        DoseGrid::of(origin_m, spacing_m, dims, cells).map_err(refused)
    };
    let (here, other) = (
        grid(&dose_gy, origin_mm, spacing_mm)?,
        grid(
            &other_gy,
            other_origin_mm.unwrap_or(origin_mm),
            other_spacing_mm.unwrap_or(spacing_mm),
        )?,
    );
    let criterion = Criterion {
        dose_share: percent / 100.0,
        of_gy,
        distance_m: distance_mm * M_PER_MM,
    };
    let gammas = py.detach(|| {
        let [nx, ny, _] = here.dims();
        let compared = here.dose_gy().iter().enumerate().filter(|(_, gy)| **gy >= least_gy);
        let (numbers, places): (Vec<usize>, Vec<_>) = compared
            .map(|(n, gy)| (n, (here.centre_m([n % nx, n / nx % ny, n / nx / ny]), *gy)))
            .unzip();
        let found = criterion.gammas(&places, &|place_m| other.has(place_m).then(|| other.at_gy(place_m)));
        let mut gammas = vec![f64::NAN; here.dose_gy().len()];
        for (n, gamma) in numbers.into_iter().zip(found) {
            gammas[n] = gamma.unwrap_or(f64::NAN);
        }
        gammas
    });
    arrays::volume(py, gammas, here.dims())
}
