//! As `run.mjs`, but native: `stylet-tests-wasm FILE.flight [--denormals]`, or without a file the cost of a tick.

use std::process::ExitCode;
use stylet_runtime::rt::arm::{Ask, arm};
use stylet_sim::scene::TissueKind;
use stylet_tests_wasm::{Bench, repeat};

/// Rehearsals of which the fastest counts.
const RUNS: usize = 5;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has_denormals = arguments.iter().any(|argument| argument == "--denormals");
    let as_loops = || {
        let ask = Ask {
            priority: None,
            core: None,
        };
        if !has_denormals {
            arm(ask).expect("no priority is asked for");
        }
    };
    let file = arguments.iter().find(|argument| !argument.starts_with("--"));
    if let Some(file) = file {
        let bytes = std::fs::read(file).unwrap_or_else(|why| panic!("{file}: {why}"));
        let is_same = match repeat(&bytes, as_loops) {
            Ok(found) => {
                print!("{found}");
                found.is_same()
            }
            Err(why) => {
                println!("{why}");
                false
            }
        };
        return if is_same { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    as_loops();
    for tissue in [TissueKind::Paper, TissueKind::ChainMail] {
        let mut bench = Bench::new(tissue);
        let cost_us = (0..RUNS).map(|_| {
            let begun_us = processor_time_us();
            let ticks = bench.rehearse();
            (processor_time_us() - begun_us) / ticks
        });
        let least_us = cost_us.fold(f64::INFINITY, f64::min);
        println!(
            "{}: {least_us:.1} µs a force tick with its share of the tissue",
            tissue.name()
        );
    }
    ExitCode::SUCCESS
}

/// Processor time of the main thread: other programs may keep this one waiting.
fn processor_time_us() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let first = text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    1e-3 * first.expect("the kernel counts processor time")
}
