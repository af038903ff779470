//! The second device's flight recording, written each tick.

use super::ports::SecondOrder;
use super::response::ProbeResponse;
use crate::rt::motion_lease::MotionLease;
use crate::rt::recorder::{FLIGHT_TICKS, Last, Tape, complete_from};
use crate::rt::taped::pod;
use crate::rt::watchdog::Watchdog;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::{DeviceFault, DeviceInfo, HandGoal, Sample};
use stylet_shm_schema::{SecondRecord, SecondState, flags};
use stylet_sim::force::{GateParameters, GateState, VelocityEstimator};

/// Ticks between two checkpoints.
const CHECKPOINT_EVERY: u64 = 256;
const CHECKPOINTS: usize = FLIGHT_TICKS / CHECKPOINT_EVERY as usize + 2;
const ORDERS: usize = 4096;

/// All state of the loop between ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct SecondMemory {
    /// Settings of the gate.
    pub gate_parameters: GateParameters,
    /// State of the last limits before the device.
    pub gate: GateState,
    /// Tip velocity from positions.
    pub estimator: VelocityEstimator,
    /// Last good sample of the device.
    pub sample: Option<Sample>,
    /// Goal of the simulated hand.
    pub goal: Option<HandGoal>,
    /// Direction of the tool's +y for the goal.
    pub up: Option<Vector3<f64>>,
    /// Lease of the motion that a host ordered.
    pub motion: MotionLease,
    /// Watchdog with its latched fault.
    pub watchdog: Watchdog,
    /// State shown to hosts.
    #[serde(with = "pod")]
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
            sample: None,
            goal: None,
            up: None,
            motion: MotionLease::default(),
            watchdog: Watchdog::default(),
            state,
        }
    }
}

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct SecondEntry {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// The device's answer to the read.
    pub read: Result<Sample, DeviceFault>,
    /// The device rejected the force.
    pub write_failed: bool,
    /// Response of the tissue loop that the tick used.
    pub response: ProbeResponse,
    /// The record that the tick made.
    #[serde(with = "pod")]
    pub record: SecondRecord,
}

/// The last ticks of the loop. Numbers count from the first tick on the tape.
pub struct SecondTape {
    /// The last ticks.
    pub ticks: Last<SecondEntry>,
    /// Orders, each with the number of the tick that applied it.
    pub orders: Last<(u64, SecondOrder)>,
    /// Checkpoints, each with the number of the tick that follows it.
    pub checkpoints: Last<(u64, SecondMemory)>,
}

impl SecondTape {
    /// A blank tape for a loop that begins with `memory`.
    pub fn new(memory: &SecondMemory) -> Self {
        let blank = SecondEntry {
            woke_ns: 0,
            read: Err(DeviceFault::NotConnected),
            write_failed: false,
            response: ProbeResponse::default(),
            record: bytemuck::Zeroable::zeroed(),
        };
        Self {
            ticks: Last::new(&blank, CHECKPOINTS * CHECKPOINT_EVERY as usize),
            orders: Last::new(&(0, SecondOrder::HandOverTape), ORDERS),
            checkpoints: Last::new(&(0, *memory), CHECKPOINTS),
        }
    }

    /// Saves the state before the next tick if a checkpoint is due.
    pub fn begin_tick(&mut self, memory: &SecondMemory) {
        if self.ticks.next().is_multiple_of(CHECKPOINT_EVERY) {
            self.checkpoints.push((self.ticks.next(), *memory));
        }
    }

    /// Records an order of the current tick.
    pub fn order(&mut self, order: SecondOrder) {
        self.orders.push((self.ticks.next(), order));
    }

    /// Returns the longest repeatable stretch: from the oldest checkpoint after which nothing was overwritten.
    pub fn flight(&self) -> Option<SecondFlight> {
        let possible = self.ticks.first().max(complete_from(&self.orders))..self.ticks.next();
        let (first, memory) = self.checkpoints.since(0).find(|(tick, _)| possible.contains(tick))?;
        let orders = self.orders.since(0).filter(|(tick, _)| tick >= first);
        Some(SecondFlight {
            memory: *memory,
            ticks: self.ticks.since(*first).copied().collect(),
            orders: orders.map(|(tick, order)| (tick - first, *order)).collect(),
        })
    }
}

impl Tape for SecondTape {
    fn clear(&mut self) {
        self.ticks.clear();
        self.orders.clear();
        self.checkpoints.clear();
    }

    fn is_for(&self, _scene_generation: u64) -> bool {
        true
    }
}

/// A repeatable stretch of the loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SecondFlight {
    /// Before the first of `ticks`.
    pub memory: SecondMemory,
    /// The ticks.
    pub ticks: Vec<SecondEntry>,
    /// Orders, each with the index of the tick that applied it.
    pub orders: Vec<(u64, SecondOrder)>,
}
