//! The control thread's side of the second device: orders to its loop, records and faults to the hosts.

use super::Control;
use super::link::Link;
use super::notices::event_of;
use super::supervisor::Supervisor;
use crate::rt::exchange::{Happened, HapticOrder, Moved, Notice, Ticket, hand_order};
use crate::rt::recorder::TapePort;
use crate::rt::second::{SecondControlPorts, SecondTape};
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{Event, EventKind, Fault, ProbeMove, Refusal, RefusalCode, SecondRecord, Text};

/// Present in a run with a second device.
pub(super) struct Second {
    pub(super) orders: rtrb::Producer<(Ticket, HapticOrder)>,
    notices: rtrb::Consumer<Notice>,
    records: rtrb::Consumer<SecondRecord>,
    supervisor: Supervisor,
    /// The loop has stopped, and hosts have been notified.
    has_stopped: bool,
}

impl Second {
    /// Also returns the tapes, which go to the keeper of flight recordings.
    pub fn new((device, ports): (DeviceInfo, SecondControlPorts), is_real_time: bool) -> (Self, TapePort<SecondTape>) {
        let second = Self {
            orders: ports.orders,
            notices: ports.notices,
            records: ports.records,
            supervisor: Supervisor::new(is_real_time, device.simulated),
            has_stopped: false,
        };
        (second, ports.tapes)
    }

    /// Returns the ticket under which its loop answers a change that all loops share. A stopped loop does not answer:
    /// it applies the change before its next tick.
    pub fn shared(&self, ticket: Ticket) -> Ticket {
        if self.has_stopped { 0 } else { ticket }
    }

    /// Sends records to the hosts, and reports a stopped loop. The needle's loop continues.
    fn pass(&mut self, link: &mut Link) {
        let made_a_tick = link.wall.take_second_records(&mut self.records);
        let stands_still = self.supervisor.pass(made_a_tick);
        if stands_still && !std::mem::replace(&mut self.has_stopped, stands_still) {
            link.event(Event {
                code: Fault::LoopStopped as u32,
                text: Text::new("the loop of the second device has stopped; the needle's goes on"),
                ..link.event_now(EventKind::SecondFaultRaised)
            });
        }
        self.has_stopped &= !made_a_tick;
    }
}

impl Control {
    /// Serves records, notices and the state of the second device's loop.
    pub(super) fn pass_second(&mut self) {
        while let Some(Ok(notice)) = self.second.as_mut().map(|second| second.notices.pop()) {
            self.take_second_notice(notice);
        }
        if let Some(second) = &mut self.second {
            second.pass(&mut self.link);
        }
    }

    fn take_second_notice(&mut self, notice: Notice) {
        match notice {
            Notice::Done { ticket, tick } => self.link.carried_out(ticket, tick),
            Notice::Refused { ticket, why } => self.link.answer(ticket, Err(&why.into())),
            Notice::Event { tick, time_ns, what } => {
                let mut event = event_of(what, tick, time_ns);
                match what {
                    Happened::Fault(fault) => {
                        self.fault_flight(&format!("the second device: {}", fault.message()));
                        event.kind = EventKind::SecondFaultRaised as u32;
                    }
                    Happened::Rearmed => event.kind = EventKind::SecondRearmed as u32,
                    _ => {}
                }
                self.link.event(event);
            }
        }
    }

    /// Sends an order that the loop can afford to lose; does nothing without a second device. A stopped loop has no room
    /// for it, and the needle's loop is not affected.
    pub(super) fn order_second(&mut self, ticket: Ticket, order: HapticOrder) {
        let _ = self.ask_second(ticket, order);
    }

    /// Orders what the second device's loop answers.
    pub(super) fn ask_second(&mut self, ticket: Ticket, order: HapticOrder) -> Result<(), Refusal> {
        let second = self.second.as_mut().ok_or(RefusalCode::NoSecondDevice)?;
        let pushed = second.orders.push((ticket, order));
        pushed.map_err(|_| RefusalCode::TooManyRequests.into())
    }

    pub(super) fn move_second_hand(&mut self, ticket: Ticket, probe: &ProbeMove) -> Result<(), Refusal> {
        let promise = self.first_promise(ticket, Moved::SecondHand);
        self.ask_second(ticket, hand_order(&probe.hand, probe.up, promise))
    }
}
