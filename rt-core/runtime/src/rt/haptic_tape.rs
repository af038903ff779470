//! What the haptic loop writes to its flight recording, each tick.

use crate::rt::exchange::HapticOrder;
use crate::rt::pose::TipPose;
use crate::rt::recorder::{FLIGHT_TICKS, Last, Tape, complete_from};
use crate::rt::response::TissueResponse;
use crate::rt::taped::pod;
use crate::rt::watchdog::Watchdog;
use serde::{Deserialize, Serialize};
use stylet_hw::{DeviceFault, DeviceInfo, HandGoal, Sample};
use stylet_shm_schema::{HapticState, TickRecord, flags};
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::{ChainParameters, ChainState};
use stylet_sim::needle::NeedleParameters;

/// Ticks between two checkpoints.
const CHECKPOINT_EVERY: u64 = 256;
const CHECKPOINTS: usize = FLIGHT_TICKS / CHECKPOINT_EVERY as usize + 2;
const ORDERS: usize = 4096;

/// Everything that one tick of the haptic loop leaves to the next.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HapticMemory {
    /// Parameters of the force chain.
    pub parameters: ChainParameters,
    /// State of the force chain.
    pub chain: ChainState,
    /// Last good sample of the device.
    pub sample: Option<Sample>,
    /// Number of the contact that the loop has taken up.
    pub contact: u64,
    /// Last pose handed to the tissue loop.
    pub pose: TipPose,
    /// Goal of the simulated hand.
    pub goal: Option<HandGoal>,
    /// Watchdog with the fault that it keeps.
    pub watchdog: Watchdog,
    /// State as hosts see it.
    #[serde(with = "pod")]
    pub state: HapticState,
}

impl HapticMemory {
    /// Before the first tick.
    pub fn new(info: &DeviceInfo, (needle, force): (NeedleParameters, ForceParameters), base_flags: u32) -> Self {
        let mut state: HapticState = bytemuck::Zeroable::zeroed();
        state.flags = base_flags | if info.simulated { flags::SIMULATED_DEVICE } else { 0 };
        state.device_limit_n = info.peak_force_n;
        state.parameters_generation = 1;
        Self {
            parameters: ChainParameters { needle, force },
            chain: ChainState::new(info),
            sample: None,
            contact: 0,
            pose: TipPose::default(),
            goal: None,
            watchdog: Watchdog::default(),
            state,
        }
    }
}

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HapticEntry {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// What the device answered to the read.
    pub read: Result<Sample, DeviceFault>,
    /// The device did not take the force.
    pub write_failed: bool,
    /// Response of the tissue loop that the tick used.
    pub tissue: TissueResponse,
    /// The record that the tick made.
    #[serde(with = "pod")]
    pub record: TickRecord,
}

/// The last ticks of the haptic loop. Numbers count from the first tick on the tape.
pub struct HapticTape {
    /// The last ticks.
    pub ticks: Last<HapticEntry>,
    /// Orders, each with the number of the tick that took it up.
    pub orders: Last<(u64, HapticOrder)>,
    /// Checkpoints, each with the number of the tick that it comes before.
    pub checkpoints: Last<(u64, HapticMemory)>,
}

impl HapticTape {
    /// A blank tape for a loop that begins with `memory`.
    pub fn new(memory: &HapticMemory) -> Self {
        let blank = HapticEntry {
            woke_ns: 0,
            read: Err(DeviceFault::NotConnected),
            write_failed: false,
            tissue: TissueResponse::default(),
            record: bytemuck::Zeroable::zeroed(),
        };
        Self {
            ticks: Last::new(&blank, CHECKPOINTS * CHECKPOINT_EVERY as usize),
            orders: Last::new(&(0, HapticOrder::HandOverTape), ORDERS),
            checkpoints: Last::new(&(0, *memory), CHECKPOINTS),
        }
    }

    /// Whether the tick that begins now needs a checkpoint.
    pub fn is_checkpoint_due(&self) -> bool {
        self.ticks.next().is_multiple_of(CHECKPOINT_EVERY)
    }

    /// Keeps what the tick that begins now starts from.
    pub fn checkpoint(&mut self, memory: HapticMemory) {
        self.checkpoints.push((self.ticks.next(), memory));
    }

    /// Keeps an order of the tick that runs.
    pub fn order(&mut self, order: HapticOrder) {
        self.orders.push((self.ticks.next(), order));
    }

    /// The longest stretch that can be repeated: from the oldest checkpoint after which nothing was overwritten.
    pub fn flight(&self) -> Option<HapticFlight> {
        let oldest_tick = self.ticks.first().max(complete_from(&self.orders));
        let (first, memory) = self
            .checkpoints
            .since(0)
            .find(|(tick, _)| *tick >= oldest_tick && *tick < self.ticks.next())?;
        let orders = self.orders.since(0).filter(|(tick, _)| tick >= first);
        Some(HapticFlight {
            memory: *memory,
            ticks: self.ticks.since(*first).copied().collect(),
            orders: orders.map(|(tick, order)| (tick - first, *order)).collect(),
        })
    }
}

impl Tape for HapticTape {
    fn clear(&mut self) {
        self.ticks.clear();
        self.orders.clear();
        self.checkpoints.clear();
    }

    fn is_for(&self, _scene_generation: u64) -> bool {
        true
    }
}

/// A stretch of the haptic loop that can be repeated.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HapticFlight {
    /// Before the first of `ticks`.
    pub memory: HapticMemory,
    /// The ticks.
    pub ticks: Vec<HapticEntry>,
    /// Each with the index of the tick that took it up.
    pub orders: Vec<(u64, HapticOrder)>,
}

impl HapticFlight {
    /// Ticks in which the needle was on a prepared line. The tape holds no line: such a flight can be looked at, but its
    /// forces cannot be repeated.
    pub fn ticks_on_line(&self) -> usize {
        let is_on_line = |entry: &&HapticEntry| entry.record.flags & flags::LINE_READY != 0;
        self.ticks.iter().filter(is_on_line).count()
    }
}
