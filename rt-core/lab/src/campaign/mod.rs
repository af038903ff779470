//! `rt-core campaign`: measurements of hours and nights, in parts, that continue after any interruption.
//!
//! The file of a campaign names its parts (`plan`). Each start of the program measures the rest of a part in a separate
//! session, and writes its data every minute (`session`). One report covers all sessions (`report`, `page`). Data after
//! the last checkpoint of a killed session is discarded and measured again.

mod page;
mod plan;
mod report;
mod session;
#[cfg(test)]
mod tests;

use crate::disk::{self, DiskError};
use crate::measure::{Checkpoints, MeasureError, Setup, measure, period_ns};
use crate::plots::DrawError;
use clap::Args;
use plan::{Plan, PlanProblem};
use session::{FORCE, Store};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_runtime::args::{OptionsError, RealTimeArgs};
use stylet_runtime::process::Options;
use stylet_runtime::rt::clock::Wait;
use stylet_shm_schema::ProblemList;
use stylet_write::write_whole;

const COPY: &str = "campaign.toml";
const LOCK: &str = "campaign.lock";

/// A campaign.
#[derive(Args, Debug)]
pub struct CampaignArgs {
    /// The campaign as a TOML file: a `part` for each load, one after the other
    ///
    /// A part needs its duration ("8h"). Its load is one of those of `rt-core latency`, without one nothing; its rate
    /// is in Hz, by default 1000; its spin_us is 0 by default. Before the parts, `repeat` measures the whole list so
    /// many times, `window` is the time of which the worst is drawn, by default "5m", and `checkpoint` how often all
    /// that was measured is written, by default "1m". The same command continues a campaign that was interrupted,
    /// killed, or ended by a restart of the PC; a line `@reboot` in a crontab does so by itself.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Folder of the campaign: its checkpoints, campaign.json and campaign.html
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Make the report of what there is so far, and measure nothing
    #[arg(long)]
    pub report: bool,
    #[command(flatten)]
    real_time: RealTimeArgs,
}

/// Reason why a campaign does not run.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A file of the campaign cannot be read or written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// All problems with the file.
    #[error(transparent)]
    Plan(#[from] ProblemList<PlanProblem>),
    /// The folder belongs to another campaign.
    #[error("{} holds another campaign: its {COPY} differs from {}; expected the same file, or a new folder", .folder.display(), .file.display())]
    Other {
        /// The folder.
        folder: PathBuf,
        /// The given file.
        file: PathBuf,
    },
    /// The campaign is already running.
    #[error("{} is in use: another rt-core measures this campaign", .0.display())]
    InUse(PathBuf),
    /// A checkpoint that cannot be used.
    #[error("{}: {why}", .path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// Problem with it.
        why: String,
    },
    /// Options of the run.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The loops did not run.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// A picture of the page cannot be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
}

/// Measures what is left and writes the report; 0 when the campaign is complete, 2 when it was interrupted before.
///
/// # Errors
/// The file or a checkpoint is invalid, the folder is of another campaign or in use, or the loops do not run.
pub fn run(args: &CampaignArgs, interrupted: &AtomicBool) -> Result<u8, CampaignError> {
    let text = disk::read_text(&args.file)?;
    let plan = Plan::of(&text)?;
    disk::make(&args.out)?;
    let _lock = lock(&args.out)?;
    let copy = args.out.join(COPY);
    match std::fs::read_to_string(&copy) {
        Ok(before) if before != text => {
            return Err(CampaignError::Other {
                folder: args.out.clone(),
                file: args.file.clone(),
            });
        }
        Ok(_) => {}
        Err(_) => write_whole(&copy, text.as_bytes()).map_err(DiskError::from)?,
    }
    let store = Store {
        folder: args.out.clone(),
    };
    if !args.report {
        // After a restart of the PC, this process may have the number of an earlier session's.
        let options = args.real_time.options(&format!("lab-{}", std::process::id()))?;
        for number in 0..plan.parts.len() {
            // SYNC: set by a signal handler; nothing but the flag is carried.
            if !interrupted.load(Ordering::Acquire) {
                measure_part(&plan, number, &store, &options, interrupted)?;
            }
        }
    }
    let report = report::report(&plan, &store)?;
    println!(
        "{} of {} measured in {} sessions",
        time(report.measured_s),
        time(report.planned_s),
        report.sessions.len()
    );
    disk::write_report(&args.out, "campaign", &report, &page::page(&report)?)?;
    if report.complete {
        return Ok(0);
    }
    println!("not complete: the same command continues it");
    Ok(2)
}

/// Formats seconds, such as `7h 5m 10s`.
fn time(seconds: f64) -> String {
    format!("{:#}", jiff::SignedDuration::from_secs(seconds.max(0.0).round() as i64))
}

/// Locks the folder until the lock is dropped, or until this process ends.
fn lock(folder: &Path) -> Result<File, CampaignError> {
    let path = folder.join(LOCK);
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(DiskError::read(&path))?;
    file.try_lock().map_err(|_| CampaignError::InUse(folder.to_owned()))?;
    Ok(file)
}

/// Measures the rest of one part in one session; prints a line at each checkpoint.
fn measure_part(
    plan: &Plan,
    number: usize,
    store: &Store,
    options: &Options,
    interrupted: &AtomicBool,
) -> Result<(), CampaignError> {
    let part = &plan.parts[number];
    let left_ns = store.left_ns(number, part)?;
    if left_ns == 0 {
        return Ok(());
    }
    let writer = store.begin(number)?;
    let progress = Progress::new(plan, store, number, left_ns)?;
    let options = Options {
        haptic_period_ns: period_ns(part.rate),
        wait: Wait {
            spin_ns: part.spin_us * 1_000,
            ..Wait::at_period(period_ns(part.rate))
        },
        ..options.clone()
    };
    let checkpoints = Checkpoints {
        every: Duration::from_nanos(plan.checkpoint_ns),
        window_ns: plan.window_ns,
        take: &|name, timing| {
            writer.put(name, timing, plan.window_ns);
            if name == FORCE {
                eprintln!("rt-core: {}", progress.line(timing.measured_ns() as f64 / 1e9));
            }
        },
    };
    let setup = Setup {
        checkpoints: Some(&checkpoints),
        ..Setup::new(&options, left_ns, part.load, &store.folder)
    };
    measure(&setup, interrupted)?;
    Ok(writer.ended()?)
}

/// One session within its campaign.
struct Progress {
    part: String,
    left_s: f64,
    /// Time measured before this session began, and total planned time.
    before_s: f64,
    planned_s: f64,
}

impl Progress {
    fn new(plan: &Plan, store: &Store, number: usize, left_ns: u64) -> Result<Self, CampaignError> {
        let mut before_s = 0.0;
        for (i, part) in plan.parts.iter().enumerate() {
            before_s += (part.duration_ns - store.left_ns(i, part)?) as f64 / 1e9;
        }
        let part = &plan.parts[number];
        Ok(Self {
            part: format!("part {} of {} ({})", number + 1, plan.parts.len(), part.name()),
            left_s: left_ns as f64 / 1e9,
            before_s,
            planned_s: plan.planned_s(),
        })
    }

    /// Returns the line after `passed_s` of the session.
    fn line(&self, passed_s: f64) -> String {
        let done_s = self.before_s + passed_s.min(self.left_s);
        format!(
            "{}: {} left; campaign {:.0} %, {} left",
            self.part,
            time(self.left_s - passed_s),
            (100.0 * done_s / self.planned_s).floor(),
            time(self.planned_s - done_s)
        )
    }
}
