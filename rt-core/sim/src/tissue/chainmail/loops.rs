//! The loops over rows, compiled once for each set of instructions and called. Inlined wherever they are used they were
//! some hundred copies, and 50 of the 52 s that this crate took to compile.

use super::kernels::{Kernels, Portable};
use super::sweep::{Inner, Pass};

/// Inner loops of passes over a body.
pub(super) trait Loops: Kernels {
    /// Sweeps one plane.
    fn plane(pass: &mut Pass, k: usize, inner_z: Option<Inner>);
    /// Verifies the links of one run.
    fn check_run(pass: &mut Pass, run: usize, j: usize, k: usize);
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
}
