//! Layers around a body, against the same layers in cells of the body's size (`tests/oracles/gland_in_layers.py`).

use super::*;
use crate::scene::{Layer, Role, TissueKind};
use crate::tissue::ElementField;
use crate::tissue::fem::batch::{BatchModel, BatchState, NodeWeight};

const IN_LAYERS: &str = include_str!("../../../../../../tests/oracles/gland_in_layers.csv");

/// Returns the nodes of the body that a row loads with one newton.
fn load(load: &str, scene: &Scene, body: &BatchModel<f32>) -> Vec<NodeWeight> {
    let lattice = &scene.lattice;
    let spread = |places: &[[f64; 3]], axis: usize| {
        let weigh = |(node, part): (u32, f64)| {
            let mut weight = [0.0; 3];
            weight[axis] = part / places.len() as f64;
            NodeWeight { node, weight }
        };
        let nodes = places.iter().filter_map(|place_m| body.trilinear(*place_m)).flatten();
        nodes.map(weigh).collect()
    };
    let everywhere: Vec<_> = (0..lattice.element_count() as u32).map(|e| lattice.rest_m(e)).collect();
    match load {
        "even y" => spread(&everywhere, 1),
        "even z" => spread(&everywhere, 2),
        depth => {
            let cells = [
                53.5,
                31.0,
                lattice.occupied()[0][2] as f64 + depth.parse::<f64>().expect("cells"),
            ];
            spread(&[cells.map(|c| c * lattice.spacing_m)], 2)
        }
    }
}

/// Returns the largest difference of the gland's mean motion, and the root mean square over cells of its surface, both
/// over the mean motion.
fn off_by(model: &FemModel<f32>, scene: &Scene) -> [f64; 2] {
    let body = BatchModel::new(model);
    let mut state = BatchState::new(&body);
    let mut field = ElementField::zeros(body.element_count());
    let (mut mean, mut square, mut cells) = (0.0_f64, 0.0, 0.0);
    let (mut loaded, mut motion_mm) = (String::new(), 0.0);
    for row in IN_LAYERS.lines().filter(|line| line.starts_with("shell,")) {
        let words: Vec<&str> = row.split(',').collect();
        let wanted_mm: Vec<f64> = words[3..].iter().map(|v| v.parse().expect("a number")).collect();
        if loaded != words[1] {
            loaded = words[1].to_owned();
            state.begin(&body, &[&load(words[1], scene, &body)]);
            state.solve(&body, 1e-4, 200);
            state.write(&body, 0, &mut field);
        }
        let is_mean = words[2] == "mean";
        let own = |u: &Vec<f32>| {
            if is_mean {
                return u.iter().map(|u| f64::from(*u)).sum::<f64>() / u.len() as f64;
            }
            let cell: Vec<usize> = words[2].split(' ').map(|c| c.parse().expect("a cell")).collect();
            let element = scene.lattice.element_of_cell(cell[0], cell[1], cell[2]);
            f64::from(u[element.expect("on the surface") as usize])
        };
        let own_mm = field.0.each_ref().map(|u| 1e3 * own(u));
        let off_mm = (0..3).map(|a| (own_mm[a] - wanted_mm[a]).powi(2)).sum::<f64>().sqrt();
        if is_mean {
            motion_mm = wanted_mm.iter().map(|c| c * c).sum::<f64>().sqrt();
            mean = mean.max(off_mm / motion_mm);
            println!(
                "{loaded}: {own_mm:.4?} mm/N, oracle {wanted_mm:.4?}, off by {:.2} %",
                1e2 * off_mm / motion_mm
            );
        } else {
            square += (off_mm / motion_mm).powi(2);
            cells += 1.0;
        }
    }
    [mean, f64::sqrt(square / cells)]
}

/// The gland moves as in the same layers solved cell by cell. On springs of the layer's modulus over its thickness it
/// moves twice as far.
#[test]
fn a_gland_in_layers_moves_as_with_all_their_cells() {
    let scene = Scene::builtin("paper").expect("built in");
    let model = FemTissue::<f32>::new(&scene).expect("valid").model;
    let [mean, surface] = off_by(&model, &scene);
    println!("mean {:.2} %, surface {:.2} %", 1e2 * mean, 1e2 * surface);
    assert!(mean < 0.03 && surface < 0.07, "{mean} {surface}");
    let springs = Scene {
        layers: Vec::new(),
        ..scene.clone()
    };
    let on_springs = FemTissue::<f32>::new(&springs).expect("valid").model;
    let [mean, _] = off_by(&on_springs, &scene);
    assert!(mean > 0.8, "{mean}");
}

/// What two loads do to each other does not depend on which of them acts, and the layers and springs carry all of both.
#[test]
fn layers_answer_reciprocally_and_carry_the_load() {
    let scene = Scene::builtin("paper").expect("built in");
    let body = BatchModel::new(&FemTissue::<f32>::new(&scene).expect("valid").model);
    let loads = ["3", "29", "even y", "even z"].map(|name| load(name, &scene, &body));
    let mut state = BatchState::new(&body);
    state.begin(&body, &loads.each_ref().map(Vec::as_slice));
    state.solve(&body, 1e-5, 200);
    for (a, _) in loads.iter().enumerate() {
        for b in 0..a {
            let [there, back] = [state.sample(a, &loads[b]), state.sample(b, &loads[a])];
            let own = (state.sample(a, &loads[a]) * state.sample(b, &loads[b])).sqrt();
            println!("{a} and {b}: {there:.4e} and {back:.4e} of {own:.4e} m/N");
            assert!((there - back).abs() < 2e-5 * own, "{there} {back} of {own}");
        }
        let carried = state.foundation_n(&body, a)[if a == 2 { 1 } else { 2 }];
        println!("{a}: carried {carried:.5} N");
        assert!((carried + 1.0).abs() < 2e-3, "{carried}");
    }
}

/// A ball beside another that is loaded, with nothing between them, stays at rest: layers do not couple parts.
#[test]
fn a_part_beside_a_loaded_one_stays_at_rest() {
    let dims = [24, 12, 12];
    let is_in = |i: usize, j: usize, k: usize| {
        let from = |middle: f64| (i as f64 + 0.5 - middle).hypot((j as f64 - 5.5).hypot(k as f64 - 5.5)) < 5.0;
        from(6.0) || from(18.0)
    };
    let cells = (0..dims.iter().product()).map(|n| u8::from(is_in(n % 24, n / 24 % 12, n / 288)));
    let labels = Labels {
        dims,
        spacing_m: 2e-3,
        cells: cells.collect(),
        structures: Vec::new(),
    };
    let scene = Scene::from_labels("two balls", &labels).expect("valid");
    let body = BatchModel::new(&FemTissue::<f32>::new(&scene).expect("valid").model);
    let at = body.trilinear([12e-3, 12e-3, 12e-3]).expect("in the first");
    let load = at.map(|(node, part)| NodeWeight {
        node,
        weight: [0.0, part, 0.0],
    });
    let mut state = BatchState::new(&body);
    state.begin(&body, &[&load]);
    state.solve(&body, 1e-4, 200);
    let mut field = ElementField::zeros(body.element_count());
    state.write(&body, 0, &mut field);
    let moved = |middle_m: f64| {
        let element = scene
            .lattice
            .element_at_rest([middle_m, 12e-3, 12e-3])
            .expect("in a ball");
        let square = field.0.each_ref().map(|u| u[element as usize].powi(2));
        square.iter().sum::<f32>().sqrt()
    };
    let [near, far] = [12e-3, 36e-3].map(moved);
    // As the solver leaves it, on springs as well.
    assert!(near > 1e-4 && far < 1e-3 * near, "{near} {far}");
}

/// Measures what layers cost and do, with springs beside them: `cargo test --profile quick -p stylet-sim --lib
/// what_layers_cost -- --ignored --nocapture`
#[test]
#[ignore = "a measurement of a minute"]
fn what_layers_cost_and_do_in_paper_and_pelvis() {
    for name in ["paper", "pelvis"] {
        let scene = Scene::builtin(name).expect("built in").for_tissue(TissueKind::Fem);
        for layers in [vec![], vec![Layer::FAT]] {
            let is_layered = !layers.is_empty();
            let scene = Scene {
                layers,
                ..scene.clone()
            };
            let seconds = |begun: std::time::Instant| begun.elapsed().as_secs_f64();
            let begun = std::time::Instant::now();
            let model = FemTissue::<f32>::new(&scene).expect("valid").model;
            let made_s = seconds(begun);
            let begun = std::time::Instant::now();
            let again = FemTissue::<f32>::new(&scene).expect("valid").model;
            let again_s = seconds(begun);
            assert_eq!(again.reactions.len(), model.reactions.len());
            let begun = std::time::Instant::now();
            let body = BatchModel::new(&model);
            let condensed_s = seconds(begun);
            let (low, high) = scene.target_bounds_m();
            let middle_m = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]));
            let mut state = BatchState::new(&body);
            let mut field = ElementField::zeros(body.element_count());
            let mut means = [0.0; 3];
            for (axis, mean) in means.iter_mut().enumerate() {
                let load = body.trilinear(middle_m).expect("in the gland").map(|(node, part)| {
                    let weight = [0, 1, 2].map(|a| if a == axis { part } else { 0.0 });
                    NodeWeight { node, weight }
                });
                state.begin(&body, &[&load]);
                state.solve(&body, 1e-3, 200);
                state.write(&body, 0, &mut field);
                let is_target = |e: &u32| scene.structures[usize::from(scene.body.structure(*e))].role == Role::Target;
                let targets: Vec<u32> = (0..scene.body.element_count() as u32).filter(is_target).collect();
                let sum: f64 = targets.iter().map(|e| f64::from(field.0[axis][*e as usize])).sum();
                *mean = 1e3 * sum / targets.len() as f64;
            }
            product_of_shapes(&model);
            let springs: f64 = model.levels[0].springs.iter().map(|s| f64::from(*s)).sum();
            println!(
                "{name}, layers {is_layered}: made in {made_s:.2} s, again in {again_s:.2} s, condensed in {condensed_s:.2} s, {:.1} MB, springs {springs:.0} N/m, gland moves by {means:.4?} mm/N along x, y, z",
                body.bytes() as f64 / 1e6
            );
        }
    }
}

/// Prints how long a tick off a line would take to add the layers' shapes to one product of its solver.
fn product_of_shapes(model: &FemModel<f32>) {
    for reaction in &model.reactions {
        let narrow = |column: &Vec<[f64; 3]>| column.iter().map(|f| f.map(|c| c as f32)).collect();
        let columns: Vec<Vec<[f32; 3]>> = reaction.forces.iter().map(narrow).collect();
        let mut u = vec![[1e-3_f32; 3]; reaction.nodes.len()];
        let begun = std::time::Instant::now();
        const TIMES: u32 = 20;
        for _ in 0..TIMES {
            let dot = |column: &Vec<[f32; 3]>| -> f64 {
                let products = column
                    .iter()
                    .zip(&u)
                    .map(|(f, u)| f[0] * u[0] + f[1] * u[1] + f[2] * u[2]);
                f64::from(products.sum::<f32>())
            };
            let along = nalgebra::DVector::from_iterator(columns.len(), columns.iter().map(dot));
            for (column, &share) in columns.iter().zip(&(&reaction.mix * along)) {
                let share = 1e-9 * share as f32;
                for (u, f) in u.iter_mut().zip(column) {
                    (0..3).for_each(|c| u[c] -= share * f[c]);
                }
            }
        }
        println!(
            "{} columns on {} nodes: {:.2} ms",
            columns.len(),
            u.len(),
            1e3 * begun.elapsed().as_secs_f64() / f64::from(TIMES)
        );
        assert!(u[0][0].is_finite());
    }
}
