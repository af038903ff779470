//! A Phantom as a [`Device`]: wait-free ends for the force loop.

use std::path::PathBuf;

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::driver_thread::arm::Arm;
use crate::driver_thread::ends::{self, ForceLoopEnd};
use crate::driver_thread::keeper::{self, KeeperThread, Report};
use crate::driver_thread::open;
use crate::libhd::connector::Connector;
use crate::libhd::exchange::Readings;
use crate::libhd::ffi::Api;
use crate::libhd::servo::{Inner, Servo, State};
use crate::libhd::session::{ConnectionError, Description};
use crate::placement::Placement;

/// Device to open, and its place in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct PhantomConfig {
    /// The driver's library; `None` tries its usual names.
    pub library: Option<PathBuf>,
    /// Name of the device in the driver's set-up; `None` takes the default one.
    pub name: Option<String>,
    /// Place of the device in the world.
    pub placement: Placement,
    /// Rate of the driver's servo loop, Hz: 500, 1000 or 2000 on a parallel port. The module's
    /// documentation explains the delay that it causes.
    pub servo_hz: u32,
}

/// Reason why a Phantom could not be opened; the text says what to do.
pub type OpenError = open::OpenError<ConnectionError>;

/// A Phantom; see the module [`libhd`](crate::libhd). Dropping it leaves zero force and a disabled device.
pub struct Phantom {
    description: Description,
    servo: &'static Servo,
    end: ForceLoopEnd,
    _keeper: KeeperThread,
}

impl Phantom {
    /// Loads the driver and finds the device. `arm` runs once in each servo thread, before its
    /// first tick is served. `report` receives messages for the operator, from a thread of normal
    /// priority.
    ///
    /// A device that is not calibrated is opened too: it reads [`DeviceFault::NotCalibrated`] until
    /// the operator has followed the reported instruction.
    pub fn open(config: PhantomConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref())?;
        Self::open_with(api, config, arm, report)
    }

    /// Like [`open`](Self::open), with a library that is already loaded.
    pub fn open_with(api: Api, config: PhantomConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let (end, servo_end) = ends::pair();
        // Never freed, see `Servo`.
        let servo: &'static Servo = Box::leak(Box::new(Servo::new(Inner {
            api,
            placement: config.placement,
            arm,
            end: servo_end,
            servo_hz: config.servo_hz,
            state: State::default(),
        })));
        let (keeper, opened) = keeper::spawn("phantom", Connector::new(api, servo, config), report);
        let description = open::first(&opened)?;
        Ok(Self {
            description,
            servo,
            end,
            _keeper: keeper,
        })
    }

    /// Properties of the device at the first connection.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Returns the state of the driver, without the pose.
    pub fn readings(&self) -> Readings {
        self.servo.shared.readings()
    }
}

impl Device for Phantom {
    fn info(&self) -> DeviceInfo {
        self.description.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        self.end.read(self.servo.shared.fault.get())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.end.write(&self.description.info, wrench)
    }
}
