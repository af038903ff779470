//! Moves the outer ends of links into their limits.

use std::arch::x86_64::*;

use super::lanes::{LANES, Lanes, first_lanes, lanes, load, store};
use crate::tissue::chainmail::kernels::{Scaled, Stretch, UPPER};

/// # Safety
/// `inner..inner + n` and `outer..outer + n` must be inside each component, which all have `len` values.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) unsafe fn clamp<const OUTER: bool>(
    l: &Scaled,
    u: [*mut f32; 3],
    inner: usize,
    outer: usize,
    n: usize,
    len: usize,
) -> Stretch {
    let l = lanes(l);
    let mut hull = Stretch::EMPTY;
    let mut e = 0;
    while e < n {
        let left = n - e;
        let ends_inside = inner.max(outer) + e + LANES <= len;
        // SAFETY: all eight are before `len`, or those of the mask before `n`.
        let moved = unsafe {
            if left >= LANES {
                clamp_eight::<OUTER, true, true>(&l, u, inner + e, outer + e, _mm256_setzero_si256())
            } else if ends_inside {
                clamp_eight::<OUTER, true, false>(&l, u, inner + e, outer + e, first_lanes(left))
            } else {
                clamp_eight::<OUTER, false, false>(&l, u, inner + e, outer + e, first_lanes(left))
            }
        };
        if moved != 0 {
            hull = hull.with(Stretch {
                start: e as u32 + moved.trailing_zeros(),
                end: e as u32 + 32 - moved.leading_zeros(),
            });
        }
        e += LANES;
    }
    hull
}

/// The lanes that had to move: of all eight, or of `mask`. Loads and stores whole vectors where it may, even if some
/// lanes are not to move: stores under a mask hold up the loads that follow.
///
/// # Safety
/// As for `clamp`, for eight lanes if `WHOLE`, else for those of `mask`.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn clamp_eight<const OUTER: bool, const WHOLE: bool, const ALL: bool>(
    l: &Lanes,
    [a, b, c]: [*mut f32; 3],
    inner: usize,
    outer: usize,
    mask: __m256i,
) -> u32 {
    // SAFETY: the caller's promise.
    let (ia, ib, ic, oa, ob, oc) = unsafe {
        (
            load::<WHOLE>(a.add(inner), mask),
            load::<WHOLE>(b.add(inner), mask),
            load::<WHOLE>(c.add(inner), mask),
            load::<WHOLE>(a.add(outer), mask),
            load::<WHOLE>(b.add(outer), mask),
            load::<WHOLE>(c.add(outer), mask),
        )
    };
    let d = if OUTER == UPPER {
        _mm256_sub_ps(oa, ia)
    } else {
        _mm256_sub_ps(ia, oa)
    };
    let along = _mm256_min_ps(_mm256_max_ps(d, l.low), l.high);
    let new_a = if OUTER == UPPER {
        _mm256_add_ps(ia, along)
    } else {
        _mm256_sub_ps(ia, along)
    };
    let moved_a = beyond(l, d, along);
    let shear = _mm256_mul_ps(l.tan, _mm256_add_ps(l.rest, along));
    let (new_b, moved_b) = clamp_side(l, shear, ib, ob);
    let (new_c, moved_c) = clamp_side(l, shear, ic, oc);
    let live = |moved: __m256| {
        if ALL {
            moved
        } else {
            _mm256_and_ps(moved, _mm256_castsi256_ps(mask))
        }
    };
    let (moved_a, moved_b, moved_c) = (live(moved_a), live(moved_b), live(moved_c));
    let moved = _mm256_movemask_ps(_mm256_or_ps(moved_a, _mm256_or_ps(moved_b, moved_c)));
    if moved != 0 {
        // SAFETY: the caller's promise.
        unsafe {
            store::<WHOLE>(a.add(outer), mask, _mm256_blendv_ps(oa, new_a, moved_a));
            store::<WHOLE>(b.add(outer), mask, _mm256_blendv_ps(ob, new_b, moved_b));
            store::<WHOLE>(c.add(outer), mask, _mm256_blendv_ps(oc, new_c, moved_c));
        }
    }
    moved as u32
}

#[target_feature(enable = "avx2")]
#[inline]
fn clamp_side(l: &Lanes, shear: __m256, inner: __m256, outer: __m256) -> (__m256, __m256) {
    let d = _mm256_sub_ps(outer, inner);
    let kept = _mm256_min_ps(_mm256_max_ps(d, _mm256_xor_ps(shear, l.sign)), shear);
    (_mm256_add_ps(inner, kept), beyond(l, d, kept))
}

#[target_feature(enable = "avx2")]
#[inline]
fn beyond(l: &Lanes, d: __m256, kept: __m256) -> __m256 {
    let over = _mm256_andnot_ps(l.sign, _mm256_sub_ps(d, kept));
    _mm256_cmp_ps::<_CMP_GT_OQ>(over, l.slack)
}
