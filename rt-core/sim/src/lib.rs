//! The simulation: a body of labelled cells, tissue that gives way, a needle in it, and the force on the hand.
//!
//! Pure: the same input gives the same bytes. No thread, no clock, no port; the loops that call it are in `stylet-runtime`.

#![warn(missing_docs)]

pub mod active;
pub mod force;
pub mod limits;
pub mod line;
pub mod migration;
pub mod needle;
pub mod probe;
pub mod scene;
pub mod settings;
mod simd;
pub mod tissue;
