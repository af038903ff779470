//! A seed as dose sees it.

/// Where a seed lies, how it points, how strong it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Place of its middle, in m.
    pub position_m: [f64; 3],
    /// Unit vector; `None` when the direction is not known, which means the 1D formalism.
    pub axis: Option<[f64; 3]>,
    /// Air kerma strength at the reference time.
    pub strength_u: f64,
}
