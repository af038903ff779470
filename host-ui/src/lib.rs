//! The operator's program: the window, and the command line over the same code.

mod affinity;
pub mod app;
pub mod cli;
pub mod command;
pub mod cpu_time;
pub mod dose_desk;
pub mod heap;
pub mod keyboard;
mod loader;
pub mod panel;
mod picture;
pub mod planner;
pub mod settings;
pub mod theme;
pub mod view;
