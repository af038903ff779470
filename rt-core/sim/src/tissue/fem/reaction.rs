//! Stiffness of the layers around one part of a body beyond that of its springs to rest.

use nalgebra::DMatrix;

/// Forces `U mix U^T u` of the layers on a part, for its displacement `u`.
#[derive(Clone, Debug)]
pub(super) struct Reaction {
    /// Number of the part.
    pub part: u32,
    /// Nodes of the finest grid on its surface.
    pub nodes: Vec<u32>,
    /// Columns of U: a force on each of these nodes.
    pub forces: Vec<Vec<[f64; 3]>>,
    pub mix: DMatrix<f64>,
    /// Displacement as one piece for each newton, the mean over all directions.
    pub whole_m_per_n: f64,
}
