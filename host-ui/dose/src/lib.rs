//! Dose of permanent seeds: TG-43U1, volumes and dose at once, and what the operator is scored by.
//!
//! Lengths in m, time in s, dose in Gy, air kerma strength in U (1 U = 1 µGy m² h⁻¹); one frame for seeds, structures and
//! grids, whichever the caller chooses. Water everywhere and no shielding of one seed by another, as TG-43 has it.
#![warn(missing_docs)]

pub mod criteria;
pub mod criterion;
pub mod curve;
pub mod decay;
pub mod dvh;
pub mod edema;
pub mod effect;
pub mod error;
pub mod gamma;
pub mod grid;
pub mod isodose;
pub mod kernel;
pub mod mesh;
pub mod metric;
pub mod perturb;
pub mod picture;
pub mod points;
pub mod report;
pub mod seed;
pub mod source;
pub mod structure;
pub mod tg43;

pub use dvh::Dvh;
pub use error::DoseError;
pub use grid::DoseGrid;
pub use kernel::DoseKernel;
pub use metric::Metric;
pub use points::DosePoints;
pub use seed::Seed;
pub use source::Source;
pub use structure::{Region, Structure};
