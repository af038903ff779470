//! `rt-core`: the real-time process.

use clap::{CommandFactory, Parser};
use rt_core::cli::{Cli, PRODUCTS, RunArgs, Task};
use rt_core::devices;
use rt_core::report::Report;
use std::error::Error;
use std::process::ExitCode;
use stylet_runtime::process::limits;
use stylet_runtime::signals::{follow_parent, stop_flag};

fn main() -> ExitCode {
    stylet_runtime::environment::cleanse();
    if let Err(why) = stylet_manual::hand_over(&PRODUCTS) {
        return failed(&why);
    }
    let cli = Cli::parse();
    // The force loop outlives its output; so does what is left half done in a file.
    if matches!(cli.task, Some(Task::Devices(_) | Task::Replay(_))) {
        stylet_manual::end_with_reader();
    }
    limits::raise();
    match carry_out(&cli) {
        Ok(code) => ExitCode::from(code),
        Err(why) => failed(&*why),
    }
}

fn failed(why: &dyn Error) -> ExitCode {
    eprintln!("rt-core: {}", stylet_text::printable(&why.to_string()));
    ExitCode::FAILURE
}

/// Returns the exit code of the run or of its task.
fn carry_out(cli: &Cli) -> Result<u8, Box<dyn Error>> {
    Ok(match &cli.task {
        None => run(&cli.run).map(|()| 0)?,
        Some(Task::Devices(args)) => devices::run(args),
        Some(Task::Replay(replay)) => u8::from(!replay.run()?),
        Some(Task::Manual(args)) => args.run(Cli::command()).map(|()| 0)?,
        Some(Task::Probe(args)) => args.run(&*stop_flag()?).map(|()| 0)?,
    })
}

fn run(args: &RunArgs) -> Result<(), Box<dyn Error>> {
    abort_on_panic();
    if args.exit_with_parent {
        follow_parent();
    }
    let options = args.options()?;
    let stop = stop_flag()?;
    eprintln!(
        "rt-core: instance '{}', scene '{}', {}",
        options.instance.name(),
        options.scene,
        if options.no_rt { "NOT real-time" } else { "real-time" }
    );
    let report = stylet_runtime::process::run(&options, &stop)?;
    if let Some(path) = &args.report {
        let json = serde_json::to_string_pretty(&Report::from(&report))? + "\n";
        std::fs::write(path, json).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    }
    Ok(())
}

/// Ends the process on a panic in any thread, and the force with it.
fn abort_on_panic() {
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        print(info);
        std::process::abort();
    }));
}
