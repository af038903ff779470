//! The arithmetic of one link, and of many in a row: portable loops; `avx2` has the same arithmetic eight at a time.
//!
//! Components come in the order along, side, side: the link's axis first, then the two other axes.

use crate::limits::LinkLimits;
use bytemuck::{Pod, Zeroable};

/// Links whose outer end is the upper one; `LOWER` where it is the lower one.
pub(crate) const UPPER: bool = true;
pub(crate) const LOWER: bool = false;

/// Limits of the links of one class at the scale that the state has now (`TissueState::scale`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scaled {
    pub low: f32,
    pub high: f32,
    pub tan: f32,
    /// Length of a link at rest.
    pub rest: f32,
    /// Violations up to this stay as they are: rounding, far below any tolerance.
    pub slack: f32,
}

impl LinkLimits {
    /// Scales the limits; `rest` is one element, `slack` a length, both in the state's unit.
    #[inline(always)]
    pub(crate) fn scaled(&self, rest: f32, slack: f32) -> Scaled {
        Scaled {
            low: self.low * rest,
            high: self.high * rest,
            tan: self.tan,
            rest,
            slack,
        }
    }
}

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

// f32::min and max treat NaN with care that costs instructions; states are finite.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(crate) fn clamp(value: f32, low: f32, high: f32) -> f32 {
    lesser(greater(value, low), high)
}

/// Returns where the outer end of a link must be, given both ends: stretch first, then shear; and whether it had to
/// move.
///
/// A component that is within its limits keeps its bits.
#[inline(always)]
pub(crate) fn clamped_outer<const OUTER: bool>(l: &Scaled, inner: [f32; 3], outer: [f32; 3]) -> ([f32; 3], bool) {
    let up = OUTER == UPPER;
    let d = if up { outer[0] - inner[0] } else { inner[0] - outer[0] };
    let along = clamp(d, l.low, l.high);
    let shear = l.tan * (l.rest + along);
    let mut moved = (d - along).abs() > l.slack;
    let mut new = outer;
    if moved {
        new[0] = if up { inner[0] + along } else { inner[0] - along };
    }
    for side in 1..3 {
        let d = outer[side] - inner[side];
        let kept = clamp(d, -shear, shear);
        if (d - kept).abs() > l.slack {
            new[side] = inner[side] + kept;
            moved = true;
        }
    }
    (new, moved)
}

/// Components of `u` with the one along `axis` first.
#[inline(always)]
pub(crate) fn ordered<T>(axis: usize, [x, y, z]: [T; 3]) -> [T; 3] {
    match axis {
        0 => [x, y, z],
        1 => [y, x, z],
        _ => [z, x, y],
    }
}

/// Returns the components of one element.
#[inline(always)]
pub(crate) fn at(u: &[&mut [f32]; 3], e: usize) -> [f32; 3] {
    [u[0][e], u[1][e], u[2][e]]
}

/// The passes' loops over links.
///
/// Called inside a tick with the stretches of a model on a state that fits it, so that all lie inside the components.
///
/// `u` has the component along the links first. Links join element `inner + n` to `outer + n` (or `lo + n` to
/// `hi + n`); the two stretches do not overlap unless stated.
pub(crate) trait Kernels {
    /// Moves the outer end of each link into its limits; says which, counted from 0.
    fn clamp<const OUTER: bool>(l: &Scaled, u: &mut [&mut [f32]; 3], inner: usize, outer: usize, n: usize) -> Stretch;

    /// Returns the largest violation; zero if there is none. The stretches may overlap (links along x).
    fn violation(l: &Scaled, u: &[&[f32]; 3], lo: usize, hi: usize, n: usize) -> f32;

    /// Returns the first of the links between consecutive elements `start..end` and the next that is violated by more
    /// than the slack, or `end`.
    fn first_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize;

    /// Returns one past the last such link, or `start`.
    fn past_last_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize;

    /// Returns the largest square of a displacement.
    fn largest_square(u: &[&[f32]; 3], start: usize, end: usize) -> f32;
}

/// Returns the largest violation of one link; negative inside its limits.
#[inline(always)]
pub(crate) fn link_violation(l: &Scaled, lo: [f32; 3], hi: [f32; 3]) -> f32 {
    let along = hi[0] - lo[0];
    let stretch = greater(l.low - along, along - l.high);
    let side = greater((hi[1] - lo[1]).abs(), (hi[2] - lo[2]).abs());
    greater(stretch, side - l.tan * (l.rest + along))
}

pub(crate) struct Portable;

#[inline(always)]
fn violation_between(l: &Scaled, u: &[&[f32]; 3], lo: usize, hi: usize) -> f32 {
    link_violation(l, u.map(|c| c[lo]), u.map(|c| c[hi]))
}

impl Kernels for Portable {
    fn clamp<const OUTER: bool>(l: &Scaled, u: &mut [&mut [f32]; 3], inner: usize, outer: usize, n: usize) -> Stretch {
        let mut hull = Stretch::EMPTY;
        for e in 0..n {
            let (new, moved) = clamped_outer::<OUTER>(l, at(u, inner + e), at(u, outer + e));
            if moved {
                for (component, value) in u.iter_mut().zip(new) {
                    component[outer + e] = value;
                }
                hull = hull.with(Stretch {
                    start: e as u32,
                    end: e as u32 + 1,
                });
            }
        }
        hull
    }

    fn violation(l: &Scaled, u: &[&[f32]; 3], lo: usize, hi: usize, n: usize) -> f32 {
        (0..n).fold(0.0, |worst, e| greater(violation_between(l, u, lo + e, hi + e), worst))
    }

    fn first_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
        let mut links = start..end;
        links
            .find(|&e| violation_between(l, u, e, e + 1) > l.slack)
            .unwrap_or(end)
    }

    fn past_last_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
        let mut links = (start..end).rev();
        let last = links.find(|&e| violation_between(l, u, e, e + 1) > l.slack);
        last.map_or(start, |e| e + 1)
    }

    fn largest_square(u: &[&[f32]; 3], start: usize, end: usize) -> f32 {
        let square = |e: usize| u[0][e] * u[0][e] + u[1][e] * u[1][e] + u[2][e] * u[2][e];
        (start..end).fold(0.0, |largest, e| greater(square(e), largest))
    }
}

/// Part of a violation that each end of a link gives. Half each is the projection; up to the whole each still
/// converges (over-relaxation), and this needs fewer passes.
const OVER_RELAXATION: f32 = 0.9;

/// Returns the differences of a link after orthogonal projections onto its half-spaces in turn.
#[inline(always)]
pub(crate) fn projected_difference(l: &Scaled, mut d: [f32; 3]) -> [f32; 3] {
    d[0] = clamp(d[0], l.low, l.high);
    let per_square = 1.0 / (1.0 + l.tan * l.tan);
    for side in 1..3 {
        let over = greater(d[side].abs() - l.tan * (l.rest + d[0]), 0.0) * per_square;
        d[side] -= over.copysign(d[side]);
        d[0] += over * l.tan;
    }
    d
}

/// Projects both ends of a link into its limits; a fixed end stays and the other moves all the way.
#[inline(always)]
pub(crate) fn projected(l: &Scaled, pin: Pin, lo: [f32; 3], hi: [f32; 3]) -> [[f32; 3]; 2] {
    let first = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]];
    let d = projected_difference(l, first);
    let (lo_part, hi_part) = match pin {
        Pin::None => (OVER_RELAXATION, OVER_RELAXATION),
        Pin::Lo => (0.0, 1.0),
        Pin::Hi => (1.0, 0.0),
    };
    let give = [0, 1, 2].map(|c| d[c] - first[c]);
    [
        [0, 1, 2].map(|c| lo[c] - lo_part * give[c]),
        [0, 1, 2].map(|c| hi[c] + hi_part * give[c]),
    ]
}

/// Fixed end of a link; links with two fixed ends are no links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pin {
    None,
    Lo,
    Hi,
}

/// Returns the largest factor on all differences that leaves a link within `tolerance` of its limits.
///
/// Each limit reads `A s <= B` in the factor s; zero always satisfies it.
#[inline(always)]
pub(crate) fn feasible_factor(l: &Scaled, d: [f32; 3], tolerance: f32) -> f32 {
    let side = greater(d[1].abs(), d[2].abs());
    let each = [(-d[0], -l.low), (d[0], l.high), (side - l.tan * d[0], l.tan * l.rest)];
    let mut factor = 1.0;
    for (a, b) in each {
        if a > b + tolerance {
            factor = lesser(factor, (b + tolerance) / a);
        }
    }
    factor
}
