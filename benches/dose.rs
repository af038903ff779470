//! Dose of a whole implant: time as a ratio to the straightforward loop in the same run, and the error
//! against it.
//!
//! `cargo bench -p stylet-benches --bench dose`. Rounds are interleaved, so that a noisy machine disturbs all rows
//! alike.

use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;
use stylet_benches::error::quantile;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseGrid, DoseKernel, Dvh, Metric, Region, Seed, Source, Structure};

const ROUNDS: usize = 30;
/// Gland and margin.
const SIDES_M: [f64; 3] = [0.07, 0.06, 0.07];
const SPACING_M: f64 = 1e-3;
const PRESCRIPTION_GY: f64 = 145.0;

struct Ellipsoid {
    middle_m: [f64; 3],
    half_m: [f64; 3],
}

impl Region for Ellipsoid {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        (
            [0, 1, 2].map(|a| self.middle_m[a] - self.half_m[a]),
            [0, 1, 2].map(|a| self.middle_m[a] + self.half_m[a]),
        )
    }

    fn contains(&self, p: [f64; 3]) -> bool {
        (0..3)
            .map(|a| ((p[a] - self.middle_m[a]) / self.half_m[a]).powi(2))
            .sum::<f64>()
            <= 1.0
    }
}

/// Milliseconds of every round.
struct Row {
    name: &'static str,
    millis: Vec<f64>,
}

impl Row {
    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let made = black_box(work());
        self.millis.push(start.elapsed().as_secs_f64() * 1e3);
        made
    }
}

fn seeds(count: usize) -> Vec<Seed> {
    (0..count)
        .map(|i| {
            let t = i as f64;
            let share = [(1.7 * t).sin(), (2.3 * t + 1.0).sin(), (0.9 * t + 2.0).sin()];
            let tilt = 0.2 * (1.1 * t).sin();
            Seed {
                position_m: [0, 1, 2].map(|a| SIDES_M[a] / 2.0 + 0.018 * share[a]),
                axis: Some([tilt.sin(), 0.0, tilt.cos()]),
                strength_u: 0.5,
            }
        })
        .collect()
}

fn grid(high_m: [f64; 3]) -> DoseGrid {
    DoseGrid::covering([0.0; 3], high_m, SPACING_M).expect("a grid of a gland is not too large")
}

/// Returns the formulae for each voxel and each seed, on all cores.
fn straightforward(kernel: &DoseKernel, grid: &DoseGrid, seeds: &[Seed]) -> Vec<f64> {
    let [nx, ny, nz] = grid.dims();
    let dose = |i: usize| {
        let at = grid.centre_m([i % nx, i / nx % ny, i / nx / ny]);
        seeds.iter().map(|s| kernel.exact_at_gy(s, at)).sum()
    };
    (0..nx * ny * nz).into_par_iter().map(dose).collect()
}

fn structures() -> Vec<Structure> {
    let middle_m = SIDES_M.map(|s| s / 2.0);
    let body = |name: &str, off: f64, half_m: [f64; 3], pitch_m: f64| {
        let middle_m = [middle_m[0], middle_m[1] + off, middle_m[2]];
        Structure::of_region(name, &Ellipsoid { middle_m, half_m }, pitch_m)
    };
    vec![
        body("Prostate", 0.0, [0.024, 0.019, 0.022], SPACING_M),
        body("Urethra", 0.004, [0.003, 0.003, 0.022], 0.5e-3),
        body("Rectum", -0.027, [0.012, 0.006, 0.03], SPACING_M),
    ]
}

fn metrics(grid: &DoseGrid, structures: &[Structure]) -> Vec<f64> {
    let names = ["D90", "V100", "V150", "V200", "D10", "D30", "D2cc", "D0.1cc"];
    let metrics = names.map(|n| Metric::parse(n).expect("a metric"));
    let mut all = Vec::new();
    for s in structures {
        let dose: Vec<f64> = s.points_m.par_iter().map(|&p| grid.at_gy(p)).collect();
        let dvh = Dvh::new(&dose, &s.volumes_m3).expect("there are points");
        all.extend(metrics.iter().filter_map(|m| m.of(&dvh, PRESCRIPTION_GY).main()));
    }
    all
}

fn main() {
    let source = Source::known("6711").expect("it comes with the program");
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let hundred = seeds(100);
    let bodies = structures();
    let mut rows = [
        "straightforward loop, 5 seeds (shown for 100)",
        "table, kernel, 100 seeds, histograms, metrics",
        "table alone",
        "100 seeds on the grid",
        "200 seeds on the grid",
        "100 seeds, twice the voxels",
        "histograms and metrics of three structures",
        "one more seed",
    ]
    .map(|name| Row {
        name,
        millis: Vec::with_capacity(ROUNDS),
    });
    let mut full = grid(SIDES_M);
    full.add(&kernel, &hundred);
    for _ in 0..ROUNDS {
        let empty = grid(SIDES_M);
        rows[0].time(|| straightforward(&kernel, &empty, &hundred[..5]));
        rows[1].time(|| {
            let kernel = DoseKernel::new(&source, Interval::ALL);
            let mut grid = grid(SIDES_M);
            grid.add(&kernel, &hundred);
            metrics(&grid, &bodies)
        });
        rows[2].time(|| DoseKernel::new(&source, Interval::ALL));
        let mut g = empty.clone();
        rows[3].time(|| g.add(&kernel, &hundred));
        let two_hundred = seeds(200);
        let mut g = empty;
        rows[4].time(|| g.add(&kernel, &two_hundred));
        let mut g = grid([SIDES_M[0], SIDES_M[1], 2.0 * SIDES_M[2] + SPACING_M]);
        rows[5].time(|| g.add(&kernel, &hundred));
        rows[6].time(|| metrics(&full, &bodies));
        rows[7].time(|| full.add(&kernel, &hundred[..1]));
        full.remove(&kernel, &hundred[..1]);
    }
    for ms in &mut rows[0].millis {
        *ms *= 20.0;
    }
    let exact = straightforward(&kernel, &full, &hundred);
    let errors = full.dose_gy().iter().zip(&exact).map(|(a, b)| (a / b - 1.0).abs());
    let (mut worst, mut sum) = (0.0_f64, 0.0);
    for e in errors {
        worst = worst.max(e);
        sum += e;
    }
    let [nx, ny, nz] = full.dims();
    println!(
        "{nx} x {ny} x {nz} voxels of 1 mm, {} threads, {ROUNDS} interleaved rounds; {} points in three structures",
        rayon::current_num_threads(),
        bodies.iter().map(|s| s.points_m.len()).sum::<usize>()
    );
    println!(
        "{:<50} {:>9} {:>9} {:>9} {:>8}",
        "", "min ms", "p50 ms", "max ms", "ratio"
    );
    let base = quantile(&rows[0].millis, 0.5);
    for row in &mut rows {
        let [min, p50, max] = [0.0, 0.5, 1.0].map(|q| quantile(&row.millis, q));
        println!("{:<50} {min:>9.2} {p50:>9.2} {max:>9.2} {:>8.1}", row.name, base / p50);
    }
    println!(
        "error against the loop: worst {worst:.1e}, mean {:.1e}",
        sum / exact.len() as f64
    );
    assert!(worst < 5e-4, "the table is not what the formulae give");
}
