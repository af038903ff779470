//! Vector instructions of the processor, detected when a model is built.

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

    /// Returns every set that this processor has.
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

/// Returns the sum of products, in `N` sums side by side.
#[inline(always)]
pub(crate) fn dot<const N: usize>(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; N];
    let (of_a, of_b) = (a.as_chunks::<N>(), b.as_chunks::<N>());
    for (a, b) in of_a.0.iter().zip(of_b.0) {
        for n in 0..N {
            sums[n] += a[n] * b[n];
        }
    }
    let whole = N * of_a.0.len().min(of_b.0.len());
    let rest: f64 = a[whole..].iter().zip(&b[whole..]).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// Compiles the caller's function `generic` for each set of instructions and calls the one for `$simd`: with the types
/// `$portable`, or `$wide` where there is AVX2 or more.
///
/// Nothing below it may be a closure: what is called from several places is not inlined, and only what is inlined is
/// compiled for the instructions of its caller. `vector_instructions_are_inlined` looks for calls in `rt-core`.
macro_rules! dispatch {
    (
        $simd:ident, [$($generics:tt)*] [$($names:tt)*] [$($portable:tt)*] [$($wide:tt)*]
        ($($argument:ident: $type:ty),*) [$($result:tt)*]
    ) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn avx2<$($generics)*>($($argument: $type),*) $($result)* {
            generic::<$($wide)*>($($argument),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512vl")]
        fn avx512<$($generics)*>($($argument: $type),*) $($result)* {
            generic::<$($wide)*>($($argument),*)
        }

        match $simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` has found AVX-512F and VL.
            $crate::simd::Simd::Avx512 => unsafe { avx512::<$($names)*>($($argument),*) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` has found AVX2.
            $crate::simd::Simd::Avx2 => unsafe { avx2::<$($names)*>($($argument),*) },
            $crate::simd::Simd::Portable => generic::<$($portable)*>($($argument),*),
        }
    }};
}
pub(crate) use dispatch;

/// Makes a function that is compiled for each set of instructions and takes the one to use as its first argument.
macro_rules! vectorised {
    (
        $(#[$attribute:meta])*
        fn $name:ident$(<$t:ident $(, $o:ident: $bound:ident)?>)?($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        pub(super) fn $name$(<$t: Real $(, $o: $bound<$t>)?>)?(simd: Simd, $($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn generic$(<$t: Real $(, $o: $bound<$t>)?>)?($($argument: $type),*) $(-> $result)? $body

            $crate::simd::dispatch!(
                simd, [$($t: Real $(, $o: $bound<$t>)?)?] [$($t $(, $o)?)?] [$($t $(, $o)?)?] [$($t $(, $o)?)?]
                ($($argument: $type),*) [$(-> $result)?]
            )
        }
    };
}
pub(crate) use vectorised;
