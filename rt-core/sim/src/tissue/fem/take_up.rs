//! Start of a grip on a patch, and of a direction to move it in.

use super::grip::{DIRECTIONS, Grip, PatchCells, dot};
use super::guess::guess;
use super::model::FemModel;
use super::real::Real;

impl<T: Real> Grip<T> {
    /// Begins a patch: the displacement that `before` answers with becomes the first guess of the response along
    /// `by_m`, moved along where the patch is the next one: deep inside a body that would be the answer.
    ///
    /// False, and nothing changes, if no node in `cells` can move.
    pub fn take_up(&mut self, model: &FemModel<T>, cells: PatchCells, by_m: [f64; 3], before: &Grip<T>) -> bool {
        if !self.find_nodes(model, cells) {
            return false;
        }
        let distance = dot(by_m, by_m).sqrt();
        let direction = by_m.map(|c| c / distance);
        guess(model, before, cells, by_m, &mut self.p, &mut self.responses[0].u);
        self.hold(model);
        self.cells = Some(cells);
        self.count = 1;
        self.iteration = None;
        self.begin_response(model, 0, direction, false);
        true
    }

    fn hold(&mut self, model: &FemModel<T>) {
        let held = &self.nodes[..self.held];
        self.multigrid.hold(&model.levels, held);
        for nodes in &model.loose {
            let part = nodes.first().map(|&node| model.part[node as usize]);
            if held.iter().any(|&node| Some(model.part[node as usize]) == part) {
                continue;
            }
            for &node in nodes {
                self.multigrid.stages[0].inverse_diagonal[node as usize] = T::ZERO;
                self.responses[0].u.iter_mut().for_each(|c| c[node as usize] = T::ZERO);
            }
        }
    }

    /// Begins a response from what `u` holds, or from nothing: then the residual is known already, and small for a
    /// small weight.
    fn begin_response(&mut self, model: &FemModel<T>, n: usize, direction: [f64; 3], from_nothing: bool) {
        let (load, force_n_per_m) = self.load(model, direction);
        let response = &mut self.responses[n];
        for (u, part) in response.u.iter_mut().zip(direction) {
            if from_nothing {
                u.fill(T::ZERO);
            }
            for &node in &self.nodes[..self.held] {
                u[node as usize] = T::of(part);
            }
        }
        response.direction = direction;
        response.load = load;
        response.force_n_per_m = force_n_per_m;
        response.residual = if from_nothing { load } else { f64::INFINITY };
    }

    /// Expresses a displacement of the patch in the directions known, with a new one if more than `new` of it is
    /// outside them.
    pub fn weigh(&mut self, model: &FemModel<T>, by_m: [f64; 3], new: f64) {
        let mut rest = by_m;
        for response in &mut self.responses[..self.count] {
            response.weight_m = dot(rest, response.direction);
            for (rest, along) in rest.iter_mut().zip(response.direction) {
                *rest -= response.weight_m * along;
            }
        }
        let left = dot(rest, rest).sqrt();
        if left <= new * dot(by_m, by_m).sqrt() || self.count == DIRECTIONS {
            return;
        }
        let n = self.count;
        self.responses[n].weight_m = left;
        self.count += 1;
        self.begin_response(model, n, rest.map(|c| c / left), true);
    }

    fn find_nodes(&mut self, model: &FemModel<T>, cells: PatchCells) -> bool {
        let level = &model.levels[0];
        let grid = &level.grid;
        let inside = |cell: [usize; 3]| (0..3).all(|a| (cells[a][0]..cells[a][1]).contains(&cell[a]));
        let holds = |place: [usize; 3]| {
            (0..8).any(|corner: usize| {
                let back = [corner & 1, corner >> 1 & 1, corner >> 2];
                let cell = [0, 1, 2].map(|a| place[a].wrapping_sub(back[a]));
                inside(cell) && model.is_cell[grid.index(cell)]
            })
        };
        let any_free = (cells[2][0]..=cells[2][1]).any(|k| {
            (cells[1][0]..=cells[1][1]).any(|j| {
                (cells[0][0]..=cells[0][1])
                    .any(|i| level.inverse_diagonal[grid.index([i, j, k])] != T::ZERO && holds([i, j, k]))
            })
        });
        if !any_free {
            return false;
        }
        self.held = 0;
        for k in cells[2][0]..=cells[2][1] {
            for j in cells[1][0]..=cells[1][1] {
                for i in cells[0][0]..=cells[0][1] {
                    let node = grid.index([i, j, k]);
                    if level.inverse_diagonal[node] != T::ZERO && holds([i, j, k]) {
                        self.nodes[self.held] = node as u32;
                        self.held += 1;
                    }
                }
            }
        }
        true
    }
}
