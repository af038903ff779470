//! Ways back to a state without violations when outward sweeps alone do not get there.

use super::kernels;
use super::model::ChainMail;
use super::sweep::{ends, run_violation};
use crate::scene::Run;

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
    for &run in &model.runs {
        if run_violation(x, run, u) > 0.0 {
            project_run(x, run, upward, u);
        }
    }
}

fn project_run(limits: &crate::tissue::limits::LinkLimits, run: Run, upward: bool, u: &mut [Vec<f32>; 3]) {
    let (first, end) = (run.first as usize, run.end() as usize);
    let [x, y, z] = u.each_mut().map(|c| &mut c[first..end]);
    let links = x.len() - 1;
    for n in 0..links {
        let e = if upward { n } else { links - 1 - n };
        let (lo, hi) = ([x[e], y[e], z[e]], [x[e + 1], y[e + 1], z[e + 1]]);
        let [l, h] = kernels::projected(limits, lo, hi);
        [x[e], y[e], z[e]] = l;
        [x[e + 1], y[e + 1], z[e + 1]] = h;
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
