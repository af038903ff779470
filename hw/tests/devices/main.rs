//! Devices against the contract of the trait, and the simulated ones against closed forms.

mod hand;
mod phantom;
mod replay;

/// Period of the force loop.
const DT_S: f64 = 1e-3;
