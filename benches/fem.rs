//! A 200 Hz insertion into the paper's gland with FEM: time per tick beside the error against the converged solution, with and
//! without work ahead.

use std::sync::Arc;
use std::time::Instant;

use stylet_benches::patch::{FOUNDATION_PA_PER_M, PERIOD_S, PatchTick, STRAIGHT, Way, converged, insertion};
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::{Lattice, Scene};
use stylet_sim::tissue::fem::{self, FemModel, FemSettings, FemState, Integration, Material, SolveSettings};
use stylet_sim::tissue::{ChainMail, Held, TissueState};

/// What counts as solved.
const EXACT: SolveSettings = SolveSettings {
    relative_tolerance: 1e-8,
    max_cycles: 400,
};

/// Root of the mean square of the elements' errors, in elements.
fn rms<'a>(here: impl Fn(usize) -> &'a [f32], there: &[Vec<f32>; 3]) -> f64 {
    let squares = (0..3).flat_map(|a| here(a).iter().zip(&there[a]).map(|(h, t)| f64::from(h - t).powi(2)));
    (squares.sum::<f64>() / there[0].len() as f64).sqrt()
}

struct Run {
    nanoseconds: Vec<u64>,
    /// Of each tick, the round in which nothing came between.
    fastest: Vec<u64>,
    cycles: Vec<u32>,
    /// RMS error of each tick over the held patch's displacement.
    errors: Vec<f64>,
}

fn run(
    model: &FemModel<f32>,
    ticks: &[PatchTick],
    solved: &[[Vec<f32>; 3]],
    settings: &SolveSettings,
    works_ahead: bool,
    rounds: usize,
) -> Run {
    let mut run = Run {
        nanoseconds: Vec::new(),
        fastest: vec![u64::MAX; ticks.len()],
        cycles: Vec::new(),
        errors: Vec::new(),
    };
    for round in 0..rounds {
        let mut state = FemState::at_rest(model);
        for ((tick, solved), fastest) in ticks.iter().zip(solved).zip(&mut run.fastest) {
            let start = Instant::now();
            let report = fem::step(model, &mut state, tick.held, settings);
            if works_ahead {
                fem::prepare(model, &mut state, tick.next, settings);
            }
            let nanoseconds = start.elapsed().as_nanos() as u64;
            run.nanoseconds.push(nanoseconds);
            *fastest = nanoseconds.min(*fastest);
            if round == 0 && tick.held.is_some() {
                run.cycles.push(report.cycles);
                let error = rms(|a| state.displacement(a), solved) * model.lattice().spacing_m / tick.by_m;
                run.errors.push(error);
            }
        }
    }
    run
}

fn chainmail(scene: &Scene, ticks: &[PatchTick], rounds: usize) -> Vec<u64> {
    let limits = TissueParameters::default().validate().expect("defaults are valid");
    let model = ChainMail::new(scene, limits);
    let mut nanoseconds = Vec::new();
    for _ in 0..rounds {
        let mut state = TissueState::at_rest(&model);
        for held in ticks.iter().filter_map(|tick| tick.held) {
            let held = Held {
                element: held.element,
                position_m: held.position_m,
                patch_m: held.edge_m,
            };
            let start = Instant::now();
            let report = stylet_sim::tissue::step(&model, &mut state, Some(held), PERIOD_S);
            nanoseconds.push(start.elapsed().as_nanos() as u64);
            assert!(report.converged);
        }
    }
    nanoseconds
}

/// p50, p99, p99.9 and maximum.
fn quantiles<T: Copy + PartialOrd>(values: &[T]) -> [T; 4] {
    let mut sorted = values.to_vec();
    sorted.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
    let at = |part: f64| sorted[((sorted.len() as f64 * part) as usize).min(sorted.len() - 1)];
    [at(0.5), at(0.99), at(0.999), sorted[sorted.len() - 1]]
}

fn settings_of(material: Material) -> FemSettings {
    FemSettings::homogeneous(material, FOUNDATION_PA_PER_M)
}

fn report_insertion(name: &str, scene: &Scene, material: Material, way: Way, rounds: usize) {
    let lattice = &scene.lattice;
    let ticks = insertion(lattice, way, 40e-3);
    let exact = FemModel::<f64>::new(lattice, &settings_of(material)).expect("valid");
    let model = FemModel::<f32>::new(lattice, &settings_of(material)).expect("valid");
    let solved: Vec<_> = converged(&exact, &ticks, &EXACT)
        .into_iter()
        .map(|s| s.displacement)
        .collect();
    let changes = ticks
        .windows(2)
        .filter(|w| w[0].held.map(|h| h.element) != w[1].held.map(|h| h.element))
        .count();
    println!("{name}: {} ticks, {changes} changes of the held element", ticks.len());
    println!(
        "  cycles <= | tolerance | ahead |  p50 us    p99  p99.9    max | fastest p99 max | cycles p99 max | RMS error, % of travel p50   p99   max"
    );
    let rows = [
        (1, 1e-3, false),
        (1, 1e-3, true),
        (2, 1e-3, false),
        (2, 1e-3, true),
        (4, 1e-3, false),
        (4, 1e-3, true),
        (100, 1e-4, false),
    ];
    for (max_cycles, relative_tolerance, works_ahead) in rows {
        let settings = SolveSettings {
            relative_tolerance,
            max_cycles,
        };
        let run = run(&model, &ticks, &solved, &settings, works_ahead, rounds);
        let us = quantiles(&run.nanoseconds).map(|ns| ns as f64 * 1e-3);
        let [_, f99, _, fmax] = quantiles(&run.fastest).map(|ns| ns as f64 * 1e-3);
        let [_, c99, _, cmax] = quantiles(&run.cycles);
        let [e50, e99, _, emax] = quantiles(&run.errors).map(|e| e * 100.0);
        println!(
            "  {max_cycles:9} | {relative_tolerance:9.0e} | {:5} | {:7.0} {:6.0} {:6.0} {:6.0} | {f99:11.0} {fmax:3.0} | {c99:10} {cmax:3} | {e50:26.3} {e99:5.3} {emax:5.3}",
            if works_ahead { "yes" } else { "no" },
            us[0],
            us[1],
            us[2],
            us[3]
        );
    }
    let us = quantiles(&chainmail(scene, &ticks, rounds)).map(|ns| ns as f64 * 1e-3);
    println!(
        "  ChainMail                     | {:7.0} {:6.0} {:6.0} {:6.0} |",
        us[0], us[1], us[2], us[3]
    );
}

/// The first tick from rest, to several tolerances.
fn report_cold(name: &str, lattice: &Arc<Lattice>, material: Material) {
    let model = FemModel::<f32>::new(lattice, &settings_of(material)).expect("valid");
    let held = insertion(lattice, STRAIGHT, 40e-3).pop().expect("ticks").held;
    print!(
        "{name}: cold, {} nodes, {} levels:",
        model.node_count(),
        model.level_count()
    );
    for relative_tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let settings = SolveSettings {
            relative_tolerance,
            max_cycles: 400,
        };
        let mut state = FemState::at_rest(&model);
        let start = Instant::now();
        let report = fem::step(&model, &mut state, held, &settings);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        print!("  {relative_tolerance:.0e} {} cycles {ms:.1} ms", report.cycles);
    }
    println!();
}

fn main() {
    let scene = Scene::builtin("paper").expect("built in");
    let rounds = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(5);
    let material = |poisson_ratio, integration| Material {
        poisson_ratio,
        integration,
        ..Material::PROSTATE
    };
    let full = material(0.45, Integration::Full);
    let soft = |nu| material(nu, Integration::MeanDilatation);
    for (name, material) in [
        ("nu 0.45 full", full),
        ("nu 0.45", soft(0.45)),
        ("nu 0.49", soft(0.49)),
        ("nu 0.499", soft(0.499)),
    ] {
        report_cold(name, &scene.lattice, material);
    }
    let oblique = Way {
        direction: [0.1, -0.05, (1.0_f64 - 0.0125).sqrt()],
        ..STRAIGHT
    };
    let fast = |speed_m_per_s| Way {
        speed_m_per_s,
        ..STRAIGHT
    };
    report_insertion("nu 0.45, along z", &scene, soft(0.45), STRAIGHT, rounds);
    report_insertion("nu 0.45, along z, 123 mm/s", &scene, soft(0.45), fast(0.123), rounds);
    report_insertion("nu 0.45, along z, 280 mm/s", &scene, soft(0.45), fast(0.28), rounds);
    report_insertion("nu 0.45, oblique", &scene, soft(0.45), oblique, rounds);
    report_insertion("nu 0.49, along z", &scene, soft(0.49), STRAIGHT, rounds);
    report_insertion("nu 0.49, oblique", &scene, soft(0.49), oblique, rounds);
}
