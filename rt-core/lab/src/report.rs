//! The report of a measurement: everything in one record, written as JSON, as a page, and as raw histograms.

mod assemble;
mod derive;

pub use crate::measure::LoopCounts;
pub use assemble::{Parts, report, window_rows};
pub use derive::{contradictions, derive, limits_of};

use crate::bound::MissBound;
use crate::compare::Comparison;
use crate::load::Load;
use crate::noise_section::NoiseSection;
use crate::others::Others;
use crate::paired_section::PairedSection;
use crate::provenance::{Fact, ProgramDigest, Setting};
use crate::spin::SpinSearch;
use crate::stationary::Stationarity;
use crate::summary::Summary;
use crate::trace::TraceSection;
use crate::verdict::{LimitResult, Outcome};
use crate::watch::CoreWatch;
use crate::whose::Whose;
use serde::{Deserialize, Serialize};

/// Version of the format: incremented when a field changes its meaning, or one that `saved` reads is removed.
pub const SCHEMA: &str = "stylet.latency/2";
/// Version before figures could be computed again from the files of the report.
pub const OLD_SCHEMA: &str = "stylet.latency/1";
pub const JSON: &str = "report.json";
pub const PAGE: &str = "report.html";
pub const HISTOGRAMS: &str = "histograms.hlog";
pub const WAKES: &str = "wakes.txt";
/// Files that are computed from the others.
pub const CYCLICTEST: &str = "cyclictest.json";
pub const OSADL: &str = "osadl.svg";
/// Every file of a report but the report, in the order in which it lists them.
pub const FILES: [&str; 5] = [HISTOGRAMS, WAKES, CYCLICTEST, OSADL, PAGE];

/// File in the report's folder, with the digest that `sha256sum` prints.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FileDigest {
    pub name: String,
    pub sha256: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Protocol {
    pub scene: String,
    pub load: Load,
    pub load_is: String,
    pub rate_hz: f64,
    pub tissue_rate_hz: f64,
    /// Rate of the second device's loop, in a run that has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_rate_hz: Option<f64>,
    pub duration_s: f64,
    pub measured_s: f64,
    pub warm_up_s: f64,
    pub spin_us: u64,
    pub insertions: u64,
    /// Length of the windows.
    pub window_s: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LoopSection {
    pub times: Vec<Summary>,
    pub counts: LoopCounts,
    pub miss_bound: MissBound,
    /// Own work at p99.9 as a fraction of the period.
    pub work_p999_of_period: Option<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HostSection {
    pub times: Vec<Summary>,
    pub snapshots: u64,
    pub records: u64,
    pub records_missing: u64,
    pub faults: u64,
    /// Faults as text.
    pub which_faults: Vec<String>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Margin {
    pub at: String,
    pub delay_us: Option<f64>,
    pub k_max_n_per_m: Option<f64>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct StiffnessSection {
    pub rule: String,
    pub hand_damping_n_s_per_m: f64,
    pub law_damping_n_s_per_m: f64,
    pub margins: Vec<Margin>,
}

/// One of the latest wake-ups, and simultaneous observations elsewhere.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Late {
    pub at_s: f64,
    pub wake_us: f64,
    pub work_us: f64,
    pub cause: String,
}

/// The worst of a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowRow {
    /// Seconds into the run; in a campaign, since 1970.
    pub at_s: f64,
    pub worst_wake_us: f64,
    pub worst_work_us: f64,
    pub missed: u32,
    pub overruns: u32,
    pub ticks: u32,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GapSection {
    pub core: Option<usize>,
    pub watched_s: f64,
    pub gaps: u64,
    pub worst_us: Option<f64>,
    pub wake: Summary,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Environment {
    pub qualified: bool,
    pub evidence: Vec<String>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Verdict {
    pub overall: Outcome,
    pub limits: Vec<LimitResult>,
}

/// The whole report, declared in reading order.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    pub schema: String,
    pub sha256: String,
    pub sha256_is_of: String,
    pub files: Vec<FileDigest>,
    pub made_at: String,
    pub program: String,
    pub commit: String,
    pub command: Vec<String>,
    pub whose: Whose,
    /// Challenge of whoever asked for the measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nonce: Option<String>,
    pub programs: Vec<ProgramDigest>,
    pub protocol: Protocol,
    pub verdict: Verdict,
    pub environment: Environment,
    pub haptic: LoopSection,
    pub tissue: LoopSection,
    /// The loop of the second device, in a run that has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<LoopSection>,
    pub host: HostSection,
    pub stiffness: StiffnessSection,
    pub windows: Vec<WindowRow>,
    pub latest_wake_ups: Vec<Late>,
    /// Late ticks with their causes, if a trace was requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trace: Option<TraceSection>,
    /// Wake-ups of the force loop in equal parts of the run.
    pub parts: Vec<Summary>,
    pub stationarity: Stationarity,
    pub gaps: GapSection,
    /// The force loop's core before the loop started.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseSection>,
    pub cores: Vec<CoreWatch>,
    pub others: Others,
    /// Whose the late wake-ups are, if a witness was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paired: Option<PairedSection>,
    pub comparison: Option<Comparison>,
    /// Search for the spin; only with `--spin-us auto`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spin_search: Option<SpinSearch>,
    pub settings: Vec<Setting>,
    pub facts: Vec<Fact>,
}
