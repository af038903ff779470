//! The part that flight recordings of all loops with a device have in common: ticks, orders, checkpoints.

use crate::rt::exchange::HapticOrder;
use crate::rt::hand::DeviceAnswer;
use crate::rt::recorder::{FLIGHT_TICKS, Last};
use serde::{Deserialize, Serialize};

/// Ticks between two checkpoints.
const CHECKPOINT_EVERY: u64 = 256;
/// Checkpoints on a tape.
pub const CHECKPOINTS: usize = FLIGHT_TICKS / CHECKPOINT_EVERY as usize + 2;
const ORDERS: usize = 4096;

/// Input and output of one tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct DeviceEntry<Response, Record> {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// The device's answers.
    pub answer: DeviceAnswer,
    /// Response of the tissue loop that the tick used.
    pub response: Response,
    /// The record that the tick made.
    pub record: Record,
}

/// The last ticks of a loop. Numbers count from the first tick on the tape.
pub struct DeviceTape<Memory, Response, Record> {
    /// The last ticks.
    pub ticks: Last<DeviceEntry<Response, Record>>,
    /// Orders, each with the number of the tick that applied it.
    orders: Last<(u64, HapticOrder)>,
    /// Checkpoints, each with the number of the tick that follows it.
    pub checkpoints: Last<(u64, Memory)>,
}

/// A repeatable stretch of a loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DeviceFlight<Memory, Response, Record> {
    /// Before the first of `ticks`.
    pub memory: Memory,
    /// The ticks.
    pub ticks: Vec<DeviceEntry<Response, Record>>,
    /// Orders, each with the index of the tick that applied it.
    pub orders: Vec<(u64, HapticOrder)>,
}

impl<M: Copy, R: Copy + Default, T: bytemuck::Pod> DeviceTape<M, R, T> {
    /// A blank tape for a loop that begins with `memory`.
    pub fn new(memory: &M) -> Self {
        let blank = DeviceEntry {
            woke_ns: 0,
            answer: DeviceAnswer::default(),
            response: R::default(),
            record: T::zeroed(),
        };
        Self {
            ticks: Last::new(&blank, CHECKPOINTS * CHECKPOINT_EVERY as usize),
            orders: Last::new(&(0, HapticOrder::HandOverTape), ORDERS),
            checkpoints: Last::new(&(0, *memory), CHECKPOINTS),
        }
    }

    /// True if the next tick needs a checkpoint.
    pub fn is_checkpoint_due(&self) -> bool {
        self.ticks.next().is_multiple_of(CHECKPOINT_EVERY)
    }

    /// Saves the state before the next tick.
    pub fn checkpoint(&mut self, memory: M) {
        self.checkpoints.push((self.ticks.next(), memory));
    }

    /// Records an order of the current tick.
    pub fn order(&mut self, order: HapticOrder) {
        self.orders.push((self.ticks.next(), order));
    }

    /// Ticks that can be repeated from a checkpoint before them, if everything is known from tick `complete` on.
    pub fn possible(&self, complete: u64) -> std::ops::Range<u64> {
        self.ticks.first().max(complete).max(self.orders.complete_from())..self.ticks.next()
    }

    /// Returns the stretch from the checkpoint before tick `first`.
    pub fn flight(&self, (first, memory): &(u64, M)) -> DeviceFlight<M, R, T> {
        DeviceFlight {
            memory: *memory,
            ticks: self.ticks.since(*first).copied().collect(),
            orders: self.orders.counted_from(*first),
        }
    }

    /// Clears the tape without allocating.
    pub fn clear(&mut self) {
        self.ticks.clear();
        self.orders.clear();
        self.checkpoints.clear();
    }
}
