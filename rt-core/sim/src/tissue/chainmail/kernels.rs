//! The arithmetic of one link, and of many in a row, eight at a time.
//!
//! Components come in the order along, side, side: the link's axis first, then the two other axes.
//!
//! Nothing here panics, since it runs inside a tick. Stretches that do not lie in the components are cut, or left alone
//! where a part of them means nothing; those of a model lie inside its state, which `TissueState::fits` verifies.

use super::stretch::Stretch;
use crate::limits::LinkLimits;
use crate::simd::{LANES, Vector, in_vectors};

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

/// Limits of a link in every lane.
struct Lanes<V> {
    low: V,
    high: V,
    tan: V,
    rest: V,
    slack: V,
}

impl<V: Vector<f32>> Lanes<V> {
    #[inline(always)]
    fn of(l: &Scaled) -> Self {
        Lanes {
            low: V::splat(l.low),
            high: V::splat(l.high),
            tan: V::splat(l.tan),
            rest: V::splat(l.rest),
            slack: V::splat(l.slack),
        }
    }
}

/// Loads eight values, zeros for those past the end: whole vectors even where some lanes are not meant.
#[inline(always)]
fn load<V: Vector<f32>>(c: &[f32], at: usize) -> V {
    let from = c.get(at..).unwrap_or_default();
    from.first_chunk().map_or_else(|| V::load_first(from), V::load)
}

/// Stores what fits. A store of some lanes holds up the loads that follow, so it is kept for the end of a component.
#[inline(always)]
fn store<V: Vector<f32>>(c: &mut [f32], at: usize, value: V) {
    let to = c.get_mut(at..).unwrap_or_default();
    match to.first_chunk_mut() {
        Some(all) => value.store(all),
        None => value.store_first(to),
    }
}

/// Returns the bits of the first `n` lanes, of all from eight on.
#[inline(always)]
fn first(n: usize) -> u32 {
    (1 << n.min(LANES)) - 1
}

#[inline(always)]
fn shortest(u: &[&[f32]; 3]) -> usize {
    u[0].len().min(u[1].len()).min(u[2].len())
}

/// Moves the outer end of each link `inner + n` to `outer + n` into its limits; says which, counted from 0. The two
/// stretches do not overlap.
#[inline(always)]
pub(crate) fn clamp_all<V: Vector<f32>, const OUTER: bool>(
    l: &Scaled,
    [a, b, c]: &mut [&mut [f32]; 3],
    inner: usize,
    outer: usize,
    n: usize,
) -> Stretch {
    let len = a.len().min(b.len()).min(c.len());
    let n = n.min(len.saturating_sub(inner.max(outer)));
    let l = Lanes::<V>::of(l);
    let mut hull = Stretch::EMPTY;
    for e in (0..n).step_by(LANES) {
        let (from, to) = (inner + e, outer + e);
        let (ia, oa): (V, V) = (load(a, from), load(a, to));
        let d = if OUTER == UPPER { oa - ia } else { ia - oa };
        let along = d.greater(l.low).lesser(l.high);
        let new = if OUTER == UPPER { ia + along } else { ia - along };
        let shear = l.tan * (l.rest + along);
        let (ob, oc) = (load::<V>(b, to), load::<V>(c, to));
        let (new_b, moved_b) = clamp_side(&l, shear, load(b, from), ob);
        let (new_c, moved_c) = clamp_side(&l, shear, load(c, from), oc);
        let moved_a = (d - along).abs().above(l.slack);
        let live = first(n - e);
        let moved = (moved_a | moved_b | moved_c) & live;
        if moved != 0 {
            store(a, to, V::select(moved_a & live, new, oa));
            store(b, to, V::select(moved_b & live, new_b, ob));
            store(c, to, V::select(moved_c & live, new_c, oc));
            hull = hull.with(Stretch {
                start: e as u32 + moved.trailing_zeros(),
                end: e as u32 + 32 - moved.leading_zeros(),
            });
        }
    }
    hull
}

#[inline(always)]
fn clamp_side<V: Vector<f32>>(l: &Lanes<V>, shear: V, inner: V, outer: V) -> (V, u32) {
    let d = outer - inner;
    let kept = d.greater(V::splat(0.0) - shear).lesser(shear);
    (inner + kept, (d - kept).abs().above(l.slack))
}

/// Returns the violations of eight links; negative inside their limits.
#[inline(always)]
fn violations<V: Vector<f32>>(l: &Lanes<V>, u: &[&[f32]; 3], lo: usize, hi: usize) -> V {
    let [along, b, c] = [
        load::<V>(u[0], hi) - load::<V>(u[0], lo),
        load::<V>(u[1], hi) - load::<V>(u[1], lo),
        load::<V>(u[2], hi) - load::<V>(u[2], lo),
    ];
    let stretch = (l.low - along).greater(along - l.high);
    stretch.greater(b.abs().greater(c.abs()) - l.tan * (l.rest + along))
}

/// Returns the greater of `most` and the first `n` numbers of `found`, in each lane.
#[inline(always)]
fn with_first<V: Vector<f32>>(most: V, found: V, n: usize) -> V {
    let found = if n < LANES {
        V::select(first(n), found, most)
    } else {
        found
    };
    found.greater(most)
}

#[inline(always)]
fn largest<V: Vector<f32>>(most: V) -> f32 {
    most.numbers().into_iter().fold(0.0, greater)
}

/// Returns the largest violation of the links `lo + n` to `hi + n`; zero if there is none. The stretches may overlap.
#[inline(always)]
pub(crate) fn violation<V: Vector<f32>>(l: &Scaled, u: &[&[f32]; 3], lo: usize, hi: usize, n: usize) -> f32 {
    let n = n.min(shortest(u).saturating_sub(lo.max(hi)));
    let l = Lanes::<V>::of(l);
    let mut most = V::splat(0.0);
    for e in (0..n).step_by(LANES) {
        most = with_first(most, violations(&l, u, lo + e, hi + e), n - e);
    }
    largest(most)
}

/// Returns the first of the links between consecutive elements `start..end` and the next that is violated by more than
/// the slack, or `end`.
#[inline(always)]
pub(crate) fn first_violated<V: Vector<f32>>(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
    let l = Lanes::<V>::of(l);
    let start = if end < shortest(u) { start } else { end };
    for e in (start..end).step_by(LANES) {
        let found = violations(&l, u, e, e + 1).above(l.slack) & first(end - e);
        if found != 0 {
            return e + found.trailing_zeros() as usize;
        }
    }
    end
}

/// Returns one past the last such link, or `start`.
#[inline(always)]
pub(crate) fn past_last_violated<V: Vector<f32>>(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
    let l = Lanes::<V>::of(l);
    let mut past = if end < shortest(u) { end } else { start };
    while past > start {
        let e = past.saturating_sub(LANES).max(start);
        let found = violations(&l, u, e, e + 1).above(l.slack) & first(past - e);
        if found != 0 {
            return e + 32 - found.leading_zeros() as usize;
        }
        past = e;
    }
    start
}

in_vectors! {
/// Returns the largest square of a displacement.
fn largest_square<V: Vector<f32>>(u: &[&[f32]; 3], start: usize, end: usize) -> f32 {
    let n = end.min(shortest(u)).saturating_sub(start);
    let mut most = V::splat(0.0);
    for e in (0..n).step_by(LANES) {
        let [x, y, z]: [V; 3] = [load(u[0], start + e), load(u[1], start + e), load(u[2], start + e)];
        most = with_first(most, x * x + y * y + z * z, n - e);
    }
    largest(most)
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

#[cfg(test)]
mod tests;
