//! The textbook's single pass as sweeps: the held line along x, then rows of its plane along y, then planes
//! along z. Follows one tree of links, so it may leave others violated: for comparison, as `queue`.

use super::held::{self, Grip};
use super::kernels::{Kernels, LOWER, Portable, Scaled, Stretch, UPPER, at, clamped_outer, ordered};
use super::model::ChainMail;
use super::spans::Span;
use super::state::TissueState;
use crate::scene::Run;
use crate::tissue::Held;
use std::cmp::Ordering;

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
    let held = grip.element as usize;
    let [i, j, k] = model.lattice.cell(grip.element);
    let rest = 1.0 / state.scale();
    let mut tree = Tree {
        model,
        u: state.u.each_mut().map(Vec::as_mut_slice),
        limits: [0, 1, 2].map(|axis| model.classes.limits(0, axis).scaled(rest, 0.0)),
        held_i: i as u32,
    };
    tree.line(&model.rows.runs[model.rows.run_of(held as u32)], held);
    let above = &model.links;
    for plane in (0..nz).map(|n| if n < nz - k { k + n } else { nz - 1 - n }) {
        let inner_z = |row: usize| match plane.cmp(&k) {
            Ordering::Equal => (&[][..], true),
            Ordering::Greater => (above[2].below(row), true),
            Ordering::Less => (above[2].below(row + ny), false),
        };
        let [first, end] = model.rows_of_plane[plane];
        let row = |j: usize| j + ny * plane;
        if (first..end).contains(&j) && plane != k {
            tree.row::<K>(row(j), inner_z(row(j)), (&[], true));
        }
        for n in first.max(j + 1)..end {
            tree.row::<K>(row(n), inner_z(row(n)), (above[1].below(row(n)), true));
        }
        for n in (first..end.min(j)).rev() {
            tree.row::<K>(row(n), inner_z(row(n)), (above[1].below(row(n) + 1), false));
        }
    }
}

/// Links to inner neighbours, and whether these are the lower ones.
type Inner<'a> = (&'a [Span], bool);

struct Tree<'a> {
    model: &'a ChainMail,
    u: [&'a mut [f32]; 3],
    limits: [Scaled; 3],
    held_i: u32,
}

impl Tree<'_> {
    /// Moves a row after its inner plane, what that does not reach after its inner row, and the rest along the row.
    #[inline(always)]
    fn row<K: Kernels>(&mut self, row: usize, z: Inner, y: Inner) {
        let rows = &self.model.rows;
        for number in rows.numbers(row) {
            let run = &rows.runs[number];
            let mut reached = Stretch::EMPTY;
            for (axis, (spans, below)) in [(2, z), (1, y)] {
                let after_z = reached;
                for span in spans {
                    let (outer, outer_run) = if below {
                        (span.hi, span.hi_run)
                    } else {
                        (span.lo, span.lo_run)
                    };
                    if outer_run as usize == number {
                        reached = reached.with(self.outside::<K>(axis, span, outer, below, after_z));
                    }
                }
            }
            if !reached.is_empty() {
                let lowest = reached.start as usize;
                self.line_down(run, lowest);
                self.line_up(run, reached.end as usize - 1);
            } else {
                let start = self.held_i.clamp(run.start_i, run.start_i + run.len - 1) - run.start_i;
                self.line(run, (run.first + start) as usize);
            }
        }
    }

    /// Moves the outer ends of a span outside `done`; says all that it reaches.
    #[inline(always)]
    fn outside<K: Kernels>(&mut self, axis: usize, span: &Span, outer: u32, below: bool, done: Stretch) -> Stretch {
        let all = Stretch {
            start: 0,
            end: span.len,
        };
        let inside = done.within(outer, span.len);
        let pieces = if inside.is_empty() {
            [all, Stretch::EMPTY]
        } else {
            [
                Stretch {
                    end: inside.start,
                    ..all
                },
                Stretch {
                    start: inside.end,
                    ..all
                },
            ]
        };
        let mut u = ordered(axis, self.u.each_mut().map(|c| &mut **c));
        for piece in pieces.into_iter().filter(|piece| !piece.is_empty()) {
            let (lo, hi) = ((span.lo + piece.start) as usize, (span.hi + piece.start) as usize);
            if below {
                K::clamp::<UPPER>(&self.limits[axis], &mut u, lo, hi, piece.len() as usize);
            } else {
                K::clamp::<LOWER>(&self.limits[axis], &mut u, hi, lo, piece.len() as usize);
            }
        }
        all.from(outer)
    }

    fn line(&mut self, run: &Run, start: usize) {
        self.line_up(run, start);
        self.line_down(run, start);
    }

    #[inline(always)]
    fn line_up(&mut self, run: &Run, start: usize) {
        for e in start + 1..run.end() as usize {
            let (new, _) = clamped_outer::<UPPER>(&self.limits[0], at(&self.u, e - 1), at(&self.u, e));
            [self.u[0][e], self.u[1][e], self.u[2][e]] = new;
        }
    }

    #[inline(always)]
    fn line_down(&mut self, run: &Run, start: usize) {
        for e in (run.first as usize..start).rev() {
            let (new, _) = clamped_outer::<LOWER>(&self.limits[0], at(&self.u, e + 1), at(&self.u, e));
            [self.u[0][e], self.u[1][e], self.u[2][e]] = new;
        }
    }
}
