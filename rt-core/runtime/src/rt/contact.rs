//! The contact of the needle with the tissue.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A contact in progress.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Contact {
    /// Rises with each contact of a run; the first is 1.
    pub number: u64,
    /// Entry of the tip into the body, scene frame, m.
    pub place: Vector3<f64>,
    /// Direction of the needle at that moment, unit vector: r of eq. 6.
    pub direction: Vector3<f64>,
}
