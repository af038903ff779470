//! The haptic tick, 1 kHz: read → chain (velocity, needle, force law, gate) → write → pose → record.

use crate::device::fault_of;
use crate::rt::arm::Armed;
use crate::rt::clock::{self, Grid};
use crate::rt::exchange::*;
use crate::rt::haptic_tape::{HapticMemory, HapticTape};
use crate::rt::recorder::Recorder;
use crate::rt::timing::Probe;
use crate::rt::watchdog::{Watchdog, Watched, at_gate};
use iceoryx2::port::writer::EntryHandleMut;
use nalgebra::Vector3;
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_hw::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
use stylet_shm_schema::service::Ipc;
use stylet_shm_schema::{Fault, HapticState, RefusalCode, TickRecord, flags};
use stylet_sim::force::ForceFault;
use stylet_sim::force::chain::{self, ChainOutput, ChainParameters, ChainState, Touch};
use stylet_sim::needle::Phase;

mod flight;

/// The blackboard entry; made and used by the haptic thread alone.
pub type StateEntry = EntryHandleMut<Ipc, u64, HapticState>;

/// The hand is at its goal within this distance, at rest.
const AT_GOAL_M: f64 = 4e-4;
const AT_REST_M_PER_S: f64 = 3e-3;

/// Ends of the rings that this loop owns.
pub struct HapticPorts {
    pub pose: triple_buffer::Input<TipPose>,
    pub response: triple_buffer::Output<TissueResponse>,
    pub orders: rtrb::Consumer<HapticOrder>,
    pub notices: rtrb::Producer<Notice>,
    pub records: RecordRing,
    pub flight: Recorder<HapticTape>,
}

/// Everything that the haptic thread owns.
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
    watchdog: Watchdog,
    /// What the device answered in this tick, for the recording.
    answer: DeviceAnswer,
    /// What hosts see; also holds the counters.
    pub state: HapticState,
    /// Present in a measurement.
    pub probe: Option<Box<Probe>>,
    /// Spinning before each deadline; 0 for none.
    pub spin_ns: u64,
    period_s: f64,
}

/// What [`Probe`] tells apart in this tick.
pub const HAPTIC_STAGES: &[&str] = &["orders", "device read", "force chain", "write", "publish and record"];
/// The mark at which the device read begins.
const READ_MARK: usize = 0;

/// What the device said to the last read and the last write.
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
    /// Begins with `memory`, which names every field.
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
            watchdog: memory.watchdog,
            answer: DeviceAnswer::default(),
            state: memory.state,
            probe: None,
            spin_ns: 0,
            period_s,
        }
    }

    /// Ends a stage of the tick, in a measurement.
    fn mark(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
        }
    }

    /// Runs on the ideal grid until `stop`, then ramps the force to zero and leaves.
    pub fn run(&mut self, _armed: &Armed, stop: &AtomicBool, mut publish: impl FnMut(&HapticState)) {
        let mut grid = Grid::from(clock::now_ns(), (self.period_s * 1e9) as u64);
        let mut missed = 0;
        let mut last_ticks = self.parameters.force.gate.ramp_out_ticks + 1;
        while last_ticks > 0 {
            // SYNC: pairs with the bridge's release store; nothing but the flag is carried.
            if stop.load(Ordering::Acquire) {
                self.release_for_the_end();
                last_ticks -= 1;
            }
            let slept = clock::wait_until(grid.due_ns, self.spin_ns);
            let woke_ns = clock::now_ns();
            self.tick(grid.due_ns, woke_ns, missed);
            publish(&self.state);
            if let Some(probe) = &mut self.probe {
                probe.finish(grid.due_ns, woke_ns, missed, slept);
            }
            missed = grid.advance(clock::now_ns());
        }
        let _ = self.device.write(&Wrench::zero());
        self.ports.flight.hand_over();
    }

    /// One tick; in the order of the data.
    pub fn tick(&mut self, due_ns: u64, woke_ns: u64, missed: u32) {
        self.checkpoint();
        self.take_orders();
        self.mark();
        let sample = self.read();
        self.mark();
        let tissue = *self.ports.response.read();
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
    }

    fn notify(&mut self, notice: Notice) {
        // A full ring means that the bridge is gone; there is nobody to tell.
        let _ = self.ports.notices.push(notice);
    }

    fn take_orders(&mut self) {
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
                    self.state.parameters_generation = generation;
                    self.notify(Notice::ParametersActive {
                        ticket,
                        generation,
                        tick,
                    });
                }
                HapticOrder::Hand { ticket, goal } if goal.is_valid() => {
                    self.device.set_hand_goal(&goal);
                    self.goal = Some(goal);
                    self.notify(Notice::Done { ticket, tick });
                }
                HapticOrder::Hand { ticket, .. } => self.notify(Notice::Refused {
                    ticket,
                    why: RefusalCode::BadGoal,
                }),
                HapticOrder::StopHand { ticket } => {
                    self.device.stop_hand();
                    self.goal = None;
                    self.notify(Notice::Done { ticket, tick });
                }
                HapticOrder::Engage { ticket } => self.engage(ticket, tick),
                HapticOrder::Disengage { ticket } => {
                    self.chain.gate.release();
                    self.notify(Notice::Done { ticket, tick });
                }
                HapticOrder::Reset { ticket } => self.reset(ticket, tick),
                HapticOrder::HandOverTape => self.ports.flight.hand_over(),
            }
        }
    }

    fn engage(&mut self, ticket: Ticket, tick: u64) {
        if self.watchdog.rearm() {
            let time_ns = self.state.time_ns;
            self.notify(Notice::Rearmed { tick, time_ns });
        }
        self.chain.gate.engage();
        self.notify(Notice::Done { ticket, tick });
    }

    fn reset(&mut self, ticket: Ticket, tick: u64) {
        self.end_contact();
        self.state.peak_force_n = 0.0;
        self.state.missed_deadlines = 0;
        self.state.worst_wake_ns = 0;
        self.state.worst_work_ns = 0;
        self.state.worst_residual = 0.0;
        self.state.worst_tissue_work_ns = 0;
        self.notify(Notice::Done { ticket, tick });
    }

    /// The newest sample; the last good one when the device has a fault.
    fn read(&mut self) -> Sample {
        let last = self.sample.unwrap_or(Sample {
            tip_in_world: Vector3::zeros(),
            world_from_tool: nalgebra::UnitQuaternion::identity(),
            buttons: 0,
            sequence: 0,
        });
        self.answer.read = self.device.read(self.period_s);
        let sample = match self.answer.read {
            Ok(sample) if sample.is_finite() => sample,
            Ok(_) => {
                self.raise(Fault::NonFiniteInput);
                last
            }
            Err(fault) => {
                self.raise(fault_of(fault));
                last
            }
        };
        let repeated = self.sample.is_some_and(|s| s.sequence == sample.sequence);
        if let Some(fault) = self.watchdog.sample(repeated) {
            self.raise(fault);
        }
        sample
    }

    fn raise(&mut self, fault: Fault) {
        self.chain.gate.trip(at_gate(fault));
        if self.watchdog.raise(fault) {
            let (tick, time_ns) = (self.state.tick + 1, self.state.time_ns);
            self.notify(Notice::Fault { tick, time_ns, fault });
        }
    }

    /// Watchdog over the other thread and over this one.
    fn watch(&mut self, woke_ns: u64, missed: u32, tissue: &TissueResponse) {
        let fault = self.watchdog.tick(&Watched {
            woke_ns,
            missed,
            tissue_ns: tissue.time_ns,
            tissue_unsolved: tissue.unsolved,
            engaged: self.chain.gate.engaged(),
        });
        if let Some(fault) = fault {
            self.raise(fault);
        }
    }

    fn end_contact(&mut self) {
        self.pose.released_contact = self.contact;
        self.chain.end_contact();
    }

    /// Where the tip meets tissue, unless this loop has ended that contact already.
    fn touch(&mut self, tissue: &TissueResponse) -> Option<Touch> {
        if tissue.contact <= self.pose.released_contact {
            return None;
        }
        self.contact = tissue.contact;
        Some(tissue.touch())
    }

    /// Eq. 6-10 for this sample, and the gate.
    fn respond(&mut self, sample: &Sample, tissue: &TissueResponse) -> ChainOutput {
        let touch = self.touch(tissue);
        let output = chain::step(
            &self.parameters,
            &self.info,
            &mut self.chain,
            sample,
            touch.as_ref(),
            self.period_s,
        );
        if output.puncture {
            let (tick, time_ns) = (self.state.tick + 1, self.state.time_ns);
            self.notify(Notice::Puncture {
                tick,
                time_ns,
                depth_m: output.depth_m,
                position_m: sample.tip_in_world,
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
        self.ports.pose.write(self.pose);
    }

    fn flags(&self, response: &ChainOutput) -> u32 {
        let always = flags::REAL_TIME | flags::SIMULATED_DEVICE;
        let speed = self.chain.estimator.velocity_m_per_s().norm();
        let at_goal = self.goal.is_some_and(|goal| {
            (self.pose.tip_in_scene - goal.tip_in_world).norm() < AT_GOAL_M && speed < AT_REST_M_PER_S
        });
        let bit = |set: bool, flag: u32| if set { flag } else { 0 };
        (self.state.flags & always)
            | bit(self.chain.gate.engaged(), flags::ENGAGED)
            | bit(self.chain.gate.waiting(), flags::WAITING)
            | bit(response.phase != Phase::Outside, flags::IN_CONTACT)
            | bit(self.chain.needle.punctured, flags::PUNCTURED)
            | bit(at_goal, flags::AT_GOAL)
    }

    fn record(
        &mut self,
        due_ns: u64,
        [woke_ns, written_ns]: [u64; 2],
        missed: u32,
        tissue: &TissueResponse,
        response: &ChainOutput,
    ) {
        let t = &response.terms;
        let along = |v: &Vector3<f64>| v.dot(&response.axis);
        let gate = &self.chain.gate;
        let gate_counts = gate.counts().all();
        let interventions = gate_counts.iter().sum();
        let (energy_j, warmth_n) = (gate.passivity().energy_j(), gate.warmth_n());
        let mut now_flags = self.flags(response);
        if interventions > self.state.gate_interventions {
            now_flags |= flags::GATE_ACTED;
        }
        let wake_latency_ns = woke_ns.saturating_sub(due_ns);
        let s = &mut self.state;
        s.tick += 1;
        s.time_ns = woke_ns;
        s.tip_in_scene_m = self.pose.tip_in_scene.into();
        s.needle_direction = self.pose.direction.into();
        s.contact_in_scene_m = tissue.contact_in_scene.into();
        s.depth_m = response.depth_m;
        s.speed_m_per_s = response.speed_along_m_per_s;
        s.force_on_hand_n = response.wrench.force_n.into();
        s.torque_on_hand_nm = response.wrench.torque_nm.into();
        s.force_terms_n = [
            along(&t.membrane_n),
            t.guide_n.norm(),
            along(&t.damping_n),
            along(&t.friction_n),
            along(&t.gravity_n),
        ];
        s.peak_force_n = s.peak_force_n.max(response.wrench.force_n.norm());
        s.force_scale = self.parameters.force.gate.force_scale;
        s.missed_deadlines += u64::from(missed);
        s.worst_wake_ns = s.worst_wake_ns.max(wake_latency_ns);
        s.tissue_tick = tissue.tick;
        s.tissue_missed_deadlines = tissue.missed;
        s.tissue_worst_wake_ns = tissue.worst_wake_ns;
        s.worst_residual = tissue.worst_residual;
        s.worst_tissue_work_ns = tissue.worst_work_ns;
        s.gate_interventions = interventions;
        s.gate_counts = gate_counts;
        s.energy_j = energy_j;
        s.warmth_n = warmth_n;
        s.tissue_force_n = along(&t.tissue_n);
        s.phase = response.phase.code();
        s.fault = self.watchdog.fault() as u32;
        s.flags = now_flags;
        s.seed_count = tissue.seed_count;
        let work_ns = clock::now_ns().saturating_sub(woke_ns);
        s.worst_work_ns = s.worst_work_ns.max(work_ns);
        let record = TickRecord {
            session_id: self.session_id,
            tick: s.tick,
            due_ns,
            wake_latency_ns,
            force_written_ns: written_ns.saturating_sub(woke_ns),
            work_ns,
            missed,
            phase: s.phase,
            fault: s.fault,
            flags: s.flags,
            tip_in_scene_m: s.tip_in_scene_m,
            force_on_hand_n: s.force_on_hand_n,
            depth_m: s.depth_m,
            speed_m_per_s: s.speed_m_per_s,
            force_terms_n: s.force_terms_n,
            tissue_tick: s.tissue_tick,
            world_from_tool: self
                .sample
                .map_or([0.0; 4], |sample| sample.world_from_tool.coords.into()),
            buttons: self.sample.map_or(0, |sample| sample.buttons),
            reserved: 0,
        };
        if self.ports.records.push(record).is_err() {
            s.records_lost += 1;
        }
        self.tape(woke_ns, tissue, record);
    }
}
