//! `rt-core doctor --apply`: changes the settings that the doctor names, reversibly, and measures before and after.

mod allowed;
mod file;
#[cfg(test)]
mod tests;

use super::tunable::{self, Tunable};
use crate::args::duration_ns;
use crate::collect::LoopTiming;
use crate::disk::{self, DiskError};
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::{MeasureError, Setup, measure};
use crate::summary::{QUANTILES, quantile_us};
use clap::Args;
use file::{Changes, UndoProblem};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use stylet_runtime::args::{OptionsError, RealTimeArgs};
use stylet_write::write_whole;

const UNDO: &str = "undo.json";

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
    /// core, interrupts on it, watchdogs, statistics, huge pages, PCIe power.
    /// Nothing is kept over a restart.
    #[arg(long, conflicts_with = "undo")]
    apply: bool,
    /// With --apply: change them, print the loop's wake-ups before and after, and write DIR/undo.json
    #[arg(long, requires = "apply", requires = "out")]
    yes: bool,
    /// With --apply: folder of undo.json
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
        why: UndoProblem,
    },
    /// The folder holds the data for undoing an earlier change.
    #[error("{} is there already: undo it first, or name another folder", .0.display())]
    NotUndone(PathBuf),
    /// A file cannot be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// Options of the measurement.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The measurement did not run.
    #[error(transparent)]
    Measure(#[from] MeasureError),
}

impl MendError {
    fn of_undo(path: &Path, why: UndoProblem) -> Self {
        let path = path.to_owned();
        Self::Undo { path, why }
    }
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
    let tunables = tunable::all(&machine, core);
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
    disk::make(out)?;
    let put = |changes: &Changes| write_whole(&undo, changes.text().as_bytes()).map_err(DiskError::from);
    let measured = |when: &str| {
        eprintln!("rt-core: measuring for {:.0} s {when}", duration_ns as f64 / 1e9);
        let options = RealTimeArgs::for_measurement(core).options(&format!("lab-{}", std::process::id()))?;
        let setup = Setup::new(&options, duration_ns, Load::None, out);
        Ok::<_, MendError>(measure(&setup, interrupted)?.haptic)
    };
    let before = measured("before")?;
    let mut changes = Changes::planned(tunables);
    // The undo data is on disk before anything changes.
    put(&changes)?;
    changes.apply(machine);
    put(&changes)?;
    print!("{}", changes.words());
    let after = measured("after")?;
    print!("{}", compared(&before, &after));
    println!("undo with: sudo rt-core doctor --undo {}", undo.display());
    Ok(u8::from(changes.any_refused()))
}

/// Compares the wake-ups of two measurements; a percentile that one was too short for is missing.
fn compared(before: &LoopTiming, after: &LoopTiming) -> String {
    let mut out = String::from("\nwake-up, us        before     after     ratio\n");
    let max = |t: &LoopTiming| Some(t.wake.max() as f64 / 1e3).filter(|_| !t.wake.is_empty());
    let quantiles = QUANTILES.map(|(name, q)| (name, quantile_us(&before.wake, q), quantile_us(&after.wake, q)));
    for (name, before, after) in quantiles.into_iter().chain([("max", max(before), max(after))]) {
        if let (Some(before), Some(after)) = (before, after) {
            out += &format!("{name:<14} {before:>10.1} {after:>9.1} {:>9.2}\n", after / before);
        }
    }
    let missed = |t: &LoopTiming| format!("{} of {}", t.missed, t.ticks + t.missed);
    out + &format!("deadlines missed: {} before, {} after\n", missed(before), missed(after))
}
