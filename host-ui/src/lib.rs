//! The operator's program: the window, and the command line over the same code.
//!
//! Modules of the window know only those to their right:
//! `app` → `panel` → `view` → `keyboard` → `shown`, `action` → `planner`, `dose_worker`, `loader` → `mesh`, `theme`, `settings`.

pub mod action;
mod affinity;
pub mod app;
pub mod cli;
pub mod command;
pub mod cpu_time;
pub mod dose_worker;
pub mod heap;
pub mod keyboard;
mod loader;
pub mod mesh;
pub mod panel;
mod picture;
pub mod planner;
pub mod settings;
pub mod shown;
pub mod theme;
pub mod view;
