//! The kernels eight links at a time, with the same operations in the same order: the same bits.

use std::arch::x86_64::*;

use super::kernels::{Kernels, Scaled, Stretch, UPPER};

/// To be used only where the processor has AVX2 (`ChainMail::vectors`).
pub(crate) struct Avx2;

const LANES: usize = 8;

impl Kernels for Avx2 {
    #[inline(always)]
    fn clamp<const OUTER: bool>(l: &Scaled, u: &mut [&mut [f32]; 3], inner: usize, outer: usize, n: usize) -> Stretch {
        let len = u[0].len().min(u[1].len()).min(u[2].len());
        assert!(inner + n <= len && outer + n <= len);
        // SAFETY: both stretches are inside every component; AVX2 is there (type's doc).
        unsafe { clamp::<OUTER>(l, u.each_mut().map(|c| c.as_mut_ptr()), inner, outer, n, len) }
    }

    #[inline(always)]
    fn violation(l: &Scaled, u: &[&[f32]; 3], lo: usize, hi: usize, n: usize) -> f32 {
        let len = shortest(u);
        assert!(lo.max(hi) + n <= len);
        // SAFETY: as above.
        unsafe { violation(l, u.map(<[f32]>::as_ptr), lo, hi, n, len) }
    }

    #[inline(always)]
    fn first_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
        let len = shortest(u);
        assert!(start >= end || end < len);
        // SAFETY: as above; link `end - 1` reads element `end`.
        unsafe { first_violated(l, u.map(<[f32]>::as_ptr), start, end, len) }
    }

    #[inline(always)]
    fn past_last_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
        let len = shortest(u);
        assert!(start >= end || end < len);
        // SAFETY: as above.
        unsafe { past_last_violated(l, u.map(<[f32]>::as_ptr), start, end, len) }
    }

    #[inline(always)]
    fn largest_square(u: &[&[f32]; 3], start: usize, end: usize) -> f32 {
        assert!(start >= end || end <= shortest(u));
        // SAFETY: as above.
        unsafe { largest_square(u.map(<[f32]>::as_ptr), start, end) }
    }
}

#[inline(always)]
fn shortest(u: &[&[f32]; 3]) -> usize {
    u[0].len().min(u[1].len()).min(u[2].len())
}

struct Lanes {
    low: __m256,
    high: __m256,
    tan: __m256,
    rest: __m256,
    slack: __m256,
    sign: __m256,
}

#[target_feature(enable = "avx2")]
#[inline]
fn lanes(l: &Scaled) -> Lanes {
    Lanes {
        low: _mm256_set1_ps(l.low),
        high: _mm256_set1_ps(l.high),
        tan: _mm256_set1_ps(l.tan),
        rest: _mm256_set1_ps(l.rest),
        slack: _mm256_set1_ps(l.slack),
        sign: _mm256_set1_ps(-0.0),
    }
}

/// The first `n` of eight lanes, for n from 0 to 8.
#[target_feature(enable = "avx2")]
#[inline]
fn first_lanes(n: usize) -> __m256i {
    let number = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    _mm256_cmpgt_epi32(_mm256_set1_epi32(n as i32), number)
}

/// Eight values, or those of `mask` and zeros.
///
/// # Safety
/// The lanes that are read must be inside the slice that `p` points into.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn load<const ALL: bool>(p: *const f32, mask: __m256i) -> __m256 {
    // SAFETY: the caller's promise; masked lanes are not read.
    unsafe {
        if ALL {
            _mm256_loadu_ps(p)
        } else {
            _mm256_maskload_ps(p, mask)
        }
    }
}

/// # Safety
/// As for `load`, to be written.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn store<const ALL: bool>(p: *mut f32, mask: __m256i, value: __m256) {
    // SAFETY: the caller's promise; masked lanes are not written.
    unsafe {
        if ALL {
            _mm256_storeu_ps(p, value);
        } else {
            _mm256_maskstore_ps(p, mask, value);
        }
    }
}

/// # Safety
/// `inner..inner + n` and `outer..outer + n` must be inside each component, which all have `len` values.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn clamp<const OUTER: bool>(
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

#[target_feature(enable = "avx2")]
#[inline]
fn largest_lane(v: __m256) -> f32 {
    let half = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
    let pair = _mm_max_ps(half, _mm_movehl_ps(half, half));
    _mm_cvtss_f32(_mm_max_ss(pair, _mm_movehdup_ps(pair)))
}

/// # Safety
/// `lo..lo + n` and `hi..hi + n` must be inside each component.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn violation(l: &Scaled, u: [*const f32; 3], lo: usize, hi: usize, n: usize, len: usize) -> f32 {
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
unsafe fn first_violated(l: &Scaled, u: [*const f32; 3], start: usize, end: usize, len: usize) -> usize {
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
unsafe fn past_last_violated(l: &Scaled, u: [*const f32; 3], start: usize, end: usize, len: usize) -> usize {
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
unsafe fn largest_square(u: [*const f32; 3], start: usize, end: usize) -> f32 {
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
