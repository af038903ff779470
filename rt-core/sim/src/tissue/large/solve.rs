//! Minimises the energy of a window under its loads: L-BFGS on top of the Laplacian, a bounded number of evaluations.

use super::SIDE;
use super::energy::{Cells, Nodes, Sides, linear, neo_hookean};
use super::grid::Grid;
use super::kernels::{add, add_dot, add_square, differ, dot, farthest, less_load, mask};
use super::precondition::Laplacian;
use crate::simd::Simd;

const KEPT: usize = 5;
/// Largest motion of a centre in a step, in elements.
const FARTHEST: f32 = 0.3;
/// Slope up at the end of a step, over that down at its start, or growth of the gradient's square, from which a step is
/// too long.
const OVERSHOT: f32 = 0.7;
const GREW: f32 = 4.0;
/// Gradient over load at which a window rests: it is within about a thousandth of an element then.
const RESTS: f32 = 5e-4;

#[derive(Clone, Debug)]
pub(super) struct Pair {
    pub step: Nodes,
    pub change: Nodes,
    inverse: f32,
}

/// Everything that a solve works in.
#[derive(Clone, Debug)]
pub(super) struct Solver {
    pub grid: Grid,
    pub cells: Cells,
    /// 1 where a node may move, else 0.
    pub free: Vec<f32>,
    laplacian: Laplacian,
    simd: Simd,
    /// Place of the nodes by the linear answer, what displaces them besides, and their place now; in elements.
    pub linear: Nodes,
    pub besides: Nodes,
    pub now: Nodes,
    load: Nodes,
    /// Norm of the load.
    length: f32,
    /// The load over its length.
    along: Nodes,
    gradient: Sides,
    pub before: Nodes,
    direction: Nodes,
    pairs: Vec<Pair>,
    alphas: [f32; KEPT],
    used: usize,
    /// Slope down the direction, how much of it was taken, and whether it is still to be shortened.
    slope: f32,
    part: f32,
    is_trial: bool,
    best: Nodes,
    /// Answer of the Laplacian to `along`, and its share of it.
    answer: Nodes,
    share: f32,
}

fn keep(from: &Nodes, to: &mut Nodes) {
    for (from, to) in from.iter().zip(to) {
        to.copy_from_slice(from);
    }
}

pub(super) fn nodes(grid: &Grid) -> Nodes {
    std::array::from_fn(|_| vec![0.0; grid.len()])
}

impl Solver {
    pub fn new() -> Self {
        let grid = Grid::new(SIDE);
        let zero = || nodes(&grid);
        Solver {
            cells: Cells {
                mu: std::array::from_fn(|_| vec![0.0; grid.len()]),
                lambda: vec![0.0; grid.len()],
            },
            free: vec![0.0; grid.len()],
            laplacian: Laplacian::new(&grid),
            simd: Simd::detect(),
            linear: zero(),
            besides: zero(),
            now: zero(),
            load: zero(),
            length: 0.0,
            along: zero(),
            gradient: Sides::new(&grid),
            before: zero(),
            direction: zero(),
            pairs: (0..KEPT)
                .map(|_| Pair {
                    step: zero(),
                    change: zero(),
                    inverse: 0.0,
                })
                .collect(),
            alphas: [0.0; KEPT],
            used: 0,
            slope: 0.0,
            part: 0.0,
            is_trial: false,
            best: zero(),
            answer: zero(),
            share: 0.0,
            grid,
        }
    }

    /// Takes the loads that the linear answer stands for.
    pub fn begin(&mut self) {
        self.used = 0;
        linear(self.simd, &self.grid, &self.cells, &self.linear, &mut self.gradient);
        keep(&self.gradient.sum, &mut self.load);
        mask(self.simd, &mut self.load, &self.free);
        self.length = dot(self.simd, &self.load, &self.load).sqrt();
        let length = self.length.max(f32::MIN_POSITIVE);
        for (along, load) in self.along.iter_mut().zip(&self.load) {
            for (along, load) in along.iter_mut().zip(load) {
                *along = load / length;
            }
        }
        for (answer, along) in self.answer.iter_mut().zip(&self.along) {
            answer.copy_from_slice(along);
        }
        self.laplacian.apply(self.simd, &self.grid, &mut self.answer);
        mask(self.simd, &mut self.answer, &self.free);
        self.share = dot(self.simd, &self.along, &self.answer).max(f32::MIN_POSITIVE);
    }

    /// Moves the place of the load to that of the linear answer.
    pub fn meet(&mut self) {
        let short = dot(self.simd, &self.along, &self.linear) - dot(self.simd, &self.along, &self.now);
        add(self.simd, &mut self.now, short / self.share, &self.answer);
    }

    /// Computes the forces less the loads, and less the force that holds the place of the load; returns their square.
    fn evaluate(&mut self) -> f32 {
        neo_hookean(self.simd, &self.grid, &self.cells, &self.now, &mut self.gradient);
        let gradient = &mut self.gradient.sum;
        let along = less_load(self.simd, gradient, &self.free, &self.load, &self.answer);
        add_square(self.simd, gradient, -along / self.share, &self.along)
    }

    /// Evaluations of the gradient: as many as it takes until the window rests, at most `evaluations`, and where it is
    /// folded then at most `most`. Ends where the gradient was smallest.
    pub fn minimise(&mut self, [evaluations, most]: [usize; 2], is_folded: impl Fn(&Grid, &Nodes) -> bool) {
        let mut smallest = self.evaluate();
        keep(&self.now, &mut self.best);
        let mut square = smallest;
        let rests = (RESTS * self.length).powi(2);
        for number in 1..most {
            if number >= evaluations && !is_folded(&self.grid, &self.best) {
                break;
            }
            if smallest <= rests || !(self.is_trial || self.set_out()) {
                break;
            }
            let there = self.evaluate();
            if there < smallest {
                smallest = there;
                keep(&self.now, &mut self.best);
            }
            let slope = dot(self.simd, &self.direction, &self.gradient.sum);
            let is_far = slope > OVERSHOT * -self.slope || there.is_nan() || there >= GREW * square;
            self.is_trial = is_far;
            if is_far {
                // Back, to where the slope would end if it were a straight line.
                let to = self.part * (self.slope / (self.slope - slope)).clamp(0.1, 0.5);
                add(self.simd, &mut self.now, to - self.part, &self.direction);
                self.part = to;
            } else {
                square = there;
                self.remember();
            }
        }
        self.is_trial = false;
        keep(&self.best, &mut self.now);
    }

    /// Steps down from where the gradient was taken; returns false where no step goes down.
    fn set_out(&mut self) -> bool {
        self.aim();
        self.slope = dot(self.simd, &self.direction, &self.gradient.sum);
        if self.slope.is_nan() || self.slope >= 0.0 {
            return false;
        }
        keep(&self.gradient.sum, &mut self.before);
        self.part = (FARTHEST / farthest(self.simd, &self.direction)).min(1.0);
        add(self.simd, &mut self.now, self.part, &self.direction);
        true
    }

    fn remember(&mut self) {
        self.pairs.rotate_right(1);
        let Some(pair) = self.pairs.first_mut() else { return };
        differ(
            self.simd,
            pair,
            self.part,
            &self.direction,
            &self.gradient.sum,
            &self.before,
        );
        let curvature = dot(self.simd, &pair.step, &pair.change);
        if curvature > 0.0 {
            pair.inverse = 1.0 / curvature;
            self.used = (self.used + 1).min(KEPT);
        } else {
            self.pairs.rotate_left(1);
        }
    }

    /// Aims down, by what the last steps have shown.
    fn aim(&mut self) {
        for (direction, gradient) in self.direction.iter_mut().zip(&self.gradient.sum) {
            for (direction, gradient) in direction.iter_mut().zip(gradient) {
                *direction = -gradient;
            }
        }
        let pairs = &self.pairs[..self.used];
        let mut along = pairs
            .first()
            .map_or(0.0, |pair| dot(self.simd, &pair.step, &self.direction));
        for (n, (pair, alpha)) in pairs.iter().zip(&mut self.alphas).enumerate() {
            *alpha = pair.inverse * along;
            match pairs.get(n + 1) {
                Some(next) => along = add_dot(self.simd, &mut self.direction, -*alpha, &pair.change, &next.step),
                None => add(self.simd, &mut self.direction, -*alpha, &pair.change),
            }
        }
        self.laplacian.apply(self.simd, &self.grid, &mut self.direction);
        mask(self.simd, &mut self.direction, &self.free);
        let mut along = pairs
            .last()
            .map_or(0.0, |pair| dot(self.simd, &pair.change, &self.direction));
        for (n, (pair, alpha)) in pairs.iter().zip(&self.alphas).enumerate().rev() {
            let by = alpha - pair.inverse * along;
            match n.checked_sub(1).and_then(|before| pairs.get(before)) {
                Some(next) => along = add_dot(self.simd, &mut self.direction, by, &pair.step, &next.change),
                None => add(self.simd, &mut self.direction, by, &pair.step),
            }
        }
    }
}
