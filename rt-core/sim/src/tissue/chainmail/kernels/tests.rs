//! Kernels on stretches that are not inside the components.

use super::*;
use crate::simd::{Eight, Simd};

/// These were asserts, which would have stopped the tissue loop.
#[test]
fn stretches_outside_the_components_are_cut_and_never_panic() {
    type V = Eight<f32>;
    let limits = LinkLimits {
        low: -0.45,
        high: 0.75,
        tan: 0.5,
    };
    let l = limits.scaled(1.0, 0.0);
    let rough = || [0, 1, 2].map(|c| (0..20).map(|e| ((7 * e + c) % 5) as f32 - 2.0).collect::<Vec<f32>>());
    let mut u = rough();
    let mut slices = u.each_mut().map(Vec::as_mut_slice);
    assert_eq!(clamp_all::<V, UPPER>(&l, &mut slices, 0, 20, 4), Stretch::EMPTY);
    assert_eq!(clamp_all::<V, LOWER>(&l, &mut slices, 30, 0, 4), Stretch::EMPTY);
    clamp_all::<V, UPPER>(&l, &mut slices, 0, 12, 100);
    assert_eq!(u[0][..12], rough()[0][..12], "inner ends stay");
    let u = rough();
    let slices = u.each_ref().map(Vec::as_slice);
    let inside = violation::<V>(&l, &slices, 0, 1, 19);
    assert_eq!(violation::<V>(&l, &slices, 0, 1, 500), inside);
    assert_eq!(violation::<V>(&l, &slices, 40, 41, 1), 0.0);
    assert_eq!(first_violated::<V>(&l, &slices, 0, 20), 20);
    assert_eq!(past_last_violated::<V>(&l, &slices, 3, 20), 3);
    for simd in Simd::all() {
        let square = |start, end| largest_square(simd, &slices, start, end);
        assert_eq!(square(0, 500), square(0, 20));
        assert_eq!(square(30, 40), 0.0);
    }
}
