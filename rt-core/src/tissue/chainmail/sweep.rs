//! Outward sweeps: the held element stays, and every link moves its outer end.
//!
//! Planes outward from the held plane; in a plane, rows outward from the held row; in a row, elements
//! outward from the held column. Each element is moved after its inner neighbours.

use super::kernels::{self, LOWER, UPPER};
use super::model::ChainMail;
use super::spans::Span;
use crate::scene::Run;
use crate::tissue::limits::LinkLimits;

/// Violations that a row may keep: rounding, far below any tolerance.
const ROUNDING: f32 = 1e-5;

/// The components in the order along, side, side.
#[inline(always)]
pub(super) fn ordered<T>(axis: usize, [x, y, z]: [T; 3]) -> [T; 3] {
    match axis {
        0 => [x, y, z],
        1 => [y, x, z],
        _ => [z, x, y],
    }
}

/// Both ends of a span, split so that both can be written.
#[inline(always)]
pub(super) fn ends<'a>(u: &'a mut [Vec<f32>; 3], axis: usize, span: Span) -> ([&'a mut [f32]; 3], [&'a mut [f32]; 3]) {
    let (lo, hi, len) = (span.lo as usize, span.hi as usize, span.len as usize);
    let [x, y, z] = ordered(axis, u.each_mut());
    let split = |component: &'a mut Vec<f32>| {
        let (below, above) = component.split_at_mut(hi);
        (&mut below[lo..lo + len], &mut above[..len])
    };
    let ((xl, xh), (yl, yh), (zl, zh)) = (split(x), split(y), split(z));
    ([xl, yl, zl], [xh, yh, zh])
}

fn sweep_spans<const OUTER: bool>(limits: &LinkLimits, axis: usize, spans: &[Span], u: &mut [Vec<f32>; 3]) {
    for &span in spans {
        let (lo, hi) = ends(u, axis, span);
        if OUTER == UPPER {
            kernels::clamp_outer::<UPPER>(limits, lo.map(|s| &*s), hi);
        } else {
            kernels::clamp_outer::<LOWER>(limits, hi.map(|s| &*s), lo);
        }
    }
}

/// Largest violation of the links of one run.
pub(super) fn run_violation(limits: &LinkLimits, run: Run, u: &[Vec<f32>; 3]) -> f32 {
    let (first, end) = (run.first as usize, run.end() as usize);
    let lo = u.each_ref().map(|c| &c[first..end - 1]);
    let hi = u.each_ref().map(|c| &c[first + 1..end]);
    kernels::violation(limits, lo, hi)
}

/// Moves the elements of a run outward from the column of the held element, if any link is violated.
fn sweep_run(limits: &LinkLimits, run: Run, held_i: u32, u: &mut [Vec<f32>; 3]) {
    if run_violation(limits, run, u) <= ROUNDING {
        return;
    }
    let (first, end) = (run.first as usize, run.end() as usize);
    let [x, y, z] = u.each_mut().map(|c| &mut c[first..end]);
    let start = (held_i.saturating_sub(run.start_i) as usize).min(x.len() - 1);
    let mut inner = [x[start], y[start], z[start]];
    for e in start + 1..x.len() {
        inner = kernels::clamped_outer::<UPPER>(limits, inner, [x[e], y[e], z[e]]);
        [x[e], y[e], z[e]] = inner;
    }
    inner = [x[start], y[start], z[start]];
    for e in (0..start).rev() {
        inner = kernels::clamped_outer::<LOWER>(limits, inner, [x[e], y[e], z[e]]);
        [x[e], y[e], z[e]] = inner;
    }
}

/// Rows of plane `k` in the order outward from row `held_j`: the held row, those above, those below.
fn sweep_rows(model: &ChainMail, [held_i, held_j, _]: [usize; 3], k: usize, u: &mut [Vec<f32>; 3]) {
    let [x, y, _] = &model.limits.links;
    let ny = model.lattice.dims[1];
    let [start, end] = model.rows_of_plane[k];
    let sweep_row = |j: usize, u: &mut [Vec<f32>; 3]| {
        for &run in model.lattice.row(j, k) {
            sweep_run(x, run, held_i as u32, u);
        }
    };
    if (start..end).contains(&held_j) {
        sweep_row(held_j, u);
    }
    for j in start.max(held_j + 1)..end {
        sweep_spans::<UPPER>(y, 1, model.y_links.below(j + ny * k), u);
        sweep_row(j, u);
    }
    for j in (start..end.min(held_j)).rev() {
        sweep_spans::<LOWER>(y, 1, model.y_links.below(j + 1 + ny * k), u);
        sweep_row(j, u);
    }
}

/// One outward sweep over every link.
pub(super) fn outward(model: &ChainMail, held_cell: [usize; 3], u: &mut [Vec<f32>; 3]) {
    let z = &model.limits.links[2];
    let (held_k, nz) = (held_cell[2], model.lattice.dims[2]);
    sweep_rows(model, held_cell, held_k, u);
    for k in held_k + 1..nz {
        sweep_spans::<UPPER>(z, 2, model.z_links.below(k), u);
        sweep_rows(model, held_cell, k, u);
    }
    for k in (0..held_k).rev() {
        sweep_spans::<LOWER>(z, 2, model.z_links.below(k + 1), u);
        sweep_rows(model, held_cell, k, u);
    }
}

/// The textbook's single pass as sweeps: the held line along x, then rows of its plane along y, then
/// planes along z. Follows one tree of links, so it leaves other links violated.
#[cfg(test)]
pub(super) fn single_pass(model: &ChainMail, held_cell: [usize; 3], u: &mut [Vec<f32>; 3]) {
    let [held_i, held_j, held_k] = held_cell;
    let [x, y, z] = &model.limits.links;
    let [_, ny, nz] = model.lattice.dims;
    for &run in model.lattice.row(held_j, held_k) {
        sweep_run(x, run, held_i as u32, u);
    }
    for j in held_j + 1..ny {
        sweep_spans::<UPPER>(y, 1, model.y_links.below(j + ny * held_k), u);
    }
    for j in (0..held_j).rev() {
        sweep_spans::<LOWER>(y, 1, model.y_links.below(j + 1 + ny * held_k), u);
    }
    for k in held_k + 1..nz {
        sweep_spans::<UPPER>(z, 2, model.z_links.below(k), u);
    }
    for k in (0..held_k).rev() {
        sweep_spans::<LOWER>(z, 2, model.z_links.below(k + 1), u);
    }
}
