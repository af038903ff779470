//! The latency laboratory: runs the real loops under load, and reports with evidence how late they are.
//!
//! [`latency`] runs a measurement and writes a report; [`verify`] verifies that a saved report is
//! unaltered; [`doctor`] checks whether this PC is fit. No report claims conformity with a standard.

pub mod args;
pub mod collect;
pub mod compare;
pub mod cost;
pub mod doctor;
pub mod files;
pub mod gaps;
pub mod host;
pub mod html;
pub mod latency;
pub mod load;
pub mod machine;
pub mod measure;
pub mod plots;
pub mod provenance;
pub mod report;
pub mod summary;
pub mod verdict;
pub mod verify;
pub mod watch;
