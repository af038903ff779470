//! Measurements of a session, as written at each checkpoint and read again.

use super::CampaignError;
use super::chain::Chain;
use super::plan::Part;
use crate::collect::LoopTiming;
use crate::disk::{self, DiskError};
use crate::provenance::sha256;
use crate::report::{self, WindowRow};
use crate::sample::{Batched, histogram};
use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Mutex;
use stylet_write::write_whole;

const SCHEMA: &str = "stylet.campaign-session/1";
/// Shortfall with which a part still counts as complete: the run ends between two ticks.
const COMPLETE_NS: u64 = 500_000_000;
/// Names of the loops in file names.
pub const FORCE: &str = "force";
pub const TISSUE: &str = "tissue";

/// A histogram as values and their counts, nanoseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bins(Vec<(u64, u64)>);

impl Bins {
    fn of(h: &Histogram<u64>) -> Self {
        let bins = h.iter_recorded();
        Self(bins.map(|b| (b.value_iterated_to(), b.count_at_value())).collect())
    }

    /// Returns them as a histogram.
    pub fn histogram(&self) -> Histogram<u64> {
        let mut h = histogram();
        for &(value, count) in &self.0 {
            h.saturating_record_n(value, count);
        }
        h
    }
}

fn of_parts(batched: &Batched) -> Vec<Bins> {
    batched.parts.iter().map(Bins::of).collect()
}

/// One loop of one session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SessionRecord {
    schema: String,
    /// Part, and the number of its session, both from 0.
    pub part: usize,
    pub session: usize,
    /// Start of the PC; times below count from it.
    pub boot: String,
    /// Seconds since 1970.
    pub began_s: f64,
    pub first_due_ns: u64,
    pub measured_ns: u64,
    pub ticks: u64,
    pub missed: u64,
    pub overruns: u64,
    pub unmeasured: u64,
    /// Histograms of equal parts of the session, here and below.
    pub wake: Vec<Bins>,
    pub work: Vec<Bins>,
    pub due_to_output: Vec<Bins>,
    pub maxima: Vec<WindowRow>,
}

fn file_name(part: usize, session: usize, name: &str) -> String {
    format!("part-{part:03}-session-{session:03}-{name}.json")
}

impl SessionRecord {
    /// Checks that histograms and windows tell of the same ticks.
    fn consistent(&self) -> Result<(), String> {
        let in_windows = |of: fn(&WindowRow) -> u32| self.maxima.iter().map(|m| u64::from(of(m))).sum::<u64>();
        let in_bins = |bins: &[Bins]| bins.iter().map(|b| b.histogram().len()).sum::<u64>();
        let (wake, work) = (in_bins(&self.wake), in_bins(&self.work));
        for (what, says, is) in [
            ("ticks", self.ticks, wake),
            ("ticks", self.ticks, work),
            ("ticks", self.ticks, in_windows(|m| m.ticks)),
            ("missed", self.missed, in_windows(|m| m.missed)),
            ("overruns", self.overruns, in_windows(|m| m.overruns)),
        ] {
            if says != is {
                return Err(format!(
                    "contradicts itself: {what} {says}, its histograms and windows have {is}"
                ));
            }
        }
        Ok(())
    }

    /// Returns whether both measured the same moment.
    pub fn overlaps(&self, other: &Self) -> bool {
        let end = |r: &Self| r.first_due_ns + r.measured_ns;
        self.boot == other.boot && self.first_due_ns < end(other) && other.first_due_ns < end(self)
    }
}

/// A record with the digest of its file.
#[derive(Clone, Debug)]
pub struct Kept {
    pub file: String,
    pub sha256: String,
    pub record: SessionRecord,
}

/// The folder of a campaign.
pub struct Store {
    pub folder: PathBuf,
}

impl Store {
    /// Returns every session of one loop, in the order in which they were measured.
    pub fn records(&self, name: &str) -> Result<Vec<Kept>, CampaignError> {
        let names = self.files()?.into_iter();
        names
            .filter(|n| n.ends_with(&format!("-{name}.json")))
            .map(|file| self.record(file, name))
            .collect()
    }

    /// Returns the names of all checkpoints.
    pub fn files(&self) -> Result<Vec<String>, DiskError> {
        let entries = std::fs::read_dir(&self.folder).map_err(DiskError::read(&self.folder))?;
        let names = entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names
            .filter(|n| n.starts_with("part-") && n.ends_with(".json"))
            .collect();
        names.sort();
        Ok(names)
    }

    fn record(&self, file: String, name: &str) -> Result<Kept, CampaignError> {
        let path = self.folder.join(&file);
        let text = disk::read_text(&path)?;
        let invalid = |why: String| CampaignError::Checkpoint {
            path: path.clone(),
            why,
        };
        let record: SessionRecord =
            serde_json::from_str(&text).map_err(|e| invalid(format!("not a checkpoint: {e}")))?;
        if record.schema != SCHEMA {
            return Err(invalid(format!("expected schema {SCHEMA}, found {:?}", record.schema)));
        }
        let expected = file_name(record.part, record.session, name);
        if file != expected {
            return Err(invalid(format!("the checkpoint {expected} under another name")));
        }
        record.consistent().map_err(invalid)?;
        Ok(Kept {
            file,
            sha256: sha256(text.as_bytes()),
            record,
        })
    }

    /// Returns the time of `part` that is still to be measured; 0 when it is complete.
    pub fn left_ns(&self, number: usize, part: &Part) -> Result<u64, CampaignError> {
        let kept = self.records(FORCE)?;
        let of_part = kept.iter().filter(|k| k.record.part == number);
        let left_ns = part
            .duration_ns
            .saturating_sub(of_part.map(|k| k.record.measured_ns).sum());
        Ok(if left_ns < COMPLETE_NS { 0 } else { left_ns })
    }

    /// Returns a writer of the next session of a part.
    pub fn begin(&self, part: usize) -> Result<Writer, CampaignError> {
        let mut chain = Chain::read(&self.folder)?;
        chain.settle()?;
        let all = self.records(FORCE)?;
        let before = all
            .iter()
            .filter(|k| k.record.part == part)
            .map(|k| k.record.session + 1);
        let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Ok(Writer {
            folder: self.folder.clone(),
            part,
            session: before.max().unwrap_or(0),
            chain: Mutex::new(chain),
            boot: boot.trim().to_owned(),
            began_s: jiff::Timestamp::now().as_duration().as_secs_f64(),
            failure: Mutex::new(None),
        })
    }
}

/// Writes the checkpoints of a session; each replaces the one before, whole or not at all.
pub struct Writer {
    folder: PathBuf,
    part: usize,
    session: usize,
    boot: String,
    began_s: f64,
    chain: Mutex<Chain>,
    failure: Mutex<Option<DiskError>>,
}

impl Writer {
    /// Writes all that `timing` has gathered.
    pub fn put(&self, name: &str, timing: &LoopTiming, window_ns: u64) {
        if timing.ticks == 0 {
            return;
        }
        let record = self.record(timing, window_ns);
        let file = file_name(self.part, self.session, name);
        let text = serde_json::to_string(&record).unwrap_or_default();
        let mut chain = self.chain.lock().unwrap_or_else(|e| e.into_inner());
        let linked = chain.append(&file, sha256(text.as_bytes()));
        let written = linked.and_then(|()| Ok(write_whole(&self.folder.join(&file), text.as_bytes())?));
        if let Err(why) = written {
            // The measurement continues: the next checkpoint may succeed.
            *self.failure.lock().unwrap_or_else(|e| e.into_inner()) = Some(why);
        }
    }

    fn record(&self, timing: &LoopTiming, window_ns: u64) -> SessionRecord {
        SessionRecord {
            schema: SCHEMA.to_owned(),
            part: self.part,
            session: self.session,
            boot: self.boot.clone(),
            began_s: self.began_s,
            first_due_ns: timing.first_due_ns,
            measured_ns: timing.measured_ns(),
            ticks: timing.ticks,
            missed: timing.missed,
            overruns: timing.overruns,
            unmeasured: timing.lost,
            wake: of_parts(&timing.wake),
            work: of_parts(&timing.work),
            due_to_output: of_parts(&timing.due_to_output),
            maxima: report::window_rows(timing, window_ns, self.began_s),
        }
    }

    /// Returns the reason why a checkpoint could not be written.
    pub fn ended(self) -> Result<(), DiskError> {
        let failure = self.failure.into_inner().unwrap_or_else(|e| e.into_inner());
        failure.map_or(Ok(()), Err)
    }
}
