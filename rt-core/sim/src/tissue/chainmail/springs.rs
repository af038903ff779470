//! A row of springs: where the elements of a segment go, given their neighbours. Portable; `avx2` has the same
//! arithmetic.

use super::kernels::Portable;
use super::segments::{LEFT, RIGHT, Segment};

/// Springs of a row for one component: `new = own * u + sum of each neighbour's share`.
#[derive(Clone, Copy)]
pub(super) struct Shares {
    pub own: f32,
    /// Shares of the neighbours below and above along x, y, z.
    pub of: [[f32; 2]; 3],
}

/// Values below this become zero: spreading makes ever smaller ones, and denormal numbers are slow.
pub(super) const NEGLIGIBLE: f32 = 1e-30;

/// Relaxes one component of a segment.
pub(super) trait RowSprings {
    /// Relaxes a segment; elements outside `u` are left alone.
    fn relax(u: &mut [f32], segment: &Segment, shares: &Shares);
}

#[inline(always)]
fn relaxed(shares: &Shares, own: f32, [x, y, z]: [[f32; 2]; 3]) -> f32 {
    let of = &shares.of;
    let along_x = of[0][0] * x[0] + of[0][1] * x[1];
    let along_y = of[1][0] * y[0] + of[1][1] * y[1];
    let along_z = of[2][0] * z[0] + of[2][1] * z[1];
    let new = (shares.own * own + along_x) + (along_y + along_z);
    if new.abs() > NEGLIGIBLE { new } else { 0.0 }
}

impl RowSprings for Portable {
    fn relax(u: &mut [f32], segment: &Segment, shares: &Shares) {
        let first = segment.first as usize;
        let len = segment.len as usize;
        let mut left = if segment.open & LEFT != 0 {
            u[first]
        } else {
            u[first - 1]
        };
        for n in 0..len {
            let e = first + n;
            let own = u[e];
            let right = if n + 1 == len && segment.open & RIGHT != 0 {
                own
            } else {
                u[e + 1]
            };
            let [y0, y1, z0, z1] = segment.beside.map(|b| u[b as usize + n]);
            u[e] = relaxed(shares, own, [[left, right], [y0, y1], [z0, z1]]);
            left = own;
        }
    }
}
