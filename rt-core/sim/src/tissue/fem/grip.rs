//! One held patch of tissue: its nodes, the body's responses to its motion, and the progress of the solver.

use super::model::FemModel;
use super::multigrid::Multigrid;
use super::real::Real;
use super::sweep::{Field, touched, zeros};

/// Number of directions that a patch can be moved in and still answer by superposition.
pub(super) const DIRECTIONS: usize = 3;
/// Part of the displacement outside the known directions that makes a new one.
pub(super) const NEW_DIRECTION: f64 = 1e-6;
/// Least cosine between two directions that count as the same.
pub(super) const SAME_WAY: f64 = 0.9;

/// Lowest and one past the highest cell of a patch in the finest grid, along each axis.
pub(super) type PatchCells = [[usize; 2]; 3];

/// Response of the body to the held patch moved by one metre along `direction`.
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

/// State of conjugate gradients on one response, which continue from tick to tick. `r`, `p` and `q` are in the grip's
/// fields.
#[derive(Clone, Copy, Debug)]
pub(super) struct Iteration {
    pub response: usize,
    pub cycles: u32,
    pub residual: f64,
    pub rz: f64,
    pub alpha: f64,
}

/// Responses and work space for one patch. Nothing in it depends on another, so that one can answer while the next is
/// prepared.
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
    pub iteration: Option<Iteration>,
}

impl<T: Real> Grip<T> {
    /// Makes a grip on no patch. Writes every page, so that no step is the first to touch one.
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
            iteration: None,
        }
    }

    pub fn fits(&self, model: &FemModel<T>) -> bool {
        let nodes = model.levels.iter().map(|level| level.grid.len());
        let finest = model.levels.first().map(|level| level.grid.nodes);
        finest == Some(self.multigrid.nodes)
            && nodes.eq(self.multigrid.stages.iter().map(|stage| stage.inverse_diagonal.len()))
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
        self.iteration = None;
    }

    /// Returns whether it is on this patch, and knows or has begun most of the answer to this displacement.
    pub fn is_for(&self, cells: PatchCells, by_m: [f64; 3]) -> bool {
        let along = |r: &Response<T>| dot(by_m, r.direction).powi(2);
        self.cells == Some(cells) && self.used().iter().map(along).sum::<f64>() > SAME_WAY.powi(2) * dot(by_m, by_m)
    }

    /// Returns the displacement of the patch from rest.
    pub fn held_at_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| self.used().iter().map(|r| r.weight_m * r.direction[a]).sum())
    }

    /// Returns whether it is held away from rest.
    pub fn is_moved(&self) -> bool {
        self.used().iter().any(|r| r.weight_m != 0.0)
    }

    /// Returns to rest; responses are kept for when the same patch is held again.
    pub fn release(&mut self) {
        self.responses.iter_mut().for_each(|r| r.weight_m = 0.0);
    }
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|n| a[n] * b[n]).sum()
}
