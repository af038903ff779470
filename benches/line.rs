//! A tick of a needle's line: by sets against sweeps alone.
//!
//! `cargo bench -p stylet-benches --bench line`.

use std::time::Instant;

use stylet_benches::error::quantile;
use stylet_random::Random;
use stylet_sim::line::{
    ColumnQueue, Compliance, Line, LineInput, LineLayer, LineModel, LineOutput, LineSettings, LineState, MAX_STATIONS,
    StationSettings, Stations, TOLERANCE, step,
};
use stylet_sim::scene::Scene;
use stylet_sim::tissue::fem::batch::BatchModel;
use stylet_sim::tissue::fem::{FemModel, FemSettings, Integration, Material};

/// Gland as patients have it, nearly incompressible; a centimetre of fat around it.
const GLAND: Material = Material {
    youngs_modulus_pa: 17e3,
    poisson_ratio: 0.49,
    integration: Integration::MeanDilatation,
};
const FOUNDATION_PA_PER_M: f64 = 250e3;

fn main() {
    ticks("40 stations, made up", &made_up(40));
    let (model, stations) = paper();
    ticks("paper", &solved(&model, &stations));
}

/// Makes a line through the middle of the gland, from the apex in.
fn paper() -> (BatchModel<f32>, Stations) {
    let lattice = Scene::builtin("paper").expect("built in").lattice;
    let fem = FemModel::<f32>::new(&lattice, &FemSettings::homogeneous(GLAND, FOUNDATION_PA_PER_M)).expect("valid");
    let model = BatchModel::new(&fem);
    let (low, high) = lattice.bounds_m();
    let start = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2] - 10e-3];
    let line = Line::into_body(&lattice, start, [0.0, 0.0, 1.0]).expect("meets the gland");
    let stations = Stations::along(
        &model,
        line,
        StationSettings::of_lattice(lattice.spacing_m),
        MAX_STATIONS,
    );
    (model, stations)
}

fn solved(model: &BatchModel<f32>, stations: &Stations) -> Compliance {
    let mut queue = ColumnQueue::new(model, stations, false, TOLERANCE);
    queue.prepare(model, usize::MAX);
    Compliance::of_columns(model, stations, queue.columns()).expect("all columns")
}

/// Returns a gland that moves as a whole and near the load.
fn made_up(stations: usize) -> Compliance {
    let spacing_m = 1e-3;
    Compliance::from_rows(stations, spacing_m, 4e-3, |i, j| {
        let distance_m = (i % stations).abs_diff(j % stations) as f64 * spacing_m;
        let own = if i == j && i < stations {
            0.014 * 1.364e-3 / spacing_m
        } else {
            0.0
        };
        1.0 / 1434.0 + (-distance_m / 5e-3).exp() / 270.0 + own
    })
}

/// 20 s of a hand that goes in, back and on, at up to 200 mm/s.
fn way(length_m: f64) -> Vec<f64> {
    let mut random = Random(3);
    let (mut tip_m, mut to_m, mut speed) = (0.0, 0.0, 1e-4);
    let mut places = Vec::new();
    for _ in 0..20_000 {
        if tip_m == to_m {
            to_m = 1.15 * length_m * random.unit();
            speed = 2e-4 * random.unit() + 1e-6;
        }
        tip_m += f64::clamp(to_m - tip_m, -speed, speed);
        places.push(tip_m);
    }
    places
}

struct Ticks {
    us: Vec<f64>,
    least: Vec<f64>,
    outputs: Vec<LineOutput>,
}

/// Measures ticks by sets alternating with the same by sweeps; the answers of both must agree.
fn ticks(name: &str, compliance: &Compliance) {
    let layer = LineLayer {
        puncture_force_n: 5.6,
        puncture_depth_m: 8e-3,
        cutting_force_n: 1.5,
        shaft_friction_n_per_m: 80.0,
        ..LineLayer::default()
    };
    let models = [true, false].map(|by_sets| {
        let settings = LineSettings {
            by_sets,
            ..LineSettings::default()
        };
        LineModel::new(compliance.clone(), &[layer], settings).expect("valid")
    });
    let places = way(models[0].length_m());
    let mut runs = models.each_ref().map(|_| Ticks {
        us: Vec::new(),
        least: vec![f64::INFINITY; places.len()],
        outputs: Vec::new(),
    });
    for round in 0..8 {
        let mut states = models.each_ref().map(LineState::new);
        for (n, &tip_m) in places.iter().enumerate() {
            for which in 0..2 {
                let start = Instant::now();
                let output = step(&models[which], &mut states[which], &LineInput { tip_m, dt_s: 1e-3 });
                let us = start.elapsed().as_secs_f64() * 1e6;
                let run = &mut runs[which];
                run.us.push(us);
                run.least[n] = run.least[n].min(us);
                if round == 0 {
                    run.outputs.push(output);
                }
            }
        }
    }
    println!("{name}: {} stations, {} ticks", compliance.stations, places.len());
    println!(
        "            |  p50 us    p99  p99.9    max | fastest of 8: p50 p99 p99.9 max | products or sweeps: p50 p99 max"
    );
    for (name, run) in ["sets", "sweeps"].iter().zip(&runs) {
        let [all, least] = [&run.us, &run.least].map(|us| quantiles(us));
        let work: Vec<f64> = run.outputs.iter().map(|o| f64::from(o.sweeps)).collect();
        let work = quantiles(&work);
        println!(
            "  {name:9} | {:7.2} {:6.2} {:6.2} {:6.2} | {:6.2} {:6.2} {:6.2} {:6.2} | {} {} {}",
            all[0], all[1], all[2], all[3], least[0], least[1], least[2], least[3], work[0], work[1], work[3]
        );
    }
    let pairs = || runs[0].outputs.iter().zip(&runs[1].outputs);
    let force_n = pairs().map(|(a, b)| (a.force_on_hand_n - b.force_on_hand_n).abs());
    let place_m = pairs().map(|(a, b)| (a.tip_material_m - b.tip_material_m).abs());
    let (force_n, place_m) = (force_n.fold(0.0, f64::max), place_m.fold(0.0, f64::max));
    println!("  between them: force {force_n:.1e} N, place of the tip {place_m:.1e} m");
    assert!(force_n < 1e-3 && place_m < 2e-6, "a wrong answer has no time");
}

/// Returns p50, p99, p99.9 and the largest.
fn quantiles(values: &[f64]) -> [f64; 4] {
    [0.5, 0.99, 0.999, 1.0].map(|q| quantile(values, q))
}
