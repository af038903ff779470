//! The haptic tick, 1 kHz: read → chain (velocity, needle, force law, gate) → write → pose → record.

use crate::rt::clock::{self, HAPTIC_PHASE};
use crate::rt::device_loop::{Counts, DeviceLoop};
use crate::rt::exchange::{Happened, HapticOrder, Notice};
use crate::rt::hand::HandDevice;
use crate::rt::haptic_tape::HapticMemory;
use crate::rt::response::TissueResponse;
use crate::rt::watchdog::{Watched, at_gate};
use crate::rt::wiring::HapticPorts;
use stylet_hw::{Device, Sample};
use stylet_shm_schema::{Fault, HapticState};
use stylet_sim::force::ForceFault;
use stylet_sim::force::chain::{self, ChainOutput, Touch};
use stylet_sim::line::HandLine;

mod deflection;
mod flight;
mod left;
mod line;
mod motion;
mod orders;
mod record;

/// State of the haptic thread.
pub struct HapticLoop {
    session_id: u64,
    /// The needle's device.
    pub device: HandDevice,
    ports: HapticPorts,
    /// State between ticks, with the state shown to hosts. The number of its line is not kept up to date.
    pub memory: HapticMemory,
    /// Line of a needle that goes in along it.
    line: Option<Box<HandLine>>,
    /// Needles that stay in.
    left: left::Left,
}

/// Stages of this tick, as [`Probe`](crate::rt::timing::Probe) times them.
pub const HAPTIC_STAGES: &[&str] = &["orders", "device read", "force chain", "write", "publish and record"];

impl HapticLoop {
    /// Begins with `memory`; [`resume_line`](Self::resume_line) restores its line.
    pub fn new(
        session_id: u64,
        device: Box<dyn Device>,
        ports: HapticPorts,
        memory: &HapticMemory,
        period_s: f64,
    ) -> Self {
        Self {
            session_id,
            device: HandDevice::new(device, period_s),
            ports,
            memory: *memory,
            line: None,
            left: left::Left::default(),
        }
    }

    /// Runs one tick, in the order of the data. Returns the output of the force chain.
    pub fn tick(&mut self, due_ns: u64, woke_ns: u64, missed: u32) -> ChainOutput {
        self.checkpoint();
        self.take_orders();
        self.watch_motions();
        self.take_line();
        self.follow_body();
        self.device.mark();
        let sample = self.read();
        self.device.mark();
        let tissue = *self.ports.response.read();
        self.follow_outside(&tissue);
        self.look_after_left(&sample, &tissue);
        self.watch(woke_ns, missed, &tissue);
        let response = self.respond(&sample, &tissue);
        self.device.mark();
        if self.device.write(&response.wrench) {
            self.raise(Fault::DeviceError);
        }
        let written_ns = clock::now_ns();
        self.device.mark_output();
        self.hand_over_pose(woke_ns, &sample, &response);
        self.record(due_ns, [woke_ns, written_ns], missed, &tissue, &response);
        response
    }

    fn happened(&mut self, what: Happened) {
        let (tick, time_ns) = (self.memory.state.tick + 1, self.memory.state.time_ns);
        self.notify(Notice::Event { tick, time_ns, what });
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the control thread has ended: its notices are not needed.
        let _ = self.ports.notices.push(notice);
    }

    /// Moves the patient, by an exercise.
    fn follow_body(&mut self) {
        self.memory.put_in.step(self.device.period_s);
        self.memory.pose.body_moved_m = self.memory.put_in.body_moved_m;
    }

    /// Returns the newest sample; the last good one when the device has a fault.
    fn read(&mut self) -> Sample {
        let answer = self.device.read();
        self.device.answer.read = self.memory.put_in.answer(answer);
        let in_body = self.device.answer.read.map(|sample| self.memory.put_in.in_body(sample));
        let (sample, faults) = self.memory.hand.judge(in_body);
        faults.into_iter().flatten().for_each(|fault| self.raise(fault));
        sample
    }

    fn raise(&mut self, fault: Fault) {
        self.memory.chain.gate.trip(at_gate(fault));
        if self.memory.hand.watchdog.raise(fault) {
            self.happened(Happened::Fault(fault));
        }
    }

    /// Runs the watchdog over both threads.
    fn watch(&mut self, woke_ns: u64, missed: u32, tissue: &TissueResponse) {
        let fault = self.memory.hand.watchdog.tick(&Watched {
            woke_ns,
            missed,
            tissue_ns: tissue.time_ns,
            // Without coupling, no force depends on the tissue's answer: its lag is visible but not felt.
            tissue_unsolved: tissue.unsolved
                && (self.memory.parameters.force.coupling > 0.0
                    || !tissue.local.displacement_m.iter().all(|u| u.is_finite())),
            engaged: self.memory.chain.gate.engaged(),
        });
        if let Some(fault) = fault {
            self.raise(fault);
        }
    }

    fn end_contact(&mut self) {
        self.memory.pose.released_contact = self.memory.contact;
        self.memory.chain.end_contact();
        if let Some(line) = &mut self.line {
            line.forget();
        }
        self.give_up_left();
        self.leave_line();
    }

    /// Returns where the tip meets tissue, unless this loop has already ended that contact.
    fn touch(&mut self, tissue: &TissueResponse) -> Option<Touch> {
        if tissue.contact <= self.memory.pose.released_contact || self.memory.is_hand_empty {
            return None;
        }
        self.memory.contact = tissue.contact;
        Some(tissue.touch())
    }

    /// Computes eq. 6-10 for this sample, and applies the gate.
    fn respond(&mut self, sample: &Sample, tissue: &TissueResponse) -> ChainOutput {
        let output = self.respond_to_needle(sample, tissue);
        if output.puncture {
            self.happened(Happened::Puncture {
                depth_m: output.depth_m,
                position_m: self.memory.put_in.in_scene(sample.tip_in_world),
            });
        }
        if output.left {
            self.memory.pose.released_contact = self.memory.contact;
        }
        if self.memory.chain.gate.fault() == Some(ForceFault::NonFiniteForce)
            && self.memory.hand.watchdog.fault() == Fault::None
        {
            self.raise(Fault::NonFiniteForce);
        }
        self.memory.hand.sample = Some(*sample);
        output
    }

    /// Computes the force on the needle's line, if any, else against the contact of the tissue loop.
    fn respond_to_needle(&mut self, sample: &Sample, tissue: &TissueResponse) -> ChainOutput {
        if self.is_on_line(sample, tissue)
            && let Some(output) = self.respond_on_line(sample)
        {
            return output;
        }
        self.leave_line();
        self.step_left();
        let touch = self.touch(tissue);
        chain::step(
            &self.memory.parameters,
            &self.device.info,
            &mut self.memory.chain,
            sample,
            touch.as_ref(),
            self.device.period_s,
        )
    }

    fn hand_over_pose(&mut self, woke_ns: u64, sample: &Sample, response: &ChainOutput) {
        let (chain, pose) = (&self.memory.chain, &mut self.memory.pose);
        pose.time_ns = woke_ns;
        pose.tip_in_scene = sample.tip_in_world;
        pose.direction = sample.direction_in_world();
        pose.speed_along_m_per_s = response.speed_along_m_per_s;
        pose.phase = response.phase;
        pose.punctured = chain.needle.punctured;
        pose.held_travel_m = chain.held_travel_m;
        pose.innermost_layer = chain.path.innermost();
        pose.seen_layer = chain.path.seen();
        pose.hand_is_empty = self.memory.is_hand_empty;
        self.ports.pose.write(self.memory.pose);
    }
}

impl DeviceLoop for HapticLoop {
    type State = HapticState;
    const PHASE: f64 = HAPTIC_PHASE;

    fn state(&self) -> &HapticState {
        &self.memory.state
    }

    fn counts(&self) -> Counts {
        Counts {
            ticks: self.memory.state.tick,
            since_start: self.memory.state.since_start,
            since_armed: self.memory.state.since_armed,
        }
    }

    fn device(&mut self) -> &mut HandDevice {
        &mut self.device
    }

    fn ramp_out_ticks(&self) -> u32 {
        self.memory.parameters.force.gate.ramp_out_ticks
    }

    /// Records the end as an order, so that its ramp can be repeated.
    fn release_for_the_end(&mut self) {
        self.memory.chain.gate.release();
        if let Some(tape) = self.ports.flight.tape() {
            tape.device.order(HapticOrder::Disengage);
        }
    }

    fn step(&mut self, due_ns: u64, woke_ns: u64, missed: u32) {
        self.tick(due_ns, woke_ns, missed);
    }

    fn end(&mut self) {
        self.device.end();
        self.ports.flight.hand_over();
    }
}
