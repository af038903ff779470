//! A seed for dose computation.

/// Place, direction and strength of a seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Place of its centre, in m.
    pub position_m: [f64; 3],
    /// Direction as a unit vector; `None` if it is unknown, which selects the 1D formalism.
    pub axis: Option<[f64; 3]>,
    /// Air kerma strength at the reference time.
    pub strength_u: f64,
}
