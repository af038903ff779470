//! Prints how long steps take; run with `--ignored --nocapture --test-threads=1`. Asserts no time.

use std::time::Instant;

use super::*;
use crate::scene::Scene;
use crate::tissue::{Held, TissueParameters};

#[test]
#[ignore = "prints times"]
fn print_times() {
    let scene = Scene::builtin("paper").expect("built in");
    let limits = TissueParameters::default().validate().expect("valid");
    let model = ChainMail::new(&scene, limits);
    let element = scene.lattice.element_of_cell(53, 31, 80).expect("inside");
    let rest = scene.lattice.rest_m(element);
    for (name, speed, tau_ticks) in [
        ("50 mm/s", 0.05, 1),
        ("300 mm/s", 0.3, 1),
        ("x3 cells", 4.1, 1),
    ] {
        let mut state = TissueState::at_rest(&model);
        let mut times = Vec::new();
        let (mut passes, mut residual, mut moved, mut worst) = (0, 0.0_f64, 0, Solve::Nothing);
        for tick in 1..=400 {
            let way = speed * 1e-3 * f64::from(tick * tau_ticks);
            let way = if way < 0.02 { way } else { 0.04 - way };
            let held = Held {
                element,
                position_m: [rest[0] + 0.2 * way, rest[1], rest[2] + way],
            };
            let start = Instant::now();
            let report = step(&model, &mut state, Some(held), 1e-3);
            times.push(start.elapsed().as_secs_f64() * 1e6);
            passes = passes.max(report.passes);
            residual = residual.max(report.residual);
            moved = moved.max(report.moved);
            worst = worst.max(report.solve);
        }
        times.sort_by(f64::total_cmp);
        println!(
            "{name}: p50 {:.0} us, p99 {:.0}, max {:.0}; passes {passes}, residual {residual:.1e}, moved {moved}, {worst:?}",
            times[200], times[396], times[399]
        );
    }
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
    us("project", &mut || {
        project::project_all(&model, true, &mut state.u)
    });
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
            },
        );
    });
}
