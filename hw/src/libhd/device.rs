//! A Phantom as a [`Device`]: wait-free ends for the force loop.

use core::fmt;
use core::time::Duration;
use std::path::PathBuf;
use std::sync::mpsc;

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::libhd::exchange::{Command, Readings};
use crate::libhd::ffi::{Api, LoadError};
use crate::libhd::frame::Placement;
use crate::libhd::keeper::{Keeper, KeeperThread, Tell};
use crate::libhd::servo::{Arm, Inner, Servo, State};
use crate::libhd::session::{Description, Trouble};

/// Which device, and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct PhantomConfig {
    /// The driver's library; `None` tries its usual names.
    pub library: Option<PathBuf>,
    /// The device's name in the driver's set-up; `None` takes the default one.
    pub name: Option<String>,
    pub placement: Placement,
    /// Of the driver's servo loop: 500, 1000 or 2000 on a parallel port. See the module's documentation on delay.
    pub servo_hz: u32,
}

/// Why there is no device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OpenError {
    Load(LoadError),
    Trouble(Trouble),
    /// The driver does not return from initialisation.
    NoAnswer,
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Load(why) => why.fmt(f),
            Self::Trouble(why) => why.fmt(f),
            Self::NoAnswer => {
                f.write_str("the driver does not answer: check the device's power and cable, then try again")
            }
        }
    }
}

impl core::error::Error for OpenError {}

const OPEN_LIMIT: Duration = Duration::from_secs(15);

/// See the module. Dropped, it leaves zero force and a disabled device.
pub struct Phantom {
    description: Description,
    servo: &'static Servo,
    samples: triple_buffer::Output<Option<Sample>>,
    commands: triple_buffer::Input<Command>,
    number: u64,
    _keeper: KeeperThread,
}

impl Phantom {
    /// Loads the driver and finds the device. `arm` runs once in each servo thread, before its first tick is served;
    /// `tell` gets, from a thread of normal priority, what the operator has to know or do.
    ///
    /// A device that is not calibrated is opened: it reads [`DeviceFault::NotCalibrated`] until the operator has done
    /// what `tell` said.
    pub fn open(config: PhantomConfig, arm: Arm, tell: Tell) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref()).map_err(OpenError::Load)?;
        Self::open_with(api, config, arm, tell)
    }

    /// As [`open`](Self::open), with a library that is loaded already.
    pub fn open_with(api: Api, config: PhantomConfig, arm: Arm, tell: Tell) -> Result<Self, OpenError> {
        let (sample_in, samples) = triple_buffer::triple_buffer(&None);
        let (commands, command_out) = triple_buffer::triple_buffer(&Command::default());
        // Never freed, see `Servo`.
        let servo: &'static Servo = Box::leak(Box::new(Servo::new(Inner {
            api,
            placement: config.placement,
            arm,
            samples: sample_in,
            commands: command_out,
            servo_hz: config.servo_hz,
            state: State::default(),
        })));
        let (first, opened) = mpsc::channel();
        let keeper = Keeper::new(api, servo, config, tell).spawn(first);
        let description = match opened.recv_timeout(OPEN_LIMIT) {
            Ok(description) => description.map_err(OpenError::Trouble)?,
            Err(_) => return Err(OpenError::NoAnswer),
        };
        Ok(Self {
            description,
            servo,
            samples,
            commands,
            number: 0,
            _keeper: keeper,
        })
    }

    pub fn description(&self) -> &Description {
        &self.description
    }

    /// What the driver says beside the pose.
    pub fn readings(&self) -> Readings {
        self.servo.shared.readings()
    }

    fn command(&mut self, wrench: Wrench) {
        self.number += 1;
        self.commands.write(Command {
            wrench,
            number: self.number,
        });
    }
}

impl Device for Phantom {
    fn info(&self) -> DeviceInfo {
        self.description.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        match self.servo.shared.fault() {
            Some(fault) => Err(fault),
            None => self.samples.read().ok_or(DeviceFault::NotConnected),
        }
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        if !wrench.is_finite() {
            self.command(Wrench::zero());
            return Err(DeviceFault::NonFiniteWrench);
        }
        // While there is a fault, which `read` tells, the servo thread exerts nothing.
        self.command(wrench.within(&self.description.info));
        Ok(())
    }
}
