//! The haptic loop's side of the flight recorder: saves and restores all state between ticks.

use super::HapticLoop;
use crate::rt::haptic_tape::{HapticEntry, HapticMemory};
use crate::rt::left_loads::LeftLoads;
use crate::rt::response::TissueResponse;
use stylet_shm_schema::TickRecord;
use stylet_sim::line::{HandLine, LeftNeedles, LeftRecord};

impl HapticLoop {
    /// Returns all state between ticks but that of the lines, which is kept separately.
    fn memory(&self) -> HapticMemory {
        HapticMemory {
            line: self.line.as_ref().map_or(0, |line| line.generation),
            ..self.memory
        }
    }

    /// Restores the line of the initial memory. Call before the first tick.
    pub fn resume_line(&mut self, mut line: Box<HandLine>) {
        line.set_forces(&self.memory.parameters.layer_forces());
        self.line = Some(line);
    }

    /// Restores the needles that stay in from their record, after [`resume_line`](Self::resume_line). False if they do
    /// not match it.
    pub fn resume_left(&mut self, record: &LeftRecord, line: impl FnMut(u64) -> Option<Box<HandLine>>) -> bool {
        let mut needles = LeftNeedles::with_room();
        let forces = self.memory.parameters.layer_forces();
        let mut line = line;
        let with_forces = |generation: u64| {
            let mut line = line(generation)?;
            line.set_forces(&forces);
            Some(line)
        };
        let fits = needles.take_record(record, with_forces, self.line.as_deref());
        self.left.needles = Some(needles);
        fits
    }

    /// Returns the state of needles that stay in after the last tick.
    pub fn left_record(&self) -> LeftRecord {
        let mut record = LeftRecord::default();
        if let Some(needles) = self.left.needles.as_deref() {
            record.copy_from(needles);
        }
        record
    }

    /// Returns their loads on the body.
    pub fn left_loads(&self) -> LeftLoads {
        let mut loads = LeftLoads::default();
        if let Some(needles) = self.left.needles.as_deref() {
            loads.set(needles.needles().iter().zip(needles.shares()));
        }
        loads
    }

    pub(super) fn checkpoint(&mut self) {
        // One haptic tape serves every scene.
        let tape = self.ports.flight.begin_tick(0);
        let due = tape.is_some_and(|tape| tape.device.is_checkpoint_due());
        if due {
            let memory = self.memory();
            if let Some(tape) = self.ports.flight.tape() {
                let left = self.left.needles.as_deref().filter(|left| !left.is_empty());
                tape.checkpoint(memory, self.line.as_ref().map(|line| line.state()), left);
            }
        }
    }

    pub(super) fn tape(&mut self, woke_ns: u64, response: TissueResponse, record: TickRecord) {
        if let Some(tape) = self.ports.flight.tape() {
            tape.device.ticks.push(HapticEntry {
                woke_ns,
                answer: self.device.answer,
                response,
                record,
            });
        }
    }
}
