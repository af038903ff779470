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
        surroundings: Vec::new(),
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

/// Springs of all parts together used to hold the one that is loaded, and the other parts went with it.
#[test]
fn a_part_is_held_by_its_own_springs() {
    let lattice = lattice_of(&test_bodies::two_parts());
    let settings = FemSettings::homogeneous(material(0.45), 1e5);
    let model = BatchModel::new(&FemModel::<f64>::new(&lattice, &settings).expect("valid"));
    let faces = f64::from(2 * (8 * 8 + 7 * 8 + 7 * 8));
    let alone_m_per_n = 1.0 / (1e5 * faces * lattice.spacing_m.powi(2));
    let parts = [0, model.node_count() as u32 - 1].map(|node| model.part_of(node).expect("a node in use"));
    assert_ne!(parts[0], parts[1]);
    for part in parts {
        assert!(
            (part.m_per_n / alone_m_per_n - 1.0).abs() < 1e-12,
            "{} {alone_m_per_n}",
            part.m_per_n
        );
        assert_eq!(part.elements.iter().map(|e| e.len()).sum::<usize>(), 7 * 8 * 8);
        let is_left = |element: u32| lattice.cell(element)[0] < lattice.cell(part.elements[0].start)[0] + 7;
        assert!(part.elements.iter().cloned().flatten().all(is_left), "one block");
    }
}

/// A gland on its foundation under a point load, on the same mesh: CalculiX (`tests/oracles/gland_ccx.py`), whose C3D8
/// is fully integrated, and B-bar elements assembled and factored by SciPy (`gland_bbar.py`).
#[test]
fn a_loaded_gland_is_where_two_other_solvers_have_it() {
    assert_agrees(Integration::Full, include_str!("golden/gland_linear.csv"));
    assert_agrees(
        Integration::MeanDilatation,
        include_str!("golden/gland_linear_bbar.csv"),
    );
}

fn assert_agrees(integration: Integration, golden: &str) {
    let half = [10.0, 8.0, 11.0];
    let (dims, h) = ([20, 16, 22], 2.2e-3);
    let cell = |n: usize| [n % 20, n / 20 % 16, n / 320];
    let inside = |n: usize| {
        let square = |a: usize| ((cell(n)[a] as f64 + 0.5 - half[a]) / half[a]).powi(2);
        square(0) + square(1) + square(2) <= 1.0
    };
    let labels = Labels {
        dims,
        spacing_m: h,
        cells: (0..dims.iter().product()).map(|n| u8::from(inside(n))).collect(),
        structures: Vec::new(),
    };
    let lattice = lattice_of(&labels);
    let material = Material {
        integration,
        ..material(0.49)
    };
    let fem = FemModel::<f64>::new(&lattice, &FemSettings::homogeneous(material, 250e3)).expect("valid");
    let model = BatchModel::new(&fem);
    let middle = [10.5, 8.5, 2.5].map(|c| c * h);
    let load = model.trilinear(middle).expect("inside").map(|(node, w)| NodeWeight {
        node,
        weight: [0.0, 0.0, w],
    });
    let mut state = BatchState::new(&model);
    state.begin(&model, &[&load]);
    assert!(state.solve(&model, 1e-11, 200).residual <= 1e-11);
    let (mut worst_mm, mut rows) = (0.0_f64, 0);
    for line in golden.lines().filter(|line| !line.starts_with('#')) {
        let numbers: Vec<f64> = line.split(',').map(|n| n.parse().expect("a number")).collect();
        let point = [0, 1, 2].map(|a| numbers[a] * h);
        // A node is read by the weights of any cell that it touches.
        let beside = (0..8).find_map(|c: usize| {
            model.trilinear([0, 1, 2].map(|a| point[a] + if c >> a & 1 == 1 { -1e-12 } else { 1e-12 }))
        });
        for axis in 0..3 {
            let weights = beside.expect("beside a cell").map(|(node, w)| {
                let mut weight = [0.0; 3];
                weight[axis] = w;
                NodeWeight { node, weight }
            });
            worst_mm = worst_mm.max((state.sample(0, &weights) * 1e3 - numbers[3 + axis]).abs());
        }
        rows += 1;
    }
    println!(
        "{rows} nodes, {} elements: worst {worst_mm:.2e} mm of 1.9 mm",
        model.element_count()
    );
    assert!(rows > 60 && worst_mm < 1e-6, "{worst_mm}");
}
