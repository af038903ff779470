//! Assembles a report from the measurements.

use super::{
    Environment, GapSection, HostSection, Late, LoopCounts, LoopSection, Margin, NO_DIGEST, Protocol, Report, SCHEMA,
    StiffnessSection, Verdict, WindowRow,
};
use crate::bound;
use crate::collect::{LateTick, LoopTiming};
use crate::compare::Comparison;
use crate::gaps::GapReport;
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::{Measured, WARM_UP_S, switches_beyond_sleep};
use crate::provenance;
use crate::sample::PARTS;
use crate::spin::SpinSearch;
use crate::stationary;
use crate::summary::{Summary, quantile_us, summary};
use crate::trace::TraceSection;
use crate::verdict::{self, Limits};
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
}

/// Assembles a report; digests are still missing.
pub fn report(parts: &Parts) -> Report {
    let Parts { options, measured, .. } = parts;
    let period_ns = options.haptic_period_ns;
    let rate_hz = 1e9 / period_ns as f64;
    let tissue_rate_hz = 1e9 / stylet_runtime::rt::clock::TISSUE_PERIOD_NS as f64;
    let second_rate_hz = options.second.as_ref().map(|second| 1e9 / second.period_ns as f64);
    let second = measured
        .run
        .second
        .as_ref()
        .zip(measured.second.as_ref())
        .zip(second_rate_hz);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let unqualified = provenance::unqualified(parts.machine, &measured.run);
    let limits = verdict::evaluate(parts.limits, measured, period_ns, unqualified.is_empty());
    let host = &measured.host;
    Report {
        schema: SCHEMA,
        sha256: NO_DIGEST.to_owned(),
        sha256_is_of: "this file, with the 64 digits of sha256 as zeros",
        files: Vec::new(),
        made_at: provenance::now(),
        program: provenance::program(),
        commit: provenance::COMMIT,
        command: std::env::args().collect(),
        whose: parts.whose.clone(),
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
        },
        verdict: Verdict {
            overall: verdict::overall(limits.iter().map(|l| l.outcome)),
            limits,
        },
        environment: environment(&unqualified, measured),
        haptic: loop_section(
            &measured.run.haptic,
            &measured.haptic,
            rate_hz,
            ["device read to force written", "due to force written"],
        ),
        tissue: loop_section(
            &measured.run.tissue,
            &measured.tissue,
            tissue_rate_hz,
            ["tip moved to response published", "due to response published"],
        ),
        second: second.map(|((run, timing), rate_hz)| {
            loop_section(
                run,
                timing,
                rate_hz,
                ["device read to force written", "due to force written"],
            )
        }),
        host: HostSection {
            times: vec![
                summary("tip moved to host saw it", &host.tip_to_host, tissue_rate_hz),
                summary("tissue tick to host saw it", &host.tissue_to_host, tissue_rate_hz),
            ],
            snapshots: host.snapshots,
            records: host.records,
            records_missing: host.records_missing,
            faults: host.faults.len() as u64,
            which_faults: host.faults.clone(),
        },
        stiffness: stiffness(&measured.haptic.due_to_output, period_ns),
        windows: window_rows(&measured.haptic, measured.window_ns, 0.0),
        latest_wake_ups: latest(measured),
        trace: traced(measured),
        parts: parts_of_run(&measured.haptic, rate_hz),
        stationarity: stationary::examine(&measured.haptic.sample.series, measured.haptic.sample.stride),
        gaps: gap_section(measured),
        cores: measured.cores.clone(),
        comparison: parts.comparison.clone(),
        spin_search: parts.spin_search.clone(),
        settings: provenance::settings(parts.machine, options, &measured.run),
        facts: provenance::facts(parts.machine, options),
    }
}

fn loop_section(run: &LoopReport, timing: &LoopTiming, rate_hz: f64, [path, output]: [&str; 2]) -> LoopSection {
    let of = |name: &str, h: &Histogram<u64>| summary(name, h, rate_hz);
    let mut times = vec![of("wake-up", &timing.wake), of("period jitter", &timing.jitter)];
    let stages = timing.stage_names.iter().zip(&timing.stages);
    times.extend(stages.map(|(name, h)| of(name, h)));
    times.extend([
        of("whole tick", &timing.work),
        of(path, &timing.path),
        of(output, &timing.due_to_output),
        of("handing over what was measured", &timing.recording),
    ]);
    LoopSection {
        times,
        counts: LoopCounts {
            ticks: run.ticks,
            missed_deadlines: timing.missed,
            overruns: timing.overruns,
            unmeasured: timing.lost,
            usage: run.usage,
            voluntary_switches_beyond_sleep: switches_beyond_sleep(run),
        },
        miss_bound: bound::of_misses(timing.missed, timing.ticks + timing.missed, rate_hz),
        work_p999_of_period: quantile_us(&timing.work, 0.999).map(|us| us * rate_hz / 1e6),
    }
}

fn parts_of_run(timing: &LoopTiming, rate_hz: f64) -> Vec<Summary> {
    // One second of the run gives each part that fraction of its samples.
    let rate_of_part_hz = rate_hz / PARTS as f64;
    let parts = timing.sample.parts.iter().enumerate().filter(|(_, h)| !h.is_empty());
    parts
        .map(|(i, h)| summary(&format!("part {} of {PARTS}", i + 1), h, rate_of_part_hz))
        .collect()
}

fn environment(unqualified: &[String], measured: &Measured) -> Environment {
    let gaps = &measured.gaps;
    let core = gaps.core.map_or("any core".to_owned(), |c| format!("core {c}"));
    let worst = match gaps.gaps.len() {
        0 => String::new(),
        _ => format!(", the worst {:.0} us", gaps.gaps.max() as f64 / 1e3),
    };
    let steal: f64 = measured.cores.iter().filter_map(|c| c.steal_s).sum();
    let mut evidence = unqualified.to_vec();
    evidence.push(format!(
        "gap watch: spun {:.1} s on {core} and saw {} gaps over 20 us in which the kernel switched no thread{worst}",
        gaps.watched_ns as f64 / 1e9,
        gaps.gaps.len()
    ));
    if !gaps.wake.is_empty() {
        evidence.push(format!(
            "gap watch: its own timer fired up to {:.0} us late",
            gaps.wake.max() as f64 / 1e3
        ));
    }
    evidence.push(format!(
        "steal time on our cores as reported by /proc/stat: {steal:.2} s"
    ));
    Environment {
        qualified: unqualified.is_empty(),
        evidence,
    }
}

fn stiffness(delay: &Histogram<u64>, period_ns: u64) -> StiffnessSection {
    let (hand, law) = provenance::dampings_n_s_per_m();
    let margin = |at, delay_us: Option<f64>| Margin {
        at,
        delay_us,
        k_max_n_per_m: delay_us.map(|us| provenance::stiffness_margin_n_per_m(period_ns, us * 1e3)),
    };
    let max_us = (!delay.is_empty()).then(|| delay.max() as f64 / 1e3);
    StiffnessSection {
        rule: "K_max = (b + B) / (T/2 + t_d); t_d from due time to force written; a loop that is always so late",
        hand_damping_n_s_per_m: hand,
        law_damping_n_s_per_m: law,
        margins: vec![
            margin("p50", quantile_us(delay, 0.5)),
            margin("p99.9", quantile_us(delay, 0.999)),
            margin("max", max_us),
        ],
    }
}

/// Returns the worst of each window with a tick; `began_s` is the time of the first.
pub fn window_rows(timing: &LoopTiming, window_ns: u64, began_s: f64) -> Vec<WindowRow> {
    let used = timing.windows.iter().enumerate().filter(|(_, w)| w.ticks > 0);
    used.map(|(i, w)| WindowRow {
        at_s: began_s + i as f64 * window_ns as f64 / 1e9,
        worst_wake_us: w.worst_wake_ns as f64 / 1e3,
        worst_work_us: w.worst_work_ns as f64 / 1e3,
        missed: w.missed,
        ticks: w.ticks,
    })
    .collect()
}

fn latest(measured: &Measured) -> Vec<Late> {
    let timing = &measured.haptic;
    let late = timing.worst.iter().filter(|t| t.wake_ns > 0);
    late.map(|t| Late {
        at_s: t.due_ns.saturating_sub(timing.first_due_ns) as f64 / 1e9,
        wake_us: t.wake_ns as f64 / 1e3,
        work_us: t.work_ns as f64 / 1e3,
        cause: cause(measured, t),
    })
    .collect()
}

/// Returns the cause shown by the trace; if it does not cover the tick, that seen by the gap watch.
fn cause(measured: &Measured, tick: &LateTick) -> String {
    let outliers = measured.trace.iter().flat_map(|t| &t.outliers);
    let traced = outliers.into_iter().find(|o| o.due_ns == tick.due_ns);
    traced.map_or_else(
        || seen_elsewhere(&measured.gaps, tick.due_ns, tick.due_ns + tick.wake_ns),
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

fn gap_section(measured: &Measured) -> GapSection {
    let gaps = &measured.gaps;
    GapSection {
        core: gaps.core,
        watched_s: gaps.watched_ns as f64 / 1e9,
        gaps: gaps.gaps.len(),
        worst_us: (!gaps.gaps.is_empty()).then(|| gaps.gaps.max() as f64 / 1e3),
        wake: summary("wake-up of the gap watch", &gaps.wake, 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_fall_as_the_delay_grows() {
        let mut delay = crate::sample::histogram();
        for i in 0..20_000_u64 {
            delay.record(15_000 + i * 10).expect("in range");
        }
        let s = stiffness(&delay, 1_000_000);
        let k: Vec<f64> = s.margins.iter().filter_map(|m| m.k_max_n_per_m).collect();
        assert!(k.len() == 3 && k[0] > k[1] && k[1] > k[2], "{k:?}");
    }
}
