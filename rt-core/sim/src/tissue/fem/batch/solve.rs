//! Conjugate gradients on eight loads, in slices of one pass over one level.

use std::ops::Range;

use super::cycle::{Stage, prolong, restrict, smooth, smooth_down, solve_coarsest};
use super::kernel::{PlaneOp, TwoPlanes, each, sweep};
use super::level::{BatchLevel, BatchModel, NodeWeight};
use super::{LOADS, Lanes, Node};
use crate::simd::{Simd, vectorised};
use crate::tissue::fem::real::Real;

/// What the next slice of work does.
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

/// How far the loads are.
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
    stages: Vec<Stage<T>>,
    work: TwoPlanes<T>,
    pub(super) u: Vec<Node<T>>,
    r: Vec<Node<T>>,
    p: Vec<Node<T>>,
    q: Vec<Node<T>>,
    slices: Vec<Slice>,
    next: usize,
    load: [f64; LOADS],
    rz: [f64; LOADS],
    alpha: [f64; LOADS],
    residuals: [f64; LOADS],
    iterations: u32,
}

impl<T: Real> BatchState<T> {
    pub(in super::super) fn of_model(model: &BatchModel<T>) -> Self {
        let zeros = || vec![[[T::ZERO; LOADS]; 3]; model.node_count()];
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
            r: zeros(),
            p: zeros(),
            q: zeros(),
            slices,
            next: 0,
            load: [0.0; LOADS],
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

    /// Bytes that the state keeps.
    pub fn bytes(&self) -> usize {
        let nodes: usize = self.stages.iter().map(|s| 3 * s.x.len()).sum();
        (nodes + 4 * self.u.len()) * size_of::<Node<T>>()
    }

    pub(in super::super) fn take_up(&mut self, model: &BatchModel<T>, loads: &[&[NodeWeight]]) {
        for field in [&mut self.u, &mut self.r, &mut self.p, &mut self.q] {
            field.fill([[T::ZERO; LOADS]; 3]);
        }
        for (lane, load) in loads.iter().take(LOADS).enumerate() {
            for entry in load.iter().filter(|entry| model.is_free(entry.node)) {
                for c in 0..3 {
                    self.r[entry.node as usize][c][lane] += T::of(entry.weight[c]);
                }
            }
        }
        self.load = dot(model.levels[0].simd, &self.r, &self.r).map(f64::sqrt);
        self.residuals = self.load;
        (self.next, self.iterations) = (0, 0);
        (self.rz, self.alpha) = ([0.0; LOADS], [0.0; LOADS]);
    }

    pub(in super::super) fn do_slice(&mut self, model: &BatchModel<T>) -> Progress {
        let levels = &model.levels;
        match self.slices[self.next] {
            Slice::Down(n) => {
                if n == 0 {
                    self.stages[0].b.copy_from_slice(&self.r);
                }
                smooth_down(&levels[n], &mut self.stages[n], &mut self.work);
            }
            Slice::Restrict(n) => {
                let (fine, coarse) = self.stages.split_at_mut(n + 1);
                restrict(&levels[n], &mut fine[n], &mut coarse[0], &mut self.work);
            }
            Slice::Coarsest => {
                if let Some(stage) = self.stages.last_mut() {
                    if levels.len() == 1 {
                        stage.b.copy_from_slice(&self.r);
                    }
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

    /// How far each of the loads is solved.
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

    /// Between two iterations, when answers may be read.
    pub fn is_whole(&self) -> bool {
        self.next == 0
    }

    /// `p = z + beta p` with Polak and Ribière's beta, then `q = A p`.
    fn turn(&mut self, model: &BatchModel<T>) {
        let simd = model.levels[0].simd;
        let z = &self.stages[0].x;
        let rz = dot(simd, &self.r, z);
        let zq = dot(simd, z, &self.q);
        let beta: Lanes<T> = each(|n| {
            let beta = -self.alpha[n] * zq[n] / self.rz[n];
            T::of(if beta.is_finite() { beta } else { 0.0 })
        });
        scale_and_add(simd, beta, z, &mut self.p);
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
        let alpha: Lanes<T> = each(|n| T::of(self.alpha[n]));
        let square = advance_fields(model.levels[0].simd, alpha, &self.p, &self.q, &mut self.u, &mut self.r);
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
    fn plane(&mut self, at: Range<usize>, forces: &[Node<T>], p: &mut [Node<T>]) {
        let mut sums = [T::ZERO; LOADS];
        let nodes = self.inverse_diagonal[at.clone()].iter().zip(forces).zip(p);
        for (((&inverse, forces), p), q) in nodes.zip(&mut self.q[at]) {
            for c in 0..3 {
                let (f, p, before) = (forces[c], p[c], sums);
                let kept = each(|n| if inverse == T::ZERO { T::ZERO } else { f[n] });
                q[c] = kept;
                sums = each(|n| before[n] + kept[n] * p[n]);
            }
        }
        self.dot
            .iter_mut()
            .zip(sums)
            .for_each(|(dot, sum)| *dot += sum.to_f64());
    }
}

/// Nodes whose products are summed before the sum goes on in f64.
const SUMMED: usize = 256;

vectorised! {
fn dot<T>(a: &[Node<T>], b: &[Node<T>]) -> [f64; LOADS] {
    let mut total = [0.0; LOADS];
    for (a, b) in a.chunks(SUMMED).zip(b.chunks(SUMMED)) {
        let mut sums = [T::ZERO; LOADS];
        for (a, b) in a.iter().zip(b) {
            for c in 0..3 {
                let (a, b, before) = (a[c], b[c], sums);
                sums = each(|n| before[n] + a[n] * b[n]);
            }
        }
        total.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum.to_f64());
    }
    total
}
}

vectorised! {
/// `p = z + beta p`.
fn scale_and_add<T>(beta: Lanes<T>, z: &[Node<T>], p: &mut [Node<T>]) {
    for (z, p) in z.iter().zip(p) {
        for c in 0..3 {
            let (z, p0) = (z[c], p[c]);
            p[c] = each(|n| z[n] + beta[n] * p0[n]);
        }
    }
}
}

vectorised! {
/// `u += alpha p`, `r -= alpha q`; returns `r . r`.
fn advance_fields<T>(alpha: Lanes<T>, p: &[Node<T>], q: &[Node<T>], u: &mut [Node<T>], r: &mut [Node<T>]) -> [f64; LOADS] {
    for ((p, q), (u, r)) in p.iter().zip(q).zip(u.iter_mut().zip(r.iter_mut())) {
        for c in 0..3 {
            let (p, q, u0, r0) = (p[c], q[c], u[c], r[c]);
            u[c] = each(|n| u0[n] + alpha[n] * p[n]);
            r[c] = each(|n| r0[n] - alpha[n] * q[n]);
        }
    }
    let mut total = [0.0; LOADS];
    for r in r.chunks(SUMMED) {
        let mut sums = [T::ZERO; LOADS];
        for r in r {
            for r in r {
                let before = sums;
                sums = each(|n| before[n] + r[n] * r[n]);
            }
        }
        total.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum.to_f64());
    }
    total
}
}

/// Nodes of the finest level, for what reads answers.
pub(super) fn finest<T>(model: &BatchModel<T>) -> &BatchLevel<T> {
    &model.levels[0]
}
