//! The forces of a row of cubic elements on their corners.
//!
//! The eight corner values of a component are turned into the coefficients of 1, x, y, z, xy, yz, zx, xyz (up to a
//! factor: a Walsh-Hadamard transform, 24 additions). In these a cube's stiffness falls into blocks of at most three,
//! by symmetry, for any isotropic material, and both integrations differ in one coefficient only. That is a third of
//! the arithmetic of the 24 x 24 matrix, and there is no matrix to load.

use super::lanes::{LANES, each, lanes, lanes_mut};
use super::material::{Integration, Material};
use super::real::Real;

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

/// Returns sums and differences of four corners of a row: 1, y, z, yz.
#[inline(always)]
fn across<T: Real>([a, b, c, d]: [T; 4]) -> [T; 4] {
    let (low, high) = (a + b, c + d);
    let (low_y, high_y) = (b - a, d - c);
    [low + high, low_y + high_y, high - low, high_y - low_y]
}

/// Applies the transpose of `across`.
#[inline(always)]
fn corners<T: Real>([one, y, z, yz]: [T; 4]) -> [T; 4] {
    let (low, high) = (one - z, one + z);
    let (low_y, high_y) = (y - yz, y + yz);
    [low - low_y, low + low_y, high - high_y, high + high_y]
}

/// 1, y, z, yz of one component, even and odd in x.
struct Modes<T> {
    even: [T; 4],
    odd: [T; 4],
}

#[inline(always)]
fn modes<T: Real>(lines: &[&[T]; 4], e: usize) -> Modes<T> {
    let near = across([lines[0][e], lines[1][e], lines[2][e], lines[3][e]]);
    let far = across([lines[0][e + 1], lines[1][e + 1], lines[2][e + 1], lines[3][e + 1]]);
    Modes {
        even: [near[0] + far[0], near[1] + far[1], near[2] + far[2], near[3] + far[3]],
        odd: [far[0] - near[0], far[1] - near[1], far[2] - near[2], far[3] - near[3]],
    }
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
    let (ul, vl, wl) = (cut(ul), cut(vl), cut(wl));
    let (two, third) = (T::of(2.0), T::of(1.0 / 3.0));
    for e in 0..n {
        let (u, v, w) = (modes(&ul, e), modes(&vl, e), modes(&wl, e));
        let (m0, l0, l1) = (shear[e], mean[e], varying[e]);
        let m1 = m0 * third;
        let dilatation = l0 * (u.odd[0] + v.even[1] + w.even[2]);
        let (xy, xz, yz) = (
            m0 * (u.even[1] + v.odd[0]),
            m0 * (u.even[2] + w.odd[0]),
            m0 * (v.even[2] + w.even[1]),
        );
        // Dilatation that varies along x, y, z.
        let along_x = l1 * (v.odd[1] + w.odd[2]);
        let along_y = l1 * (u.odd[1] + w.even[3]);
        let along_z = l1 * (u.odd[2] + v.even[3]);
        let twist = u.even[3] + v.odd[2] + w.odd[1];
        let last = (l1 + m1 + m1 + m1 + m1) * third;
        let normal = two * m0;
        let fu = Modes {
            even: [T::ZERO, xy, xz, m1 * (u.even[3] + twist)],
            odd: [
                dilatation + normal * u.odd[0],
                along_y + m0 * u.odd[1],
                along_z + m0 * u.odd[2],
                last * u.odd[3],
            ],
        };
        let fv = Modes {
            even: [T::ZERO, dilatation + normal * v.even[1], yz, along_z + m0 * v.even[3]],
            odd: [xy, along_x + m0 * v.odd[1], m1 * (v.odd[2] + twist), last * v.odd[3]],
        };
        let fw = Modes {
            even: [T::ZERO, yz, dilatation + normal * w.even[2], along_y + m0 * w.even[3]],
            odd: [xz, m1 * (w.odd[1] + twist), along_x + m0 * w.odd[2], last * w.odd[3]],
        };
        for (component, f) in [fu, fv, fw].into_iter().enumerate() {
            let (even, odd) = (corners(f.even), corners(f.odd));
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
