//! Projections that remove the violations which outward sweeps leave.

use super::kernels::{self, Pin, Scaled, feasible_factor, ordered, projected};
use super::spans::Span;
use super::sweep::Pass;
use crate::scene::MAX_CELLS_PER_AXIS;

impl Pass<'_> {
    /// Makes one pass of orthogonal projections over all links, both ends giving half, or the whole against a fixed
    /// end.
    ///
    /// Projecting onto convex sets in turn, the held element's position among them, converges to a point in
    /// all of them. Passes alternate in direction so that a correction travels both ways.
    pub fn project(&mut self, upward: bool) {
        for axis in [1, 2] {
            let spans = self.model.links[axis].all();
            for n in 0..spans.len() {
                let span = &spans[if upward { n } else { spans.len() - 1 - n }];
                let l = self.limits(span.class, axis);
                project_span(&l, axis, span, self.u());
            }
        }
        let mut halves = Halves::new();
        for span in self.model.links[0].all() {
            let l = self.limits(span.class, 0);
            project_along_x(&l, span, upward, self.u(), &mut halves);
        }
    }

    fn u(&mut self) -> [&mut [f32]; 3] {
        self.state.u.each_mut().map(Vec::as_mut_slice)
    }

    /// Pulls the held element's part of the body toward a state that meets every limit, just far enough: the body
    /// at rest moved as a whole, or, where something in the part is fixed, the body at rest.
    ///
    /// In either no link has a difference in displacement, so scaling all differences reaches every limit, and
    /// the factor is known in closed form: this always succeeds.
    pub fn reanchor(&mut self, held: usize) {
        let part = self.model.part(held as u32);
        let factor = self.feasible_factor(part);
        let anchor = if self.model.part_is_fixed(part) {
            [0.0; 3]
        } else {
            kernels::at(&self.u(), held)
        };
        for (run, of_run) in self.model.rows.runs.iter().enumerate() {
            if self.model.part_of_run(run) == part {
                for (component, anchor) in self.state.u.iter_mut().zip(anchor) {
                    for value in &mut component[of_run.first as usize..of_run.end() as usize] {
                        *value = anchor + factor * (*value - anchor);
                    }
                }
            }
        }
    }

    fn feasible_factor(&self, part: u32) -> f32 {
        let tolerance = 0.5 * self.model.limits().tolerance * self.rest;
        let u = self.state.u.each_ref().map(Vec::as_slice);
        let mut factor = 1.0_f32;
        for axis in 0..3 {
            let u = ordered(axis, u);
            for span in self.model.links[axis].all() {
                if self.model.part_of_run(span.lo_run as usize) != part {
                    continue;
                }
                let l = self.limits(span.class, axis);
                for n in 0..span.len {
                    let d = u.map(|c| c[(span.hi + n) as usize] - c[(span.lo + n) as usize]);
                    factor = factor.min(feasible_factor(&l, d, tolerance));
                }
            }
        }
        factor
    }
}

fn project_span(l: &Scaled, axis: usize, span: &Span, u: [&mut [f32]; 3]) {
    let (lo, hi, len) = (span.lo as usize, span.hi as usize, span.len as usize);
    let [a, b, c] = ordered(axis, u);
    let split = |component| {
        let (below, above) = <[f32]>::split_at_mut(component, hi);
        (&mut below[lo..lo + len], &mut above[..len])
    };
    let ((la, ha), (lb, hb), (lc, hc)) = (split(a), split(b), split(c));
    project_links(l, span.pin, [la, lb, lc], [ha, hb, hc]);
}

fn project_links(l: &Scaled, pin: Pin, [la, lb, lc]: [&mut [f32]; 3], [ha, hb, hc]: [&mut [f32]; 3]) {
    match pin {
        Pin::None => project_slices(l, Pin::None, la, lb, lc, ha, hb, hc),
        pinned => project_slices(l, pinned, la, lb, lc, ha, hb, hc),
    }
}

/// Projects with each slice as an argument: the compiler then knows that they do not overlap.
#[expect(clippy::too_many_arguments, reason = "slices that may not overlap")]
#[inline]
fn project_slices(
    l: &Scaled,
    pin: Pin,
    la: &mut [f32],
    lb: &mut [f32],
    lc: &mut [f32],
    ha: &mut [f32],
    hb: &mut [f32],
    hc: &mut [f32],
) {
    let n = ha.len();
    let (la, lb, lc) = (&mut la[..n], &mut lb[..n], &mut lc[..n]);
    let (hb, hc) = (&mut hb[..n], &mut hc[..n]);
    for e in 0..n {
        let [lo, hi] = projected(l, pin, [la[e], lb[e], lc[e]], [ha[e], hb[e], hc[e]]);
        [la[e], lb[e], lc[e]] = lo;
        [ha[e], hb[e], hc[e]] = hi;
    }
}

/// Every other element of a run: links of one half to the other do not share ends, so they go in vectors.
struct Halves {
    even: [[f32; HALF_RUN]; 3],
    odd: [[f32; HALF_RUN]; 3],
}

const HALF_RUN: usize = MAX_CELLS_PER_AXIS / 2;

impl Halves {
    fn new() -> Self {
        Halves {
            even: [[0.0; HALF_RUN]; 3],
            odd: [[0.0; HALF_RUN]; 3],
        }
    }
}

fn project_along_x(l: &Scaled, span: &Span, upward: bool, u: [&mut [f32]; 3], halves: &mut Halves) {
    let (first, end) = (span.lo as usize, (span.hi + span.len) as usize);
    let odd_count = (end - first) / 2;
    let even_count = end - first - odd_count;
    let even = halves.even.each_mut().map(|c| &mut c[..even_count]);
    let odd = halves.odd.each_mut().map(|c| &mut c[..odd_count]);
    let ([ex, ey, ez], [ox, oy, oz]) = (even, odd);
    for (values, even, odd) in [
        (&*u[0], &mut *ex, &mut *ox),
        (&*u[1], &mut *ey, &mut *oy),
        (&*u[2], &mut *ez, &mut *oz),
    ] {
        split(&values[first..end], even, odd);
    }
    for turn in [upward, !upward] {
        if turn {
            let n = odd_count;
            let lo = [&mut ex[..n], &mut ey[..n], &mut ez[..n]];
            project_links(l, span.pin, lo, [&mut *ox, &mut *oy, &mut *oz]);
        } else {
            let n = even_count - 1;
            let lo = [&mut ox[..n], &mut oy[..n], &mut oz[..n]];
            project_links(l, span.pin, lo, [&mut ex[1..], &mut ey[1..], &mut ez[1..]]);
        }
    }
    let [ux, uy, uz] = u;
    for (values, even, odd) in [(ux, ex, ox), (uy, ey, oy), (uz, ez, oz)] {
        join(even, odd, &mut values[first..end]);
    }
}

fn split(values: &[f32], even: &mut [f32], odd: &mut [f32]) {
    for (pair, (e, o)) in values.chunks_exact(2).zip(even.iter_mut().zip(odd)) {
        (*e, *o) = (pair[0], pair[1]);
    }
    if let ([last], Some(e)) = (values.chunks_exact(2).remainder(), even.last_mut()) {
        *e = *last;
    }
}

fn join(even: &[f32], odd: &[f32], values: &mut [f32]) {
    let mut pairs = values.chunks_exact_mut(2);
    for (pair, (e, o)) in pairs.by_ref().zip(even.iter().zip(odd)) {
        (pair[0], pair[1]) = (*e, *o);
    }
    if let ([last], Some(e)) = (pairs.into_remainder(), even.last()) {
        *last = *e;
    }
}
