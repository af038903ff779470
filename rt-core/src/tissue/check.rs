//! What a state is worth: its largest violation over all links.

use super::chainmail::{ChainMail, TissueState, violation};

/// Largest violation of a limit over all links, in elements; zero if there is none, infinite for a state
/// of another model.
pub fn largest_violation(model: &ChainMail, state: &TissueState) -> f64 {
    if state.fits(model) {
        f64::from(largest_violation_f32(model, state))
    } else {
        f64::INFINITY
    }
}

pub(super) fn largest_violation_f32(model: &ChainMail, state: &TissueState) -> f32 {
    let [x, y, z] = &model.limits.links;
    let u = state.u.each_ref().map(Vec::as_slice);
    let mut worst = 0.0_f32;
    for run in &model.runs {
        let (first, end) = (run.first as usize, run.end() as usize);
        let lo = u.map(|c| &c[first..end - 1]);
        let hi = u.map(|c| &c[first + 1..end]);
        worst = worst.max(violation(x, lo, hi));
    }
    let [ux, uy, uz] = u;
    let along_y = (y, &model.y_links, [uy, ux, uz]);
    let along_z = (z, &model.z_links, [uz, ux, uy]);
    for (limits, links, u) in [along_y, along_z] {
        for span in links.all() {
            let (lo, hi, len) = (span.lo as usize, span.hi as usize, span.len as usize);
            let lo = u.map(|c| &c[lo..lo + len]);
            let hi = u.map(|c| &c[hi..hi + len]);
            worst = worst.max(violation(limits, lo, hi));
        }
    }
    worst
}
