//! The textbook's single pass as sweeps: the held line along x, then rows of its plane along y, then planes
//! along z. Follows one tree of links, so it leaves other links violated: for comparison, as `queue`.

use super::held::{self, Grip};
use super::kernels::{Kernels, LOWER, Portable, UPPER, at, clamped_outer, ordered};
use super::model::ChainMail;
use super::spans::Span;
use super::state::TissueState;
use crate::tissue::Held;

/// Puts the held element in place and moves the others outward from it, each at most once.
///
/// # Panics
///
/// If the held element cannot be followed, the state is of another model, or the body has several structures.
pub fn single_pass(model: &ChainMail, state: &mut TissueState, held: Held) {
    let grip = held::grip(model, Some(held)).0.expect("an element within reach");
    assert!(state.fits(model), "a state of this model");
    assert_eq!(model.classes.count(), 1, "the textbook knows one kind of tissue");
    state.put(grip.element as usize, grip.at);
    #[cfg(target_arch = "x86_64")]
    if model.vectors {
        // SAFETY: `vectors` says that the processor has AVX2.
        unsafe { tree_avx2(model, state, &grip) };
        return state.disturb(model);
    }
    tree::<Portable>(model, state, &grip);
    state.disturb(model);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn tree_avx2(model: &ChainMail, state: &mut TissueState, grip: &Grip) {
    tree::<super::avx2::Avx2>(model, state, grip);
}

#[inline(always)]
fn tree<K: Kernels>(model: &ChainMail, state: &mut TissueState, grip: &Grip) {
    let [_, ny, nz] = model.lattice.dims;
    let [_, j, k] = model.lattice.cell(grip.element);
    line(model, state, grip.element as usize);
    for row in j + 1..ny {
        spans::<K, UPPER>(model, state, 1, model.links[1].below(row + ny * k));
    }
    for row in (0..j).rev() {
        spans::<K, LOWER>(model, state, 1, model.links[1].below(row + 1 + ny * k));
    }
    for plane in k + 1..nz {
        spans::<K, UPPER>(model, state, 2, model.links[2].below_rows(ny * plane, ny * (plane + 1)));
    }
    for plane in (0..k).rev() {
        spans::<K, LOWER>(
            model,
            state,
            2,
            model.links[2].below_rows(ny * (plane + 1), ny * (plane + 2)),
        );
    }
}

/// The held run, outward.
#[inline(always)]
fn line(model: &ChainMail, state: &mut TissueState, held: usize) {
    let run = model.rows.runs[model.rows.run_of(held as u32)];
    let l = model.classes.limits(0, 0).scaled(1.0 / state.scale(), 0.0);
    let u = state.u.each_mut().map(Vec::as_mut_slice);
    for e in held + 1..run.end() as usize {
        let (new, _) = clamped_outer::<UPPER>(&l, at(&u, e - 1), at(&u, e));
        [u[0][e], u[1][e], u[2][e]] = new;
    }
    for e in (run.first as usize..held).rev() {
        let (new, _) = clamped_outer::<LOWER>(&l, at(&u, e + 1), at(&u, e));
        [u[0][e], u[1][e], u[2][e]] = new;
    }
}

#[inline(always)]
fn spans<K: Kernels, const OUTER: bool>(model: &ChainMail, state: &mut TissueState, axis: usize, spans: &[Span]) {
    let l = model.classes.limits(0, axis).scaled(1.0 / state.scale(), 0.0);
    let mut u = ordered(axis, state.u.each_mut().map(Vec::as_mut_slice));
    for span in spans {
        let (lo, hi) = (span.lo as usize, span.hi as usize);
        let (inner, outer) = if OUTER == UPPER { (lo, hi) } else { (hi, lo) };
        K::clamp::<OUTER>(&l, &mut u, inner, outer, span.len as usize);
    }
}
