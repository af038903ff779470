//! `stylet-igtl`: serves a core to 3D Slicer over OpenIGTLink.

use clap::{CommandFactory, Parser, Subcommand};
use std::error::Error;
use std::process::ExitCode;
use stylet_igtl::serve;
use stylet_manual::ManualArgs;

/// OpenIGTLink server of Stylet.
///
/// `host-ui igtl` and `stylet-igtl igtl` are the same command.
#[derive(Parser, Debug)]
#[command(name = "stylet-igtl", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// Serve needle, seeds, gland, state and ultrasound to 3D Slicer over OpenIGTLink, until interrupted;
    /// anyone who reaches the address can watch, because the protocol has no passwords
    Igtl(serve::Options),
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

fn main() -> ExitCode {
    match carry_out(Cli::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("stylet-igtl: {}", stylet_base::format::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}

fn carry_out(task: Task) -> Result<(), Box<dyn Error>> {
    stylet_manual::end_with_reader();
    match task {
        Task::Igtl(options) => {
            let ended = serve::run(&options);
            options.instance.sweep();
            Ok(ended?)
        }
        Task::Manual(args) => Ok(args.run(Cli::command())?),
    }
}
