//! Eight values at a time: constants, masks, loads and stores.

use std::arch::x86_64::*;

use crate::tissue::chainmail::kernels::Scaled;

/// Values in a vector.
pub(super) const LANES: usize = 8;

/// Limits of a link, the same in every lane.
pub(super) struct Lanes {
    pub low: __m256,
    pub high: __m256,
    pub tan: __m256,
    pub rest: __m256,
    pub slack: __m256,
    pub sign: __m256,
}

#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn lanes(l: &Scaled) -> Lanes {
    Lanes {
        low: _mm256_set1_ps(l.low),
        high: _mm256_set1_ps(l.high),
        tan: _mm256_set1_ps(l.tan),
        rest: _mm256_set1_ps(l.rest),
        slack: _mm256_set1_ps(l.slack),
        sign: _mm256_set1_ps(-0.0),
    }
}

/// Returns the first `n` of eight lanes, for n from 0 to 8.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn first_lanes(n: usize) -> __m256i {
    let number = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    _mm256_cmpgt_epi32(_mm256_set1_epi32(n as i32), number)
}

/// Eight values, or those of `mask` and zeros.
///
/// # Safety
/// The lanes that are read must be inside the slice that `p` points into.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) unsafe fn load<const ALL: bool>(p: *const f32, mask: __m256i) -> __m256 {
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
pub(super) unsafe fn store<const ALL: bool>(p: *mut f32, mask: __m256i, value: __m256) {
    // SAFETY: the caller's promise; masked lanes are not written.
    unsafe {
        if ALL {
            _mm256_storeu_ps(p, value);
        } else {
            _mm256_maskstore_ps(p, mask, value);
        }
    }
}

#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn largest_lane(v: __m256) -> f32 {
    let half = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
    let pair = _mm_max_ps(half, _mm_movehl_ps(half, half));
    _mm_cvtss_f32(_mm_max_ss(pair, _mm_movehdup_ps(pair)))
}
