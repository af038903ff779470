//! Floods from one seat, as a foreign program would send them, and their effect on the operator and another observer.

use crate::fixture::{Keys, Named, Running, core, invitation, join, until};
use crate::host::{Host, go};
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use stylet_relay::keys::{Role, Validity};
use stylet_relay::net::{self, Place, Priority, Session};
use stylet_relay::now_ns;
use stylet_relay::wire::{self, Hello, Kind, Stamp, Ticks, encode};
use stylet_shm_schema::{Mark, Request, UploadHeader, flags};

/// Duration of each flood.
const LENGTH: Duration = Duration::from_secs(4);
/// Interval of the messages: 5,000 a second.
const EVERY: Duration = Duration::from_micros(200);

/// Data received by an observer of an instance in some time.
#[derive(Default)]
struct Had {
    records: usize,
    lost: u64,
    oldest_ms: f64,
    /// Longest time without a snapshot.
    blind_ms: f64,
    /// Records of a resting hand.
    at_rest: usize,
}

impl fmt::Display for Had {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} records, {} lost, the oldest {:.0} ms old; {:.0} ms without a picture",
            self.records, self.lost, self.oldest_ms, self.blind_ms
        )
    }
}

fn watch(named: &Named, end: Instant) -> Had {
    let node = crate::host::node(named);
    let records = stylet_ports::records::subscriber(&node).expect("a port");
    let pictures = stylet_ports::snapshots::subscriber(&node).expect("a port");
    let (mut had, mut next, mut picture) = (Had::default(), None, Instant::now());
    while Instant::now() < end {
        while let Some(sample) = records.receive() {
            for record in sample.values() {
                had.lost += next.map_or(0, |next| record.tick - next);
                next = Some(record.tick + 1);
                had.records += 1;
                had.at_rest += usize::from(record.flags & flags::IN_MOTION == 0);
            }
            let newest = sample.values().last().map_or(u64::MAX, |record| record.due_ns);
            had.oldest_ms = had.oldest_ms.max(now_ns().saturating_sub(newest) as f64 * 1e-6);
        }
        while pictures.receive().is_some() {
            had.blind_ms = had.blind_ms.max(picture.elapsed().as_secs_f64() * 1e3);
            picture = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    had.blind_ms = had.blind_ms.max(picture.elapsed().as_secs_f64() * 1e3);
    had
}

/// A member's session without the member's program.
struct Eve {
    session: Session,
    seat: u16,
    /// Bytes received, and the newest time and tick of the server.
    came: Arc<[AtomicU64; 3]>,
}

impl Eve {
    fn new(path: &Path) -> Self {
        let invited = invitation(path);
        let code = std::fs::read_to_string(path.with_extension("code")).expect("kept");
        let identity = invited.identity(&code).expect("its code");
        let session = net::join(&invited.server, &identity).expect("a server");
        let came = Arc::new([const { AtomicU64::new(0) }; 3]);
        let here = Arc::clone(&came);
        net::hear(&session, &Place::To(invited.seat).key(), move |_, bytes| {
            here[0].fetch_add(bytes.len() as u64, Ordering::Relaxed);
            if let Ok(message) = wire::decode(bytes) {
                here[1].fetch_max(message.stamp.sent_ns, Ordering::Relaxed);
            }
        })
        .expect("a subscriber");
        Self {
            session,
            seat: invited.seat,
            came,
        }
    }

    fn send(&self, kind: Kind, number: u64, parts: &[&[u8]]) {
        let stamp = Stamp {
            run: 0,
            number,
            sent_ns: now_ns(),
            heard_ns: self.came[1].load(Ordering::Relaxed),
        };
        let bytes = encode(kind, stamp, parts);
        net::put_whole(&self.session, Place::Ask(self.seat), Priority::InteractiveHigh, bytes);
    }

    fn greet(&self, process: u64, epoch: u64) {
        let hello = Hello {
            epoch,
            ..Hello::default()
        };
        self.send(Kind::Hello, process, &[bytemuck::bytes_of(&hello)]);
    }

    /// Returns the bytes received and the number of messages sent during `flood`.
    fn flood(&self, end: Instant, flood: &dyn Fn(&Self, u64)) -> (u64, u64) {
        let before = self.came[0].load(Ordering::Relaxed);
        let (mut sent, begun) = (0, Instant::now());
        while Instant::now() < end {
            flood(self, sent);
            if sent % 250 == 0 {
                self.greet(1, 1);
            }
            sent += 1;
            let due = begun + EVERY * sent as u32;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
        (self.came[0].load(Ordering::Relaxed) - before, sent)
    }
}

/// Name, role and messages of a flood.
type Flood = (&'static str, Role, &'static dyn Fn(&Eve, u64));

fn command(eve: &Eve, request: &Request, number: u64) {
    let command = request.encode(666, number + 1).expect("fits");
    eve.send(Kind::Command, 0, &[bytemuck::bytes_of(&command)]);
}

const FLOODS: [Flood; 7] = [
    ("nothing", Role::Observer, &|_, _| {}),
    (
        "requests that are refused, each with a line of the log",
        Role::Observer,
        &|eve, n| {
            command(eve, &Request::StopHand, n);
        },
    ),
    ("requests to which there is a right", Role::Instructor, &|eve, n| {
        let mark = Mark {
            text: "again".to_owned(),
            before_s: 0.0,
        };
        command(eve, &Request::Mark(mark), n);
    }),
    ("orders of the lease", Role::Operator, &|eve, n| {
        eve.send(Kind::Lease, 0, &[[&b"take"[..], b"release"][n as usize % 2]]);
    }),
    ("records asked again", Role::Observer, &|eve, _| {
        let session_id = eve.came[2].load(Ordering::Relaxed);
        let ticks = Ticks {
            session_id,
            from: 1,
            to: u64::MAX,
        };
        eve.send(Kind::Again, 0, &[bytemuck::bytes_of(&ticks)]);
    }),
    ("greetings of a new epoch and process", Role::Observer, &|eve, n| {
        eve.greet(n, n)
    }),
    (
        "parts of a volume, without the right to it",
        Role::Observer,
        &|eve, n| {
            let mut header: UploadHeader = bytemuck::Zeroable::zeroed();
            header.dims = [256, 256, 256];
            let at = n % 512 * wire::PART_BYTES as u64;
            eve.send(
                Kind::Upload,
                0,
                &[bytemuck::bytes_of(&header), &at.to_le_bytes(), &[1; wire::PART_BYTES]],
            );
        },
    ),
];

/// All parties except the flood.
struct Class {
    otto: Host,
    served: Running,
    keys: Keys,
    _joined: [Running; 2],
    _core: Running,
    named: [Named; 3],
}

impl Class {
    fn begin() -> Self {
        let named = [Named::new(), Named::new(), Named::new()];
        let core = core(&named[0], &[]);
        let keys = Keys::new();
        let served = keys.serve(&named[0]);
        let joined = [("otto", Role::Operator, &named[1]), ("olga", Role::Observer, &named[2])]
            .map(|(name, role, far)| join(&keys.invite(name, role, Validity::days(1)), far));
        let mut otto = Host::new(&named[1]);
        let mut olga = Host::new(&named[2]);
        for host in [&mut otto, &mut olga] {
            assert!(host.sees_the_core(Duration::from_secs(20)), "{}", served.log());
        }
        Self {
            otto,
            served,
            keys,
            _joined: joined,
            _core: core,
            named,
        }
    }

    /// Moves the operator's hand at 1 mm/s during a flood.
    fn suffer(&mut self, number: usize, (name, role, flood): Flood) -> [Had; 2] {
        let scene = self.otto.scene.expect("seen");
        self.otto.ask(&go(&scene, 0.06, 0.001)).expect("an operator");
        let eve = Eve::new(&self.keys.invite(&format!("eve {number}"), role, Validity::days(1)));
        eve.came[2].store(self.otto.session.expect("seen").session_id, Ordering::Relaxed);
        eve.greet(1, 1);
        let hears = until(Duration::from_secs(5), || eve.came[0].load(Ordering::Relaxed) > 5000);
        assert!(hears, "{}", self.served.log());
        let lines = self.served.log().lines().count();
        let end = Instant::now() + LENGTH;
        let [_, far, other] = &self.named;
        let (otto, olga, (came, sent)) = std::thread::scope(|scope| {
            let otto = scope.spawn(|| watch(far, end));
            let olga = scope.spawn(|| watch(other, end));
            let flood = eve.flood(end, flood);
            (otto.join().expect("ran"), olga.join().expect("ran"), flood)
        });
        let lines = self.served.log().lines().count() - lines;
        println!(
            "| {name} | {sent} | {:.1} MB | {lines} | {otto} | {olga} |",
            came as f64 * 1e-6
        );
        let log = self.served.log();
        assert!(lines < 40, "{name}: {lines} lines: {log}");
        assert!((came as f64) < 10e6, "{name}: {came} bytes went to the flood");
        net::close(eve.session);
        [otto, olga]
    }
}

#[test]
fn a_flood_of_one_seat_costs_others_nothing() {
    let mut class = Class::begin();
    println!("| flood | sent | to it | lines | operator | observer |");
    for (number, flood) in FLOODS.into_iter().enumerate() {
        for had in class.suffer(number, flood) {
            assert_eq!(had.lost, 0, "{}: {had}", flood.0);
            assert!(had.records > 3000, "{}: {had}", flood.0);
            assert!(had.blind_ms < 1000.0, "{}: {had}", flood.0);
            assert_eq!(had.at_rest, 0, "{}: the hand rested", flood.0);
        }
    }
    let log = class.served.log();
    println!("{log}");
    assert!(!log.contains("the hand is stopped"), "{log}");
    assert!(log.contains("turned away: "), "{log}");
}
