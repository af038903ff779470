//! Fixtures of the claims: bodies, a needle that wanders, and oracles that share no code with the step.

use super::violation::largest_violation;
use crate::limits::TissueParameters;
use crate::scene::{Labels, Scene};
use crate::tissue::chainmail::{ChainMail, TissueState, step};
use crate::tissue::{Held, HeldOutcome, Solve};
use stylet_random::Random;

pub(super) fn model_with(labels: &Labels, parameters: &TissueParameters) -> ChainMail {
    let scene = Scene::from_labels("test", labels).expect("valid labels");
    ChainMail::new(&scene, parameters.validate().expect("valid limits"))
}

pub(super) fn model_of(labels: &Labels) -> ChainMail {
    model_with(labels, &TissueParameters::default())
}

pub(super) fn paper() -> ChainMail {
    let scene = Scene::builtin("paper").expect("built in");
    let limits = TissueParameters::default().validate().expect("valid");
    ChainMail::new(&scene, limits)
}

/// Holds an element at its rest position moved by `way`, in elements.
pub(super) fn held_at(model: &ChainMail, element: u32, way: [f64; 3]) -> Held {
    let rest = model.lattice().rest_m(element);
    let h = model.lattice().spacing_m;
    Held {
        element,
        position_m: [0, 1, 2].map(|a| rest[a] + h * way[a]),
        patch_m: 0.0,
    }
}

/// Returns the largest violation, by positions in f64 over each element's upper neighbours: shares no code with the
/// step.
pub(super) fn oracle_violation(model: &ChainMail, state: &TissueState, parameters: &TissueParameters) -> f64 {
    let h = model.lattice().spacing_m;
    let mut worst = 0.0_f64;
    for element in 0..model.element_count() as u32 {
        let x = state.deformed(model).position_m(element);
        let around = model.lattice().neighbours(element);
        for a in 0..3 {
            let Some(neighbour) = around[2 * a + 1] else {
                continue;
            };
            let y = state.deformed(model).position_m(neighbour);
            let d = [0, 1, 2].map(|n| (y[n] - x[n]) / h);
            let angle = [parameters.shear_deg, parameters.shear_vert_deg][usize::from(a > 0)];
            let shear = angle.to_radians().tan() * d[a];
            worst = worst
                .max(parameters.min_stretch - d[a])
                .max(d[a] - parameters.max_stretch);
            for b in (0..3).filter(|&b| b != a) {
                worst = worst.max(d[b].abs() - shear);
            }
        }
    }
    worst
}

/// Returns the smallest volume of a cell's corner, by positions in f64: over each element and each three of its
/// neighbours.
///
/// Panics if one is smaller than limits kept to `residual` allow: at the paper's angles a corner may come to zero
/// with every limit met, and so below it by what the residual leaves.
pub(super) fn smallest_corner(model: &ChainMail, state: &TissueState, residual: f64) -> f64 {
    let lattice = model.lattice();
    let mut smallest = f64::INFINITY;
    for element in 0..model.element_count() as u32 {
        let x = state.deformed(model).position_m(element);
        let around = lattice.neighbours(element);
        for corner in 0..8 {
            let sides = [0, 1, 2].map(|axis| corner >> axis & 1);
            let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|axis| around[2 * axis + sides[axis]]) else {
                continue;
            };
            let mut tangents = [0.0; 3];
            let mut longest = 1.0;
            let links = [(a, 0), (b, 1), (c, 2)].map(|(neighbour, axis): (u32, usize)| {
                let link = model
                    .classes
                    .of_link(lattice.structure(element), lattice.structure(neighbour));
                let l = model.classes.limits(link.map_or(0, |(class, _)| class), axis);
                tangents[axis] = f64::from(l.tan) + residual / (1.0 + f64::from(l.low) - residual);
                longest *= 1.0 + f64::from(l.high) + residual;
                let y = state.deformed(model).position_m(neighbour);
                let sign = if sides[axis] == 1 { 1.0 } else { -1.0 };
                nalgebra::Vector3::from([0, 1, 2].map(|n| sign * (y[n] - x[n]) / lattice.spacing_m))
            });
            let volume = nalgebra::Matrix3::from_columns(&links).determinant();
            let [tx, ty, tz] = tangents;
            let beyond = tx * ty + ty * tz + tz * tx + 2.0 * tx * ty * tz - 1.0;
            assert!(
                volume >= -longest * beyond.max(0.0) - 1e-5,
                "corner {volume}, limits allow {beyond}"
            );
            smallest = smallest.min(volume);
        }
    }
    smallest
}

pub(super) struct Run {
    pub worst_solve: Solve,
    pub most_passes: u32,
    pub solves: [u32; 4],
    pub passes: u32,
    pub smallest_corner: f64,
}

/// Wanders for `ticks` ticks by up to `per_tick` elements, turning back now and then, and checks each step.
pub(super) fn wander(labels: &Labels, parameters: &TissueParameters, per_tick: f64, ticks: u32, seed: u64) -> Run {
    let model = model_with(labels, parameters);
    let mut state = TissueState::at_rest(&model);
    let mut random = Random(seed);
    let count = model.element_count() as f64;
    let mut element = (random.unit() * count) as u32;
    let (mut way, mut direction) = ([0.0; 3], [0.0; 3]);
    let mut run = Run {
        worst_solve: Solve::Nothing,
        most_passes: 0,
        solves: [0; 4],
        passes: 0,
        smallest_corner: f64::INFINITY,
    };
    for tick in 0..ticks {
        if tick % 50 == 0 {
            element = (random.unit() * count) as u32;
            way = state.deformed(&model).displacement(element);
        }
        if tick % 7 == 0 {
            direction = [(); 3].map(|()| random.signed() * per_tick);
        } else if tick % 11 == 0 {
            direction = direction.map(|c| -c);
        }
        way = [0, 1, 2].map(|a| (way[a] + direction[a]).clamp(-40.0, 40.0));
        let held = held_at(&model, element, way);
        let report = step(&model, &mut state, Some(held), 1e-3);
        assert!(report.converged, "tick {tick}: {report:?}");
        assert_eq!(report.held, HeldOutcome::Followed);
        let now = state.deformed(&model).displacement(element);
        assert!((0..3).all(|a| (now[a] - way[a]).abs() < 1e-5), "held element moved");
        let reference = largest_violation(&model, &state);
        let dishonest = "what was looked at is not all that is violated";
        assert!(
            (reference - report.residual).abs() < 2e-5,
            "tick {tick}: {reference}, {report:?}: {dishonest}"
        );
        if tick % 10 == 0 {
            let found = oracle_violation(&model, &state, parameters);
            assert!(found <= 1.001e-3, "tick {tick}: violation {found}, {report:?}");
            assert!((found - report.residual).abs() < 2e-5, "residual is not honest");
            run.smallest_corner = run
                .smallest_corner
                .min(smallest_corner(&model, &state, report.residual));
        }
        run.solves[report.solve as usize] += 1;
        run.passes += report.passes;
        run.worst_solve = run.worst_solve.max(report.solve);
        run.most_passes = run.most_passes.max(report.passes);
    }
    run
}
