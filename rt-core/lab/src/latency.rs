//! `rt-core latency`: measures, compares with the limits, writes the report, prints the verdict.

use crate::args::{ArgsError, LatencyArgs};
use crate::compare::{self, Against, CompareError, compare};
use crate::disk::{self, DiskError};
use crate::external::{self, ExternalError};
use crate::files::{self, FilesError};
use crate::machine::Machine;
use crate::measure::{MeasureError, Setup, measure};
use crate::raw::Raw;
use crate::report::{self, JSON, PAGE, Parts, Report};
use crate::sign::{self, SignError};
use crate::spin::{self, Spin, SpinError};
use crate::spread::{self, SPREAD};
use crate::verdict::{self, LimitsError, Outcome};
use crate::whose::WhoseError;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_runtime::process::Options;

/// Reason why there is no report; the text is for people.
#[derive(Debug, thiserror::Error)]
pub enum LatencyError {
    /// The settings of the loops are invalid.
    #[error(transparent)]
    Args(#[from] ArgsError),
    /// Operator, site, device or key are invalid.
    #[error(transparent)]
    Whose(#[from] WhoseError),
    /// The limits of the verdict are invalid.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// The folder of the report, or the notes of the pin, cannot be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// Nothing was measured.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// Nothing was compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// No spin could be searched for.
    #[error(transparent)]
    Spin(#[from] SpinError),
    /// The capture of an instrument cannot be used.
    #[error(transparent)]
    External(#[from] ExternalError),
    /// The report cannot be written.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// The report cannot be signed.
    #[error(transparent)]
    Sign(#[from] SignError),
}

/// Runs the measurement, or more of them; the exit code is the worst verdict: 0 pass, 1 fail, 2 not measurable.
pub fn run(args: &LatencyArgs, interrupted: &AtomicBool) -> Result<u8, LatencyError> {
    if let Some(file) = &args.external {
        return Ok(external::run(&args.out, file, args.motion.as_deref())?);
    }
    if args.repeat == 1 {
        return Ok(measure_into(args, &args.out, interrupted)?.exit_code());
    }
    disk::make(&args.out)?;
    disk::keep_what_is_there(&args.out.join(SPREAD))?;
    let mut worst = Outcome::Pass;
    for i in 1..=args.repeat {
        eprintln!("rt-core: run {i} of {}", args.repeat);
        worst = worst.max(measure_into(args, &spread::folder(&args.out, i), interrupted)?);
        // SYNC: set by a signal handler; nothing but the flag is carried.
        if interrupted.load(Ordering::Acquire) {
            break;
        }
    }
    spread::write(&args.out)?;
    Ok(worst.exit_code())
}

/// Measures once, and writes the report into `out`.
fn measure_into(args: &LatencyArgs, out: &Path, interrupted: &AtomicBool) -> Result<Outcome, LatencyError> {
    let mut options = args.options()?;
    let whose = args.whose.read()?;
    let limits = verdict::limits(options.haptic_period_ns, &args.limit)?;
    verdict::check_duration(&args.limit, args.duration, options.haptic_period_ns)?;
    if let Some(why) = args
        .compare
        .and_then(|against| compare::impossible(&setup_of(args, out, &options), against))
    {
        return Err(CompareError::Impossible(why).into());
    }
    disk::make(out)?;
    disk::keep_what_is_there(&out.join(JSON))?;
    let mut spin_search = None;
    if args.spin_us == Spin::Auto {
        eprintln!("rt-core: looking for the smallest spin, trials of three seconds");
        let setup = setup_of(args, out, &options);
        let search = spin::search(&setup, args.longest_spin_us(), interrupted)?;
        println!("{}", search.words());
        options.wait.spin_ns = search.used_us * 1_000;
        spin_search = Some(search);
    }
    let setup = setup_of(args, out, &options);
    eprintln!(
        "rt-core: measuring for {:.0} s at {} Hz on scene '{}'",
        args.duration as f64 / 1e9,
        args.rate,
        options.scene
    );
    let measured = measure(&setup, interrupted)?;
    if args.toggle.is_some() {
        external::keep(out, &measured.haptic.toggles).map_err(DiskError::from)?;
    }
    if let Some(why) = measured.trace.as_ref().and_then(|t| t.absent.as_ref()) {
        eprintln!("rt-core: no causes: {why}");
    }
    if args.witness && measured.paired.is_none() {
        eprintln!("rt-core: no witness: the kernel grants no priority above that of the force loop");
    }
    let traced = measured.trace.as_ref().is_some_and(|t| t.absent.is_none());
    let comparison = match args.against().filter(|against| traced || *against != Against::Untraced) {
        Some(against) => {
            let [ours, theirs] = against.sides();
            eprintln!("rt-core: alternating {ours} and {theirs}, {} rounds", args.rounds);
            Some(compare(&setup, against, args.rounds, interrupted)?)
        }
        None => None,
    };
    let machine = Machine::this();
    let raw = Raw::of(&measured, comparison.as_ref());
    let parts = Parts {
        options: &options,
        duration_ns: args.duration,
        load: args.load,
        limits: &limits,
        measured: &measured,
        comparison,
        machine: &machine,
        whose: &whose,
        spin_search,
        nonce: args.nonce.as_deref(),
    };
    let mut report = report::report(&parts, &raw);
    let json = out.join(JSON);
    files::write(out, &mut report, &raw)?;
    print_verdict(&report);
    println!("{}", out.join(PAGE).display());
    println!("{}", json.display());
    if let Some(key) = &whose.sign {
        println!("{}", sign::sign(&json, key)?.display());
    }
    Ok(report.verdict.overall)
}

fn setup_of<'a>(args: &LatencyArgs, out: &'a Path, options: &'a Options) -> Setup<'a> {
    Setup {
        trace_over_ns: args.trace_over_ns(),
        toggle: args.toggle,
        witness: args.witness,
        noise: true,
        ..Setup::new(options, args.duration, args.load, out)
    }
}

/// Prints the verdict on the terminal: one line for each limit, then the overall one.
fn print_verdict(report: &Report) {
    let limits = &report.verdict.limits;
    let width = limits.iter().map(|j| j.outcome.words().len()).max().unwrap_or(0);
    for j in limits {
        let value = j.value.map_or("n/a".to_owned(), |v| format!("{v:.1}"));
        let sign = if j.lower_bound { ">=" } else { "<=" };
        let why = if j.outcome == Outcome::Pass { "" } else { &j.evidence };
        println!(
            "{:<width$} {:<24} {value:>9} {sign} {:<8} {:<4} {why}",
            j.outcome.words(),
            j.name,
            j.limit,
            j.unit
        );
    }
    println!("{}", report.others.words());
    if let Some(noise) = &report.noise {
        println!("{}", noise.words());
    }
    if let Some(paired) = &report.paired {
        println!("{}", paired.words());
    }
    if !report.environment.qualified {
        println!("environment not qualified: {}", report.environment.evidence.join("; "));
    }
    for outlier in report.trace.iter().flat_map(|t| &t.outliers) {
        println!(
            "late at {:.3} s by {:.0} us: {}",
            outlier.at_s, outlier.wake_us, outlier.cause
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
                let [ours, theirs] = comparison.against.sides();
                println!(
                    "{ours} over {theirs}, median of {} rounds: {}",
                    comparison.rounds.len(),
                    said.join(", ")
                );
            }
        }
    }
    println!("verdict: {}", report.verdict.overall.words());
}
