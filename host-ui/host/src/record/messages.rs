//! What stands in a recording: JSON messages, each kind with its JSON schema, so that any viewer of MCAP opens them.
//!
//! JSON and not a binary form: 1 kHz of it costs one core a few per cent, zstd takes most of its size back (figures in
//! CHANGELOG), and every reader has a parser. Numbers are written so that they read back to the same bits.

use super::scene;
use crate::link::Snapshot;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use stylet_shm_schema::{
    Event, EventKind, MAX_BEND_POINTS, MAX_LEFT_NEEDLES, MAX_SEEDS, SnapshotHeader, Text, TickRecord, Vertex,
};

/// Where each kind of message goes, and the name and text of its schema.
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
/// The well-known schema of this name: viewers draw it.
pub const GLAND: Channel = Channel {
    topic: "/stylet/gland",
    schema: "foxglove.PointCloud",
    text: gland_schema,
};

/// A [`TickRecord`], field by field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    pub session_id: u64,
    pub tick: u64,
    pub due_ns: u64,
    pub wake_latency_ns: u64,
    pub force_written_ns: u64,
    pub work_ns: u64,
    pub missed: u32,
    pub phase: u32,
    pub fault: u32,
    pub flags: u32,
    pub tip_in_scene_m: [f64; 3],
    pub force_on_hand_n: [f64; 3],
    pub depth_m: f64,
    pub speed_m_per_s: f64,
    pub force_terms_n: [f64; 5],
    pub tissue_tick: u64,
    pub world_from_tool: [f64; 4],
    pub buttons: u32,
    /// Recordings of an older version have none.
    #[serde(default)]
    pub tip_deflection_m: [f64; 3],
    /// As above.
    #[serde(default)]
    pub folded_from_um: u32,
}

impl Tick {
    /// As the core sent it.
    pub fn record(&self) -> TickRecord {
        TickRecord {
            session_id: self.session_id,
            tick: self.tick,
            due_ns: self.due_ns,
            wake_latency_ns: self.wake_latency_ns,
            force_written_ns: self.force_written_ns,
            work_ns: self.work_ns,
            missed: self.missed,
            phase: self.phase,
            fault: self.fault,
            flags: self.flags,
            tip_in_scene_m: self.tip_in_scene_m,
            force_on_hand_n: self.force_on_hand_n,
            depth_m: self.depth_m,
            speed_m_per_s: self.speed_m_per_s,
            force_terms_n: self.force_terms_n,
            tissue_tick: self.tissue_tick,
            world_from_tool: self.world_from_tool,
            tip_deflection_m: self.tip_deflection_m,
            buttons: self.buttons,
            folded_from_um: self.folded_from_um,
        }
    }
}

impl From<&TickRecord> for Tick {
    fn from(r: &TickRecord) -> Self {
        Self {
            session_id: r.session_id,
            tick: r.tick,
            due_ns: r.due_ns,
            wake_latency_ns: r.wake_latency_ns,
            force_written_ns: r.force_written_ns,
            work_ns: r.work_ns,
            missed: r.missed,
            phase: r.phase,
            fault: r.fault,
            flags: r.flags,
            tip_in_scene_m: r.tip_in_scene_m,
            force_on_hand_n: r.force_on_hand_n,
            depth_m: r.depth_m,
            speed_m_per_s: r.speed_m_per_s,
            force_terms_n: r.force_terms_n,
            tissue_tick: r.tissue_tick,
            world_from_tool: r.world_from_tool,
            buttons: r.buttons,
            tip_deflection_m: r.tip_deflection_m,
            folded_from_um: r.folded_from_um,
        }
    }
}

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

pub fn event(e: &Event) -> Value {
    json!({
        "session_id": e.session_id, "sequence": e.sequence, "tick": e.tick, "time_ns": e.time_ns,
        "kind": EventKind::from_number(e.kind).map_or_else(String::new, |k| format!("{k:?}")),
        "code": e.code, "value": e.value, "position_m": e.position_m, "text": e.text.read(),
    })
}

/// The event of [`event`]; `None` for bytes that are none.
pub fn event_of(data: &[u8]) -> Option<Event> {
    let e: EventRead = serde_json::from_slice(data).ok()?;
    let kind = (1..64)
        .filter_map(EventKind::from_number)
        .find(|kind| format!("{kind:?}") == e.kind)?;
    let is_finite = e.value.is_finite() && e.position_m.iter().all(|c| c.is_finite());
    is_finite.then(|| Event {
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

#[derive(Deserialize)]
struct EventRead {
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

pub fn tissue(snapshot: &Snapshot) -> Value {
    let h = &snapshot.header;
    let seeds = h.seeds.iter().take(h.seed_count as usize);
    let seeds = seeds.map(|s| json!({ "position_m": s.position_m, "axis": s.axis, "dropped_at_m": s.dropped_at_m }));
    let left = h.left().iter();
    let left = left.map(|l| json!({ "number": l.number, "tip_m": l.tip_m, "direction": l.direction }));
    json!({
        "session_id": h.session_id, "tissue_tick": h.tissue_tick, "time_ns": h.time_ns,
        "tip_in_scene_m": h.tip_in_scene_m, "needle_direction": h.needle_direction, "held_in_scene_m": h.held_in_scene_m,
        "bend_m": h.bends_m(), "bend_spacing_m": h.bend_spacing_m, "body_moved_m": h.body_moved_m,
        "held_element": (h.held_element != u32::MAX).then_some(h.held_element), "phase": h.phase, "residual": h.residual,
        "max_displacement_m": h.max_displacement_m, "work_ns": h.work_ns, "seeds": seeds.collect::<Vec<_>>(),
        "needles_left_in": left.collect::<Vec<_>>(),
    })
}

#[derive(Deserialize)]
struct Seed {
    position_m: [f64; 3],
    axis: [f64; 3],
    dropped_at_m: [f64; 3],
}

#[derive(Deserialize)]
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
    seeds: Vec<Seed>,
    /// Earlier versions know none.
    #[serde(default)]
    needles_left_in: Vec<LeftIn>,
    /// Recordings of an older version have none. So of the spacing.
    #[serde(default)]
    bend_m: Vec<[f64; 3]>,
    #[serde(default)]
    bend_spacing_m: f64,
    /// As above.
    #[serde(default)]
    body_moved_m: [f64; 3],
}

#[derive(Deserialize)]
struct LeftIn {
    number: u64,
    tip_m: [f64; 3],
    direction: [f64; 3],
}

/// The header of a snapshot, as far as [`tissue`] keeps it.
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
        seed_count: t.seeds.len().min(MAX_SEEDS) as u32,
        left_count: t.needles_left_in.len().min(MAX_LEFT_NEEDLES) as u32,
        bend_count: t.bend_m.len().min(MAX_BEND_POINTS) as u32,
        bend_spacing_m: t.bend_spacing_m,
        body_moved_m: t.body_moved_m,
        ..SnapshotHeader::default()
    };
    for (to, from) in header.left.iter_mut().zip(t.needles_left_in) {
        (to.number, to.tip_m, to.direction) = (from.number, from.tip_m, from.direction);
    }
    for (to, from) in header.bend_m.iter_mut().zip(t.bend_m) {
        *to = from;
    }
    for (to, from) in header.seeds.iter_mut().zip(t.seeds) {
        (to.position_m, to.axis, to.dropped_at_m) = (from.position_m, from.axis, from.dropped_at_m);
    }
    Some(header)
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
