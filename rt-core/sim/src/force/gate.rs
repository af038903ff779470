//! The safety gate, last before the device: nothing else may write a force.
//!
//! Order: finite → force scale and ramp → passivity → slew → magnitude → continuous (thermal) → the device's own
//! limit. The slew limit comes before the magnitudes: each of those is a pull towards zero onto a ball that the
//! last force is in, which makes no step longer. So all limits hold at once. The device's own limit comes
//! last, whatever the settings are. A fault ramps to zero from the last force and latches until
//! [`GateState::engage`].

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_device::{DeviceInfo, Wrench};

use super::passivity::{self, Motion, PassivityState};
use super::thermal::Warmth;

mod fault;
mod parameters;

pub use fault::{ForceFault, GateCounts};
pub use parameters::{GateParameters, RAMP_OUT_TICKS};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Mode {
    /// Zero force, or on the way there from `from`.
    RampOut {
        from: Wrench,
        ticks: u32,
    },
    /// Asked to engage while the model still asks for too much. A ramp out continues to its end.
    Waiting {
        from: Wrench,
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
    output: Wrench,
    warmth: Warmth,
    passivity: PassivityState,
    counts: GateCounts,
}

/// Force and torque of the model, with the motion over which they were computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateInput {
    /// Wrench of the force law, before the force scale.
    pub wanted: Wrench,
    /// Constant part of its force (`F_G`): what it gives on the way up it takes on the way down.
    pub constant_n: Vector3<f64>,
    /// Energy in the springs of the model.
    pub stored_j: f64,
    /// Motion in the last tick.
    pub motion: Motion,
}

/// Output of the gate for the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateOutput {
    /// Within every limit.
    pub wrench: Wrench,
    /// Set while the device renders the force of the law.
    pub engaged: bool,
    /// Why the force goes to zero.
    pub fault: Option<ForceFault>,
}

impl Default for GateState {
    fn default() -> Self {
        Self {
            mode: Mode::RampOut {
                from: Wrench::zero(),
                ticks: 0,
            },
            fault: None,
            output: Wrench::zero(),
            warmth: Warmth::default(),
            passivity: PassivityState::default(),
            counts: GateCounts::default(),
        }
    }
}

impl GateState {
    /// Ramps the force in as soon as it is small, and forgets the last fault.
    pub fn engage(&mut self) {
        if let Mode::RampOut { from, ticks } = self.mode {
            self.mode = Mode::Waiting { from, ticks };
        }
        self.fault = None;
    }

    /// Ramps the force out.
    pub fn release(&mut self) {
        match self.mode {
            Mode::RampOut { .. } => {}
            Mode::Waiting { from, ticks } => self.mode = Mode::RampOut { from, ticks },
            Mode::Engaged { .. } => {
                self.mode = Mode::RampOut {
                    from: self.output,
                    ticks: 0,
                }
            }
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

    /// Returns whether the force is engaged, or will be as soon as it is small.
    pub fn engaged(&self) -> bool {
        !matches!(self.mode, Mode::RampOut { .. })
    }

    /// Returns whether it is to engage while the model still asks for too much.
    pub fn waiting(&self) -> bool {
        matches!(self.mode, Mode::Waiting { .. })
    }

    /// Returns the reason for which the force went to zero, until it is engaged again.
    pub fn fault(&self) -> Option<ForceFault> {
        self.fault
    }

    /// Returns the wrench of the last tick.
    pub fn output(&self) -> &Wrench {
        &self.output
    }

    /// Returns how often each limit acted.
    pub fn counts(&self) -> &GateCounts {
        &self.counts
    }

    /// Returns the energy account.
    pub fn passivity(&self) -> &PassivityState {
        &self.passivity
    }

    /// Returns the root mean square of the force over the thermal time, to show with the continuous limit.
    pub fn warmth_n(&self) -> f64 {
        self.warmth.rms_n()
    }
}

/// Advances by one tick.
pub fn step(parameters: &GateParameters, device: &DeviceInfo, state: &mut GateState, input: &GateInput) -> GateOutput {
    if !input.wanted.is_finite() {
        state.counts.non_finite = state.counts.non_finite.wrapping_add(1);
        state.trip(ForceFault::NonFiniteForce);
    }
    let small = (input.wanted.force_n - input.constant_n).norm() * parameters.force_scale <= parameters.engage_below_n;
    if state.waiting() && small {
        state.mode = Mode::Engaged { ticks: 0 };
        state.passivity = PassivityState::default();
    }
    let ramp_out = parameters.ramp_out_ticks.max(1);
    let mut constant_n = Vector3::zeros();
    let next = match &mut state.mode {
        Mode::Engaged { ticks } => {
            *ticks = ticks.saturating_add(1).min(parameters.ramp_in_ticks);
            let ramp = f64::from(*ticks) / f64::from(parameters.ramp_in_ticks.max(1));
            let share = parameters.force_scale * ramp.min(1.0);
            constant_n = input.constant_n * share;
            within_limits(parameters, device, state, input, share)
        }
        Mode::Waiting { from, ticks } | Mode::RampOut { from, ticks } => {
            *ticks = ticks.saturating_add(1).min(ramp_out);
            scaled(from, 1.0 - f64::from(*ticks) / f64::from(ramp_out))
        }
    };
    let (force_n, cut) = limited(next.force_n, device.peak_force_n);
    let (torque_nm, turned) = limited(next.torque_nm, device.peak_torque_nm);
    count(&mut state.counts.device_limited, cut || turned);
    let next = Wrench { force_n, torque_nm };
    // Settings that are not numbers end here, and the ramp out begins at what the device was given: zero.
    let is_finite = next.is_finite();
    state.output = if is_finite { next } else { Wrench::zero() };
    if !is_finite {
        state.trip(ForceFault::NonFiniteForce);
    }
    // What is the same everywhere stores what it takes: no motion that ends where it began gets any of it.
    state.passivity.book(&(state.output.force_n - constant_n));
    let dt_s = input.motion.dt_s;
    state
        .warmth
        .add(state.output.force_n.norm(), dt_s, parameters.thermal_time_s);
    GateOutput {
        wrench: state.output,
        engaged: state.engaged() && !state.waiting(),
        fault: state.fault,
    }
}

/// Applies passivity → slew → magnitude → continuous limit; the torque has slew and magnitude.
fn within_limits(
    parameters: &GateParameters,
    device: &DeviceInfo,
    state: &mut GateState,
    input: &GateInput,
    share: f64,
) -> Wrench {
    let (dt_s, counts) = (input.motion.dt_s, &mut state.counts);
    let wanted_n = input.wanted.force_n * share;
    let stored_j = input.stored_j * share;
    let passive_n = passivity::step(
        &parameters.passivity,
        &mut state.passivity,
        &input.motion,
        stored_j,
        &wanted_n,
    );
    count(&mut counts.passivity, state.passivity.in_debt());
    let (slewed_n, cut) = within_slew(&state.output.force_n, &passive_n, parameters.slew_n_per_s * dt_s);
    count(&mut counts.slew_limited, cut);
    let (force_n, cut) = limited(slewed_n, parameters.max_force_n);
    count(&mut counts.magnitude_limited, cut);
    let warm_limit_n = state.warmth.limit_n(device.peak_force_n, device.continuous_force_n);
    // Cold motors leave this to the device's own limit.
    let (force_n, cut) = warm_limit_n.map_or((force_n, false), |limit_n| limited(force_n, limit_n));
    count(&mut counts.thermal_limited, cut);
    let wanted_nm = input.wanted.torque_nm * share;
    let longest_nm = parameters.torque_slew_nm_per_s * dt_s;
    let (slewed_nm, cut) = within_slew(&state.output.torque_nm, &wanted_nm, longest_nm);
    let (torque_nm, too_large) = limited(slewed_nm, device.peak_torque_nm);
    count(&mut counts.torque_limited, cut || too_large);
    Wrench { force_n, torque_nm }
}

fn count(counter: &mut u64, acted: bool) {
    *counter = counter.wrapping_add(u64::from(acted));
}

fn scaled(wrench: &Wrench, share: f64) -> Wrench {
    Wrench {
        force_n: wrench.force_n * share,
        torque_nm: wrench.torque_nm * share,
    }
}

fn within_slew(from: &Vector3<f64>, to: &Vector3<f64>, longest: f64) -> (Vector3<f64>, bool) {
    let (change, cut) = limited(to - from, longest.max(0.0));
    (from + change, cut)
}

/// Returns the same direction, no longer than `limit`; and whether that cut anything.
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
mod tests;
