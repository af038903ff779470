//! The pelvis under a probe that is pressed 10 mm: against the reference, between the pads, and how long it takes.

use super::reference::{Reference, beside_reference};
use super::{Fixture, displace};
use crate::probe::wall::Wall;
use crate::probe::{PADS_APART_M, ProbeState, step};
use crate::scene::{Labels, Role, Scene, TissueKind};
use nalgebra::Vector3;
use std::sync::OnceLock;
use std::time::Instant;

const PRESSED_M: f64 = 10e-3;
/// The tip is so far beyond the middle of the gland: its base is at 22 mm.
const BEYOND_M: f64 = 35e-3;
/// Largest depth of the wall between its points in the probe: measured, see docs/adr/0021-probe.md.
const DEEPEST_UM: f64 = 400.0;

fn pelvis() -> &'static Fixture {
    static PELVIS: OnceLock<Fixture> = OnceLock::new();
    PELVIS.get_or_init(|| {
        let start = Instant::now();
        let scene = Scene::builtin("pelvis").expect("built in");
        let fixture = Fixture::new(scene.for_lines(TissueKind::ChainMail).expect("has lines"), PADS_APART_M);
        println!(
            "{} elements of {:.2} mm, {} pads, {:?} bytes, worst residual {:.1e}, {:.1?} with the scene",
            fixture.scene.body.element_count(),
            1e3 * fixture.scene.body.spacing_m,
            fixture.probe.wall.pads.len(),
            fixture.probe.bytes(),
            fixture.probe.solved.residual,
            start.elapsed()
        );
        fixture
    })
}

/// `cargo test --profile quick -p stylet-sim --lib probe::tests::pelvis -- --ignored --nocapture`
#[test]
#[ignore = "takes minutes"]
fn the_gland_moves_as_with_the_contact_solved_in_full() {
    let fixture = pelvis();
    let ([_, largest_m, _, worst_m], force_off) = beside_reference(fixture, &fixture.probe.wall, PRESSED_M, BEYOND_M);
    assert!(force_off < 0.05, "{force_off}");
    assert!(worst_m < 0.02 * largest_m, "{worst_m} of {largest_m}");
}

#[test]
#[ignore = "a measurement"]
fn finer_pads() {
    let fixture = pelvis();
    for spacing_m in [7e-3, 3.5e-3] {
        let wall = Wall::of(&fixture.scene, spacing_m).expect("a rectum");
        println!(
            "reference with {} pads {:.1} mm apart:",
            wall.pads.len(),
            1e3 * spacing_m
        );
        beside_reference(fixture, &wall, PRESSED_M, BEYOND_M);
    }
}

/// Returns the depths of the wall, as the full solution of the whole body moves it under the forces of a tick, at each
/// of its faces and between neighbours: that is 1.4 and 0.7 mm apart, where pads are 5.
fn depths_um(fixture: &Fixture, pressed_m: f64) -> Vec<f64> {
    let mut state = ProbeState::new(&fixture.probe);
    fixture.go_in_and_press(&mut state, pressed_m, BEYOND_M);
    let pose = fixture.pose(pressed_m, BEYOND_M);
    let wall = &fixture.probe.wall;
    let mut full = Reference::new(fixture, wall);
    let loads: Vec<[f64; 3]> = state.loads_n().chunks(3).map(|l| [l[0], l[1], l[2]]).collect();
    full.load_pads(&loads);
    let gap_m = |at: Vector3<f64>| fixture.probe.shape.gap_m(&pose, at.into());
    let mut places = Vec::new();
    for point in wall.finely(&fixture.scene) {
        let moved_m = full.sample(&point.weights(&fixture.body).expect("in the body"));
        let at = Vector3::from(point.place_m) + Vector3::from(moved_m);
        if Vector3::from(gap_m(at).1).dot(&Vector3::from(point.outward)) < 0.2 {
            places.push(at);
        }
    }
    let own = places.clone();
    for (n, a) in own.iter().enumerate() {
        let next = own[..n].iter().filter(|b| (a - **b).norm() < 2e-3);
        places.extend(next.map(|b| (a + b) / 2.0));
    }
    if let Some(deepest) = own.iter().min_by(|a, b| gap_m(**a).0.total_cmp(&gap_m(**b).0)) {
        let faced =
            |p: &&crate::probe::Point| Vector3::from(gap_m(p.place_m.into()).1).dot(&Vector3::from(p.outward)) < 0.2;
        let at_points = wall.points.iter().filter(faced).map(|p| {
            let moved_m = full.sample(&p.weights(&fixture.body).expect("in the body"));
            let at = Vector3::from(p.place_m) + Vector3::from(moved_m);
            (-1e6 * gap_m(at).0, at)
        });
        let places: Vec<_> = at_points.collect();
        let nearest = places.iter().map(|(_, at)| (at - deepest).norm()).fold(1.0, f64::min);
        println!(
            "deepest at {:.1?} mm, a point is {:.1} mm off; points in the probe by {:.1} um; tip {:.1?}",
            (deepest * 1e3).as_slice(),
            1e3 * nearest,
            places.iter().map(|p| p.0).fold(-1e9, f64::max),
            pose.tip_m.map(|c| c * 1e3)
        );
    }
    let near = places
        .iter()
        .map(|at| -1e6 * gap_m(*at).0)
        .filter(|depth| *depth > -1e3);
    let mut depths: Vec<f64> = near.collect();
    depths.sort_by(f64::total_cmp);
    let at = |q: f64| depths[((depths.len() - 1) as f64 * q) as usize];
    println!(
        "pressed {:.0} mm, {} places of the wall within 1 mm: in the probe by {:.0} um at most, p99 {:.0}, p95 {:.0}, p50 {:.0}; at points {:.4} um; {} of {} pressed",
        1e3 * pressed_m,
        depths.len(),
        at(1.0),
        at(0.99),
        at(0.95),
        at(0.5),
        1e6 * state.report().open_m,
        state.pressed().filter(|(n, _)| *n > 0.0).count(),
        wall.points.len()
    );
    depths
}

#[test]
#[ignore = "a measurement"]
fn between_the_points() {
    for pressed_m in [4e-3, 8e-3, PRESSED_M, 12e-3] {
        let depths = depths_um(pelvis(), pressed_m);
        assert!(
            depths.last().is_some_and(|deepest| *deepest < DEEPEST_UM),
            "{pressed_m}"
        );
    }
}

/// One press, with columns that are solved for in ever smaller elements and displace those of ChainMail's lines: where
/// the scene's own cells are from a body whose cells are half as large.
#[test]
#[ignore = "half an hour, 8 GB"]
fn halving_the_cells_does_not_change_the_press() {
    let scene = Scene::builtin("pelvis").expect("built in");
    let bodies = [
        scene.clone().for_lines(TissueKind::ChainMail).expect("has lines"),
        scene.clone().for_lines(TissueKind::Fem).expect("has lines"),
        scene.clone().with_body(usize::MAX),
        halved(&scene).with_body(usize::MAX),
    ];
    let mut pressed: Vec<_> = bodies.iter().map(|body| pressed_in(body, Some(PADS_APART_M))).collect();
    let converged = pressed.pop().expect("four");
    let off: Vec<_> = pressed.iter().map(|of| off_by(of, &converged)).collect();
    let [gland, force] = off[2];
    assert!(gland < 0.02 && force < 0.05, "{gland} {force}");
}

/// Measures the error of pads in the scene's own cells, against forces on the points themselves, which `rt-core probe`
/// solves for.
#[test]
#[ignore = "a measurement, twelve minutes"]
fn what_pads_leave_out() {
    let cells = Scene::builtin("pelvis").expect("built in").with_body(usize::MAX);
    let points = pressed_in(&cells, None);
    off_by(&pressed_in(&cells, Some(PADS_APART_M)), &points);
    for tissue in [TissueKind::ChainMail, TissueKind::Fem] {
        let body = Scene::builtin("pelvis").expect("built in").for_lines(tissue);
        off_by(&pressed_in(&body.expect("has lines"), Some(PADS_APART_M)), &points);
    }
}

/// Splits each cell into eight.
fn halved(scene: &Scene) -> Scene {
    let dims = scene.lattice.dims.map(|n| 2 * n);
    let label = |n: usize| {
        let [i, j, k] = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]].map(|c| c / 2);
        let element = scene.lattice.element_of_cell(i, j, k);
        element.map_or(0, |e| scene.structures[usize::from(scene.lattice.structure(e))].label)
    };
    let labels = Labels {
        dims,
        spacing_m: scene.lattice.spacing_m / 2.0,
        cells: (0..dims.iter().product()).map(label).collect(),
        structures: scene.structures.clone(),
    };
    Scene::from_labels("halved", &labels).expect("valid")
}

/// Force on the hand, and how the elements of the gland move, m.
type Press = (Vector3<f64>, Vec<Vector3<f64>>);

/// Presses with columns of that body, in the elements of ChainMail's lines; loads points where no pads are asked for.
fn pressed_in(body: &Scene, pads_apart_m: Option<f64>) -> Press {
    let begun = Instant::now();
    let scene = Scene::builtin("pelvis").expect("built in");
    let scene = scene.for_lines(TissueKind::ChainMail).expect("has lines");
    let wall = Wall::of(&scene, pads_apart_m.unwrap_or(PADS_APART_M)).expect("a rectum");
    let wall = if pads_apart_m.is_some() {
        wall
    } else {
        wall.loaded_at_points()
    };
    let fixture = Fixture::solved_for(body, scene, wall);
    let mut state = ProbeState::new(&fixture.probe);
    let response = fixture.go_in_and_press(&mut state, PRESSED_M, BEYOND_M);
    displace(&fixture.probe, &mut state);
    let body = &fixture.scene.body;
    let is_gland = |e: &usize| {
        let structure = &fixture.scene.structures[usize::from(body.structure(*e as u32))];
        structure.role == Role::Target
    };
    let moved = |e| Vector3::from_fn(|c, _| f64::from(state.share.0[c][e]));
    let gland: Vec<_> = (0..body.element_count()).filter(is_gland).map(moved).collect();
    println!(
        "elements of {:.2} mm, {} loads, {:.0?}: force {:.3?} N, torque {:.3?} N m, {} points; gland {:.3?} mm on average; stiffness up {:.0} N/m; {:?}",
        1e3 * fixture.probe.solved.edge_m,
        fixture.probe.wall.loads(),
        begun.elapsed(),
        response.wrench.force_n(),
        response.wrench.torque_nm(),
        response.contacts,
        (1e3 * gland.iter().sum::<Vector3<f64>>() / gland.len() as f64).as_slice(),
        response.stiffness[1][1],
        state.report()
    );
    (Vector3::from(response.wrench.force_n()), gland)
}

/// Returns the error of the worst element of the gland, over the largest displacement; and that of the force.
fn off_by((force_n, gland): &Press, (wanted_n, wanted): &Press) -> [f64; 2] {
    let rms = |of: &[Vector3<f64>]| (of.iter().map(Vector3::norm_squared).sum::<f64>() / of.len() as f64).sqrt();
    let most = |of: &[Vector3<f64>]| of.iter().map(Vector3::norm).fold(0.0, f64::max);
    let off: Vec<_> = gland.iter().zip(wanted).map(|(a, b)| a - b).collect();
    let force = (force_n - wanted_n).norm() / wanted_n.norm();
    println!(
        "gland off by {:.3} mm rms of {:.3} and {:.3} at most of {:.3}; force by {:.1} %",
        1e3 * rms(&off),
        1e3 * rms(wanted),
        1e3 * most(&off),
        1e3 * most(wanted),
        100.0 * force
    );
    [most(&off) / most(wanted), force]
}

#[test]
#[ignore = "a measurement"]
fn times_of_ticks() {
    let fixture = pelvis();
    let mut best = vec![[f64::INFINITY; 2]; 240];
    let mut passes = 0;
    for _ in 0..6 {
        let mut state = ProbeState::new(&fixture.probe);
        fixture.go_in_and_press(&mut state, 0.0, BEYOND_M);
        for (n, slot) in best.iter_mut().enumerate() {
            let pressed_m = PRESSED_M * (n.min(240 - n) as f64 / 120.0);
            // Jumps of 5 mm among them.
            let jump_m = if n % 40 == 20 { 5e-3 } else { 0.0 };
            let pose = fixture.pose(pressed_m - jump_m, BEYOND_M);
            let begun = Instant::now();
            step(&fixture.probe, &mut state, &pose, &[]);
            let stepped = begun.elapsed();
            displace(&fixture.probe, &mut state);
            let all = begun.elapsed();
            passes = passes.max(state.report().passes);
            for (least, time) in slot.iter_mut().zip([stepped, all]) {
                *least = least.min(1e6 * time.as_secs_f64());
            }
        }
    }
    for (which, name) in ["contact", "contact and body"].into_iter().enumerate() {
        let mut micros: Vec<f64> = best.iter().map(|b| b[which]).collect();
        micros.sort_by(f64::total_cmp);
        println!(
            "{name}: p50 {:.0}, p99 {:.0}, max {:.0} us; {passes} passes at most",
            micros[120], micros[237], micros[239]
        );
    }
}
