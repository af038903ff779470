//! `stylet-study`: runs thousands of insertions, in shards.

use clap::{CommandFactory, Parser, Subcommand};
use std::error::Error;
use std::process::ExitCode;
use stylet_manual::ManualArgs;
use stylet_runtime::signals::stop_flag;
use stylet_study::args::StudyArgs;

/// Population studies of Stylet, without a device and without real time.
#[derive(Parser, Debug)]
#[command(name = "stylet-study", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// Run thousands of insertions over scenes, plans, hands and tissues, in shards that make Parquet files
    Study(Box<StudyArgs>),
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

fn main() -> ExitCode {
    match carry_out(&Cli::parse().task) {
        Ok(code) => ExitCode::from(code),
        Err(why) => {
            eprintln!("stylet-study: {}", stylet_text::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}

/// Returns the exit code of the task.
fn carry_out(task: &Task) -> Result<u8, Box<dyn Error>> {
    Ok(match task {
        Task::Study(args) => args.run(&*stop_flag()?)?,
        Task::Manual(args) => args.run(Cli::command()).map(|()| 0)?,
    })
}
