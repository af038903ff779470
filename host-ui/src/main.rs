//! Starts the window, or the procedure without one.

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    host_ui::heap::keep_little();
    host_ui::session::name_runtime_folder();
    let ended = match stylet_manual::hand_over(&host_ui::cli::PRODUCTS) {
        Ok(()) => host_ui::cli::Cli::parse().run(),
        Err(why) => Err(why.into()),
    };
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("host-ui: {}", stylet_base::format::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}
