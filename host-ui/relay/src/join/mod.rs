//! The relay on another machine: offers the core's services as if it ran here, and sends the requests of hosts here to
//! the server.

mod awaited;
mod clock;
mod connection;
mod last;
mod line;
mod order;
mod rounds;
mod streams;
mod volume;

use crate::keys::{Identity, Invitation};
use crate::net::{self, Place, Priority};
use crate::say::say;
use crate::wire::{self, Kind, Stamp, encode};
use crate::{RelayError, now_ns};
use clock::Clock;
use connection::{Connection, InUse};
use rounds::Rounds;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stylet_shm_schema::Instance;

/// Most messages queued for a thread; more are dropped, and dropped records are requested again.
const WAITING: usize = 4096;
const SNAPSHOTS_WAITING: usize = 32;
/// Silence after which the server counts as lost, until it is heard again.
const SILENCE: Duration = Duration::from_millis(300);

/// Settings of a member.
pub struct Options {
    /// Instance for hosts here.
    pub instance: Instance,
    /// Address and port of the server.
    pub server: String,
    /// Invitation of this member.
    pub invitation: Invitation,
    /// The certificate and key of the invitation.
    pub identity: Identity,
}

/// State shared by a member's threads.
struct Member {
    session: InUse,
    instance: Instance,
    seat: u16,
    // SYNC: the fields below are independent figures; no other data is published by them.
    end: AtomicBool,
    server_run: AtomicU64,
    /// Newest time of the server, by its clock.
    heard_ns: AtomicU64,
    /// Time at which the server was last heard, by this machine's clock.
    heard_at_ns: AtomicU64,
    /// Why the server refuses this member, and when it last said so, by this machine's clock.
    refused: Mutex<Option<(String, u64)>>,
    /// Records lost for good.
    lost: AtomicU64,
    clock: Mutex<Clock>,
    /// Snapshots that never arrived, or too late to be shown.
    snapshots_lost: AtomicU64,
    /// Time at which the newest shown snapshot was made, by this machine's clock; 0 for none.
    snapshot_made_ns: AtomicU64,
    /// A run of the core has been announced to hosts here; they drop data before that.
    is_announced: AtomicBool,
    /// Changes the number of the core's run for hosts here, if its board cannot be made under its own.
    salt: AtomicU64,
}

impl Member {
    fn ends(&self) -> bool {
        self.end.load(Ordering::Relaxed)
    }

    /// The run of the core, as announced to hosts here.
    fn run(&self, session_id: u64) -> u64 {
        session_id ^ self.salt.load(Ordering::Relaxed)
    }

    fn heard(&self, stamp: &Stamp) {
        if self.server_run.swap(stamp.run, Ordering::Relaxed) != stamp.run {
            self.heard_ns.store(stamp.sent_ns, Ordering::Relaxed);
        }
        self.heard_ns.fetch_max(stamp.sent_ns, Ordering::Relaxed);
        let now_ns = now_ns();
        self.heard_at_ns.store(now_ns, Ordering::Relaxed);
        self.clock().heard(stamp, now_ns);
    }

    fn clock(&self) -> MutexGuard<'_, Clock> {
        // The data behind the lock is consistent after each statement.
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// True if the server was heard within that time.
    fn has_heard(&self, within: Duration) -> bool {
        let at = self.heard_at_ns.load(Ordering::Relaxed);
        at != 0 && u128::from(now_ns().saturating_sub(at)) < within.as_nanos()
    }

    /// True if records or a refusal arrived within that time.
    fn is_answered(&self, within: Duration) -> bool {
        self.has_heard(within) || self.refusal(within).is_some()
    }

    /// Returns why the server refuses this member.
    fn refusal(&self, within: Duration) -> Option<String> {
        let refused = self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        let recent = |at| u128::from(now_ns().saturating_sub(at)) < within.as_nanos();
        refused
            .as_ref()
            .filter(|(_, at)| recent(*at))
            .map(|(why, _)| why.clone())
    }

    fn has_server(&self) -> bool {
        self.has_heard(SILENCE)
    }

    fn stamp(&self, number: u64) -> Stamp {
        Stamp {
            run: self.server_run.load(Ordering::Relaxed),
            number,
            sent_ns: now_ns(),
            heard_ns: self.heard_ns.load(Ordering::Relaxed),
        }
    }

    /// Sends a message that may be lost: another follows soon.
    fn say(&self, kind: Kind, number: u64, body: &[u8]) {
        let bytes = encode(kind, self.stamp(number), &[body]);
        net::put(
            &self.session.get(),
            Place::Ask(self.seat),
            Priority::InteractiveHigh,
            bytes,
        );
    }

    /// Sends a message that must not be lost while there is a connection.
    fn ask(&self, kind: Kind, parts: &[&[u8]]) {
        // Below all requests of a hand.
        let priority = match kind {
            Kind::Upload => Priority::Data,
            _ => Priority::InteractiveHigh,
        };
        let bytes = encode(kind, self.stamp(0), parts);
        net::put_whole(&self.session.get(), Place::Ask(self.seat), priority, bytes);
    }
}

/// A message passed from a callback to a thread.
type Bytes = Vec<u8>;

/// Queues of messages by kind.
struct Queues {
    records: SyncSender<Bytes>,
    snapshots: SyncSender<Bytes>,
    rest: SyncSender<Bytes>,
}

impl Queues {
    fn take(&self, member: &Member, bytes: &[u8]) {
        let Ok(message) = wire::decode(bytes) else { return };
        if message.kind == Kind::Refused {
            if let Ok(why) = wire::words(message.body) {
                *member.refused.lock().unwrap_or_else(PoisonError::into_inner) = Some((why, now_ns()));
            }
            return;
        }
        member.heard(&message.stamp);
        if message.kind == Kind::Newest
            && let Ok((state, records)) = wire::state_and_records(message.body)
        {
            let _ = self.rest.try_send(encode(Kind::State, message.stamp, &[state]));
            let _ = self.records.try_send(encode(Kind::Records, message.stamp, &[records]));
            return;
        }
        let queue = match message.kind {
            Kind::Records | Kind::Missing => &self.records,
            Kind::Snapshot => &self.snapshots,
            _ => &self.rest,
        };
        let _ = queue.try_send(bytes.to_vec());
    }
}

/// Joins until `stop`.
pub fn run(options: &Options, stop: &AtomicBool) -> Result<(), RelayError> {
    // Before any thread starts, including zenoh's.
    crate::slice::shorten();
    let mut connection = Connection::new(options);
    let Some(session) = connection.first(stop)? else {
        return Ok(());
    };
    let seat = options.invitation.seat;
    let member = Arc::new(Member {
        session: InUse::new(session),
        instance: options.instance.clone(),
        seat,
        end: AtomicBool::new(false),
        server_run: AtomicU64::new(0),
        heard_ns: AtomicU64::new(0),
        heard_at_ns: AtomicU64::new(0),
        refused: Mutex::new(None),
        lost: AtomicU64::new(0),
        clock: Mutex::new(Clock::new()),
        snapshots_lost: AtomicU64::new(0),
        snapshot_made_ns: AtomicU64::new(0),
        is_announced: AtomicBool::new(false),
        salt: AtomicU64::new(0),
    });
    let (to_records, records) = sync_channel(WAITING);
    let (to_snapshots, snapshots) = sync_channel(SNAPSHOTS_WAITING);
    let (to_rest, rest) = sync_channel(WAITING);
    let mut rounds = Rounds::new(Arc::clone(&member), options)?;
    let threads = [
        spawn("records", &member, move |member| streams::records(member, &records))?,
        spawn("snapshots", &member, {
            let scenes = rounds.scenes();
            move |member| streams::snapshots(member, &snapshots, &scenes)
        })?,
    ];
    let queues = Arc::new(Queues {
        records: to_records,
        snapshots: to_snapshots,
        rest: to_rest,
    });
    connection::listen(&member.session.get(), &member, &queues)?;
    say(format!(
        "joining {} as {} ({}); hosts here use instance \"{}\"",
        options.server,
        options.invitation.name,
        options.invitation.role,
        options.instance.name()
    ));
    while !stop.load(Ordering::Relaxed) && !threads.iter().any(std::thread::JoinHandle::is_finished) {
        rounds.pass();
        connection.pass(&member, &queues)?;
        // Waits for one message instead of sleeping, so that a message is not delayed.
        if let Ok(bytes) = rest.recv_timeout(rounds.pause()) {
            rounds.take(&bytes);
            rest.try_iter().take(WAITING).for_each(|bytes| rounds.take(&bytes));
        }
    }
    member.end.store(true, Ordering::Relaxed);
    let mut ended = Ok(());
    for thread in threads {
        ended = thread.join().unwrap_or(Ok(())).and(ended);
    }
    drop(rounds);
    net::close(member.session.get());
    ended
}

type Thread = std::thread::JoinHandle<Result<(), RelayError>>;

fn spawn(
    name: &str,
    member: &Arc<Member>,
    run: impl FnOnce(&Member) -> Result<(), RelayError> + Send + 'static,
) -> Result<Thread, RelayError> {
    let member = Arc::clone(member);
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || run(&member))
        .map_err(RelayError::Thread)
}
