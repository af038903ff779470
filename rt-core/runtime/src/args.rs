//! Options that a run and a measurement share on the command line, and the settings of a run that they give.

mod priorities;

use crate::device::{DeviceChoice, Libraries};
use crate::kept_probe;
use crate::process::{Options, SecondOptions};
use crate::replay;
use crate::rt::arm::{self, Refused};
use crate::rt::clock::{HAPTIC_PERIOD_NS, Wait};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use stylet_shm_schema::{BUILTIN_SCENES, Instance, InstanceError, ProblemList};
use stylet_sim::scene::TissueKind;

/// Options that a run and a measurement share.
#[derive(Args, Debug)]
pub struct RealTimeArgs {
    /// Built-in scene to start with
    #[arg(long, default_value = BUILTIN_SCENES[0], value_parser = scenes())]
    pub scene: String,
    /// Run without real-time scheduling; every record and screen then shows it
    #[arg(long)]
    no_rt: bool,
    /// Try real time first and run without it when the rights are missing
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

/// Rate of the second device's loop, Hz.
const SECOND_RATE_HZ: u32 = 1000;
/// Between the tissue step and the force loop: where it has to share the tissue's core, it goes before it.
const SECOND_PRIORITY: u32 = 75;

/// Options of the second device.
#[derive(Args, Debug)]
pub struct SecondArgs {
    /// Device of the other hand, which holds the ultrasound probe: any that --device takes, but not the same one
    #[arg(long, value_name = "DEVICE")]
    device_2: Option<DeviceChoice>,
    /// Rate of its loop, Hz
    #[arg(long, requires = "device_2", default_value_t = SECOND_RATE_HZ, value_parser = clap::value_parser!(u32).range(100..=10_000), value_name = "HZ")]
    device_2_rate: u32,
    /// Core of its loop [default: the one before that of the tissue step, where there are three]
    #[arg(long, requires = "device_2", value_name = "N")]
    device_2_core: Option<usize>,
    /// SCHED_FIFO priority of its loop
    #[arg(long, requires = "device_2", default_value_t = SECOND_PRIORITY, value_parser = clap::value_parser!(u32).range(1..=98), value_name = "1-98")]
    device_2_priority: u32,
}

impl SecondArgs {
    /// Adds the second device to the run, where one was named.
    pub fn add_to(&self, options: &mut Options) -> Result<(), OptionsError> {
        options.second = self.options()?;
        priorities::check(options)
    }

    fn options(&self) -> Result<Option<SecondOptions>, OptionsError> {
        let Some(device) = self.device_2.clone() else {
            return Ok(None);
        };
        let cores = cores();
        if let Some(core) = self.device_2_core.filter(|core| !cores.contains(core)) {
            let option = "--device-2-core";
            return Err(OptionsProblem::NoSuchCore { option, core, cores }.into());
        }
        Ok(Some(SecondOptions {
            device,
            period_ns: 1_000_000_000 / u64::from(self.device_2_rate),
            core: self
                .device_2_core
                .or(cores.iter().rev().nth(2).or(tissue_core(&cores)).copied()),
            priority: self.device_2_priority,
        }))
    }
}

fn cores() -> Vec<usize> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    cores.iter().map(|c| c.id).collect()
}

fn tissue_core(cores: &[usize]) -> Option<&usize> {
    cores.iter().rev().nth(1).or(cores.last())
}

/// Problems with the options of a run.
pub type OptionsError = ProblemList<OptionsProblem>;

/// Problem with the options of a run.
#[derive(Debug, thiserror::Error)]
pub enum OptionsProblem {
    /// A core that this process may not use.
    #[error("{option} {core}: this process may use cores {cores:?}")]
    NoSuchCore {
        /// Option that names the core.
        option: &'static str,
        /// The core.
        core: usize,
        /// Cores of this process.
        cores: Vec<usize>,
    },
    /// The name of the instance.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// A priority with which one loop would starve another.
    #[error(
        "{} {}: {} shares core {core} with {}, which would wait for it; give it less than {} {}, or another core",
        .other.option, .other.priority, .other.name, .first.name, .first.option, .first.priority
    )]
    Starves {
        /// Core of both loops.
        core: usize,
        /// Loop that would wait.
        first: Asked,
        /// Loop that it would wait for.
        other: Asked,
    },
}

/// Core and priority requested for a loop.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    name: &'static str,
    core: Option<usize>,
    priority: u32,
    /// Option that sets the priority.
    option: &'static str,
}

/// Names of the tissue models, with a line of help for each.
pub fn tissue_kinds() -> impl TypedValueParser<Value = TissueKind> {
    let kinds = TissueKind::ALL.map(|kind| PossibleValue::new(kind.name()).help(kind.help()));
    PossibleValuesParser::new(kinds).map(|name| TissueKind::of_name(&name).unwrap_or_default())
}

/// Names of the built-in scenes, with a line of help for each.
pub fn scenes() -> PossibleValuesParser {
    let help = |name| match name {
        "paper" => "the gland alone, one tissue, 19,307 elements",
        "pelvis" => "the gland with capsule and urethra among rectum, bladder, pubic arch, fat and perineum",
        "full" => "every cell of the grid, one tissue, 1,167,584 elements: for measuring",
        _ => "",
    };
    PossibleValuesParser::new(BUILTIN_SCENES.map(|name| PossibleValue::new(name).help(help(name))))
}

impl RealTimeArgs {
    /// The defaults of the command line, with the force loop on `haptic_core`; real time where it is allowed.
    pub fn for_measurement(haptic_core: usize) -> Self {
        Self {
            scene: BUILTIN_SCENES[0].to_owned(),
            no_rt: false,
            rt_if_allowed: true,
            haptic_core: Some(haptic_core),
            tissue_core: None,
            haptic_priority: 80,
            tissue_priority: 70,
        }
    }

    /// The settings of a run, or every problem with them.
    pub fn options(&self, instance: &str) -> Result<Options, OptionsError> {
        let cores = cores();
        let mut problems = Vec::new();
        for (option, core) in [("--haptic-core", self.haptic_core), ("--tissue-core", self.tissue_core)] {
            if let Some(core) = core.filter(|c| !cores.contains(c)) {
                let cores = cores.clone();
                problems.push(OptionsProblem::NoSuchCore { option, core, cores });
            }
        }
        let instance = Instance::new(instance).map_err(|e| problems.push(e.into()));
        let refused = if self.rt_if_allowed {
            try_real_time().err().map(|why| why.to_string())
        } else {
            None
        };
        let options = match instance {
            Ok(instance) if problems.is_empty() => Options {
                instance,
                scene: self.scene.clone(),
                no_rt: self.no_rt || refused.is_some(),
                no_rt_asked: self.no_rt,
                rights_missing: refused,
                haptic_core: self.haptic_core.or(cores.last().copied()),
                tissue_core: self.tissue_core.or(tissue_core(&cores).copied()),
                haptic_priority: self.haptic_priority,
                tissue_priority: self.tissue_priority,
                haptic_period_ns: HAPTIC_PERIOD_NS,
                wait: Wait::at_period(HAPTIC_PERIOD_NS),
                flight_folder: replay::file::default_folder(),
                probe_folder: kept_probe::default_folder(),
                tissue: TissueKind::default().into(),
                device: DeviceChoice::default(),
                second: None,
                libraries: Libraries::default(),
            },
            _ => return Err(ProblemList(problems)),
        };
        priorities::check(&options)?;
        Ok(options)
    }
}

/// Tries real-time scheduling in a short-lived thread; the error explains how to grant what is missing.
fn try_real_time() -> Result<(), Refused> {
    let ask = arm::Ask {
        priority: Some(1),
        core: None,
    };
    // Otherwise this thread would leave its own heap to later threads.
    arm::keep_one_heap();
    let armed = std::thread::spawn(move || arm::arm(ask).map(drop)).join();
    armed.unwrap_or(Err(Refused::Trial))?;
    // SAFETY: both calls have no preconditions; what is locked now is unlocked again.
    let lockable = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) == 0 && libc::munlockall() == 0 };
    if lockable {
        Ok(())
    } else {
        Err(Refused::MemoryLock(None))
    }
}
