//! The haptic loop's side of the flight recorder: all that one tick leaves to the next, out and in.

use super::HapticLoop;
use crate::rt::exchange::HapticOrder;
use crate::rt::haptic_tape::{HapticEntry, HapticMemory};
use crate::rt::response::TissueResponse;
use stylet_shm_schema::TickRecord;

impl HapticLoop {
    /// Names every field, so that a new one is not forgotten.
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
            // Of elastic bodies, which no recording holds.
            line: _,
            on_line: _,
            watchdog,
            answer: _,
            state,
            probe: _,
            spin_ns: _,
            period_s: _,
        } = self;
        HapticMemory {
            parameters: *parameters,
            chain: *chain,
            sample: *sample,
            contact: *contact,
            pose: *pose,
            goal: *goal,
            watchdog: *watchdog,
            state: *state,
        }
    }

    /// The end counts as an order, so that its ramp can be repeated.
    pub(super) fn release_for_the_end(&mut self) {
        self.chain.gate.release();
        if let Some(tape) = self.ports.flight.tape() {
            tape.order(HapticOrder::Disengage { ticket: 0 });
        }
    }

    pub(super) fn checkpoint(&mut self) {
        // The haptic loop's tape serves every scene.
        let due = self
            .ports
            .flight
            .begin_tick(0)
            .is_some_and(|tape| tape.is_checkpoint_due());
        if due {
            let memory = self.memory();
            if let Some(tape) = self.ports.flight.tape() {
                tape.checkpoint(memory);
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
