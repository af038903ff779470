//! `rt-core campaign`: measurements of hours and nights, in parts, that continue after any interruption.
//!
//! The file of a campaign names its parts (`plan`). Each start of the program measures the rest of a part in a separate
//! session, and writes its data every minute (`session`). One report covers all sessions (`report`, `page`). Data after
//! the last checkpoint of a killed session is discarded and measured again.

mod chain;
mod page;
mod plan;
mod report;
mod session;
#[cfg(test)]
mod tests;

use crate::disk::{self, DiskError};
use crate::measure::{Checkpoints, MeasureError, Setup, measure, period_ns};
use crate::plots::DrawError;
use crate::provenance::{COMMIT, sha256};
use crate::report::FileDigest;
use crate::sealed::{self, seal};
use crate::sign::{self, SignError};
use crate::whose::{WhoseArgs, WhoseError};
use chain::{CHAIN, Chain};
use clap::Args;
use plan::{Plan, PlanProblem};
use report::{About, CampaignReport, Said};
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

/// Report of a campaign.
pub(crate) const REPORT: &str = "campaign.json";
const PAGE: &str = "campaign.html";
const COPY: &str = "campaign.toml";
const LOCK: &str = "campaign.lock";

/// A campaign.
#[derive(Args, Debug)]
pub struct CampaignArgs {
    /// The campaign as a TOML file: a `part` for each load, one after the other
    ///
    /// A part needs its duration ("8h"). Its load is one of those of `rt-core latency`, without one nothing; its rate
    /// is in Hz, by default 1000; its spin_us is 0 by default. Before the parts, `repeat` measures the whole list so
    /// many times, `window` is the time of which the worst is drawn, by default "5m", `checkpoint` is how often all
    /// that was measured is written, by default "1m", and `limits` are those other than their defaults, as
    /// "wake_p99_us=300". The same command continues a campaign that was interrupted,
    /// killed, or ended by a restart of the PC; a line `@reboot` in a crontab does so by itself.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Folder of the campaign: its checkpoints, campaign.json and campaign.html
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Make the report of what there is so far, and measure nothing
    #[arg(long)]
    pub report: bool,
    /// Challenge of whoever asks for the campaign: it stands in the report, and its signature covers it
    #[arg(long, value_name = "TEXT")]
    pub nonce: Option<String>,
    #[command(flatten)]
    whose: WhoseArgs,
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
    /// Checkpoints that are not those which were measured.
    #[error("{}: {}", .folder.display(), .problems.join("; "))]
    Altered {
        /// The folder.
        folder: PathBuf,
        /// Every problem.
        problems: Vec<String>,
    },
    /// Operator, site, device or key are invalid.
    #[error(transparent)]
    Whose(#[from] WhoseError),
    /// The report cannot be signed.
    #[error(transparent)]
    Sign(#[from] SignError),
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

/// Measures what is left and writes the report; returns the verdict (0 pass, 1 fail, 2 open), or 2 when the campaign was
/// interrupted.
///
/// # Errors
/// The file or a checkpoint is invalid, the folder is of another campaign, altered or in use, or the loops do not run.
pub fn run(args: &CampaignArgs, interrupted: &AtomicBool) -> Result<u8, CampaignError> {
    let whose = args.whose.read()?;
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
    refuse_altered(&store)?;
    let mut report = report::report(&plan, &store, About::this(whose.clone(), args.nonce.clone()))?;
    println!(
        "{} of {} measured in {} sessions",
        time(report.measured_s),
        time(report.planned_s),
        report.sessions.len()
    );
    let file = args.out.join(REPORT);
    let signature = sign::signature_of(&file);
    if signature.exists() {
        println!("{}: signed already, and not written again", file.display());
    } else {
        write(&args.out, &mut report)?;
        if let Some(key) = whose.sign.filter(|_| report.complete) {
            println!("{}", sign::sign(&file, &key)?.display());
        }
    }
    if report.complete {
        println!("verdict: {}", report.verdict.words());
        return Ok(report.verdict.exit_code());
    }
    println!("not complete: the same command continues it");
    Ok(2)
}

/// Fails if a checkpoint is not as it was written.
fn refuse_altered(store: &Store) -> Result<(), CampaignError> {
    let problems = Chain::read(&store.folder)?.problems(&store.files()?);
    if problems.is_empty() {
        return Ok(());
    }
    Err(CampaignError::Altered {
        folder: store.folder.clone(),
        problems,
    })
}

/// Writes page and report with all digests.
fn write(folder: &Path, report: &mut CampaignReport) -> Result<(), CampaignError> {
    let page = page::page(report)?;
    write_whole(&folder.join(PAGE), page.as_bytes()).map_err(DiskError::from)?;
    for name in [COPY, CHAIN, PAGE] {
        let bytes = disk::read(&folder.join(name)).unwrap_or_default();
        report.files.push(FileDigest {
            name: name.to_owned(),
            sha256: sha256(&bytes),
        });
    }
    let text = seal(&disk::json(report)?);
    write_whole(&folder.join(REPORT), text.as_bytes()).map_err(DiskError::from)?;
    println!("{}\n{}", folder.join(PAGE).display(), folder.join(REPORT).display());
    Ok(())
}

/// Checks a finished campaign: digests, the chain, every figure, and the signature; returns problems and notes.
pub(crate) fn check(folder: &Path, allowed: Option<&Path>) -> Result<(Vec<String>, Vec<String>), DiskError> {
    let file = folder.join(REPORT);
    let text = disk::read_text(&file)?;
    let mut problems = sealed::problems(REPORT, &text, |name| disk::read(&folder.join(name)).ok());
    if let Err(why) = again(folder, &text, &mut problems) {
        problems.push(why.to_string());
    }
    let mut notes = Vec::new();
    match sign::signer(&file, allowed) {
        Ok(note) => notes.push(note),
        Err(problem) => problems.push(problem.to_string()),
    }
    Ok((problems, notes))
}

/// Computes the report again from the checkpoints.
fn again(folder: &Path, text: &str, problems: &mut Vec<String>) -> Result<(), CampaignError> {
    let store = Store {
        folder: folder.to_owned(),
    };
    problems.extend(Chain::read(folder)?.problems(&store.files()?));
    let plan = Plan::of(&disk::read_text(&folder.join(COPY))?)?;
    let said: Said = serde_json::from_str(text).map_err(|e| CampaignError::Checkpoint {
        path: folder.join(REPORT),
        why: format!("not the report of a campaign: {e}"),
    })?;
    let mut again = report::report(&plan, &store, said.about.clone())?;
    (again.sha256, again.files) = (said.sha256, said.files);
    problems.extend(
        sealed::lines(REPORT, text, &disk::json(&again)?)
            .into_iter()
            .take(NAMED),
    );
    if again.about.commit == COMMIT {
        let page = disk::read_text(&folder.join(PAGE))?;
        problems.extend(sealed::other_text(PAGE, &page, &page::page(&again)?));
    }
    Ok(())
}

/// Most lines that are named.
const NAMED: usize = 8;

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
