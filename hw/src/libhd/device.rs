//! A Phantom, opened.

use std::path::PathBuf;

use crate::driver_thread::arm::Arm;
use crate::driver_thread::keeper::Report;
use crate::driver_thread::open;
use crate::driver_thread::served::Served;
use crate::libhd::connector::Connector;
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
pub type Phantom = Served<Description>;

impl Phantom {
    /// Loads the driver and finds the device. `arm` runs once in each servo thread, before its
    /// first tick is served. `report` receives messages for the operator, from a thread of normal
    /// priority.
    ///
    /// A device that is not calibrated is opened too: it reads [`crate::DeviceFault::NotCalibrated`] until
    /// the operator has followed the reported instruction.
    pub fn open(config: PhantomConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref())?;
        Self::open_with(api, config, arm, report)
    }

    /// Like [`open`](Self::open), with a library that is already loaded.
    pub fn open_with(api: Api, config: PhantomConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        Self::start("phantom", report, |shared, end| {
            let inner = Inner {
                api,
                placement: config.placement,
                arm,
                end,
                servo_hz: config.servo_hz,
                state: State::default(),
            };
            // Never freed, see `Servo`.
            let servo: &'static Servo = Box::leak(Box::new(Servo::new(inner, shared)));
            Connector::new(api, servo, config)
        })
    }
}
