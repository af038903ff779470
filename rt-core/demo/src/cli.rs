//! The demonstration as a program.

use crate::core;
use clap::{CommandFactory, Parser, Subcommand};
use host_ui::app::{self, Options};
use std::error::Error;
use std::process::ExitCode;
use stylet_manual::ManualArgs;
use stylet_runtime::args::{scenes, tissue_kinds};
use stylet_shm_schema::Instance;
use stylet_sim::scene::TissueKind;

/// Demonstration of Stylet in one program.
///
/// `host-ui demo` and `stylet-demo demo` are the same command.
#[derive(Parser, Debug)]
#[command(name = "stylet-demo", version)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand, Debug)]
enum Task {
    /// Open the window over a core in the same program: no real time, no device, and nothing else to start
    Demo {
        /// Scene to begin with
        #[arg(long, default_value = core::SCENE, value_parser = scenes())]
        scene: String,
        /// Tissue model
        #[arg(long, default_value = TissueKind::default().name(), value_parser = tissue_kinds())]
        tissue: TissueKind,
    },
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

pub fn run() -> ExitCode {
    match carry_out(Cli::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("stylet-demo: {why}");
            ExitCode::FAILURE
        }
    }
}

fn carry_out(task: Task) -> Result<(), Box<dyn Error>> {
    stylet_manual::end_with_reader();
    match task {
        Task::Demo { scene, tissue } => {
            // A window keeps its plan by the name of its core; this core ends with the window.
            let mut options = Options::default();
            options.core.instance = Instance::new(&format!("demo-{}", std::process::id()))?;
            let instance = options.core.instance.clone();
            let ended = app::run(options, core::home(scene, tissue));
            instance.sweep();
            Ok(ended?)
        }
        Task::Manual(args) => Ok(args.run(Cli::command())?),
    }
}
