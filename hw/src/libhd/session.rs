//! One connection to a device, from initialisation to disabling: the calls that may block, made by one thread.

use core::ffi::{CStr, c_int};
use core::fmt;
use std::ffi::CString;

use crate::device::DeviceInfo;
use crate::driver_thread::arm::ArmError;
use crate::driver_thread::served::Described;
use crate::libhd::errors;
use crate::libhd::ffi::{
    Api, Callback, Enum, Handle, INVALID_HANDLE, PRIORITY_MAX, Schedule, WAIT_CHECK_STATUS, capability, parameter,
};
use crate::libhd::model;
use crate::library::text;

/// Names that the driver's old and new set-up programs give the first device; omitting the name
/// fails on some systems.
const DEVICE_NAMES: &[&CStr] = &[c"Default PHANToM", c"Default Device"];

/// Reason why there is no connection; the text says what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConnectionError {
    /// No name could be initialised; each with the driver's error code.
    #[error("the driver finds no device{}", attempts(.0))]
    NoDevice(Vec<(String, u32)>),
    /// No limits are known for this model.
    #[error("the device is a \"{0}\", of which no limits are known; known are: {known}", known = model::known_models())]
    WrongModel(String),
    /// Another device answers after a reconnection: the force loop has the limits of `was`.
    #[error("a \"{is}\" came back in place of the {was}: plug that in, or restart rt-core")]
    OtherModel {
        /// Model of the first connection.
        was: &'static str,
        /// Model that answers now.
        is: String,
    },
    /// The named call failed with this error code.
    #[error("{0} failed with {error} (0x{1:04x}): {cure}", error = errors::known(*.1).name, cure = errors::cure(*.1))]
    Call(&'static str, u32),
    /// The driver does not switch forces on.
    #[error("the driver does not switch forces on: check the power of the amplifiers")]
    NoForce,
    /// The scheduler runs, but no callback arrived.
    #[error("the driver's servo loop does not run: check the device's power, its cable and the port's mode")]
    NoCallback,
    /// The servo thread was not granted the rights that it needs.
    #[error("the driver's servo thread is not real-time: {0}")]
    NotArmed(#[source] ArmError),
}

fn attempts(tried: &[(String, u32)]) -> String {
    let line = |(name, code): &(String, u32)| {
        let error = errors::known(*code).name;
        format!("\n  {name}: {error} (0x{code:04x}): {}", errors::cure(*code))
    };
    tried.iter().map(line).collect()
}

/// Properties of the device as the driver reports them.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Limits and encoder step: the known figures of the model, lowered by the driver's report.
    pub info: DeviceInfo,
    /// Model name as the driver spells it.
    pub model: String,
    /// Serial number.
    pub serial: String,
    /// Version of the device driver.
    pub driver: String,
    /// Version of OpenHaptics.
    pub library: String,
    /// Number of axes with a motor: 6 means torques.
    pub output_dof: c_int,
}

impl Described for Description {
    fn info(&self) -> DeviceInfo {
        self.info
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, serial {}, driver {}, OpenHaptics {}, {} axes of force, at most {:.1} N ({:.1} N continuous)",
            self.model,
            self.serial,
            self.driver,
            self.library,
            self.output_dof,
            self.info.peak_force_n,
            self.info.continuous_force_n
        )
    }
}

/// An initialised device.
pub struct Session {
    api: Api,
    /// The driver's handle of the device.
    pub handle: Handle,
    schedule: Option<Schedule>,
    started: bool,
}

impl Session {
    /// Tries `name`, or the usual names and then the first device.
    pub fn open(api: &Api, name: Option<&str>) -> Result<Self, ConnectionError> {
        discard_errors(api);
        let mut names: Vec<Option<CString>> = Vec::new();
        match name {
            Some(name) => names.push(Some(CString::new(name).unwrap_or_default())),
            None => {
                names.extend(DEVICE_NAMES.iter().map(|n| Some((*n).to_owned())));
                names.push(None);
            }
        }
        let mut tried = Vec::new();
        for name in names {
            let pointer = name.as_ref().map_or(core::ptr::null(), |n| n.as_ptr());
            // SAFETY: null or a string that ends with zero and outlives the call.
            let handle = unsafe { (api.hdInitDevice)(pointer) };
            let error = last_error(api);
            if handle != INVALID_HANDLE && error == errors::SUCCESS {
                // SAFETY: the handle is the driver's own.
                unsafe { (api.hdMakeCurrentDevice)(handle) };
                return Ok(Self {
                    api: *api,
                    handle,
                    schedule: None,
                    started: false,
                });
            }
            let shown = name.map_or("(first device)".to_owned(), |n| n.to_string_lossy().into_owned());
            tried.push((shown, error));
        }
        Err(ConnectionError::NoDevice(tried))
    }

    /// Queries model, versions and limits.
    pub fn describe(&self) -> Result<Description, ConnectionError> {
        let model = self.string(parameter::MODEL);
        self.check("hdGetString")?;
        let figures = model::figures(&model).ok_or_else(|| ConnectionError::WrongModel(model.clone()))?;
        let (mut output_dof, mut peak_n, mut continuous_n) = (0, 0.0, 0.0);
        // SAFETY: one number each, as the interface states.
        unsafe {
            (self.api.hdGetIntegerv)(parameter::OUTPUT_DOF, &mut output_dof);
            (self.api.hdGetDoublev)(parameter::MAX_FORCE, &mut peak_n);
            (self.api.hdGetDoublev)(parameter::MAX_CONTINUOUS_FORCE, &mut continuous_n);
        }
        self.check("hdGetDoublev")?;
        let description = Description {
            info: model::with_reported(figures, peak_n, continuous_n, output_dof),
            serial: self.string(parameter::SERIAL),
            driver: self.string(parameter::DRIVER_VERSION),
            library: self.string(parameter::VERSION),
            model,
            output_dof,
        };
        // An old driver may lack some of the strings.
        discard_errors(&self.api);
        Ok(description)
    }

    /// Turns forces and limits on, schedules the callback at `rate_hz` and starts the scheduler.
    /// The driver's thread inherits policy and cores from the calling thread.
    ///
    /// # Safety
    ///
    /// `callback` may be called with `context` from any thread until the process ends.
    pub unsafe fn start(
        &mut self,
        callback: Callback,
        context: *mut core::ffi::c_void,
        rate_hz: u32,
    ) -> Result<(), ConnectionError> {
        for capability in capability::AT_START {
            // SAFETY: no preconditions.
            unsafe { (self.api.hdEnable)(capability) };
            self.check("hdEnable")?;
        }
        // SAFETY: no preconditions.
        if unsafe { (self.api.hdIsEnabled)(capability::FORCE_OUTPUT) } == 0 {
            return Err(ConnectionError::NoForce);
        }
        // SAFETY: by the contract of this function.
        let schedule = unsafe { (self.api.hdScheduleAsynchronous)(callback, context, PRIORITY_MAX) };
        self.check("hdScheduleAsynchronous")?;
        self.schedule = Some(schedule);
        // SAFETY: no preconditions.
        unsafe { (self.api.hdSetSchedulerRate)(rate_hz.into()) };
        self.check("hdSetSchedulerRate")?;
        // SAFETY: no preconditions.
        unsafe { (self.api.hdStartScheduler)() };
        self.started = true;
        self.check("hdStartScheduler")
    }

    /// Returns whether the driver still runs the callback.
    pub fn is_scheduled(&self) -> bool {
        // SAFETY: the schedule is the driver's own; the status check does not wait.
        self.schedule
            .is_some_and(|s| unsafe { (self.api.hdWaitForCompletion)(s, WAIT_CHECK_STATUS) } != 0)
    }

    /// Returns whether the scheduler was started.
    pub fn is_running(&self) -> bool {
        self.started
    }

    /// Stops, unschedules and disables; call it after the callbacks have written zero.
    pub fn close(self) {
        // SAFETY: handles are the driver's own, each used for the last time.
        unsafe {
            if self.started {
                (self.api.hdStopScheduler)();
            }
            if let Some(schedule) = self.schedule {
                (self.api.hdUnschedule)(schedule);
            }
            (self.api.hdDisable)(capability::FORCE_OUTPUT);
            (self.api.hdDisableDevice)(self.handle);
        }
        discard_errors(&self.api);
    }

    fn check(&self, call: &'static str) -> Result<(), ConnectionError> {
        match last_error(&self.api) {
            errors::SUCCESS => Ok(()),
            code => Err(ConnectionError::Call(call, code)),
        }
    }

    fn string(&self, what: Enum) -> String {
        // SAFETY: the driver gives null or a static string.
        unsafe { text((self.api.hdGetString)(what)) }
    }
}

/// Empties the error stack of the driver; returns the oldest error.
pub fn last_error(api: &Api) -> u32 {
    let mut oldest = errors::SUCCESS;
    // The driver's stack has its newest on top. It is bounded; so is this.
    for _ in 0..64 {
        // SAFETY: no preconditions.
        match unsafe { (api.hdGetError)() }.code {
            errors::SUCCESS => break,
            code => oldest = code,
        }
    }
    oldest
}

/// Empties the error stack of the driver.
pub fn discard_errors(api: &Api) {
    let _ = last_error(api);
}
