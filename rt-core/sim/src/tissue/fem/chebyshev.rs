//! Coefficients of the Chebyshev iteration that smooths a level, for one load and for eight.

/// Part of the spectrum, from the top, that the smoother damps.
const SMOOTHED: f64 = 5.0;

/// Yields `keep` and `gain` of each step of `d = keep d + gain (b - A x) / diagonal`, `x += d`, which damps the upper
/// part of a spectrum that ends at `top` evenly.
pub(super) fn steps(top: f64) -> impl Iterator<Item = [f64; 2]> {
    let bottom = top / SMOOTHED;
    let (middle, half) = (0.5 * (top + bottom), 0.5 * (top - bottom));
    let mut rho = half / middle;
    let further = std::iter::repeat_with(move || {
        let next = 1.0 / (2.0 * middle / half - rho);
        let step = [next * rho, 2.0 * next / half];
        rho = next;
        step
    });
    std::iter::once([0.0, 1.0 / middle]).chain(further)
}
