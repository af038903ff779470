//! Calibration, one step at a time, with instructions for the operator.

use core::ffi::c_int;

use crate::libhd::ffi::{Api, Handle, calibration, parameter, style};
use crate::libhd::session::{ConnectionError, last_error};

/// State of the calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Calibration {
    /// The device is calibrated.
    Done,
    /// The calibration was updated; check again.
    Updated,
    /// The operator has to follow this instruction first.
    NeedsOperator(&'static str),
}

const INKWELL: &str =
    "The device is not calibrated. Put the stylus into the inkwell and leave it there until this message disappears.";
const NEUTRAL: &str = "The device is not calibrated. Hold the arm in its neutral pose, upper link level, lower link \
                       upright, stylus straight ahead, and press the button of the stylus.";
const MOVE: &str =
    "The device is not calibrated. Move the arm slowly through its whole range until this message disappears.";

/// Checks the calibration, and updates it if that is possible now. The scheduler must be stopped.
///
/// Resetting the encoders makes the present pose the neutral one, so it waits for the button.
pub fn step(api: &Api, handle: Handle) -> Result<Calibration, ConnectionError> {
    // SAFETY: no preconditions.
    let state = unsafe { (api.hdCheckCalibration)() };
    check(api, "hdCheckCalibration")?;
    if state == calibration::OK {
        return Ok(Calibration::Done);
    }
    let style = chosen_style(api);
    let ready = match style {
        style::ENCODER_RESET => button_pressed(api, handle)?,
        _ => state == calibration::NEEDS_UPDATE,
    };
    if ready {
        // SAFETY: no preconditions.
        unsafe { (api.hdUpdateCalibration)(style) };
        check(api, "hdUpdateCalibration")?;
        return Ok(Calibration::Updated);
    }
    Ok(Calibration::NeedsOperator(match style {
        style::INKWELL => INKWELL,
        style::AUTO => MOVE,
        _ => NEUTRAL,
    }))
}

/// Returns the calibration style: the inkwell as the most reliable one, or an encoder reset for a
/// device that reports none, as the Premium does.
fn chosen_style(api: &Api) -> u32 {
    let mut styles: c_int = 0;
    // SAFETY: one number, as the interface states.
    unsafe { (api.hdGetIntegerv)(parameter::CALIBRATION_STYLE, &mut styles) };
    if last_error(api) != 0 || styles == 0 {
        // Newer libraries report it here.
        // SAFETY: no preconditions.
        styles = unsafe { (api.hdCheckCalibrationStyle)() } as c_int;
        let _ = last_error(api);
    }
    let offered = |style: u32| styles as u32 & style != 0;
    [style::INKWELL, style::ENCODER_RESET, style::AUTO]
        .into_iter()
        .find(|&s| offered(s))
        .unwrap_or(style::ENCODER_RESET)
}

fn button_pressed(api: &Api, handle: Handle) -> Result<bool, ConnectionError> {
    let mut buttons: c_int = 0;
    // SAFETY: the handle is the driver's own; one number, as the interface states.
    unsafe {
        (api.hdBeginFrame)(handle);
        (api.hdGetIntegerv)(parameter::BUTTONS, &mut buttons);
        (api.hdEndFrame)(handle);
    }
    check(api, "hdBeginFrame")?;
    Ok(buttons != 0)
}

fn check(api: &Api, call: &'static str) -> Result<(), ConnectionError> {
    match last_error(api) {
        0 => Ok(()),
        code => Err(ConnectionError::Call(call, code)),
    }
}
