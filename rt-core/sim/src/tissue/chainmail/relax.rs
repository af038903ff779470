//! Relaxation: elements move toward the mean of their neighbours (Gibson's elastic step).
//!
//! The springs of a link pull its ends together in displacement, stiffer along the link than across it, and the
//! foundation pulls every element to its place at rest; so the three components are three Laplace equations. They are
//! relaxed row by row, first the rows with even j + k and then the others, elements of a row all at once: that
//! converges for weights between 0 and 2 (`docs/physics.md`).

use super::held::{self, Grip};
use super::model::ChainMail;
use super::springs::{RowSprings, Shares};
use super::state::TissueState;
use crate::limits::Relaxation;

/// Relaxes the rows whose j + k is even (`parity` 0) or odd (1) in one pass; what is held stays.
#[inline(always)]
pub(super) fn half_pass<K: RowSprings>(
    model: &ChainMail,
    state: &mut TissueState,
    grip: Option<&Grip>,
    relaxation: &Relaxation,
    parity: usize,
) {
    let ny = model.lattice.dims[1];
    let uniform = [0, 1, 2].map(|component| shares(relaxation, component, &[1.0; 6]));
    let held = grip.map(|grip| (grip, held::planes_and_rows(model, grip)));
    for (k, &[first, end]) in model.rows_of_plane.iter().enumerate() {
        for j in (first..end).filter(|j| (j + k) % 2 == parity) {
            let held_here = held
                .as_ref()
                .filter(|(_, [planes, rows])| planes.contains(&k) && rows.contains(&j));
            for segment in model.segments.of_row(j + ny * k) {
                for (component, uniform) in uniform.iter().enumerate() {
                    let u = &mut state.u[component];
                    match model.segments.weights(segment) {
                        None => K::relax(u, segment, uniform),
                        Some(weights) => K::relax(u, segment, &shares(relaxation, component, weights)),
                    }
                }
                // At once, before the next segment of the row reads it.
                if let Some((grip, _)) = held_here {
                    held::put_row(model, state, grip, [j, k]);
                }
            }
        }
    }
}

/// Shares for a component, of neighbours whose links have these stiffnesses relative to the reference.
///
/// The divisor is the diagonal plus all that the element's row can add to it: no eigenvalue of a row's springs is
/// above it, whence the bound of 2 on the weight.
fn shares(relaxation: &Relaxation, component: usize, weights: &[f32; 6]) -> Shares {
    let stiffness = |axis: usize| if axis == component { 1.0 } else { relaxation.shear };
    let of = [0, 1, 2].map(|axis| [0, 1].map(|side| stiffness(axis) * weights[2 * axis + side]));
    let springs = of.iter().flatten().sum::<f32>() + relaxation.foundation;
    let in_row = of[0][0] + of[0][1];
    let part = relaxation.weight / (springs + in_row);
    Shares {
        own: 1.0 - part * springs,
        of: of.map(|pair| pair.map(|k| part * k)),
    }
}
