//! Layers condensed onto a body against the same body with their cells.

use super::cubes::{BEYOND, BODY};
use super::*;
use crate::scene::{Labels, Material, Role, Scene, Structure, Surroundings, TissueKind};
use crate::tissue::ElementField;
use crate::tissue::fem::FemTissue;
use crate::tissue::fem::batch::{BatchModel, BatchState, NodeWeight, condensed};
use crate::tissue::fem::material::{Integration, Structure as Elastic};
use stylet_anatomy::Beyond;

fn elastic(young_pa: f64, poisson: f64) -> Elastic {
    Elastic::Elastic(crate::tissue::fem::Material {
        youngs_modulus_pa: young_pa,
        poisson_ratio: poisson,
        integration: Integration::MeanDilatation,
    })
}

fn settings_of(scene: &Scene) -> FemSettings {
    let structure = |s: &Structure| match s.material.fixed {
        true => Elastic::Fixed,
        false => elastic(s.material.young_pa, s.material.poisson),
    };
    FemSettings {
        structures: scene.structures.iter().map(structure).collect(),
        structure_of: scene.body.structures().to_vec(),
        foundation_pa_per_m: 0.0,
        surroundings: scene.structures.iter().map(|s| s.material.surroundings).collect(),
    }
}

/// Returns the body with all cells of its layers, and the place of its frame in that of the scene.
fn in_all_cells(scene: &Scene, settings: &FemSettings) -> (BatchModel<f32>, [f64; 3]) {
    let unit = FemSettings {
        foundation_pa_per_m: 1.0,
        ..settings.clone()
    };
    let unit = FemModel::<f32>::of_lattice(&scene.body, &scene.body, &unit, &|_| false).expect("valid");
    let cubes = Cubes::around(&unit, &scene.layers, &settings.surroundings);
    assert_eq!(cubes.edge_m, scene.body.spacing_m, "cells of the body's size");
    let is_cell = |kind: u8| kind == BODY || (1..=scene.layers.len() as u8).contains(&kind);
    let cells: Vec<u8> = cubes.kinds.iter().map(|&kind| u8::from(is_cell(kind))).collect();
    let structure = |(&kind, &element): (&u8, &u32)| match kind {
        BODY => scene.body.structure(element),
        layer => settings.structures.len() as u8 + layer - 1,
    };
    let all = cubes
        .kinds
        .iter()
        .zip(&cubes.element)
        .filter(|(kind, _)| is_cell(**kind));
    let layers = scene.layers.iter().map(|layer| elastic(layer.young_pa, 0.49));
    let structures: Vec<Elastic> = settings.structures.iter().copied().chain(layers).collect();
    let settings = FemSettings {
        surroundings: vec![Surroundings::all(Beyond::Free); structures.len()],
        structures,
        structure_of: all.map(structure).collect(),
        foundation_pa_per_m: 0.0,
    };
    let lattice = Arc::new(Lattice::of_cells(cubes.dims, cubes.edge_m, &cells));
    let is_fixed = |place_m: [f64; 3]| {
        let corner = place_m.map(|c| (c / cubes.edge_m).round() as usize);
        cubes.around_corner(corner).any(|at| cubes.kinds[at] == BEYOND)
    };
    let model = FemModel::of_lattice(&lattice, &lattice, &settings, &is_fixed).expect("valid");
    (BatchModel::new(&model), cubes.low_m)
}

/// Returns the mean displacement of the targets by a newton in their middle along each axis, m.
fn means_m(body: &BatchModel<f32>, low_m: [f64; 3], scene: &Scene) -> [[f64; 3]; 3] {
    let in_frame = |place_m: [f64; 3]| [0, 1, 2].map(|a| place_m[a] - low_m[a]);
    let (low, high) = scene.target_bounds_m();
    let middle_m = in_frame([0, 1, 2].map(|a| 0.5 * (low[a] + high[a])));
    let is_target = |e: &u32| scene.structures[usize::from(scene.body.structure(*e))].role == Role::Target;
    let targets = (0..scene.body.element_count() as u32).filter(is_target);
    let at = |e: u32| body.lattice().element_at_rest(in_frame(scene.body.rest_m(e)));
    let targets: Vec<usize> = targets.map(|e| at(e).expect("in the body") as usize).collect();
    let mut state = BatchState::new(body);
    let mut field = ElementField::zeros(body.element_count());
    [0, 1, 2].map(|axis| {
        let load = body.trilinear(middle_m).expect("in the body").map(|(node, part)| {
            let weight = [0, 1, 2].map(|a| if a == axis { part } else { 0.0 });
            NodeWeight { node, weight }
        });
        state.begin(body, &[&load]);
        state.solve(body, 1e-4, 600);
        state.write(body, 0, &mut field);
        let mean = |u: &Vec<f32>| targets.iter().map(|&e| f64::from(u[e])).sum::<f64>() / targets.len() as f64;
        field.0.each_ref().map(mean)
    })
}

/// Returns the largest difference of a mean motion from that with all cells, over it.
fn off_by(name: &str, scene: &Scene) -> f64 {
    let settings = settings_of(scene);
    let layered = FemModel::of_layered(&scene.body, &scene.body, &settings, &scene.layers).expect("valid");
    let own = means_m(&condensed(&layered), [0.0; 3], scene);
    let (all, low_m) = in_all_cells(scene, &settings);
    let wanted = means_m(&all, low_m, scene);
    let norm = |u: [f64; 3]| u.iter().map(|c| c * c).sum::<f64>().sqrt();
    let off = |axis: usize| norm([0, 1, 2].map(|a| own[axis][a] - wanted[axis][a])) / norm(wanted[axis]);
    for axis in 0..3 {
        let mm = |u: [f64; 3]| u.map(|c| c * 1e3);
        println!(
            "{name}: {:.4?} mm/N, with all cells {:.4?}, off by {:.1} %",
            mm(own[axis]),
            mm(wanted[axis]),
            1e2 * off(axis)
        );
    }
    (0..3).map(off).fold(0.0, f64::max)
}

/// Two layers on five sides of a block, nothing on the sixth.
#[test]
fn two_layers_on_five_sides_of_a_block_move_it_as_their_cells_do() {
    let mut surroundings = Surroundings::FAT;
    surroundings.0[4] = Beyond::Free;
    let material = Material {
        surroundings,
        ..Structure::soft("gland", 1).material
    };
    let labels = Labels {
        dims: [16, 12, 14],
        spacing_m: 2e-3,
        cells: vec![1; 16 * 12 * 14],
        structures: vec![Structure {
            material,
            ..Structure::soft("gland", 1)
        }],
    };
    let scene = Scene {
        layers: vec![
            Layer {
                thickness_m: 4e-3,
                young_pa: 12e3,
            },
            Layer {
                thickness_m: 8e-3,
                young_pa: 4e3,
            },
        ],
        ..Scene::from_labels("block", &labels).expect("valid")
    };
    let off = off_by("block", &scene);
    assert!(off < 0.02, "{off}");
}

/// `full` did not start: its layers are thinner than the cells of its coarsest grid, which has no free node.
#[test]
fn every_built_in_scene_has_its_layers() {
    for name in ["paper", "pelvis", "full"] {
        let scene = Scene::builtin(name).expect("built in").for_lines(TissueKind::ChainMail);
        let body = FemTissue::<f32>::new(&scene.expect("has lines")).expect("valid");
        let springs: f64 = body.model.levels[0].springs.iter().map(|s| s.to_f64()).sum();
        assert!(springs > 0.0, "{name}");
    }
}

/// Measures what springs do to a body that bone holds: `cargo test --profile quick -p stylet-sim --lib pelvis_in_its_layers
/// -- --ignored --nocapture`
#[test]
#[ignore = "a measurement of a minute"]
fn pelvis_in_its_layers_beside_all_their_cells() {
    let scene = Scene::builtin("pelvis").expect("built in").for_tissue(TissueKind::Fem);
    off_by("pelvis", &scene);
}
