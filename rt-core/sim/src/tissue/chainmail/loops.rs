//! The loops over rows, compiled once for each set of instructions and called. Inlined wherever they are used they were
//! some hundred copies, and 50 of the 52 s that this crate took to compile.

use super::held::Grip;
use super::kernels::{Kernels, Portable};
use super::model::ChainMail;
use super::relax;
use super::springs::RowSprings;
use super::state::TissueState;
use super::sweep::{Inner, Pass};
use crate::limits::Relaxation;

/// Inner loops of passes over a body.
pub(super) trait Loops: Kernels + RowSprings {
    /// Sweeps one plane.
    fn plane(pass: &mut Pass, k: usize, inner_z: Option<Inner>);
    /// Verifies the links of one run.
    fn check_run(pass: &mut Pass, run: usize, j: usize, k: usize);
    /// Relaxes the rows whose j + k is even (`parity` 0) or odd (1).
    fn relax_rows(model: &ChainMail, state: &mut TissueState, grip: Option<&Grip>, springs: &Relaxation, parity: usize);
}

impl Loops for Portable {
    #[inline(never)]
    fn plane(pass: &mut Pass, k: usize, inner_z: Option<Inner>) {
        pass.plane::<Self>(k, inner_z);
    }

    #[inline(never)]
    fn check_run(pass: &mut Pass, run: usize, j: usize, k: usize) {
        pass.check_run::<Self>(run, j, k);
    }

    #[inline(never)]
    fn relax_rows(
        model: &ChainMail,
        state: &mut TissueState,
        grip: Option<&Grip>,
        springs: &Relaxation,
        parity: usize,
    ) {
        relax::half_pass::<Self>(model, state, grip, springs, parity);
    }
}

#[cfg(target_arch = "x86_64")]
impl Loops for super::avx2::Avx2 {
    fn plane(pass: &mut Pass, k: usize, inner_z: Option<Inner>) {
        #[target_feature(enable = "avx2")]
        fn plane(pass: &mut Pass, k: usize, inner_z: Option<Inner>) {
            pass.plane::<super::avx2::Avx2>(k, inner_z);
        }
        // SAFETY: AVX2 is there (type's doc).
        unsafe { plane(pass, k, inner_z) }
    }

    fn check_run(pass: &mut Pass, run: usize, j: usize, k: usize) {
        #[target_feature(enable = "avx2")]
        fn check_run(pass: &mut Pass, run: usize, j: usize, k: usize) {
            pass.check_run::<super::avx2::Avx2>(run, j, k);
        }
        // SAFETY: as above.
        unsafe { check_run(pass, run, j, k) }
    }

    fn relax_rows(
        model: &ChainMail,
        state: &mut TissueState,
        grip: Option<&Grip>,
        springs: &Relaxation,
        parity: usize,
    ) {
        #[target_feature(enable = "avx2")]
        fn relax_rows(
            m: &ChainMail,
            state: &mut TissueState,
            grip: Option<&Grip>,
            springs: &Relaxation,
            parity: usize,
        ) {
            relax::half_pass::<super::avx2::Avx2>(m, state, grip, springs, parity);
        }
        // SAFETY: as above.
        unsafe { relax_rows(model, state, grip, springs, parity) }
    }
}
