//! Relaxation of a segment eight elements at a time, with the operations of the portable one in its order.

use std::arch::x86_64::*;

use super::lanes::{LANES, first_lanes};
use crate::tissue::chainmail::segments::{LEFT, RIGHT, Segment};
use crate::tissue::chainmail::springs::{NEGLIGIBLE, Shares};

/// # Safety
/// The segment and the four beside it must be inside `u`, and so must the elements before and after it in its row
/// unless it is open there.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn relax(u: *mut f32, segment: &Segment, shares: &Shares) {
    let (first, len) = (segment.first as usize, segment.len as usize);
    let mut n = 0;
    // Elements of a row go all at once: a chunk is stored when the next has read its last element.
    let mut waiting: Option<__m256> = None;
    while n < len {
        let left = len - n;
        // SAFETY: chunks of eight lanes are inside the segment; lanes of a mask that are read, too.
        unsafe {
            let new = if left >= LANES
                && (left > LANES || segment.open & RIGHT == 0)
                && (n > 0 || segment.open & LEFT == 0)
            {
                whole(u, segment, shares, n)
            } else {
                masked(u, segment, shares, n, left.min(LANES))
            };
            if let Some(before) = waiting.replace(new) {
                _mm256_storeu_ps(u.add(first + n - LANES), before);
            }
        }
        n += LANES;
    }
    if let Some(last) = waiting {
        let from = n - LANES;
        // SAFETY: as above; the mask ends with the segment.
        unsafe { _mm256_maskstore_ps(u.add(first + from), first_lanes(len - from), last) };
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn combine(shares: &Shares, own: __m256, n: [__m256; 6]) -> __m256 {
    let share = |axis: usize, side: usize| _mm256_mul_ps(_mm256_set1_ps(shares.of[axis][side]), n[2 * axis + side]);
    let along = |axis: usize| _mm256_add_ps(share(axis, 0), share(axis, 1));
    let row = _mm256_add_ps(_mm256_mul_ps(_mm256_set1_ps(shares.own), own), along(0));
    let new = _mm256_add_ps(row, _mm256_add_ps(along(1), along(2)));
    let size = _mm256_andnot_ps(_mm256_set1_ps(-0.0), new);
    _mm256_and_ps(new, _mm256_cmp_ps::<_CMP_GT_OQ>(size, _mm256_set1_ps(NEGLIGIBLE)))
}

/// # Safety
/// As for `relax`; eight elements from the `n`th, each with both neighbours in its row.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn whole(u: *const f32, segment: &Segment, shares: &Shares, n: usize) -> __m256 {
    let e = segment.first as usize + n;
    // SAFETY: the caller's promise.
    unsafe {
        let beside = |side: usize| _mm256_loadu_ps(u.add(segment.beside[side] as usize + n));
        let row = [_mm256_loadu_ps(u.add(e - 1)), _mm256_loadu_ps(u.add(e + 1))];
        let neighbours = [row[0], row[1], beside(0), beside(1), beside(2), beside(3)];
        combine(shares, _mm256_loadu_ps(u.add(e)), neighbours)
    }
}

/// # Safety
/// As for `relax`; `count` elements from the `n`th.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn masked(u: *const f32, segment: &Segment, shares: &Shares, n: usize, count: usize) -> __m256 {
    let e = segment.first as usize + n;
    let here = first_lanes(count);
    let opens_left = n == 0 && segment.open & LEFT != 0;
    let opens_right = n + count == segment.len as usize && segment.open & RIGHT != 0;
    let lane_of_last = first_lanes(count - usize::from(opens_right));
    let lane_of_first = if opens_left {
        _mm256_andnot_si256(first_lanes(1), here)
    } else {
        here
    };
    // SAFETY: the caller's promise; lanes outside the masks are not read.
    unsafe {
        let own = _mm256_maskload_ps(u.add(e), here);
        let in_row = |p: *const f32, mask: __m256i| {
            _mm256_blendv_ps(own, _mm256_maskload_ps(p, mask), _mm256_castsi256_ps(mask))
        };
        let row = [
            in_row(u.wrapping_add(e).wrapping_sub(1), lane_of_first),
            in_row(u.wrapping_add(e + 1), lane_of_last),
        ];
        let beside = |side: usize| _mm256_maskload_ps(u.add(segment.beside[side] as usize + n), here);
        combine(
            shares,
            own,
            [row[0], row[1], beside(0), beside(1), beside(2), beside(3)],
        )
    }
}
