//! Turns notices of the loops into answers and events for hosts.

use super::Control;
use super::link::event_at;
use crate::rt::exchange::{Happened, Moved, Notice};
use stylet_shm_schema::{Event, EventKind, Fault, Text};

impl Control {
    pub(super) fn take_notices(&mut self) {
        while let Ok(notice) = self.loops.haptic_notices.pop() {
            match notice {
                Notice::Done { ticket, tick } => {
                    if self.parameters.take_effect(ticket, tick) {
                        self.announce_parameters();
                    }
                    self.link.answer(ticket, Ok(tick));
                }
                _ => self.take_notice(notice),
            }
        }
        while let Ok(notice) = self.loops.tissue_notices.pop() {
            match notice {
                Notice::Done { ticket, tick } => {
                    self.take_up_scene(ticket, tick);
                    self.link.carried_out(ticket, tick);
                }
                _ => self.take_notice(notice),
            }
        }
    }

    fn take_notice(&mut self, notice: Notice) {
        match notice {
            Notice::Done { .. } => {}
            Notice::Refused { ticket, why } => self.link.answer(ticket, Err(&why.into())),
            Notice::Event { tick, time_ns, what } => {
                if let Happened::Fault(fault) = what {
                    self.fault_flight(fault.message());
                }
                // The supervisor has already reported a loop that stopped.
                if what != Happened::Fault(Fault::LoopStopped) {
                    self.link.event(event_of(what, tick, time_ns));
                }
            }
        }
    }
}

/// Returns the event for hosts.
pub(super) fn event_of(what: Happened, tick: u64, time_ns: u64) -> Event {
    let at = |kind| event_at(kind, tick, time_ns);
    match what {
        Happened::Contact(position_m) => Event {
            position_m: position_m.into(),
            ..at(EventKind::Contact)
        },
        Happened::Puncture { depth_m, position_m } => Event {
            value: depth_m,
            position_m: position_m.into(),
            ..at(EventKind::Puncture)
        },
        Happened::LeftTissue => at(EventKind::LeftTissue),
        Happened::Seed { index, position_m } => Event {
            code: index,
            position_m: position_m.into(),
            ..at(EventKind::SeedDropped)
        },
        Happened::Fault(fault) => Event {
            code: fault as u32,
            text: Text::new(fault.message()),
            ..at(EventKind::FaultRaised)
        },
        Happened::Rearmed => at(EventKind::Rearmed),
        Happened::MotionGivenUp(what) => Event {
            code: what as u32,
            text: Text::new(match what {
                Moved::Needle => "the program that moved the hand fell silent; the hand was stopped",
                Moved::SecondHand => "the program that moved the second hand fell silent; that hand was stopped",
                Moved::DrawnNeedle => "the program that drew a needle out fell silent; the needle was stopped",
            }),
            ..at(EventKind::MotionGivenUp)
        },
    }
}
