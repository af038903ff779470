//! Relaxation: elements go toward where their neighbours would have them (Gibson's elastic step).
//!
//! The springs of a link pull its ends together in displacement, stiffer along the link than across it, and the
//! ground pulls every element to its place at rest; so the three components are three Laplace equations. They are
//! relaxed row by row, first the rows with even j + k and then the others, elements of a row all at once: that
//! converges for weights between 0 and 2 (`docs/physics.md`).

use super::held::{self, Grip};
use super::model::ChainMail;
use super::segments::{LEFT, RIGHT, Segment};
use super::state::TissueState;
use crate::limits::Relaxation;

/// What a row of springs does to one component: `new = own * u + sum of each neighbour's share`.
#[derive(Clone, Copy)]
pub(super) struct Shares {
    pub own: f32,
    /// Of the neighbours below and above along x, y, z.
    pub of: [[f32; 2]; 3],
}

/// Below this a value is none: spreading makes ever smaller ones, and denormal numbers are slow.
pub(super) const NONE: f32 = 1e-30;

/// One component's values, and a segment of them to relax.
pub(super) trait Rows {
    fn relax(u: &mut [f32], segment: &Segment, shares: &Shares);
}

/// One pass over the rows whose j + k is even (`parity` 0) or odd (1); what is held stays.
#[inline(always)]
pub(super) fn half_pass<K: Rows>(
    model: &ChainMail,
    state: &mut TissueState,
    grip: Option<&Grip>,
    relaxation: &Relaxation,
    parity: usize,
) {
    let ny = model.lattice.dims[1];
    let uniform = [0, 1, 2].map(|component| shares(relaxation, component, &[1.0; 6]));
    for (k, &[first, end]) in model.rows_of_plane.iter().enumerate() {
        for j in (first..end).filter(|j| (j + k) % 2 == parity) {
            for segment in model.segments.of_row(j + ny * k) {
                for (component, uniform) in uniform.iter().enumerate() {
                    let u = &mut state.u[component];
                    match model.segments.weights(segment) {
                        None => K::relax(u, segment, uniform),
                        Some(weights) => K::relax(u, segment, &shares(relaxation, component, weights)),
                    }
                }
                // At once, before the next segment of the row looks at it.
                if let Some(grip) = grip {
                    held::put_row(model, state, grip, [j, k]);
                }
            }
        }
    }
}

/// Shares for a component, of neighbours whose links have these stiffnesses beside the reference.
///
/// The divisor is the diagonal plus all that the element's row can add to it: no eigenvalue of a row's springs is
/// above it, whence the bound of 2 on the weight.
fn shares(relaxation: &Relaxation, component: usize, weights: &[f32; 6]) -> Shares {
    let stiffness = |axis: usize| if axis == component { 1.0 } else { relaxation.shear };
    let of = [0, 1, 2].map(|axis| [0, 1].map(|side| stiffness(axis) * weights[2 * axis + side]));
    let springs = of.iter().flatten().sum::<f32>() + relaxation.ground;
    let in_row = of[0][0] + of[0][1];
    let part = relaxation.weight / (springs + in_row);
    Shares {
        own: 1.0 - part * springs,
        of: of.map(|pair| pair.map(|k| part * k)),
    }
}

#[inline(always)]
fn relaxed(shares: &Shares, own: f32, [x, y, z]: [[f32; 2]; 3]) -> f32 {
    let of = &shares.of;
    let along_x = of[0][0] * x[0] + of[0][1] * x[1];
    let along_y = of[1][0] * y[0] + of[1][1] * y[1];
    let along_z = of[2][0] * z[0] + of[2][1] * z[1];
    let new = (shares.own * own + along_x) + (along_y + along_z);
    if new.abs() > NONE { new } else { 0.0 }
}

impl Rows for super::kernels::Portable {
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

#[cfg(target_arch = "x86_64")]
impl Rows for super::avx2::Avx2 {
    #[inline(always)]
    fn relax(u: &mut [f32], segment: &Segment, shares: &Shares) {
        let end = |first: u32| first as usize + segment.len as usize;
        let open_right = usize::from(segment.open & RIGHT == 0);
        assert!(end(segment.first) + open_right <= u.len() && segment.beside.iter().all(|&b| end(b) <= u.len()));
        assert!(segment.open & LEFT != 0 || segment.first > 0);
        // SAFETY: the segment, its neighbours beside it and those in its row, where it has them, are inside `u`;
        // AVX2 is there (type's doc).
        unsafe { super::avx2_relax::relax(u.as_mut_ptr(), segment, shares) }
    }
}
