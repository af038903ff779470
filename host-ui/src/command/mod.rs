//! Tasks of the command line that open no window.

/// An error of a command, whatever its type: it is printed for the person at the terminal.
pub type CommandError = Box<dyn std::error::Error>;

pub mod class;
pub mod compare;
pub mod convert;
pub mod dicom;
pub mod dose;
pub mod export;
pub mod find_seeds;
pub mod perturb;
pub mod picture;
pub mod plan;
pub mod post_implant;
pub mod record;
pub mod scene;
pub mod study;
