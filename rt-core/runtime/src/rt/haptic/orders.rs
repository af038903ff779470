//! Orders to the force loop, taken at the start of a tick.

use super::HapticLoop;
use crate::rt::exchange::{Happened, HapticOrder, Notice};
use crate::rt::put_in::PutIn;
use stylet_shm_schema::{DeadlineTotals, Fault, RefusalCode};
use stylet_sim::force::chain::ChainParameters;

impl HapticLoop {
    pub(super) fn take_orders(&mut self) {
        while let Ok((ticket, order)) = self.ports.orders.pop() {
            if let Some(tape) = self.ports.flight.tape() {
                tape.device.order(order);
            }
            let tick = self.memory.state.tick + 1;
            let result = self.carry_out(order);
            if ticket != 0 || result.is_err() {
                self.notify(Notice::answer(ticket, tick, result));
            }
        }
    }

    fn carry_out(&mut self, order: HapticOrder) -> Result<(), RefusalCode> {
        match order {
            HapticOrder::Parameters {
                generation,
                needle,
                force,
            } => {
                self.memory.parameters = ChainParameters { needle, force };
                let forces = self.memory.parameters.layer_forces();
                if let Some(line) = &mut self.line {
                    line.set_forces(&forces);
                }
                if let Some(left) = self.left.any_mut() {
                    left.set_forces(&forces);
                }
                self.memory.state.parameters_generation = generation;
            }
            HapticOrder::Hand { goal, up, promise } if goal.is_valid() => {
                self.memory.hand.begin_motion(&mut self.device, goal, up, promise);
            }
            HapticOrder::Hand { .. } => return Err(RefusalCode::BadGoal),
            HapticOrder::StopHand => self.stop_motion(),
            HapticOrder::Engage => self.engage(),
            HapticOrder::Disengage => self.memory.chain.gate.release(),
            HapticOrder::LeaveNeedle => return self.leave_needle(),
            HapticOrder::TakeNeedle(number) => return self.take_needle(number),
            HapticOrder::DrawNeedle {
                number,
                speed_m_per_s,
                promise,
            } => return self.draw_needle(number, speed_m_per_s, promise),
            HapticOrder::KeepMoving(promise) => self.keep_moving(&promise),
            HapticOrder::LoseDevice(lost) => self.memory.put_in.device_lost = lost,
            HapticOrder::MoveBody(to_m) => self.memory.put_in.body_to_m = to_m.into(),
            HapticOrder::Reset => self.reset(),
            HapticOrder::StoodStill => self.raise(Fault::LoopStopped),
            HapticOrder::HandOverTape => self.ports.flight.hand_over(),
        }
        Ok(())
    }

    fn engage(&mut self) {
        if self.memory.hand.watchdog.rearm() {
            self.happened(Happened::Rearmed);
        }
        self.memory.state.since_armed = DeadlineTotals::default();
        self.memory.chain.gate.engage();
    }

    fn reset(&mut self) {
        self.end_contact();
        // No needle is in tissue now, so the body may jump back.
        self.memory.put_in = PutIn::default();
        let state = &mut self.memory.state;
        state.peak_force_n = 0.0;
        state.missed_deadlines = 0;
        state.worst_wake_ns = 0;
        state.worst_work_ns = 0;
        state.worst_residual = 0.0;
        state.worst_tissue_work_ns = 0;
        state.worst_lag_ns = 0;
        state.worst_lag_m = 0.0;
    }
}
