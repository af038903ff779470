//! `stylet-clinic`: commands on the files of a clinic, and on results of the simulator.

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    match stylet_clinic::cli::Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("stylet-clinic: {}", stylet_base::format::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}
