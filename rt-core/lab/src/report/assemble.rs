//! Assembles a report from the measurements.

use super::{
    Environment, GapSection, HostSection, Late, LoopSection, Protocol, Report, SCHEMA, StiffnessSection, Verdict,
    WindowRow, derive,
};
use crate::bound;
use crate::collect::{LateTick, LoopTiming};
use crate::compare::Comparison;
use crate::gaps::GapReport;
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::{Measured, counts};
use crate::noise_section::NoiseSection;
use crate::paired_section::PairedSection;
use crate::provenance;
use crate::raw::Raw;
use crate::sample::WARM_UP_S;
use crate::sealed::NO_DIGEST;
use crate::spin::SpinSearch;
use crate::stationary;
use crate::summary::summary;
use crate::trace::TraceSection;
use crate::verdict::{Limits, Outcome};
use crate::whose::Whose;
use hdrhistogram::Histogram;
use stylet_runtime::process::{LoopReport, Options};

/// Parts of a report.
pub struct Parts<'a> {
    pub options: &'a Options,
    pub duration_ns: u64,
    pub load: Load,
    pub limits: &'a Limits,
    pub measured: &'a Measured,
    pub comparison: Option<Comparison>,
    pub machine: &'a Machine,
    pub whose: &'a Whose,
    pub spin_search: Option<SpinSearch>,
    pub nonce: Option<&'a str>,
}

/// Assembles a report; digests are still missing.
pub fn report(parts: &Parts, raw: &Raw) -> Report {
    let Parts { options, measured, .. } = parts;
    let period_ns = options.haptic_period_ns;
    let rate_hz = 1e9 / period_ns as f64;
    let tissue_rate_hz = 1e9 / stylet_runtime::rt::clock::TISSUE_PERIOD_NS as f64;
    let second_rate_hz = options.second.as_ref().map(|second| 1e9 / second.period_ns as f64);
    let second = measured.run.second.as_ref().zip(measured.second.as_ref());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let host = &measured.host;
    let mut report = Report {
        schema: SCHEMA.to_owned(),
        sha256: NO_DIGEST.to_owned(),
        sha256_is_of: String::new(),
        files: Vec::new(),
        made_at: provenance::now(),
        program: provenance::program(),
        commit: provenance::COMMIT.to_owned(),
        command: std::env::args().collect(),
        whose: parts.whose.clone(),
        nonce: parts.nonce.map(str::to_owned),
        programs: provenance::programs(),
        protocol: Protocol {
            scene: options.scene.clone(),
            load: parts.load,
            load_is: parts.load.describe(cores),
            rate_hz,
            tissue_rate_hz,
            second_rate_hz,
            duration_s: parts.duration_ns as f64 / 1e9,
            measured_s: parts.measured.haptic.measured_ns() as f64 / 1e9,
            warm_up_s: WARM_UP_S,
            spin_us: options.wait.spin_ns / 1_000,
            insertions: host.insertions,
            window_s: measured.window_ns as f64 / 1e9,
        },
        verdict: Verdict {
            overall: Outcome::NotMeasurable,
            limits: Vec::new(),
        },
        environment: Environment::default(),
        haptic: counted(&measured.run.haptic, &measured.haptic),
        tissue: counted(&measured.run.tissue, &measured.tissue),
        second: second.map(|(run, timing)| counted(run, timing)),
        host: HostSection {
            times: Vec::new(),
            snapshots: host.snapshots,
            records: host.records,
            records_missing: host.records_missing,
            faults: 0,
            which_faults: host.faults.clone(),
        },
        stiffness: StiffnessSection::default(),
        windows: window_rows(&measured.haptic, measured.window_ns, 0.0),
        latest_wake_ups: latest(measured),
        trace: traced(measured),
        parts: Vec::new(),
        stationarity: stationary::examine(&[], 1),
        gaps: GapSection {
            core: measured.gaps.core,
            watched_s: measured.gaps.watched_ns as f64 / 1e9,
            gaps: 0,
            worst_us: None,
            wake: summary("", &measured.gaps.wake, &[], 1e3),
        },
        noise: measured.noise.as_ref().map(NoiseSection::of),
        cores: measured.cores.clone(),
        others: measured.others.clone(),
        paired: measured.paired.as_ref().map(|_| PairedSection::of(raw, period_ns)),
        comparison: parts.comparison.clone(),
        spin_search: parts.spin_search.clone(),
        settings: provenance::settings(parts.machine, options, &measured.run),
        facts: provenance::facts(parts.machine, options),
    };
    derive(&mut report, raw, parts.limits);
    report
}

/// Returns a section with its counters alone.
fn counted(run: &LoopReport, timing: &LoopTiming) -> LoopSection {
    LoopSection {
        times: Vec::new(),
        counts: counts(run, timing),
        miss_bound: bound::of_misses(0, 0, 1.0),
        work_p999_of_period: None,
    }
}

/// Returns the worst of each window with a tick; `began_s` is the time of the first.
pub fn window_rows(timing: &LoopTiming, window_ns: u64, began_s: f64) -> Vec<WindowRow> {
    let used = timing.windows.iter().enumerate().filter(|(_, w)| w.ticks > 0);
    used.map(|(i, w)| WindowRow {
        at_s: began_s + i as f64 * window_ns as f64 / 1e9,
        worst_wake_us: of_bin_us(&timing.wake, w.worst_wake_ns),
        worst_work_us: of_bin_us(&timing.work, w.worst_work_ns),
        missed: w.missed,
        overruns: w.overruns,
        ticks: w.ticks,
    })
    .collect()
}

/// Returns a time as the histogram resolves it, so that it can be checked against it.
fn of_bin_us(histogram: &Histogram<u64>, ns: u64) -> f64 {
    histogram.highest_equivalent(ns) as f64 / 1e3
}

fn latest(measured: &Measured) -> Vec<Late> {
    let timing = &measured.haptic;
    let late = timing.worst.iter().filter(|t| t.wake_ns > 0);
    late.map(|t| Late {
        at_s: t.due_ns.saturating_sub(timing.first_due_ns) as f64 / 1e9,
        wake_us: of_bin_us(&timing.wake, t.wake_ns),
        work_us: of_bin_us(&timing.work, t.work_ns),
        cause: cause(measured, t),
    })
    .collect()
}

/// Returns the cause shown by the trace; if it does not cover the tick, a thread that preempts the loop, or what the
/// gap watch saw.
fn cause(measured: &Measured, tick: &LateTick) -> String {
    let outliers = measured.trace.iter().flat_map(|t| &t.outliers);
    let traced = outliers.into_iter().find(|o| o.due_ns == tick.due_ns);
    traced.map_or_else(
        || {
            let woke_ns = tick.due_ns + tick.wake_ns;
            let rival = measured.others.rival(tick.due_ns, woke_ns);
            let elsewhere = || seen_elsewhere(&measured.gaps, tick.due_ns, woke_ns);
            let paired = measured.paired.as_ref().and_then(|p| p.words(tick));
            rival.unwrap_or_else(|| {
                [paired, Some(elsewhere())]
                    .into_iter()
                    .flatten()
                    .collect::<Vec<_>>()
                    .join("; ")
            })
        },
        |o| o.cause.clone(),
    )
}

/// Returns the trace, with times relative to the start of the measurement.
fn traced(measured: &Measured) -> Option<TraceSection> {
    let mut section = measured.trace.clone()?;
    for outlier in &mut section.outliers {
        outlier.at_s = outlier.due_ns.saturating_sub(measured.haptic.first_due_ns) as f64 / 1e9;
    }
    Some(section)
}

/// Returns the gap watch's observations between two times.
fn seen_elsewhere(gaps: &GapReport, from_ns: u64, to_ns: u64) -> String {
    let core = gaps.core.map_or("another core".to_owned(), |c| format!("core {c}"));
    if let Some(ns) = gaps.gap_during(from_ns, to_ns) {
        return format!(
            "a gap of {:.0} us on {core} at the same time, without a switch",
            ns as f64 / 1e3
        );
    }
    match gaps.late_during(from_ns, to_ns) {
        Some(ns) => format!(
            "the gap watch on {core} woke {:.0} us late at the same time: not this core alone",
            ns as f64 / 1e3
        ),
        None => format!("nothing seen on {core}: this core alone"),
    }
}
