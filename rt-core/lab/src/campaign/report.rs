//! One report over all sessions of a campaign.

use super::CampaignError;
use super::chain::Chain;
use super::plan::{Part, Plan};
use super::session::{Bins, FORCE, Kept, SessionRecord, Store, TISSUE};
use crate::bound::{self, MissBound};
use crate::machine::Machine;
use crate::measure::{LoopCounts, period_ns};
use crate::provenance;
use crate::raw::Raw;
use crate::report::{FileDigest, WindowRow};
use crate::sample::histogram;
use crate::sealed::NO_DIGEST;
use crate::summary::{Summary, summary};
use crate::verdict::{self, Counted, LimitResult, Outcome};
use crate::whose::Whose;
use serde::{Deserialize, Serialize};

const SCHEMA: &str = "stylet.campaign/2";
/// Limits of the figures that a campaign keeps.
const JUDGED: [&str; 9] = [
    "wake_p50_us",
    "wake_p99_us",
    "wake_p999_us",
    "wake_max_us",
    "work_p99_us",
    "work_p999_us",
    "missed_deadlines",
    "overruns",
    "k_max_p999_n_per_m",
];

/// Everything measured of one loop in one part.
#[derive(Clone, Debug, Serialize)]
pub struct LoopOfPart {
    pub wake: Summary,
    pub work: Summary,
    pub due_to_output: Summary,
    pub ticks: u64,
    pub missed_deadlines: u64,
    pub overruns: u64,
    pub unmeasured: u64,
    pub miss_bound: MissBound,
}

#[derive(Clone, Debug, Serialize)]
pub struct PartReport {
    pub part: Part,
    pub measured_s: f64,
    pub sessions: usize,
    pub complete: bool,
    pub limits: Vec<LimitResult>,
    pub force: LoopOfPart,
    pub tissue: LoopOfPart,
    /// The worst of each window of the force loop, in the order of time.
    pub maxima: Vec<WindowRow>,
}

/// A session with its file.
#[derive(Clone, Debug, Serialize)]
pub struct SessionReport {
    pub file: String,
    pub sha256: String,
    pub part: usize,
    pub began_s: f64,
    pub measured_s: f64,
    /// Start of the PC.
    pub boot: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct CampaignReport {
    pub schema: String,
    pub sha256: String,
    pub sha256_is_of: String,
    pub files: Vec<FileDigest>,
    /// Last digest of the chain of checkpoints.
    pub chain: String,
    pub name: String,
    #[serde(flatten)]
    pub about: About,
    pub verdict: Outcome,
    pub complete: bool,
    pub planned_s: f64,
    pub measured_s: f64,
    pub window_s: f64,
    pub parts: Vec<PartReport>,
    pub sessions: Vec<SessionReport>,
}

/// Who made the report of a campaign, and where; not measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct About {
    pub made_at: String,
    pub program: String,
    pub commit: String,
    pub whose: Whose,
    /// Challenge of whoever asked for the campaign.
    pub nonce: Option<String>,
    /// Hypervisor below the loops.
    pub hypervisor: Option<String>,
}

/// What a saved report of a campaign says, and its checkpoints do not determine.
#[derive(Debug, Deserialize)]
pub struct Said {
    pub sha256: String,
    pub files: Vec<FileDigest>,
    #[serde(flatten)]
    pub about: About,
}

impl About {
    /// Returns what holds of this program and PC.
    pub fn this(whose: Whose, nonce: Option<String>) -> Self {
        Self {
            made_at: provenance::now(),
            program: provenance::program(),
            commit: provenance::COMMIT.to_owned(),
            whose,
            nonce,
            hypervisor: Machine::this().hypervisor(),
        }
    }
}

/// Combines all sessions. Sessions that overlap in time are refused: no time may count twice.
pub fn report(plan: &Plan, store: &Store, about: About) -> Result<CampaignReport, CampaignError> {
    let (force, tissue) = (store.records(FORCE)?, store.records(TISSUE)?);
    for sessions in [&force, &tissue] {
        disjoint(store, sessions)?;
    }
    let mut parts = Vec::new();
    for (number, part) in plan.parts.iter().enumerate() {
        let of_part = |all: &'_ [Kept]| -> Vec<SessionRecord> {
            all.iter()
                .map(|k| &k.record)
                .filter(|record| record.part == number)
                .cloned()
                .collect()
        };
        let (force, tissue) = (of_part(&force), of_part(&tissue));
        let of_force = one_loop(&force, f64::from(part.rate));
        parts.push(PartReport {
            limits: limits(plan, part, &force, &of_force, about.hypervisor.is_none()),
            part: *part,
            measured_s: force.iter().map(|r| r.measured_ns as f64 / 1e9).sum(),
            sessions: force.len(),
            complete: store.left_ns(number, part)? == 0,
            maxima: force.iter().flat_map(|r| r.maxima.iter().cloned()).collect(),
            force: of_force,
            tissue: one_loop(&tissue, 1e9 / stylet_runtime::rt::clock::TISSUE_PERIOD_NS as f64),
        });
    }
    let session = |Kept { file, sha256, record }: Kept| SessionReport {
        file,
        sha256,
        part: record.part,
        began_s: record.began_s,
        measured_s: record.measured_ns as f64 / 1e9,
        boot: record.boot,
    };
    Ok(CampaignReport {
        schema: SCHEMA.to_owned(),
        sha256: NO_DIGEST.to_owned(),
        sha256_is_of: "this file, with the 64 digits of sha256 as zeros".to_owned(),
        files: Vec::new(),
        chain: Chain::read(&store.folder)?.head,
        name: plan.name.clone(),
        about,
        verdict: verdict::overall(parts.iter().flat_map(|p| &p.limits).map(|l| l.outcome)),
        complete: parts.iter().all(|p| p.complete),
        planned_s: plan.planned_s(),
        measured_s: parts.iter().map(|p| p.measured_s).sum(),
        window_s: plan.window_ns as f64 / 1e9,
        parts,
        sessions: force.into_iter().map(session).collect(),
    })
}

/// Compares the force loop of one part with its limits.
fn limits(
    plan: &Plan,
    part: &Part,
    sessions: &[SessionRecord],
    force: &LoopOfPart,
    qualified: bool,
) -> Vec<LimitResult> {
    let period_ns = period_ns(part.rate);
    // The plan was checked as it was read.
    let limits = verdict::limits(period_ns, &plan.limits).unwrap_or_default();
    let whole = |name: &str, of: fn(&SessionRecord) -> &Vec<Bins>| {
        let mut whole = histogram();
        sessions.iter().flat_map(of).for_each(|bins| whole += bins.histogram());
        (format!("haptic/{name}"), whole)
    };
    let raw = Raw::with(vec![
        whole("wake", |r| &r.wake),
        whole("work", |r| &r.work),
        whole("due_to_output", |r| &r.due_to_output),
    ]);
    let counts = LoopCounts {
        ticks: force.ticks,
        missed_deadlines: force.missed_deadlines,
        overruns: force.overruns,
        ..LoopCounts::default()
    };
    let counted = Counted {
        loops: vec![("haptic", &counts)],
        records: 0,
        records_missing: 0,
        insertions: 0,
        faults: &[],
        measured_s: sessions.iter().map(|r| r.measured_ns as f64 / 1e9).sum(),
    };
    let all = verdict::evaluate(&limits, &raw, &counted, period_ns, qualified);
    all.into_iter().filter(|l| JUDGED.contains(&l.name.as_str())).collect()
}

fn disjoint(store: &Store, sessions: &[Kept]) -> Result<(), CampaignError> {
    for (i, a) in sessions.iter().enumerate() {
        if let Some(b) = sessions[..i].iter().find(|b| a.record.overlaps(&b.record)) {
            return Err(CampaignError::Checkpoint {
                path: store.folder.join(&a.file),
                why: format!("measured at the same time as {}: it would count twice", b.file),
            });
        }
    }
    Ok(())
}

fn one_loop(sessions: &[SessionRecord], rate_hz: f64) -> LoopOfPart {
    let sum = |of: fn(&SessionRecord) -> u64| sessions.iter().map(of).sum::<u64>();
    let joined = |name: &str, of: fn(&SessionRecord) -> &Vec<Bins>| {
        let parts: Vec<_> = sessions.iter().flat_map(of).map(Bins::histogram).collect();
        let mut whole = histogram();
        parts.iter().for_each(|part| whole += part);
        summary(name, &whole, &parts, rate_hz)
    };
    let (ticks, missed) = (sum(|r| r.ticks), sum(|r| r.missed));
    LoopOfPart {
        wake: joined("wake-up", |r| &r.wake),
        work: joined("whole tick", |r| &r.work),
        due_to_output: joined("due to output", |r| &r.due_to_output),
        ticks,
        missed_deadlines: missed,
        overruns: sum(|r| r.overruns),
        unmeasured: sum(|r| r.unmeasured),
        miss_bound: bound::of_misses(missed, ticks + missed, rate_hz),
    }
}
