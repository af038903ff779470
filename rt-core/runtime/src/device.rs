//! Which haptic device a run uses, and what its faults are called on the screen.

use crate::replay::motion;
use crate::rt::arm::{self, Ask};
use nalgebra::Vector3;
use std::path::PathBuf;
use std::str::FromStr;
use stylet_hw::backend::{self, BackendKind, UnknownBackend};
use stylet_hw::libhd::{ArmError, Placement};
use stylet_hw::{Device, DeviceFault, Phantom, PhantomConfig, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_shm_schema::{Fault, ThreadReport};
use stylet_sim::scene::Scene;

/// Of the driver's servo loop.
const SERVO_HZ: u32 = 1000;
/// The servo thread goes before the force loop, which waits for what it brings.
const SERVO_AHEAD: u32 = 5;

/// What the operator asked for: `simulated`, `phantom`, `phantom:NAME` or `replay:FILE`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    #[default]
    Simulated,
    /// With its name in the driver's set-up; `None` takes the default one.
    Phantom(Option<String>),
    /// A motion that the host exported.
    Replay(PathBuf),
}

impl FromStr for DeviceChoice {
    type Err = UnknownBackend;

    fn from_str(text: &str) -> Result<Self, UnknownBackend> {
        let (kind, argument) = backend::parse(text)?;
        Ok(match kind {
            BackendKind::Simulated => Self::Simulated,
            BackendKind::Phantom => Self::Phantom(argument.map(str::to_owned)),
            BackendKind::Replay => Self::Replay(argument.map(PathBuf::from).unwrap_or_default()),
        })
    }
}

/// Opens it, with its tip or its origin outside the body, below the target. `force_loop` is what the force loop's
/// thread asks for, `servo_core` where the driver's own thread goes.
pub fn open(
    choice: &DeviceChoice,
    library: Option<PathBuf>,
    scene: &Scene,
    force_loop: Ask,
    servo_core: Option<usize>,
) -> Result<Box<dyn Device>, String> {
    let (lowest, _) = scene.lattice.bounds_m();
    let (lower, upper) = scene.target_bounds_m();
    let start = Vector3::new(
        (lower[0] + upper[0]) / 2.0,
        (lower[1] + upper[1]) / 2.0,
        lowest[2] - 0.03,
    );
    let name = match choice {
        DeviceChoice::Simulated => {
            return Ok(Box::new(SimulatedPhantom::new(SimulatedPhantomConfig {
                start_tip_in_world: start,
                ..SimulatedPhantomConfig::default()
            })));
        }
        DeviceChoice::Replay(path) => return Ok(Box::new(motion::device(path)?)),
        DeviceChoice::Phantom(name) => name.clone(),
    };
    let config = PhantomConfig {
        library,
        name,
        placement: Placement::facing_patient(start),
        servo_hz: SERVO_HZ,
    };
    let ask = Ask {
        priority: force_loop.priority.map(|p| (p + SERVO_AHEAD).min(98)),
        core: servo_core,
    };
    let arm = move || arm::arm(ask).map(|armed| words(&armed.report)).map_err(ArmError::new);
    let phantom = Phantom::open(
        config,
        Box::new(arm),
        Box::new(|text| eprintln!("rt-core: device: {text}")),
    );
    match phantom {
        Ok(phantom) => Ok(Box::new(phantom)),
        Err(why) => Err(format!("{why}\nOr start with --device simulated.")),
    }
}

/// What a thread was granted.
fn words(granted: &ThreadReport) -> String {
    let policy = if granted.is_fifo() {
        format!("SCHED_FIFO {}", granted.priority)
    } else {
        "no real-time scheduling".to_owned()
    };
    match granted.core {
        u32::MAX => format!("{policy} on any core"),
        core => format!("{policy} on core {core}"),
    }
}

/// What a fault of a device is called on the screen.
pub fn fault_of(fault: DeviceFault) -> Fault {
    match fault {
        DeviceFault::NotConnected => Fault::DeviceLost,
        DeviceFault::NotCalibrated => Fault::DeviceNotCalibrated,
        DeviceFault::Overheated => Fault::DeviceWarm,
        DeviceFault::SafetyStop => Fault::DeviceStopped,
        DeviceFault::NonFiniteSample => Fault::NonFiniteInput,
        DeviceFault::TimedOut | DeviceFault::NonFiniteWrench | DeviceFault::InvalidPeriod | DeviceFault::Driver => {
            Fault::DeviceError
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_named_as_the_help_says_and_not_otherwise() {
        assert_eq!("simulated".parse(), Ok(DeviceChoice::Simulated));
        assert_eq!(
            "sim".parse(),
            Ok(DeviceChoice::Simulated),
            "the name in older scene files"
        );
        assert_eq!("phantom".parse(), Ok(DeviceChoice::Phantom(None)));
        assert_eq!(
            "phantom:Left arm".parse(),
            Ok(DeviceChoice::Phantom(Some("Left arm".to_owned())))
        );
        for wrong in ["", "phantom:", "Phantom", "simulated:x", "falcon"] {
            assert!(wrong.parse::<DeviceChoice>().is_err(), "{wrong}");
        }
    }
}
