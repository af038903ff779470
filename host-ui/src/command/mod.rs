//! Commands that open no window.

/// Error of a command, of any type, printed on the terminal.
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
