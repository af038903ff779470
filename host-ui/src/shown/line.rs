//! Whether the needle has its line.

use super::Shown;
use stylet_shm_schema::flags;

/// Whether the tissue is prepared for the needle where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeedleLine {
    Ready,
    /// The needle is outside.
    Preparing,
    /// The needle is in tissue without one.
    Missing,
}

impl Shown {
    /// `None` where the tissue needs no lines, and while the hand holds no needle.
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
