//! What a recording holds beside ticks, so that a window can show it: run, plan, parameters, and what no tick says of the state.
//!
//! Fields have names, so that a recording outlives the layout of shared memory; what a later build does not find has its default.

use super::messages::Channel;
use bytemuck::Zeroable;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use stylet_shm_schema::{
    HapticState, MAX_SEEDS, PARAMETERS, ParametersInForce, PlanInForce, SCHEMA_VERSION, Session, Text, ThreadReport,
};

pub const PLAN: Channel = Channel {
    topic: "/stylet/plan",
    schema: "stylet.Plan",
    text: || schema("stylet.Plan", "path of the needle and planned seeds, m, scene frame"),
};
pub const PARAMETERS_CHANNEL: Channel = Channel {
    topic: "/stylet/parameters",
    schema: "stylet.Parameters",
    text: || schema("stylet.Parameters", "parameters in force by their keys, SI"),
};
pub const STATE: Channel = Channel {
    topic: "/stylet/state",
    schema: "stylet.State",
    text: || {
        schema(
            "stylet.State",
            "what the core counts since the last reset, beside the ticks",
        )
    },
};
pub const SESSION: Channel = Channel {
    topic: "/stylet/session",
    schema: "stylet.Session",
    text: || {
        schema(
            "stylet.Session",
            "the run of rt-core: device, version, periods, what the kernel granted",
        )
    },
};

pub fn schema(title: &str, what: &str) -> Value {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, "type": "object", "description": what,
    })
}

/// As `ThreadReport` has it.
#[derive(Serialize, Deserialize)]
struct Thread {
    policy: u32,
    priority: u32,
    asked_priority: u32,
    asked_core: u32,
    core: u32,
}

#[derive(Serialize, Deserialize)]
struct Run {
    session_id: u64,
    period_ns: u64,
    tissue_period_ns: u64,
    haptic: Thread,
    tissue: Thread,
    #[serde(default)]
    memory_locked: u32,
    device: String,
    version: String,
    /// Of a run with a second device.
    #[serde(skip_serializing_if = "Option::is_none")]
    second: Option<Second>,
}

#[derive(Serialize, Deserialize)]
struct Second {
    device: String,
    period_ns: u64,
    thread: Thread,
}

impl From<&ThreadReport> for Thread {
    fn from(report: &ThreadReport) -> Self {
        Self {
            policy: report.policy,
            priority: report.priority,
            asked_priority: report.asked_priority,
            asked_core: report.asked_core,
            core: report.core,
        }
    }
}

impl Thread {
    fn report(&self) -> ThreadReport {
        ThreadReport {
            policy: self.policy,
            priority: self.priority,
            asked_priority: self.asked_priority,
            asked_core: self.asked_core,
            core: self.core,
            reserved: 0,
        }
    }
}

pub fn session(session: &Session) -> Value {
    let run = Run {
        session_id: session.session_id,
        period_ns: session.period_ns,
        tissue_period_ns: session.tissue_period_ns,
        haptic: Thread::from(&session.haptic),
        tissue: Thread::from(&session.tissue),
        memory_locked: session.memory_locked,
        device: session.device.read(),
        version: session.version.read(),
        second: session.has_second().then(|| Second {
            device: session.second_device.read(),
            period_ns: session.second_period_ns,
            thread: Thread::from(&session.second),
        }),
    };
    serde_json::to_value(run).unwrap_or_default()
}

pub fn session_of(data: &[u8]) -> Option<Session> {
    let run: Run = serde_json::from_slice(data).ok()?;
    let mut session = Session::zeroed();
    (session.session_id, session.schema_version) = (run.session_id, SCHEMA_VERSION);
    (session.period_ns, session.tissue_period_ns) = (run.period_ns.max(1), run.tissue_period_ns);
    session.memory_locked = run.memory_locked;
    (session.haptic, session.tissue) = (run.haptic.report(), run.tissue.report());
    (session.device, session.version) = (Text::new(&run.device), Text::new(&run.version));
    if let Some(second) = run.second {
        (session.second_device, session.second_period_ns) = (Text::new(&second.device), second.period_ns);
        session.second = second.thread.report();
    }
    Some(session)
}

#[derive(Serialize, Deserialize)]
struct Plan {
    generation: u64,
    scene_generation: u64,
    entry_m: [f64; 3],
    direction: [f64; 3],
    seeds_m: Vec<[f64; 3]>,
    /// Recordings of earlier versions have none.
    #[serde(default)]
    prescribed: Prescribed,
}

#[derive(Default, Serialize, Deserialize)]
struct Prescribed {
    needle: u32,
    last_needle: u32,
    strength_u: f64,
    dose_gy: f64,
    source: String,
}

pub fn plan(plan: &PlanInForce) -> Value {
    let seeds = plan.seeds.iter().take(plan.seed_count as usize);
    let plan = Plan {
        generation: plan.generation,
        scene_generation: plan.scene_generation,
        entry_m: plan.entry_m,
        direction: plan.direction,
        seeds_m: seeds.map(|seed| seed.position_m).collect(),
        prescribed: Prescribed {
            needle: plan.prescribed.needle,
            last_needle: plan.prescribed.last_needle,
            strength_u: plan.prescribed.strength_u,
            dose_gy: plan.prescribed.dose_gy,
            source: plan.prescribed.source.read(),
        },
    };
    serde_json::to_value(plan).unwrap_or_default()
}

pub fn plan_of(data: &[u8], session_id: u64) -> Option<PlanInForce> {
    let p: Plan = serde_json::from_slice(data).ok()?;
    let mut plan = PlanInForce::zeroed();
    (plan.session_id, plan.generation, plan.scene_generation) = (session_id, p.generation, p.scene_generation);
    (plan.entry_m, plan.direction) = (p.entry_m, p.direction);
    plan.seed_count = p.seeds_m.len().min(MAX_SEEDS) as u64;
    plan.prescribed = stylet_shm_schema::Prescribed {
        needle: p.prescribed.needle,
        last_needle: p.prescribed.last_needle,
        strength_u: p.prescribed.strength_u,
        dose_gy: p.prescribed.dose_gy,
        source: Text::new(&p.prescribed.source),
    };
    for (to, from) in plan.seeds.iter_mut().zip(p.seeds_m) {
        to.position_m = from;
    }
    Some(plan)
}

#[derive(Serialize, Deserialize)]
struct Parameters {
    generation: u64,
    effective_tick: u64,
    values: BTreeMap<String, f64>,
}

pub fn parameters(in_force: &ParametersInForce) -> Value {
    let values = PARAMETERS
        .iter()
        .map(|spec| (spec.key.to_owned(), in_force.set.get(spec.id)));
    let parameters = Parameters {
        generation: in_force.generation,
        effective_tick: in_force.effective_tick,
        values: values.collect(),
    };
    serde_json::to_value(parameters).unwrap_or_default()
}

pub fn parameters_of(data: &[u8], session_id: u64) -> Option<ParametersInForce> {
    let p: Parameters = serde_json::from_slice(data).ok()?;
    let mut in_force = ParametersInForce::zeroed();
    (in_force.session_id, in_force.generation) = (session_id, p.generation);
    in_force.effective_tick = p.effective_tick;
    in_force.set = Default::default();
    for spec in &PARAMETERS {
        if let Some(&value) = p.values.get(spec.key) {
            in_force.set.set(spec.id, value);
        }
    }
    Some(in_force)
}

#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct State {
    needle_direction: [f64; 3],
    contact_in_scene_m: [f64; 3],
    puncture_depth_m: f64,
    peak_force_n: f64,
    force_scale: f64,
    device_limit_n: f64,
    missed_deadlines: u64,
    worst_wake_ns: u64,
    worst_work_ns: u64,
    tissue_missed_deadlines: u64,
    tissue_worst_wake_ns: u64,
    worst_residual: f64,
    worst_tissue_work_ns: u64,
    records_lost: u64,
    gate_interventions: u64,
    parameters_generation: u64,
    seed_count: u32,
    least_corner: f64,
    folded_from_m: f64,
    tip_deflection_m: [f64; 3],
    lag_ns: u64,
    lag_m: f64,
    worst_lag_ns: u64,
    worst_lag_m: f64,
}

pub fn state(s: &HapticState) -> Value {
    let state = State {
        needle_direction: s.needle_direction,
        contact_in_scene_m: s.contact_in_scene_m,
        puncture_depth_m: s.puncture_depth_m,
        peak_force_n: s.peak_force_n,
        force_scale: s.force_scale,
        device_limit_n: s.device_limit_n,
        missed_deadlines: s.missed_deadlines,
        worst_wake_ns: s.worst_wake_ns,
        worst_work_ns: s.worst_work_ns,
        tissue_missed_deadlines: s.tissue_missed_deadlines,
        tissue_worst_wake_ns: s.tissue_worst_wake_ns,
        worst_residual: s.worst_residual,
        worst_tissue_work_ns: s.worst_tissue_work_ns,
        records_lost: s.records_lost,
        gate_interventions: s.gate_interventions,
        parameters_generation: s.parameters_generation,
        seed_count: s.seed_count,
        least_corner: s.least_corner,
        folded_from_m: s.folded_from_m,
        tip_deflection_m: s.tip_deflection_m,
        lag_ns: s.lag_ns,
        lag_m: s.lag_m,
        worst_lag_ns: s.worst_lag_ns,
        worst_lag_m: s.worst_lag_m,
    };
    serde_json::to_value(state).unwrap_or_default()
}

/// The parts of it that ticks say are zero.
pub fn state_of(data: &[u8]) -> Option<HapticState> {
    let s: State = serde_json::from_slice(data).ok()?;
    Some(HapticState {
        needle_direction: s.needle_direction,
        contact_in_scene_m: s.contact_in_scene_m,
        puncture_depth_m: s.puncture_depth_m,
        peak_force_n: s.peak_force_n,
        force_scale: s.force_scale,
        device_limit_n: s.device_limit_n,
        missed_deadlines: s.missed_deadlines,
        worst_wake_ns: s.worst_wake_ns,
        worst_work_ns: s.worst_work_ns,
        tissue_missed_deadlines: s.tissue_missed_deadlines,
        tissue_worst_wake_ns: s.tissue_worst_wake_ns,
        worst_residual: s.worst_residual,
        worst_tissue_work_ns: s.worst_tissue_work_ns,
        records_lost: s.records_lost,
        gate_interventions: s.gate_interventions,
        parameters_generation: s.parameters_generation,
        seed_count: s.seed_count,
        least_corner: s.least_corner,
        folded_from_m: s.folded_from_m,
        tip_deflection_m: s.tip_deflection_m,
        lag_ns: s.lag_ns,
        lag_m: s.lag_m,
        worst_lag_ns: s.worst_lag_ns,
        worst_lag_m: s.worst_lag_m,
        ..HapticState::zeroed()
    })
}
