//! Opens the haptic device that the operator named.

mod motion;

use crate::rt::arm::{self, Ask};
pub use crate::start::{needle_start, second_start};
use clap::Args;
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use stylet_hw::backend::{self, BackendKind, UnknownBackend};
use stylet_hw::{
    Arm, ArmError, Axes, Device, ForceDimension, ForceDimensionConfig, Haply, HaplyConfig, Phantom, PhantomConfig,
    Placement, Report, SimulatedPhantom, SimulatedPhantomConfig, drd, haply, libhd,
};
use stylet_shm_schema::ThreadReport;

/// Rate of a driver's servo loop.
const SERVO_HZ: u32 = 1000;
/// Priority of the servo thread over the force loop, which waits for its samples.
const SERVO_AHEAD: u32 = 5;

/// A back end of [`backend::BACKENDS`] as the operator named it, with the text after the colon: the name of a Phantom
/// in the driver's configuration, or the file of a recorded motion.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceChoice {
    kind: BackendKind,
    argument: Option<String>,
}

impl DeviceChoice {
    /// True if both hands cannot use these two. A recorded motion or a simulation can be used twice. OpenHaptics serves
    /// all its devices in one loop, which this program does not support for two.
    pub fn excludes(&self, other: &Self) -> bool {
        let is_hardware = backend::BACKENDS.iter().any(|b| b.kind == self.kind && !b.simulated);
        is_hardware && self.kind == other.kind && (self == other || self.kind == BackendKind::Phantom)
    }
}

impl FromStr for DeviceChoice {
    type Err = UnknownBackend;

    fn from_str(text: &str) -> Result<Self, UnknownBackend> {
        let (kind, argument) = backend::parse(text)?;
        let argument = argument.map(str::to_owned);
        Ok(Self { kind, argument })
    }
}

/// Lists every name that [`DeviceChoice`] accepts, with its help.
pub fn help() -> String {
    backend::help()
}

/// Vendor libraries and addresses of their services, if not the defaults.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq)]
pub struct Libraries {
    /// The driver's library libHD.so [default: STYLET_LIBHD, else where the system has it]
    #[arg(long, value_name = "PATH")]
    pub libhd: Option<PathBuf>,
    /// The library of the Force Dimension SDK, libdrd.so or libdhd.so [default: STYLET_LIBDRD, else where the system
    /// has it]
    #[arg(long, value_name = "PATH")]
    pub libdrd: Option<PathBuf>,
    /// The Inverse service of Haply [default: STYLET_HAPLY_URL, else ws://localhost:10001]
    #[arg(long, value_name = "URL")]
    pub haply_url: Option<String>,
}

impl Libraries {
    /// Returns the command line's values, else those of the environment: `STYLET_LIBHD`, `STYLET_LIBDRD`,
    /// `STYLET_HAPLY_URL`.
    pub fn or_of_environment(self) -> Self {
        let path = |variable| std::env::var_os(variable).map(PathBuf::from);
        Self {
            libhd: self.libhd.or_else(|| path("STYLET_LIBHD")),
            libdrd: self.libdrd.or_else(|| path("STYLET_LIBDRD")),
            haply_url: self.haply_url.or_else(|| std::env::var("STYLET_HAPLY_URL").ok()),
        }
    }

    /// Returns the named Inverse service, or the default.
    pub fn inverse_service(&self) -> Result<haply::Service, haply::BadAddress> {
        self.haply_url
            .as_deref()
            .map_or(Ok(haply::Service::default()), str::parse)
    }
}

/// Failure to open a device; the text says what to do.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The Phantom.
    #[error("{0}\nOr start with --device simulated.")]
    Phantom(#[from] libhd::OpenError),
    /// The device of Force Dimension.
    #[error("{0}\nOr start with --device simulated.")]
    ForceDimension(#[from] drd::OpenError),
    /// The device of Haply.
    #[error("{0}\nOr start with --device simulated.")]
    Haply(#[from] haply::OpenError),
    /// The address in `--haply-url` or its variable is invalid.
    #[error("--haply-url: {0}")]
    Service(#[from] haply::BadAddress),
    /// The text after the colon is not a device number.
    #[error("--device force-dimension:{0}: give the number of a device, from 0; rt-core devices lists them")]
    Number(String),
    /// The recorded motion.
    #[error(transparent)]
    Motion(#[from] motion::MotionError),
}

/// Opens the device with its tip, or the origin of its frame, at `start`. `force_loop` is the loop's scheduling
/// request, `servo_core` the processor of the driver's own thread.
pub fn open(
    choice: &DeviceChoice,
    libraries: &Libraries,
    start: Vector3<f64>,
    force_loop: Ask,
    servo_core: Option<usize>,
) -> Result<Box<dyn Device>, DeviceError> {
    match choice.kind {
        BackendKind::Simulated => Ok(Box::new(SimulatedPhantom::new(SimulatedPhantomConfig {
            start_tip_in_world: start,
            ..SimulatedPhantomConfig::default()
        }))),
        BackendKind::Replay => {
            let path = choice.argument.as_deref().unwrap_or_default();
            Ok(Box::new(motion::device(Path::new(path))?))
        }
        BackendKind::Phantom => {
            let config = PhantomConfig {
                library: libraries.libhd.clone(),
                name: choice.argument.clone(),
                placement: Placement::facing_patient(Axes::OPEN_HAPTICS, start),
                servo_hz: SERVO_HZ,
            };
            Ok(Box::new(Phantom::open(config, arm(force_loop, servo_core), report())?))
        }
        BackendKind::ForceDimension => {
            let number = choice.argument.as_deref().unwrap_or("0");
            let config = ForceDimensionConfig {
                library: libraries.libdrd.clone(),
                number: number.parse().map_err(|_| DeviceError::Number(number.to_owned()))?,
                placement: Placement::facing_patient(Axes::FORCE_DIMENSION, start),
                servo_hz: SERVO_HZ,
            };
            Ok(Box::new(ForceDimension::open(
                config,
                arm(force_loop, servo_core),
                report(),
            )?))
        }
        BackendKind::Haply => {
            let wanted = choice.argument.as_deref().map(str::parse);
            let config = HaplyConfig {
                service: libraries.inverse_service()?,
                wanted: wanted.and_then(Result::ok).unwrap_or_default(),
                placement: Placement::facing_patient(Axes::HAPLY, start),
                servo_hz: SERVO_HZ,
            };
            Ok(Box::new(Haply::open(config, arm(force_loop, servo_core), report())?))
        }
    }
}

/// Arms the servo thread of a device, ahead of the force loop.
fn arm(force_loop: Ask, core: Option<usize>) -> Arm {
    let ask = Ask {
        priority: force_loop.priority.map(|p| (p + SERVO_AHEAD).min(98)),
        core,
    };
    Box::new(move || {
        arm::arm(ask)
            .map(|armed| granted_text(&armed.report))
            .map_err(ArmError::new)
    })
}

fn report() -> Report {
    Box::new(|text| eprintln!("rt-core: device: {text}"))
}

/// Describes the grants of a thread.
fn granted_text(granted: &ThreadReport) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_named_as_the_help_says_and_not_otherwise() {
        let choice = |kind, argument: Option<&str>| {
            let argument = argument.map(str::to_owned);
            Ok(DeviceChoice { kind, argument })
        };
        assert_eq!("simulated".parse(), Ok(DeviceChoice::default()));
        assert_eq!("phantom".parse(), choice(BackendKind::Phantom, None));
        assert_eq!(
            "phantom:Left arm".parse(),
            choice(BackendKind::Phantom, Some("Left arm"))
        );
        assert_eq!(
            "force-dimension:1".parse(),
            choice(BackendKind::ForceDimension, Some("1"))
        );
        assert_eq!("haply:049D".parse(), choice(BackendKind::Haply, Some("049D")));
        assert_eq!("replay:a.motion".parse(), choice(BackendKind::Replay, Some("a.motion")));
        for wrong in ["", "phantom:", "Phantom", "simulated:x", "falcon"] {
            assert!(wrong.parse::<DeviceChoice>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn both_hands_do_not_hold_one_device() {
        let excludes = |a: &str, b: &str| {
            let choice = |name: &str| name.parse::<DeviceChoice>().expect("a device");
            choice(a).excludes(&choice(b))
        };
        for (a, b) in [
            ("haply", "haply"),
            ("haply:1", "haply:1"),
            ("phantom", "phantom:Left arm"),
        ] {
            assert!(excludes(a, b), "{a} {b}");
        }
        for (a, b) in [
            ("simulated", "simulated"),
            ("replay:a", "replay:a"),
            ("haply:0", "haply:1"),
            ("force-dimension", "haply"),
        ] {
            assert!(!excludes(a, b), "{a} {b}");
        }
    }
}
