//! A Phantom as a [`Device`]: wait-free ends for the force loop.

use core::time::Duration;
use std::path::PathBuf;
use std::sync::mpsc;

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::libhd::connector::{Connector, ConnectorThread, Report};
use crate::libhd::exchange::{Command, Readings};
use crate::libhd::ffi::{Api, LoadError};
use crate::libhd::frame::Placement;
use crate::libhd::servo::{Arm, Inner, Servo, State};
use crate::libhd::session::{ConnectionError, Description};

/// Which device to open, and its place in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct PhantomConfig {
    /// The driver's library; `None` tries its usual names.
    pub library: Option<PathBuf>,
    /// The device's name in the driver's set-up; `None` takes the default one.
    pub name: Option<String>,
    /// Place of the device in the world.
    pub placement: Placement,
    /// Rate of the driver's servo loop, Hz: 500, 1000 or 2000 on a parallel port. The module's documentation explains the
    /// delay that follows from it.
    pub servo_hz: u32,
}

/// Why a Phantom could not be opened; the text says what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// The driver's library cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// There is no connection to a device.
    #[error(transparent)]
    Connection(#[from] ConnectionError),
    /// The driver does not return from initialisation.
    #[error("the driver does not answer: check the device's power and cable, then try again")]
    NoAnswer,
}

const OPEN_LIMIT: Duration = Duration::from_secs(15);

/// A Phantom; see the module [`libhd`](crate::libhd). Dropping it leaves zero force and a disabled device.
pub struct Phantom {
    description: Description,
    servo: &'static Servo,
    samples: triple_buffer::Output<Option<Sample>>,
    commands: triple_buffer::Input<Command>,
    number: u64,
    _connector: ConnectorThread,
}

impl Phantom {
    /// Loads the driver and finds the device. `arm` runs once in each servo thread, before its first tick is served;
    /// `report` receives messages for the operator, from a thread of normal priority.
    ///
    /// A device that is not calibrated is opened: it reads [`DeviceFault::NotCalibrated`] until the operator has followed
    /// the reported instruction.
    pub fn open(config: PhantomConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref())?;
        Self::open_with(api, config, arm, report)
    }

    /// As [`open`](Self::open), with a library that is already loaded.
    pub fn open_with(api: Api, config: PhantomConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
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
        let connector = Connector::new(api, servo, config, report).spawn(first);
        let description = match opened.recv_timeout(OPEN_LIMIT) {
            Ok(description) => description?,
            Err(_) => return Err(OpenError::NoAnswer),
        };
        Ok(Self {
            description,
            servo,
            samples,
            commands,
            number: 0,
            _connector: connector,
        })
    }

    /// Properties of the device at the first connection.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// State of the driver beside the pose.
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
        // While there is a fault, which `read` reports, the servo thread exerts no force.
        self.command(wrench.within(&self.description.info));
        Ok(())
    }
}
