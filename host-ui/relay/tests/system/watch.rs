//! Data arriving at a host: records by their ticks, and snapshots with their age.

use crate::fixture::{Named, lease, until};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender};
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node};
use stylet_relay::now_ns;
use stylet_shm_schema::BATCH_EVERY;
use stylet_shm_schema::Instance;

/// Duration of each measurement, s; `STYLET_RELAY_S` makes it longer for a figure.
pub fn seconds(everyday: f64) -> f64 {
    let asked = std::env::var("STYLET_RELAY_S").ok().and_then(|s| s.parse().ok());
    asked.unwrap_or(everyday)
}

const LOOK_EVERY: Duration = Duration::from_micros(100);

/// Half the shortest time in which a record passes a relay.
const SOONEST: Duration = Duration::from_micros(300);

/// Coordination of hosts that poll for records.
pub enum Beside {
    Nobody,
    /// Signals when a batch is there.
    Ringing(Sender<()>),
    /// Is signalled.
    Rung(Receiver<()>),
}

/// Time at which each tick was first seen, by a host that polls every 0.1 ms; it pauses while no batch can come, so
/// that polling takes less processor time than the relay.
pub fn arrivals(instance: &Instance, until: Instant, beside: &Beside) -> BTreeMap<u64, Instant> {
    // Measures the relay, not this thread's scheduling.
    stylet_relay::slice::shorten();
    let node = Node::join(instance).expect("shared memory");
    let port = service::records::subscriber(&node).expect("a port");
    let mut seen = BTreeMap::new();
    while Instant::now() < until {
        let mut pause = LOOK_EVERY;
        while let Some(sample) = port.receive() {
            pause = BATCH_EVERY * 3 / 4;
            let now = Instant::now();
            seen.extend(sample.values().iter().map(|record| (record.tick, now)));
        }
        match beside {
            Beside::Ringing(bell) if pause != LOOK_EVERY => {
                let _ = bell.send(());
            }
            // A signal during the search for the batch before is not missed: it is queued.
            Beside::Rung(bell) if pause != LOOK_EVERY => {
                let _ = bell.recv_timeout(BATCH_EVERY);
                pause = SOONEST;
            }
            _ => {}
        }
        std::thread::sleep(pause);
    }
    seen
}

/// Time that a socket of this machine takes for a batch between threads, ms: a lower limit for any relay here.
pub fn socket_ages_ms(until: Instant) -> Vec<f64> {
    const BATCH_BYTES: usize = 7_000;
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("bound");
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let mut line = TcpStream::connect(address).expect("listens");
            line.set_nodelay(true).expect("a socket");
            while Instant::now() < until {
                let mut batch = vec![0; BATCH_BYTES];
                batch[..8].copy_from_slice(&now_ns().to_le_bytes());
                line.write_all(&batch).expect("taken");
                std::thread::sleep(BATCH_EVERY);
            }
        });
        let (mut line, _) = listener.accept().expect("called");
        let (mut batch, mut ages_ms) = (vec![0; BATCH_BYTES], Vec::new());
        while line.read_exact(&mut batch).is_ok() {
            let sent_ns = u64::from_le_bytes(batch[..8].try_into().expect("eight"));
            ages_ms.push(now_ns().saturating_sub(sent_ns) as f64 * 1e-6);
        }
        ages_ms
    })
}

/// Age of each snapshot on arrival, ms, by its tissue tick. Both sides share this machine's clock.
pub fn pictures(instance: &Instance, until: Instant) -> Vec<(u64, f64)> {
    let node = Node::join(instance).expect("shared memory");
    let port = service::snapshots::subscriber(&node).expect("a port");
    let mut seen = Vec::new();
    while Instant::now() < until {
        while let Some(sample) = port.receive() {
            let header = sample.header();
            let age_ms = now_ns().saturating_sub(header.time_ns) as f64 * 1e-6;
            seen.push((header.tissue_tick, age_ms));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    seen
}

pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values
        .get(((values.len().max(1) - 1) as f64 * share) as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

/// First and last of each run of consecutive ticks.
pub fn gaps(ticks: &[u64]) -> Vec<(u64, u64)> {
    let runs = ticks.chunk_by(|a, b| a + 1 == *b);
    runs.filter_map(|run| Some((*run.first()?, *run.last()?))).collect()
}

/// Records and snapshots of one host in some time.
pub struct Seen {
    pub records: BTreeMap<u64, Instant>,
    pub snapshots: Vec<(u64, f64)>,
    /// Final output of `relay lease status` there.
    pub words: String,
}

impl Seen {
    pub fn until(far: &Named, end: Instant) -> Self {
        Self::beside(Beside::Nobody, far, end)
    }

    pub fn beside(beside: Beside, far: &Named, end: Instant) -> Self {
        let (records, snapshots) = std::thread::scope(|scope| {
            let records = scope.spawn(move || arrivals(&far.0, end, &beside));
            let snapshots = scope.spawn(|| pictures(&far.0, end));
            (records.join().expect("ran"), snapshots.join().expect("ran"))
        });
        let words = lease(far, &["status"]);
        Self {
            records,
            snapshots,
            words,
        }
    }

    /// Missing ticks between the first and the last.
    pub fn missing(&self) -> u64 {
        let ticks: Vec<u64> = self.records.keys().copied().collect();
        ticks.windows(2).map(|pair| pair[1] - pair[0] - 1).sum()
    }

    /// Median, 99th percentile and largest age of the snapshots, ms; without the first, which was kept for latecomers.
    pub fn ages_ms(&self) -> [f64; 3] {
        let mut ages_ms: Vec<f64> = self.snapshots.iter().skip(1).map(|(_, age)| *age).collect();
        [0.5, 0.99, 1.0].map(|share| quantile(&mut ages_ms, share))
    }

    /// Lost snapshots, see [`snapshots_lost`].
    pub fn snapshots_lost(&self) -> u64 {
        snapshots_lost(&self.words)
    }

    pub fn words(&self, line: &str) -> String {
        let [median, most, oldest] = self.ages_ms();
        format!(
            "{line}: {} records, {} missing; {} snapshots, {} lost, p50 {median:.1}, p99 {most:.1} ms old, the oldest {oldest:.0} ms\n{}",
            self.records.len(),
            self.missing(),
            self.snapshots.len(),
            self.snapshots_lost(),
            self.words
        )
    }

    /// Checks that every record arrived, and that the member's report agrees.
    pub fn has_every_record(&self) {
        assert!(self.records.len() > 500, "{} records", self.records.len());
        assert_eq!(self.missing(), 0);
        assert!(self.words.contains(" 0 records lost"), "{}", self.words);
    }
}

/// Snapshots that never arrived since the member joined, from the output of `relay lease status` there.
pub fn snapshots_lost(words: &str) -> u64 {
    let before = words.split(" snapshots lost").next();
    let number = before.and_then(|words| words.rsplit(' ').next());
    number.and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("{words}"))
}

/// Waits for a host's first snapshots: the scene of a core, which is large, precedes them.
pub fn settle(far: &Named) {
    until(Duration::from_secs(10), || {
        let end = Instant::now() + Duration::from_millis(300);
        pictures(&far.0, end).len() > 5
    });
}
