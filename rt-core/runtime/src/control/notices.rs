//! Turns notices of the loops into answers and events for hosts.

use super::Control;
use super::link::EventDetails;
use crate::rt::exchange::{Moved, Notice};
use stylet_shm_schema::{EventKind, Fault};

impl Control {
    pub(super) fn take_notices(&mut self) {
        while let Ok(notice) = self.loops.haptic_notices.pop() {
            self.take_notice(notice);
        }
        while let Ok(notice) = self.loops.tissue_notices.pop() {
            match notice {
                Notice::Done { ticket, tick } => self.link.carried_out(ticket, tick),
                _ => self.take_notice(notice),
            }
        }
    }

    fn take_notice(&mut self, notice: Notice) {
        match notice {
            Notice::Done { ticket, tick } => self.link.answer(ticket, Ok(tick)),
            Notice::Refused { ticket, why } => self.link.answer(ticket, Err(&why.into())),
            Notice::ParametersActive {
                ticket,
                generation,
                tick,
            } => {
                if self.parameters.take_effect(generation, tick) {
                    self.link.wall.parameters(self.parameters.in_force);
                }
                self.link.answer(ticket, Ok(tick));
            }
            Notice::WorldSwapped {
                ticket,
                generation,
                tick,
            } => {
                self.scene_taken_up(generation, tick);
                self.link.answer(ticket, Ok(tick));
            }
            Notice::Fault { fault, .. } => {
                self.flights.fault(fault.message());
                // The supervisor has already reported this fault.
                if fault != Fault::LoopStopped {
                    self.report(&notice);
                }
            }
            _ => self.report(&notice),
        }
    }

    /// Reports notices that are only events.
    pub(super) fn report(&mut self, notice: &Notice) {
        let (kind, details) = match *notice {
            Notice::Contact {
                tick,
                time_ns,
                position_m,
            } => (
                EventKind::Contact,
                EventDetails {
                    position_m: position_m.into(),
                    ..EventDetails::at(tick, time_ns)
                },
            ),
            Notice::Puncture {
                tick,
                time_ns,
                depth_m,
                position_m,
            } => (
                EventKind::Puncture,
                EventDetails {
                    value: depth_m,
                    position_m: position_m.into(),
                    ..EventDetails::at(tick, time_ns)
                },
            ),
            Notice::LeftTissue { tick, time_ns } => (EventKind::LeftTissue, EventDetails::at(tick, time_ns)),
            Notice::Seed {
                tick,
                time_ns,
                index,
                position_m,
            } => (
                EventKind::SeedDropped,
                EventDetails {
                    code: index,
                    position_m: position_m.into(),
                    ..EventDetails::at(tick, time_ns)
                },
            ),
            Notice::Fault { tick, time_ns, fault } => (
                EventKind::FaultRaised,
                EventDetails {
                    code: fault as u32,
                    text: fault.message(),
                    ..EventDetails::at(tick, time_ns)
                },
            ),
            Notice::MotionGivenUp { tick, time_ns, what } => (
                EventKind::MotionGivenUp,
                EventDetails {
                    code: what as u32,
                    text: match what {
                        Moved::Needle => "the program that moved the hand fell silent; the hand was stopped",
                        Moved::SecondHand => {
                            "the program that moved the second hand fell silent; that hand was stopped"
                        }
                        Moved::DrawnNeedle => "the program that drew a needle out fell silent; the needle was stopped",
                    },
                    ..EventDetails::at(tick, time_ns)
                },
            ),
            Notice::Rearmed { tick, time_ns } => (EventKind::Rearmed, EventDetails::at(tick, time_ns)),
            Notice::Done { .. }
            | Notice::Refused { .. }
            | Notice::ParametersActive { .. }
            | Notice::WorldSwapped { .. } => return,
        };
        self.link.event(kind, details);
    }
}
