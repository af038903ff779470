//! The control thread's side of the second device: orders to its loop, records and faults to the hosts.

use super::Control;
use super::link::{EventDetails, Link};
use super::requests::hand_goal;
use super::supervisor::Supervisor;
use crate::rt::exchange::{Moved, Notice, Ticket};
use crate::rt::second::{SecondControlPorts, SecondOrder, gate_of};
use nalgebra::Vector3;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{EventKind, Fault, ProbeMove, Refusal, RefusalCode, SecondRecord};
use stylet_sim::force::GateParameters;

/// Settings of the second device for a control thread.
pub struct SecondSetup {
    /// Properties of the device.
    pub device: DeviceInfo,
    /// The control thread's ends of its rings, except the tapes.
    pub ports: SecondControlPorts,
}

/// Present in a run with a second device.
pub(super) struct Second {
    device: DeviceInfo,
    pub(super) orders: rtrb::Producer<SecondOrder>,
    notices: rtrb::Consumer<Notice>,
    records: rtrb::Consumer<SecondRecord>,
    supervisor: Supervisor,
    /// The loop has stopped, and hosts have been notified.
    has_stopped: bool,
}

impl Second {
    /// Also returns the tapes, which go to the keeper of flight recordings.
    pub fn new(setup: SecondSetup, is_real_time: bool) -> (Self, super::flight::SecondTapes) {
        let SecondSetup { device, ports } = setup;
        let second = Self {
            device,
            orders: ports.orders,
            notices: ports.notices,
            records: ports.records,
            supervisor: Supervisor::new(is_real_time, device.simulated),
            has_stopped: false,
        };
        (second, ports.tapes)
    }

    /// Sends an order that the loop can afford to lose. A stopped loop has no room for it, and the needle's loop is not
    /// affected.
    pub fn order(&mut self, order: SecondOrder) {
        let _ = self.orders.push(order);
    }

    /// Returns the ticket under which its loop answers a change that all loops share. A stopped loop does not answer:
    /// it applies the change before its next tick.
    pub fn shared(&self, ticket: Ticket) -> Ticket {
        if self.has_stopped { 0 } else { ticket }
    }

    /// Returns the gate order within the limits of this device.
    pub fn gate_order(&self, ticket: Ticket, generation: u64, run: &GateParameters) -> SecondOrder {
        SecondOrder::Gate {
            ticket: self.shared(ticket),
            generation,
            gate: gate_of(run, &self.device),
        }
    }

    fn order_answered(&mut self, order: SecondOrder) -> Result<(), Refusal> {
        let pushed = self.orders.push(order);
        pushed.map_err(|_| RefusalCode::TooManyRequests.into())
    }

    /// Sends records to the hosts, and reports a stopped loop. The needle's loop continues.
    fn pass(&mut self, link: &mut Link) {
        let made_a_tick = link.wall.second_records.take(&mut self.records);
        let stands_still = self.supervisor.pass(made_a_tick);
        if stands_still && !std::mem::replace(&mut self.has_stopped, stands_still) {
            let fault = Fault::LoopStopped;
            link.event(
                EventKind::SecondFaultRaised,
                EventDetails {
                    code: fault as u32,
                    text: "the loop of the second device has stopped; the needle's goes on",
                    ..EventDetails::now()
                },
            );
        }
        self.has_stopped &= !made_a_tick;
    }
}

impl Control {
    /// Serves records, notices and the state of the second device's loop.
    pub(super) fn pass_second(&mut self) {
        while let Some(Ok(notice)) = self.second.as_mut().map(|second| second.notices.pop()) {
            self.take_second_notice(&notice);
        }
        if let Some(second) = &mut self.second {
            second.pass(&mut self.link);
        }
    }

    fn take_second_notice(&mut self, notice: &Notice) {
        match *notice {
            Notice::Done { ticket, tick } => self.link.carried_out(ticket, tick),
            Notice::Refused { ticket, why } => self.link.answer(ticket, Err(&why.into())),
            Notice::Fault { tick, time_ns, fault } => {
                self.flights.fault(&format!("the second device: {}", fault.message()));
                self.link.event(
                    EventKind::SecondFaultRaised,
                    EventDetails {
                        code: fault as u32,
                        text: fault.message(),
                        ..EventDetails::at(tick, time_ns)
                    },
                );
            }
            Notice::Rearmed { tick, time_ns } => {
                self.link
                    .event(EventKind::SecondRearmed, EventDetails::at(tick, time_ns));
            }
            Notice::MotionGivenUp { .. } => self.report(notice),
            _ => {}
        }
    }

    /// Sends an order that applies to both hands; does nothing without a second device.
    pub(super) fn order_second(&mut self, order: SecondOrder) {
        if let Some(second) = &mut self.second {
            second.order(order);
        }
    }

    fn second_or_refusal(&mut self) -> Result<&mut Second, Refusal> {
        self.second.as_mut().ok_or(RefusalCode::NoSecondDevice.into())
    }

    pub(super) fn move_second_hand(&mut self, ticket: Ticket, probe: &ProbeMove) -> Result<(), Refusal> {
        let goal = hand_goal(&probe.hand);
        let promise = self.first_promise(ticket, Moved::SecondHand);
        let second = self.second_or_refusal()?;
        second.order_answered(SecondOrder::Up(probe.up.map(Vector3::from)))?;
        second.order_answered(SecondOrder::Hand { ticket, goal, promise })
    }

    pub(super) fn stop_second_hand(&mut self, ticket: Ticket) -> Result<(), Refusal> {
        self.second_or_refusal()?
            .order_answered(SecondOrder::StopHand { ticket })
    }
}
