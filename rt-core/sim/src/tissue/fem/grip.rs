//! One held patch of tissue: its nodes, how the body answers when it is moved, and how far the solver is with that.

use super::cg::Course;
use super::guess::guess;
use super::model::FemModel;
use super::multigrid::Multigrid;
use super::real::Real;
use super::sweep::{Field, touched, zeros};

/// Directions that a patch can be moved in and still answer by superposition.
pub(super) const DIRECTIONS: usize = 3;
/// A direction is new if this part of the displacement is outside those known.
pub(super) const NEW_DIRECTION: f64 = 1e-6;
/// A patch is pushed the same way up to an angle of this cosine.
pub(super) const SAME_WAY: f64 = 0.9;

/// Lowest and one past the highest cell of a patch in the finest grid, along each axis.
pub(super) type PatchCells = [[usize; 2]; 3];

/// How the body answers to the held patch moved by one metre along `direction`.
#[derive(Clone, Debug)]
pub(super) struct Response<T> {
    pub direction: [f64; 3],
    /// Displacement of the nodes per metre.
    pub u: Field<T>,
    /// Force that moves the patch.
    pub force_n_per_m: [f64; 3],
    /// Norm of what is left of the forces on free nodes, and of those that the moved patch alone would cause.
    pub residual: f64,
    pub load: f64,
    /// Metres, in the present displacement.
    pub weight_m: f64,
}

/// What is kept for one patch. Nothing in it depends on another, so that one can answer while the next is prepared.
#[derive(Clone, Debug)]
pub(super) struct Grip<T> {
    /// The patch; `None` before the first, and when what was known of it is dropped.
    pub cells: Option<PatchCells>,
    pub responses: [Response<T>; DIRECTIONS],
    /// Responses in use.
    pub count: usize,
    /// Nodes of the patch, the first `held` in use.
    pub nodes: Vec<u32>,
    pub held: usize,
    pub multigrid: Multigrid<T>,
    pub p: Field<T>,
    pub q: Field<T>,
    /// Conjugate gradients that are not done.
    pub course: Option<Course>,
}

impl<T: Real> Grip<T> {
    /// On no patch. Writes every page, so that no step is the first to touch one.
    pub fn new(model: &FemModel<T>) -> Self {
        let nodes = model.levels[0].grid.len();
        let response = || Response {
            direction: [0.0; 3],
            u: zeros(nodes),
            force_n_per_m: [0.0; 3],
            residual: 0.0,
            load: 0.0,
            weight_m: 0.0,
        };
        Grip {
            cells: None,
            responses: std::array::from_fn(|_| response()),
            count: 0,
            nodes: touched(nodes, 0),
            held: 0,
            multigrid: Multigrid::new(&model.levels),
            p: zeros(nodes),
            q: zeros(nodes),
            course: None,
        }
    }

    pub fn fits(&self, model: &FemModel<T>) -> bool {
        let nodes = model.levels.iter().map(|level| level.grid.len());
        nodes.eq(self.multigrid.stages.iter().map(|stage| stage.inverse_diagonal.len()))
    }

    pub fn used(&self) -> &[Response<T>] {
        &self.responses[..self.count]
    }

    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.held]
    }

    /// Forgets its patch.
    pub fn drop_patch(&mut self) {
        self.cells = None;
        self.count = 0;
        self.course = None;
    }

    /// Whether it is on this patch, and knows or has begun most of the answer to this displacement.
    pub fn is_for(&self, cells: PatchCells, by_m: [f64; 3]) -> bool {
        let along = |r: &Response<T>| dot(by_m, r.direction).powi(2);
        self.cells == Some(cells) && self.used().iter().map(along).sum::<f64>() > SAME_WAY.powi(2) * dot(by_m, by_m)
    }

    /// Takes up a patch: the displacement that `before` answers with becomes the first guess of the response along `by_m`,
    /// moved along where the patch is the next one: deep inside a body that would be the answer.
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
        self.course = None;
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

    /// How far the patch is from rest.
    pub fn held_at_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| self.used().iter().map(|r| r.weight_m * r.direction[a]).sum())
    }

    /// Held away from rest.
    pub fn is_moved(&self) -> bool {
        self.used().iter().any(|r| r.weight_m != 0.0)
    }

    /// Back to rest; responses are kept for when the same patch is held again.
    pub fn release(&mut self) {
        self.responses.iter_mut().for_each(|r| r.weight_m = 0.0);
    }

    /// From what `u` holds, or from nothing: then what is left to do is known already, and small for a small weight.
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

    /// Expresses a displacement of the patch in the directions known, with a new one if more than `new` of it is outside them.
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

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|n| a[n] * b[n]).sum()
}
