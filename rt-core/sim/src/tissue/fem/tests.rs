//! Fixtures of the elastic body's tests.

use std::sync::Arc;

use super::solve::hold_cells;
use super::*;
use stylet_random::Random;

use crate::scene::{Labels, Lattice, Scene, test_bodies};
use crate::tissue::{Held, HeldOutcome};

mod ahead;
mod coarser;
mod golden;
mod layers;
mod locking;
mod memory;
mod operator;
mod refusals;
mod step;
mod surroundings;

const EXACT: SolveSettings = SolveSettings {
    relative_tolerance: 1e-9,
    max_cycles: 400,
};

/// Returns the displacement of the node at `corner`, counted in cells from the scene's origin, in metres; `None`
/// without a node.
fn node_displacement_m<T: Real>(state: &FemState<T>, model: &FemModel<T>, corner: [usize; 3]) -> Option<[f64; 3]> {
    let grid = &model.levels[0].grid;
    let mut place = [0; 3];
    for axis in 0..3 {
        place[axis] = corner[axis].checked_sub(model.low_cell[axis])?;
        if place[axis] >= grid.nodes[axis] {
            return None;
        }
    }
    let node = grid.index(place);
    let used = state.grip.used().iter();
    let along = |a: usize| used.clone().map(|r| r.weight_m * r.u[a][node].to_f64()).sum();
    (model.part[node] != u32::MAX).then(|| [0, 1, 2].map(along))
}

fn lattice_of(labels: &Labels) -> Arc<Lattice> {
    Scene::from_labels("test", labels).expect("valid labels").lattice
}

fn block(dims: [usize; 3], spacing_m: f64) -> Arc<Lattice> {
    lattice_of(&Labels {
        dims,
        spacing_m,
        cells: vec![1; dims.iter().product()],
        structures: Vec::new(),
    })
}

fn material(poisson_ratio: f64, integration: Integration) -> Material {
    Material {
        youngs_modulus_pa: 20e3,
        poisson_ratio,
        integration,
    }
}

const FULL: Integration = Integration::Full;
const MEAN: Integration = Integration::MeanDilatation;

/// Returns the settings of two materials in alternating cells, stiffness 1 to `contrast`.
fn two_materials(lattice: &Lattice, contrast: f64, foundation_pa_per_m: f64) -> FemSettings {
    let soft = material(0.3, FULL);
    let stiff = Material {
        youngs_modulus_pa: contrast * soft.youngs_modulus_pa,
        ..material(0.45, MEAN)
    };
    let structure = |element| u8::from(lattice.cell(element).iter().map(|c| c / 2).sum::<usize>() % 2 == 1);
    FemSettings {
        structures: vec![Structure::Elastic(soft), Structure::Elastic(stiff)],
        structure_of: (0..lattice.element_count() as u32).map(structure).collect(),
        foundation_pa_per_m,
        surroundings: Vec::new(),
    }
}

fn patch(lattice: &Lattice, element: u32, by_m: [f64; 3], patch_m: f64) -> Held {
    let rest = lattice.rest_m(element);
    Held {
        element,
        position_m: [0, 1, 2].map(|a| rest[a] + by_m[a]),
        patch_m,
    }
}
