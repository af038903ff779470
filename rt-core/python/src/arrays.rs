//! NumPy arrays as the simulator's lists, and back; mm outside, m inside.

use crate::work::refused;
use nalgebra::{Unit, Vector3};
use numpy::ndarray::Array2;
use numpy::{
    AllowTypeChange, Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayLike2, PyArrayLikeDyn, PyArrayMethods,
};
use pyo3::prelude::*;

pub const M_PER_MM: f64 = 1e-3;
pub const MM_PER_M: f64 = 1e3;

/// Rows of places or directions, shape (N, 3).
pub type Rows<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;
/// One number for all, or one for each, shape (N,).
pub type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// Returns the rows, each value multiplied by `factor`.
pub fn rows(name: &str, given: &Rows<'_>, factor: f64) -> PyResult<Vec<[f64; 3]>> {
    let view = given.as_array();
    if view.ncols() != 3 {
        let found = view.shape();
        return Err(refused(format!("{name} has the shape {found:?}; it must be (N, 3)")));
    }
    let list: Vec<[f64; 3]> = view
        .rows()
        .into_iter()
        .map(|row| [row[0], row[1], row[2]].map(|value| value * factor))
        .collect();
    match list.iter().flatten().all(|value| value.is_finite()) {
        true => Ok(list),
        false => Err(refused(format!("{name} has a value that is not a number"))),
    }
}

/// Returns one number for each of `count`.
pub fn numbers(name: &str, given: &Numbers<'_>, count: usize) -> PyResult<Vec<f64>> {
    let view = given.as_array();
    let list: Vec<f64> = match view.ndim() {
        0 => vec![view.sum(); count],
        _ => view.iter().copied().collect(),
    };
    if view.ndim() > 1 || list.len() != count || !list.iter().all(|value| value.is_finite()) {
        let found = view.shape();
        return Err(refused(format!(
            "{name} has the shape {found:?}; it must be one number, or have the shape ({count},)"
        )));
    }
    Ok(list)
}

/// Returns a finite place in m.
pub fn place_m(name: &str, mm: [f64; 3]) -> PyResult<Vector3<f64>> {
    match mm.iter().all(|value| value.is_finite()) {
        true => Ok(Vector3::from(mm) * M_PER_MM),
        false => Err(refused(format!("{name} has a value that is not a number"))),
    }
}

/// Returns the unit vector of a direction.
pub fn direction(name: &str, given: [f64; 3]) -> PyResult<Unit<Vector3<f64>>> {
    Unit::try_new(Vector3::from(given), 1e-9)
        .filter(|unit| unit.iter().all(|value| value.is_finite()))
        .ok_or_else(|| refused(format!("{name} is {given:?}, which is no direction")))
}

/// Returns an array of shape (N, K), each value multiplied by `factor`.
pub fn table<const K: usize>(
    py: Python<'_>,
    rows: impl ExactSizeIterator<Item = [f64; K]>,
    factor: f64,
) -> Bound<'_, PyArray2<f64>> {
    let count = rows.len();
    let values: Vec<f64> = rows.flatten().map(|value| value * factor).collect();
    // As many values as the shape has.
    Array2::from_shape_vec((count, K), values)
        .unwrap_or_default()
        .into_pyarray(py)
}

/// Returns a list as an array of shape (N,), without a copy.
pub fn column<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    values.into_pyarray(py)
}

/// Returns cells, x fastest, as an array that is indexed [x, y, z], without a copy.
pub fn volume<T: Element>(py: Python<'_>, cells: Vec<T>, dims: [usize; 3]) -> PyResult<Bound<'_, PyArray3<T>>> {
    let [x, y, z] = dims;
    cells.into_pyarray(py).reshape([z, y, x])?.transpose()
}

/// Returns the cells of an array that is indexed [x, y, z], x fastest.
pub fn cells<T: Element + Copy>(given: &numpy::PyReadonlyArray3<'_, T>) -> (Vec<T>, [usize; 3]) {
    let view = given.as_array();
    let dims = [view.shape()[0], view.shape()[1], view.shape()[2]];
    (view.reversed_axes().iter().copied().collect(), dims)
}
