#![doc = include_str!("../README.md")]
#![warn(missing_docs)]

pub mod along_away;
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
