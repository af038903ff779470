//! State of the needle's line.

use super::Shown;
use stylet_shm_schema::flags;

/// Preparation of the tissue for the needle at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeedleLine {
    Ready,
    /// The needle is outside.
    Preparing,
    /// The needle is in tissue without one.
    Missing,
}

impl Shown {
    /// Returns the state of the line; `None` if the tissue needs none, and while the hand holds no
    /// needle.
    pub fn needle_line(&self) -> Option<NeedleLine> {
        let needs_one = self.has_flag(flags::LINE_NEEDED) && !self.has_flag(flags::HAND_EMPTY);
        needs_one.then(|| {
            if self.has_flag(flags::LINE_READY) {
                NeedleLine::Ready
            } else if self.has_flag(flags::IN_CONTACT) {
                NeedleLine::Missing
            } else {
                NeedleLine::Preparing
            }
        })
    }
}
