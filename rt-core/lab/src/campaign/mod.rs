//! `rt-core campaign`: measurements of hours and nights, in parts, that continue after any interruption.
//!
//! The file of a campaign names its parts (`plan`). Each start of the program measures the rest of a part in a separate
//! session, and writes its data every minute (`session`). One report covers all sessions (`report`, `page`). Data after
//! the last checkpoint of a killed session is discarded and measured again.

mod page;
mod plan;
mod progress;
mod report;
mod session;
#[cfg(test)]
mod tests;

use crate::measure::{Checkpoints, MeasureError, Setup, measure, period_ns};
use crate::plots::DrawError;
use clap::Args;
use plan::{Part, Plan};
use progress::Progress;
use session::Store;
use std::fs::File;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_runtime::args::{OptionsError, RealTimeArgs};
use stylet_runtime::process::Options;
use stylet_runtime::rt::clock::Wait;
use stylet_write::{WriteError, write_whole};

const COPY: &str = "campaign.toml";
const LOCK: &str = "campaign.lock";
const REPORT: &str = "campaign.json";
const PAGE: &str = "campaign.html";

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
    /// The file of the campaign, or one of its folder, cannot be read.
    #[error("cannot read {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// All problems with the file, one per line.
    #[error("{0}")]
    Plan(String),
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
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The loops did not run.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// A picture of the page cannot be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The report as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A checkpoint could not be written.
    #[error("{0}")]
    Unwritten(String),
}

/// Measures what is left and writes the report; 0 when the campaign is complete, 2 when it was interrupted before.
///
/// # Errors
/// The file or a checkpoint is invalid, the folder is of another campaign or in use, or the loops do not run.
pub fn run(args: &CampaignArgs, interrupted: &AtomicBool) -> Result<u8, CampaignError> {
    let text = read(&args.file)?;
    let plan = Plan::of(&text).map_err(|problems| CampaignError::Plan(problems.to_string()))?;
    std::fs::create_dir_all(&args.out).map_err(|source| CampaignError::Read {
        path: args.out.clone(),
        source,
    })?;
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
        Err(_) => write_whole(&copy, text.as_bytes())?,
    }
    let store = Store::open(&args.out)?;
    if !args.report {
        // After a restart of the PC, this process may have the number of an earlier session's.
        let options = args.real_time.options(&format!("lab-{}", std::process::id()))?;
        measure_what_is_left(&plan, &store, &options, interrupted)?;
    }
    let report = report::report(&plan, &store)?;
    let page = page::page(&report)?;
    let json = serde_json::to_string_pretty(&report)? + "\n";
    write_whole(&args.out.join(REPORT), json.as_bytes())?;
    write_whole(&args.out.join(PAGE), page.as_bytes())?;
    println!(
        "{} of {} measured in {} sessions",
        progress::time(report.measured_s),
        progress::time(report.planned_s),
        report.sessions.len()
    );
    println!("{}", args.out.join(PAGE).display());
    if report.complete {
        return Ok(0);
    }
    println!("not complete: the same command continues it");
    Ok(2)
}

fn read(path: &Path) -> Result<String, CampaignError> {
    std::fs::read_to_string(path).map_err(|source| CampaignError::Read {
        path: path.to_owned(),
        source,
    })
}

/// Locks the folder until the lock is dropped, or until this process ends.
fn lock(folder: &Path) -> Result<File, CampaignError> {
    let path = folder.join(LOCK);
    let file = File::options().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(|source| CampaignError::Read {
        path: path.clone(),
        source,
    })?;
    // SAFETY: a descriptor that is open.
    match unsafe { libc::flock(file.as_raw_fd(), libc::LOCK_EX | libc::LOCK_NB) } {
        0 => Ok(file),
        _ => Err(CampaignError::InUse(folder.to_owned())),
    }
}

fn measure_what_is_left(
    plan: &Plan,
    store: &Store,
    options: &Options,
    interrupted: &AtomicBool,
) -> Result<(), CampaignError> {
    for (number, part) in plan.parts.iter().enumerate() {
        let left_ns = store.left_ns(number, part)?;
        // SYNC: set by a signal handler; nothing but the flag is carried.
        if left_ns > 0 && !interrupted.load(Ordering::Acquire) {
            session(plan, number, part, left_ns, store, options, interrupted)?;
        }
    }
    Ok(())
}

/// Runs one session: the rest of one part.
fn session(
    plan: &Plan,
    number: usize,
    part: &Part,
    left_ns: u64,
    store: &Store,
    options: &Options,
    interrupted: &AtomicBool,
) -> Result<(), CampaignError> {
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
        take: &|name, timing| writer.put(name, timing, plan.window_ns),
    };
    let setup = Setup {
        options: &options,
        duration_ns: left_ns,
        load: part.load,
        folder: &store.folder,
        trace_over_ns: None,
        toggle: None,
        checkpoints: Some(&checkpoints),
    };
    let ended = AtomicBool::new(false);
    let measured = std::thread::scope(|threads| {
        threads.spawn(|| progress.show(&ended));
        let measured = measure(&setup, interrupted);
        // SYNC: nothing but the flag is carried.
        ended.store(true, Ordering::Release);
        measured
    });
    measured?;
    writer.failed().map_or(Ok(()), |why| Err(CampaignError::Unwritten(why)))
}
