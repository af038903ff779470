//! Measurements of a session, as written at each checkpoint and read again.

use super::CampaignError;
use super::plan::Part;
use crate::collect::LoopTiming;
use crate::disk::{self, DiskError};
use crate::provenance::sha256;
use crate::report::{self, WindowRow};
use crate::sample::histogram;
use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Mutex;
use stylet_write::{WriteError, write_whole};

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

    /// Adds them to a histogram.
    fn add_to(&self, h: &mut Histogram<u64>) {
        for &(value, count) in &self.0 {
            h.saturating_record_n(value, count);
        }
    }
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
    pub wake: Bins,
    pub work: Bins,
    pub due_to_output: Bins,
    pub maxima: Vec<WindowRow>,
}

impl SessionRecord {
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
        let ending = format!("-{name}.json");
        let entries = std::fs::read_dir(&self.folder).map_err(DiskError::read(&self.folder))?;
        let names = entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names
            .filter(|n| n.starts_with("part-") && n.ends_with(&ending))
            .collect();
        names.sort();
        names.into_iter().map(|file| self.record(file)).collect()
    }

    fn record(&self, file: String) -> Result<Kept, CampaignError> {
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
    failure: Mutex<Option<WriteError>>,
}

impl Writer {
    /// Writes all that `timing` has gathered.
    pub fn put(&self, name: &str, timing: &LoopTiming, window_ns: u64) {
        if timing.ticks == 0 {
            return;
        }
        let record = self.record(timing, window_ns);
        let path = self
            .folder
            .join(format!("part-{:03}-session-{:03}-{name}.json", self.part, self.session));
        let text = serde_json::to_string(&record).unwrap_or_default();
        if let Err(why) = write_whole(&path, text.as_bytes()) {
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
            wake: Bins::of(&timing.wake),
            work: Bins::of(&timing.work),
            due_to_output: Bins::of(&timing.due_to_output),
            maxima: report::window_rows(timing, window_ns, self.began_s),
        }
    }

    /// Returns the reason why a checkpoint could not be written.
    pub fn ended(self) -> Result<(), DiskError> {
        let failure = self.failure.into_inner().unwrap_or_else(|e| e.into_inner());
        failure.map_or(Ok(()), |why| Err(why.into()))
    }
}

/// Joins all of `bins` into one histogram.
pub fn join<'a>(bins: impl Iterator<Item = &'a Bins>) -> Histogram<u64> {
    let mut joined = histogram();
    bins.for_each(|b| b.add_to(&mut joined));
    joined
}
