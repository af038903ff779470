//! `rt-core`: the real-time process, and the laboratory that measures it.

use clap::{CommandFactory, Parser};
use rt_core::cli::{Cli, RunArgs, Task};
use rt_core::report::Report;
use std::error::Error;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_lab::{campaign, credibility, devices, doctor, fleet, latency, load, verify};
use stylet_runtime::process::limits;
use stylet_sim::scene::Scene;

fn main() -> ExitCode {
    stylet_runtime::environment::cleanse();
    let cli = Cli::parse();
    limits::raise();
    match carry_out(&cli) {
        Ok(code) => ExitCode::from(code),
        Err(why) => {
            eprintln!("rt-core: {}", stylet_text::printable(&why.to_string()));
            ExitCode::FAILURE
        }
    }
}

/// Returns the exit code of the run or of its task.
fn carry_out(cli: &Cli) -> Result<u8, Box<dyn Error>> {
    Ok(match &cli.task {
        None => run(&cli.run).map(|()| 0)?,
        Some(Task::Latency(args)) => latency::run(args, &*stop_on_signal()?)?,
        Some(Task::Campaign(args)) => campaign::run(args, &*stop_on_signal()?)?,
        Some(Task::Verify(args)) => verify::run(args)?,
        Some(Task::Fleet(args)) => fleet::run(args)?,
        Some(Task::Credibility(args)) => credibility::run(args)?,
        Some(Task::Doctor(args)) => doctor::run(args, &*stop_on_signal()?)?,
        Some(Task::Devices(args)) => devices::run(args),
        Some(Task::Replay(replay)) => u8::from(!replay.run()?),
        #[cfg(feature = "study")]
        Some(Task::Study(args)) => args.run(&*stop_on_signal()?)?,
        Some(Task::Manual(args)) => args.run(Cli::command()).map(|()| 0)?,
        Some(Task::Probe(args)) => args.run(&*stop_on_signal()?).map(|()| 0)?,
        Some(Task::Cost { scene }) => cost(scene).map(|()| 0)?,
        Some(Task::TraceKeeper { name }) => stylet_lab::keep_trace_instance(name).map(|()| 0)?,
        Some(Task::Load { work, core, file }) => serve_as_load(*work, *core, file).map(|()| 0)?,
    })
}

/// Returns a flag that the first termination signal sets.
fn stop_on_signal() -> Result<Arc<AtomicBool>, Box<dyn Error>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [
        signal_hook::consts::SIGINT,
        signal_hook::consts::SIGTERM,
        signal_hook::consts::SIGHUP,
    ] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(|e| format!("signal handler: {e}"))?;
    }
    Ok(stop)
}

fn serve_as_load(work: load::LoadProcess, core: Option<usize>, file: &std::path::Path) -> Result<(), Box<dyn Error>> {
    follow_parent();
    let stop = stop_on_signal()?;
    // SYNC: set by a signal handler; nothing but the flag is carried.
    Ok(load::work(work, core, file, || stop.load(Ordering::Acquire))?)
}

fn cost(scene: &str) -> Result<(), Box<dyn Error>> {
    let scene = Scene::builtin(scene)?;
    println!("{}", stylet_lab::cost::table(&scene)?);
    Ok(())
}

fn run(args: &RunArgs) -> Result<(), Box<dyn Error>> {
    abort_on_panic();
    if args.exit_with_parent {
        follow_parent();
    }
    let options = args.options()?;
    let stop = stop_on_signal()?;
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

/// The kernel sends SIGTERM when the parent dies, even by SIGKILL.
fn follow_parent() {
    // SAFETY: PR_SET_PDEATHSIG takes a signal number; getppid has no preconditions.
    let orphan = unsafe {
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM);
        libc::getppid() == 1
    };
    if orphan {
        std::process::exit(0);
    }
}
