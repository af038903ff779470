//! The picture of a transrectal biplane probe: a sector across it or parallel beams along it.

mod beams;
mod marks;
mod plane;
mod scanner;

pub use plane::{FWHM, Plane, Pose, Probe, View};
pub use scanner::{NoPicture, Scanner, Settings};

#[cfg(test)]
mod tests;
