//! What the operator asks for, as plain data: pictures, panels and keys return it, the window carries it out.

use crate::settings::Layout;
use std::path::PathBuf;
use stylet_implant::plan::{Hole, Row};
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
    LookFrom(Viewpoint),
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
    DismissRefusals,
    /// That a device was unplugged was read.
    DismissDisconnected,
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

/// A place that the three-dimensional picture is looked at from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Viewpoint {
    Oblique,
    Perineum,
    Side,
    Above,
    Needle,
}

impl Viewpoint {
    pub const ALL: [Self; 5] = [Self::Oblique, Self::Perineum, Self::Side, Self::Above, Self::Needle];

    pub fn name(self) -> &'static str {
        match self {
            Self::Oblique => "Oblique",
            Self::Perineum => "From the perineum",
            Self::Side => "From the side",
            Self::Above => "From above",
            Self::Needle => "Along the needle",
        }
    }
}
