//! Ways back to a state without violations when outward sweeps alone do not get there.

use super::kernels;
use super::model::ChainMail;
use super::sweep::{ends, run_violation};
use crate::scene::{MAX_CELLS_PER_AXIS, Run};
use crate::tissue::limits::LinkLimits;

/// One pass of orthogonal projections over all links, both ends giving half.
///
/// Projecting onto convex sets in turn, the held element's position among them, converges to a point in
/// all of them. Passes alternate in direction so that a correction travels both ways.
pub(super) fn project_all(model: &ChainMail, upward: bool, u: &mut [Vec<f32>; 3]) {
    let [x, y, z] = &model.limits.links;
    for (axis, limits, links) in [(1, y, &model.y_links), (2, z, &model.z_links)] {
        let spans = links.all();
        for n in 0..spans.len() {
            let span = spans[if upward { n } else { spans.len() - 1 - n }];
            let (lo, hi) = ends(u, axis, span);
            kernels::project(limits, lo, hi);
        }
    }
    let mut halves = Halves::new();
    for &run in &model.runs {
        if run_violation(x, run, u) > 0.0 {
            project_run(x, run, upward, u, &mut halves);
        }
    }
}

/// Every other element of a run: links of one half to the other do not share ends, so they go in vectors.
struct Halves {
    even: [[f32; HALF_RUN]; 3],
    odd: [[f32; HALF_RUN]; 3],
}

const HALF_RUN: usize = MAX_CELLS_PER_AXIS / 2;

impl Halves {
    fn new() -> Self {
        Halves {
            even: [[0.0; HALF_RUN]; 3],
            odd: [[0.0; HALF_RUN]; 3],
        }
    }
}

fn project_run(limits: &LinkLimits, run: Run, upward: bool, u: &mut [Vec<f32>; 3], halves: &mut Halves) {
    let (first, end) = (run.first as usize, run.end() as usize);
    let odd_count = (end - first) / 2;
    let even_count = end - first - odd_count;
    let even = halves.even.each_mut().map(|c| &mut c[..even_count]);
    let odd = halves.odd.each_mut().map(|c| &mut c[..odd_count]);
    let ([ex, ey, ez], [ox, oy, oz]) = (even, odd);
    for (component, even, odd) in [
        (0, &mut *ex, &mut *ox),
        (1, &mut *ey, &mut *oy),
        (2, &mut *ez, &mut *oz),
    ] {
        split(&u[component][first..end], even, odd);
    }
    for turn in [upward, !upward] {
        if turn {
            let n = odd_count;
            kernels::project(limits, [&mut ex[..n], &mut ey[..n], &mut ez[..n]], [ox, oy, oz]);
        } else {
            let n = even_count - 1;
            let lo = [&mut ox[..n], &mut oy[..n], &mut oz[..n]];
            kernels::project(limits, lo, [&mut ex[1..], &mut ey[1..], &mut ez[1..]]);
        }
    }
    for (component, even, odd) in [(0, ex, ox), (1, ey, oy), (2, ez, oz)] {
        join(even, odd, &mut u[component][first..end]);
    }
}

fn split(values: &[f32], even: &mut [f32], odd: &mut [f32]) {
    for (pair, (e, o)) in values.chunks_exact(2).zip(even.iter_mut().zip(odd)) {
        (*e, *o) = (pair[0], pair[1]);
    }
    if let ([last], Some(e)) = (values.chunks_exact(2).remainder(), even.last_mut()) {
        *e = *last;
    }
}

fn join(even: &[f32], odd: &[f32], values: &mut [f32]) {
    let mut pairs = values.chunks_exact_mut(2);
    for (pair, (e, o)) in pairs.by_ref().zip(even.iter().zip(odd)) {
        (pair[0], pair[1]) = (*e, *o);
    }
    if let ([last], Some(e)) = (pairs.into_remainder(), even.last()) {
        *last = *e;
    }
}

/// Pulls the held element's part of the body toward the body at rest moved as a whole, just far enough.
///
/// That body has no difference in displacement along any link, so scaling all differences reaches every
/// limit, and the scale is known in closed form: this always succeeds.
pub(super) fn reanchor(model: &ChainMail, held: usize, u: &mut [Vec<f32>; 3]) {
    let scale = smallest_scale(model, model.part[held], u);
    for component in u {
        let anchor = component[held];
        for (value, &part) in component.iter_mut().zip(&model.part) {
            if part == model.part[held] {
                *value = anchor + scale * (*value - anchor);
            }
        }
    }
}

fn smallest_scale(model: &ChainMail, part: u32, u: &[Vec<f32>; 3]) -> f32 {
    let [x, y, z] = &model.limits.links;
    let tolerance = 0.5 * model.limits.tolerance;
    let mut scale = 1.0_f32;
    let mut link = |limits, order: [usize; 3], lo: usize, hi: usize| {
        if model.part[lo] == part {
            let d = order.map(|axis| u[axis][hi] - u[axis][lo]);
            scale = scale.min(kernels::feasible_scale(limits, d, tolerance));
        }
    };
    for run in &model.runs {
        for e in run.first as usize + 1..run.end() as usize {
            link(x, [0, 1, 2], e - 1, e);
        }
    }
    let along_y = model.y_links.all().iter().map(|s| (y, [1, 0, 2], s));
    let along_z = model.z_links.all().iter().map(|s| (z, [2, 0, 1], s));
    for (limits, order, span) in along_y.chain(along_z) {
        for n in 0..span.len {
            link(limits, order, (span.lo + n) as usize, (span.hi + n) as usize);
        }
    }
    scale
}
