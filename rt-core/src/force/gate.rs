//! The last thing before the device: nothing else may write a force.
//!
//! Order: finite check → force scale → ramp → magnitude and continuous (thermal) limit → slew limit → the
//! device's own limit. The magnitude comes before the slew, since a step from one force inside a ball
//! towards another stays inside: so both limits hold at once. The device's own limit comes last, whatever
//! the settings are. A fault ramps to zero from the last force and latches until [`GateState::engage`].

use core::fmt;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::DeviceInfo;

use super::check::{Problem, Problems};

/// Ticks of the ramp to zero.
pub const RAMP_OUT_TICKS: u32 = 20;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GateParameters {
    /// Force of the device for each newton of the model: real needles reach 9 to 16 N. Shown to the operator.
    pub force_scale: f64,
    pub max_force_n: f64,
    pub slew_n_per_s: f64,
    pub ramp_in_ticks: u32,
    /// The ramp out keeps to its ticks even where that is steeper than the slew limit.
    pub ramp_out_ticks: u32,
    /// Time constant of the motors' warming, for the limit on continuous force.
    pub thermal_time_s: f64,
}

impl Default for GateParameters {
    fn default() -> Self {
        Self {
            force_scale: 1.0,
            max_force_n: 8.5,
            slew_n_per_s: 500.0,
            ramp_in_ticks: 200,
            ramp_out_ticks: RAMP_OUT_TICKS,
            thermal_time_s: 600.0,
        }
    }
}

impl GateParameters {
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.range("gate.force_scale", self.force_scale, 0.0, 2.0);
        problems.range("gate.max_force_n", self.max_force_n, 0.0, 40.0);
        problems.range("gate.slew_n_per_s", self.slew_n_per_s, 1.0, 1e5);
        problems.range("gate.ramp_in_ticks", f64::from(self.ramp_in_ticks), 1.0, 1e4);
        problems.range("gate.ramp_out_ticks", f64::from(self.ramp_out_ticks), 1.0, 100.0);
        problems.range("gate.thermal_time_s", self.thermal_time_s, 1.0, 1e5);
        problems.finish()
    }
}

/// Why the force goes to zero. The numbers are stable: they appear in records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum ForceFault {
    NonFiniteForce = 1,
    DeviceFault = 2,
    StaleDevice = 3,
    StaleTissue = 4,
    Overrun = 5,
    Stopped = 6,
}

impl ForceFault {
    pub const fn code(self) -> u32 {
        self as u32
    }
}

impl fmt::Display for ForceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NonFiniteForce => "the force law gave a force that is not a number",
            Self::DeviceFault => "the device reported a fault",
            Self::StaleDevice => "the device repeats an old sample",
            Self::StaleTissue => "the tissue has not answered in time",
            Self::Overrun => "the force loop missed its deadlines",
            Self::Stopped => "the operator stopped the force",
        })
    }
}

/// How often each limit had a say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GateCounts {
    pub non_finite: u64,
    pub magnitude_limited: u64,
    pub thermal_limited: u64,
    pub slew_limited: u64,
    pub device_limited: u64,
    pub faults: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Mode {
    /// Zero force, or on the way there from `from_n`.
    RampOut {
        from_n: Vector3<f64>,
        ticks: u32,
    },
    Engaged {
        ticks: u32,
    },
}

/// One for a device. Begins disengaged, at zero force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GateState {
    mode: Mode,
    fault: Option<ForceFault>,
    output_n: Vector3<f64>,
    /// Mean square of the force over the thermal time.
    heat_n2: f64,
    counts: GateCounts,
}

/// What goes to the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateOutput {
    pub force_n: Vector3<f64>,
    pub engaged: bool,
    pub fault: Option<ForceFault>,
}

impl Default for GateState {
    fn default() -> Self {
        Self {
            mode: Mode::RampOut {
                from_n: Vector3::zeros(),
                ticks: 0,
            },
            fault: None,
            output_n: Vector3::zeros(),
            heat_n2: 0.0,
            counts: GateCounts::default(),
        }
    }
}

impl GateState {
    /// Ramps the force in, and forgets the last fault.
    pub fn engage(&mut self) {
        if !self.engaged() {
            self.mode = Mode::Engaged { ticks: 0 };
        }
        self.fault = None;
    }

    /// Ramps the force out.
    pub fn release(&mut self) {
        if self.engaged() {
            self.mode = Mode::RampOut {
                from_n: self.output_n,
                ticks: 0,
            };
        }
    }

    /// Ramps the force out because of `fault`. The first fault is kept.
    pub fn trip(&mut self, fault: ForceFault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
            self.counts.faults = self.counts.faults.wrapping_add(1);
        }
        self.release();
    }

    pub fn engaged(&self) -> bool {
        matches!(self.mode, Mode::Engaged { .. })
    }

    pub fn fault(&self) -> Option<ForceFault> {
        self.fault
    }

    /// What the last tick gave the device.
    pub fn output_n(&self) -> &Vector3<f64> {
        &self.output_n
    }

    pub fn counts(&self) -> &GateCounts {
        &self.counts
    }

    /// Root mean square of the force over the thermal time, to show beside the continuous limit.
    pub fn warmth_n(&self) -> f64 {
        self.heat_n2.sqrt()
    }
}

/// One tick. `wanted_n` is the model's force on the operator.
pub fn step(
    parameters: &GateParameters,
    device: &DeviceInfo,
    state: &mut GateState,
    wanted_n: &Vector3<f64>,
    dt_s: f64,
) -> GateOutput {
    let finite = wanted_n.iter().all(|x| x.is_finite());
    if !finite {
        state.counts.non_finite = state.counts.non_finite.wrapping_add(1);
        state.trip(ForceFault::NonFiniteForce);
    }
    let next_n = match &mut state.mode {
        Mode::Engaged { ticks } => {
            *ticks = ticks.saturating_add(1).min(parameters.ramp_in_ticks);
            let ramp = f64::from(*ticks) / f64::from(parameters.ramp_in_ticks.max(1));
            let scaled_n = wanted_n * (parameters.force_scale * ramp.min(1.0));
            let allowed_n = within_magnitude(parameters, device, state, scaled_n);
            within_slew(parameters, state, allowed_n, dt_s)
        }
        Mode::RampOut { from_n, ticks } => {
            *ticks = ticks.saturating_add(1).min(parameters.ramp_out_ticks.max(1));
            *from_n * (1.0 - f64::from(*ticks) / f64::from(parameters.ramp_out_ticks.max(1)))
        }
    };
    let (next_n, cut) = limited(next_n, device.peak_force_n);
    state.counts.device_limited = state.counts.device_limited.wrapping_add(u64::from(cut));
    // Settings that are not numbers end here.
    state.output_n = if next_n.iter().all(|x| x.is_finite()) {
        next_n
    } else {
        state.trip(ForceFault::NonFiniteForce);
        Vector3::zeros()
    };
    let share = (dt_s / parameters.thermal_time_s).clamp(0.0, 1.0);
    if share.is_finite() {
        state.heat_n2 += share * (state.output_n.norm_squared() - state.heat_n2);
    }
    GateOutput {
        force_n: state.output_n,
        engaged: state.engaged(),
        fault: state.fault,
    }
}

/// The magnitude limit, which falls to the device's continuous force as the motors warm up: over the last
/// fifth of what they can take, so that nothing drops in the operator's hand.
fn within_magnitude(
    parameters: &GateParameters,
    device: &DeviceInfo,
    state: &mut GateState,
    force_n: Vector3<f64>,
) -> Vector3<f64> {
    let (force_n, cut) = limited(force_n, parameters.max_force_n);
    state.counts.magnitude_limited = state.counts.magnitude_limited.wrapping_add(u64::from(cut));
    let continuous_n = device.continuous_force_n;
    let spare = (5.0 * (1.0 - state.heat_n2 / (continuous_n * continuous_n))).clamp(0.0, 1.0);
    let warm_limit_n = continuous_n + (device.peak_force_n - continuous_n) * spare;
    // Cold motors leave this to the device's own limit.
    if spare >= 1.0 {
        return force_n;
    }
    let (force_n, cut) = limited(force_n, warm_limit_n);
    state.counts.thermal_limited = state.counts.thermal_limited.wrapping_add(u64::from(cut));
    force_n
}

fn within_slew(parameters: &GateParameters, state: &mut GateState, force_n: Vector3<f64>, dt_s: f64) -> Vector3<f64> {
    let longest_n = (parameters.slew_n_per_s * dt_s).max(0.0);
    let (change_n, cut) = limited(force_n - state.output_n, longest_n);
    state.counts.slew_limited = state.counts.slew_limited.wrapping_add(u64::from(cut));
    state.output_n + change_n
}

/// The same direction, no longer than `limit`; and whether that cut anything.
fn limited(v: Vector3<f64>, limit: f64) -> (Vector3<f64>, bool) {
    // Scaled first: the square of a huge length is not finite.
    let largest = v.amax();
    if largest <= 0.0 {
        return (v, false);
    }
    let scaled = v / largest;
    let size = scaled.norm();
    if size * largest <= limit {
        (v, false)
    } else {
        (scaled * (limit / size), true)
    }
}

#[cfg(test)]
#[path = "gate_tests.rs"]
mod tests;
