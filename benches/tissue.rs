//! Tissue step: time of each solver as a ratio within one run, with the constraint violation it leaves beside it.
//!
//! `cargo bench -p stylet-benches`. Rounds are interleaved, so that a noisy machine disturbs all rows alike.

use rt_core::scene::Scene;
use rt_core::tissue::chainmail::queue::QueuePass;
use rt_core::tissue::{ChainMail, Held, TissueParameters, TissueState, largest_violation, step};
use std::time::Instant;

const ROUNDS: usize = 200;

/// Microseconds of every round, and the worst violation left.
struct Row {
    name: &'static str,
    micros: Vec<f64>,
    violation: f64,
}

impl Row {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            micros: Vec::with_capacity(ROUNDS),
            violation: 0.0,
        }
    }

    fn add(&mut self, start: Instant, model: &ChainMail, state: &TissueState) {
        self.micros.push(start.elapsed().as_secs_f64() * 1e6);
        self.violation = self.violation.max(largest_violation(model, state));
    }

    fn quantile(&mut self, q: f64) -> f64 {
        self.micros.sort_by(f64::total_cmp);
        self.micros[((self.micros.len() - 1) as f64 * q).round() as usize]
    }
}

fn main() {
    let scene = Scene::builtin("paper").expect("the built-in scene is valid");
    let limits = TissueParameters::default().validate().expect("the defaults are valid");
    let model = ChainMail::new(&scene, limits);
    let h = scene.lattice.spacing_m;
    let (lower, upper) = scene.lattice.bounds_m();
    let middle = [0, 1, 2].map(|a| ((lower[a] + upper[a]) / 2.0 / h) as usize);
    let element = scene
        .lattice
        .element_of_cell(middle[0], middle[1], middle[2])
        .expect("the gland is convex");
    let rest = scene.lattice.rest_m(element);
    // Far enough that every element moves.
    let far = Held {
        element,
        position_m: [rest[0] + 30.0 * h, rest[1] - 20.0 * h, rest[2] + 50.0 * h],
        patch_m: 0.0,
    };

    let mut queue = QueuePass::new(&model);
    let mut rows = [
        Row::new("queue, one pass, everything moved"),
        Row::new("step to the residual, everything moved"),
        Row::new("step to the residual, 50 mm/s insertion"),
    ];
    let mut inserted = TissueState::at_rest(&model);
    let tip_rest = scene.lattice.rest_m(0);
    for round in 0..ROUNDS {
        let mut state = TissueState::at_rest(&model);
        let start = Instant::now();
        queue.run(&model, &mut state, far);
        rows[0].add(start, &model, &state);

        let mut state = TissueState::at_rest(&model);
        let start = Instant::now();
        std::hint::black_box(step(&model, &mut state, Some(far), 5e-3));
        rows[1].add(start, &model, &state);

        // 0.25 mm a tick, in and out over 10 mm.
        let depth = 2.5e-4 * (40 - (round as i64 % 80 - 40).abs()) as f64;
        let held = Held {
            element: 0,
            position_m: [tip_rest[0], tip_rest[1], tip_rest[2] + depth],
            patch_m: 0.0,
        };
        let start = Instant::now();
        std::hint::black_box(step(&model, &mut inserted, Some(held), 5e-3));
        rows[2].add(start, &model, &inserted);
    }

    println!(
        "{} elements, {ROUNDS} interleaved rounds; violation in elements",
        scene.lattice.element_count()
    );
    println!(
        "{:<42} {:>9} {:>9} {:>9} {:>8} {:>11}",
        "", "p50 us", "p99 us", "max us", "ratio", "violation"
    );
    let base = rows[0].quantile(0.5);
    for row in &mut rows {
        let p50 = row.quantile(0.5);
        let (p99, max, ratio) = (row.quantile(0.99), row.quantile(1.0), base / p50);
        println!(
            "{:<42} {p50:>9.1} {p99:>9.1} {max:>9.1} {ratio:>8.2} {:>11.2e}",
            row.name, row.violation
        );
    }
    assert!(
        rows[1].violation <= 1e-3 && rows[2].violation <= 1e-3,
        "a step left its limits"
    );
}
