//! Panels: each a pure function of prepared data that draws and returns what the operator asked for.

mod axis;
pub mod help;
mod histogram;
pub mod history;
pub mod parameters;
pub mod plots;
mod seeds;
pub mod setup;
mod shown;
pub mod status;
mod strip;
pub mod workflow;

pub use seeds::{SeedError, all_errors, own_errors, seed_errors};
pub use shown::{FrameCost, LoadState, Note, Shown, TipOnPath};

use crate::settings::Layout;
use crate::view::scene3d::Preset;
use std::path::PathBuf;
use stylet_implant::plan::{Hole, Row};
use stylet_shm_schema::Request;

/// What the operator asked for. The window carries it out after all panels are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// A request without a payload.
    Send(Request),
    PlanSeeds,
    PlaceNeedle,
    Insert,
    Retract,
    /// Depth along the path from the entry, m.
    MoveTo(f64),
    /// A hand on the needle: depth along the path, m. Carried out once a frame at most.
    DriveTo(f64),
    /// The one thing to do in the step that is next.
    Next,
    /// Takes back the last step, where it can be.
    Undo,
    /// Puts back what was taken back of a plan.
    Redo,
    Plan(PlanAction),
    RunAll,
    StopRun,
    LoadScene(PathBuf),
    /// Of the patient of the present scene, for the slices.
    LoadImage(PathBuf),
    CancelLoad,
    /// By its place among [`stylet_shm_schema::BUILTIN_SCENES`].
    LoadBuiltinScene(usize),
    OpenParameters,
    ToggleHelp,
    ResetView,
    LookFrom(Preset),
    SetLayout(Layout),
    NextLayout,
    ToggleFollowTip,
    ToggleMeasure,
    ToggleIsodose,
    ToggleImage,
    ToggleTheme,
    /// The window as PNG.
    SavePicture,
    /// What the implant was worth, as files.
    SaveDebrief,
    /// The refusals told so far were read.
    PutRefusalsAway,
    /// That a device was unplugged was read.
    PutGoneAway,
}

/// What is asked of a plan of many needles; those are counted from 0.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanAction {
    /// An empty one.
    Begin,
    Automatic,
    Discard,
    Add(Hole),
    Remove(usize),
    Move(usize, Hole),
    SetRow(usize, Row),
    /// Of every seed, U.
    SetStrength(f64),
    FitStrength,
    Compensate,
    Cancel,
    Import(PathBuf),
    Export(PathBuf),
    /// The next one with seeds is set as the one to go in.
    NextNeedle,
    /// Slices go to this depth from the template's face, m.
    LookAt(f64),
}
