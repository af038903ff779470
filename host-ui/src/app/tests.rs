//! The whole window without a core and without a graphics device: what is clipped, what overlaps, what moves.

mod class;
pub(crate) mod fixture;
mod guide;
mod held;
mod pictures;
mod rearm;
mod text;
mod update;
mod whole;
