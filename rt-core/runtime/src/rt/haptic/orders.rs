//! Orders to the force loop, taken at the start of a tick.

use super::HapticLoop;
use crate::rt::exchange::{HapticOrder, Notice, Ticket};
use stylet_shm_schema::{DeadlineTotals, Fault, RefusalCode};
use stylet_sim::force::chain::ChainParameters;

impl HapticLoop {
    pub(super) fn take_orders(&mut self) {
        while let Ok(order) = self.ports.orders.pop() {
            let tick = self.state.tick + 1;
            if let Some(tape) = self.ports.flight.tape() {
                tape.order(order);
            }
            match order {
                HapticOrder::Parameters {
                    ticket,
                    generation,
                    needle,
                    force,
                } => {
                    self.parameters = ChainParameters { needle, force };
                    let forces = self.parameters.layer_forces();
                    if let Some(line) = &mut self.line {
                        line.set_forces(&forces);
                    }
                    if let Some(left) = self.left.any_mut() {
                        left.set_forces(&forces);
                    }
                    self.state.parameters_generation = generation;
                    self.notify(Notice::ParametersActive {
                        ticket,
                        generation,
                        tick,
                    });
                }
                HapticOrder::Hand { ticket, goal, promise } if goal.is_valid() => {
                    self.begin_motion(goal, promise);
                    self.notify(Notice::Done { ticket, tick });
                }
                HapticOrder::Hand { ticket, .. } => self.notify(Notice::Refused {
                    ticket,
                    why: RefusalCode::BadGoal,
                }),
                HapticOrder::StopHand { ticket } => {
                    self.stop_motion();
                    self.notify(Notice::Done { ticket, tick });
                }
                HapticOrder::Engage { ticket } => self.engage(ticket, tick),
                HapticOrder::Disengage { ticket } => {
                    self.chain.gate.release();
                    self.notify(Notice::Done { ticket, tick });
                }
                HapticOrder::LeaveNeedle { ticket } => self.leave_needle(ticket),
                HapticOrder::TakeNeedle { ticket, number } => self.take_needle(ticket, number),
                HapticOrder::DrawNeedle {
                    ticket,
                    number,
                    speed_m_per_s,
                    promise,
                } => self.draw_needle(ticket, number, speed_m_per_s, promise),
                HapticOrder::KeepMoving(promise) => self.keep_moving(&promise),
                HapticOrder::LoseDevice { ticket, lost } => self.lose_device(ticket, lost, tick),
                HapticOrder::MoveBody { ticket, to_m } => self.move_body(ticket, to_m, tick),
                HapticOrder::Reset { ticket } => self.reset(ticket, tick),
                HapticOrder::StoodStill => self.raise(Fault::LoopStopped),
                HapticOrder::HandOverTape => self.ports.flight.hand_over(),
            }
        }
    }

    fn engage(&mut self, ticket: Ticket, tick: u64) {
        if self.watchdog.rearm() {
            let time_ns = self.state.time_ns;
            self.notify(Notice::Rearmed { tick, time_ns });
        }
        self.state.since_armed = DeadlineTotals::default();
        self.chain.gate.engage();
        self.notify(Notice::Done { ticket, tick });
    }

    fn reset(&mut self, ticket: Ticket, tick: u64) {
        self.end_contact();
        self.take_faults_out();
        self.state.peak_force_n = 0.0;
        self.state.missed_deadlines = 0;
        self.state.worst_wake_ns = 0;
        self.state.worst_work_ns = 0;
        self.state.worst_residual = 0.0;
        self.state.worst_tissue_work_ns = 0;
        self.state.worst_lag_ns = 0;
        self.state.worst_lag_m = 0.0;
        self.notify(Notice::Done { ticket, tick });
    }
}
