//! Figures of a report from its raw data. A measurement fills them in by this, and `verify` computes them again.

use super::{Environment, GapSection, HostSection, LoopCounts, LoopSection, Margin, Report, StiffnessSection, Verdict};
use crate::bound;
use crate::paired::{BOTH, LOOP_ALONE};
use crate::paired_section::PairedSection;
use crate::provenance;
use crate::raw::Raw;
use crate::sample::{PARTS, histogram};
use crate::stationary;
use crate::summary::{Summary, quantile_us, summary};
use crate::verdict::{self, Counted, Limits, LimitsError};
use hdrhistogram::Histogram;

/// Computes every figure that the raw data, the windows, the settings and the facts determine.
pub fn derive(r: &mut Report, raw: &Raw, limits: &Limits) {
    r.sha256_is_of = "this file, with the 64 digits of sha256 as zeros".to_owned();
    let p = &r.protocol;
    let period_ns = period_ns(p.rate_hz);
    r.haptic.counts.missed_deadlines = r.windows.iter().map(|w| u64::from(w.missed)).sum();
    r.haptic.counts.overruns = r.windows.iter().map(|w| u64::from(w.overruns)).sum();
    let device = ["device read to force written", "due to force written"];
    let tissue = ["tip moved to response published", "due to response published"];
    r.haptic = of_loop(raw, "haptic", &r.haptic.counts, p.rate_hz, device);
    r.tissue = of_loop(raw, "tissue", &r.tissue.counts, p.tissue_rate_hz, tissue);
    let second = r.second.as_ref().zip(p.second_rate_hz);
    r.second = second.map(|(second, rate_hz)| of_loop(raw, "second", &second.counts, rate_hz, device));
    let seen = |name, tag| of(raw, name, &format!("host/{tag}"), p.tissue_rate_hz);
    r.host = HostSection {
        times: vec![
            seen("tip moved to host saw it", "tip_to_host"),
            seen("tissue tick to host saw it", "tissue_to_host"),
        ],
        faults: r.host.which_faults.len() as u64,
        ..r.host.clone()
    };
    r.stiffness = stiffness(&raw.get("haptic/due_to_output"), period_ns);
    // One second of the run gives each part that fraction of its samples.
    let rate_of_part_hz = p.rate_hz / PARTS as f64;
    let parts = raw
        .parts("haptic/wake")
        .into_iter()
        .enumerate()
        .filter(|(_, h)| !h.is_empty());
    r.parts = parts
        .map(|(i, h)| summary(&format!("part {} of {PARTS}", i + 1), &h, &[], rate_of_part_hz))
        .collect();
    r.stationarity = stationary::examine(&raw.series, raw.stride);
    let gaps = raw.get("gap_watch/gaps");
    r.gaps = GapSection {
        gaps: gaps.len(),
        worst_us: (!gaps.is_empty()).then(|| gaps.max() as f64 / 1e3),
        wake: summary("wake-up of the gap watch", &raw.get("gap_watch/wake"), &[], 1e3),
        ..r.gaps.clone()
    };
    if let Some(noise) = &mut r.noise {
        noise.derive(raw);
    }
    if let Some(comparison) = &mut r.comparison {
        comparison.set_ratios();
    }
    r.paired = r.paired.as_ref().map(|_| PairedSection::of(raw, period_ns));
    r.environment = environment(r);
    let loops = [("haptic", &r.haptic), ("tissue", &r.tissue)];
    let second = r.second.as_ref().map(|s| ("second", s));
    let counted = Counted {
        loops: loops
            .into_iter()
            .chain(second)
            .map(|(name, s)| (name, &s.counts))
            .collect(),
        records: r.host.records,
        records_missing: r.host.records_missing,
        insertions: r.protocol.insertions,
        faults: &r.host.which_faults,
        measured_s: r.protocol.measured_s,
    };
    let limits = verdict::evaluate(limits, raw, &counted, period_ns, r.environment.qualified);
    r.verdict = Verdict {
        overall: verdict::overall(limits.iter().map(|l| l.outcome)),
        limits,
    };
}

fn period_ns(rate_hz: f64) -> u64 {
    (1e9 / rate_hz.clamp(1.0, 1e6)).round() as u64
}

/// Returns the limits that the command of the report asked for.
pub fn limits_of(r: &Report) -> Result<Limits, LimitsError> {
    let mut given = Vec::new();
    let mut words = r.command.iter();
    while let Some(word) = words.next() {
        match word.strip_prefix("--limit") {
            Some("") => given.extend(words.next().cloned()),
            Some(rest) => given.extend(rest.strip_prefix('=').map(str::to_owned)),
            None => {}
        }
    }
    verdict::limits(period_ns(r.protocol.rate_hz), &given)
}

fn of(raw: &Raw, name: &str, tag: &str, rate_hz: f64) -> Summary {
    summary(name, &raw.get(tag), &raw.parts(tag), rate_hz)
}

fn of_loop(raw: &Raw, name: &str, counts: &LoopCounts, rate_hz: f64, [path, output]: [&str; 2]) -> LoopSection {
    let title = |tag: &str| match tag {
        "wake" => "wake-up".to_owned(),
        "jitter" => "period jitter".to_owned(),
        "work" => "whole tick".to_owned(),
        "path" => path.to_owned(),
        "due_to_output" => output.to_owned(),
        "recording" => "handing over what was measured".to_owned(),
        stage => stage.replace('_', " "),
    };
    let times = raw
        .of_loop(name)
        .map(|tag| of(raw, &title(tag), &format!("{name}/{tag}"), rate_hz));
    let points = raw.get(&format!("{name}/wake")).len() + counts.missed_deadlines;
    let work = raw.get(&format!("{name}/work"));
    LoopSection {
        times: times.collect(),
        counts: counts.clone(),
        miss_bound: bound::of_misses(counts.missed_deadlines, points, rate_hz),
        work_p999_of_period: quantile_us(&work, 0.999).map(|us| us * rate_hz / 1e6),
    }
}

/// Returns why the tail of a measurement reflects this environment rather than the program; empty if it does not.
fn unqualified(facts: &[provenance::Fact], settings: &[provenance::Setting]) -> Vec<String> {
    let mut reasons = Vec::new();
    let below = facts.iter().find(|f| f.name == "hypervisor");
    if let Some(name) = below
        .map(|f| &f.value)
        .filter(|name| *name != provenance::NO_HYPERVISOR)
    {
        reasons.push(format!("virtual machine ({name})"));
    }
    let met = |of: &str| settings.iter().filter(|s| s.name.ends_with(of)).all(|s| s.met);
    if !met(provenance::POLICY) {
        reasons.push("the loops ran without SCHED_FIFO".to_owned());
    }
    if !met(provenance::MEMORY_LOCK) {
        reasons.push("memory was not locked".to_owned());
    }
    reasons
}

fn environment(r: &Report) -> Environment {
    let unqualified = unqualified(&r.facts, &r.settings);
    let gaps = &r.gaps;
    let core = gaps.core.map_or("any core".to_owned(), |c| format!("core {c}"));
    let worst = gaps
        .worst_us
        .map_or(String::new(), |us| format!(", the worst {us:.0} us"));
    let steal: f64 = r.cores.iter().filter_map(|c| c.steal_s).sum();
    let qualified = unqualified.is_empty();
    let mut evidence = unqualified;
    evidence.push(format!(
        "gap watch: spun {:.1} s on {core} and saw {} gaps over 20 us in which the kernel switched no thread{worst}",
        gaps.watched_s, gaps.gaps
    ));
    if let Some(us) = gaps.wake.max_us {
        evidence.push(format!("gap watch: its own timer fired up to {us:.0} us late"));
    }
    evidence.push(format!(
        "steal time on our cores as reported by /proc/stat: {steal:.2} s"
    ));
    Environment { qualified, evidence }
}

fn stiffness(delay: &Histogram<u64>, period_ns: u64) -> StiffnessSection {
    let (hand, law) = provenance::dampings_n_s_per_m();
    let margin = |at: &str, delay_us: Option<f64>| Margin {
        at: at.to_owned(),
        delay_us,
        k_max_n_per_m: delay_us.map(|us| provenance::stiffness_margin_n_per_m(period_ns, us * 1e3)),
    };
    let max_us = (!delay.is_empty()).then(|| delay.max() as f64 / 1e3);
    StiffnessSection {
        rule: "K_max = (b + B) / (T/2 + t_d); t_d from due time to force written; a loop that is always so late"
            .to_owned(),
        hand_damping_n_s_per_m: hand,
        law_damping_n_s_per_m: law,
        margins: vec![
            margin("p50", quantile_us(delay, 0.5)),
            margin("p99.9", quantile_us(delay, 0.999)),
            margin("max", max_us),
        ],
    }
}

/// Returns what in the record of ticks contradicts the histograms, or itself.
pub fn contradictions(r: &Report, raw: &Raw) -> Vec<String> {
    let mut found = Vec::new();
    let mut must = |is_so: bool, what: String| found.extend((!is_so).then_some(what));
    let (wake, work) = (raw.get("haptic/wake"), raw.get("haptic/work"));
    let in_windows: u64 = r.windows.iter().map(|w| u64::from(w.ticks)).sum();
    must(
        in_windows == wake.len(),
        format!(
            "windows: {in_windows} ticks, the histogram of wake-ups has {}",
            wake.len()
        ),
    );
    let known = |h: &Histogram<u64>, us: f64| {
        let ns = (us * 1e3).round().max(0.0) as u64;
        ns == h.highest_equivalent(ns) && h.count_at(ns) > 0
    };
    for w in &r.windows {
        let in_bins = known(&wake, w.worst_wake_us) && known(&work, w.worst_work_us);
        must(
            in_bins,
            format!("windows: at {} s: no such wake-up or tick in the histograms", w.at_s),
        );
    }
    let late: Vec<f64> = r.latest_wake_ups.iter().map(|l| l.wake_us).collect();
    for l in &r.latest_wake_ups {
        let in_bins = known(&wake, l.wake_us) && known(&work, l.work_us);
        must(
            in_bins,
            format!("latest_wake_ups: at {} s: no such wake-up in the histograms", l.at_s),
        );
    }
    must(
        late.is_sorted_by(|a, b| a >= b),
        "latest_wake_ups: not the latest first".to_owned(),
    );
    let longest = |of: fn(&super::WindowRow) -> f64| r.windows.iter().map(of).fold(0.0, f64::max);
    for (name, h, us) in [
        ("windows: worst_wake_us", &wake, longest(|w| w.worst_wake_us)),
        ("windows: worst_work_us", &work, longest(|w| w.worst_work_us)),
        ("latest_wake_ups", &wake, late.first().copied().unwrap_or(0.0)),
    ] {
        let ends_us = h.max() as f64 / 1e3;
        must(
            us == ends_us,
            format!("{name}: at most {us} us, the histogram ends at {ends_us} us"),
        );
    }
    for (name, h) in raw.of_loop("haptic").map(|tag| (tag, format!("haptic/{tag}"))) {
        let mut joined = histogram();
        let all_fit = raw.parts(&h).iter().all(|part| joined.add(part).is_ok());
        must(
            all_fit && joined == raw.get(&h),
            format!("histograms.hlog: the parts of {name} are not its whole"),
        );
    }
    for late in [LOOP_ALONE, BOTH].iter().flat_map(|tag| {
        raw.get(tag)
            .iter_recorded()
            .map(|b| b.value_iterated_to())
            .collect::<Vec<_>>()
    }) {
        let sorted = [LOOP_ALONE, BOTH]
            .map(|tag| raw.get(tag).count_at(late))
            .iter()
            .sum::<u64>();
        must(
            sorted <= wake.count_at(late),
            format!("paired: {sorted} late wake-ups of {late} ns, the histogram of wake-ups has fewer"),
        );
    }
    let noise = r.noise.as_ref().and_then(|noise| noise.contradiction(raw));
    must(noise.is_none(), noise.unwrap_or_default());
    let c = &r.haptic.counts;
    let parts = raw.parts("haptic/wake");
    let grid_of_part = ((r.protocol.duration_s * r.protocol.rate_hz).round() as u64)
        .div_ceil(PARTS as u64)
        .max(1);
    let is_known = |(i, &ns): (u64, &u64)| {
        // A missed deadline shifts all later ticks on the grid.
        let part = (i * raw.stride / grid_of_part) as usize;
        let shifted = c.missed_deadlines > 0 || c.unmeasured > 0;
        if shifted { &wake } else { &parts[part.min(PARTS - 1)] }.count_at(ns) > 0
    };
    let counted = wake.len().div_ceil(raw.stride);
    must(
        raw.series.len() as u64 == counted && (0..).zip(&raw.series).all(is_known),
        format!(
            "wakes.txt: not every {} of the wake-ups in the histograms, in their order",
            raw.stride
        ),
    );
    must(
        c.ticks >= wake.len(),
        format!("counts: {} ticks in all, {} measured", c.ticks, wake.len()),
    );
    let grid = (r.protocol.measured_s * r.protocol.rate_hz).round() as u64;
    let points = wake.len() + c.missed_deadlines;
    must(
        c.unmeasured > 0 || grid.abs_diff(points) <= 1,
        format!("measured_s: {grid} deadlines, {points} were served or missed"),
    );
    let made = jiff::civil::DateTime::strptime("%Y-%m-%d %H:%M:%S UTC", &r.made_at);
    let made_s = made.and_then(|t| Ok(t.to_zoned(jiff::tz::TimeZone::UTC)?.timestamp().as_second()));
    let ended_s = raw.began_s as f64 + r.protocol.measured_s;
    must(
        made_s.is_ok_and(|s| s as f64 >= ended_s - 1.0),
        format!(
            "made_at: {}, the measurement ended {ended_s:.0} s after 1970",
            r.made_at
        ),
    );
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::provenance::{Fact, Setting};

    #[test]
    fn margins_fall_as_the_delay_grows() {
        let mut delay = histogram();
        for i in 0..20_000_u64 {
            delay.record(15_000 + i * 10).expect("in range");
        }
        let s = stiffness(&delay, 1_000_000);
        let k: Vec<f64> = s.margins.iter().filter_map(|m| m.k_max_n_per_m).collect();
        assert!(k.len() == 3 && k[0] > k[1] && k[1] > k[2], "{k:?}");
    }

    #[test]
    fn lack_of_real_time_rights_disqualifies_the_tail() {
        let setting = |name: &str, met| Setting {
            name: name.to_owned(),
            asked: String::new(),
            got: String::new(),
            met,
        };
        let below = |value: &str| Fact {
            group: "Processor".to_owned(),
            name: "hypervisor".to_owned(),
            value: value.to_owned(),
        };
        let all = |met| {
            [
                setting("haptic thread: policy and priority", met),
                setting("memory lock", met),
            ]
        };
        assert_eq!(unqualified(&[below("KVM")], &all(false)).len(), 3);
        assert_eq!(unqualified(&[below("none found")], &all(false)).len(), 2);
        assert!(unqualified(&[below("none found")], &all(true)).is_empty());
    }
}
