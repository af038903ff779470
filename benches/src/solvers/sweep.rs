//! The same propagation as sweeps: the held line along x, then rows of its plane along y, then planes along z.

use super::body::{Body, ordered, outer_end};
use std::ops::Range;
use stylet_sim::limits::LinkLimits;
use stylet_sim::scene::Lattice;

/// Consecutive elements along x.
struct Run {
    first: usize,
    end: usize,
    /// Cell of the first along x.
    start_i: usize,
}

/// Elements from `outer` on, each linked to the element as far from `inner`.
struct Links {
    inner: usize,
    outer: usize,
    len: usize,
}

/// Links of each run to the runs beside it, found once.
pub struct PlainSweep {
    runs: Vec<Run>,
    /// Runs of each row `j + ny * k`.
    rows: Vec<Range<usize>>,
    /// Links of each run to the rows at -y, +y, -z, +z.
    beside: Vec<[Vec<Links>; 4]>,
    dims: [usize; 3],
}

impl PlainSweep {
    /// For bodies of this lattice.
    pub fn new(lattice: &Lattice) -> Self {
        let dims @ [_, ny, nz] = lattice.dims;
        let mut sweep = PlainSweep {
            runs: Vec::new(),
            rows: vec![0..0; ny * nz],
            beside: Vec::new(),
            dims,
        };
        for element in 0..lattice.element_count() {
            let [i, j, k] = lattice.cell(element as u32);
            let row = &mut sweep.rows[j + ny * k];
            match sweep.runs.last_mut() {
                Some(run) if !(*row).is_empty() && run.start_i + (run.end - run.first) == i => run.end += 1,
                _ => {
                    let (first, number) = (element, sweep.runs.len());
                    let start = if (*row).is_empty() { number } else { row.start };
                    *row = start..number + 1;
                    let end = first + 1;
                    sweep.runs.push(Run { first, end, start_i: i });
                }
            }
        }
        for row in 0..ny * nz {
            let (j, k) = (row % ny, row / ny);
            let rows = [
                (j > 0).then(|| row - 1),
                (j + 1 < ny).then_some(row + 1),
                (k > 0).then(|| row - ny),
                (k + 1 < nz).then_some(row + ny),
            ];
            for run in sweep.rows[row].clone() {
                let links = rows.map(|inner| inner.map_or(Vec::new(), |inner| sweep.links(run, inner)));
                sweep.beside.push(links);
            }
        }
        sweep
    }

    fn links(&self, run: usize, inner_row: usize) -> Vec<Links> {
        let outer = &self.runs[run];
        let end_i = |run: &Run| run.start_i + run.end - run.first;
        let inner = self.runs[self.rows[inner_row].clone()].iter();
        let links = inner.filter_map(|inner| {
            let (from, to) = (outer.start_i.max(inner.start_i), end_i(outer).min(end_i(inner)));
            (from < to).then(|| Links {
                inner: inner.first + from - inner.start_i,
                outer: outer.first + from - outer.start_i,
                len: to - from,
            })
        });
        links.collect()
    }

    /// Puts `held` in place, `at` elements from rest, and moves the others outward from it, each at most once.
    pub fn run(&self, body: &mut Body, held: u32, at: [f32; 3]) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.run_avx2(body, held, at) };
        }
        self.run_portable(body, held, at);
    }

    /// The same loops, compiled for wider vectors: the shipped solver has them too.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2(&self, body: &mut Body, held: u32, at: [f32; 3]) {
        self.run_portable(body, held, at);
    }

    #[inline(always)]
    fn run_portable(&self, body: &mut Body, held: u32, at: [f32; 3]) {
        body.put(held, at);
        let [_, ny, nz] = self.dims;
        let [i, j, k] = body.lattice.cell(held);
        let own = &self.runs[self.rows[j + ny * k].clone()];
        if let Some(run) = own.iter().find(|r| (r.first..r.end).contains(&(held as usize))) {
            along_x(body, run, held as usize..held as usize + 1);
        }
        // Outward: the held plane, those above it, then those below it; rows alike.
        for plane in (k..nz).chain((0..k).rev()) {
            let z = (plane != k).then_some(if plane > k { 2 } else { 3 });
            for row in (j..ny).chain((0..j).rev()) {
                let y = (row != j).then_some(usize::from(row < j));
                if y.is_some() || z.is_some() {
                    self.row(body, row + ny * plane, i, z, y);
                }
            }
        }
    }

    /// Moves a row after its inner plane, what that does not reach after its inner row, and the rest along the row.
    #[inline(always)]
    fn row(&self, body: &mut Body, row: usize, held_i: usize, z: Option<usize>, y: Option<usize>) {
        for number in self.rows[row].clone() {
            let run = &self.runs[number];
            // Empty until the first links are met.
            let mut reached = Range {
                start: usize::MAX,
                end: 0,
            };
            for (axis, side) in [(2, z), (1, y)] {
                let done = reached.clone();
                for links in side.map_or(&[][..], |side| &self.beside[number][side]) {
                    outside(body, axis, side.is_some_and(|s| s % 2 == 0), links, &done);
                    reached = reached.start.min(links.outer)..reached.end.max(links.outer + links.len);
                }
            }
            if reached.is_empty() {
                let nearest =
                    run.first + held_i.clamp(run.start_i, run.start_i + run.end - run.first - 1) - run.start_i;
                reached = nearest..nearest + 1;
            }
            along_x(body, run, reached);
        }
    }
}

/// Moves the outer ends of links that are not in `done`.
#[inline(always)]
fn outside(body: &mut Body, axis: usize, up: bool, links: &Links, done: &Range<usize>) {
    let all = links.outer..links.outer + links.len;
    let pieces = if done.start >= all.end || done.end <= all.start {
        [all, 0..0]
    } else {
        [all.start..done.start.max(all.start), done.end.min(all.end)..all.end]
    };
    for piece in pieces.into_iter().filter(|piece| !piece.is_empty()) {
        let from = links.inner + piece.start - links.outer;
        let l = body.limits[axis];
        let u = ordered(axis, body.u.each_mut().map(Vec::as_mut_slice));
        if up {
            clamp_links::<true>(&l, u.map(|c| ends(c, from, piece.clone())));
        } else {
            clamp_links::<false>(&l, u.map(|c| ends(c, from, piece.clone())));
        }
    }
}

/// Inner and outer ends of links, which do not overlap.
#[inline(always)]
fn ends(component: &mut [f32], inner: usize, outer: Range<usize>) -> (&[f32], &mut [f32]) {
    if inner < outer.start {
        let (below, above) = component.split_at_mut(outer.start);
        (&below[inner..inner + outer.len()], &mut above[..outer.len()])
    } else {
        let (below, above) = component.split_at_mut(inner);
        (&above[..outer.len()], &mut below[outer])
    }
}

#[inline(always)]
fn clamp_links<const UP: bool>(l: &LinkLimits, [a, b, c]: [(&[f32], &mut [f32]); 3]) {
    let n = a.0.len();
    let (ia, ib, ic) = (&a.0[..n], &b.0[..n], &c.0[..n]);
    let (oa, ob, oc) = (&mut a.1[..n], &mut b.1[..n], &mut c.1[..n]);
    for e in 0..n {
        ([oa[e], ob[e], oc[e]], _) = outer_end::<UP>(l, [ia[e], ib[e], ic[e]], [oa[e], ob[e], oc[e]]);
    }
}

/// Moves the elements of a run before and behind those of `reached` after them.
#[inline(always)]
fn along_x(body: &mut Body, run: &Run, reached: Range<usize>) {
    let l = body.limits[0];
    let [x, y, z] = body.u.each_mut().map(Vec::as_mut_slice);
    for e in reached.end..run.end {
        let inner = e - 1;
        ([x[e], y[e], z[e]], _) = outer_end::<true>(&l, [x[inner], y[inner], z[inner]], [x[e], y[e], z[e]]);
    }
    for e in (run.first..reached.start).rev() {
        let inner = e + 1;
        ([x[e], y[e], z[e]], _) = outer_end::<false>(&l, [x[inner], y[inner], z[inner]], [x[e], y[e], z[e]]);
    }
}
