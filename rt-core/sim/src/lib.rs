#![doc = include_str!("../README.md")]
#![warn(missing_docs)]

pub mod active;
pub mod force;
pub mod limits;
pub mod line;
pub mod migration;
pub mod needle;
pub mod probe;
pub mod scene;
pub mod settings;
mod simd;
pub mod tissue;
