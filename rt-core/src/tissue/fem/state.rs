//! Where the elastic body is, and everything that a step works in.

use super::model::FemModel;
use super::multigrid::Multigrid;
use super::real::Real;
use super::sweep::{Field, zeros};

/// Directions that a patch can be moved in and still answer by superposition.
pub(super) const DIRECTIONS: usize = 3;

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

/// Displacements of all elements, and what the solver keeps from tick to tick.
#[derive(Clone, Debug)]
pub struct FemState<T = f32> {
    /// Of the element centres, in elements.
    pub(super) displacement: [Vec<f32>; 3],
    pub(super) max_displacement: f32,
    pub(super) responses: [Response<T>; DIRECTIONS],
    /// Responses in use.
    pub(super) count: usize,
    /// Lowest and one past the highest cell of the held patch in the finest grid, along each axis.
    pub(super) patch: Option<[[usize; 2]; 3]>,
    /// Nodes of the patch, the first `held` in use.
    pub(super) patch_nodes: Vec<u32>,
    pub(super) held: usize,
    pub(super) multigrid: Multigrid<T>,
    pub(super) p: Field<T>,
    pub(super) q: Field<T>,
}

impl<T: Real> FemState<T> {
    /// The body at rest. Writes every page, so that no step is the first to touch one.
    pub fn at_rest(model: &FemModel<T>) -> Self {
        let nodes = model.levels[0].grid.len();
        let response = || Response {
            direction: [0.0; 3],
            u: zeros(nodes),
            force_n_per_m: [0.0; 3],
            residual: 0.0,
            load: 0.0,
            weight_m: 0.0,
        };
        FemState {
            displacement: zeros(model.element_count()),
            max_displacement: 0.0,
            responses: std::array::from_fn(|_| response()),
            count: 0,
            patch: None,
            patch_nodes: (0..nodes).map(|_| std::hint::black_box(0)).collect(),
            held: 0,
            multigrid: Multigrid::new(&model.levels),
            p: zeros(nodes),
            q: zeros(nodes),
        }
    }

    /// Displacement from rest along `axis` (0 to 2) of the centres of all elements, in elements.
    pub fn displacement(&self, axis: usize) -> &[f32] {
        self.displacement.get(axis).map_or(&[], Vec::as_slice)
    }

    /// Centre of an element in the scene frame; the last element's for a number past the end.
    pub fn position_m(&self, model: &FemModel<T>, element: u32) -> [f64; 3] {
        let rest = model.lattice.rest_m(element);
        let e = (element as usize).min(self.displacement[0].len().saturating_sub(1));
        let u = [0, 1, 2].map(|a| self.displacement[a].get(e).copied().map_or(0.0, f64::from));
        [0, 1, 2].map(|a| rest[a] + model.lattice.spacing_m * u[a])
    }

    /// Displacement of the node at `corner`, counted in cells from the scene's origin, in metres; `None` where there is no node.
    pub fn node_displacement_m(&self, model: &FemModel<T>, corner: [usize; 3]) -> Option<[f64; 3]> {
        let grid = &model.levels[0].grid;
        let mut place = [0; 3];
        for axis in 0..3 {
            place[axis] = corner[axis].checked_sub(model.low_cell[axis])?;
            if place[axis] >= grid.nodes[axis] {
                return None;
            }
        }
        let node = grid.index(place);
        (model.part[node] != u32::MAX).then(|| {
            let used = &self.responses[..self.count];
            [0, 1, 2].map(|a| used.iter().map(|r| r.weight_m * r.u[a][node].to_f64()).sum())
        })
    }

    pub(super) fn fits(&self, model: &FemModel<T>) -> bool {
        let nodes = model.levels.iter().map(|level| level.grid.len());
        let stages = self.multigrid.stages.iter().map(|stage| stage.inverse_diagonal.len());
        nodes.eq(stages) && self.displacement[0].len() == model.element_count()
    }
}
