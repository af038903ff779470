//! The arithmetic of one link, over slices of links; straight loops that the compiler turns into vectors.
//!
//! Components come in the order along, side, side: `u[axis]` first, then the two other axes.

use crate::tissue::limits::LinkLimits;

/// Links whose outer end is the upper one; `LOWER` where it is the lower one.
pub(crate) const UPPER: bool = true;
pub(crate) const LOWER: bool = false;

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

/// Where the outer end of a link must be, given both ends: stretch first, then shear.
#[inline(always)]
pub(crate) fn clamped_outer<const OUTER: bool>(limits: &LinkLimits, inner: [f32; 3], outer: [f32; 3]) -> [f32; 3] {
    let sign = if OUTER == UPPER { 1.0 } else { -1.0 };
    let along = clamp(sign * (outer[0] - inner[0]), limits.low, limits.high);
    let shear = limits.tan * (1.0 + along);
    [
        inner[0] + sign * along,
        inner[1] + clamp(outer[1] - inner[1], -shear, shear),
        inner[2] + clamp(outer[2] - inner[2], -shear, shear),
    ]
}

/// Moves the outer end of each link into its limits.
pub(crate) fn clamp_outer<const OUTER: bool>(
    limits: &LinkLimits,
    [ia, ib, ic]: [&[f32]; 3],
    [a, b, c]: [&mut [f32]; 3],
) {
    clamp_outer_slices::<OUTER>(limits, ia, ib, ic, a, b, c);
}

/// Each slice an argument of its own: the compiler then knows that they do not overlap.
fn clamp_outer_slices<const OUTER: bool>(
    limits: &LinkLimits,
    ia: &[f32],
    ib: &[f32],
    ic: &[f32],
    a: &mut [f32],
    b: &mut [f32],
    c: &mut [f32],
) {
    let n = a.len();
    let (ia, ib, ic) = (&ia[..n], &ib[..n], &ic[..n]);
    let (b, c) = (&mut b[..n], &mut c[..n]);
    for e in 0..n {
        let moved = clamped_outer::<OUTER>(limits, [ia[e], ib[e], ic[e]], [a[e], b[e], c[e]]);
        [a[e], b[e], c[e]] = moved;
    }
}

/// How far one link is outside its limits, at most; negative inside.
#[inline(always)]
fn link_violation(limits: &LinkLimits, lo: [f32; 3], hi: [f32; 3]) -> f32 {
    let along = hi[0] - lo[0];
    let stretch = greater(limits.low - along, along - limits.high);
    let side = greater((hi[1] - lo[1]).abs(), (hi[2] - lo[2]).abs());
    greater(stretch, side - limits.tan * (1.0 + along))
}

/// Largest violation over the links between two slices; zero if there is none.
pub(crate) fn violation(limits: &LinkLimits, lo: [&[f32]; 3], hi: [&[f32]; 3]) -> f32 {
    let n = hi[0].len();
    let [la, lb, lc] = lo.map(|s| &s[..n]);
    let [ha, hb, hc] = hi.map(|s| &s[..n]);
    // As integers the bits of floats above zero have the order of the floats, and those below zero are
    // below zero: an integer maximum is one that the compiler may take in any order.
    let mut worst = 0_i32;
    for e in 0..n {
        let found = link_violation(limits, [la[e], lb[e], lc[e]], [ha[e], hb[e], hc[e]]);
        worst = worst.max(found.to_bits() as i32);
    }
    f32::from_bits(worst as u32)
}

/// Part of a violation that each end of a link gives. Half each is the projection; up to the whole each still
/// converges (over-relaxation), and this needs fewer passes.
const RELAXATION: f32 = 0.9;

/// Where both ends of a link go: orthogonal projections onto the link's half-spaces in turn, over-relaxed.
#[inline(always)]
pub(crate) fn projected(limits: &LinkLimits, lo: [f32; 3], hi: [f32; 3]) -> [[f32; 3]; 2] {
    let first = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]];
    let mut d = first;
    d[0] = clamp(d[0], limits.low, limits.high);
    let per_square = 1.0 / (1.0 + limits.tan * limits.tan);
    for side in 1..3 {
        let over = greater(d[side].abs() - limits.tan * (1.0 + d[0]), 0.0) * per_square;
        d[side] -= over.copysign(d[side]);
        d[0] += over * limits.tan;
    }
    let give = [0, 1, 2].map(|c| RELAXATION * (d[c] - first[c]));
    [
        [lo[0] - give[0], lo[1] - give[1], lo[2] - give[2]],
        [hi[0] + give[0], hi[1] + give[1], hi[2] + give[2]],
    ]
}

/// Projects each link between two slices.
pub(crate) fn project(limits: &LinkLimits, [la, lb, lc]: [&mut [f32]; 3], [ha, hb, hc]: [&mut [f32]; 3]) {
    project_slices(limits, la, lb, lc, ha, hb, hc);
}

fn project_slices(
    limits: &LinkLimits,
    la: &mut [f32],
    lb: &mut [f32],
    lc: &mut [f32],
    ha: &mut [f32],
    hb: &mut [f32],
    hc: &mut [f32],
) {
    let n = ha.len();
    let (la, lb, lc) = (&mut la[..n], &mut lb[..n], &mut lc[..n]);
    let (hb, hc) = (&mut hb[..n], &mut hc[..n]);
    for e in 0..n {
        let [l, h] = projected(limits, [la[e], lb[e], lc[e]], [ha[e], hb[e], hc[e]]);
        [la[e], lb[e], lc[e]] = l;
        [ha[e], hb[e], hc[e]] = h;
    }
}

/// Largest factor on all differences that leaves a link within `tolerance` of its limits.
///
/// Each limit reads `A s <= B` in the factor s; zero always satisfies it.
#[inline(always)]
pub(crate) fn feasible_scale(limits: &LinkLimits, d: [f32; 3], tolerance: f32) -> f32 {
    let side = greater(d[1].abs(), d[2].abs());
    let each = [
        (-d[0], -limits.low),
        (d[0], limits.high),
        (side - limits.tan * d[0], limits.tan),
    ];
    let mut scale = 1.0;
    for (a, b) in each {
        if a > b + tolerance {
            scale = lesser(scale, (b + tolerance) / a);
        }
    }
    scale
}
