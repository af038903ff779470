//! Starts the window, or the procedure without one.

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    host_ui::heap::keep_little();
    host_ui::session::name_runtime_folder();
    match host_ui::cli::Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("host-ui: {}", stylet_base::format::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}
