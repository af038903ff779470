//! Repeats a flight recording, and rehearses a needle to measure its ticks: natively, and as wasm without a system.
//!
//! `make wasm-test` builds it for wasm and runs `run.mjs` with node. The program of this package does the same
//! natively.

mod cost;
mod differences;
#[cfg(target_family = "wasm")]
mod exports;
mod repeat;

pub use cost::Bench;
pub use differences::Differences;
pub use repeat::{Repetition, repeat};
