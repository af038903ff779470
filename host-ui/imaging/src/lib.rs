//! Pictures of the deformed body, computed on the graphics card: the ultrasound of a transrectal
//! probe, radiographs of a C-arm.
//!
//! The crate takes plain arrays: labels with their tissues, a field of displacements, seeds and
//! needles. It knows no ports and no windows. `docs/imaging.md` describes the pictures and their
//! limits.
#![warn(missing_docs)]

mod bend;
mod body;
pub mod fluoroscopy;
pub mod gpu;
mod tissue;
pub mod ultrasound;
pub mod xray;

pub use bend::Bend;
pub use body::{Body, Metal, NEEDLE_RADIUS_M, Needle, SEED_LENGTH_M, SEED_RADIUS_M, Seed};
pub use gpu::{Gpu, NoGpu};
pub use tissue::{OUTSIDE, Tissue, brightness};
