//! Inputs of dose computation from files: sources, seeds, structures, points, and an existing dose.

mod columns;
pub mod contours;
mod declared;
pub mod grid;
pub mod labels;
pub mod places;
pub mod seeds;
mod source;
mod table;

pub use columns::{Mapped, NotAColumn};
pub use declared::{Declared, Mismatch};
pub use grid::{at_gy, is_dose_volume, places_m, read_any_dose};
pub use seeds::{SeedDefaults, SeedFile, dose_seed, read_seeds};
pub use source::{file_of_program, read_source};
pub use table::read_points;
