//! One report over all sessions of a campaign.

use super::CampaignError;
use super::plan::{Part, Plan};
use super::session::{Bins, FORCE, Kept, SessionRecord, Store, TISSUE, join};
use crate::bound::{self, MissBound};
use crate::machine::Machine;
use crate::provenance;
use crate::report::WindowRow;
use crate::summary::{Summary, summary};
use serde::Serialize;

const SCHEMA: &str = "stylet.campaign/1";

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
    pub schema: &'static str,
    pub name: String,
    pub made_at: String,
    pub program: String,
    pub commit: &'static str,
    pub complete: bool,
    pub planned_s: f64,
    pub measured_s: f64,
    pub window_s: f64,
    pub parts: Vec<PartReport>,
    pub sessions: Vec<SessionReport>,
    /// Hypervisor below the loops.
    pub hypervisor: Option<String>,
}

/// Combines all sessions. Sessions that overlap in time are refused: no time may count twice.
pub fn report(plan: &Plan, store: &Store) -> Result<CampaignReport, CampaignError> {
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
        parts.push(PartReport {
            part: *part,
            measured_s: force.iter().map(|r| r.measured_ns as f64 / 1e9).sum(),
            sessions: force.len(),
            complete: store.left_ns(number, part)? == 0,
            maxima: force.iter().flat_map(|r| r.maxima.iter().cloned()).collect(),
            force: one_loop(&force, f64::from(part.rate)),
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
        schema: SCHEMA,
        name: plan.name.clone(),
        made_at: provenance::now(),
        program: provenance::program(),
        commit: provenance::COMMIT,
        complete: parts.iter().all(|p| p.complete),
        planned_s: plan.planned_s(),
        measured_s: parts.iter().map(|p| p.measured_s).sum(),
        window_s: plan.window_ns as f64 / 1e9,
        parts,
        sessions: force.into_iter().map(session).collect(),
        hypervisor: Machine::this().hypervisor(),
    })
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
    let joined = |of: fn(&SessionRecord) -> &Bins| join(sessions.iter().map(of));
    let (ticks, missed) = (sum(|r| r.ticks), sum(|r| r.missed));
    LoopOfPart {
        wake: summary("wake-up", &joined(|r| &r.wake), rate_hz),
        work: summary("whole tick", &joined(|r| &r.work), rate_hz),
        due_to_output: summary("due to output", &joined(|r| &r.due_to_output), rate_hz),
        ticks,
        missed_deadlines: missed,
        overruns: sum(|r| r.overruns),
        unmeasured: sum(|r| r.unmeasured),
        miss_bound: bound::of_misses(missed, ticks + missed, rate_hz),
    }
}
