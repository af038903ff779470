//! The operator's program: what it reads from the core, the files it opens, the procedure it runs.

pub mod app;
pub mod cli;
pub mod files;
pub mod link;
pub mod procedure;
pub mod workflow;
