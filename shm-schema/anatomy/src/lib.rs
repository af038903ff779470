//! Anatomy shared by all parts: organs by name, their material, and the patient's frame.
#![warn(missing_docs)]

mod frame;
mod organ;
mod surroundings;
mod tissue;

pub use frame::{PatientFrame, ras_from_lps};
pub use organ::{Organ, Part, target_among};
pub use surroundings::{Beyond, Layer, Surroundings};
pub use tissue::{Material, Role};
