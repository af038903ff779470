//! Eight numbers side by side: in registers of the processor's width where it has them.
//!
//! Arrays of eight that a compiler makes vectors of itself are shuffled together from halves of other widths; these
//! types say which registers to use. Nothing is reordered or fused, so that all of them give the same bits.

use std::ops::{Add, Deref, DerefMut, Mul, Sub};

/// Numbers in a [`Eight`].
pub(crate) const LANES: usize = 8;

/// Eight numbers in memory, on a boundary from which no load of a whole register crosses into another cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Eight<T>(pub [T; LANES]);

impl<T> Deref for Eight<T> {
    type Target = [T; LANES];

    #[inline(always)]
    fn deref(&self) -> &[T; LANES] {
        &self.0
    }
}

impl<T> DerefMut for Eight<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T; LANES] {
        &mut self.0
    }
}

/// Arithmetic on eight numbers at once. [`Number::Wide`] may be used in functions alone that are compiled for AVX2 or
/// more.
pub trait Vector<T>: Copy {
    /// Loads eight numbers from memory.
    fn load(from: &[T; LANES]) -> Self;
    /// Stores eight numbers to memory.
    fn store(self, to: &mut [T; LANES]);
    /// Repeats a number eight times.
    fn splat(value: T) -> Self;
    /// Returns the eight sums.
    fn add(self, other: Self) -> Self;
    /// Returns the eight differences.
    fn sub(self, other: Self) -> Self;
    /// Returns the eight products.
    fn mul(self, other: Self) -> Self;
}

/// A number type with registers for eight of it.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Vector type for functions that are compiled for AVX2 or more.
    type Wide: Vector<Self>;
}

impl<T: Number> Vector<T> for Eight<T> {
    #[inline(always)]
    fn load(from: &[T; LANES]) -> Self {
        Eight(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [T; LANES]) {
        *to = self.0;
    }

    #[inline(always)]
    fn splat(value: T) -> Self {
        Eight([value; LANES])
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Eight(std::array::from_fn(|n| self.0[n] + other.0[n]))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Eight(std::array::from_fn(|n| self.0[n] - other.0[n]))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Eight(std::array::from_fn(|n| self.0[n] * other.0[n]))
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl Number for f32 {
    type Wide = Eight<f32>;
}

#[cfg(not(target_arch = "x86_64"))]
impl Number for f64 {
    type Wide = Eight<f64>;
}

#[cfg(target_arch = "x86_64")]
mod wide {
    use super::{LANES, Number, Vector};
    use std::arch::x86_64::*;

    /// Eight numbers of 32 bits in one register.
    #[derive(Clone, Copy)]
    pub struct Single(__m256);

    /// Eight numbers of 64 bits in two.
    #[derive(Clone, Copy)]
    pub struct Double(__m256d, __m256d);

    impl Number for f32 {
        type Wide = Single;
    }

    impl Number for f64 {
        type Wide = Double;
    }

    impl Vector<f32> for Single {
        #[inline(always)]
        fn load(from: &[f32; LANES]) -> Self {
            // SAFETY: eight numbers; AVX2 is there (trait's doc), here and below.
            Single(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [f32; LANES]) {
            // SAFETY: as above.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) };
        }

        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_set1_ps(value) })
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_sub_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
    }

    impl Vector<f64> for Double {
        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            let (low, high) = from.split_at(4);
            // SAFETY: four numbers each; AVX2 is there (trait's doc), here and below.
            unsafe { Double(_mm256_loadu_pd(low.as_ptr()), _mm256_loadu_pd(high.as_ptr())) }
        }

        #[inline(always)]
        fn store(self, to: &mut [f64; LANES]) {
            let (low, high) = to.split_at_mut(4);
            // SAFETY: as above.
            unsafe {
                _mm256_storeu_pd(low.as_mut_ptr(), self.0);
                _mm256_storeu_pd(high.as_mut_ptr(), self.1);
            }
        }

        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: as above.
            let one = unsafe { _mm256_set1_pd(value) };
            Double(one, one)
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe { Double(_mm256_add_pd(self.0, other.0), _mm256_add_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe { Double(_mm256_sub_pd(self.0, other.0), _mm256_sub_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: as above.
            unsafe { Double(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
        }
    }
}

/// Makes a function as `vectorised` does, whose body is written in vectors: its second parameter of type is
/// [`Number::Wide`] where there is AVX2, and [`Eight`] elsewhere. For one type of numbers: `<V: Vector<f64>>`, and `<V:
/// Vector<f64>, const B: usize>`.
macro_rules! in_vectors {
    (
        $(#[$attribute:meta])*
        fn $name:ident<$v:ident: Vector<$t:ty>, const $b:ident: usize>($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        pub(super) fn $name<const $b: usize>(simd: $crate::simd::Simd, $($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn generic<$v: $crate::simd::Vector<$t>, const $b: usize>($($argument: $type),*) $(-> $result)? $body

            $crate::simd::dispatch!(
                simd, [const $b: usize] [$b]
                [$crate::simd::Eight<$t>, $b] [<$t as $crate::simd::Number>::Wide, $b]
                ($($argument: $type),*) [$(-> $result)?]
            )
        }
    };
    (
        $(#[$attribute:meta])*
        fn $name:ident<$v:ident: Vector<$t:ty>>($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        pub(super) fn $name(simd: $crate::simd::Simd, $($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn generic<$v: $crate::simd::Vector<$t>>($($argument: $type),*) $(-> $result)? $body

            $crate::simd::dispatch!(
                simd, [] []
                [$crate::simd::Eight<$t>] [<$t as $crate::simd::Number>::Wide]
                ($($argument: $type),*) [$(-> $result)?]
            )
        }
    };
    (
        $(#[$attribute:meta])*
        fn $name:ident<$t:ident: $number:ident, $v:ident $(, $o:ident: $bound:ident)?>($($argument:ident: $type:ty),* $(,)?)
            $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        pub(super) fn $name<$t: $number $(, $o: $bound<$t>)?>(
            simd: $crate::simd::Simd,
            $($argument: $type),*
        ) $(-> $result)? {
            #[inline(always)]
            fn generic<$t: $number, $v: $crate::simd::Vector<$t> $(, $o: $bound<$t>)?>($($argument: $type),*) $(-> $result)? $body

            $crate::simd::dispatch!(
                simd, [$t: $number $(, $o: $bound<$t>)?] [$t $(, $o)?]
                [$t, $crate::simd::Eight<$t> $(, $o)?] [$t, <$t as $crate::simd::Number>::Wide $(, $o)?]
                ($($argument: $type),*) [$(-> $result)?]
            )
        }
    };
}
pub(crate) use in_vectors;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Simd;

    in_vectors! {
        fn mixed<T: Number, V>(a: &Eight<T>, b: &Eight<T>, c: T, to: &mut Eight<T>) {
            let (a, b) = (V::load(a), V::load(b));
            a.add(b).mul(V::splat(c)).sub(a.mul(b)).store(to);
        }
    }

    fn agrees<T: Number + PartialEq + std::fmt::Debug>(of: fn(f64) -> T) {
        let a = Eight(std::array::from_fn(|n| of(1.0 / (n as f64 + 0.3))));
        let b = Eight(std::array::from_fn(|n| of((n as f64 - 3.7) * 1e5)));
        for simd in Simd::all() {
            let mut c = Eight([of(0.0); LANES]);
            mixed(simd, &a, &b, of(0.1), &mut c);
            for n in 0..LANES {
                assert_eq!(c.0[n], (a.0[n] + b.0[n]) * of(0.1) - a.0[n] * b.0[n], "{simd:?}");
            }
        }
    }

    #[test]
    fn every_set_of_instructions_gives_the_same_bits() {
        agrees(|v| v as f32);
        agrees(|v| v);
    }
}
