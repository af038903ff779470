//! What of the state a frame shows, in parts of its own.

#[derive(Clone, Debug, Default, PartialEq)]
pub enum LoadState {
    #[default]
    Idle,
    /// What, and the share of it that is done.
    Reading(String, f32),
    Sending(String),
    Loaded(String),
    Refused(String),
}

impl LoadState {
    pub fn is_busy(&self) -> bool {
        matches!(self, Self::Reading(..) | Self::Sending(_))
    }
}

/// Where the tip is against the planned path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipOnPath {
    /// From the entry along the path, and how far the path goes.
    pub depth_m: f64,
    pub length_m: f64,
    /// Beside the path: to the right and up, as seen from the perineum.
    pub beside_m: [f64; 2],
    /// How far beside the path there are holes.
    pub room_m: [[f64; 2]; 2],
    /// The tip touches nothing.
    pub is_free: bool,
}

/// What the last frame cost this program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Processor time without the driver's.
    pub cpu_us: f64,
    /// Of the graphics library and its driver for the pictures in the middle.
    pub driver_us: f64,
    pub uploaded_bytes: u64,
}

/// A recording in place of a core.
#[derive(Clone, Debug, PartialEq)]
pub struct Watched {
    pub name: String,
    pub at_s: f64,
    pub length_s: f64,
    pub is_held: bool,
    pub has_ended: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    pub refused: bool,
    pub text: String,
}
