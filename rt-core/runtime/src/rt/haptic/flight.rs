//! The haptic loop's side of the flight recorder: saves and restores all state between ticks.

use super::HapticLoop;
use crate::rt::exchange::HapticOrder;
use crate::rt::haptic_tape::{HapticEntry, HapticMemory};
use crate::rt::left_loads::LeftLoads;
use crate::rt::response::TissueResponse;
use stylet_shm_schema::TickRecord;
use stylet_sim::line::{HandLine, LeftNeedles, LeftRecord};

impl HapticLoop {
    /// Names every field, so that no new one is forgotten.
    pub fn memory(&self) -> HapticMemory {
        let Self {
            session_id: _,
            device: _,
            info: _,
            ports: _,
            parameters,
            chain,
            sample,
            contact,
            pose,
            goal,
            motions,
            line,
            outside,
            on_line,
            // Its record is kept separately.
            left,
            watchdog,
            put_in,
            answer: _,
            state,
            probe: _,
            wait: _,
            period_s: _,
        } = self;
        HapticMemory {
            parameters: *parameters,
            chain: *chain,
            sample: *sample,
            contact: *contact,
            pose: *pose,
            goal: *goal,
            motions: *motions,
            line: line.as_ref().map_or(0, |line| line.generation),
            outside: *outside,
            on_line: *on_line,
            is_hand_empty: left.is_hand_empty,
            watchdog: *watchdog,
            put_in: *put_in,
            state: *state,
        }
    }

    /// Restores the line of the initial memory. Call before the first tick.
    pub fn resume_line(&mut self, mut line: Box<HandLine>) {
        line.set_forces(&self.parameters.layer_forces());
        self.line = Some(line);
    }

    /// Restores the needles that stay in from their record, after [`resume_line`](Self::resume_line). False if they do
    /// not match it.
    pub fn resume_left(&mut self, record: &LeftRecord, line: impl FnMut(u64) -> Option<Box<HandLine>>) -> bool {
        let mut needles = LeftNeedles::with_room();
        let forces = self.parameters.layer_forces();
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

    /// Records the end as an order, so that its ramp can be repeated.
    pub(super) fn release_with_tape(&mut self) {
        self.chain.gate.release();
        if let Some(tape) = self.ports.flight.tape() {
            tape.order(HapticOrder::Disengage { ticket: 0 });
        }
    }

    pub(super) fn checkpoint(&mut self) {
        // One haptic tape serves every scene.
        let due = self
            .ports
            .flight
            .begin_tick(0)
            .is_some_and(|tape| tape.is_checkpoint_due());
        if due {
            let memory = self.memory();
            if let Some(tape) = self.ports.flight.tape() {
                let left = self.left.needles.as_deref().filter(|left| !left.is_empty());
                tape.checkpoint(memory, self.line.as_ref().map(|line| line.state()), left);
            }
        }
    }

    pub(super) fn tape(&mut self, woke_ns: u64, tissue: &TissueResponse, record: TickRecord) {
        let (read, write_failed) = (self.answer.read, self.answer.write_failed);
        if let Some(tape) = self.ports.flight.tape() {
            tape.ticks.push(HapticEntry {
                woke_ns,
                read,
                write_failed,
                tissue: *tissue,
                record,
            });
        }
    }
}
