//! Setting of a recording, needed to show it in a window: run, plan, parameters and states.
//!
//! Fields are named, so that a recording outlives the layout of shared memory; a field unknown to the file takes its
//! default.

use super::messages::Channel;
use bytemuck::Zeroable;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use stylet_shm_schema::{PARAMETERS, ParametersInForce, PlanInForce, PlannedNeedle, SCHEMA_VERSION, Session};

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

/// Writes a message under the names of its fields.
pub fn message(value: &impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

pub fn session_of(data: &[u8]) -> Option<Session> {
    let session: Session = serde_json::from_slice(data).ok()?;
    Some(Session {
        schema_version: SCHEMA_VERSION,
        period_ns: session.period_ns.max(1),
        ..session
    })
}

#[derive(Serialize, Deserialize)]
struct Plan {
    generation: u64,
    scene_generation: u64,
    #[serde(flatten)]
    needle: PlannedNeedle,
}

pub fn plan(plan: &PlanInForce) -> Value {
    message(&Plan {
        generation: plan.generation,
        scene_generation: plan.scene_generation,
        needle: plan.needle(),
    })
}

pub fn plan_of(data: &[u8], session_id: u64) -> Option<PlanInForce> {
    let plan: Plan = serde_json::from_slice(data).ok()?;
    Some(PlanInForce {
        session_id,
        generation: plan.generation,
        scene_generation: plan.scene_generation,
        ..PlanInForce::of(Some(&plan.needle))
    })
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
    message(&parameters)
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
