//! Output of a force-loop tick: the state shown to hosts, and its record.

use super::HapticLoop;
use crate::rt::clock;
use crate::rt::motion_lease::MotionLease;
use crate::rt::response::TissueResponse;
use nalgebra::Vector3;
use stylet_shm_schema::{TickRecord, flags};
use stylet_sim::force::chain::ChainOutput;
use stylet_sim::needle::Phase;

impl HapticLoop {
    fn flags(&self, tissue: &TissueResponse, response: &ChainOutput) -> u32 {
        let always = flags::REAL_TIME | flags::SIMULATED_DEVICE | flags::LINE_NEEDED;
        let speed = self.memory.chain.estimator.velocity_m_per_s().norm();
        let tip = self.memory.put_in.in_scene(self.memory.pose.tip_in_scene);
        let at_goal = self.memory.hand.is_at_goal(&tip, speed);
        let bit = |set: bool, flag: u32| if set { flag } else { 0 };
        (self.memory.state.flags & always)
            | bit(self.memory.chain.gate.engaged(), flags::ENGAGED)
            | bit(self.memory.chain.gate.waiting(), flags::WAITING)
            | bit(response.phase != Phase::Outside, flags::IN_CONTACT)
            | bit(self.memory.chain.needle.punctured, flags::PUNCTURED)
            | bit(at_goal, flags::AT_GOAL)
            | bit(self.memory.on_line && !self.lacks_beam(), flags::LINE_READY)
            | bit(tissue.least_corner <= 0.0, flags::FOLDED)
            | bit(self.memory.is_hand_empty, flags::HAND_EMPTY)
            | bit(self.memory.hand.motion != MotionLease::Free, flags::IN_MOTION)
    }

    pub(super) fn record(
        &mut self,
        due_ns: u64,
        [woke_ns, written_ns]: [u64; 2],
        missed: u32,
        tissue: &TissueResponse,
        response: &ChainOutput,
    ) {
        let t = &response.terms;
        let along = |v: &Vector3<f64>| v.dot(&response.axis);
        let gate = &self.memory.chain.gate;
        let gate_counts = gate.counts().all();
        let interventions = gate_counts.iter().sum();
        let (energy_j, warmth_n) = (gate.passivity().energy_j(), gate.warmth_n());
        let mut now_flags = self.flags(tissue, response);
        if interventions > self.memory.state.gate_interventions {
            now_flags |= flags::GATE_ACTED;
        }
        let wake_latency_ns = woke_ns.saturating_sub(due_ns);
        let tip_deflection_m = self.tip_deflection_m(response);
        let (lag_ns, lag_m) = self.lag(woke_ns, tissue, response.phase);
        let sample = self.memory.hand.sample;
        let s = &mut self.memory.state;
        s.tick += 1;
        s.time_ns = woke_ns;
        s.tip_in_scene_m = self.memory.put_in.in_scene(self.memory.pose.tip_in_scene).into();
        s.needle_direction = self.memory.pose.direction.into();
        s.contact_in_scene_m = self.memory.put_in.in_scene(tissue.contact_in_scene).into();
        s.depth_m = response.depth_m;
        s.puncture_depth_m = response.puncture_depth_m;
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
        s.force_scale = self.memory.parameters.force.gate.force_scale;
        s.missed_deadlines += u64::from(missed);
        s.worst_wake_ns = s.worst_wake_ns.max(wake_latency_ns);
        s.since_start.add(missed, wake_latency_ns);
        s.since_armed.add(missed, wake_latency_ns);
        (s.tissue_since_start, s.tissue_since_armed) = (tissue.since_start, tissue.since_armed);
        s.tissue_tick = tissue.tick;
        s.tissue_missed_deadlines = tissue.missed;
        s.tissue_worst_wake_ns = tissue.worst_wake_ns;
        s.worst_residual = tissue.worst_residual;
        s.least_corner = tissue.least_corner;
        s.folded_from_m = tissue.folded_from_m;
        s.worst_tissue_work_ns = tissue.worst_work_ns;
        s.gate_interventions = interventions;
        s.gate_counts = gate_counts;
        s.energy_j = energy_j;
        s.warmth_n = warmth_n;
        s.tip_deflection_m = tip_deflection_m;
        (s.lag_ns, s.lag_m) = (lag_ns, lag_m);
        s.worst_lag_ns = s.worst_lag_ns.max(lag_ns);
        s.worst_lag_m = s.worst_lag_m.max(lag_m);
        s.tissue_force_n = along(&t.tissue_n);
        s.phase = response.phase as u32;
        s.fault = self.memory.hand.watchdog.fault() as u32;
        s.flags = now_flags;
        s.seed_count = tissue.seed_count;
        s.left_count = self.left.count() as u32;
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
            world_from_tool: sample.map_or([0.0; 4], |sample| sample.world_from_tool.coords.into()),
            tip_deflection_m,
            buttons: sample.map_or(0, |sample| sample.buttons),
            folded_from_um: (s.folded_from_m * 1e6).ceil() as u32,
        };
        if self.ports.records.push(record).is_err() {
            s.records_lost += 1;
        }
        self.tape(woke_ns, *tissue, record);
    }
}
