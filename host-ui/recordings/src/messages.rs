//! Messages of a recording: what the core sends under the names of its fields, so that a recording outlives the layout
//! of shared memory; a field unknown to the file takes its default.

use crate::{SceneModel, Snapshot};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use bytemuck::Zeroable;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use stylet_shm_schema::{
    Event, EventKind, LeftNeedlePose, MAX_STRUCTURES, PARAMETERS, ParametersInForce, PlanInForce, PlannedNeedle,
    SCHEMA_VERSION, SceneHeader, SeedPose, Session, SnapshotHeader, StructureInfo, Vertex,
};

/// Writes a message under the names of its fields, in their alphabetical order.
pub fn message(value: &impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// An [`Event`] with the name of its kind.
#[derive(Serialize, Deserialize)]
struct NamedEvent {
    kind: String,
    #[serde(flatten)]
    event: Event,
}

/// Writes an event.
pub fn event(event: &Event) -> Value {
    message(&NamedEvent {
        kind: EventKind::from_number(event.kind).map_or_else(String::new, |kind| format!("{kind:?}")),
        event: *event,
    })
}

/// Reads an event; `None` for invalid bytes.
pub fn event_of(data: &[u8]) -> Option<Event> {
    let NamedEvent { kind, event } = serde_json::from_slice(data).ok()?;
    let kind = (1..64)
        .filter_map(EventKind::from_number)
        .find(|known| format!("{known:?}") == kind)?;
    let is_finite = event.value.is_finite() && event.position_m.iter().all(|c| c.is_finite());
    is_finite.then_some(Event {
        kind: kind as u32,
        ..event
    })
}

/// A [`SnapshotHeader`] with its lists.
#[derive(Serialize, Deserialize)]
struct Tissue {
    #[serde(flatten)]
    header: SnapshotHeader,
    held_element: Option<u32>,
    seeds: Vec<SeedPose>,
    // Absent from recordings of earlier versions.
    #[serde(default)]
    needles_left_in: Vec<LeftNeedlePose>,
    #[serde(default)]
    bend_m: Vec<[f64; 3]>,
}

/// Writes the header of a snapshot.
pub fn tissue(snapshot: &Snapshot) -> Value {
    let h = &snapshot.header;
    message(&Tissue {
        header: *h,
        held_element: (h.held_element != u32::MAX).then_some(h.held_element),
        seeds: h.seeds[..h.seed_count as usize].to_vec(),
        needles_left_in: h.left().to_vec(),
        bend_m: h.bends_m().to_vec(),
    })
}

/// Returns the header of a snapshot, with the fields that [`tissue`] keeps.
pub fn tissue_of(data: &[u8]) -> Option<SnapshotHeader> {
    let mut t: Tissue = serde_json::from_slice(data).ok()?;
    t.header.held_element = t.held_element.unwrap_or(u32::MAX);
    t.header.seed_count = fill(&mut t.header.seeds, &t.seeds);
    t.header.left_count = fill(&mut t.header.left, &t.needles_left_in);
    t.header.bend_count = fill(&mut t.header.bend_m, &t.bend_m);
    Some(t.header)
}

/// Copies as many as fit, and returns their number.
fn fill<T: Copy>(room: &mut [T], from: &[T]) -> u32 {
    let count = room.len().min(from.len());
    room[..count].copy_from_slice(&from[..count]);
    count as u32
}

/// Writes the vertices of the deformed surface, in the order of the scene's rest surface.
pub fn gland(snapshot: &Snapshot, time_ns: u64) -> Value {
    const FLOAT32: u32 = 7;
    let fields = ["x", "y", "z"].iter().enumerate();
    let fields = fields.map(|(i, name)| json!({ "name": name, "offset": 4 * i, "type": FLOAT32 }));
    json!({
        "timestamp": { "sec": time_ns / 1_000_000_000, "nsec": time_ns % 1_000_000_000 },
        "frame_id": "scene",
        "pose": { "position": { "x": 0.0, "y": 0.0, "z": 0.0 }, "orientation": { "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0 } },
        "point_stride": size_of::<Vertex>(), "fields": fields.collect::<Vec<_>>(),
        "data": places(&snapshot.positions_m),
    })
}

/// Returns the vertices of [`gland`].
pub fn gland_of(data: &[u8]) -> Option<Vec<[f32; 3]>> {
    #[derive(Deserialize)]
    struct Gland {
        data: String,
    }
    let gland: Gland = serde_json::from_slice(data).ok()?;
    places_of(&gland.data)
}

/// Encodes positions as three `f32` each, little-endian, base64.
fn places(places_m: &[[f32; 3]]) -> String {
    let bytes: Vec<u8> = places_m.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    STANDARD.encode(bytes)
}

fn places_of(text: &str) -> Option<Vec<[f32; 3]>> {
    let bytes = STANDARD.decode(text).ok()?;
    let coordinate = |w: &[u8]| f32::from_le_bytes([w[0], w[1], w[2], w[3]]);
    let place = |p: &[u8]| [coordinate(&p[..4]), coordinate(&p[4..8]), coordinate(&p[8..])];
    Some(bytes.chunks_exact(12).map(place).collect())
}

#[derive(Serialize, Deserialize)]
struct Scene {
    #[serde(flatten)]
    header: SceneHeader,
    structures: Vec<StructureInfo>,
    /// Words that follow a `SceneHeader`, little-endian, base64.
    words: String,
}

/// Writes a scene at rest.
pub fn scene(model: &SceneModel) -> Value {
    let words: Vec<u8> = model.words().iter().flat_map(|word| word.to_le_bytes()).collect();
    message(&Scene {
        header: model.header,
        structures: model.header.structures().to_vec(),
        words: STANDARD.encode(words),
    })
}

/// Decodes a scene; `None` if it is inconsistent.
pub fn scene_of(data: &[u8], session_id: u64) -> Option<SceneModel> {
    let Scene {
        mut header,
        structures,
        words,
    } = serde_json::from_slice(data).ok()?;
    if structures.len() > MAX_STRUCTURES {
        return None;
    }
    header.session_id = session_id;
    header.structure_count = fill(&mut header.structures, &structures);
    let bytes = STANDARD.decode(words).ok()?;
    let words = bytes
        .chunks_exact(4)
        .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
    SceneModel::of_words(&header, &words.collect::<Vec<_>>())
}

#[derive(Serialize, Deserialize)]
struct Field {
    scene_generation: u64,
    /// Displacements in m, base64.
    displacements: String,
}

/// Writes the displacements of a snapshot.
pub fn field(snapshot: &Snapshot) -> Value {
    message(&Field {
        scene_generation: snapshot.header.scene_generation,
        displacements: places(&snapshot.displacements_m),
    })
}

/// Returns the generation of the scene, and the displacements.
pub fn field_of(data: &[u8]) -> Option<(u64, Vec<[f32; 3]>)> {
    let field: Field = serde_json::from_slice(data).ok()?;
    Some((field.scene_generation, places_of(&field.displacements)?))
}

/// Reads the announcement of a core; `None` for invalid bytes, as below.
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

/// Writes a plan.
pub fn plan(plan: &PlanInForce) -> Value {
    message(&Plan {
        generation: plan.generation,
        scene_generation: plan.scene_generation,
        needle: plan.needle(),
    })
}

/// Reads a plan of that run.
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

/// Writes parameters by their keys.
pub fn parameters(in_force: &ParametersInForce) -> Value {
    let value = |spec: &stylet_shm_schema::ParameterSpec| (spec.key.to_owned(), in_force.set.get(spec.id));
    message(&Parameters {
        generation: in_force.generation,
        effective_tick: in_force.effective_tick,
        values: PARAMETERS.iter().map(value).collect(),
    })
}

/// Reads parameters of that run; those that the file lacks have their defaults.
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
