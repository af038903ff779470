//! Orders to the second device's loop, taken at the start of a tick.

use super::{SecondLoop, gate_of};
use crate::rt::exchange::{Happened, HapticOrder, Notice};
use stylet_shm_schema::{DeadlineTotals, RefusalCode};

impl SecondLoop {
    pub(super) fn take_orders(&mut self) {
        while let Ok((ticket, order)) = self.ports.orders.pop() {
            if let Some(tape) = self.ports.flight.tape() {
                tape.order(order);
            }
            let tick = self.memory.state.tick + 1;
            let result = self.carry_out(order);
            if ticket != 0 || result.is_err() {
                self.notify(Notice::answer(ticket, tick, result));
            }
        }
    }

    fn carry_out(&mut self, order: HapticOrder) -> Result<(), RefusalCode> {
        let (hand, device) = (&mut self.memory.hand, &mut self.device);
        match order {
            HapticOrder::Parameters { generation, force, .. } => {
                self.memory.gate_parameters = gate_of(&force.gate, &device.info);
                self.memory.state.parameters_generation = generation;
            }
            HapticOrder::Hand { goal, up, promise } if goal.is_valid() => hand.begin_motion(device, goal, up, promise),
            HapticOrder::Hand { .. } => return Err(RefusalCode::BadGoal),
            HapticOrder::StopHand => hand.stop_motion(device, hand.sample, self.memory.estimator.velocity_m_per_s()),
            HapticOrder::Engage => self.engage(),
            HapticOrder::Disengage => self.memory.gate.release(),
            HapticOrder::Reset => {
                let state = &mut self.memory.state;
                state.peak_force_n = 0.0;
                state.missed_deadlines = 0;
                state.worst_wake_ns = 0;
                state.worst_work_ns = 0;
            }
            HapticOrder::KeepMoving(promise) => hand.keep_moving(device, &promise),
            HapticOrder::HandOverTape => self.ports.flight.hand_over(),
            // Orders to the needle.
            HapticOrder::LoseDevice(_)
            | HapticOrder::MoveBody(_)
            | HapticOrder::LeaveNeedle
            | HapticOrder::TakeNeedle(_)
            | HapticOrder::DrawNeedle { .. }
            | HapticOrder::StoodStill => {}
        }
        Ok(())
    }

    fn engage(&mut self) {
        if self.memory.hand.watchdog.rearm() {
            self.happened(Happened::Rearmed);
        }
        self.memory.state.since_armed = DeadlineTotals::default();
        self.memory.gate.engage();
    }
}
