//! Parts of the state that a frame shows.

use std::sync::Arc;
use stylet_host::link::TimeMark;

#[derive(Clone, Debug, Default, PartialEq)]
pub enum LoadState {
    #[default]
    Idle,
    /// Stage of the reading, and its completed share.
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

/// Position of the tip relative to the planned path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipOnPath {
    /// Depth from the entry along the path, and length of the path.
    pub depth_m: f64,
    pub length_m: f64,
    /// Offset from the path: to the right and up, as seen from the perineum.
    pub offset_m: [f64; 2],
    /// Range of the holes around the path.
    pub room_m: [[f64; 2]; 2],
    /// True if the tip touches nothing.
    pub is_free: bool,
}

/// Cost of the last frame for this program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Processor time without the driver's.
    pub cpu_us: f64,
    /// Processor time of the graphics library and its driver, for the pictures in the middle.
    pub driver_us: f64,
    pub uploaded_bytes: u64,
}

/// Recording that replaces a core.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Watched {
    pub name: String,
    pub at_s: f64,
    pub length_s: f64,
    pub is_held: bool,
    /// Multiple of the recorded speed.
    pub speed: f64,
    pub marks: Arc<[TimeMark]>,
    pub has_ended: bool,
}
