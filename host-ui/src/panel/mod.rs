//! Panels: each a pure function of prepared data that draws and returns what the operator asked for.

pub mod help;
pub mod history;
pub mod parameters;
pub mod plots;
mod seeds;
mod shown;
pub mod status;
pub mod workflow;

pub use seeds::{SeedError, seed_errors};
pub use shown::{LoadState, Note, Shown};

use std::path::PathBuf;
use stylet_shm_schema::CommandKind;

/// What the operator asked for. The window carries it out after all panels are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// A command without values.
    Send(CommandKind),
    PlanSeeds,
    PlaceNeedle,
    Insert,
    Retract,
    /// Depth along the path from the entry, m.
    MoveTo(f64),
    RunAll,
    StopRun,
    LoadScene(PathBuf),
    /// By its place among [`stylet_shm_schema::BUILTIN_SCENES`].
    LoadBuiltinScene(usize),
    OpenParameters,
    ToggleHelp,
    ResetView,
}
