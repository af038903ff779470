//! A population of simulated insertions: its distributions, its dose, and a page that compares both
//! with published values.
//!
//! Reads the Parquet files that `rt-core study` writes. Lengths in mm, forces in N, times in s,
//! dose in Gy.

#![warn(missing_docs)]

mod dose;
mod error;
mod errors;
mod figures;
mod page;
mod picture;
mod published;
mod shards;
mod tables;

pub use dose::{ImplantDose, Scored, score};
pub use error::PopulationError;
pub use errors::{misplacement, turned};
pub use figures::{Distribution, figures};
pub use page::page;
pub use shards::{Population, load};
pub use tables::write_tables;

#[cfg(test)]
mod tests;
