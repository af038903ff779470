//! Our wake-up latency, alternating with a reference: that of `cyclictest` on the same core with the same priority and
//! interval, or our own without the load.

use crate::load::{Load, LoadError, Running};
use crate::measure::{MeasureError, Measured, Setup, measure};
use crate::sample::histogram;
use crate::summary::quantile_us;
use clap::ValueEnum;
use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_runtime::process::Options;

/// Each turn brings p99.9 with ten samples beyond it at 1 kHz.
const SHORTEST_TURN_NS: u64 = 11_000_000_000;
/// A turn with or without the trace: p99 with ten samples beyond it at 1 kHz.
const SHORTEST_TRACED_TURN_NS: u64 = 2_000_000_000;
/// Bins of 1 ns; of latencies above a millisecond only the number and the maximum are known.
const BINS: u64 = 1_000_000;
const COMPARED: [(&str, f64); 4] = [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("max", 1.0)];

/// Reference that our loops are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Against {
    /// `cyclictest` (Debian package rt-tests) under the same load: same core, priority and interval
    Cyclictest,
    /// The same loops without the load
    Unloaded,
    /// The same loops without the trace of --trace
    Untraced,
}

impl Against {
    pub fn name(self) -> &'static str {
        match self {
            Self::Cyclictest => "cyclictest",
            Self::Unloaded => "without the load",
            Self::Untraced => "without the trace",
        }
    }

    /// Returns the heading of the comparison.
    pub fn title(self) -> &'static str {
        match self {
            Self::Cyclictest => "Beside cyclictest",
            Self::Unloaded => "With and without the load",
            Self::Untraced => "What tracing costs",
        }
    }

    /// Returns the words for both sides.
    pub fn sides(self) -> [&'static str; 2] {
        match self {
            Self::Cyclictest => ["ours", "cyclictest's"],
            Self::Unloaded => ["with the load", "without it"],
            Self::Untraced => ["with the trace", "without it"],
        }
    }
}

/// Wake-up latency of one turn, microseconds, in the order of the comparison's `names`.
pub type Turn = [Option<f64>; COMPARED.len()];

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Round {
    pub ours_us: Turn,
    pub others_us: Turn,
    pub ratio: Turn,
}

/// Result of the turns, or the reason why there were none.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Comparison {
    pub against: Against,
    /// Version of the other program; empty where it is this one.
    pub tool: String,
    /// Reason why nothing could be compared.
    pub absent: Option<String>,
    pub names: [String; COMPARED.len()],
    pub turn_s: f64,
    pub rounds: Vec<Round>,
    /// Ours divided by the reference; below 1 ours is earlier.
    pub median_ratio: Turn,
    /// All turns together, for the picture.
    #[serde(skip, default = "histogram")]
    pub ours: Histogram<u64>,
    #[serde(skip, default = "histogram")]
    pub others: Histogram<u64>,
}

/// Reason why there is no comparison.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// Our side.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// Load during the other side's turn.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The other side.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// There is nothing to compare with.
    #[error("--compare: {0}")]
    Impossible(String),
    /// Histograms of different bins; a bug.
    #[error("histograms: {0}")]
    Histograms(String),
}

/// Reason why cyclictest gave no histogram.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// It is not installed.
    #[error("cyclictest is not installed: sudo apt-get install rt-tests")]
    Missing,
    /// It does not start, or cannot be waited for.
    #[error("cyclictest: {0}")]
    Run(#[from] io::Error),
    /// It failed; the first line of its output.
    #[error("cyclictest failed: {0}")]
    Failed(String),
    /// It ended without an error, but without a histogram in its file.
    #[error("cyclictest wrote no histogram")]
    NoHistogram,
    /// A signal asked this program to end.
    #[error("interrupted")]
    Interrupted,
}

/// Returns why there is nothing to compare with.
pub fn impossible(setup: &Setup, against: Against) -> Option<String> {
    match (against, setup.load) {
        (Against::Untraced, _) if setup.trace_over_ns.is_none() => {
            Some("there is no trace to compare with; give --trace".to_owned())
        }
        (Against::Cyclictest, Load::Window) => {
            Some("the window draws nothing without our loops; give --compare unloaded".to_owned())
        }
        (Against::Cyclictest, _) if version().is_none() => Some(ToolError::Missing.to_string()),
        (Against::Unloaded, Load::None) => Some("there is no load to compare with; give --load".to_owned()),
        _ => None,
    }
}

/// Measures our loops and the other side alternately, `rounds` times each, where that is not [`impossible`].
pub fn compare(
    setup: &Setup,
    against: Against,
    rounds: u32,
    interrupted: &AtomicBool,
) -> Result<Comparison, CompareError> {
    let turn_ns = match against {
        Against::Untraced => (setup.duration_ns / 4 / u64::from(rounds)).max(SHORTEST_TRACED_TURN_NS),
        _ => (setup.duration_ns / u64::from(rounds)).max(SHORTEST_TURN_NS),
    };
    let mut comparison = Comparison {
        against,
        absent: None,
        tool: match against {
            Against::Cyclictest => version().unwrap_or_default(),
            Against::Unloaded | Against::Untraced => String::new(),
        },
        names: COMPARED.map(|(name, _)| name.to_owned()),
        turn_s: turn_ns as f64 / 1e9,
        rounds: Vec::new(),
        median_ratio: [None; COMPARED.len()],
        ours: histogram(),
        others: histogram(),
    };
    let setup = Setup {
        // Only the cost of the trace is measured with the trace.
        trace_over_ns: setup.trace_over_ns.filter(|_| against == Against::Untraced),
        ..Setup::new(setup.options, turn_ns, setup.load, setup.folder)
    };
    for _ in 0..rounds {
        let measured: Measured = measure(&setup, interrupted)?;
        let ours = &measured.haptic.wake.whole;
        let others = match against {
            Against::Cyclictest => cyclictest(&setup, interrupted),
            Against::Unloaded => without(&setup, Load::None, interrupted),
            Against::Untraced => without(&setup, setup.load, interrupted),
        };
        let others = match others {
            Ok(others) => others,
            Err(why) => {
                comparison.absent = Some(why.to_string());
                break;
            }
        };
        comparison.rounds.push(round(ours, &others));
        let joined = comparison.ours.add(ours).and(comparison.others.add(&others));
        joined.map_err(|e| CompareError::Histograms(format!("{e:?}")))?;
        // SYNC: set by a signal handler; nothing but the flag is carried.
        if interrupted.load(Ordering::Acquire) {
            break;
        }
    }
    comparison.set_ratios();
    Ok(comparison)
}

impl Comparison {
    /// Computes all ratios from the times of both sides.
    pub fn set_ratios(&mut self) {
        for round in &mut self.rounds {
            round.ratio = ratio(&round.ours_us, &round.others_us);
        }
        self.median_ratio = std::array::from_fn(|i| median(self.rounds.iter().filter_map(|r| r.ratio[i])));
    }
}

/// Runs our loops under `load`, without a trace.
fn without(setup: &Setup, load: Load, interrupted: &AtomicBool) -> Result<Histogram<u64>, CompareError> {
    let setup = Setup {
        load,
        trace_over_ns: None,
        ..*setup
    };
    Ok(measure(&setup, interrupted)?.haptic.wake.whole)
}

fn turn(histogram: &Histogram<u64>) -> Turn {
    COMPARED.map(|(_, q)| {
        if q < 1.0 {
            // A value past the last bin of cyclictest cannot be compared.
            quantile_us(histogram, q).filter(|us| *us < BINS as f64 / 1e3)
        } else {
            (!histogram.is_empty()).then(|| histogram.max() as f64 / 1e3)
        }
    })
}

fn round(ours: &Histogram<u64>, others: &Histogram<u64>) -> Round {
    let (ours_us, others_us) = (turn(ours), turn(others));
    Round {
        ratio: ratio(&ours_us, &others_us),
        ours_us,
        others_us,
    }
}

fn ratio(ours_us: &Turn, others_us: &Turn) -> Turn {
    std::array::from_fn(|i| ours_us[i].zip(others_us[i]).map(|(a, b)| a / b))
}

/// Returns the median; of an even number of values, the mean of both in the middle.
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    let n = all.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(all[n / 2]),
        _ => Some((all[n / 2 - 1] + all[n / 2]) / 2.0),
    }
}

/// Returns the first line of its help; `None` if it is not installed.
fn version() -> Option<String> {
    let output = Command::new("cyclictest").arg("--help").output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    text.lines()
        .find(|l| l.contains("cyclictest"))
        .map(|l| l.trim().to_owned())
}

/// Runs one turn of cyclictest.
pub fn cyclictest_turn(setup: &Setup, interrupted: &AtomicBool) -> Result<Histogram<u64>, CompareError> {
    version().ok_or(ToolError::Missing)?;
    cyclictest(setup, interrupted)
}

fn cyclictest(setup: &Setup, interrupted: &AtomicBool) -> Result<Histogram<u64>, CompareError> {
    let load = Running::start(setup.load, &setup.options.instance, setup.folder)?;
    let file = setup.folder.join("cyclictest.tmp");
    let mut child = Command::new("cyclictest")
        .args(arguments(setup.options, setup.duration_ns, &file))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(ToolError::from)?;
    let ended = wait(&mut child, interrupted);
    drop(load);
    // The ui load was in shared memory, and no core could clean up after it.
    setup.options.instance.sweep();
    let text = std::fs::read_to_string(&file).unwrap_or_default();
    let _ = std::fs::remove_file(&file);
    ended?;
    Ok(read(&text).ok_or(ToolError::NoHistogram)?)
}

fn arguments(options: &Options, duration_ns: u64, file: &Path) -> Vec<String> {
    let mut arguments: Vec<String> = ["-q", "-m", "-N", "-t", "1"].map(str::to_owned).to_vec();
    let mut add = |flag: &str, value: u64| arguments.extend([flag.to_owned(), value.to_string()]);
    add("-i", options.haptic_period_ns / 1_000);
    add("-l", duration_ns / options.haptic_period_ns);
    add("-h", BINS);
    if !options.no_rt {
        add("-p", u64::from(options.haptic_priority));
    }
    if let Some(core) = options.haptic_core {
        add("-a", core as u64);
    }
    arguments.push(format!("--histfile={}", file.display()));
    arguments
}

fn wait(child: &mut Child, interrupted: &AtomicBool) -> Result<(), ToolError> {
    loop {
        match child.try_wait()? {
            Some(status) if status.success() => return Ok(()),
            Some(_) => {
                let said = child
                    .stderr
                    .take()
                    .map(io::read_to_string)
                    .transpose()?
                    .unwrap_or_default();
                let first = said.lines().next().unwrap_or("no reason given");
                return Err(ToolError::Failed(first.to_owned()));
            }
            None => {}
        }
        // SYNC: set by a signal handler; nothing but the flag is carried.
        if interrupted.load(Ordering::Acquire) {
            let _ = child.kill();
            let _ = child.wait();
            return Err(ToolError::Interrupted);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Bins of one nanosecond, then the maximum and what lies past the last bin.
fn read(text: &str) -> Option<Histogram<u64>> {
    let mut h = histogram();
    let (mut max_ns, mut past) = (0, 0);
    for line in text.lines() {
        if let Some(value) = line.strip_prefix("# Max Latencies:") {
            max_ns = value.trim().parse().ok()?;
        } else if let Some(value) = line.strip_prefix("# Histogram Overflows:") {
            past = value.trim().parse().ok()?;
        } else if let Some((ns, count)) = line.split_once(char::is_whitespace)
            && let (Ok(ns), Ok(count)) = (ns.parse::<u64>(), count.trim().parse::<u64>())
            && count > 0
        {
            h.saturating_record_n(ns, count);
        }
    }
    h.saturating_record_n(max_ns, past);
    (!h.is_empty()).then_some(h)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histogram_of_cyclictest_is_read_with_what_lies_past_its_end() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n014000 000600\n020000 000399\n# Total: 000000999\n\
                    # Min Latencies: 14000\n# Avg Latencies: 15000\n# Max Latencies: 4862000\n# Histogram Overflows: 00001\n";
        let h = read(text).expect("a histogram");
        assert_eq!(h.len(), 1_000);
        assert_eq!(h.value_at_quantile(0.5), h.highest_equivalent(14_000));
        assert_eq!(h.max(), h.highest_equivalent(4_862_000));
        assert!(read("# no bins\n").is_none());
    }

    #[test]
    fn ratio_is_ours_over_theirs_and_the_median_forgives_one_bad_round() {
        let (mut ours, mut theirs) = (histogram(), histogram());
        ours.record_n(12_000, 2_000).expect("in range");
        theirs.record_n(10_000, 2_000).expect("in range");
        let r = round(&ours, &theirs);
        assert!(r.ratio[0].is_some_and(|x| (x - 1.2).abs() < 2e-3));
        // 2,000 samples are too few for p99.9.
        assert_eq!(r.ratio[2], None);
        assert_eq!(median([1.0, 9.0, 1.1].into_iter()), Some(1.1));
        assert_eq!(median([1.0, 2.0].into_iter()), Some(1.5));
        assert_eq!(median(std::iter::empty()), None);
    }
}
