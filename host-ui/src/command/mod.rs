//! Tasks of the command line that open no window.

pub mod convert;
pub mod dose;
pub mod plan;
