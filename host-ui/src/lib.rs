//! The operator's program: the window, and the command line over the same code.
//!
//! The modules of the window depend on each other in one direction: `app` → `redraw`, `panel` → `view`, `keyboard` →
//! `shown`, `action` → `planner`, `dose_worker`, `loader` → `theme`, `settings`, `words` → `recent`, `dialog`.

#![warn(missing_docs)]

mod action;
pub mod app;
pub mod cli;
mod command;
pub mod cpu_time;
mod dialog;
mod dose_worker;
pub mod heap;
pub mod keyboard;
mod loader;
mod panel;
mod picture;
pub mod planner;
mod recent;
mod redraw;
pub mod session;
mod settings;
mod shown;
mod theme;
pub mod view;
mod words;

pub use settings::text_scale;
pub use theme::colors_of_lines;
