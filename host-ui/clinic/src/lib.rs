//! Commands that need no window: files converted, checked and planned with, dose, seeds in images, implants compared.

#![warn(missing_docs)]

/// Error of a command, of any type, printed on the terminal.
pub type CommandError = Box<dyn std::error::Error>;

mod class;
pub mod cli;
mod compare;
mod convert;
mod dicom;
mod dose;
mod find_seeds;
mod finder;
mod perturb;
mod plan;
mod post_implant;
mod scene;
mod sheet;
mod sources;
mod study;
mod trainees;
