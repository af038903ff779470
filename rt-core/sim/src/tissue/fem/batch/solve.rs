//! Conjugate gradients on eight loads, in slices of one pass over one level.

use std::ops::Range;

use super::cycle::{Stage, prolong, restrict, smooth, smooth_down, solve_coarsest};
use super::kernel::{PlaneOp, TwoPlanes, answer, nothing, sweep};
use super::level::BatchModel;
use super::support::OfLayers;
use super::{LOADS, Node, NodeWeight};
use crate::simd::{Eight, Vector, in_vectors};
use crate::tissue::fem::real::Real;

/// Work of the next slice.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Slice {
    Down(usize),
    Restrict(usize),
    Coarsest,
    /// Correction from the coarser level, and the first step after it.
    Up(usize),
    Last(usize),
    Turn,
    Advance,
}

/// Progress of the loads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Whole iterations done.
    pub iterations: u32,
    /// Largest norm of a residual over the norm of its load.
    pub residual: f64,
}

/// Eight answers in the making.
#[derive(Clone, Debug)]
pub struct BatchState<T = f32> {
    /// Work space of each level: the residual is the right-hand side of the finest, its preconditioned one the answer
    /// there.
    stages: Vec<Stage<T>>,
    work: TwoPlanes<T>,
    pub(super) u: Vec<Node<T>>,
    p: Vec<Node<T>>,
    q: Vec<Node<T>>,
    slices: Vec<Slice>,
    next: usize,
    load: [f64; LOADS],
    pub(super) of_layers_n: OfLayers,
    rz: [f64; LOADS],
    alpha: [f64; LOADS],
    residuals: [f64; LOADS],
    iterations: u32,
}

impl<T: Real> BatchState<T> {
    /// Makes room for eight answers.
    pub fn new(model: &BatchModel<T>) -> Self {
        let zeros = || vec![nothing(); model.node_count()];
        let last = model.levels.len() - 1;
        let mut slices = Vec::new();
        (0..last).for_each(|n| slices.extend([Slice::Down(n), Slice::Restrict(n)]));
        slices.push(Slice::Coarsest);
        (0..last)
            .rev()
            .for_each(|n| slices.extend([Slice::Up(n), Slice::Last(n)]));
        slices.extend([Slice::Turn, Slice::Advance]);
        BatchState {
            stages: model.levels.iter().map(Stage::new).collect(),
            work: TwoPlanes::new(&model.levels[0]),
            u: zeros(),
            p: zeros(),
            q: zeros(),
            slices,
            next: 0,
            load: [0.0; LOADS],
            of_layers_n: OfLayers::default(),
            rz: [0.0; LOADS],
            alpha: [0.0; LOADS],
            residuals: [0.0; LOADS],
            iterations: 0,
        }
    }

    /// Slices of one iteration.
    pub fn slices(&self) -> usize {
        self.slices.len()
    }

    /// Returns the size of the state, in bytes.
    pub fn bytes(&self) -> usize {
        let nodes: usize = self.stages.iter().map(|s| 3 * s.x.len()).sum();
        (nodes + 3 * self.u.len()) * size_of::<Node<T>>()
    }

    /// Begins at most eight loads; those past the eighth are ignored, as are nodes that do not move.
    pub fn begin(&mut self, model: &BatchModel<T>, loads: &[&[NodeWeight]]) {
        self.of_layers_n = OfLayers::default();
        let r = &mut self.stages[0].b;
        for field in [&mut self.u, &mut *r, &mut self.p, &mut self.q] {
            field.fill(nothing());
        }
        for (lane, load) in loads.iter().take(LOADS).enumerate() {
            for entry in load.iter().filter(|entry| model.is_free(entry.node)) {
                for (value, weight) in r[entry.node as usize].iter_mut().zip(entry.weight) {
                    value.0[lane] += T::of(weight);
                }
            }
            let mut sum = [0.0; 3];
            for support in &model.supports {
                let on_part = support.react(load, |node, force_n| {
                    if let Some(r) = r.get_mut(node as usize) {
                        (0..3).for_each(|c| r[c].0[lane] += T::of(force_n[c]));
                    }
                });
                (0..3).for_each(|c| sum[c] += on_part[c]);
            }
            self.of_layers_n[lane] = sum;
        }
        self.load = dots(model.levels[0].simd, &*r, [&*r, &*r])[0].map(f64::sqrt);
        self.residuals = self.load;
        (self.next, self.iterations) = (0, 0);
        (self.rz, self.alpha) = ([0.0; LOADS], [0.0; LOADS]);
    }

    pub(in super::super) fn do_slice(&mut self, model: &BatchModel<T>) -> Progress {
        let levels = &model.levels;
        match self.slices[self.next] {
            Slice::Down(n) => smooth_down(&levels[n], &mut self.stages[n], &mut self.work),
            Slice::Restrict(n) => {
                let (fine, coarse) = self.stages.split_at_mut(n + 1);
                restrict(&levels[n], &mut fine[n], &mut coarse[0], &mut self.work);
            }
            Slice::Coarsest => {
                if let Some(stage) = self.stages.last_mut() {
                    solve_coarsest(model, stage);
                }
            }
            Slice::Up(n) => {
                let (fine, coarse) = self.stages.split_at_mut(n + 1);
                prolong(levels[n].simd, &levels[n], &coarse[0].x, &mut fine[n].x);
                smooth(&levels[n], &mut fine[n], &mut self.work, 0);
            }
            Slice::Last(n) => smooth(&levels[n], &mut self.stages[n], &mut self.work, 1),
            Slice::Turn => self.turn(model),
            Slice::Advance => self.go_along(model),
        }
        self.next = (self.next + 1) % self.slices.len();
        self.iterations += u32::from(self.next == 0);
        self.progress()
    }

    /// Solves to `tolerance`, in at most so many iterations.
    pub fn solve(&mut self, model: &BatchModel<T>, tolerance: f64, most: u32) -> Progress {
        while !(self.next == 0 && (self.progress().residual <= tolerance || self.iterations >= most)) {
            self.do_slice(model);
        }
        self.progress()
    }

    /// Returns the progress of each load.
    pub fn progress(&self) -> Progress {
        let relative = self
            .residuals
            .iter()
            .zip(&self.load)
            .map(|(r, l)| if *l > 0.0 { r / l } else { 0.0 });
        Progress {
            iterations: self.iterations,
            residual: relative.fold(0.0, |m: f64, v| if v <= m { m } else { v }),
        }
    }

    /// Returns whether it is between two iterations, when answers may be read.
    pub fn is_whole(&self) -> bool {
        self.next == 0
    }

    /// Computes `p = z + beta p` with Polak and Ribière's beta, then `q = A p`.
    fn turn(&mut self, model: &BatchModel<T>) {
        let simd = model.levels[0].simd;
        let Stage { x: z, b: r, .. } = &self.stages[0];
        let [rz, zq] = dots(simd, z, [r, &self.q]);
        let beta = Eight(std::array::from_fn(|n| {
            let beta = -self.alpha[n] * zq[n] / self.rz[n];
            T::of(if beta.is_finite() { beta } else { 0.0 })
        }));
        scale_and_add(simd, &beta, z, &mut self.p);
        self.rz = rz;
        let mut op = Product {
            q: &mut self.q,
            inverse_diagonal: &model.levels[0].inverse_diagonal,
            dot: [0.0; LOADS],
        };
        sweep(simd, &model.levels[0], &mut self.p, &mut self.work, &mut op);
        self.alpha = std::array::from_fn(|n| {
            let alpha = rz[n] / op.dot[n];
            if alpha.is_finite() && alpha > 0.0 { alpha } else { 0.0 }
        });
    }

    fn go_along(&mut self, model: &BatchModel<T>) {
        let alpha = Eight(self.alpha.map(T::of));
        let r = &mut self.stages[0].b;
        let square = advance_fields(model.levels[0].simd, &alpha, &self.p, &self.q, &mut self.u, r);
        self.residuals = square.map(f64::sqrt);
    }
}

/// `q = A p` where nodes are free, zero elsewhere; `p . q`.
struct Product<'a, T> {
    q: &'a mut [Node<T>],
    inverse_diagonal: &'a [T],
    dot: [f64; LOADS],
}

impl<T: Real> PlaneOp<T> for Product<'_, T> {
    #[inline(always)]
    fn plane<V: Vector<T>>(&mut self, at: Range<usize>, forces: &[Node<T>], springs: &[T], p: &mut [Node<T>]) {
        let mut sums = V::splat(T::ZERO);
        let known = self.inverse_diagonal[at.clone()].iter().zip(springs);
        for (((&inverse, &spring), forces), (p, q)) in known.zip(forces).zip(p.iter().zip(&mut self.q[at])) {
            if inverse == T::ZERO {
                *q = nothing();
                continue;
            }
            for c in 0..3 {
                let p = V::load(&p[c]);
                let force = answer::<T, V>(&forces[c], spring, p);
                force.store(&mut q[c]);
                sums = sums.add(force.mul(p));
            }
        }
        add_up(&mut self.dot, sums);
    }
}

/// Number of nodes whose products are summed before the sum continues in f64.
pub(super) const SUMMED: usize = 256;

#[inline(always)]
pub(super) fn add_up<T: Real, V: Vector<T>>(total: &mut [f64; LOADS], sums: V) {
    let mut each = Eight([T::ZERO; LOADS]);
    sums.store(&mut each);
    total
        .iter_mut()
        .zip(each.0)
        .for_each(|(total, sum)| *total += sum.to_f64());
}

in_vectors! {
/// Returns `a . b` for both of `b`.
fn dots<T: Real, V>(a: &[Node<T>], b: [&[Node<T>]; 2]) -> [[f64; LOADS]; 2] {
    let mut totals = [[0.0; LOADS]; 2];
    for ((a, b0), b1) in a.chunks(SUMMED).zip(b[0].chunks(SUMMED)).zip(b[1].chunks(SUMMED)) {
        let mut sums = [V::splat(T::ZERO); 2];
        for ((a, b0), b1) in a.iter().zip(b0).zip(b1) {
            for c in 0..3 {
                let a = V::load(&a[c]);
                sums = [sums[0].add(a.mul(V::load(&b0[c]))), sums[1].add(a.mul(V::load(&b1[c])))];
            }
        }
        totals.iter_mut().zip(sums).for_each(|(total, sums)| add_up(total, sums));
    }
    totals
}
}

in_vectors! {
/// Computes `p = z + beta p`.
fn scale_and_add<T: Real, V>(beta: &Eight<T>, z: &[Node<T>], p: &mut [Node<T>]) {
    let beta = V::load(beta);
    for (z, p) in z.iter().zip(p) {
        for c in 0..3 {
            V::load(&z[c]).add(beta.mul(V::load(&p[c]))).store(&mut p[c]);
        }
    }
}
}

in_vectors! {
/// Computes `u += alpha p`, `r -= alpha q`; returns `r . r`.
fn advance_fields<T: Real, V>(
    alpha: &Eight<T>,
    p: &[Node<T>],
    q: &[Node<T>],
    u: &mut [Node<T>],
    r: &mut [Node<T>],
) -> [f64; LOADS] {
    let alpha = V::load(alpha);
    let mut total = [0.0; LOADS];
    let known = p.chunks(SUMMED).zip(q.chunks(SUMMED));
    for ((p, q), (u, r)) in known.zip(u.chunks_mut(SUMMED).zip(r.chunks_mut(SUMMED))) {
        let mut sums = V::splat(T::ZERO);
        for ((p, q), (u, r)) in p.iter().zip(q).zip(u.iter_mut().zip(r)) {
            for c in 0..3 {
                V::load(&u[c]).add(alpha.mul(V::load(&p[c]))).store(&mut u[c]);
                let left = V::load(&r[c]).sub(alpha.mul(V::load(&q[c])));
                left.store(&mut r[c]);
                sums = sums.add(left.mul(left));
            }
        }
        add_up(&mut total, sums);
    }
    total
}
}
