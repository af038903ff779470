//! `make report`: every tissue model over the same insertions; speed, error, and what to pick.

mod budget;
mod models;
mod page;
mod runs;
mod ships;
mod table;

use clap::Parser;
use models::{converged, entries};
use page::Refinement;
use runs::{Reference, run};
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use stylet_benches::bodies::{SPACINGS_M, gland};
use stylet_benches::error::{apart, quantile, rms};
use stylet_benches::insertions::{GLAND, Insertion, MIDDLE, TICK_S};
use stylet_benches::machine;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{Held, MaterialPoint, TissueModel};
use table::{Row, Where, row};

/// Runs every tissue model over the same needle insertions and writes speed, error and advice.
#[derive(Parser)]
struct Options {
    /// Folder to write into; the default is benches/runs/DATE-HOST
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Equal runs of each model, of which the least time of each tick counts
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    /// What ships beside its converged solution alone, into as-it-ships.csv: minutes instead of a quarter of an hour
    #[arg(long)]
    ships: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::parse();
    let start = Instant::now();
    let machine = machine::describe();
    let out = options.out.unwrap_or_else(|| machine::run_folder(&machine));
    std::fs::create_dir_all(&out)?;

    let ships = ships::measure(options.rounds);
    table::write(&ships, &out.join("as-it-ships.csv"))?;
    if options.ships {
        return Ok(());
    }
    let causes = budget::causes();
    let mut rows = Vec::new();
    for spacing_m in SPACINGS_M {
        let scene = gland(spacing_m);
        for insertion in &GLAND {
            eprintln!("{:.2} mm, {} ...", spacing_m * 1e3, insertion.name);
            rows.extend(measure(&scene, insertion, options.rounds.max(1)));
        }
    }
    table::write(&rows, &out.join("speed-vs-error.csv"))?;
    let found = page::Findings {
        machine: &machine,
        points: &table::points(&rows),
        refinement: &refinement(),
        ships: &ships,
        causes: &causes,
        seconds: start.elapsed().as_secs_f64(),
    };
    std::fs::write(out.join("README.md"), page::write(&found)?)?;
    println!("{}", out.join("README.md").display());
    Ok(())
}

/// Runs every model through one insertion, round by round, so that a noisy machine disturbs all alike.
fn measure(scene: &Scene, insertion: &Insertion, rounds: usize) -> Vec<Row> {
    let script: Vec<Held> = insertion.script(scene);
    let seeds = insertion.seeds(scene);
    let reference = Reference::of(&mut converged(scene), &script);
    let mut entries = entries(scene);
    let mut runs: Vec<Vec<_>> = entries.iter().map(|_| Vec::new()).collect();
    for _ in 0..rounds {
        for (entry, runs) in entries.iter_mut().zip(&mut runs) {
            runs.push(run(&mut *entry.model, &script, &seeds, insertion.travel_m, &reference));
        }
    }
    let place = Where {
        spacing_m: scene.lattice.spacing_m,
        elements: scene.lattice.element_count(),
        without_model: reference.without_model(insertion.travel_m, &seeds),
    };
    let with_runs = entries.iter().zip(&runs);
    with_runs
        .map(|(entry, runs)| row(&place, insertion, entry, runs))
        .collect()
}

/// Measures the error of the lattice itself: seeds of the converged FEM at each spacing against those of the finest.
fn refinement() -> Vec<Refinement> {
    let ends: Vec<Vec<[f64; 3]>> = SPACINGS_M.map(|spacing_m| seeds_after_push(&gland(spacing_m))).into();
    let finest = ends.last().expect("spacings are given");
    let row = |(spacing_m, seeds): (&f64, &Vec<[f64; 3]>)| {
        let pairs = seeds.iter().zip(finest);
        let apart_m: Vec<f64> = pairs.map(|(a, b)| apart(*a, *b)).collect();
        Refinement {
            spacing_mm: spacing_m * 1e3,
            rms_mm: rms(&apart_m) * 1e3,
            largest_mm: quantile(&apart_m, 1.0) * 1e3,
        }
    };
    SPACINGS_M.iter().zip(&ends).map(row).collect()
}

/// Returns the displacement of the same places of the gland at the end of the push in the middle.
fn seeds_after_push(scene: &Scene) -> Vec<[f64; 3]> {
    let insertion = &MIDDLE;
    let push = (insertion.travel_m / (insertion.speed_m_per_s * TICK_S)).ceil() as usize;
    let mut fem = converged(scene);
    let lattice = &scene.lattice;
    let (low, high) = lattice.bounds_m();
    let places = [
        [3.0, 0.0, -2.0],
        [0.0, 5.0, 2.0],
        [-8.0, 0.0, 4.0],
        [0.0, -3.0, 6.0],
        [5.0, 5.0, 0.0],
    ];
    let points = places.map(|mm: [f64; 3]| {
        let place = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]) + 1e-3 * mm[a]);
        let point = MaterialPoint::locate(&fem.deformed(), place, None).expect("inside the gland");
        (place, point)
    });
    for &held in &insertion.script(scene)[..push] {
        fem.step(Some(held), TICK_S);
    }
    let body = fem.deformed();
    points
        .iter()
        .map(|(place, point)| {
            let now = point.position_m(&body);
            [0, 1, 2].map(|a| now[a] - place[a])
        })
        .collect()
}
