//! The session of zenoh: QUIC alone, certificates on both sides, no scouting, nothing allowed that is not listed.

mod claimed;

use crate::RelayError;
use crate::keys::{Identity, SEATS, seat_name};
use crate::say::say;
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
use zenoh::qos::Reliability;
pub use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Config, Wait};

/// Port where `serve` listens where no other is given.
pub const PORT: u16 = 7461;
/// A link that is silent for so long is closed, ms.
const LEASE_MS: u32 = 600;
/// What is sent whole waits so long for room. A peer that is silent is lost after [`LEASE_MS`]; one that is heard is slow, and waited for.
pub const PATIENCE_US: u64 = 10_000_000;
/// A connection that is not made after so long is begun again: QUIC sends a first packet that was lost again after a second. Four round trips.
const OPEN_MS: u32 = 700;
/// A message of a volume of 64 million cells fits.
const MAX_MESSAGE_BYTES: usize = 70 << 20;

/// Where a message goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Records, from the server to all.
    Records,
    /// Everything else, from the server to all.
    Rest,
    /// From the server to one seat.
    To(u16),
    /// From one seat to the server.
    Ask(u16),
}

impl Place {
    /// Its key expression.
    pub fn key(self) -> String {
        let root = format!("stylet/{SCHEMA_VERSION}");
        match self {
            Self::Records => format!("{root}/all/records"),
            Self::Rest => format!("{root}/all/rest"),
            Self::To(seat) => format!("{root}/to/{}", seat_name(seat)),
            Self::Ask(seat) => format!("{root}/ask/{}", seat_name(seat)),
        }
    }
}

/// The key that every request to the server matches.
pub fn every_ask() -> String {
    format!("stylet/{SCHEMA_VERSION}/ask/*")
}

/// With datagrams beside its streams, for [`put_newest`].
fn endpoint(at: &str) -> String {
    format!("quic/{at}?mixed_rel=1")
}

fn base64(text: &str) -> String {
    base64::engine::general_purpose::STANDARD.encode(text)
}

fn common(mode: &str, tls: Value) -> Value {
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
                "rx": { "max_message_size": MAX_MESSAGE_BYTES },
                "tls": tls,
            },
        },
    })
}

/// What `serve` listens on: addresses with ports. Seats in `closed` hear nothing; what they ask is refused by name, by `serve::asked`.
pub fn serve(listen: &[String], identity: &Identity, closed: &[u16]) -> Result<Session, RelayError> {
    let tls = json!({
        "root_ca_certificate_base64": base64(&identity.authority),
        "listen_private_key_base64": base64(&identity.key),
        "listen_certificate_base64": base64(&identity.certificate),
        "enable_mtls": true,
        "close_link_on_expiration": true,
    });
    let mut config = common("router", tls);
    let endpoints: Vec<String> = listen.iter().map(|at| endpoint(at)).collect();
    config["listen"] = json!({ "endpoints": endpoints, "exit_on_failure": true });
    config["access_control"] = access(closed);
    open(&config).map_err(|e| {
        RelayError(format!(
            "cannot listen on {}: {e}. Is another relay running, or does 'relay keys new' still have to make this machine's certificate?",
            listen.join(", ")
        ))
    })
}

/// A session of the member with `identity`, which connects to `server`, an address with a port, whenever it can.
pub fn join(server: &str, identity: &Identity) -> Result<Session, RelayError> {
    let tls = json!({
        "root_ca_certificate_base64": base64(&identity.authority),
        "connect_private_key_base64": base64(&identity.key),
        "connect_certificate_base64": base64(&identity.certificate),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    });
    let mut config = common("client", tls);
    config["connect"] = json!({
        "endpoints": [endpoint(server)], "timeout_ms": -1, "exit_on_failure": false,
        "retry": { "period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5 },
    });
    open(&config).map_err(|e| RelayError(format!("cannot connect to {server}: {e}")))
}

fn open(config: &Value) -> Result<Session, zenoh::Error> {
    claimed::note_refused();
    // A second session of one program has the log already.
    let _ = tracing::subscriber::set_global_default(Log);
    zenoh::open(Config::from_json5(&config.to_string())?).wait()
}

/// Default deny; a seat may ask under its own name alone, and hear what is for all and for itself while it is open.
fn access(closed: &[u16]) -> Value {
    let open = || (1..=SEATS).filter(|seat| !closed.contains(seat));
    let mut rules = vec![json!({
        "id": "all", "permission": "allow", "flows": ["ingress", "egress"], "messages": ["declare_subscriber"],
        "key_exprs": [Place::Records.key(), Place::Rest.key()],
    })];
    rules.push(json!({
        "id": "all-data", "permission": "allow", "flows": ["egress"], "messages": ["put"],
        "key_exprs": [Place::Records.key(), Place::Rest.key()],
    }));
    rules.push(json!({
        "id": "server", "permission": "allow", "flows": ["egress"], "messages": ["declare_subscriber"],
        "key_exprs": [every_ask()],
    }));
    let names = |seats: &mut dyn Iterator<Item = u16>| seats.map(seat_name).collect::<Vec<_>>();
    let mut subjects = vec![
        json!({ "id": "members", "cert_common_names": names(&mut open()) }),
        json!({ "id": "seats", "cert_common_names": names(&mut (1..=SEATS)) }),
    ];
    let mut policies = vec![
        json!({ "rules": ["all", "all-data"], "subjects": ["members"] }),
        json!({ "rules": ["server"], "subjects": ["seats"] }),
    ];
    for seat in 1..=SEATS {
        let name = seat_name(seat);
        rules.push(json!({
            "id": format!("ask-{name}"), "permission": "allow", "flows": ["ingress"], "messages": ["put"],
            "key_exprs": [Place::Ask(seat).key()],
        }));
        rules.push(json!({
            "id": format!("hear-{name}"), "permission": "allow", "flows": ["ingress"], "messages": ["declare_subscriber"],
            "key_exprs": [Place::To(seat).key()],
        }));
        rules.push(json!({
            "id": format!("to-{name}"), "permission": "allow", "flows": ["egress"], "messages": ["put"],
            "key_exprs": [Place::To(seat).key()],
        }));
        subjects.push(json!({ "id": name, "cert_common_names": [name] }));
        let kinds: &[&str] = if closed.contains(&seat) {
            &["ask"]
        } else {
            &["ask", "hear", "to"]
        };
        let of_seat: Vec<String> = kinds.iter().map(|kind| format!("{kind}-{name}")).collect();
        policies.push(json!({ "rules": of_seat, "subjects": [name] }));
    }
    json!({ "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies })
}

/// Sends a message; what congestion drops is sent again by whoever needs it.
pub fn put(session: &Session, place: Place, priority: Priority, bytes: Vec<u8>) {
    let sent = session
        .put(place.key(), bytes)
        .congestion_control(CongestionControl::Drop)
        .priority(priority)
        .express(true)
        .wait();
    // A session that is closing sends nothing; its end is seen elsewhere.
    let _ = sent;
}

/// The same in datagrams, which are never sent again: what is lost is not worth waiting for, and holds up nothing that comes after it.
pub fn put_newest(session: &Session, place: Place, priority: Priority, bytes: Vec<u8>) {
    let sent = session
        .put(place.key(), bytes)
        .congestion_control(CongestionControl::Drop)
        .reliability(Reliability::BestEffort)
        .priority(priority)
        .express(true)
        .wait();
    let _ = sent;
}

/// The same, but waits for room: for the one member that asked for it, on a thread of its own.
pub fn put_whole(session: &Session, place: Place, priority: Priority, bytes: Vec<u8>) {
    let sent = session
        .put(place.key(), bytes)
        .congestion_control(CongestionControl::Block)
        .priority(priority)
        .wait();
    let _ = sent;
}

/// Calls `take` with key and bytes of each message; on a thread of zenoh, so it must not wait.
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
        .map_err(|e| RelayError(format!("cannot hear {key}: {e}")))
}

/// Closes a session, which may wait for a peer that does not answer; it is given up after two seconds.
pub fn close(session: Session) {
    let (done, ended) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let _ = session.close().wait();
        let _ = done.send(());
    });
    let _ = ended.recv_timeout(Duration::from_secs(2));
}

const SAY_EVERY: Duration = Duration::from_secs(10);
static SAID: Mutex<Option<(String, Instant)>> = Mutex::new(None);

/// What a person reads of a message of zenoh: of a handshake that failed, the reason that its library gives in quotation marks.
fn reason(text: &str) -> String {
    if !text.contains("QUIC acceptor failed") {
        return format!("network: {text}");
    }
    let quoted = text
        .split_once("reason: \"")
        .and_then(|(_, rest)| rest.split('"').next());
    let quoted = quoted.unwrap_or(text).split(" time ").next().unwrap_or(text);
    let who = claimed::take().map_or_else(String::new, |name| format!(" that calls itself {name}"));
    format!("refused: a connection{who}, in its handshake: {quoted}")
}

/// Prints what zenoh reports as an error or a warning: a refused certificate is one.
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
        // A peer that is refused tries again at once; the same reason is said once in a while.
        let mut said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
        // A peer may have chosen some of it.
        let why = reason(&text.0).replace(char::is_control, " ");
        if said
            .as_ref()
            .is_some_and(|(last, at)| *last == why && at.elapsed() < SAY_EVERY)
        {
            return;
        }
        say(format!("{why}"));
        *said = Some((why, Instant::now()));
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}
