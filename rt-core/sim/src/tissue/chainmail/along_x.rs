//! The part of a sweep inside a run: elements outward from the held column, each after its inner neighbour.

use super::kernels::{self, LOWER, Pin, Scaled, UPPER};
use super::spans::Span;
use super::stretch::Stretch;
use super::sweep::Pass;
use crate::simd::Vector;

impl Pass<'_> {
    /// Moves the elements of a run outward from the held column; says which moved.
    #[inline(always)]
    pub fn along_x<V: Vector<f32>>(&mut self, run: usize, row: usize) -> Stretch {
        self.state.keep(self.model, run);
        let of_run = self.model.rows.runs[run];
        let first = of_run.first as usize;
        let held_i = (self.held_cell[0] as u32).clamp(of_run.start_i, of_run.start_i + of_run.len - 1);
        let start = first + (held_i - of_run.start_i) as usize;
        let active = self.state.active.of_run(run);
        let mut moved = Stretch::EMPTY;
        let spans = self.model.links[0].below(row);
        for span in spans.iter().filter(|s| s.lo_run as usize == run) {
            let reach = active.with(moved).end as usize;
            let from = (span.lo as usize)
                .max(start)
                .max((active.start as usize).saturating_sub(1));
            let links = [from, (span.lo + span.len) as usize, reach];
            moved = moved.with(self.up::<V>(span, links));
        }
        for span in spans.iter().rev().filter(|s| s.lo_run as usize == run) {
            let reach = (active.with(moved).start as usize).saturating_sub(1);
            let end = ((span.lo + span.len) as usize).min(start).min(active.end as usize);
            let links = [span.lo as usize, end, reach];
            moved = moved.with(self.down::<V>(span, links));
        }
        moved
    }

    /// Handles links `from..end` of a run upward, from `from` to `reach` or as far as something moves.
    #[inline(always)]
    fn up<V: Vector<f32>>(&mut self, span: &Span, [from, end, reach]: [usize; 3]) -> Stretch {
        let l = self.limits(span.class, 0);
        let mut u = self.state.u.each_mut().map(Vec::as_mut_slice);
        let mut moved = Stretch::EMPTY;
        let (mut link, stop) = (from, end.min(reach));
        while link < stop {
            link = kernels::first_violated::<V>(&l, &u.each_ref().map(|c| &**c), link, stop);
            if link >= stop {
                break;
            }
            if span.pin == Pin::Hi {
                moved = moved.with(move_one::<LOWER>(&l, &mut u, link + 1, link));
                link += 1;
                continue;
            }
            let mut inner = kernels::at(&u, link);
            while link < end {
                let (new, moves) = kernels::clamped_outer::<UPPER>(&l, inner, kernels::at(&u, link + 1));
                link += 1;
                if !moves {
                    break;
                }
                [u[0][link], u[1][link], u[2][link]] = new;
                moved = moved.with(Stretch::one(link));
                inner = new;
            }
        }
        moved
    }

    /// Handles links `start..end` of a run downward, from `end` to `reach` or as far as something moves.
    #[inline(always)]
    fn down<V: Vector<f32>>(&mut self, span: &Span, [start, end, reach]: [usize; 3]) -> Stretch {
        let l = self.limits(span.class, 0);
        let mut u = self.state.u.each_mut().map(Vec::as_mut_slice);
        let mut moved = Stretch::EMPTY;
        let (mut past, stop) = (end, start.max(reach));
        while past > stop {
            past = kernels::past_last_violated::<V>(&l, &u.each_ref().map(|c| &**c), stop, past);
            if past <= stop {
                break;
            }
            if span.pin == Pin::Lo {
                moved = moved.with(move_one::<UPPER>(&l, &mut u, past - 1, past));
                past -= 1;
                continue;
            }
            let mut inner = kernels::at(&u, past);
            while past > start {
                let (new, moves) = kernels::clamped_outer::<LOWER>(&l, inner, kernels::at(&u, past - 1));
                past -= 1;
                if !moves {
                    break;
                }
                [u[0][past], u[1][past], u[2][past]] = new;
                moved = moved.with(Stretch::one(past));
                inner = new;
            }
        }
        moved
    }
}

#[inline(always)]
fn move_one<const OUTER: bool>(l: &Scaled, u: &mut [&mut [f32]; 3], inner: usize, outer: usize) -> Stretch {
    let (new, moves) = kernels::clamped_outer::<OUTER>(l, kernels::at(u, inner), kernels::at(u, outer));
    if !moves {
        return Stretch::EMPTY;
    }
    [u[0][outer], u[1][outer], u[2][outer]] = new;
    Stretch::one(outer)
}
