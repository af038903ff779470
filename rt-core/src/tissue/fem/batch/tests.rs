//! Eight loads at once give what one solver gives for each.

use super::*;
use crate::scene::{Labels, Lattice, Scene, test_bodies};
use crate::tissue::fem::{FemModel, FemSettings, Integration, Material, Structure};
use std::sync::Arc;

fn material(nu: f64) -> Material {
    Material {
        youngs_modulus_pa: 17e3,
        poisson_ratio: nu,
        integration: Integration::MeanDilatation,
    }
}

fn lattice_of(labels: &Labels) -> Arc<Lattice> {
    Scene::from_labels("test", labels).expect("valid labels").lattice
}

fn unit(node: u32, axis: usize) -> Vec<NodeWeight> {
    let mut weight = [0.0; 3];
    weight[axis] = 1.0;
    vec![NodeWeight { node, weight }]
}

/// A body with holes and two materials: what a load at one place moves another by is the same the other way round.
#[test]
fn answers_are_reciprocal_and_balance_their_loads() {
    let lattice = lattice_of(&test_bodies::with_hole());
    let settings = FemSettings {
        structures: vec![Structure::Elastic(material(0.3)), Structure::Elastic(material(0.45))],
        structure_of: (0..lattice.element_count()).map(|e| (e / 5 % 2) as u8).collect(),
        foundation_pa_per_m: 1e5,
    };
    let model = BatchModel::new(&FemModel::<f64>::new(&lattice, &settings).expect("valid"));
    let mut state = BatchState::new(&model);
    let nodes: Vec<u32> = (0..8).map(|n| n * (model.node_count() as u32 / 8) + 3).collect();
    let loads: Vec<_> = nodes.iter().enumerate().map(|(n, &node)| unit(node, n % 3)).collect();
    let loads: Vec<_> = loads.iter().map(Vec::as_slice).collect();
    state.begin(&model, &loads);
    let progress = state.solve(&model, 1e-12, 200);
    assert!(progress.residual <= 1e-12, "{progress:?}");
    for (a, load) in loads.iter().enumerate() {
        let foundation = state.foundation_n(&model, a);
        for (axis, force) in foundation.into_iter().enumerate() {
            let wanted = -load[0].weight[axis];
            assert!((force - wanted).abs() < 1e-9, "{force} {wanted}");
        }
        for (b, other) in loads.iter().enumerate() {
            let (ab, ba) = (state.sample(a, other), state.sample(b, load));
            assert!((ab - ba).abs() < 1e-10 * state.sample(a, load), "{ab} {ba}");
        }
    }
}
