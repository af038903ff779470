//! The tick of the second device, 1 kHz: read → contact → gate → write → pose → record.
//!
//! The other hand's loop has its own thread, rate, watchdog, gate and limits, under the contract of every loop here. It
//! shares nothing with the needle's loop: a failure of one leaves the other running.

mod orders;
mod ports;
mod record;
mod response;
mod tape;

pub use ports::{SecondControlPorts, SecondPorts, SecondPose, SecondTissuePorts, wire};
pub use response::{Felt, ProbeResponse};
pub use tape::{SecondEntry, SecondFlight, SecondMemory, SecondTape};

use crate::rt::clock::{self, SECOND_PHASE};
use crate::rt::device_loop::{Counts, DeviceLoop};
use crate::rt::exchange::{Happened, HapticOrder, Moved, Notice};
use crate::rt::hand::HandDevice;
use crate::rt::watchdog::{Watched, at_gate};
use nalgebra::Vector3;
use stylet_hw::{Device, DeviceInfo, Sample, Wrench};
use stylet_shm_schema::{Fault, SecondState};
use stylet_sim::force::{ForceFault, GateInput, GateParameters, Motion, gate};

/// Stages of this tick, as [`Probe`](crate::rt::timing::Probe) times them.
pub const SECOND_STAGES: &[&str] = &[
    "orders",
    "device read",
    "contact and gate",
    "write",
    "publish and record",
];
/// State of the second device's thread.
pub struct SecondLoop {
    session_id: u64,
    /// The device.
    pub device: HandDevice,
    ports: SecondPorts,
    /// Includes the state shown to hosts, with the counters.
    memory: SecondMemory,
}

/// Output of one tick.
#[derive(Clone, Copy, Debug)]
pub struct SecondOutput {
    /// Wrench on the device.
    pub wrench: Wrench,
    /// Requested force of the contact.
    pub felt: Felt,
    velocity_m_per_s: Vector3<f64>,
}

/// Returns the gate of the second device: the run's settings within this device's limits.
pub fn gate_of(run: &GateParameters, info: &DeviceInfo) -> GateParameters {
    GateParameters {
        max_force_n: info.peak_force_n,
        ..*run
    }
}

impl SecondLoop {
    /// Begins with `memory`.
    pub fn new(
        session_id: u64,
        device: Box<dyn Device>,
        ports: SecondPorts,
        memory: &SecondMemory,
        period_s: f64,
    ) -> Self {
        Self {
            session_id,
            device: HandDevice::new(device, period_s),
            ports,
            memory: *memory,
        }
    }

    /// Runs one tick, in the order of the data.
    pub fn tick(&mut self, due_ns: u64, woke_ns: u64, missed: u32) -> SecondOutput {
        if let Some(tape) = self.ports.flight.begin_tick(0)
            && tape.is_checkpoint_due()
        {
            tape.checkpoint(self.memory);
        }
        self.take_orders();
        self.watch_motion();
        self.device.mark();
        let sample = self.read();
        self.device.mark();
        let response = *self.ports.response.read();
        self.watch(woke_ns, missed, &response);
        let output = self.respond(&sample, &response);
        self.device.mark();
        if self.device.write(&output.wrench) {
            self.raise(Fault::DeviceError);
        }
        let written_ns = clock::now_ns();
        self.device.mark_output();
        self.hand_over_pose(woke_ns, &sample, &output);
        let record = self.record(due_ns, [woke_ns, written_ns], missed, &response, &output);
        if let Some(tape) = self.ports.flight.tape() {
            tape.ticks.push(SecondEntry {
                woke_ns,
                answer: self.device.answer,
                response,
                record,
            });
        }
        output
    }

    /// Brakes a motion whose lease has lapsed.
    fn watch_motion(&mut self) {
        let (hand, velocity) = (&mut self.memory.hand, self.memory.estimator.velocity_m_per_s());
        if let Some(what) = hand.watch_motion(&mut self.device, hand.sample, velocity, Moved::SecondHand) {
            self.happened(what);
        }
    }

    fn happened(&mut self, what: Happened) {
        let (tick, time_ns) = (self.memory.state.tick + 1, self.memory.state.time_ns);
        self.notify(Notice::Event { tick, time_ns, what });
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the control thread has ended: its notices are not needed.
        let _ = self.ports.notices.push(notice);
    }

    fn read(&mut self) -> Sample {
        let answer = self.device.read();
        let (sample, faults) = self.memory.hand.judge(answer);
        faults.into_iter().flatten().for_each(|fault| self.raise(fault));
        sample
    }

    fn raise(&mut self, fault: Fault) {
        self.memory.gate.trip(at_gate(fault));
        if self.memory.hand.watchdog.raise(fault) {
            self.happened(Happened::Fault(fault));
        }
    }

    /// Runs the watchdog over the tissue loop and this one.
    fn watch(&mut self, woke_ns: u64, missed: u32, response: &ProbeResponse) {
        let fault = self.memory.hand.watchdog.tick(&Watched {
            woke_ns,
            missed,
            tissue_ns: response.time_ns,
            tissue_unsolved: response.unsolved,
            engaged: self.memory.gate.engaged(),
        });
        if let Some(fault) = fault {
            self.raise(fault);
        }
    }

    /// Computes the contact for this sample, and applies the gate.
    fn respond(&mut self, sample: &Sample, response: &ProbeResponse) -> SecondOutput {
        let memory = &mut self.memory;
        let tip = sample.tip_in_world;
        let moved_m = memory
            .hand
            .sample
            .map_or(Vector3::zeros(), |before| tip - before.tip_in_world);
        let velocity_m_per_s = memory.estimator.update(&tip, self.device.period_s);
        // The scale of the force also scales the spring.
        let most = self.device.info.max_stiffness_n_per_m / memory.gate_parameters.force_scale.max(1e-3);
        let felt = response.at(&tip, &sample.world_from_tool, most);
        let input = GateInput {
            wanted: felt.wrench,
            constant_n: Vector3::zeros(),
            stored_j: felt.stored_j,
            motion: Motion {
                moved_m,
                velocity_m_per_s,
                position_step_m: self.device.info.position_step_m,
                dt_s: self.device.period_s,
            },
        };
        let output = gate::step(&memory.gate_parameters, &self.device.info, &mut memory.gate, &input);
        memory.hand.sample = Some(*sample);
        let is_new = output.fault == Some(ForceFault::NonFiniteForce) && memory.hand.watchdog.fault() == Fault::None;
        if is_new {
            self.raise(Fault::NonFiniteForce);
        }
        SecondOutput {
            wrench: output.wrench,
            felt,
            velocity_m_per_s,
        }
    }

    fn hand_over_pose(&mut self, woke_ns: u64, sample: &Sample, output: &SecondOutput) {
        self.ports.pose.write(SecondPose {
            time_ns: woke_ns,
            tip_in_scene: sample.tip_in_world,
            world_from_tool: sample.world_from_tool,
            velocity_m_per_s: output.velocity_m_per_s,
        });
    }
}

impl DeviceLoop for SecondLoop {
    type State = SecondState;
    const PHASE: f64 = SECOND_PHASE;

    fn state(&self) -> &SecondState {
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
        self.memory.gate_parameters.ramp_out_ticks
    }

    fn release_for_the_end(&mut self) {
        self.memory.gate.release();
        if let Some(tape) = self.ports.flight.tape() {
            tape.order(HapticOrder::Disengage);
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

#[cfg(test)]
mod tests;
