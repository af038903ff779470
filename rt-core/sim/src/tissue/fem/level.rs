//! One level of the multigrid: a grid of cubic elements, each with a stiffness, and the springs of the foundation.

use super::grid::Grid;
use crate::simd::Simd;

/// The operator on one grid.
#[derive(Clone, Debug)]
pub(super) struct Level<T> {
    pub grid: Grid,
    /// `mean`, `varying` and `shear` of each cell, N/m; zero where there is none.
    pub stiffness: [Vec<T>; 3],
    /// Springs to rest, N/m.
    pub springs: Vec<T>,
    /// One over the diagonal; zero at nodes that are fixed or touch no element.
    pub inverse_diagonal: Vec<T>,
    /// Largest eigenvalue of the operator after division by the diagonal.
    pub largest_eigenvalue: f64,
    pub simd: Simd,
}
