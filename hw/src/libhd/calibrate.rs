//! Calibration, one step at a time, with what the operator has to do.

use core::ffi::c_int;

use crate::libhd::ffi::{Api, Handle, calibration, parameter, style};
use crate::libhd::session::{Trouble, last_error};

/// Where calibration stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Calibration {
    Done,
    /// Something was updated; ask again.
    Updated,
    /// The operator has to do this first.
    Waits(&'static str),
}

const INKWELL: &str =
    "The device is not calibrated. Put the stylus into the inkwell and leave it there until this message goes.";
const NEUTRAL: &str = "The device is not calibrated. Hold the arm in its neutral pose, upper link level, lower link \
                       upright, stylus straight ahead, and press the button of the stylus.";
const MOVE: &str = "The device is not calibrated. Move the arm slowly through its whole range until this message goes.";

/// Asks, and updates what can be updated. The scheduler does not run.
///
/// A reset of the encoders takes the pose of that moment for the neutral one: so it waits for the button.
pub fn step(api: &Api, handle: Handle) -> Result<Calibration, Trouble> {
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
    Ok(Calibration::Waits(match style {
        style::INKWELL => INKWELL,
        style::AUTO => MOVE,
        _ => NEUTRAL,
    }))
}

/// The inkwell is the surest; a device that names none is reset, as the Premium is.
fn chosen_style(api: &Api) -> u32 {
    let mut styles: c_int = 0;
    // SAFETY: one number, as the interface states.
    unsafe { (api.hdGetIntegerv)(parameter::CALIBRATION_STYLE, &mut styles) };
    if last_error(api) != 0 || styles == 0 {
        // Newer libraries tell it here.
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

fn button_pressed(api: &Api, handle: Handle) -> Result<bool, Trouble> {
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

fn check(api: &Api, call: &'static str) -> Result<(), Trouble> {
    match last_error(api) {
        0 => Ok(()),
        code => Err(Trouble::Call(call, code)),
    }
}
