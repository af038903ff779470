//! The haptic loop's flight recording, written each tick.

use crate::rt::exchange::HapticOrder;
use crate::rt::motion_lease::Motions;
use crate::rt::outside::{LineOutside, OutsideTape};
use crate::rt::pose::TipPose;
use crate::rt::put_in::PutIn;
use crate::rt::recorder::{FLIGHT_TICKS, Last, Tape, complete_from};
use crate::rt::response::TissueResponse;
use crate::rt::taped::pod;
use crate::rt::watchdog::Watchdog;
use serde::{Deserialize, Serialize};
use stylet_hw::{DeviceFault, DeviceInfo, HandGoal, Sample};
use stylet_shm_schema::{HapticState, TickRecord, flags};
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::{ChainParameters, ChainState};
use stylet_sim::line::{LeftNeedles, LeftRecord, LineState};
use stylet_sim::needle::NeedleParameters;

/// Ticks between two checkpoints.
const CHECKPOINT_EVERY: u64 = 256;
const CHECKPOINTS: usize = FLIGHT_TICKS / CHECKPOINT_EVERY as usize + 2;
const ORDERS: usize = 4096;
/// Most line changes on a tape. Each needle stood before its line for a while: fewer than one in 60 ms.
const LINES: usize = 128;

/// All state of the haptic loop between ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HapticMemory {
    /// Parameters of the force chain.
    pub parameters: ChainParameters,
    /// State of the force chain.
    pub chain: ChainState,
    /// Last good sample of the device.
    pub sample: Option<Sample>,
    /// Number of the contact in use.
    pub contact: u64,
    /// Last pose handed to the tissue loop.
    pub pose: TipPose,
    /// Goal of the simulated hand.
    pub goal: Option<HandGoal>,
    /// Leases of motions ordered by hosts.
    pub motions: Motions,
    /// Number of the needle line in use; 0 for none. Its state is kept separately.
    pub line: u64,
    /// Generation of the probe displacement last applied to the line.
    pub outside: u64,
    /// The last tick was on the line.
    pub on_line: bool,
    /// The hand holds no needle. The record of those that stay in is kept separately.
    pub is_hand_empty: bool,
    /// Watchdog with its latched fault.
    pub watchdog: Watchdog,
    /// Instructor-injected faults.
    pub put_in: PutIn,
    /// State shown to hosts.
    #[serde(with = "pod")]
    pub state: HapticState,
}

impl HapticMemory {
    /// Returns the memory before the first tick.
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
            motions: Motions::default(),
            line: 0,
            outside: 0,
            on_line: false,
            is_hand_empty: false,
            watchdog: Watchdog::default(),
            put_in: PutIn::default(),
            state,
        }
    }
}

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HapticEntry {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// The device's answer to the read.
    pub read: Result<Sample, DeviceFault>,
    /// The device rejected the force.
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
    /// Orders, each with the number of the tick that applied it.
    pub orders: Last<(u64, HapticOrder)>,
    /// Numbers of needle lines, each with the number of the tick that applied it.
    pub lines: Last<(u64, u64)>,
    /// Checkpoints, each with the number of the tick that follows it.
    pub checkpoints: Last<(u64, HapticMemory)>,
    /// State of the line at each checkpoint; without stations if there was none.
    line_states: Last<LineState>,
    /// The needles that stay in, at each checkpoint.
    left: Last<LeftRecord>,
    /// The probe's displacement of the line; allocated once there is a probe.
    outside: Option<Box<OutsideTape>>,
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
            lines: Last::new(&(0, 0), LINES),
            checkpoints: Last::new(&(0, *memory), CHECKPOINTS),
            line_states: Last::of_slots((0..CHECKPOINTS).map(|_| LineState::with_room()).collect()),
            left: Last::of_slots((0..CHECKPOINTS).map(|_| LeftRecord::with_room()).collect()),
            outside: None,
        }
    }

    /// True if the next tick needs a checkpoint.
    pub fn is_checkpoint_due(&self) -> bool {
        self.ticks.next().is_multiple_of(CHECKPOINT_EVERY)
    }

    /// Saves the state before the next tick, with that of the line, if any, and of needles that stay in.
    pub fn checkpoint(&mut self, memory: HapticMemory, line: Option<&LineState>, left: Option<&LeftNeedles>) {
        self.checkpoints.push((self.ticks.next(), memory));
        if let Some(slot) = self.line_states.advance() {
            match line {
                Some(state) => slot.copy_from(state),
                None => slot.clear(),
            }
        }
        if let Some(slot) = self.left.advance() {
            match left {
                Some(left) => slot.copy_from(left),
                None => slot.clear(),
            }
        }
    }

    /// Records that the current tick changes the line.
    pub fn line(&mut self, generation: u64) {
        self.lines.push((self.ticks.next(), generation));
    }

    /// True if there is no room yet for the probe's displacement of the line.
    pub fn lacks_outside_room(&self) -> bool {
        self.outside.is_none()
    }

    /// Takes room for it.
    pub fn take_outside_room(&mut self, room: Box<OutsideTape>) {
        self.outside.get_or_insert(room);
    }

    /// Records the probe's displacement of a line from the current tick on.
    pub fn outside(&mut self, outside: &LineOutside) {
        let tick = self.ticks.next();
        if let Some(tape) = &mut self.outside {
            tape.0.push((tick, *outside));
        }
    }

    /// Records an order of the current tick.
    pub fn order(&mut self, order: HapticOrder) {
        self.orders.push((self.ticks.next(), order));
    }

    /// Returns the longest repeatable stretch: from the oldest checkpoint after which nothing was overwritten.
    pub fn flight(&self) -> Option<HapticFlight> {
        let complete = complete_from(&self.orders).max(complete_from(&self.lines));
        let complete = complete.max(self.outside.as_ref().map_or(0, |outside| complete_from(&outside.0)));
        let possible = self.ticks.first().max(complete)..self.ticks.next();
        let points = self
            .checkpoints
            .since(0)
            .zip(self.line_states.since(0))
            .zip(self.left.since(0));
        let (((first, memory), line_state), left) =
            points.into_iter().find(|(((tick, _), _), _)| possible.contains(tick))?;
        let orders = self.orders.since(0).filter(|(tick, _)| tick >= first);
        let lines = self.lines.since(0).filter(|(tick, _)| tick >= first);
        let outside = self.outside.iter().flat_map(|outside| outside.0.since(0));
        let outside = outside.filter(|(tick, _)| tick >= first);
        Some(HapticFlight {
            memory: *memory,
            ticks: self.ticks.since(*first).copied().collect(),
            orders: orders.map(|(tick, order)| (tick - first, *order)).collect(),
            left: left.clone(),
            line_state: (memory.line != 0).then(|| line_state.clone()),
            lines: lines.map(|(tick, line)| (tick - first, *line)).collect(),
            outside: outside.map(|(tick, outside)| (tick - first, *outside)).collect(),
        })
    }
}

impl Tape for HapticTape {
    fn clear(&mut self) {
        self.ticks.clear();
        self.orders.clear();
        self.lines.clear();
        self.checkpoints.clear();
        self.line_states.clear();
        self.left.clear();
        if let Some(outside) = &mut self.outside {
            outside.0.clear();
        }
    }

    fn is_for(&self, _scene_generation: u64) -> bool {
        true
    }
}

/// A repeatable stretch of the haptic loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HapticFlight {
    /// Before the first of `ticks`.
    pub memory: HapticMemory,
    /// The ticks.
    pub ticks: Vec<HapticEntry>,
    /// Orders, each with the index of the tick that applied it.
    pub orders: Vec<(u64, HapticOrder)>,
    /// State of the line of `memory`, if it has one.
    pub line_state: Option<LineState>,
    /// Needles that stay in.
    pub left: LeftRecord,
    /// Numbers of lines, each with the index of the tick that applied it.
    pub lines: Vec<(u64, u64)>,
    /// The probe's displacement of each line, with the index of the tick that applied it.
    pub outside: Vec<(u64, LineOutside)>,
}

impl HapticFlight {
    /// Numbers of the loop's lines, in order.
    pub fn line_numbers(&self) -> impl Iterator<Item = u64> {
        let first = (self.memory.line != 0).then_some(self.memory.line);
        let first = first.into_iter().chain(self.left.line_numbers());
        first.chain(self.lines.iter().map(|(_, line)| *line))
    }

    /// Number of ticks with the needle on a prepared line.
    pub fn ticks_on_line(&self) -> usize {
        let is_on_line = |entry: &&HapticEntry| entry.record.flags & flags::LINE_READY != 0;
        self.ticks.iter().filter(is_on_line).count()
    }
}
