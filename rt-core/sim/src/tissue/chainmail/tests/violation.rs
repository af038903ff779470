//! The largest violation of a state over all links.

use crate::tissue::chainmail::kernels::{Scaled, ordered};
use crate::tissue::chainmail::{ChainMail, TissueState};

/// Returns the largest violation of a limit over all links, in elements; zero if there is none.
///
/// Verifies every link by itself: the reference for what a step reports after verifying only what moved.
pub(super) fn largest_violation(model: &ChainMail, state: &TissueState) -> f64 {
    let rest = 1.0 / state.scale();
    let mut worst = 0.0_f32;
    for axis in 0..3 {
        let u = ordered(axis, state.u.each_ref().map(Vec::as_slice));
        for span in model.links[axis].all() {
            let l = model.classes.limits(span.class, axis).scaled(rest, 0.0);
            for n in 0..span.len {
                let [lo, hi] = [span.lo, span.hi].map(|first| u.map(|c| c[(first + n) as usize]));
                worst = worst.max(link_violation(&l, lo, hi));
            }
        }
    }
    f64::from(worst / rest)
}

/// Returns the largest violation of one link; negative inside its limits.
fn link_violation(l: &Scaled, lo: [f32; 3], hi: [f32; 3]) -> f32 {
    let along = hi[0] - lo[0];
    let side = (hi[1] - lo[1]).abs().max((hi[2] - lo[2]).abs());
    (l.low - along).max(along - l.high).max(side - l.tan * (l.rest + along))
}
