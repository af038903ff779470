//! The zenoh session: QUIC alone, certificates on both sides, no scouting, and access only as listed.

use crate::RelayError;
use crate::keys::{Identity, SEATS, seat_name};
use crate::say::say;
use crate::wire::{MAX_PART_BYTES, MAX_SCENE_WORDS};
use base64::Engine;
use serde_json::{Value, json};
use std::fmt;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use stylet_shm_schema::SCHEMA_VERSION;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};
pub use zenoh::Session;
pub use zenoh::bytes::ZBytes as Bytes;
use zenoh::qos::Reliability;
pub use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Config, Wait};

/// Default port of `serve`.
pub const PORT: u16 = 7461;
/// Silence after which a link is closed, ms.
const LEASE_MS: u32 = 600;
/// Longest wait for room by a message that is sent whole. A silent peer is lost after [`LEASE_MS`]; one that is heard
/// is slow, and is waited for.
pub const PATIENCE_US: u64 = 10_000_000;
/// Time after which an unfinished connection is restarted: QUIC resends a lost first packet only after a second. Four
/// round trips.
const OPEN_MS: u32 = 700;
/// Largest message to a member: a scene.
const MAX_OF_SERVER: usize = 4 * MAX_SCENE_WORDS + (1 << 20);
/// Largest message to a server, from any sender.
const MAX_OF_MEMBER: usize = 2 * MAX_PART_BYTES;

/// Destination of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// From the server to one seat.
    To(u16),
    /// From one seat to the server.
    Ask(u16),
}

impl Place {
    /// Returns its key expression.
    pub fn key(self) -> String {
        let root = format!("stylet/{SCHEMA_VERSION}");
        match self {
            Self::To(seat) => format!("{root}/to/{}", seat_name(seat)),
            Self::Ask(seat) => format!("{root}/ask/{}", seat_name(seat)),
        }
    }
}

/// Key matched by every request to the server.
pub fn every_ask() -> String {
    format!("stylet/{SCHEMA_VERSION}/ask/*")
}

/// Returns an endpoint with datagrams as well as streams, for [`put_newest`].
fn endpoint(at: &str) -> String {
    format!("quic/{at}?mixed_rel=1")
}

fn base64(text: &str) -> String {
    base64::engine::general_purpose::STANDARD.encode(text)
}

fn common(mode: &str, tls: Value, max_message_bytes: usize) -> Value {
    json!({
        "mode": mode,
        // Without its delay a server sends as soon as it listens.
        "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": {
            "unicast": { "open_timeout": OPEN_MS, "accept_timeout": 1000, "max_sessions": 64, "qos": { "enabled": true } },
            "link": {
                "protocols": ["quic"],
                "tx": {
                    "lease": LEASE_MS, "keep_alive": 6,
                    "queue": { "size": { "data_low": 4 }, "congestion_control": { "drop": { "wait_before_drop": 1000 }, "block": { "wait_before_close": PATIENCE_US } } },
                },
                "rx": { "max_message_size": max_message_bytes },
                "tls": tls,
            },
        },
    })
}

/// Opens the session of `serve`, listening on addresses with ports.
pub fn serve(listen: &[String], identity: &Identity) -> Result<Session, RelayError> {
    let tls = json!({
        "root_ca_certificate_base64": base64(&identity.authority),
        "listen_private_key_base64": base64(&identity.key),
        "listen_certificate_base64": base64(&identity.certificate),
        "enable_mtls": true,
        "close_link_on_expiration": true,
    });
    let mut config = common("router", tls, MAX_OF_MEMBER);
    let endpoints: Vec<String> = listen.iter().map(|at| endpoint(at)).collect();
    config["listen"] = json!({ "endpoints": endpoints, "exit_on_failure": true });
    config["access_control"] = access();
    open(&config).map_err(|why| RelayError::Listen {
        addresses: listen.join(", "),
        why,
    })
}

/// Opens the session of the member with `identity`, which connects to `server`, an address with a port, whenever it
/// can.
pub fn join(server: &str, identity: &Identity) -> Result<Session, RelayError> {
    let tls = json!({
        "root_ca_certificate_base64": base64(&identity.authority),
        "connect_private_key_base64": base64(&identity.key),
        "connect_certificate_base64": base64(&identity.certificate),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    });
    let mut config = common("client", tls, MAX_OF_SERVER);
    config["connect"] = json!({
        "endpoints": [endpoint(server)], "timeout_ms": -1, "exit_on_failure": false,
        "retry": { "period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5 },
    });
    open(&config).map_err(|why| RelayError::Connect {
        server: server.to_owned(),
        why,
    })
}

fn open(config: &Value) -> Result<Session, zenoh::Error> {
    // A second session of one program finds the log in use.
    let _ = tracing::subscriber::set_global_default(Log);
    zenoh::open(Config::from_json5(&config.to_string())?).wait()
}

/// Access rules: deny by default; a seat may send and receive under its own name alone. The server admits seats message
/// by message.
fn access() -> Value {
    let server = "server";
    let mut rules = vec![json!({
        "id": server, "permission": "allow", "flows": ["egress"], "messages": ["declare_subscriber"],
        "key_exprs": [every_ask()],
    })];
    let names: Vec<String> = (1..=SEATS).map(seat_name).collect();
    let mut subjects = vec![json!({ "id": "seats", "cert_common_names": names })];
    let mut policies = vec![json!({ "rules": [server], "subjects": ["seats"] })];
    for seat in 1..=SEATS {
        let name = seat_name(seat);
        let kinds = [
            ("ask", "ingress", "put", Place::Ask(seat)),
            ("hear", "ingress", "declare_subscriber", Place::To(seat)),
            ("to", "egress", "put", Place::To(seat)),
        ];
        let id = |kind: &str| format!("{kind}-{name}");
        rules.extend(kinds.map(|(kind, flow, message, place)| {
            json!({
                "id": id(kind), "permission": "allow", "flows": [flow], "messages": [message], "key_exprs": [place.key()],
            })
        }));
        subjects.push(json!({ "id": name, "cert_common_names": [name] }));
        policies.push(json!({ "rules": kinds.map(|(kind, ..)| id(kind)), "subjects": [name] }));
    }
    json!({ "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies })
}

/// Sends a message; the receiver requests it again if congestion drops it.
pub fn put(session: &Session, place: Place, priority: Priority, bytes: impl Into<Bytes>) {
    let sent = session
        .put(place.key(), bytes.into())
        .congestion_control(CongestionControl::Drop)
        .priority(priority)
        .express(true)
        .wait();
    // A closing session sends nothing; its end is noticed elsewhere.
    let _ = sent;
}

/// As [`put`], in datagrams that are never resent: a lost one is not worth waiting for, and delays nothing after it.
pub fn put_newest(session: &Session, place: Place, priority: Priority, bytes: impl Into<Bytes>) {
    let sent = session
        .put(place.key(), bytes.into())
        .congestion_control(CongestionControl::Drop)
        .reliability(Reliability::BestEffort)
        .priority(priority)
        .express(true)
        .wait();
    let _ = sent;
}

/// As [`put`], but waits for room: for the one member that asked, on its own thread.
pub fn put_whole(session: &Session, place: Place, priority: Priority, bytes: impl Into<Bytes>) {
    let sent = session
        .put(place.key(), bytes.into())
        .congestion_control(CongestionControl::Block)
        .priority(priority)
        .wait();
    let _ = sent;
}

/// Calls `take` with key and bytes of each message, on a thread of zenoh, so it must not block.
pub fn hear(
    session: &Session,
    key: &str,
    take: impl Fn(&str, &[u8]) + Send + Sync + 'static,
) -> Result<(), RelayError> {
    session
        .declare_subscriber(key.to_owned())
        .callback(move |sample| take(sample.key_expr().as_str(), &sample.payload().to_bytes()))
        .background()
        .wait()
        .map_err(|why| RelayError::Hear {
            key: key.to_owned(),
            why,
        })
}

/// Closes a session. It may wait for a peer that does not answer, and is abandoned after two seconds.
pub fn close(session: Session) {
    let (done, ended) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let _ = session.close().wait();
        let _ = done.send(());
    });
    let _ = ended.recv_timeout(Duration::from_secs(2));
}

const SAY_EVERY: Duration = Duration::from_secs(10);
/// Most different reasons reported in that time.
const SAY_AT_MOST: usize = 8;
static SAID: Mutex<Vec<(String, Instant)>> = Mutex::new(Vec::new());

/// zenoh warns that its access rules may not know a link's network interface; ours name none.
const NO_CONCERN: &str = "Transport returned multiple network interfaces";

/// Extracts the text for users from a zenoh message: for a failed handshake, the quoted reason of its library.
fn reason(text: &str) -> Option<String> {
    if text.starts_with(NO_CONCERN) {
        return None;
    }
    if !text.contains("QUIC acceptor failed") {
        return Some(format!("network: {text}"));
    }
    let quoted = text
        .split_once("reason: \"")
        .and_then(|(_, rest)| rest.split('"').next());
    let quoted = quoted.unwrap_or(text).split(" time ").next().unwrap_or(text);
    Some(format!("refused: a connection, in its handshake: {quoted}"))
}

/// Prints zenoh's errors and warnings, such as a refused certificate.
struct Log;

struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

impl Subscriber for Log {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_event() && *metadata.level() <= Level::WARN && metadata.target().starts_with("zenoh")
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut text = Text(String::new());
        event.record(&mut text);
        // A refused peer retries at once; the same reason is printed only once in a while.
        let Some(why) = reason(&text.0) else { return };
        let mut said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
        said.retain(|(_, at)| at.elapsed() < SAY_EVERY);
        // A peer may have chosen part of it.
        let why = why.replace(char::is_control, " ");
        if said.len() < SAY_AT_MOST && said.iter().all(|(last, _)| *last != why) {
            say(why.clone());
            said.push((why, Instant::now()));
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}
