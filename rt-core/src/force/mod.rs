//! From the tip's motion to the force on the operator's hand.
//!
//! In the order of the data: [`velocity`] → [`law`] (with [`friction`]) → [`passivity`] → [`gate`] → device.
//! Every force here acts on the operator's hand. Nothing called in a tick allocates or panics.

pub mod check;
pub mod friction;
pub mod gate;
pub mod law;
pub mod parameters;
pub mod passivity;
pub mod velocity;

pub use check::Problem;
pub use gate::{ForceFault, GateCounts, GateOutput, GateParameters, GateState};
pub use law::{ForceInput, ForceState, ForceTerms, force};
pub use parameters::ForceParameters;
pub use passivity::{PassivityParameters, PassivityState};
pub use velocity::VelocityEstimator;

#[cfg(test)]
mod chain_tests;
