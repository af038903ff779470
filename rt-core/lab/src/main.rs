//! `stylet-lab`: measures how late the loops are on this machine, and what can be done about it.

use clap::{CommandFactory, Parser, Subcommand};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use stylet_lab::load::{self, LoadProcess};
use stylet_lab::{campaign, cost, credibility, doctor, fleet, latency, verify};
use stylet_manual::ManualArgs;
use stylet_runtime::args::scenes;
use stylet_runtime::process::limits;
use stylet_runtime::signals::{follow_parent, stop_flag};
use stylet_shm_schema::BUILTIN_SCENES;
use stylet_sim::scene::Scene;

/// Latency laboratory of Stylet: runs the real loops under load and documents their lateness.
///
/// `rt-core latency` and `stylet-lab latency` are the same command, and so are the others.
#[derive(Parser, Debug)]
#[command(name = "stylet-lab", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// Measure how late the loops are on this machine, and write a report with a verdict
    Latency(Box<stylet_lab::args::LatencyArgs>),
    /// Measure for hours or nights, load after load, and continue after whatever ended it; one report over all of it
    Campaign(Box<campaign::CampaignArgs>),
    /// Verify that a saved latency report is unaltered, who signed it, and which programs it is of
    Verify(verify::VerifyArgs),
    /// Compare the latency reports of many PCs: who passes, how each changed and what changed with it; a page and a CSV
    /// table
    Fleet(fleet::FleetArgs),
    /// Write the file that an auditor asks for: purpose, hazards, requirements with their tests and runs, packages and
    /// licences
    Credibility(credibility::CredibilityArgs),
    /// Check whether this PC is fit for the force loop, and what to change; change it, measured before and after; undo
    /// it
    Doctor(doctor::DoctorArgs),
    /// Measure what each part of a scene costs in a tissue tick
    Cost {
        /// Built-in scene
        #[arg(long, default_value = BUILTIN_SCENES[0], value_parser = scenes())]
        scene: String,
    },
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
    /// Remove the trace instance NAME once the input ends; started by `latency --trace`
    #[command(hide = true)]
    TraceKeeper {
        /// Instance of tracefs
        name: String,
    },
    /// One process of a load; started by `latency`
    #[command(hide = true)]
    Load {
        /// What to do
        work: LoadProcess,
        /// Core on which to do it
        #[arg(long)]
        core: Option<usize>,
        /// File that the load may write
        #[arg(long)]
        file: PathBuf,
    },
}

fn main() -> ExitCode {
    stylet_runtime::environment::cleanse();
    let cli = Cli::parse();
    if matches!(
        cli.task,
        Task::Verify(_) | Task::Fleet(_) | Task::Credibility(_) | Task::Cost { .. }
    ) {
        stylet_manual::end_with_reader();
    }
    limits::raise();
    match carry_out(&cli.task) {
        Ok(code) => ExitCode::from(code),
        Err(why) => {
            eprintln!("stylet-lab: {}", stylet_text::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}

/// Returns the exit code of the task.
fn carry_out(task: &Task) -> Result<u8, Box<dyn Error>> {
    Ok(match task {
        Task::Latency(args) => latency::run(args, &*stop_flag()?)?,
        Task::Campaign(args) => campaign::run(args, &*stop_flag()?)?,
        Task::Verify(args) => verify::run(args)?,
        Task::Fleet(args) => fleet::run(args)?,
        Task::Credibility(args) => credibility::run(args)?,
        Task::Doctor(args) => doctor::run(args, &*stop_flag()?)?,
        Task::Cost { scene } => {
            println!("{}", cost::table(&Scene::builtin(scene)?)?);
            0
        }
        Task::Manual(args) => args.run(Cli::command()).map(|()| 0)?,
        Task::TraceKeeper { name } => stylet_lab::keep_trace_instance(name).map(|()| 0)?,
        Task::Load { work, core, file } => serve_as_load(*work, *core, file).map(|()| 0)?,
    })
}

fn serve_as_load(work: LoadProcess, core: Option<usize>, file: &Path) -> Result<(), Box<dyn Error>> {
    follow_parent();
    let stop = stop_flag()?;
    // SYNC: set by a signal handler; nothing but the flag is carried.
    Ok(load::work(work, core, file, || stop.load(Ordering::Acquire))?)
}
