//! The latency laboratory: runs the real loops under load, and documents their lateness.
//!
//! [`latency`] runs a measurement and writes a report, [`campaign`] one of hours and nights; [`verify`] verifies that a
//! saved report is unaltered; [`fleet`] compares the reports of many PCs; [`doctor`] checks whether this PC is fit, and
//! improves it; [`credibility`] is the file for an auditor. No report claims conformity with a standard.

#![warn(missing_docs)]

pub mod args;
mod bound;
pub mod campaign;
mod collect;
mod compare;
pub mod cost;
pub mod credibility;
mod cyclictest;
mod disk;
pub mod doctor;
mod external;
mod files;
pub mod fleet;
mod gaps;
mod host;
mod html;
pub mod latency;
pub mod load;
mod machine;
mod measure;
mod noise;
mod noise_section;
mod others;
mod paired;
mod paired_section;
mod plots;
mod provenance;
mod raw;
mod report;
mod sample;
mod saved;
mod sealed;
mod sign;
mod spin;
mod spread;
mod stationary;
mod summary;
mod trace;
mod verdict;
pub mod verify;
mod watch;
mod whose;

pub use trace::keep as keep_trace_instance;
