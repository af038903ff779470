//! The command line of `rt-core`.

use crate::devices::DevicesArgs;
use crate::probe_task::ProbeArgs;
use crate::replay_file::Replay;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use stylet_manual::{ManualArgs, Product};
use stylet_runtime::args::{OptionsError, RealTimeArgs, SecondArgs, tissue_kinds};
use stylet_runtime::device::{self, DeviceChoice, Libraries};
use stylet_runtime::process::Options;
use stylet_sim::scene::TissueKind;

/// Commands of the laboratory and of studies.
pub const PRODUCTS: [Product; 2] = [
    Product {
        program: "stylet-lab",
        commands: &[
            "latency",
            "campaign",
            "verify",
            "fleet",
            "credibility",
            "doctor",
            "cost",
        ],
    },
    Product {
        program: "stylet-study",
        commands: &["study"],
    },
];

/// Real-time process of Stylet: owns the haptic device, the 1 kHz force loop and the 200 Hz tissue step.
///
/// Start it first; any number of hosts may connect and disconnect. It asks for SCHED_FIFO and locked memory and refuses
/// to run without them, unless started with --no-rt. With a subcommand it carries out that task instead.
#[derive(Parser, Debug)]
#[command(name = "rt-core", version, args_conflicts_with_subcommands = true, after_help = stylet_manual::list("rt-core", &PRODUCTS))]
pub struct Cli {
    /// Carried out instead of a run.
    #[command(subcommand)]
    pub task: Option<Task>,
    /// Settings of a run.
    #[command(flatten)]
    pub run: RunArgs,
}

/// What `rt-core` does instead of a run.
#[derive(Subcommand, Debug)]
pub enum Task {
    /// List the haptic devices that can be used: what of each is there, what it says, and what is missing
    Devices(DevicesArgs),
    /// Show a flight recording, repeat it, and check that all forces and positions are bit-identical
    Replay(Replay),
    /// Solve for what the ultrasound probe presses in a scene's own cells: once, for minutes; later runs use it
    ///
    /// A run with a second device (--device-2) solves for it within seconds, in the larger elements that needles' lines
    /// are solved for in: in 'pelvis' 2.7 mm (fem) and 5.5 mm (chainmail), with a press that is 10 and 15 % too strong
    /// and moves the gland 7 and 12 % too far. This solves in the scene's cells and keeps the answers; later runs of
    /// the same scene and tissue begin with them. The window says below the scene in which elements the probe is solved
    /// for.
    Probe(ProbeArgs),
    /// Write the man pages and shell completions of this program
    Manual(ManualArgs),
}

/// Running the simulator.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// Name under which hosts find this process; letters, digits and '-'
    #[arg(long, default_value = "main")]
    instance: String,
    #[command(flatten)]
    real_time: RealTimeArgs,
    /// End when the program that started this one ends, however it ends
    #[arg(long)]
    pub exit_with_parent: bool,
    /// Folder of the flight recordings [default: $XDG_STATE_HOME/stylet/flights or ~/.local/state/stylet/flights]
    #[arg(long, value_name = "DIR")]
    flight_dir: Option<PathBuf>,
    /// Tissue model
    #[arg(long, default_value = TissueKind::default().name(), value_parser = tissue_kinds())]
    tissue: TissueKind,
    // The table of back ends has the help.
    #[arg(long, default_value = "simulated", value_name = "DEVICE", help = device::help())]
    device: DeviceChoice,
    #[command(flatten)]
    second: SecondArgs,
    #[command(flatten)]
    libraries: Libraries,
    /// On exit write to FILE, as JSON, what each loop cost
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

impl RunArgs {
    /// The settings of the run, or every problem with them.
    pub fn options(&self) -> Result<Options, OptionsError> {
        let mut options = self.real_time.options(&self.instance)?;
        options.tissue = self.tissue.into();
        options.device = self.device.clone();
        self.second.add_to(&mut options)?;
        options.libraries = self.libraries.clone().or_of_environment();
        if let Some(folder) = &self.flight_dir {
            options.flight_folder = folder.clone();
        }
        Ok(options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn flags_without_a_subcommand_still_run_the_simulator() {
        Cli::command().debug_assert();
        let cli = Cli::parse_from(["rt-core", "--instance", "t1", "--rt-if-allowed", "--exit-with-parent"]);
        assert!(cli.task.is_none() && cli.run.exit_with_parent);
        assert!(Cli::try_parse_from(["rt-core", "--scene", "paper", "devices"]).is_err());
    }

    fn refused(options: &[&str]) -> String {
        let cli = Cli::parse_from([&["rt-core", "probe", "--again"], options].concat());
        let Some(Task::Probe(args)) = cli.task else {
            panic!("another task")
        };
        let refused = args.run(&AtomicBool::new(true)).expect_err("nothing to solve");
        refused.to_string()
    }

    #[test]
    fn what_cannot_be_solved_for_is_said() {
        assert!(refused(&["--scene", "paper"]).contains("rectal wall"));
        assert!(refused(&["--tissue", "paper"]).contains("--tissue"));
        assert!(refused(&["--flight", "/nowhere/a.flight"]).contains("/nowhere/a.flight"));
        assert!(refused(&["--scene", "pelvis"]).contains("given up"));
        assert!(Cli::try_parse_from(["rt-core", "probe", "--scene", "pelvis", "--flight", "a.flight"]).is_err());
    }
}
