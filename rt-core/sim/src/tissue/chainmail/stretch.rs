//! Stretches of consecutive elements, rows or planes.

use bytemuck::{Pod, Zeroable};

/// Consecutive elements `start..end`; empty if the end is not above the start.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct Stretch {
    pub start: u32,
    pub end: u32,
}

impl Stretch {
    pub const EMPTY: Stretch = Stretch {
        start: u32::MAX,
        end: 0,
    };

    /// Returns the stretch of a single element.
    #[inline(always)]
    pub fn one(n: usize) -> Stretch {
        Stretch {
            start: n as u32,
            end: n as u32 + 1,
        }
    }

    /// Returns its numbers.
    #[inline(always)]
    pub fn numbers(self) -> std::ops::Range<usize> {
        self.start as usize..self.end.max(self.start) as usize
    }

    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.start >= self.end
    }

    #[inline(always)]
    pub fn len(self) -> u32 {
        self.end.saturating_sub(self.start)
    }

    /// Returns the shortest stretch with both in it.
    #[inline(always)]
    pub fn with(self, other: Stretch) -> Stretch {
        Stretch {
            start: self.start.min(other.start),
            end: self.end.max(other.end),
        }
    }

    /// Returns the part inside `first..first + len`, counted from `first`.
    #[inline(always)]
    pub fn within(self, first: u32, len: u32) -> Stretch {
        if self.end <= first || self.start >= first + len || self.is_empty() {
            return Stretch::EMPTY;
        }
        Stretch {
            start: self.start.max(first) - first,
            end: self.end.min(first + len) - first,
        }
    }

    /// Moves the stretch up by `first`.
    #[inline(always)]
    pub fn from(self, first: u32) -> Stretch {
        if self.is_empty() {
            return Stretch::EMPTY;
        }
        Stretch {
            start: self.start + first,
            end: self.end + first,
        }
    }
}
