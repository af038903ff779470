//! Limits, and their outcome in a measurement: pass, fail, or not measurable, each with its evidence.

use crate::measure::LoopCounts;
use crate::provenance::stiffness_margin_n_per_m;
use crate::raw::Raw;
use crate::summary::{needed, quantile_us};
use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_report::parts::duration;
use stylet_runtime::rt::clock::TISSUE_PERIOD_NS;
use stylet_shm_schema::ProblemList;

/// Reading that a limit applies to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Reading {
    Wake(f64),
    Work(f64),
    Path(f64),
    Jitter(f64),
    Recording(f64),
    TipToTissue(f64),
    TipToHost(f64),
    StiffnessMargin(f64),
    Missed,
    Overruns,
    HeapCalls,
    PageFaults,
    ExtraSwitches,
    RecordsMissing,
    Faults,
}

impl Reading {
    /// Returns the percentile that it reads; `None` for a maximum or a count.
    fn quantile(self) -> Option<f64> {
        match self {
            Self::Wake(q) | Self::Work(q) | Self::Path(q) | Self::Jitter(q) | Self::Recording(q) => Some(q),
            Self::TipToTissue(q) | Self::TipToHost(q) | Self::StiffnessMargin(q) => Some(q),
            _ => None,
        }
        .filter(|q| *q < MAX)
    }

    /// Returns the time between two of its samples, where the force loop has `period_ns`.
    fn period_ns(self, period_ns: u64) -> u64 {
        match self {
            Self::TipToTissue(_) | Self::TipToHost(_) => TISSUE_PERIOD_NS,
            _ => period_ns,
        }
    }
}

/// One row of the table of limits.
pub struct LimitSpec {
    /// Stable id, for the trace from requirement to evidence.
    pub id: &'static str,
    pub name: &'static str,
    pub unit: &'static str,
    /// Default for 1 kHz. Limits that scale are multiplied by the period in milliseconds.
    default: f64,
    scales_with_period: bool,
    pub reason: &'static str,
    reading: Reading,
}

const MAX: f64 = 1.0;

macro_rules! limits {
    ($( $id:literal $name:literal $unit:literal $default:literal $scales:ident $reading:expr, $reason:literal; )*) => {
        /// Every limit there is, with the default for a 1 kHz force loop and its reason.
        pub const LIMITS: &[LimitSpec] = &[ $( LimitSpec {
            id: $id, name: $name, unit: $unit, default: $default, scales_with_period: limits!(@ $scales), reason: $reason, reading: $reading,
        } ),* ];
    };
    (@ period) => { true };
    (@ fixed) => { false };
}

limits! {
    "REQ-LAT-001" "wake_p50_us" "us" 50.0 period Reading::Wake(0.5), "Half of all ticks start within 5 % of the period: below the noise of the velocity estimate.";
    "REQ-LAT-002" "wake_p99_us" "us" 200.0 period Reading::Wake(0.99), "One tick in a hundred may start a fifth of the period late; the force then is at most 1.2 periods old.";
    "REQ-LAT-003" "wake_p999_us" "us" 500.0 period Reading::Wake(0.999), "Half a period late once a second doubles the delay that a sampled wall has anyway (T/2).";
    "REQ-LAT-004" "wake_max_us" "us" 1000.0 period Reading::Wake(MAX), "A later wake-up is a missed deadline: the hand feels the old force for a tick more.";
    "REQ-LAT-005" "jitter_p99_us" "us" 200.0 period Reading::Jitter(0.99), "Velocity is position over period: 20 % of jitter is 20 % of error in damping.";
    "REQ-LAT-006" "work_p99_us" "us" 50.0 period Reading::Work(0.99), "The loop's own work stays under 5 % of the period, so that a late wake-up is all the lateness there is.";
    "REQ-LAT-007" "work_p999_us" "us" 50.0 period Reading::Work(0.999), "The same in the tail.";
    "REQ-LAT-008" "read_to_force_p999_us" "us" 50.0 period Reading::Path(0.999), "From device read to force written: delay that adds to T/2 in every tick.";
    "REQ-LAT-009" "missed_deadlines" "" 0.0 fixed Reading::Missed, "Each is a tick in which the hand felt an old force.";
    "REQ-LAT-010" "overruns" "" 0.0 fixed Reading::Overruns, "A tick that ends after the next one is due has used up its period.";
    "REQ-LAT-011" "tip_to_tissue_p99_us" "us" 10000.0 fixed Reading::TipToTissue(0.99), "The gland answers within two tissue ticks of 5 ms.";
    "REQ-LAT-012" "tip_to_host_p99_us" "us" 15000.0 fixed Reading::TipToHost(0.99), "Touch before sight is noticed from 15 ms on (Di Luca and Mahnan 2019); drawing adds to it.";
    "REQ-LAT-013" "k_max_p999_n_per_m" "N/m" 800.0 fixed Reading::StiffnessMargin(0.999), "The stiffest wall that the device renders (Phantom Premium 1.5) must stay stable; a lower bound.";
    "REQ-RT-001" "heap_calls" "" 0.0 fixed Reading::HeapCalls, "Both loops. The heap locks, and may ask the kernel for memory.";
    "REQ-RT-002" "page_faults" "" 0.0 fixed Reading::PageFaults, "Both loops, after arming: memory is locked and touched before.";
    "REQ-RT-003" "extra_switches" "" 0.0 fixed Reading::ExtraSwitches, "Both loops: voluntary context switches beyond the one sleep a tick show a wait for somebody else.";
    "REQ-RT-004" "recording_p99_us" "us" 1.0 fixed Reading::Recording(0.99), "Measuring must not change what is measured.";
    "REQ-REC-001" "records_missing" "" 0.0 fixed Reading::RecordsMissing, "Every tick has its record, as a host sees it.";
    "REQ-SAFE-001" "faults" "" 0.0 fixed Reading::Faults, "Each is a force that was turned off by the watchdog.";
}

impl LimitSpec {
    fn default_for(&self, period_ns: u64) -> f64 {
        let scale = if self.scales_with_period {
            period_ns as f64 / 1e6
        } else {
            1.0
        };
        self.default * scale
    }

    /// Returns the one limit that is a lower bound.
    fn is_lower_bound(&self) -> bool {
        matches!(self.reading, Reading::StiffnessMargin(_))
    }

    /// True if a virtual machine, or firmware time, affects the reading more than this program does.
    fn is_tail(&self) -> bool {
        match self.reading {
            Reading::Wake(q) | Reading::Work(q) | Reading::Path(q) | Reading::StiffnessMargin(q) => q > 0.995,
            Reading::Missed | Reading::Overruns => true,
            _ => false,
        }
    }
}

/// A limit by its name, with the value in force.
pub type Limits = BTreeMap<&'static str, f64>;

/// Limits that cannot be used; the existing ones follow.
#[derive(Debug, thiserror::Error)]
#[error("{0}\nthe limits are: {names}", names = LIMITS.iter().map(|l| l.name).collect::<Vec<_>>().join(", "))]
pub struct LimitsError(#[from] ProblemList<LimitProblem>);

/// Problem with one `--limit`.
#[derive(Debug, thiserror::Error)]
pub enum LimitProblem {
    /// Its value is not a number of 0 or more.
    #[error("--limit: {0} needs a number of 0 or more")]
    NoNumber(&'static str),
    /// No limit has that name.
    #[error("--limit: no limit is called {0:?}")]
    Unknown(String),
    /// The run would end before anything can be said.
    #[error("--limit: {name} needs a run of {}, this one has {}", duration(*.needs_s), duration(*.has_s))]
    TooShort {
        /// The limit.
        name: &'static str,
        /// Length that its percentile needs, s.
        needs_s: f64,
        /// Length of the run, s.
        has_s: f64,
    },
}

/// Returns the defaults, overridden by the command line.
pub fn limits(period_ns: u64, given: &[String]) -> Result<Limits, LimitsError> {
    let mut limits: Limits = LIMITS.iter().map(|l| (l.name, l.default_for(period_ns))).collect();
    let mut problems = Vec::new();
    for word in given {
        let (name, value) = word.split_once('=').unwrap_or((word, ""));
        let known = LIMITS.iter().find(|l| l.name == name);
        match (known, value.parse().ok().filter(|v: &f64| v.is_finite() && *v >= 0.0)) {
            (Some(spec), Some(value)) => drop(limits.insert(spec.name, value)),
            (Some(spec), None) => problems.push(LimitProblem::NoNumber(spec.name)),
            (None, _) => problems.push(LimitProblem::Unknown(name.to_owned())),
        }
    }
    Ok(ProblemList::check(problems).map(|()| limits)?)
}

/// Checks that a run is long enough for the percentiles that the command line asks for; those of the defaults say in
/// the report how long it must be.
pub fn check_duration(given: &[String], duration_ns: u64, period_ns: u64) -> Result<(), LimitsError> {
    let has_s = duration_ns as f64 / 1e9;
    let too_short = |word: &String| {
        let name = word.split_once('=')?.0;
        let spec = LIMITS.iter().find(|l| l.name == name)?;
        let needs_s = needed(spec.reading.quantile()?) as f64 * spec.reading.period_ns(period_ns) as f64 / 1e9;
        (needs_s > has_s).then_some(LimitProblem::TooShort {
            name: spec.name,
            needs_s,
            has_s,
        })
    };
    Ok(ProblemList::check(given.iter().filter_map(too_short).collect())?)
}

/// Result of one limit, or of all together; the worst is the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Outcome {
    #[serde(rename = "PASS")]
    Pass,
    #[serde(rename = "NOT MEASURABLE")]
    NotMeasurable,
    /// A tail beyond its limit where the environment may be the cause.
    #[serde(rename = "OVER THE LIMIT, CAUSE UNDECIDED")]
    Undecided,
    #[serde(rename = "FAIL")]
    Fail,
}

impl Outcome {
    pub fn words(self) -> &'static str {
        match self {
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::NotMeasurable => "NOT MEASURABLE",
            Self::Undecided => "OVER THE LIMIT, CAUSE UNDECIDED",
        }
    }

    /// Returns the code for the shell: 0, 1, 2.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Pass => 0,
            Self::Fail => 1,
            Self::NotMeasurable | Self::Undecided => 2,
        }
    }
}

/// One limit compared with the measured value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitResult {
    pub id: String,
    pub name: String,
    pub unit: String,
    pub lower_bound: bool,
    pub limit: f64,
    pub value: Option<f64>,
    pub outcome: Outcome,
    pub evidence: String,
    pub reason: String,
}

/// Counts of a run that limits apply to.
pub struct Counted<'a> {
    /// The loops by name, the force loop first.
    pub loops: Vec<(&'static str, &'a LoopCounts)>,
    pub records: u64,
    pub records_missing: u64,
    pub insertions: u64,
    pub faults: &'a [String],
    pub measured_s: f64,
}

/// Compares every limit with the measurement; where the environment is not qualified, the tail of a distribution says
/// nothing about this program.
pub fn evaluate(limits: &Limits, raw: &Raw, counted: &Counted, period_ns: u64, qualified: bool) -> Vec<LimitResult> {
    let evaluate_one = |spec: &LimitSpec| {
        let limit = limits[spec.name];
        let (value, evidence) = read(spec.reading, raw, counted, period_ns);
        let met = value.map(|v| if spec.is_lower_bound() { v >= limit } else { v <= limit });
        let unqualified = spec.is_tail() && !qualified;
        let (outcome, evidence) = match met {
            None => (Outcome::NotMeasurable, evidence),
            Some(true) if unqualified => (Outcome::NotMeasurable, format!("environment not qualified; {evidence}")),
            Some(false) if unqualified => (Outcome::Undecided, format!("environment not qualified; {evidence}")),
            Some(true) => (Outcome::Pass, evidence),
            Some(false) => (Outcome::Fail, evidence),
        };
        LimitResult {
            id: spec.id.to_owned(),
            name: spec.name.to_owned(),
            unit: spec.unit.to_owned(),
            lower_bound: spec.is_lower_bound(),
            limit,
            value,
            outcome,
            evidence,
            reason: spec.reason.to_owned(),
        }
    };
    LIMITS.iter().map(evaluate_one).collect()
}

/// Returns the overall outcome: one failure fails all; otherwise an unmeasurable one leaves it open.
pub fn overall(outcomes: impl Iterator<Item = Outcome>) -> Outcome {
    outcomes.max().unwrap_or(Outcome::NotMeasurable)
}

type Read = (Option<f64>, String);

/// Returns a percentile with its basis; the maximum needs one sample. A run that is too short says how long it must be.
fn percentile(histogram: &Histogram<u64>, quantile: f64, measured_s: f64) -> Read {
    let count = histogram.len();
    if quantile >= MAX {
        let max_us = (count > 0).then(|| histogram.max() as f64 / 1e3);
        return (max_us, format!("largest of {count} samples"));
    }
    match quantile_us(histogram, quantile) {
        Some(us) => (Some(us), format!("{count} samples")),
        None => {
            let needs = needed(quantile);
            // At the rate of this run; without a sample nobody knows.
            let run = (count > 0).then(|| duration(needs as f64 / count as f64 * measured_s));
            let run = run.map_or(String::new(), |run| format!(": a run of {run}"));
            (None, format!("{count} samples, needs {needs}{run}"))
        }
    }
}

fn read(reading: Reading, raw: &Raw, m: &Counted, period_ns: u64) -> Read {
    let force = |what: &str, q| percentile(&raw.get(&format!("haptic/{what}")), q, m.measured_s);
    let counted = |what: fn(&LoopCounts) -> i64| -> Read {
        let counts = || m.loops.iter().map(|(name, counts)| (name, what(counts), counts.ticks));
        let said: Vec<String> = counts()
            .map(|(name, n, ticks)| format!("{name} {n} in {ticks} ticks"))
            .collect();
        (Some(counts().map(|c| c.1 as f64).sum()), said.join(", "))
    };
    let of_ticks = |n: fn(&LoopCounts) -> u64| {
        let first = m.loops.first().map(|(_, counts)| n(counts) as f64);
        (first, format!("{} ticks", raw.get("haptic/wake").len()))
    };
    match reading {
        Reading::Wake(q) => force("wake", q),
        Reading::Work(q) => force("work", q),
        Reading::Path(q) => force("path", q),
        Reading::Jitter(q) => force("jitter", q),
        Reading::Recording(q) => force("recording", q),
        Reading::TipToTissue(q) => percentile(&raw.get("tissue/path"), q, m.measured_s),
        Reading::TipToHost(q) => percentile(&raw.get("host/tip_to_host"), q, m.measured_s),
        Reading::StiffnessMargin(q) => {
            let (delay_us, evidence) = force("due_to_output", q);
            let margin = delay_us.map(|us| stiffness_margin_n_per_m(period_ns, us * 1e3));
            let delay = delay_us.map_or(String::new(), |us| format!(", delay {us:.1} us"));
            (margin, format!("{evidence}{delay}"))
        }
        Reading::Missed => of_ticks(|c| c.missed_deadlines),
        Reading::Overruns => of_ticks(|c| c.overruns),
        Reading::HeapCalls => counted(|c| c.usage.heap_calls as i64),
        Reading::PageFaults => counted(|c| c.usage.minor_faults + c.usage.major_faults),
        Reading::ExtraSwitches => counted(|c| c.voluntary_switches_beyond_sleep),
        Reading::RecordsMissing => (
            Some(m.records_missing as f64),
            format!("{} records seen by the host", m.records),
        ),
        Reading::Faults => {
            let insertions = format!("{} insertions", m.insertions);
            let evidence = [&[insertions], m.faults].concat().join("; ");
            (Some(m.faults.len() as f64), evidence)
        }
    }
}

#[cfg(test)]
mod tests;
