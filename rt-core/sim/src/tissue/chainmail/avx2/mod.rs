//! The kernels eight links at a time, with the same operations in the same order: the same bits.
//!
//! Nothing here panics, since it runs inside a tick. Stretches that do not lie in the components are cut, or left alone
//! where a part of them means nothing; those of a model lie inside its state, which `TissueState::fits` verifies.

mod clamp;
mod lanes;
mod violation;

use super::kernels::{Kernels, Scaled, Stretch};

/// Kernels for processors with AVX2 (`ChainMail::vectors`), and for no other.
pub(crate) struct Avx2;

impl Kernels for Avx2 {
    #[inline(always)]
    fn clamp<const OUTER: bool>(l: &Scaled, u: &mut [&mut [f32]; 3], inner: usize, outer: usize, n: usize) -> Stretch {
        let len = u[0].len().min(u[1].len()).min(u[2].len());
        let n = n.min(len.saturating_sub(inner.max(outer)));
        // SAFETY: both stretches of `n` are inside every component; AVX2 is there (type's doc).
        unsafe { clamp::clamp::<OUTER>(l, u.each_mut().map(|c| c.as_mut_ptr()), inner, outer, n, len) }
    }

    #[inline(always)]
    fn violation(l: &Scaled, u: &[&[f32]; 3], lo: usize, hi: usize, n: usize) -> f32 {
        let len = shortest(u);
        let n = n.min(len.saturating_sub(lo.max(hi)));
        // SAFETY: as above.
        unsafe { violation::violation(l, u.map(<[f32]>::as_ptr), lo, hi, n, len) }
    }

    #[inline(always)]
    fn first_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
        let len = shortest(u);
        if start >= end || end >= len {
            return end;
        }
        // SAFETY: elements `start..=end` are inside every component: link `end - 1` reads element `end`; AVX2 is there.
        unsafe { violation::first_violated(l, u.map(<[f32]>::as_ptr), start, end, len) }
    }

    #[inline(always)]
    fn past_last_violated(l: &Scaled, u: &[&[f32]; 3], start: usize, end: usize) -> usize {
        let len = shortest(u);
        if start >= end || end >= len {
            return start;
        }
        // SAFETY: as above.
        unsafe { violation::past_last_violated(l, u.map(<[f32]>::as_ptr), start, end, len) }
    }

    #[inline(always)]
    fn largest_square(u: &[&[f32]; 3], start: usize, end: usize) -> f32 {
        let end = end.min(shortest(u));
        // SAFETY: `start..end` is empty or inside every component; AVX2 is there.
        unsafe { violation::largest_square(u.map(<[f32]>::as_ptr), start, end) }
    }
}

#[inline(always)]
fn shortest(u: &[&[f32]; 3]) -> usize {
    u[0].len().min(u[1].len()).min(u[2].len())
}

#[cfg(test)]
mod tests;
