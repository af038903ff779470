//! `rt-core doctor --apply`: changes the settings that the doctor names, reversibly, and measures before and after.

mod allowed;
pub(super) mod file;
mod page;
#[cfg(test)]
mod tests;

use super::display;
use super::tunable::{self, Tunable};
use crate::args::duration_ns;
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::{MeasureError, Measured, Setup, measure};
use crate::plots::DrawError;
use crate::summary::{Summary, summary};
use clap::Args;
use file::Changes;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use stylet_runtime::args::{OptionsError, RealTimeArgs};
use stylet_write::{WriteError, write_whole};

const UNDO: &str = "undo.json";
const REPORT: &str = "mend.json";
const PAGE: &str = "mend.html";

/// What the doctor is asked for.
#[derive(Args, Debug)]
pub struct DoctorArgs {
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Core of the force loop [default: the last one]
    #[arg(long, value_name = "N")]
    haptic_core: Option<usize>,
    /// Show which settings of this PC --apply --yes would change, and change none
    ///
    /// Only settings that can be changed while the PC runs are among them: governor, sleep states of the force loop's
    /// core, interrupts on it, display servers that may run on it, watchdogs, statistics, huge pages, PCIe power.
    /// Nothing is kept over a restart.
    #[arg(long, conflicts_with = "undo")]
    apply: bool,
    /// With --apply: change them, measure before and after, and write DIR/undo.json, mend.json and mend.html
    #[arg(long, requires = "apply", requires = "out")]
    yes: bool,
    /// With --apply: folder of the report and of undo.json
    #[arg(long, value_name = "DIR", requires = "apply")]
    out: Option<PathBuf>,
    /// With --apply --yes: how long to measure before, and again after
    #[arg(long, default_value = "30s", value_parser = duration_ns, value_name = "TIME")]
    measure: u64,
    /// Give every setting its value from before, from the undo.json of --apply
    ///
    /// Only settings that --apply makes are undone, from a file that the same user wrote and nobody else can write.
    #[arg(long, value_name = "FILE")]
    undo: Option<PathBuf>,
}

/// Reason why settings were not changed, or not all of them.
#[derive(Debug, thiserror::Error)]
pub enum MendError {
    /// The file of an undo cannot be used.
    #[error("{}: {why}", .path.display())]
    Undo {
        /// The file.
        path: PathBuf,
        /// Problem with it.
        why: String,
    },
    /// The folder holds the data for undoing an earlier change.
    #[error("{} is there already: undo it first, or name another folder", .0.display())]
    NotUndone(PathBuf),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Options of the measurement.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The measurement did not run.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// The folder of the report.
    #[error("cannot make {}: {why}", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the system.
        why: std::io::Error,
    },
    /// A picture of the page.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The report as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// Examines, shows, changes or undoes; 0 when all was done, 1 when there is a blocker or a setting was refused.
///
/// # Errors
/// The measurement does not run, or a file cannot be read or written.
pub fn run(args: &DoctorArgs, interrupted: &AtomicBool) -> Result<u8, MendError> {
    let last = core_affinity::get_core_ids()
        .unwrap_or_default()
        .last()
        .map_or(0, |c| c.id);
    let core = args.haptic_core.unwrap_or(last);
    let machine = Machine::this();
    if let Some(path) = &args.undo {
        let (mut changes, file) = Changes::open_to_undo(path)?;
        changes.undo(&machine);
        changes.rewrite(path, &file)?;
        print!("{}", changes.words());
        return Ok(u8::from(changes.any_refused()));
    }
    if !args.apply {
        return Ok(super::print(args.json, core));
    }
    let mut tunables = tunable::all(&machine, core);
    tunables.extend(display::settings(&machine, core));
    match (&args.out, args.yes) {
        (Some(out), true) => mend(&machine, core, &tunables, out, args.measure, interrupted),
        _ => {
            print!("{}", dry_run(&tunables));
            Ok(0)
        }
    }
}

/// Lists the changes that would be made.
fn dry_run(tunables: &[Tunable]) -> String {
    let open: Vec<&Tunable> = tunables.iter().filter(|t| !t.is_met()).collect();
    if open.is_empty() {
        return format!(
            "nothing to change: all {} settings are as they should be\n",
            tunables.len()
        );
    }
    let mut out = String::new();
    for t in &open {
        out += &format!("{:<16} /{}: {} -> {}\n", t.check, t.path, t.now, t.wanted);
    }
    out + &format!(
        "\n{} of {} settings would change; nothing was changed. To change them, measured before and after:\n  \
         sudo rt-core doctor --apply --yes --out DIR\nTo undo it:\n  sudo rt-core doctor --undo DIR/{UNDO}\n",
        open.len(),
        tunables.len()
    )
}

/// Wake-ups and own work of the force loop in one measurement.
#[derive(Clone, Debug, Serialize)]
pub struct Side {
    pub wake: Summary,
    pub work: Summary,
    pub ticks: u64,
    pub missed_deadlines: u64,
    #[serde(skip)]
    pub wake_times: hdrhistogram::Histogram<u64>,
}

impl Side {
    fn of(measured: &Measured) -> Self {
        let h = &measured.haptic;
        Self {
            wake: summary("wake-up", &h.wake, 1e3),
            work: summary("whole tick", &h.work, 1e3),
            ticks: h.ticks,
            missed_deadlines: h.missed,
            wake_times: h.wake.clone(),
        }
    }
}

/// The report of a change.
#[derive(Serialize)]
pub struct MendReport<'a> {
    pub schema: &'static str,
    pub made_at: String,
    pub program: String,
    pub core: usize,
    pub measured_for_s: f64,
    pub changes: &'a Changes,
    pub before: Side,
    pub after: Side,
}

fn mend(
    machine: &Machine,
    core: usize,
    tunables: &[Tunable],
    out: &Path,
    duration_ns: u64,
    interrupted: &AtomicBool,
) -> Result<u8, MendError> {
    let undo = out.join(UNDO);
    if Changes::read(&undo).is_ok_and(|c| !c.is_undone()) {
        return Err(MendError::NotUndone(undo));
    }
    std::fs::create_dir_all(out).map_err(|why| MendError::Folder {
        folder: out.to_owned(),
        why,
    })?;
    eprintln!("rt-core: measuring for {:.0} s before", duration_ns as f64 / 1e9);
    let before = side(core, duration_ns, out, interrupted)?;
    let mut changes = Changes::planned(tunables);
    // The undo data is on disk before anything changes.
    write_whole(&undo, changes.text().as_bytes())?;
    changes.apply(machine);
    write_whole(&undo, changes.text().as_bytes())?;
    print!("{}", changes.words());
    eprintln!("rt-core: measuring for {:.0} s after", duration_ns as f64 / 1e9);
    let after = side(core, duration_ns, out, interrupted)?;
    let report = MendReport {
        schema: "stylet.mend/1",
        made_at: jiff::Timestamp::now().strftime("%Y-%m-%d %H:%M:%S UTC").to_string(),
        program: format!("rt-core {}", env!("CARGO_PKG_VERSION")),
        core,
        measured_for_s: duration_ns as f64 / 1e9,
        changes: &changes,
        before,
        after,
    };
    let json = serde_json::to_string_pretty(&report)? + "\n";
    write_whole(&out.join(REPORT), json.as_bytes())?;
    let page = page::page(&report)?;
    write_whole(&out.join(PAGE), page.as_bytes())?;
    for (name, ratio) in page::ratios(&report.before.wake, &report.after.wake) {
        println!("wake-up {name}: after over before {ratio}");
    }
    println!("{}", out.join(PAGE).display());
    println!("undo with: sudo rt-core doctor --undo {}", undo.display());
    Ok(u8::from(changes.any_refused()))
}

fn side(core: usize, duration_ns: u64, folder: &Path, interrupted: &AtomicBool) -> Result<Side, MendError> {
    let instance = format!("lab-{}", std::process::id());
    let options = RealTimeArgs::for_measurement(core).options(&instance)?;
    let setup = Setup {
        options: &options,
        duration_ns,
        load: Load::None,
        folder,
        trace_over_ns: None,
        toggle: None,
        checkpoints: None,
    };
    Ok(Side::of(&measure(&setup, interrupted)?))
}
