//! What the operator asks for, as plain data: pictures, panels and keys return it, the window carries it out.

use crate::dialog::Purpose;
use crate::planner::Edit;
use crate::settings::Layout;
use std::path::PathBuf;
use stylet_implant::intraoperative::SeedsFrom;
use stylet_implant::plan::{Hole, Row};
use stylet_shm_schema::{LeaseRequest, Request};

/// What the operator asked for. The window carries it out after all panels are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Sends a request without a payload.
    Send(Request),
    /// Joined to the one before it where the needle is loaded with a strand.
    DropSeed,
    PlanSeeds,
    PlaceNeedle,
    Insert,
    Retract,
    /// Depth along the path from the entry, m.
    MoveTo(f64),
    /// A hand on the needle: depth along the path, m. Carried out once a frame at most.
    DriveTo(f64),
    /// The main action of the present step.
    Next,
    /// Undoes the last step, where that is possible.
    Undo,
    /// Redoes the change of the plan that was undone last.
    Redo,
    Plan(PlanAction),
    Watch(WatchAction),
    Trainee(TraineeAction),
    Probe(ProbeAction),
    RunAll,
    /// The answer to the question that a standing fault raises: re-arm and begin, or not.
    Rearm(bool),
    /// All needles again, from a reset, whatever was done.
    StartOver,
    StopRun,
    LoadScene(PathBuf),
    /// Loads an image of the patient of the present scene for the slices.
    LoadImage(PathBuf),
    CancelLoad,
    /// Opens a dialog for a file.
    PickFile(Purpose),
    /// Loads the scene of this index in [`stylet_shm_schema::BUILTIN_SCENES`].
    LoadBuiltinScene(usize),
    OpenParameters,
    /// Shows who is connected over a relay, or no longer.
    ToggleClass,
    /// Asks the relay for the needle, or hands it over.
    Lease(LeaseRequest),
    /// Shows or hides the instructor's dialog.
    ToggleInstructor,
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
    /// Saves the window as PNG.
    SavePicture,
    /// Saves the debrief as files.
    SaveDebrief,
    /// The refusals shown so far were read.
    DismissRefusals,
    /// The message that a device was unplugged was read.
    DismissDisconnected,
}

/// What is asked of the simulated hand that holds the ultrasound probe: ways along its axis (m), turns about it (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProbeAction {
    /// By the stepper, whether its brake is on or off.
    Step {
        way_m: f64,
        turn_rad: f64,
    },
    /// By hand, which the brake does not allow.
    Drag {
        way_m: f64,
        turn_rad: f64,
    },
    ToggleBrake,
}

/// What an instructor asks for of a trainee, by the place in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraineeAction {
    /// The window shows this one.
    Follow(usize),
    /// Stops that hand.
    Stop(usize),
    /// Writes the debrief of this one, from what the window has heard.
    Debrief(usize),
    /// Stops every hand.
    StopAll,
}

/// What the operator asks for of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WatchAction {
    /// Shows the recorded insertion that comes with the program.
    Example,
    /// Shows a recording made by `host-ui record`.
    File(PathBuf),
    /// Holds it, or lets it go on.
    Hold(bool),
    /// Shows it again from its beginning.
    Again,
    /// Goes back to the core.
    Close,
}

/// What the operator asks for in a plan of many needles; needles are counted from 0.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanAction {
    /// Begins an empty plan.
    Begin,
    Automatic,
    /// Takes a proposal of the automatic plan, by its place among them.
    Choose(usize),
    Discard,
    Add(Hole),
    Remove(usize),
    Move(usize, Hole),
    SetRow(usize, Row),
    /// Strength of each seed, U.
    SetStrength(f64),
    FitStrength,
    Compensate,
    Cancel,
    Import(PathBuf),
    Export(PathBuf),
    /// Structure set, plan and dose as DICOM, into a new folder.
    ExportStudy,
    /// The next needle with seeds becomes the one to insert.
    NextNeedle,
    /// Moves the slices to this depth from the template's face, m.
    LookAt(f64),
    /// Changes what is drawn on the live picture.
    Draw(Edit),
    /// Which seeds the dose of a moment is of.
    SeedsFrom(SeedsFrom),
    /// Plans the needles that are left anew.
    Update,
    /// Takes the update that waits, or leaves the plan as it is.
    Decide(bool),
    /// The plan before the last update again.
    WithdrawUpdate,
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
