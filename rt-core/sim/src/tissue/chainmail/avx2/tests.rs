//! Vector kernels on stretches that are not inside the components.

use super::*;
use crate::limits::LinkLimits;
use crate::tissue::chainmail::kernels::{LOWER, UPPER};

const LIMITS: LinkLimits = LinkLimits {
    low: -0.45,
    high: 0.75,
    tan: 0.5,
};

/// These were asserts, which would have stopped the tissue loop.
#[test]
fn stretches_outside_the_components_are_cut_and_never_panic() {
    if !is_x86_feature_detected!("avx2") {
        return;
    }
    let l = LIMITS.scaled(1.0, 0.0);
    let rough = || [0, 1, 2].map(|c| (0..20).map(|e| ((7 * e + c) % 5) as f32 - 2.0).collect::<Vec<f32>>());
    let mut u = rough();
    let mut slices = u.each_mut().map(Vec::as_mut_slice);
    assert_eq!(Avx2::clamp::<UPPER>(&l, &mut slices, 0, 20, 4), Stretch::EMPTY);
    assert_eq!(Avx2::clamp::<LOWER>(&l, &mut slices, 30, 0, 4), Stretch::EMPTY);
    Avx2::clamp::<UPPER>(&l, &mut slices, 0, 12, 100);
    assert_eq!(u[0][..12], rough()[0][..12], "inner ends stay");
    let u = rough();
    let slices = u.each_ref().map(Vec::as_slice);
    let inside = Avx2::violation(&l, &slices, 0, 1, 19);
    assert_eq!(Avx2::violation(&l, &slices, 0, 1, 500), inside);
    assert_eq!(Avx2::violation(&l, &slices, 40, 41, 1), 0.0);
    assert_eq!(Avx2::first_violated(&l, &slices, 0, 20), 20);
    assert_eq!(Avx2::past_last_violated(&l, &slices, 3, 20), 3);
    assert_eq!(
        Avx2::largest_square(&slices, 0, 500),
        Avx2::largest_square(&slices, 0, 20)
    );
    assert_eq!(Avx2::largest_square(&slices, 30, 40), 0.0);
}
