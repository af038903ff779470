//! The implant: its plan, the procedure that executes it, compensation by rehearsal, and its score.

#![warn(missing_docs)]

pub mod intraoperative;
pub mod linked;
pub mod pairing;
mod patient;
pub mod plan;
#[cfg(not(target_family = "wasm"))]
pub mod procedure;
pub mod provenance;
pub mod readers;
pub mod received;
pub mod registration;
pub mod score;
pub mod workflow;
