//! Outward sweeps: the held element stays, and every link at an active stretch moves its outer end.
//!
//! Planes outward from the held plane; in a plane, rows outward from the held row; in a row, elements
//! outward from the held column. Each element is moved after its inner neighbours, and what moves is active
//! for those that come after it: a sweep goes as far as something moves. A fixed element is always the inner end.

use super::kernels::{self, LOWER, Pin, Scaled, UPPER};
use super::model::ChainMail;
use super::spans::Span;
use super::state::TissueState;
use super::stretch::Stretch;
use crate::simd::{Vector, in_vectors};

/// Data and scale of a pass.
pub(super) struct Pass<'a> {
    pub model: &'a ChainMail,
    pub state: &'a mut TissueState,
    /// One element, and the slack, in the unit of the state.
    pub rest: f32,
    pub slack: f32,
    /// Largest violation found that the pass leaves, in the unit of the state.
    pub worst: f32,
    pub held_cell: [usize; 3],
}

/// Position of the inner neighbours of a row.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Inner {
    Below,
    Above,
}

in_vectors! {
/// Sweeps one plane. Compiled once for each set of instructions and called: inlined wherever they are used, the loops
/// over rows were some hundred copies, and 50 of the 52 s that this crate took to compile.
fn plane<V: Vector<f32>>(pass: &mut Pass, k: usize, inner_z: Option<Inner>) {
    pass.plane::<V>(k, inner_z);
}
}

impl<'a> Pass<'a> {
    pub fn new(model: &'a ChainMail, state: &'a mut TissueState, held_cell: [usize; 3], slack: f32) -> Self {
        let rest = 1.0 / state.scale();
        Pass {
            model,
            state,
            rest,
            slack: slack * rest,
            worst: 0.0,
            held_cell,
        }
    }

    #[inline(always)]
    pub fn limits(&self, class: u16, axis: usize) -> Scaled {
        self.model.classes.limits(class, axis).scaled(self.rest, self.slack)
    }

    /// Makes one outward sweep. Leaves active what is still violated; returns the largest violation, in elements.
    pub fn outward(&mut self) -> f32 {
        let nz = self.model.lattice.dims[2];
        let (simd, held_k) = (self.model.simd, self.held_cell[2]);
        let planes = self.state.active.planes();
        if planes.start as usize <= held_k && held_k < planes.end as usize {
            plane(simd, self, held_k, None);
        }
        for k in (held_k + 1).max(planes.start as usize)..nz {
            if k >= planes.end as usize && self.state.active.rows(k - 1).is_empty() {
                break;
            }
            plane(simd, self, k, Some(Inner::Below));
        }
        for k in (0..held_k.min(planes.end as usize)).rev() {
            if k < planes.start as usize && self.state.active.rows(k + 1).is_empty() {
                break;
            }
            plane(simd, self, k, Some(Inner::Above));
        }
        if self.model.classes.any_fixed() {
            // Inner elements have moved too, whose links were already handled.
            self.check()
        } else {
            self.finish()
        }
    }

    #[inline(always)]
    fn plane<V: Vector<f32>>(&mut self, k: usize, inner_z: Option<Inner>) {
        let held_j = self.held_cell[1];
        let [first, end] = self.model.rows_of_plane[k];
        let own = self.state.active.rows(k);
        let rows = match inner_z {
            Some(Inner::Below) => own.with(self.state.active.rows(k - 1)),
            Some(Inner::Above) => own.with(self.state.active.rows(k + 1)),
            None => own,
        };
        let is_in = |j: usize| rows.start as usize <= j && j < rows.end as usize;
        let mut moving = false;
        if (first..end).contains(&held_j) && is_in(held_j) {
            moving = self.row::<V>(held_j, k, None, inner_z);
        }
        let held_row_moves = moving;
        for j in first.max(held_j + 1)..end {
            if is_in(j) || moving {
                moving = self.row::<V>(j, k, Some(Inner::Below), inner_z);
            } else if j >= rows.end as usize {
                break;
            }
        }
        moving = held_row_moves;
        for j in (first..end.min(held_j)).rev() {
            if is_in(j) || moving {
                moving = self.row::<V>(j, k, Some(Inner::Above), inner_z);
            } else if j < rows.start as usize {
                break;
            }
        }
    }

    /// Handles the links of a row with its inner neighbours and in itself; returns whether anything in it is active.
    #[inline(always)]
    fn row<V: Vector<f32>>(&mut self, j: usize, k: usize, inner_y: Option<Inner>, inner_z: Option<Inner>) -> bool {
        let model = self.model;
        let ny = model.lattice.dims[1];
        let row = j + ny * k;
        let spans_of = |axis: usize, stride: usize, inner: Option<Inner>| match inner {
            Some(Inner::Below) => model.links[axis].below(row),
            Some(Inner::Above) => model.links[axis].below(row + stride),
            None => &[],
        };
        let (y_spans, z_spans) = (spans_of(1, 1, inner_y), spans_of(2, ny, inner_z));
        for span in z_spans {
            self.push::<V>(2, span, inner_z == Some(Inner::Below), row);
        }
        for span in y_spans {
            self.push::<V>(1, span, inner_y == Some(Inner::Below), row);
        }
        let mut is_active = false;
        let mut late = false;
        for run in model.rows.numbers(row) {
            if !self.state.active.of_run(run).is_empty() {
                is_active = true;
                let moved = self.along_x::<V>(run, row);
                if !moved.is_empty() {
                    self.state.active.add(run, moved);
                    self.state.moved.add(run, moved);
                    self.state.late[1][run] = moved;
                }
                late |= !self.state.late[0][run].is_empty() || !moved.is_empty();
            }
        }
        if is_active {
            self.state.active.add_row(j, k);
            self.state.moved.add_row(j, k);
        }
        if late {
            self.check_late::<V>([(y_spans, inner_y), (z_spans, inner_z)], row);
        }
        is_active
    }

    /// Returns the part of a span that touches an active stretch, counted from its first link.
    #[inline(always)]
    fn touched(&self, span: &Span) -> Stretch {
        let lo = self.state.active.of_run(span.lo_run as usize).within(span.lo, span.len);
        let hi = self.state.active.of_run(span.hi_run as usize).within(span.hi, span.len);
        lo.with(hi)
    }

    /// Moves the outer ends of a span into their limits.
    #[inline(always)]
    fn push<V: Vector<f32>>(&mut self, axis: usize, span: &Span, upper: bool, row: usize) {
        let links = self.touched(span);
        if links.is_empty() {
            return;
        }
        let l = self.limits(span.class, axis);
        // The end that is moved: the outer one, unless that is fixed.
        let moves_hi = match span.pin {
            Pin::None => upper,
            Pin::Lo => true,
            Pin::Hi => false,
        };
        let (lo, hi) = ((span.lo + links.start) as usize, (span.hi + links.start) as usize);
        let n = links.len() as usize;
        let run = if moves_hi { span.hi_run } else { span.lo_run } as usize;
        self.state.keep(self.model, run);
        let mut u = kernels::ordered(axis, self.state.u.each_mut().map(Vec::as_mut_slice));
        let moved = if moves_hi {
            kernels::clamp_all::<V, UPPER>(&l, &mut u, lo, hi, n).from(hi as u32)
        } else {
            kernels::clamp_all::<V, LOWER>(&l, &mut u, hi, lo, n).from(lo as u32)
        };
        if moved.is_empty() {
            return;
        }
        self.state.active.add(run, moved);
        self.state.moved.add(run, moved);
        if moves_hi != upper {
            let ny = self.model.lattice.dims[1];
            let stride = if axis == 1 { 1 } else { ny };
            let inner_row = if upper { row - stride } else { row + stride };
            self.state.active.add_row(inner_row % ny, inner_row / ny);
            self.state.moved.add_row(inner_row % ny, inner_row / ny);
        } else if axis == 1 {
            self.state.late[0][run] = self.state.late[0][run].with(moved);
        }
    }
}
