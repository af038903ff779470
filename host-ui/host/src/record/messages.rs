//! Messages of a recording: JSON, each kind with its JSON schema, so that any viewer of MCAP opens them.
//!
//! JSON rather than a binary form: 1 kHz of it costs one core a few per cent, zstd recovers most of its size (figures
//! in CHANGELOG), and every reader has a parser. Numbers are written so that they read back to the same bits.

use super::{scene, setting};
use crate::link::Snapshot;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use stylet_shm_schema::{Event, EventKind, LeftNeedlePose, SeedPose, SnapshotHeader, Text, Vertex};

/// Channel of a kind of message, with the name and text of its schema.
pub struct Channel {
    pub topic: &'static str,
    pub schema: &'static str,
    pub text: fn() -> Value,
}

pub const TICK: Channel = Channel {
    topic: "/stylet/tick",
    schema: "stylet.Tick",
    text: tick_schema,
};
pub const EVENT: Channel = Channel {
    topic: "/stylet/event",
    schema: "stylet.Event",
    text: event_schema,
};
pub const TISSUE: Channel = Channel {
    topic: "/stylet/tissue",
    schema: "stylet.Tissue",
    text: tissue_schema,
};
/// The well-known schema of this name, which viewers can draw.
pub const GLAND: Channel = Channel {
    topic: "/stylet/gland",
    schema: "foxglove.PointCloud",
    text: gland_schema,
};

pub(super) fn vector(length: usize, unit: &str) -> Value {
    json!({ "type": "array", "items": { "type": "number" }, "minItems": length, "maxItems": length, "description": unit })
}

fn number(unit: &str) -> Value {
    json!({ "type": "number", "description": unit })
}

pub(super) fn whole(what: &str) -> Value {
    json!({ "type": "integer", "minimum": 0, "description": what })
}

pub(super) fn object(title: &str, properties: Value) -> Value {
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, "type": "object",
        "properties": properties,
    })
}

fn tick_schema() -> Value {
    object(
        TICK.schema,
        json!({
            "session_id": whole("run of rt-core"), "tick": whole("of the force loop"),
            "due_ns": whole("CLOCK_MONOTONIC, on the ideal grid"), "wake_latency_ns": whole("from due to awake"),
            "force_written_ns": whole("from awake to force written"), "work_ns": whole("from awake to done"),
            "missed": whole("deadlines skipped just before"), "phase": whole("0 outside, 1 contraction, 2 penetration, 3 retraction, 4 hold"),
            "fault": whole("0 none"), "flags": whole("bits: 1 real-time, 2 engaged, 4 in contact, 8 punctured, 16 simulated device, 32 at goal, 64 gate acted, 128 waiting, 256 line needed, 512 line ready, 1024 tissue folded"),
            "tip_in_scene_m": vector(3, "m"), "force_on_hand_n": vector(3, "N, after the gate"), "depth_m": number("m since the membrane"),
            "speed_m_per_s": number("m/s along the path, inwards"),
            "force_terms_n": vector(5, "N before the gate: membrane, guide, damping, friction, gravity"),
            "tissue_tick": whole("of the tissue loop"), "world_from_tool": vector(4, "quaternion i, j, k, w"), "buttons": whole("one bit each"),
            "tip_deflection_m": vector(3, "m, of a needle that bends, from where a rigid one would be"),
            "folded_from_um": whole("displacement at the tip from which on the linear answer is folded, micrometres; 0: it is not"),
        }),
    )
}

fn event_schema() -> Value {
    object(
        EVENT.schema,
        json!({
            "session_id": whole("run of rt-core"), "sequence": whole("of the event"), "tick": whole("of the loop that reported it"),
            "time_ns": whole("CLOCK_MONOTONIC"), "kind": { "type": "string" }, "code": whole("seed, fault or nothing, by kind"),
            "value": number("m or nothing, by kind"), "position_m": vector(3, "m"), "text": { "type": "string" },
        }),
    )
}

/// An [`Event`] with the name of its kind.
#[derive(Serialize, Deserialize)]
struct NamedEvent {
    session_id: u64,
    sequence: u64,
    tick: u64,
    time_ns: u64,
    kind: String,
    code: u32,
    value: f64,
    position_m: [f64; 3],
    text: String,
}

pub fn event(e: &Event) -> Value {
    setting::message(&NamedEvent {
        session_id: e.session_id,
        sequence: e.sequence,
        tick: e.tick,
        time_ns: e.time_ns,
        kind: EventKind::from_number(e.kind).map_or_else(String::new, |kind| format!("{kind:?}")),
        code: e.code,
        value: e.value,
        position_m: e.position_m,
        text: e.text.read(),
    })
}

/// Reads an event; `None` for invalid bytes.
pub fn event_of(data: &[u8]) -> Option<Event> {
    let e: NamedEvent = serde_json::from_slice(data).ok()?;
    let kind = (1..64)
        .filter_map(EventKind::from_number)
        .find(|kind| format!("{kind:?}") == e.kind)?;
    let is_finite = e.value.is_finite() && e.position_m.iter().all(|c| c.is_finite());
    is_finite.then_some(Event {
        session_id: e.session_id,
        sequence: e.sequence,
        time_ns: e.time_ns,
        tick: e.tick,
        kind: kind as u32,
        code: e.code,
        value: e.value,
        position_m: e.position_m,
        text: Text::new(&e.text),
    })
}

fn tissue_schema() -> Value {
    object(
        TISSUE.schema,
        json!({
            "session_id": whole("run of rt-core"), "tissue_tick": whole("of the tissue loop"), "time_ns": whole("CLOCK_MONOTONIC"),
            "tip_in_scene_m": vector(3, "m"), "needle_direction": vector(3, "unit vector to the tip"),
            "bend_m": { "type": "array", "items": vector(3, "m, from where a rigid needle would be; from the tip back to the hand") },
            "bend_spacing_m": number("m along the needle from one to the next"),
            "body_moved_m": vector(3, "m, of all of the body from where the scene has it; seeds are in the body as the scene has it"),
            "held_in_scene_m": vector(3, "m"), "held_element": { "type": ["integer", "null"] }, "phase": whole("as of a tick"),
            "residual": number("of the model"), "max_displacement_m": number("m"), "work_ns": whole("of the tissue tick"),
            "seeds": { "type": "array", "items": { "type": "object", "properties": {
                "position_m": vector(3, "m"), "axis": vector(3, "unit vector"), "dropped_at_m": vector(3, "m"),
            } } },
            "needles_left_in": { "type": "array", "items": { "type": "object", "properties": {
                "number": whole("of the needle"), "tip_m": vector(3, "m"), "direction": vector(3, "unit vector"),
            } } },
        }),
    )
}

/// The fields of a [`SnapshotHeader`] that viewers need.
#[derive(Serialize, Deserialize)]
struct Tissue {
    session_id: u64,
    tissue_tick: u64,
    time_ns: u64,
    tip_in_scene_m: [f64; 3],
    needle_direction: [f64; 3],
    held_in_scene_m: [f64; 3],
    held_element: Option<u32>,
    phase: u32,
    residual: f64,
    max_displacement_m: f64,
    work_ns: u64,
    seeds: Vec<SeedPose>,
    // Absent from recordings of earlier versions.
    #[serde(default)]
    needles_left_in: Vec<LeftNeedlePose>,
    #[serde(default)]
    bend_m: Vec<[f64; 3]>,
    #[serde(default)]
    bend_spacing_m: f64,
    #[serde(default)]
    body_moved_m: [f64; 3],
}

pub fn tissue(snapshot: &Snapshot) -> Value {
    let h = &snapshot.header;
    setting::message(&Tissue {
        session_id: h.session_id,
        tissue_tick: h.tissue_tick,
        time_ns: h.time_ns,
        tip_in_scene_m: h.tip_in_scene_m,
        needle_direction: h.needle_direction,
        held_in_scene_m: h.held_in_scene_m,
        held_element: (h.held_element != u32::MAX).then_some(h.held_element),
        phase: h.phase,
        residual: h.residual,
        max_displacement_m: h.max_displacement_m,
        work_ns: h.work_ns,
        seeds: h.seeds[..h.seed_count as usize].to_vec(),
        needles_left_in: h.left().to_vec(),
        bend_m: h.bends_m().to_vec(),
        bend_spacing_m: h.bend_spacing_m,
        body_moved_m: h.body_moved_m,
    })
}

/// Returns the header of a snapshot, with the fields that [`tissue`] keeps.
pub fn tissue_of(data: &[u8]) -> Option<SnapshotHeader> {
    let t: Tissue = serde_json::from_slice(data).ok()?;
    let mut header = SnapshotHeader {
        session_id: t.session_id,
        tissue_tick: t.tissue_tick,
        time_ns: t.time_ns,
        tip_in_scene_m: t.tip_in_scene_m,
        needle_direction: t.needle_direction,
        held_in_scene_m: t.held_in_scene_m,
        residual: t.residual,
        max_displacement_m: t.max_displacement_m,
        work_ns: t.work_ns,
        held_element: t.held_element.unwrap_or(u32::MAX),
        phase: t.phase,
        bend_spacing_m: t.bend_spacing_m,
        body_moved_m: t.body_moved_m,
        ..SnapshotHeader::default()
    };
    header.seed_count = fill(&mut header.seeds, &t.seeds);
    header.left_count = fill(&mut header.left, &t.needles_left_in);
    header.bend_count = fill(&mut header.bend_m, &t.bend_m);
    Some(header)
}

/// Copies as many as fit, and returns their number.
fn fill<T: Copy>(room: &mut [T], from: &[T]) -> u32 {
    let count = room.len().min(from.len());
    room[..count].copy_from_slice(&from[..count]);
    count as u32
}

#[derive(Deserialize)]
struct Gland {
    data: String,
}

/// The vertices of [`gland`].
pub fn gland_of(data: &[u8]) -> Option<Vec<[f32; 3]>> {
    let gland: Gland = serde_json::from_slice(data).ok()?;
    scene::places_of(&gland.data)
}

fn gland_schema() -> Value {
    let point = |names: &[&str]| {
        let fields = names.iter().map(|n| (n.to_string(), json!({ "type": "number" })));
        json!({ "type": "object", "properties": fields.collect::<serde_json::Map<_, _>>() })
    };
    object(
        GLAND.schema,
        json!({
            "timestamp": { "type": "object", "title": "time", "properties": { "sec": whole("s"), "nsec": whole("ns") } },
            "frame_id": { "type": "string" },
            "pose": { "type": "object", "properties": { "position": point(&["x", "y", "z"]), "orientation": point(&["x", "y", "z", "w"]) } },
            "point_stride": whole("bytes from one point to the next"),
            "fields": { "type": "array", "items": { "type": "object", "properties": {
                "name": { "type": "string" }, "offset": whole("bytes"), "type": whole("7 is FLOAT32"),
            } } },
            "data": { "type": "string", "contentEncoding": "base64", "description": "surface vertices, m, scene frame" },
        }),
    )
}

/// Vertices of the deformed surface, in the order of the scene's rest surface.
pub fn gland(snapshot: &Snapshot, time_ns: u64) -> Value {
    use base64::Engine;
    const FLOAT32: u32 = 7;
    let stride = size_of::<Vertex>();
    let fields = ["x", "y", "z"].iter().enumerate();
    let fields = fields.map(|(i, name)| json!({ "name": name, "offset": 4 * i, "type": FLOAT32 }));
    let bytes: &[u8] = bytemuck::cast_slice(&snapshot.positions_m);
    json!({
        "timestamp": { "sec": time_ns / 1_000_000_000, "nsec": time_ns % 1_000_000_000 },
        "frame_id": "scene",
        "pose": { "position": { "x": 0.0, "y": 0.0, "z": 0.0 }, "orientation": { "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0 } },
        "point_stride": stride, "fields": fields.collect::<Vec<_>>(),
        "data": base64::engine::general_purpose::STANDARD.encode(bytes),
    })
}
