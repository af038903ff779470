//! Residual of a pass: verifies links that moved, and finds what stays active.

use super::kernels;
use super::spans::Span;
use super::stretch::Stretch;
use super::sweep::{Inner, Pass};
use crate::simd::{Vector, in_vectors};

/// Slacks up to which a violation counts as none: the links' stretch and shear may each be off by one.
const CLEAN: f32 = 2.0;

in_vectors! {
/// Verifies the links of one run.
fn check_run<V: Vector<f32>>(pass: &mut Pass, run: usize, j: usize, k: usize) {
    pass.check_run::<V>(run, j, k);
}
}

impl Pass<'_> {
    /// Checks every link, as after a pass that may have moved any element.
    pub fn check_all(&mut self) -> f32 {
        let (rows, ny) = (&self.model.rows, self.model.lattice.dims[1]);
        self.state.active.add_all(rows, ny);
        self.state.moved.add_all(rows, ny);
        self.state.settled = 0.0;
        self.check()
    }

    /// Checks every link at an active stretch; only what is outside its limits stays active.
    pub fn check(&mut self) -> f32 {
        let ny = self.model.lattice.dims[1];
        for k in self.state.active.planes().numbers() {
            for j in self.state.active.rows(k).numbers() {
                for run in self.model.rows.numbers(j + ny * k) {
                    check_run(self.model.simd, self, run, j, k);
                }
            }
        }
        self.finish()
    }

    #[inline(always)]
    fn check_run<V: Vector<f32>>(&mut self, run: usize, j: usize, k: usize) {
        let active = self.state.active.of_run(run);
        if active.is_empty() {
            return;
        }
        let ny = self.model.lattice.dims[1];
        let row = j + ny * k;
        let mut worst = 0.0_f32;
        // A link along x has the number of its lower end.
        let along_x = Stretch {
            start: active.start.saturating_sub(1),
            end: active.end,
        };
        let [x, y, z] = &self.model.links;
        for span in x.below(row).iter().filter(|s| s.lo_run as usize == run) {
            let links = along_x.within(span.lo, span.len);
            worst = worst.max(self.violation::<V>(0, span, links));
        }
        for (axis, below, above) in [
            (1, y.below(row), y.below(row + 1)),
            (2, z.below(row), z.below(row + ny)),
        ] {
            for span in below.iter().filter(|s| s.hi_run as usize == run) {
                worst = worst.max(self.violation::<V>(axis, span, active.within(span.hi, span.len)));
            }
            for span in above.iter().filter(|s| s.lo_run as usize == run) {
                worst = worst.max(self.violation::<V>(axis, span, active.within(span.lo, span.len)));
            }
        }
        if worst <= CLEAN * self.slack {
            self.state.settled = self.state.settled.max(worst / self.rest);
        } else {
            self.worst = self.worst.max(worst);
            self.state.next.add(run, active);
            self.state.next.add_row(j, k);
        }
    }

    /// Hands the findings of the pass on to the next; returns the largest violation, in elements.
    #[inline(always)]
    pub fn finish(&mut self) -> f32 {
        let state = &mut *self.state;
        state.active.clear(&self.model.rows, self.model.lattice.dims[1]);
        std::mem::swap(&mut state.active, &mut state.next);
        self.worst / self.rest
    }

    /// Checks the links along z that moved after they were handled, and those along y.
    #[inline(always)]
    pub fn check_late<V: Vector<f32>>(&mut self, [y, z]: [(&[Span], Option<Inner>); 2], row: usize) {
        let mut worst = 0.0_f32;
        for (axis, (spans, inner)) in [(2, z), (1, y)] {
            for span in spans {
                let (first, run) = match inner {
                    Some(Inner::Below) => (span.hi, span.hi_run as usize),
                    _ => (span.lo, span.lo_run as usize),
                };
                let moved = match axis {
                    2 => self.state.late[0][run].with(self.state.late[1][run]),
                    _ => self.state.late[1][run],
                };
                worst = worst.max(self.violation::<V>(axis, span, moved.within(first, span.len)));
            }
        }
        let clean = worst <= CLEAN * self.slack;
        if clean {
            self.state.settled = self.state.settled.max(worst / self.rest);
        } else {
            self.worst = self.worst.max(worst);
        }
        let ny = self.model.lattice.dims[1];
        for run in self.model.rows.numbers(row) {
            let [after_z, after_y] = [0, 1].map(|n| std::mem::replace(&mut self.state.late[n][run], Stretch::EMPTY));
            if !clean {
                self.state.next.add(run, after_z.with(after_y));
                self.state.next.add_row(row % ny, row / ny);
            }
        }
    }

    /// Returns the largest violation of some links of a span.
    #[inline(always)]
    pub fn violation<V: Vector<f32>>(&self, axis: usize, span: &Span, links: Stretch) -> f32 {
        if links.is_empty() {
            return 0.0;
        }
        let l = self.limits(span.class, axis);
        let u = kernels::ordered(axis, self.state.u.each_ref().map(Vec::as_slice));
        let (lo, hi) = ((span.lo + links.start) as usize, (span.hi + links.start) as usize);
        kernels::violation::<V>(&l, &u, lo, hi, links.len() as usize)
    }
}
