//! Output of a tick of the second device's loop: the state shown to hosts, and its record.

use super::{ProbeResponse, SecondLoop, SecondOutput};
use crate::rt::clock;
use crate::rt::motion_lease::MotionLease;
use stylet_shm_schema::{SecondRecord, flags};

/// A force that is not a number trips the gate; its record still holds a number.
fn finite(size: f64) -> f64 {
    if size.is_finite() { size.min(1e4) } else { 0.0 }
}

impl SecondLoop {
    fn flags(&self, response: &ProbeResponse, output: &SecondOutput, gate_acted: bool) -> u32 {
        let always = flags::REAL_TIME | flags::SIMULATED_DEVICE;
        let memory = &self.memory;
        let speed = output.velocity_m_per_s.norm();
        let hand = &memory.hand;
        let at_goal = hand
            .sample
            .is_some_and(|sample| hand.is_at_goal(&sample.tip_in_world, speed));
        let bit = |set: bool, flag: u32| if set { flag } else { 0 };
        (memory.state.flags & always)
            | bit(memory.gate.engaged(), flags::ENGAGED)
            | bit(memory.gate.waiting(), flags::WAITING)
            | bit(response.touches, flags::IN_CONTACT)
            | bit(at_goal, flags::AT_GOAL)
            | bit(gate_acted, flags::GATE_ACTED)
            | bit(hand.motion != MotionLease::Free, flags::IN_MOTION)
    }

    pub(super) fn record(
        &mut self,
        due_ns: u64,
        [woke_ns, written_ns]: [u64; 2],
        missed: u32,
        response: &ProbeResponse,
        output: &SecondOutput,
    ) -> SecondRecord {
        let gate_counts = self.memory.gate.counts().all();
        let interventions = gate_counts.iter().sum();
        let now_flags = self.flags(response, output, interventions > self.memory.state.gate_interventions);
        let wake_latency_ns = woke_ns.saturating_sub(due_ns);
        let memory = &mut self.memory;
        let s = &mut memory.state;
        s.tick += 1;
        s.time_ns = woke_ns;
        if let Some(sample) = &memory.hand.sample {
            s.tip_in_scene_m = sample.tip_in_world.into();
            s.world_from_tool = sample.world_from_tool.coords.into();
            s.buttons = sample.buttons;
        }
        s.force_on_hand_n = output.wrench.force_n.into();
        s.torque_on_hand_nm = output.wrench.torque_nm.into();
        s.peak_force_n = s.peak_force_n.max(output.wrench.force_n.norm());
        s.force_scale = memory.gate_parameters.force_scale;
        s.missed_deadlines += u64::from(missed);
        s.worst_wake_ns = s.worst_wake_ns.max(wake_latency_ns);
        s.since_start.add(missed, wake_latency_ns);
        s.since_armed.add(missed, wake_latency_ns);
        s.tissue_tick = response.tick;
        s.probe_edge_um = response.edge_um;
        (s.gate_counts, s.gate_interventions) = (gate_counts, interventions);
        (s.energy_j, s.warmth_n) = (memory.gate.passivity().energy_j(), memory.gate.warmth_n());
        s.fault = memory.hand.watchdog.fault() as u32;
        s.flags = now_flags;
        let work_ns = clock::now_ns().saturating_sub(woke_ns);
        s.worst_work_ns = s.worst_work_ns.max(work_ns);
        let record = SecondRecord {
            session_id: self.session_id,
            tick: s.tick,
            due_ns,
            wake_latency_ns,
            force_written_ns: written_ns.saturating_sub(woke_ns),
            work_ns,
            missed,
            fault: s.fault,
            flags: s.flags,
            buttons: s.buttons,
            tip_in_scene_m: s.tip_in_scene_m,
            world_from_tool: s.world_from_tool,
            force_on_hand_n: s.force_on_hand_n,
            torque_on_hand_nm: s.torque_on_hand_nm,
            contact_force_n: finite(output.felt.wrench.force_n.norm()),
            tissue_tick: s.tissue_tick,
        };
        if self.ports.records.push(record).is_err() {
            s.records_lost += 1;
        }
        record
    }
}
