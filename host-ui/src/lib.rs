//! The operator's program: what it reads from the core, the files it opens, the procedure it runs.

mod affinity;
pub mod app;
pub mod cli;
pub mod controller;
pub mod convert;
pub mod core_args;
mod cpu_time;
pub mod dose;
pub mod dose_desk;
pub mod files;
pub mod format;
pub mod interrupt;
mod job;
pub mod keyboard;
pub mod link;
mod loader;
pub mod panel;
mod picture;
pub mod plan;
pub mod planner;
pub mod procedure;
pub mod record;
pub mod score;
pub mod settings;
pub mod theme;
pub mod view;
pub mod workflow;
