//! Violation of the limits of links, and distance of elements from rest.

use std::arch::x86_64::*;

use super::lanes::{LANES, Lanes, first_lanes, lanes, largest_lane, load};
use crate::tissue::chainmail::kernels::Scaled;

/// # Safety
/// As for `load`, at both places of each component.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn violation_eight<const ALL: bool>(
    l: &Lanes,
    [a, b, c]: [*const f32; 3],
    lo: usize,
    hi: usize,
    mask: __m256i,
) -> __m256 {
    // SAFETY: the caller's promise.
    let (along, d1, d2) = unsafe {
        (
            _mm256_sub_ps(load::<ALL>(a.add(hi), mask), load::<ALL>(a.add(lo), mask)),
            _mm256_sub_ps(load::<ALL>(b.add(hi), mask), load::<ALL>(b.add(lo), mask)),
            _mm256_sub_ps(load::<ALL>(c.add(hi), mask), load::<ALL>(c.add(lo), mask)),
        )
    };
    let stretch = _mm256_max_ps(_mm256_sub_ps(l.low, along), _mm256_sub_ps(along, l.high));
    let side = _mm256_max_ps(_mm256_andnot_ps(l.sign, d1), _mm256_andnot_ps(l.sign, d2));
    let shear = _mm256_mul_ps(l.tan, _mm256_add_ps(l.rest, along));
    _mm256_max_ps(stretch, _mm256_sub_ps(side, shear))
}

/// Violations of the first `n` links; zero or less for the other lanes.
///
/// # Safety
/// `n` elements from both places must be inside each component, which all have `len` values.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn violation_tail(l: &Lanes, u: [*const f32; 3], [lo, hi]: [usize; 2], n: usize, len: usize) -> __m256 {
    let mask = first_lanes(n);
    // SAFETY: whole vectors where they end inside, else the caller's promise; lanes that are not read count as at
    // rest, within every limit.
    unsafe {
        if lo.max(hi) + LANES <= len {
            let found = violation_eight::<true>(l, u, lo, hi, mask);
            _mm256_and_ps(found, _mm256_castsi256_ps(mask))
        } else {
            violation_eight::<false>(l, u, lo, hi, mask)
        }
    }
}

/// # Safety
/// `lo..lo + n` and `hi..hi + n` must be inside each component.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) unsafe fn violation(l: &Scaled, u: [*const f32; 3], lo: usize, hi: usize, n: usize, len: usize) -> f32 {
    let l = lanes(l);
    let mut worst = _mm256_setzero_ps();
    let mut e = 0;
    while e + LANES <= n {
        // SAFETY: eight lanes before `n`.
        let found = unsafe { violation_eight::<true>(&l, u, lo + e, hi + e, _mm256_setzero_si256()) };
        worst = _mm256_max_ps(found, worst);
        e += LANES;
    }
    if e < n {
        // SAFETY: all eight are before `len`, or the lanes of the mask before `n`.
        let found = unsafe { violation_tail(&l, u, [lo + e, hi + e], n - e, len) };
        worst = _mm256_max_ps(found, worst);
    }
    largest_lane(worst)
}

/// Links of `e..e + 8` before `end` that are violated by more than the slack.
///
/// # Safety
/// Elements `e..=end` must be inside each component.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn violated(l: &Lanes, u: [*const f32; 3], e: usize, end: usize, len: usize) -> u32 {
    let left = end - e;
    // SAFETY: the caller's promise.
    let found = unsafe {
        if left >= LANES {
            violation_eight::<true>(l, u, e, e + 1, _mm256_setzero_si256())
        } else {
            violation_tail(l, u, [e, e + 1], left, len)
        }
    };
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(found, l.slack)) as u32
}

/// # Safety
/// Elements `start..=end` must be inside each component.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) unsafe fn first_violated(l: &Scaled, u: [*const f32; 3], start: usize, end: usize, len: usize) -> usize {
    let l = lanes(l);
    let mut e = start;
    while e < end {
        // SAFETY: `start <= e < end`.
        let found = unsafe { violated(&l, u, e, end, len) };
        if found != 0 {
            return e + found.trailing_zeros() as usize;
        }
        e += LANES;
    }
    end
}

/// # Safety
/// Elements `start..=end` must be inside each component.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) unsafe fn past_last_violated(l: &Scaled, u: [*const f32; 3], start: usize, end: usize, len: usize) -> usize {
    let l = lanes(l);
    let mut past = end;
    while past > start {
        let e = past.saturating_sub(LANES).max(start);
        // SAFETY: `start <= e < past <= end`.
        let found = unsafe { violated(&l, u, e, past, len) };
        if found != 0 {
            return e + 32 - found.leading_zeros() as usize;
        }
        past = e;
    }
    start
}

/// # Safety
/// `start..end` must be inside each component.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) unsafe fn largest_square(u: [*const f32; 3], start: usize, end: usize) -> f32 {
    let mut largest = _mm256_setzero_ps();
    let mut e = start;
    while e < end {
        let left = end - e;
        // SAFETY: all eight, or those of the mask, are before `end`.
        let square = unsafe {
            if left >= LANES {
                square_eight::<true>(u, e, _mm256_setzero_si256())
            } else {
                square_eight::<false>(u, e, first_lanes(left))
            }
        };
        largest = _mm256_max_ps(square, largest);
        e += LANES;
    }
    largest_lane(largest)
}

/// # Safety
/// As for `load`.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn square_eight<const ALL: bool>([a, b, c]: [*const f32; 3], e: usize, mask: __m256i) -> __m256 {
    // SAFETY: the caller's promise.
    let (x, y, z) = unsafe {
        (
            load::<ALL>(a.add(e), mask),
            load::<ALL>(b.add(e), mask),
            load::<ALL>(c.add(e), mask),
        )
    };
    let xy = _mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y));
    _mm256_add_ps(xy, _mm256_mul_ps(z, z))
}
