//! `rt-core latency`: measure, compare with the limits, write the report, print the verdict.

use crate::args::{ArgsError, LatencyArgs};
use crate::compare::{Against, CompareError, compare};
use crate::files::{self, FilesError};
use crate::machine::Machine;
use crate::measure::{MeasureError, Setup, measure};
use crate::report::{self, JSON, PAGE, Parts, Report};
use crate::sign::{self, SignError};
use crate::verdict::{self, LimitsError, Outcome};
use crate::whose::WhoseError;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Why there is no report; the text is for people.
#[derive(Debug, thiserror::Error)]
pub enum LatencyError {
    /// Settings of the loops.
    #[error(transparent)]
    Args(#[from] ArgsError),
    /// Operator, site, device or key.
    #[error(transparent)]
    Whose(#[from] WhoseError),
    /// Limits of the verdict.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// The folder of the report.
    #[error("cannot make {}: {why}", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system reports.
        why: io::Error,
    },
    /// Nothing was measured.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// Nothing was compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// The report cannot be written.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// The report cannot be signed.
    #[error(transparent)]
    Sign(#[from] SignError),
}

/// The exit code is the verdict: 0 pass, 1 fail, 2 not measurable.
pub fn run(args: &LatencyArgs, interrupted: &AtomicBool) -> Result<u8, LatencyError> {
    let options = args.options()?;
    let whose = args.whose.read()?;
    let limits = verdict::limits(options.haptic_period_ns, args.limits.as_deref(), &args.limit)?;
    std::fs::create_dir_all(&args.out).map_err(|why| LatencyError::Folder {
        folder: args.out.clone(),
        why,
    })?;
    let setup = Setup {
        options: &options,
        duration_ns: args.duration,
        load: args.load,
        folder: &args.out,
    };
    eprintln!(
        "rt-core: measuring for {:.0} s at {} Hz on scene '{}'",
        args.duration as f64 / 1e9,
        args.rate,
        options.scene
    );
    let measured = measure(&setup, interrupted)?;
    let comparison = match args.compare {
        Some(against) => {
            let ours = if against == Against::Unloaded {
                "with and "
            } else {
                "with "
            };
            eprintln!("rt-core: alternating {ours}{}, {} rounds", against.name(), args.rounds);
            Some(compare(&setup, against, args.rounds, interrupted)?)
        }
        None => None,
    };
    let machine = Machine::this();
    let mut report = report::report(&Parts {
        options: &options,
        duration_ns: args.duration,
        load: args.load,
        limits: &limits,
        measured: &measured,
        comparison,
        machine: &machine,
        whose: &whose,
    });
    // A signature of an earlier report in the same folder is none of this one.
    let json = args.out.join(JSON);
    let _ = std::fs::remove_file(sign::signature_of(&json));
    files::write(&args.out, &mut report, &measured)?;
    print_verdict(&report);
    println!("{}", args.out.join(PAGE).display());
    println!("{}", json.display());
    if let Some(key) = &whose.sign {
        println!("{}", sign::sign(&json, key)?.display());
    }
    Ok(report.verdict.overall.exit_code())
}

/// The verdict on the terminal: one line for each limit, then all of them.
fn print_verdict(report: &Report) {
    for j in &report.verdict.limits {
        let value = j.value.map_or("n/a".to_owned(), |v| format!("{v:.1}"));
        let sign = if j.lower_bound { ">=" } else { "<=" };
        let why = if j.outcome == Outcome::Pass { "" } else { &j.evidence };
        println!(
            "{:<14} {:<24} {value:>9} {sign} {:<8} {:<4} {why}",
            j.outcome.words(),
            j.name,
            j.limit,
            j.unit
        );
    }
    if let Some(comparison) = &report.comparison {
        match &comparison.absent {
            Some(why) => println!("comparison: {why}"),
            None => {
                let ratios = comparison.names.iter().zip(comparison.median_ratio);
                let said: Vec<String> = ratios
                    .map(|(name, r)| format!("{name} {}", r.map_or("n/a".to_owned(), |r| format!("{r:.2}"))))
                    .collect();
                let over = match comparison.against {
                    Against::Cyclictest => "ours over cyclictest",
                    Against::Unloaded => "with the load over without it",
                };
                println!(
                    "{over}, median of {} rounds: {}",
                    comparison.rounds.len(),
                    said.join(", ")
                );
            }
        }
    }
    println!("verdict: {}", report.verdict.overall.words());
}
