//! The latency laboratory: runs the real loops under load, and says with evidence how late they are.
//!
//! [`latency`] runs a measurement and writes a report; [`verify`] checks that a filed report is as it was
//! written; [`doctor`] says whether this PC is fit. Nothing in here claims that a standard is met.

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
