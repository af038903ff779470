//! Channels of a recording: the topic of each kind of message, with its JSON schema, so that any viewer of MCAP opens
//! them.
//!
//! JSON rather than a binary form: 1 kHz of it costs one core a few per cent, zstd recovers most of its size (figures
//! in CHANGELOG), and every reader has a parser. Numbers are written so that they read back to the same bits.

use serde_json::{Map, Value, json};

/// Kind of a message; its number is that of its channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Tick of the force loop.
    Tick,
    /// Event of the core.
    Event,
    /// Header of a snapshot.
    Tissue,
    /// Surface of a snapshot, in the well-known schema of point clouds, which viewers can draw.
    Gland,
    /// Scene at rest.
    Scene,
    /// Plan in force.
    Plan,
    /// Parameters in force.
    Parameters,
    /// What the core counts.
    State,
    /// Displacements of a snapshot.
    Field,
    /// Run of the core.
    Session,
    /// Tick of the second device.
    Second,
}

/// Topic of a kind, name of its schema, and what the schema says of it.
pub struct Channel(pub Kind, pub &'static str, pub &'static str, fn() -> Value);

/// All channels, in the order of their kinds.
pub const CHANNELS: [Channel; 11] = [
    Channel(Kind::Tick, "/stylet/tick", "stylet.Tick", tick),
    Channel(Kind::Event, "/stylet/event", "stylet.Event", event),
    Channel(Kind::Tissue, "/stylet/tissue", "stylet.Tissue", tissue),
    Channel(Kind::Gland, "/stylet/gland", "foxglove.PointCloud", gland),
    Channel(Kind::Scene, "/stylet/scene", "stylet.Scene", || {
        json!("the scene at rest: boxes, structures, surface, labels of the cells")
    }),
    Channel(Kind::Plan, "/stylet/plan", "stylet.Plan", || {
        json!("path of the needle and planned seeds, m, scene frame")
    }),
    Channel(Kind::Parameters, "/stylet/parameters", "stylet.Parameters", || {
        json!("parameters in force by their keys, SI")
    }),
    Channel(Kind::State, "/stylet/state", "stylet.State", || {
        json!("what the core counts since the last reset, beside the ticks")
    }),
    Channel(Kind::Field, "/stylet/field", "stylet.Field", || {
        json!("displacements from rest at the nodes of the scene's grid")
    }),
    Channel(Kind::Session, "/stylet/session", "stylet.Session", || {
        json!("the run of rt-core: device, version, periods, what the kernel granted")
    }),
    Channel(Kind::Second, "/stylet/second", "stylet.SecondTick", second),
];

impl Kind {
    /// Returns the kind of a topic; `None` for one of another version.
    pub fn of(topic: &str) -> Option<Self> {
        CHANNELS
            .iter()
            .find(|channel| channel.1 == topic)
            .map(|channel| channel.0)
    }
}

impl Channel {
    /// Returns the text of the schema: its fields, or a description.
    pub fn text(&self) -> String {
        let about = (self.3)();
        let key = if about.is_string() { "description" } else { "properties" };
        json!({
            "$schema": "https://json-schema.org/draft/2020-12/schema", "title": self.2, "type": "object", (key): about,
        })
        .to_string()
    }
}

fn vector(length: usize, unit: &str) -> Value {
    json!({ "type": "array", "items": { "type": "number" }, "minItems": length, "maxItems": length, "description": unit })
}

fn number(unit: &str) -> Value {
    json!({ "type": "number", "description": unit })
}

fn whole(what: &str) -> Value {
    json!({ "type": "integer", "minimum": 0, "description": what })
}

fn tick() -> Value {
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
    })
}

fn event() -> Value {
    json!({
        "session_id": whole("run of rt-core"), "sequence": whole("of the event"), "tick": whole("of the loop that reported it"),
        "time_ns": whole("CLOCK_MONOTONIC"), "kind": { "type": "string" }, "code": whole("seed, fault or nothing, by kind"),
        "value": number("m or nothing, by kind"), "position_m": vector(3, "m"), "text": { "type": "string" },
    })
}

fn tissue() -> Value {
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
    })
}

fn second() -> Value {
    json!({
        "session_id": whole("run of rt-core"), "tick": whole("of the loop of the second device"),
        "due_ns": whole("CLOCK_MONOTONIC, on the ideal grid"), "wake_latency_ns": whole("from due to awake"),
        "force_written_ns": whole("from awake to force written"), "work_ns": whole("from awake to done"),
        "missed": whole("deadlines skipped just before"), "fault": whole("of this device, 0 none"),
        "flags": whole("bits, as those of a tick: 1 real-time, 2 engaged, 4 in contact, 16 simulated device, 32 at goal, 64 gate acted, 128 waiting"),
        "buttons": whole("one bit each"), "tip_in_scene_m": vector(3, "m, tip of what the hand holds"),
        "world_from_tool": vector(4, "quaternion i, j, k, w; what the hand holds lies along +z"),
        "force_on_hand_n": vector(3, "N, after the gate"), "torque_on_hand_nm": vector(3, "N m, after the gate"),
        "contact_force_n": number("N, size of the force of the contact before the gate"),
        "tissue_tick": whole("of the tissue loop, whose answer was used"),
    })
}

fn gland() -> Value {
    let point = |names: &[&str]| {
        let fields = names.iter().map(|n| (n.to_string(), json!({ "type": "number" })));
        json!({ "type": "object", "properties": fields.collect::<Map<_, _>>() })
    };
    json!({
        "timestamp": { "type": "object", "title": "time", "properties": { "sec": whole("s"), "nsec": whole("ns") } },
        "frame_id": { "type": "string" },
        "pose": { "type": "object", "properties": { "position": point(&["x", "y", "z"]), "orientation": point(&["x", "y", "z", "w"]) } },
        "point_stride": whole("bytes from one point to the next"),
        "fields": { "type": "array", "items": { "type": "object", "properties": {
            "name": { "type": "string" }, "offset": whole("bytes"), "type": whole("7 is FLOAT32"),
        } } },
        "data": { "type": "string", "contentEncoding": "base64", "description": "surface vertices, m, scene frame" },
    })
}
