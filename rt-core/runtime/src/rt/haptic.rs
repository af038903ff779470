//! The haptic tick, 1 kHz: read → chain (velocity, needle, force law, gate) → write → pose → record.

use crate::rt::clock::{self, HAPTIC_PHASE, Wait};
use crate::rt::device_loop::{self, Counts, DeviceLoop};
use crate::rt::exchange::Notice;
use crate::rt::haptic_tape::HapticMemory;
use crate::rt::motion_lease::Motions;
use crate::rt::pose::TipPose;
use crate::rt::put_in::PutIn;
use crate::rt::response::TissueResponse;
use crate::rt::timing::Probe;
use crate::rt::watchdog::{Watchdog, Watched, at_gate};
use crate::rt::wiring::HapticPorts;
use stylet_hw::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
use stylet_shm_schema::{Fault, HapticState};
use stylet_sim::force::ForceFault;
use stylet_sim::force::chain::{self, ChainOutput, ChainParameters, ChainState, Touch};
use stylet_sim::line::HandLine;

mod deflection;
mod flight;
mod left;
mod line;
mod motion;
mod orders;
mod put_in;
mod record;

/// State of the haptic thread.
pub struct HapticLoop {
    session_id: u64,
    device: Box<dyn Device>,
    info: DeviceInfo,
    ports: HapticPorts,
    parameters: ChainParameters,
    chain: ChainState,
    sample: Option<Sample>,
    contact: u64,
    pose: TipPose,
    goal: Option<HandGoal>,
    motions: Motions,
    /// Line of a needle that goes in along it.
    line: Option<Box<HandLine>>,
    /// Generation of the probe displacement last applied to the line.
    outside: u64,
    /// The last tick was on the line.
    on_line: bool,
    /// Needles that stay in.
    left: left::Left,
    watchdog: Watchdog,
    /// Instructor-injected faults.
    put_in: PutIn,
    /// The device's answer in this tick, for the recording.
    answer: DeviceAnswer,
    /// State shown to hosts; also holds the counters.
    pub state: HapticState,
    /// Present in a measurement.
    pub probe: Option<Box<Probe>>,
    /// Wait of the loop for each deadline.
    pub wait: Wait,
    period_s: f64,
}

/// Stages of this tick, as [`Probe`] times them.
pub const HAPTIC_STAGES: &[&str] = &["orders", "device read", "force chain", "write", "publish and record"];
/// The mark at which the device read begins.
const READ_MARK: usize = 0;

/// The device's answers to the last read and the last write.
struct DeviceAnswer {
    read: Result<Sample, DeviceFault>,
    write_failed: bool,
}

impl Default for DeviceAnswer {
    fn default() -> Self {
        Self {
            read: Err(DeviceFault::NotConnected),
            write_failed: false,
        }
    }
}

impl HapticLoop {
    /// Begins with `memory`, which names every field; [`resume_line`](Self::resume_line) restores its line.
    pub fn new(
        session_id: u64,
        device: Box<dyn Device>,
        ports: HapticPorts,
        memory: &HapticMemory,
        period_s: f64,
    ) -> Self {
        Self {
            session_id,
            info: device.info(),
            device,
            ports,
            parameters: memory.parameters,
            chain: memory.chain,
            sample: memory.sample,
            contact: memory.contact,
            pose: memory.pose,
            goal: memory.goal,
            motions: memory.motions,
            line: None,
            outside: memory.outside,
            on_line: memory.on_line,
            left: left::Left {
                is_hand_empty: memory.is_hand_empty,
                ..left::Left::default()
            },
            watchdog: memory.watchdog,
            put_in: memory.put_in,
            answer: DeviceAnswer::default(),
            state: memory.state,
            probe: None,
            wait: Wait::default(),
            period_s,
        }
    }

    /// Ends a stage of the tick, in a measurement.
    fn mark(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
        }
    }

    /// Runs one tick, in the order of the data. Returns the output of the force chain.
    pub fn tick(&mut self, due_ns: u64, woke_ns: u64, missed: u32) -> ChainOutput {
        self.checkpoint();
        self.take_orders();
        self.watch_motions();
        self.take_line();
        self.follow_body();
        self.mark();
        let sample = self.read();
        self.mark();
        let tissue = *self.ports.response.read();
        self.follow_outside(&tissue);
        self.look_after_left(&sample, &tissue);
        self.watch(woke_ns, missed, &tissue);
        let response = self.respond(&sample, &tissue);
        self.mark();
        self.answer.write_failed = self.device.write(&response.wrench).is_err();
        if self.answer.write_failed {
            self.raise(Fault::DeviceError);
        }
        let written_ns = clock::now_ns();
        self.mark();
        if let Some(probe) = &mut self.probe {
            probe.output_since_mark(READ_MARK);
        }
        self.hand_over_pose(woke_ns, &sample, &response);
        self.record(due_ns, [woke_ns, written_ns], missed, &tissue, &response);
        response
    }

    /// Returns all state of the force chain.
    pub fn chain(&self) -> &ChainState {
        &self.chain
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the control thread has ended: its notices are not needed.
        let _ = self.ports.notices.push(notice);
    }

    /// Returns the newest sample; the last good one when the device has a fault.
    fn read(&mut self) -> Sample {
        self.answer.read = self.put_in.answer(self.device.read(self.period_s));
        let in_body = self.answer.read.map(|sample| self.put_in.in_body(sample));
        let reading = device_loop::judge(in_body, self.sample);
        if let Some(fault) = reading.fault {
            self.raise(fault);
        }
        if let Some(fault) = self.watchdog.sample(reading.is_repeated) {
            self.raise(fault);
        }
        reading.sample
    }

    fn raise(&mut self, fault: Fault) {
        self.chain.gate.trip(at_gate(fault));
        if self.watchdog.raise(fault) {
            let (tick, time_ns) = (self.state.tick + 1, self.state.time_ns);
            self.notify(Notice::Fault { tick, time_ns, fault });
        }
    }

    /// Runs the watchdog over both threads.
    fn watch(&mut self, woke_ns: u64, missed: u32, tissue: &TissueResponse) {
        let fault = self.watchdog.tick(&Watched {
            woke_ns,
            missed,
            tissue_ns: tissue.time_ns,
            // Without coupling, no force depends on the tissue's answer: its lag is visible but not felt.
            tissue_unsolved: tissue.unsolved
                && (self.parameters.force.coupling > 0.0 || !tissue.local.displacement_m.iter().all(|u| u.is_finite())),
            engaged: self.chain.gate.engaged(),
        });
        if let Some(fault) = fault {
            self.raise(fault);
        }
    }

    fn end_contact(&mut self) {
        self.pose.released_contact = self.contact;
        self.chain.end_contact();
        if let Some(line) = &mut self.line {
            line.forget();
        }
        self.give_up_left();
        self.leave_line();
    }

    /// Returns where the tip meets tissue, unless this loop has already ended that contact.
    fn touch(&mut self, tissue: &TissueResponse) -> Option<Touch> {
        if tissue.contact <= self.pose.released_contact || self.left.is_hand_empty {
            return None;
        }
        self.contact = tissue.contact;
        Some(tissue.touch())
    }

    /// Computes eq. 6-10 for this sample, and applies the gate.
    fn respond(&mut self, sample: &Sample, tissue: &TissueResponse) -> ChainOutput {
        let output = self.respond_to_needle(sample, tissue);
        if output.puncture {
            let (tick, time_ns) = (self.state.tick + 1, self.state.time_ns);
            self.notify(Notice::Puncture {
                tick,
                time_ns,
                depth_m: output.depth_m,
                position_m: self.put_in.in_scene(sample.tip_in_world),
            });
        }
        if output.left {
            self.pose.released_contact = self.contact;
        }
        if self.chain.gate.fault() == Some(ForceFault::NonFiniteForce) && self.watchdog.fault() == Fault::None {
            self.raise(Fault::NonFiniteForce);
        }
        self.sample = Some(*sample);
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
            &self.parameters,
            &self.info,
            &mut self.chain,
            sample,
            touch.as_ref(),
            self.period_s,
        )
    }

    fn hand_over_pose(&mut self, woke_ns: u64, sample: &Sample, response: &ChainOutput) {
        self.pose.time_ns = woke_ns;
        self.pose.tip_in_scene = sample.tip_in_world;
        self.pose.direction = sample.direction_in_world();
        self.pose.speed_along_m_per_s = response.speed_along_m_per_s;
        self.pose.phase = response.phase;
        self.pose.punctured = self.chain.needle.punctured;
        self.pose.held_travel_m = self.chain.held_travel_m;
        self.pose.innermost_layer = self.chain.path.innermost();
        self.pose.seen_layer = self.chain.path.seen();
        self.pose.hand_is_empty = self.left.is_hand_empty;
        self.ports.pose.write(self.pose);
    }
}

impl DeviceLoop for HapticLoop {
    type State = HapticState;

    fn state(&self) -> &HapticState {
        &self.state
    }

    fn counts(&self) -> Counts {
        Counts {
            ticks: self.state.tick,
            since_start: self.state.since_start,
            since_armed: self.state.since_armed,
        }
    }

    fn period_s(&self) -> f64 {
        self.period_s
    }

    fn wait(&self) -> Wait {
        self.wait
    }

    fn phase(&self) -> f64 {
        HAPTIC_PHASE
    }

    fn ramp_out_ticks(&self) -> u32 {
        self.parameters.force.gate.ramp_out_ticks
    }

    fn release_for_the_end(&mut self) {
        self.release_with_tape();
    }

    fn step(&mut self, due_ns: u64, woke_ns: u64, missed: u32) {
        self.tick(due_ns, woke_ns, missed);
    }

    fn probe(&mut self) -> Option<&mut Probe> {
        self.probe.as_deref_mut()
    }

    fn end(&mut self) {
        let _ = self.device.write(&Wrench::zero());
        self.ports.flight.hand_over();
    }
}
