//! Requests of the operator as plain data: pictures, panels and keys return them, the window
//! executes them.

use crate::dialog::Purpose;
use crate::planner::Edit;
use crate::settings::Layout;
use std::path::PathBuf;
use stylet_implant::intraoperative::SeedsFrom;
use stylet_implant::plan::{Hole, Row};
use stylet_shm_schema::{LeaseRequest, Request};

/// Request of the operator. The window executes it after all panels are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Sends a request without a payload.
    Send(Request),
    /// Drops a seed, joined to the previous one if the needle is loaded with a strand.
    DropSeed,
    PlanSeeds,
    PlaceNeedle,
    Insert,
    Retract,
    /// Depth along the path from the entry, m.
    MoveTo(f64),
    /// Drives the needle by hand to a depth along the path, m. Executed at most once a frame.
    DriveTo(f64),
    /// Runs the main action of the present step.
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
    /// Answers the question of the window.
    Answer(bool),
    /// Inserts all needles again, from a reset.
    StartOver,
    StopRun,
    LoadScene(PathBuf),
    /// Loads an image of the present scene's patient for the slices.
    LoadImage(PathBuf),
    CancelLoad,
    Structures(StructuresAction),
    /// Opens a dialog for a file.
    PickFile(Purpose),
    /// Loads the scene of this index in [`stylet_shm_schema::BUILTIN_SCENES`].
    LoadBuiltinScene(usize),
    OpenParameters,
    /// Shows or hides the list of hosts connected over a relay.
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
    /// Starts a core to replace one that has ended.
    StartCore,
    /// Saves the window as PNG.
    SavePicture,
    /// Saves the debrief as files.
    SaveDebrief,
    /// Marks the refusals shown so far as read.
    DismissRefusals,
    /// Reduces the banner of a run that is not real-time to its badge.
    ReduceNotRealTime,
    /// Marks the message about an unplugged device as read.
    DismissDisconnected,
}

/// Request of the operator in the table of a volume's structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StructuresAction {
    /// Makes them the scene.
    Use,
    /// Saves them as a scene file.
    Save,
    Close,
}

/// Request to the simulated hand that holds the ultrasound probe: moves along its axis (m), turns
/// about it (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProbeAction {
    /// Moves by the stepper, with its brake on or off.
    Step {
        way_m: f64,
        turn_rad: f64,
    },
    /// Moves by hand, which the brake prevents.
    Drag {
        way_m: f64,
        turn_rad: f64,
    },
    ToggleBrake,
}

/// Instructor's request for a trainee, by the place in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraineeAction {
    /// Shows this trainee in the window.
    Follow(usize),
    /// Stops this trainee's hand.
    Stop(usize),
    /// Writes the debrief of this trainee, from the data that the window received.
    Debrief(usize),
    /// Stops every hand.
    StopAll,
}

/// Request of the operator for a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum WatchAction {
    /// Shows the recorded insertion that comes with the program.
    Example,
    /// Shows a recording made by `host-ui record`.
    File(PathBuf),
    /// Pauses or resumes it.
    Hold(bool),
    /// Jumps to a position, s.
    Jump(f64),
    /// Plays it at this multiple of the recorded speed.
    Speed(f64),
    /// Returns to the core.
    Close,
}

/// Request of the operator in a plan of many needles; needles are counted from 0.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanAction {
    /// Begins an empty plan.
    Begin,
    Automatic,
    /// Takes a proposal of the automatic plan, by its index.
    Choose(usize),
    Discard,
    /// Restores the plan that was discarded.
    Restore,
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
    /// Exports structure set, plan and dose as DICOM into a new folder.
    ExportStudy,
    /// Selects the next needle with seeds for insertion.
    NextNeedle,
    /// Moves the slices to this depth from the template's face, m.
    LookAt(f64),
    /// Changes the drawing on the live picture.
    Draw(Edit),
    /// Chooses the seeds whose present dose is shown.
    SeedsFrom(SeedsFrom),
    /// Replans the remaining needles.
    Update,
    /// Accepts the pending update, or rejects it.
    Decide(bool),
    /// Restores the plan before the last update.
    WithdrawUpdate,
}

/// Viewpoint of the three-dimensional picture.
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
