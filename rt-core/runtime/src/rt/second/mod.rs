//! The tick of the second device, 1 kHz: read → contact → gate → write → pose → record.
//!
//! The other hand's loop has its own thread, rate, watchdog, gate and limits, under the contract of every loop here. It
//! shares nothing with the needle's loop: a failure of one leaves the other running.

mod motion;
mod orders;
mod ports;
mod record;
mod response;
mod tape;

pub use ports::{SecondControlPorts, SecondOrder, SecondPorts, SecondPose, SecondTissuePorts, wire};
pub use response::{Felt, ProbeResponse};
pub use tape::{SecondEntry, SecondFlight, SecondMemory, SecondTape};

use crate::rt::clock::{self, SECOND_PHASE, Wait};
use crate::rt::device_loop::{self, Counts, DeviceLoop, Reading};
use crate::rt::exchange::Notice;
use crate::rt::timing::Probe;
use crate::rt::watchdog::{Watched, at_gate};
use nalgebra::Vector3;
use stylet_hw::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use stylet_shm_schema::{Fault, SecondState};
use stylet_sim::force::{ForceFault, GateInput, GateParameters, Motion, gate};

/// Stages of this tick, as [`Probe`] times them.
pub const SECOND_STAGES: &[&str] = &[
    "orders",
    "device read",
    "contact and gate",
    "write",
    "publish and record",
];
/// The mark at which the device read begins.
const READ_MARK: usize = 0;

/// State of the second device's thread.
pub struct SecondLoop {
    session_id: u64,
    device: Box<dyn Device>,
    info: DeviceInfo,
    ports: SecondPorts,
    /// Includes the state shown to hosts, with the counters.
    memory: SecondMemory,
    /// Present in a measurement.
    pub probe: Option<Box<Probe>>,
    /// Wait of the loop for each deadline.
    pub wait: Wait,
    period_s: f64,
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
            info: device.info(),
            device,
            ports,
            memory: *memory,
            probe: None,
            wait: Wait::default(),
            period_s,
        }
    }

    fn mark(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
        }
    }

    /// Runs one tick, in the order of the data.
    pub fn tick(&mut self, due_ns: u64, woke_ns: u64, missed: u32) -> SecondOutput {
        if let Some(tape) = self.ports.flight.begin_tick(0) {
            tape.begin_tick(&self.memory);
        }
        self.take_orders();
        self.watch_motion();
        self.mark();
        let (answer, reading) = self.read();
        self.mark();
        let response = *self.ports.response.read();
        self.watch(woke_ns, missed, &response);
        let output = self.respond(&reading.sample, &response);
        self.mark();
        let write_failed = self.device.write(&output.wrench).is_err();
        if write_failed {
            self.raise(Fault::DeviceError);
        }
        let written_ns = clock::now_ns();
        self.mark();
        if let Some(probe) = &mut self.probe {
            probe.output_since_mark(READ_MARK);
        }
        self.hand_over_pose(woke_ns, &reading.sample, &output);
        let record = self.record(due_ns, [woke_ns, written_ns], missed, &response, &output);
        if let Some(tape) = self.ports.flight.tape() {
            tape.ticks.push(SecondEntry {
                woke_ns,
                read: answer,
                write_failed,
                response,
                record,
            });
        }
        output
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the control thread has ended: its notices are not needed.
        let _ = self.ports.notices.push(notice);
    }

    fn read(&mut self) -> (Result<Sample, DeviceFault>, Reading) {
        let answer = self.device.read(self.period_s);
        let reading = device_loop::judge(answer, self.memory.sample);
        if let Some(fault) = reading.fault {
            self.raise(fault);
        }
        if let Some(fault) = self.memory.watchdog.sample(reading.is_repeated) {
            self.raise(fault);
        }
        (answer, reading)
    }

    fn raise(&mut self, fault: Fault) {
        self.memory.gate.trip(at_gate(fault));
        if self.memory.watchdog.raise(fault) {
            let (tick, time_ns) = (self.memory.state.tick + 1, self.memory.state.time_ns);
            self.notify(Notice::Fault { tick, time_ns, fault });
        }
    }

    /// Runs the watchdog over the tissue loop and this one.
    fn watch(&mut self, woke_ns: u64, missed: u32, response: &ProbeResponse) {
        let fault = self.memory.watchdog.tick(&Watched {
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
            .sample
            .map_or(Vector3::zeros(), |before| tip - before.tip_in_world);
        let velocity_m_per_s = memory.estimator.update(&tip, self.period_s);
        // The scale of the force also scales the spring.
        let most = self.info.max_stiffness_n_per_m / memory.gate_parameters.force_scale.max(1e-3);
        let felt = response.at(&tip, &sample.world_from_tool, most);
        let input = GateInput {
            wanted: felt.wrench,
            constant_n: Vector3::zeros(),
            stored_j: felt.stored_j,
            motion: Motion {
                moved_m,
                velocity_m_per_s,
                position_step_m: self.info.position_step_m,
                dt_s: self.period_s,
            },
        };
        let output = gate::step(&memory.gate_parameters, &self.info, &mut memory.gate, &input);
        memory.sample = Some(*sample);
        let is_new = output.fault == Some(ForceFault::NonFiniteForce) && memory.watchdog.fault() == Fault::None;
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

    fn period_s(&self) -> f64 {
        self.period_s
    }

    fn wait(&self) -> Wait {
        self.wait
    }

    fn phase(&self) -> f64 {
        SECOND_PHASE
    }

    fn ramp_out_ticks(&self) -> u32 {
        self.memory.gate_parameters.ramp_out_ticks
    }

    fn release_for_the_end(&mut self) {
        self.memory.gate.release();
        if let Some(tape) = self.ports.flight.tape() {
            tape.order(SecondOrder::Disengage);
        }
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

#[cfg(test)]
mod tests;
