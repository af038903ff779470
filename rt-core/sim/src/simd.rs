//! Which vector instructions the processor has, found when a model is built.

mod eight;

pub(crate) use eight::{Eight, LANES, Number, Vector, in_vectors};

/// The results are the same with all of them: nothing is reordered or fused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Simd {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Simd {
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512vl") {
            return Simd::Avx512;
        }
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Simd::Avx2;
        }
        Simd::Portable
    }

    /// Every set that this processor has.
    #[cfg(test)]
    pub fn all() -> Vec<Self> {
        let best = Simd::detect();
        #[cfg(target_arch = "x86_64")]
        if best == Simd::Avx512 {
            return vec![Simd::Portable, Simd::Avx2, best];
        }
        vec![Simd::Portable, best]
    }
}

/// Makes a function that is compiled for each set of instructions and takes the one to use as its first argument.
///
/// A closure would not do: what is called from several places is not inlined, and only what is inlined is compiled for the
/// instructions of its caller.
macro_rules! vectorised {
    (
        $(#[$attribute:meta])*
        fn $name:ident$(<$t:ident $(, $o:ident: $bound:ident)?>)?($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        pub(super) fn $name$(<$t: Real $(, $o: $bound<$t>)?>)?(simd: Simd, $($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn portable$(<$t: Real $(, $o: $bound<$t>)?>)?($($argument: $type),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            fn avx2$(<$t: Real $(, $o: $bound<$t>)?>)?($($argument: $type),*) $(-> $result)? {
                portable($($argument),*)
            }

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512vl")]
            fn avx512$(<$t: Real $(, $o: $bound<$t>)?>)?($($argument: $type),*) $(-> $result)? {
                portable($($argument),*)
            }

            match simd {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: `detect` has found AVX-512F and VL.
                Simd::Avx512 => unsafe { avx512($($argument),*) },
                #[cfg(target_arch = "x86_64")]
                // SAFETY: `detect` has found AVX2.
                Simd::Avx2 => unsafe { avx2($($argument),*) },
                Simd::Portable => portable($($argument),*),
            }
        }
    };
}
pub(crate) use vectorised;
