//! The largest violation of a state over all links.

use super::chainmail::{ChainMail, Scaled, TissueState, link_violation, ordered};

/// Returns the largest violation of a limit over all links, in elements; zero if there is none, infinite for a state of
/// another model.
///
/// Verifies every link by itself: the reference for what a step reports after verifying only what moved.
pub fn largest_violation(model: &ChainMail, state: &TissueState) -> f64 {
    if !state.fits(model) {
        return f64::INFINITY;
    }
    let rest = 1.0 / state.scale();
    let mut worst = 0.0_f32;
    for axis in 0..3 {
        let u = ordered(axis, state.u.each_ref().map(Vec::as_slice));
        for span in model.links[axis].all() {
            let l: Scaled = model.classes.limits(span.class, axis).scaled(rest, 0.0);
            for n in 0..span.len {
                let [lo, hi] = [span.lo, span.hi].map(|first| u.map(|c| c[(first + n) as usize]));
                worst = worst.max(link_violation(&l, lo, hi));
            }
        }
    }
    f64::from(worst / rest)
}
