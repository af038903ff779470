//! The operator's program: the window, in a desktop and in a web page, and the command line over the same code.
//!
//! The modules of the window depend on each other in one direction: `app` → `redraw`, `panel` → `view`, `keyboard` →
//! `shown`, `action` → `planner`, `dose_worker`, `loader` → `theme`, `settings`, `words` → `recent`, `dialog`.

#![warn(missing_docs)]

mod action;
pub mod app;
#[cfg(not(target_family = "wasm"))]
pub mod cli;
#[cfg(not(target_family = "wasm"))]
mod command;
pub mod cpu_time;
mod dialog;
mod dose_worker;
#[cfg(target_family = "wasm")]
mod download;
#[cfg(not(target_family = "wasm"))]
pub mod heap;
pub mod keyboard;
mod loader;
mod panel;
#[cfg(not(target_family = "wasm"))]
mod picture;
pub mod planner;
mod recent;
mod redraw;
#[cfg(not(target_family = "wasm"))]
pub mod session;
mod settings;
mod shown;
mod theme;
pub mod view;
#[cfg(target_family = "wasm")]
pub mod web;
mod words;

/// True in a web page, which has no files, devices, processes or threads.
const IN_PAGE: bool = cfg!(target_family = "wasm");

pub use settings::text_scale;
pub use theme::colors_of_lines;
