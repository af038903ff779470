//! The whole window without a core and without a graphics device: clipped, overlapping and moving
//! parts.

mod class;
pub(crate) mod fixture;
mod guide;
mod held;
mod pictures;
mod question;
mod text;
mod update;
mod whole;
