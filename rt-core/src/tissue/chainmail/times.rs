//! Prints how long steps take; run with `--ignored --nocapture --test-threads=1`. Asserts no time.

use std::time::Instant;

use super::*;
use crate::scene::Scene;
use crate::tissue::{Held, MaterialPoint, TissueParameters};

#[test]
#[ignore = "prints times"]
fn print_times() {
    let scene = Scene::builtin("paper").expect("built in");
    let limits = TissueParameters::default().validate().expect("valid");
    let model = ChainMail::new(&scene, limits);
    let element = scene.lattice.element_of_cell(53, 31, 80).expect("inside");
    let rest = scene.lattice.rest_m(element);
    let runs = [
        ("50 mm/s, there and back", 0.05),
        ("300 mm/s, there and back", 0.3),
        ("3 elements a tick, there and back", 4.1),
    ];
    for (name, speed_m_per_s) in runs {
        let way = |tick: u32| {
            let way = (f64::from(tick) * speed_m_per_s * 1e-3) % 0.04;
            if way < 0.02 { way } else { 0.04 - way }
        };
        print_run(name, &model, 1000, &mut |tick, _| {
            let way = way(tick);
            let position_m = [rest[0] + 0.2 * way, rest[1], rest[2] + way];
            Held {
                element,
                position_m,
                patch_m: 0.0,
            }
        });
    }
    let mut random = crate::scene::test_bodies::Random(1);
    let (mut held_now, mut way_m, mut direction) = (element, [0.0; 3], [0.0; 3]);
    print_run(
        "wandering by up to an element a tick",
        &model,
        1000,
        &mut |tick, state| {
            if tick % 50 == 0 {
                held_now = (random.unit() * model.element_count() as f64) as u32;
                let (at, rest) = (state.position_m(&model, held_now), scene.lattice.rest_m(held_now));
                way_m = [0, 1, 2].map(|a| at[a] - rest[a]);
            }
            if tick % 7 == 0 {
                direction = [(); 3].map(|()| random.signed() * scene.lattice.spacing_m);
            }
            way_m = [0, 1, 2].map(|a| (way_m[a] + direction[a]).clamp(-0.02, 0.02));
            let rest = scene.lattice.rest_m(held_now);
            let position_m = [0, 1, 2].map(|a| rest[a] + way_m[a]);
            Held {
                element: held_now,
                position_m,
                patch_m: 0.0,
            }
        },
    );
    // Like a needle: hold for 4 mm, let go, hold the element that is then at the tip; 40 mm in and out.
    let mut at_tip = MaterialPoint {
        element,
        local: [0.0; 3],
    };
    let mut grip_m = [0.0; 3];
    print_run("needle at 50 mm/s", &model, 1600, &mut |tick, state| {
        let way = 0.05e-3 * f64::from(tick);
        let way = if way < 0.04 { way } else { 0.08 - way };
        let tip = [rest[0], rest[1], rest[2] - 0.01 + way];
        if tick % 80 == 1 {
            at_tip = MaterialPoint::locate(&state.deformed(&model), tip, Some(at_tip.element)).unwrap_or(at_tip);
            let held = state.position_m(&model, at_tip.element);
            grip_m = [0, 1, 2].map(|a| held[a] - tip[a]);
        }
        let position_m = [0, 1, 2].map(|a| tip[a] + grip_m[a]);
        Held {
            element: at_tip.element,
            position_m,
            patch_m: 0.0,
        }
    });
}

fn print_run(name: &str, model: &ChainMail, ticks: u32, held: &mut dyn FnMut(u32, &TissueState) -> Held) {
    let mut state = TissueState::at_rest(model);
    let mut times = Vec::new();
    let (mut passes, mut residual, mut moved, mut solves) = (0, 0.0_f64, 0, [0; 4]);
    for tick in 1..=ticks {
        let held = held(tick, &state);
        let start = Instant::now();
        let report = step(model, &mut state, Some(held), 1e-3);
        times.push(start.elapsed().as_secs_f64() * 1e6);
        passes = passes.max(report.passes);
        residual = residual.max(report.residual);
        moved = moved.max(report.moved);
        solves[report.solve as usize] += 1;
    }
    times.sort_by(f64::total_cmp);
    let [p50, p99, max] = [0.5, 0.99, 1.0].map(|p| times[((ticks - 1) as f64 * p) as usize]);
    println!(
        "{name}: p50 {p50:.0} us, p99 {p99:.0} us, max {max:.0} us; at most {passes} passes, \
         residual {residual:.1e}, {moved} moved; solved by {solves:?}"
    );
}

#[test]
#[ignore = "prints times"]
fn print_parts() {
    let scene = Scene::builtin("paper").expect("built in");
    let limits = TissueParameters::default().validate().expect("valid");
    let model = ChainMail::new(&scene, limits);
    let mut state = TissueState::at_rest(&model);
    let cell = [53, 31, 80];
    let us = |name: &str, work: &mut dyn FnMut()| {
        let mut times: Vec<f64> = (0..200)
            .map(|_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e6
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("{name}: p50 {:.1} us", times[100]);
    };
    us("check", &mut || {
        std::hint::black_box(crate::tissue::largest_violation(&model, &state));
    });
    us("outward, nothing to move", &mut || {
        sweep::outward(&model, cell, &mut state.u)
    });
    us("single, nothing to move", &mut || {
        sweep::single_pass(&model, cell, &mut state.u)
    });
    let held = scene.lattice.element_of_cell(53, 31, 80).expect("inside") as usize;
    us("outward, all moved", &mut || {
        for c in &mut state.u {
            c.fill(0.0);
        }
        state.put(held, [20.0, -20.0, 30.0]);
        sweep::outward(&model, cell, &mut state.u);
    });
    us("single, all moved", &mut || {
        for c in &mut state.u {
            c.fill(0.0);
        }
        state.put(held, [20.0, -20.0, 30.0]);
        sweep::single_pass(&model, cell, &mut state.u);
    });
    println!(
        "spans {} {} runs {}",
        model.y_links.all().len(),
        model.z_links.all().len(),
        model.runs.len()
    );
    us("project", &mut || project::project_all(&model, true, &mut state.u));
    us("nothing", &mut || {
        step(&model, &mut state, None, 0.0);
    });
    let mut queue = queue::QueuePass::new(&model);
    let rest = scene.lattice.rest_m(held as u32);
    us("queue, all moved", &mut || {
        for c in &mut state.u {
            c.fill(0.0);
        }
        let h = scene.lattice.spacing_m;
        let position_m = [rest[0] + 20.0 * h, rest[1] - 20.0 * h, rest[2] + 30.0 * h];
        queue.run(
            &model,
            &mut state,
            Held {
                element: held as u32,
                position_m,
                patch_m: 0.0,
            },
        );
    });
}
