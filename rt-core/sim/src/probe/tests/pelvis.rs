//! The pelvis under a probe that is pressed 10 mm: beside the reference, between the pads, and how long it takes.

use super::Fixture;
use super::reference::{Reference, beside_reference};
use crate::probe::wall::Wall;
use crate::probe::{PADS_APART_M, ProbeState, displace, step};
use crate::scene::{Scene, TissueKind};
use nalgebra::Vector3;
use std::sync::OnceLock;
use std::time::Instant;

const PRESSED_M: f64 = 10e-3;
/// The tip is so far beyond the middle of the gland: its base is at 22 mm.
const BEYOND_M: f64 = 35e-3;

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
            fixture.probe.residual,
            start.elapsed()
        );
        fixture
    })
}

/// `cargo test --release -p stylet-sim --lib probe::tests::pelvis -- --ignored --nocapture`
#[test]
#[ignore = "half a minute"]
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

#[test]
#[ignore = "a measurement"]
fn between_the_pads() {
    let fixture = pelvis();
    let mut state = ProbeState::new(&fixture.probe);
    fixture.go_in_and_press(&mut state, PRESSED_M, BEYOND_M);
    let pose = fixture.pose(PRESSED_M, BEYOND_M);
    let mut full = Reference::new(fixture, &fixture.probe.wall);
    let loads: Vec<[f64; 3]> = state.loads_n().chunks(3).map(|l| [l[0], l[1], l[2]]).collect();
    full.load(&loads);
    let mut depths_um = Vec::new();
    for (n, pad) in fixture.probe.wall.pads.iter().enumerate() {
        if loads[n] == [0.0; 3] {
            continue;
        }
        for face in &pad.faces {
            let nodes = fixture.body.trilinear(face.inside_m).expect("in the body");
            let moved_m = full.sample(&nodes);
            let at = [0, 1, 2].map(|c| face.place_m[c] + moved_m[c]);
            depths_um.push(-1e6 * fixture.probe.shape.gap_m(&pose, at).0);
        }
    }
    depths_um.sort_by(f64::total_cmp);
    let at = |q: f64| depths_um[((depths_um.len() - 1) as f64 * q) as usize];
    println!(
        "{} faces of pressed pads: in the probe by {:.0} um at most, p95 {:.0}, p50 {:.0}, least {:.0}; at pads {:.4} um",
        depths_um.len(),
        at(1.0),
        at(0.95),
        at(0.5),
        at(0.0),
        1e6 * state.report().open_m
    );
}

#[test]
#[ignore = "a measurement"]
fn pressed_step_by_step() {
    println!("elements of ChainMail's lines:");
    pressed_in(pelvis());
    println!("elements half as large, of finite elements:");
    let scene = Scene::builtin("pelvis").expect("built in").for_lines(TissueKind::Fem);
    pressed_in(&Fixture::new(scene.expect("has lines"), PADS_APART_M));
}

fn pressed_in(fixture: &Fixture) {
    let mut state = ProbeState::new(&fixture.probe);
    for pressed_mm in [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0] {
        let response = fixture.go_in_and_press(&mut state, pressed_mm * 1e-3, BEYOND_M);
        displace(&fixture.probe, &mut state);
        let body = &fixture.scene.body;
        let of = |name: &str| {
            let (mut sum, mut count, mut largest) = (Vector3::zeros(), 0.0, 0.0_f64);
            for e in 0..body.element_count() {
                if fixture.scene.structures[body.structure(e as u32) as usize].name == name {
                    let moved = Vector3::from_fn(|c, _| f64::from(state.share.0[c][e]));
                    sum += moved;
                    count += 1.0;
                    largest = largest.max(moved.norm());
                }
            }
            (sum * 1e3 / count, largest * 1e3)
        };
        let ((gland, gland_most), (wall, wall_most)) = (of("gland"), of("rectal wall"));
        println!(
            "{pressed_mm} mm: force {:.2?} N, torque {:.3?} N m, {} pads; gland {:.2?} mm, {gland_most:.2} at most; wall {:.2?}, {wall_most:.2}; stiffness up {:.0} N/m; {:?}",
            response.wrench.force_n(),
            response.wrench.torque_nm(),
            response.contacts,
            gland.as_slice(),
            wall.as_slice(),
            response.stiffness[1][1],
            state.report()
        );
        state.reset();
    }
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
