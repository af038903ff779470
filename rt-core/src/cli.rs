//! The command line of `rt-core`.

use crate::core::{HAPTIC_PERIOD_NS, Options};
use crate::device::DeviceChoice;
use crate::lab::compare::Against;
use crate::lab::load::{Load, Work};
use crate::lab::machine::{Machine, Throttle};
use crate::lab::measure;
use crate::replay::{self, cli::Replay};
use crate::rt::arm;
use crate::tissue::TissueKind;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use stylet_shm_schema::BUILTIN_SCENES;
use stylet_shm_schema::service::Instance;

/// Real-time process of Stylet: owns the haptic device, the 1 kHz force loop and the 200 Hz tissue step.
///
/// Start it first; any number of `host-ui` windows may come and go. It asks for SCHED_FIFO and locked memory and
/// refuses to run without them, unless told --no-rt. With a subcommand it does not run but answers a question.
#[derive(Parser, Debug)]
#[command(name = "rt-core", version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    pub task: Option<Task>,
    #[command(flatten)]
    pub run: RunArgs,
}

#[derive(Subcommand, Debug)]
pub enum Task {
    /// Measure how late the loops are on this machine, and write a report with a verdict
    Latency(Box<LatencyArgs>),
    /// Check that a filed latency report is as it was written
    Verify {
        /// The folder of the report, or its report.json
        report: PathBuf,
    },
    /// Say whether this PC is fit for the force loop, and what to change
    Doctor {
        /// As JSON
        #[arg(long)]
        json: bool,
        /// Core of the force loop [default: the last one]
        #[arg(long, value_name = "N")]
        haptic_core: Option<usize>,
    },
    /// Show a flight recording, repeat it, and say whether every force and position is the same in every bit
    Replay(Replay),
    /// Measure what each part of a scene costs in a tissue tick
    Cost {
        /// Built-in scene
        #[arg(long, default_value = BUILTIN_SCENES[0], value_parser = scenes())]
        scene: String,
    },
    /// One process of a load; started by `latency`
    #[command(hide = true)]
    Load {
        work: Work,
        #[arg(long)]
        instance: String,
        #[arg(long)]
        file: PathBuf,
    },
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
    /// What computes the tissue
    #[arg(long, value_enum, default_value_t)]
    tissue: TissueKind,
    // The table of back ends has the help.
    #[arg(long, default_value = "simulated", value_name = "DEVICE", help = stylet_hw::backend::help())]
    device: DeviceChoice,
    /// The driver's library libHD.so [default: STYLET_LIBHD, else where the system has it]
    #[arg(long, value_name = "PATH")]
    libhd: Option<PathBuf>,
    /// On exit write what each loop cost to FILE, as JSON
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

/// What a run and a measurement have in common.
#[derive(Args, Debug)]
pub struct RealTimeArgs {
    /// Built-in scene to start with
    #[arg(long, default_value = BUILTIN_SCENES[0], value_parser = scenes())]
    scene: String,
    /// Run without real-time scheduling; every record and screen then says so
    #[arg(long)]
    no_rt: bool,
    /// Try real time first and go on without it when the rights are missing
    #[arg(long, conflicts_with = "no_rt")]
    rt_if_allowed: bool,
    /// Core of the force loop [default: the last one]
    #[arg(long, value_name = "N")]
    haptic_core: Option<usize>,
    /// Core of the tissue step [default: the one before]
    #[arg(long, value_name = "N")]
    tissue_core: Option<usize>,
    /// SCHED_FIFO priority of the force loop
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u32).range(1..=98), value_name = "1-98")]
    haptic_priority: u32,
    /// SCHED_FIFO priority of the tissue step
    #[arg(long, default_value_t = 70, value_parser = clap::value_parser!(u32).range(1..=98), value_name = "1-98")]
    tissue_priority: u32,
}

/// A measurement.
#[derive(Args, Debug)]
pub struct LatencyArgs {
    /// How long to measure: 60s, 10m, 1h
    #[arg(long, default_value = "60s", value_parser = duration_ns, value_name = "TIME")]
    pub duration: u64,
    /// What runs beside the loops
    #[arg(long, value_enum, default_value_t = Load::None)]
    pub load: Load,
    /// Rate of the force loop, Hz
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(500..=10_000), value_name = "HZ")]
    pub rate: u32,
    /// Spin for the last N microseconds before each deadline
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub spin_us: u64,
    /// Then measure in turns with something else
    #[arg(long, value_enum, num_args = 0..=1, default_missing_value = "cyclictest", value_name = "WITH")]
    pub compare: Option<Against>,
    /// Pairs of turns of the comparison
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100), value_name = "N")]
    pub rounds: u32,
    /// Limits in a TOML file, one `name = value` a line
    #[arg(long, value_name = "FILE")]
    pub limits: Option<PathBuf>,
    /// One limit; wins over the file
    #[arg(long, value_name = "NAME=VALUE")]
    pub limit: Vec<String>,
    /// Folder for report.json, report.html and histograms.hlog
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    real_time: RealTimeArgs,
}

fn scenes() -> PossibleValuesParser {
    let help = |name| match name {
        "paper" => "the gland alone, one tissue, 19,307 elements",
        "pelvis" => "the gland with capsule and urethra among rectum, bladder, pubic arch, fat and perineum",
        "full" => "every cell of the grid, one tissue, 1,167,584 elements: for measuring",
        _ => "",
    };
    PossibleValuesParser::new(BUILTIN_SCENES.map(|name| PossibleValue::new(name).help(help(name))))
}

impl RunArgs {
    /// Lists what is wrong with the settings.
    pub fn options(&self) -> Result<Options, String> {
        let mut options = self.real_time.options(&self.instance)?;
        options.tissue = self.tissue;
        options.device = self.device.clone();
        let from_environment = || std::env::var_os("STYLET_LIBHD").map(PathBuf::from);
        options.libhd = self.libhd.clone().or_else(from_environment);
        if let Some(folder) = &self.flight_dir {
            options.flight_folder = folder.clone();
        }
        Ok(options)
    }
}

impl LatencyArgs {
    /// An instance of its own, so that a running simulator is not disturbed in its shared memory.
    pub fn options(&self) -> Result<Options, String> {
        let mut options = self.real_time.options(&format!("lab-{}", std::process::id()))?;
        options.haptic_period_ns = measure::period_ns(self.rate);
        options.spin_ns = self.spin_us * 1_000;
        let longest_us = longest_spin_ns(options.haptic_period_ns, Machine::this().throttle()) / 1_000;
        if self.spin_us > longest_us {
            return Err(format!(
                "--spin-us {}: at {} Hz at most {longest_us}, or the kernel would stop the loop for its share of real-time work",
                self.spin_us, self.rate
            ));
        }
        Ok(options)
    }
}

/// What the loop itself and all else of real-time priority on its core may need besides spinning.
const SHARE_KEPT_FREE: f64 = 0.15;

/// The longest spin that leaves the core below the kernel's share for real-time threads.
fn longest_spin_ns(period_ns: u64, throttle: Option<Throttle>) -> u64 {
    let share = match throttle {
        Some(Throttle::Share(share)) => share,
        Some(Throttle::Off) | None => 0.95,
    };
    ((share - SHARE_KEPT_FREE).max(0.0) * period_ns as f64).round() as u64
}

fn duration_ns(text: &str) -> Result<u64, String> {
    let duration: jiff::SignedDuration = text.parse().map_err(|e: jiff::Error| e.to_string())?;
    let ns = u64::try_from(duration.as_nanos()).unwrap_or(0);
    if (1_000_000_000..=172_800_000_000_000).contains(&ns) {
        Ok(ns)
    } else {
        Err("between 1s and 48h".to_owned())
    }
}

impl RealTimeArgs {
    fn options(&self, instance: &str) -> Result<Options, String> {
        let cores: Vec<usize> = core_affinity::get_core_ids()
            .unwrap_or_default()
            .iter()
            .map(|c| c.id)
            .collect();
        let mut problems = Vec::new();
        for (option, core) in [("--haptic-core", self.haptic_core), ("--tissue-core", self.tissue_core)] {
            if let Some(core) = core.filter(|c| !cores.contains(c)) {
                problems.push(format!("{option} {core}: this process may use cores {cores:?}"));
            }
        }
        let instance = Instance::new(instance).map_err(|e| problems.push(e.to_string()));
        let refused = if self.rt_if_allowed {
            may_be_real_time().err()
        } else {
            None
        };
        match instance {
            Ok(instance) if problems.is_empty() => Ok(Options {
                instance,
                scene: self.scene.clone(),
                no_rt: self.no_rt || refused.is_some(),
                no_rt_asked: self.no_rt,
                rights_missing: refused,
                haptic_core: self.haptic_core.or(cores.last().copied()),
                tissue_core: self.tissue_core.or(cores.iter().rev().nth(1).or(cores.last()).copied()),
                haptic_priority: self.haptic_priority,
                tissue_priority: self.tissue_priority,
                haptic_period_ns: HAPTIC_PERIOD_NS,
                spin_ns: 0,
                flight_folder: replay::file::default_folder(),
                tissue: TissueKind::default(),
                device: DeviceChoice::Simulated,
                libhd: None,
            }),
            _ => Err(problems.join("\n")),
        }
    }
}

/// Tries it in a thread of its own, which then ends; `Err` says how to grant what is missing.
fn may_be_real_time() -> Result<(), String> {
    let ask = arm::Ask {
        priority: Some(1),
        core: None,
    };
    let armed = std::thread::spawn(move || arm::arm(ask).map(drop).map_err(|e| e.to_string())).join();
    armed.unwrap_or_else(|_| Err("the trial of real-time scheduling ended by itself".to_owned()))?;
    // SAFETY: both calls have no preconditions; what is locked now is unlocked again.
    let lockable = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) == 0 && libc::munlockall() == 0 };
    if lockable {
        Ok(())
    } else {
        Err(arm::advice("the kernel does not lock memory"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn flags_without_a_subcommand_still_run_the_simulator() {
        Cli::command().debug_assert();
        let cli = Cli::parse_from(["rt-core", "--instance", "t1", "--rt-if-allowed", "--exit-with-parent"]);
        assert!(cli.task.is_none() && cli.run.exit_with_parent);
        assert!(Cli::try_parse_from(["rt-core", "--scene", "paper", "doctor"]).is_err());
    }

    #[test]
    fn a_spin_leaves_the_kernel_its_share() {
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Share(0.95))), 800_000);
        assert_eq!(longest_spin_ns(200_000, Some(Throttle::Share(0.5))), 70_000);
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Share(0.1))), 0);
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Off)), 800_000);
    }

    #[test]
    fn durations_are_read_with_their_unit() {
        assert_eq!(duration_ns("90s"), Ok(90_000_000_000));
        assert_eq!(duration_ns("1h"), Ok(3_600_000_000_000));
        assert!(duration_ns("5").is_err() && duration_ns("10ms").is_err() && duration_ns("-5s").is_err());
    }
}
