//! One connection to a device, from opening to closing: the calls that may block, made by one thread.

use core::ffi::{c_int, c_uchar};
use core::fmt;

use crate::device::DeviceInfo;
use crate::drd::errors;
use crate::drd::ffi::{Api, Id, STATUS_ROOM};
use crate::drd::model;
use crate::drd::status::Status;
use crate::driver_thread::arm::ArmError;
use crate::driver_thread::served::Described;
use crate::library::text;

/// Watchdog period, in units of 125 us, after which the device drops a force that is not renewed.
const WATCHDOG_UNITS: c_uchar = 160;
const WATCHDOG_UNIT_S: f64 = 125e-6;

/// Reason why there is no connection; the text says what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConnectionError {
    /// The device with this number does not open.
    #[error("device {number} of {count} does not open: {error} ({code}): {cure}", error = errors::known(*code).name, cure = errors::cure(*code))]
    NoDevice {
        /// Requested number, from 0.
        number: u8,
        /// Number of devices that the SDK counts.
        count: i32,
        /// The SDK's error.
        code: u32,
    },
    /// No limits are known for this type.
    #[error("the device is a \"{name}\" (type {system_type}), of which no limits are known; known are: {known}", known = model::known_models())]
    WrongModel {
        /// The SDK's name.
        name: String,
        /// The SDK's number.
        system_type: i32,
    },
    /// Another device answers after a reconnection: the force loop has the limits of `was`.
    #[error("a \"{is}\" came back in place of the {was}: plug that in, or restart rt-core")]
    OtherModel {
        /// Model of the first connection.
        was: &'static str,
        /// Model that answers now.
        is: &'static str,
    },
    /// The named call failed with this error code.
    #[error("{0} failed with {error} ({1}): {cure}", error = errors::known(*.1).name, cure = errors::cure(*.1))]
    Call(&'static str, u32),
    /// The servo thread was not granted the rights that it needs.
    #[error("the servo thread is not real-time: {0}")]
    NotArmed(#[source] ArmError),
    /// The servo thread did not start, or has not come back from the driver.
    #[error("the servo thread does not run: restart rt-core")]
    NoServo,
}

/// Properties of the device as the SDK reports them.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Limits and encoder step.
    pub info: DeviceInfo,
    /// Name as the SDK spells it.
    pub name: String,
    /// Serial number, where the device has one.
    pub serial: Option<u16>,
    /// Version of the SDK, where it has one.
    pub sdk: Option<[i32; 4]>,
    /// Time after which the device drops a stale force by itself, once its watchdog is armed.
    pub watchdog_s: Option<f64>,
}

impl Described for Description {
    fn info(&self) -> DeviceInfo {
        self.info
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { info, name, .. } = self;
        write!(f, "{} (\"{name}\")", info.name)?;
        if let Some(serial) = self.serial {
            write!(f, ", serial {serial}")?;
        }
        if let Some(version) = self.sdk {
            write!(f, ", SDK {}", version_text(version))?;
        }
        let axes = if info.peak_torque_nm > 0.0 { 6 } else { 3 };
        write!(f, ", {axes} axes of force, at most {:.1} N", info.peak_force_n)
    }
}

/// Formats a version as the vendor writes it.
pub fn version_text([major, minor, release, revision]: [i32; 4]) -> String {
    format!("{major}.{minor}.{release}-{revision}")
}

/// Returns the version of the SDK, if it reports one.
pub fn sdk_version(api: &Api) -> Option<[i32; 4]> {
    let [mut major, mut minor, mut release, mut revision] = [0; 4];
    let get = api.dhdGetSDKVersion?;
    // SAFETY: one number each, as the interface states.
    unsafe { get(&mut major, &mut minor, &mut release, &mut revision) };
    Some([major, minor, release, revision])
}

/// An open device.
pub struct Session {
    api: Api,
    /// The SDK's number of the open device.
    pub id: Id,
}

impl Session {
    /// Opens the device with this number.
    pub fn open(api: &Api, number: u8) -> Result<Self, ConnectionError> {
        // SAFETY: no preconditions.
        let count = unsafe { (api.dhdGetDeviceCount)() };
        let failed = |code| ConnectionError::NoDevice { number, count, code };
        let index = Id::try_from(number).map_err(|_| failed(15))?;
        // SAFETY: no preconditions.
        let answer = unsafe { (api.dhdOpenID)(index) };
        match Id::try_from(answer) {
            Ok(id) if id >= 0 => Ok(Self { api: *api, id }),
            _ => Err(failed(last_error(api))),
        }
    }

    /// Queries model, versions and limits.
    pub fn describe(&self) -> Result<Description, ConnectionError> {
        // SAFETY: the number is the SDK's own.
        let system_type = unsafe { (self.api.dhdGetSystemType)(self.id) };
        self.check("dhdGetSystemType", system_type)?;
        // SAFETY: the number is the SDK's own; the string is the SDK's and ends with zero.
        let name = self.api.dhdGetSystemName.map(|get| unsafe { text(get(self.id)) });
        let name = name.unwrap_or_else(|| "unknown".to_owned());
        // SAFETY: the number is the SDK's own.
        let active_wrist = self.api.dhdHasActiveWrist.is_none_or(|has| unsafe { has(self.id) });
        let info = model::figures(system_type, active_wrist).ok_or(ConnectionError::WrongModel {
            name: name.clone(),
            system_type,
        })?;
        Ok(Description {
            info,
            name,
            serial: self.serial(),
            sdk: sdk_version(&self.api),
            watchdog_s: None,
        })
    }

    fn serial(&self) -> Option<u16> {
        let mut serial = 0;
        let get = self.api.dhdGetSerialNumber?;
        // SAFETY: one number, as the interface states.
        (unsafe { get(&mut serial, self.id) } >= 0).then_some(serial)
    }

    /// Queries the state of the device.
    pub fn status(&self) -> Result<Status, ConnectionError> {
        let mut numbers = [0; STATUS_ROOM];
        // SAFETY: there is room for more numbers than any version writes.
        let answer = unsafe { (self.api.dhdGetStatus)(numbers.as_mut_ptr(), self.id) };
        self.check("dhdGetStatus", answer)?;
        Ok(numbers)
    }

    /// Arms the device's watchdog and limits. Returns the time after which it drops a stale force,
    /// if it has a watchdog.
    pub fn guard(&self, info: &DeviceInfo) -> Option<f64> {
        let (api, id) = (&self.api, self.id);
        // SAFETY: no preconditions but the SDK's own number. Calls that a version or a device lacks
        // are refused without effect.
        unsafe {
            if let Some(enable) = api.dhdEnableExpertMode {
                enable();
            }
            if let Some(set) = api.dhdSetTimeGuard {
                set(0, id);
            }
            if let Some(set) = api.dhdSetMaxForce {
                set(info.peak_force_n, id);
            }
            if let Some(set) = api.dhdSetMaxTorque {
                set(info.peak_torque_nm, id);
            }
            let set = api.dhdSetWatchdog.is_some_and(|set| set(WATCHDOG_UNITS, id) >= 0);
            let mut units = WATCHDOG_UNITS;
            let read = api.dhdGetWatchdog.is_none_or(|get| get(&mut units, id) >= 0);
            if let Some(disable) = api.dhdDisableExpertMode {
                disable();
            }
            let armed = set && read && (1..=WATCHDOG_UNITS).contains(&units);
            armed.then_some(f64::from(units) * WATCHDOG_UNIT_S)
        }
    }

    /// Turns forces on, at zero: a device that refuses the zero may hold an older force.
    pub fn turn_on(&self) -> Result<(), ConnectionError> {
        // Forces are off, and it is unknown whether a device accepts a zero in that state.
        self.zero();
        // SAFETY: the number is the SDK's own.
        let answer = unsafe { (self.api.dhdEnableForce)(1, self.id) };
        self.check("dhdEnableForce", answer)?;
        let taken = self.check("dhdSetForceAndTorqueAndGripperForce", self.zero());
        if taken.is_err() {
            // SAFETY: the number is the SDK's own.
            unsafe { (self.api.dhdEnableForce)(0, self.id) };
        }
        taken
    }

    fn zero(&self) -> c_int {
        // SAFETY: the number is the SDK's own.
        unsafe { (self.api.dhdSetForceAndTorqueAndGripperForce)(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.id) }
    }

    /// Writes zero force, turns forces off and closes the device. Makes every call, whatever the
    /// earlier ones return.
    pub fn close(self) {
        self.zero();
        // SAFETY: the number is the SDK's own, used for the last time.
        unsafe {
            (self.api.dhdStop)(self.id);
            (self.api.dhdClose)(self.id);
        }
    }

    /// Closes a device whose forces were never turned on.
    pub fn close_untouched(self) {
        // SAFETY: the number is the SDK's own, used for the last time.
        unsafe { (self.api.dhdClose)(self.id) };
    }

    fn check(&self, call: &'static str, answer: c_int) -> Result<(), ConnectionError> {
        if answer >= 0 {
            Ok(())
        } else {
            Err(ConnectionError::Call(call, last_error(&self.api)))
        }
    }
}

/// Returns the SDK's number of the last error of this thread, after a call that failed.
pub fn last_error(api: &Api) -> u32 {
    // SAFETY: no preconditions.
    let code = unsafe { (api.dhdErrorGetLast)() };
    u32::try_from(code)
        .ok()
        .filter(|code| *code > 0)
        .unwrap_or(errors::ERROR)
}
