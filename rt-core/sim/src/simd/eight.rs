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
pub trait Vector<T: Number>: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Loads eight numbers from memory.
    fn load(from: &[T; LANES]) -> Self;
    /// Stores eight numbers to memory.
    fn store(self, to: &mut [T; LANES]);
    /// Repeats a number eight times.
    fn splat(value: T) -> Self;

    /// Returns the numbers as they lie in memory.
    #[inline(always)]
    fn numbers(self) -> [T; LANES] {
        let mut numbers = [T::default(); LANES];
        self.store(&mut numbers);
        numbers
    }

    /// Loads as many numbers as there are, at most eight; zeros for the others.
    #[inline(always)]
    fn load_first(from: &[T]) -> Self {
        Self::load(&std::array::from_fn(|n| from.get(n).copied().unwrap_or_default()))
    }

    /// Stores as many numbers as there is room for, at most eight.
    #[inline(always)]
    fn store_first(self, to: &mut [T]) {
        to.iter_mut().zip(self.numbers()).for_each(|(to, number)| *to = number);
    }

    /// Returns the numbers that are less than those of `other`, and those of `other` elsewhere.
    #[inline(always)]
    fn lesser(self, other: Self) -> Self {
        let (a, b) = (self.numbers(), other.numbers());
        Self::load(&std::array::from_fn(|n| if a[n] < b[n] { a[n] } else { b[n] }))
    }

    /// Returns the numbers that are greater than those of `other`, and those of `other` elsewhere.
    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        let (a, b) = (self.numbers(), other.numbers());
        Self::load(&std::array::from_fn(|n| if a[n] > b[n] { a[n] } else { b[n] }))
    }

    /// Returns the sizes of the numbers.
    #[inline(always)]
    fn abs(self) -> Self {
        self.greater(Self::splat(T::default()) - self)
    }

    /// Returns which numbers are greater than those of `other`, a bit each.
    #[inline(always)]
    fn above(self, other: Self) -> u32 {
        let (a, b) = (self.numbers(), other.numbers());
        (0..LANES).fold(0, |bits, n| bits | u32::from(a[n] > b[n]) << n)
    }

    /// Returns the numbers of `yes` where the bit is set, those of `no` elsewhere.
    #[inline(always)]
    fn select(bits: u32, yes: Self, no: Self) -> Self {
        let (yes, no) = (yes.numbers(), no.numbers());
        Self::load(&std::array::from_fn(
            |n| if bits >> n & 1 == 1 { yes[n] } else { no[n] },
        ))
    }
}

/// A number type with registers for eight of it.
pub trait Number: Copy + Default + PartialOrd + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
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
}

impl<T: Number> Add for Eight<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Eight(std::array::from_fn(|n| self.0[n] + other.0[n]))
    }
}

impl<T: Number> Sub for Eight<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Eight(std::array::from_fn(|n| self.0[n] - other.0[n]))
    }
}

impl<T: Number> Mul for Eight<T> {
    type Output = Self;

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
    use std::ops::{Add, Mul, Sub};

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

    macro_rules! operators {
        ($($trait:ident $method:ident $single:ident $double:ident,)*) => {$(
            impl $trait for Single {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: AVX2 is there (trait's doc), here and below.
                    Single(unsafe { $single(self.0, other.0) })
                }
            }

            impl $trait for Double {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: as above.
                    unsafe { Double($double(self.0, other.0), $double(self.1, other.1)) }
                }
            }
        )*};
    }
    operators! {
        Add add _mm256_add_ps _mm256_add_pd,
        Sub sub _mm256_sub_ps _mm256_sub_pd,
        Mul mul _mm256_mul_ps _mm256_mul_pd,
    }

    impl Vector<f32> for Single {
        #[inline(always)]
        fn load(from: &[f32; LANES]) -> Self {
            // SAFETY: eight numbers.
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
        fn lesser(self, other: Self) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_min_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn greater(self, other: Self) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: as above.
            Single(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }

        #[inline(always)]
        fn above(self, other: Self) -> u32 {
            // SAFETY: as above.
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0)) as u32 }
        }

        #[inline(always)]
        fn select(bits: u32, yes: Self, no: Self) -> Self {
            // SAFETY: as above.
            unsafe {
                let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                let is_set = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(bits as i32), lane), lane);
                Single(_mm256_blendv_ps(no.0, yes.0, _mm256_castsi256_ps(is_set)))
            }
        }
    }

    impl Vector<f64> for Double {
        #[inline(always)]
        fn load(from: &[f64; LANES]) -> Self {
            let (low, high) = from.split_at(4);
            // SAFETY: four numbers each.
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
        fn mixed<T: Number, V>(a: &Eight<T>, b: &Eight<T>, c: T, to: &mut [Eight<T>; 3]) {
            let (a, b, c) = (V::load(a), V::load(b), V::splat(c));
            ((a + b) * c - a * b).store(&mut to[0]);
            V::select((a * c).above(b) ^ 0b110, a.lesser(b).greater(c), b.abs()).store(&mut to[1]);
            V::load_first(&to[0][..5]).store_first(&mut to[2][1..]);
        }
    }

    fn agrees<T: Number + PartialEq + std::fmt::Debug>(of: fn(f64) -> T) {
        let a = Eight(std::array::from_fn(|n| of(1.0 / (n as f64 + 0.3))));
        let b = Eight(std::array::from_fn(|n| of((n as f64 - 3.7) * 1e5)));
        let c = of(0.1);
        for simd in Simd::all() {
            let mut to = [Eight([of(0.0); LANES]); 3];
            mixed(simd, &a, &b, c, &mut to);
            for n in 0..LANES {
                let (a, b) = (a.0[n], b.0[n]);
                assert_eq!(to[0].0[n], (a + b) * c - a * b, "{simd:?}");
                let is_yes = (a * c > b) != [1, 2].contains(&n);
                let least = if a < b { a } else { b };
                let size = if b < of(0.0) { of(0.0) - b } else { b };
                let clamped = if least > c { least } else { c };
                assert_eq!(to[1].0[n], if is_yes { clamped } else { size }, "{simd:?} {n}");
            }
            assert_eq!(to[2].0[1..6], to[0].0[..5], "{simd:?}");
            assert_eq!(to[2].0[6..], [of(0.0); 2], "{simd:?}");
        }
    }

    #[test]
    fn every_set_of_instructions_gives_the_same_bits() {
        agrees(|v| v as f32);
        agrees(|v| v);
    }
}
