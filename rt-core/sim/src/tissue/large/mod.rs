//! Large strain near the tip: neo-Hookean tissue between element centres, in a window that the linear answer surrounds.
//!
//! A linear answer folds cells next to a tip that has moved by some of them. A window of [`SIDE`] centres keeps the
//! loads of the linear answer, its rim, and the place of the loads, and solves again for the tissue between them. Where
//! strain is small this is the linear answer again. The solver starts from the window of the tick before, a fixed
//! number of evaluations a tick (`docs/adr/0020-large-strain-near-the-tip.md`).

mod energy;
mod grid;
mod kernels;
mod memory;
mod precondition;
mod solve;

use super::corners::{REACH, least_corner_of};
use crate::scene::{Lattice, Scene};
use energy::Nodes;
use solve::Solver;

/// Element centres along an edge of the window.
const SIDE: usize = 13;
/// Evaluations of the energy's gradient in a tick.
const EVALUATIONS: usize = 12;
/// Evaluations in a tick whose window stays folded.
const MOST_EVALUATIONS: usize = 24;
/// Largest lambda over mu: that of a Poisson ratio of 0.45. Tissue nearer to incompressible takes more evaluations than
/// a tick has.
const FIRMEST: f32 = 9.0;
/// Smallest corner volume of the linear answer at which the window begins to count, and at which it counts in full.
const BEGINS: f64 = 0.6;
const IN_FULL: f64 = 0.3;
/// Element number without a window.
const NOWHERE: u32 = u32::MAX;

/// Window near the tip, with its materials and state.
#[derive(Clone, Debug)]
pub struct LargeStrain {
    solver: Solver,
    /// Shear modulus of each structure, over that of the first that is not fixed; 0 for one that is.
    moduli: Vec<f32>,
    /// Element in the middle of the window of the tick before.
    around: u32,
    /// Distance of centres from where the linear answer had them, in elements.
    off: Nodes,
    /// That distance without the displacements on top of the linear answer.
    moved: Nodes,
    /// Share of that which counts, from 0 to 1.
    part: f32,
    /// Largest distance of a centre along an axis.
    farthest: f32,
    /// Elements at the window's nodes, [`NOWHERE`] where there is none.
    elements: Vec<u32>,
}

impl LargeStrain {
    /// Makes a window for the body of a scene.
    pub fn new(scene: &Scene) -> Self {
        let materials = scene.structures.iter().map(|s| &s.material);
        let shear = materials.map(|m| if m.fixed { 0.0 } else { m.young_pa / (1.0 + m.poisson) });
        let shear: Vec<f64> = shear.collect();
        let first = shear.iter().copied().find(|&s| s > 0.0).unwrap_or(1.0);
        let solver = Solver::new();
        LargeStrain {
            off: solve::nodes(&solver.grid),
            moved: solve::nodes(&solver.grid),
            elements: vec![NOWHERE; solver.grid.len()],
            solver,
            moduli: shear.into_iter().map(|s| (s / first) as f32).collect(),
            around: NOWHERE,
            part: 0.0,
            farthest: 0.0,
        }
    }

    /// Forgets the window: the next begins at the linear answer.
    pub fn forget(&mut self) {
        if self.around != NOWHERE {
            (self.around, self.part) = (NOWHERE, 0.0);
            self.off.iter_mut().for_each(|axis| axis.fill(0.0));
        }
    }

    /// Moves nothing until the next call of [`Self::unfold`], which continues from here all the same.
    pub fn hide(&mut self) {
        self.part = 0.0;
    }

    /// Returns whether it moves something.
    pub fn is_shown(&self) -> bool {
        self.part > 0.0
    }

    /// Solves for the centres around `element` if the smallest corner volume there is too small; returns whether it
    /// moved any. `linear` displaces elements by the linear answer, `besides` by what a model adds: the rim keeps both.
    /// In elements. Does not allocate.
    pub fn unfold(
        &mut self,
        lattice: &Lattice,
        [linear, besides]: [&dyn Fn(u32) -> [f32; 3]; 2],
        element: u32,
        least_corner: f64,
    ) -> bool {
        if least_corner < BEGINS {
            self.follow(lattice, element);
            self.open(lattice, [linear, besides], element);
            self.correct(least_corner);
        } else {
            self.forget();
        }
        self.is_shown()
    }

    /// Returns the elements of the window and how far each is moved from where both have it, in elements.
    pub fn moved(&self) -> impl Iterator<Item = (u32, [f32; 3])> {
        let nodes = self.elements.iter().enumerate();
        let is_moved = nodes.filter(|(_, element)| **element != NOWHERE && self.is_shown());
        is_moved.map(|(n, &element)| (element, self.at_node(n)))
    }

    /// Returns the displacement of an element from where both have it, in elements.
    pub fn at(&self, lattice: &Lattice, element: u32) -> [f32; 3] {
        if !self.is_shown() {
            return [0.0; 3];
        }
        let (middle, cell) = (lattice.cell(self.around), lattice.cell(element));
        let place = [0, 1, 2].map(|a| (cell[a] + SIDE / 2).wrapping_sub(middle[a]));
        match place.iter().all(|&c| c < SIDE) {
            true => self.at_node(self.solver.grid.at(place)),
            false => [0.0; 3],
        }
    }

    /// Returns a bound of the motion along an axis, in elements.
    pub fn farthest(&self) -> f32 {
        self.part * self.farthest
    }

    fn at_node(&self, n: usize) -> [f32; 3] {
        let moved = |axis: &Vec<f32>| axis.get(n).copied().unwrap_or(0.0);
        self.moved.each_ref().map(|axis| self.part * moved(axis))
    }

    fn correct(&mut self, least_corner: f64) {
        let solver = &mut self.solver;
        solver.begin();
        for c in 0..3 {
            for (n, now) in solver.now[c].iter_mut().enumerate() {
                let besides = if solver.free[n] > 0.0 {
                    self.off[c][n]
                } else {
                    solver.besides[c][n]
                };
                *now = solver.linear[c][n] + besides;
            }
        }
        solver.meet();
        let elements = &self.elements;
        solver.minimise([EVALUATIONS, MOST_EVALUATIONS], |grid, now| {
            least_corner_of(|step| {
                let at = grid.at(step.map(|c| c + SIDE / 2 - REACH));
                let is_there = elements.get(at).is_some_and(|&element| element != NOWHERE);
                is_there.then(|| now.each_ref().map(|axis| axis.get(at).copied().unwrap_or(0.0)))
            }) <= 0.0
        });
        self.farthest = 0.0;
        for c in 0..3 {
            for (n, off) in self.off[c].iter_mut().enumerate() {
                *off = solver.free[n] * (solver.now[c][n] - solver.linear[c][n]);
                let moved = *off - solver.free[n] * solver.besides[c][n];
                self.moved[c][n] = moved;
                // NaN stays.
                self.farthest = if moved.abs() <= self.farthest {
                    self.farthest
                } else {
                    moved.abs()
                };
            }
        }
        if !self.farthest.is_finite() {
            return self.forget();
        }
        self.part = ((BEGINS - least_corner) / (BEGINS - IN_FULL)).clamp(0.0, 1.0) as f32;
    }

    /// Moves the window along with the tip; each centre keeps its state.
    fn follow(&mut self, lattice: &Lattice, element: u32) {
        if self.around != NOWHERE && self.around != element {
            let (from, to) = (lattice.cell(self.around), lattice.cell(element));
            let by = [0, 1, 2].map(|a| to[a] as i64 - from[a] as i64);
            let grid = &self.solver.grid;
            for c in 0..3 {
                self.solver.before[c].copy_from_slice(&self.off[c]);
                self.off[c].fill(0.0);
            }
            for place in grid.places() {
                let old = [0, 1, 2].map(|a| place[a] as i64 + by[a]);
                if old.iter().all(|&c| (0..SIDE as i64).contains(&c)) {
                    let (to, from) = (grid.at(place), grid.at(old.map(|c| c as usize)));
                    for c in 0..3 {
                        self.off[c][to] = self.solver.before[c][from];
                    }
                }
            }
        }
        self.around = element;
    }

    /// Gathers both displacements and the material around an element.
    fn open(&mut self, lattice: &Lattice, [of_linear, of_besides]: [&dyn Fn(u32) -> [f32; 3]; 2], element: u32) {
        let Solver {
            grid,
            cells,
            free,
            linear,
            besides,
            before: shear,
            ..
        } = &mut self.solver;
        let middle = lattice.cell(element);
        let shear = &mut shear[0];
        for place in grid.places() {
            let cell = [0, 1, 2].map(|a| middle[a] as i64 + place[a] as i64 - (SIDE / 2) as i64);
            let (at, there) = (grid.at(place), lattice.element_at(cell));
            self.elements[at] = there.unwrap_or(NOWHERE);
            for (to, of) in [(&mut *linear, of_linear), (&mut *besides, of_besides)] {
                for (axis, u) in to.iter_mut().zip(there.map_or([0.0; 3], of)) {
                    axis[at] = u;
                }
            }
            let structure = there.map(|e| usize::from(lattice.structure(e)));
            shear[at] = structure.map_or(0.0, |s| self.moduli.get(s).copied().unwrap_or(0.0));
            free[at] = 0.0;
        }
        let is_there = |at: usize| self.elements.get(at).is_some_and(|&e| e != NOWHERE);
        for place in grid.places().filter(|p| p.iter().all(|&c| c < SIDE - 1)) {
            let at = grid.at(place);
            let mut sum = 0.0;
            for corner in 0..8 {
                let four = [corner, corner ^ 1, corner ^ 2, corner ^ 4].map(|n| at + grid.step(n));
                let mu = match four.iter().all(|&n| is_there(n)) {
                    true => four.iter().map(|&n| shear[n]).sum::<f32>() / 32.0,
                    false => 0.0,
                };
                cells.mu[corner][at] = mu;
                sum += mu;
                for n in four.into_iter().filter(|&n| mu > 0.0 && shear[n] > 0.0) {
                    free[n] = 1.0;
                }
            }
            cells.lambda[at] = if sum > 0.0 { FIRMEST / sum } else { 0.0 };
        }
        let is_rim = |p: &[usize; 3]| p.iter().any(|&c| c == 0 || c == SIDE - 1);
        grid.places()
            .filter(is_rim)
            .for_each(|place| free[grid.at(place)] = 0.0);
    }
}

#[cfg(test)]
mod tests;
