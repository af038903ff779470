//! Orders to the second device's loop, taken at the start of a tick.

use super::{SecondLoop, SecondOrder};
use crate::rt::exchange::Notice;
use stylet_shm_schema::{DeadlineTotals, RefusalCode};

impl SecondLoop {
    pub(super) fn take_orders(&mut self) {
        while let Ok(order) = self.ports.orders.pop() {
            let tick = self.memory.state.tick + 1;
            if let Some(tape) = self.ports.flight.tape() {
                tape.order(order);
            }
            match order {
                SecondOrder::Gate {
                    ticket,
                    generation,
                    gate,
                } => {
                    self.memory.gate_parameters = gate;
                    self.memory.state.parameters_generation = generation;
                    self.notify(Notice::Done { ticket, tick });
                }
                SecondOrder::Hand { ticket, goal, promise } if goal.is_valid() => {
                    self.begin_motion(goal, promise);
                    self.notify(Notice::Done { ticket, tick });
                }
                SecondOrder::Hand { ticket, .. } => {
                    let why = RefusalCode::BadGoal;
                    self.notify(Notice::Refused { ticket, why });
                }
                SecondOrder::StopHand { ticket } => {
                    self.stop_motion();
                    self.notify(Notice::Done { ticket, tick });
                }
                SecondOrder::Engage => self.engage(tick),
                SecondOrder::Disengage => self.memory.gate.release(),
                SecondOrder::Reset { ticket } => {
                    self.reset();
                    self.notify(Notice::Done { ticket, tick });
                }
                SecondOrder::Up(up) => self.turn_up(up),
                SecondOrder::KeepMoving(promise) => self.keep_moving(&promise),
                SecondOrder::HandOverTape => self.ports.flight.hand_over(),
            }
        }
    }

    fn engage(&mut self, tick: u64) {
        if self.memory.watchdog.rearm() {
            let time_ns = self.memory.state.time_ns;
            self.notify(Notice::Rearmed { tick, time_ns });
        }
        self.memory.state.since_armed = DeadlineTotals::default();
        self.memory.gate.engage();
    }

    fn reset(&mut self) {
        let state = &mut self.memory.state;
        state.peak_force_n = 0.0;
        state.missed_deadlines = 0;
        state.worst_wake_ns = 0;
        state.worst_work_ns = 0;
    }
}
