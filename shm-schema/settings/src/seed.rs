//! Size of a seed. Its place is that of its middle, in the core, in plans, in pictures and for the dose.

/// Length of a seed from end to end, over its welds, m.
pub const SEED_LENGTH_M: f64 = 4.5e-3;

/// Radius of a seed, m.
pub const SEED_RADIUS_M: f64 = 0.4e-3;

/// Largest gap between two seeds that touch, m.
pub const TOUCHING_M: f64 = 1e-4;
