//! The forces of a row of cubic elements on their corners.
//!
//! The eight corner values of a component are turned into the coefficients of 1, x, y, z, xy, yz, zx, xyz (up to a
//! factor: a Walsh-Hadamard transform, 24 additions). In these a cube's stiffness falls into blocks of at most three,
//! by symmetry, for any isotropic material, and both integrations differ in one coefficient only. That is a third of
//! the arithmetic of the 24 x 24 matrix, and there is no matrix to load.

use super::lanes::{LANES, each, lanes, lanes_mut};
use super::material::{Integration, Material};
use super::real::Real;
use std::ops::{Add, Mul, Sub};

/// Elements done at once; their scratch stays in the first-level cache.
pub(super) const CHUNK: usize = 64;

/// Twelve lines that carry the part even in x of the forces, twelve the odd part; by component, then corner of the row.
pub(super) type Scratch<T> = [[T; CHUNK + LANES]; 24];

/// Stiffness of one cell, N/m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Stiffness {
    /// lambda h / 16, for the mean dilatation.
    pub mean: f64,
    /// lambda' h / 48, for dilatation that varies inside the element: lambda if fully integrated, -2/3 mu if the
    /// deviatoric part alone remains.
    pub varying: f64,
    /// mu h / 16.
    pub shear: f64,
}

impl Stiffness {
    pub fn of(material: &Material, edge_m: f64) -> Self {
        let (lambda, mu) = material.lame_pa();
        let varying = match material.integration {
            Integration::Full => lambda,
            Integration::MeanDilatation => -2.0 / 3.0 * mu,
        };
        Stiffness {
            mean: lambda * edge_m / 16.0,
            varying: varying * edge_m / 48.0,
            shear: mu * edge_m / 16.0,
        }
    }

    /// Returns the element's entry on the diagonal, the same for each corner and component.
    pub fn diagonal(&self) -> f64 {
        let Stiffness { mean, varying, shear } = *self;
        mean + 4.0 * shear + 2.0 * (varying + shear) + 2.0 / 3.0 * shear + (varying + 4.0 / 3.0 * shear) / 3.0
    }

    /// Returns the largest eigenvalue of the element's matrix.
    pub fn largest_eigenvalue(&self) -> f64 {
        let Stiffness { mean, varying, shear } = *self;
        let of_blocks = [
            2.0 * shear + 3.0 * mean,
            2.0 * shear,
            shear + 2.0 * varying,
            shear * 4.0 / 3.0,
        ];
        8.0 * of_blocks.into_iter().fold(0.0, f64::max)
    }
}

/// A number, or a vector of them: each is computed with alike.
pub(super) trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}

impl<A: Copy + Add<Output = A> + Sub<Output = A> + Mul<Output = A>> Lane for A {}

/// Returns sums and differences of four corners of a face: 1, y, z, yz.
#[inline(always)]
pub(super) fn across<A: Lane>([a, b, c, d]: [A; 4]) -> [A; 4] {
    let (low, high) = (a + b, c + d);
    let (low_y, high_y) = (b - a, d - c);
    [low + high, low_y + high_y, high - low, high_y - low_y]
}

/// Applies the transpose of `across`.
#[inline(always)]
pub(super) fn corners<A: Lane>([one, y, z, yz]: [A; 4]) -> [A; 4] {
    let (low, high) = (one - z, one + z);
    let (low_y, high_y) = (y - yz, y + yz);
    [low - low_y, low + low_y, high - high_y, high + high_y]
}

/// 1, y, z, yz of x, y, z on one face.
pub(super) type Face<A> = [[A; 4]; 3];

/// Returns the factors that [`element`] multiplies with, from `mean`, `varying` and `shear`; the last is zero.
#[inline(always)]
pub(super) fn factors<T: Real>([mean, varying, shear]: [T; 3]) -> [T; 7] {
    let third = T::of(1.0 / 3.0);
    let m1 = shear * third;
    let last = (varying + m1 + m1 + m1 + m1) * third;
    [mean, varying, shear, m1, T::of(2.0) * shear, last, T::ZERO]
}

/// Returns the forces of an element in modes of a face, the part even in x and the odd one, from the displacements of
/// its nearer and its farther face. Those even in x and constant on the face are zero.
///
/// Three terms are added in their order where `IN_ORDER`, else the last two first: results keep their bits by it.
#[inline(always)]
pub(super) fn element<A: Lane, const IN_ORDER: bool>(
    near: &Face<A>,
    far: &Face<A>,
    [l0, l1, m0, m1, normal, last, zero]: [A; 7],
) -> (Face<A>, Face<A>) {
    let even = |c: usize, m: usize| near[c][m] + far[c][m];
    let odd = |c: usize, m: usize| far[c][m] - near[c][m];
    let sum = |a: A, b: A, c: A| if IN_ORDER { a + b + c } else { a + (b + c) };
    let (u1, v2, w3) = (odd(0, 0), even(1, 1), even(2, 2));
    let dilatation = l0 * sum(u1, v2, w3);
    let xy = m0 * (even(0, 1) + odd(1, 0));
    let xz = m0 * (even(0, 2) + odd(2, 0));
    let yz = m0 * (even(1, 2) + even(2, 1));
    // Dilatation that varies along x, y, z.
    let (vx, wx) = (odd(1, 1), odd(2, 2));
    let (uy, wy) = (odd(0, 1), even(2, 3));
    let (uz, vz) = (odd(0, 2), even(1, 3));
    let along_x = l1 * (vx + wx);
    let along_y = l1 * (uy + wy);
    let along_z = l1 * (uz + vz);
    let (ut, vt, wt) = (even(0, 3), odd(1, 2), odd(2, 1));
    let twist = sum(ut, vt, wt);
    (
        [
            [zero, xy, xz, m1 * (ut + twist)],
            [zero, dilatation + normal * v2, yz, along_z + m0 * vz],
            [zero, yz, dilatation + normal * w3, along_y + m0 * wy],
        ],
        [
            [
                dilatation + normal * u1,
                along_y + m0 * uy,
                along_z + m0 * uz,
                last * odd(0, 3),
            ],
            [xy, along_x + m0 * vx, m1 * (vt + twist), last * odd(1, 3)],
            [xz, m1 * (wt + twist), along_x + m0 * wx, last * odd(2, 3)],
        ],
    )
}

#[inline(always)]
fn face<T: Real>(lines: &[[&[T]; 4]; 3], e: usize) -> Face<T> {
    let component = |[a, b, c, d]: &[&[T]; 4]| across([a[e], b[e], c[e], d[e]]);
    [component(&lines[0]), component(&lines[1]), component(&lines[2])]
}

/// Computes the forces of `count` times `LANES` elements in a row, at most `CHUNK`, from the displacements of the four
/// lines of nodes around them. The scratch has them from `LANES` on; what is before stays zero.
#[inline(always)]
pub(super) fn forces<'a, T: Real>(
    [ul, vl, wl]: [[&'a [T]; 4]; 3],
    [mean, varying, shear]: [&[T]; 3],
    count: usize,
    scratch: &mut Scratch<T>,
) {
    let n = count.min(CHUNK / LANES) * LANES;
    let (mean, varying, shear) = (&mean[..n], &varying[..n], &shear[..n]);
    let cut = |[a, b, c, d]: [&'a [T]; 4]| [&a[..n + 1], &b[..n + 1], &c[..n + 1], &d[..n + 1]];
    let lines = [cut(ul), cut(vl), cut(wl)];
    for e in 0..n {
        let stiffness = factors([mean[e], varying[e], shear[e]]);
        let (even, odd) = element::<T, true>(&face(&lines, e), &face(&lines, e + 1), stiffness);
        for component in 0..3 {
            let (even, odd) = (corners(even[component]), corners(odd[component]));
            for corner in 0..4 {
                scratch[4 * component + corner][LANES + e] = even[corner];
                scratch[12 + 4 * component + corner][LANES + e] = odd[corner];
            }
        }
    }
}

/// Adds the forces of a row of elements on the line of their nearer nodes, and of the last on one node more.
#[inline(always)]
pub(super) fn add_line<T: Real>(even: &[T; CHUNK + LANES], odd: &[T; CHUNK + LANES], count: usize, out: &mut [T]) {
    let n = count.min(CHUNK / LANES) * LANES;
    let mut at = 0;
    while at < n {
        let here = |line: &[T; CHUNK + LANES]| lanes(&line[LANES + at..2 * LANES + at])[0];
        let before = |line: &[T; CHUNK + LANES]| lanes(&line[LANES - 1 + at..2 * LANES - 1 + at])[0];
        let (near_even, near_odd, far_even, far_odd) = (here(even), here(odd), before(even), before(odd));
        let out = &mut lanes_mut(&mut out[at..at + LANES])[0];
        let out0 = *out;
        *out = each(|n| out0[n] + ((near_even[n] - near_odd[n]) + (far_even[n] + far_odd[n])));
        at += LANES;
    }
    out[n] += even[n + LANES - 1] + odd[n + LANES - 1];
}
