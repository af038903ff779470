//! The haptic loop's flight recording, written each tick.

use crate::rt::device_tape::{CHECKPOINTS, DeviceEntry, DeviceFlight, DeviceTape};
use crate::rt::exchange::HapticOrder;
use crate::rt::hand::HandMemory;
use crate::rt::motion_lease::MotionLease;
use crate::rt::outside::{LineOutside, OutsideTape};
use crate::rt::pose::TipPose;
use crate::rt::put_in::PutIn;
use crate::rt::recorder::{Last, Tape};
use crate::rt::response::TissueResponse;
use serde::{Deserialize, Serialize};
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{HapticState, TickRecord, flags};
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::{ChainParameters, ChainState};
use stylet_sim::line::{LeftNeedles, LeftRecord, LineState};
use stylet_sim::needle::NeedleParameters;

/// Most line changes on a tape. Each needle stood before its line for a while: fewer than one in 60 ms.
const LINES: usize = 128;

/// All state of the haptic loop between ticks.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HapticMemory {
    /// Parameters of the force chain.
    pub parameters: ChainParameters,
    /// State of the force chain.
    pub chain: ChainState,
    /// Number of the contact in use.
    pub contact: u64,
    /// Last pose handed to the tissue loop.
    pub pose: TipPose,
    /// The hand that holds the needle.
    pub hand: HandMemory,
    /// Lease of all needles being drawn out.
    pub drawing: MotionLease,
    /// Number of the needle line in use; 0 for none. Its state is kept separately.
    pub line: u64,
    /// Generation of the probe displacement last applied to the line.
    pub outside: u64,
    /// The last tick was on the line.
    pub on_line: bool,
    /// The hand holds no needle. The record of those that stay in is kept separately.
    pub is_hand_empty: bool,
    /// Instructor-injected faults.
    pub put_in: PutIn,
    /// State shown to hosts.
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
            contact: 0,
            pose: TipPose::default(),
            hand: HandMemory::default(),
            drawing: MotionLease::default(),
            line: 0,
            outside: 0,
            on_line: false,
            is_hand_empty: false,
            put_in: PutIn::default(),
            state,
        }
    }
}

/// Input and output of one tick.
pub type HapticEntry = DeviceEntry<TissueResponse, TickRecord>;

/// The last ticks of the haptic loop. Numbers count from the first tick on the tape.
pub struct HapticTape {
    /// Ticks, orders, checkpoints.
    pub device: DeviceTape<HapticMemory, TissueResponse, TickRecord>,
    /// Numbers of needle lines, each with the number of the tick that applied it.
    lines: Last<(u64, u64)>,
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
        Self {
            device: DeviceTape::new(memory),
            lines: Last::new(&(0, 0), LINES),
            line_states: Last::of_slots((0..CHECKPOINTS).map(|_| LineState::with_room()).collect()),
            left: Last::of_slots((0..CHECKPOINTS).map(|_| LeftRecord::with_room()).collect()),
            outside: None,
        }
    }

    /// Saves the state before the next tick, with that of the line, if any, and of needles that stay in.
    pub fn checkpoint(&mut self, memory: HapticMemory, line: Option<&LineState>, left: Option<&LeftNeedles>) {
        self.device.checkpoint(memory);
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
        self.lines.push((self.device.ticks.next(), generation));
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
        let tick = self.device.ticks.next();
        if let Some(tape) = &mut self.outside {
            tape.0.push((tick, *outside));
        }
    }

    /// Returns the longest repeatable stretch: from the oldest checkpoint after which nothing was overwritten.
    pub fn flight(&self) -> Option<HapticFlight> {
        let outside = self.outside.as_ref().map(|outside| &outside.0);
        let complete = outside.map_or(0, Last::complete_from).max(self.lines.complete_from());
        let possible = self.device.possible(complete);
        let states = self.line_states.since(0).zip(self.left.since(0));
        let mut points = self.device.checkpoints.since(0).zip(states);
        let (point, (line_state, left)) = points.find(|((tick, _), _)| possible.contains(tick))?;
        let DeviceFlight { memory, ticks, orders } = self.device.flight(point);
        Some(HapticFlight {
            memory,
            ticks,
            orders,
            left: left.clone(),
            line_state: (memory.line != 0).then(|| line_state.clone()),
            lines: self.lines.counted_from(point.0),
            outside: outside.map(|outside| outside.counted_from(point.0)).unwrap_or_default(),
        })
    }
}

impl Tape for HapticTape {
    fn clear(&mut self) {
        self.device.clear();
        self.lines.clear();
        self.line_states.clear();
        self.left.clear();
        if let Some(outside) = &mut self.outside {
            outside.0.clear();
        }
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
