//! The second device's flight recording, written each tick.

use super::response::ProbeResponse;
use crate::rt::device_tape::{DeviceEntry, DeviceFlight, DeviceTape};
use crate::rt::hand::HandMemory;
use crate::rt::recorder::Tape;
use serde::{Deserialize, Serialize};
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{SecondRecord, SecondState, flags};
use stylet_sim::force::{GateParameters, GateState, VelocityEstimator};

/// All state of the loop between ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct SecondMemory {
    /// Settings of the gate.
    pub gate_parameters: GateParameters,
    /// State of the last limits before the device.
    pub gate: GateState,
    /// Tip velocity from positions.
    pub estimator: VelocityEstimator,
    /// The hand that holds the device.
    pub hand: HandMemory,
    /// State shown to hosts.
    pub state: SecondState,
}

impl SecondMemory {
    /// Returns the memory before the first tick.
    pub fn new(info: &DeviceInfo, gate_parameters: GateParameters, is_real_time: bool) -> Self {
        let mut state: SecondState = bytemuck::Zeroable::zeroed();
        let bit = |set: bool, flag: u32| if set { flag } else { 0 };
        state.flags = bit(is_real_time, flags::REAL_TIME) | bit(info.simulated, flags::SIMULATED_DEVICE);
        state.device_limit_n = info.peak_force_n;
        state.parameters_generation = 1;
        Self {
            gate_parameters,
            gate: GateState::default(),
            estimator: VelocityEstimator::new(info.position_step_m),
            hand: HandMemory::default(),
            state,
        }
    }
}

/// Input and output of one tick.
pub type SecondEntry = DeviceEntry<ProbeResponse, SecondRecord>;
/// The last ticks of the loop.
pub type SecondTape = DeviceTape<SecondMemory, ProbeResponse, SecondRecord>;
/// A repeatable stretch of the loop.
pub type SecondFlight = DeviceFlight<SecondMemory, ProbeResponse, SecondRecord>;

impl SecondTape {
    /// Returns the longest repeatable stretch: from the oldest checkpoint after which nothing was overwritten.
    pub fn longest(&self) -> Option<SecondFlight> {
        let possible = self.possible(0);
        let first = self.checkpoints.since(0).find(|(tick, _)| possible.contains(tick))?;
        Some(self.flight(first))
    }
}

impl Tape for SecondTape {
    fn clear(&mut self) {
        Self::clear(self);
    }
}
