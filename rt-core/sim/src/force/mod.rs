//! From the tip's motion to the force on the operator's hand.
//!
//! In the order of the data, as [`chain`] calls them: [`velocity`] → [`law`] (with [`friction`], [`chatter`] and
//! [`coupling`]) → [`gate`] (with [`passivity`] and [`thermal`]) → device. Every force here acts on the operator's
//! hand. Nothing called in a tick allocates or panics.

// What the lists of clippy.toml name has no place in a tick; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

pub mod chain;
pub mod chatter;
pub mod coupling;
pub mod friction;
pub mod gate;
pub mod law;
pub mod parameters;
pub mod passivity;
pub mod thermal;
pub mod velocity;

pub use chain::{ChainOutput, ChainParameters, ChainState, Touch};
pub use coupling::LocalResponse;
pub use gate::{ForceFault, GateCounts, GateInput, GateOutput, GateParameters, GateState};
pub use law::{ForceInput, ForceState, ForceTerms, force};
pub use parameters::ForceParameters;
pub use passivity::{Motion, PassivityParameters, PassivityState};
pub use velocity::VelocityEstimator;

/// Time between two answers of the tissue, over which a correction is blended in.
pub const TISSUE_PERIOD_S: f64 = 5e-3;
