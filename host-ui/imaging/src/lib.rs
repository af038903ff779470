//! Pictures of the body as it lies now, computed on the graphics card: the ultrasound of a transrectal probe,
//! radiographs of a C-arm.
//!
//! The crate takes plain arrays: labels with what each is made of, a field of displacements, seeds and needles. It knows no
//! ports and no windows. What the pictures are, and what they leave out, stands in `docs/imaging.md`.
#![warn(missing_docs)]

mod body;
pub mod fluoroscopy;
mod gpu;
mod tissue;
pub mod ultrasound;

pub use body::{Body, Metal, NEEDLE_RADIUS_M, Needle, SEED_LENGTH_M, SEED_RADIUS_M, Seed};
pub use gpu::{Gpu, NoGpu};
pub use tissue::{OUTSIDE, Tissue, brightness};
