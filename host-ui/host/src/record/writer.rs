//! The thread that encodes and writes.

use super::error::RecordError;
use super::gaps::{Gap, Gaps};
use super::messages::{self, Channel, EVENT, GLAND, TICK, TISSUE};
use super::scene::{self, FIELD, SCENE};
use super::second::SECOND;
use super::setting::{self, PARAMETERS_CHANNEL, PLAN, SESSION, STATE};
use crate::link::{SceneModel, Snapshot};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;
use std::process::ChildStdin;
use std::sync::{Arc, mpsc};
use stylet_shm_schema::{Event, HapticState, ParametersInForce, PlanInForce, SecondRecord, Session, TickRecord};

/// Size of a chunk: a recording cut off by a crash lacks at most the last one, about two seconds.
const CHUNK_BYTES: u64 = 1 << 20;
/// Most gaps listed in the file; all are counted.
const GAPS_LISTED: usize = 1000;
/// Most gaps listed in the terminal.
const GAPS_PRINTED: usize = 10;

/// An item from the receiving thread.
pub enum Item {
    Session(Box<Session>),
    Records(Vec<TickRecord>),
    SecondRecords(Vec<SecondRecord>),
    Event(Box<Event>),
    Scene(Arc<SceneModel>),
    Plan(Box<PlanInForce>),
    Parameters(Box<ParametersInForce>),
    /// State when the snapshot after it was taken.
    State(Box<HapticState>),
    Snapshot(Box<Snapshot>),
    /// A snapshot that was seen but not kept.
    SnapshotLeftOut,
    /// Time without a kept snapshot, s.
    SnapshotsMissing(f64),
    /// Records lost since the recording began, by the core's count.
    LostInCore(u64),
}

/// Contents of a recording, and its losses.
#[derive(Default)]
pub struct Totals {
    pub gaps: Gaps,
    /// Ticks of the second device.
    pub second: Gaps,
    pub events: Gaps,
    pub snapshots: u64,
    pub snapshots_left_out: u64,
    /// Number and total duration of gaps between snapshots.
    pub snapshot_gaps: u64,
    pub snapshot_gaps_s: f64,
    pub lost_in_core: u64,
    pub bytes: u64,
}

impl Totals {
    pub fn words(&self) -> String {
        let second = match self.second.records() {
            0 => String::new(),
            ticks => format!(
                "{ticks} ticks of the second device, {} missing; ",
                self.second.missing()
            ),
        };
        format!(
            "{} ticks of {} session(s), {} missing in {} gaps, {} of them lost in the core; {second}{} events, {} missing; \
             {} snapshots kept, {} left out, none for {:.1} s in {} gaps; {:.1} MB",
            self.gaps.records(),
            self.gaps.sessions(),
            self.gaps.missing(),
            self.gaps.gaps().len(),
            self.lost_in_core,
            self.events.records(),
            self.events.missing(),
            self.snapshots,
            self.snapshots_left_out,
            self.snapshot_gaps_s,
            self.snapshot_gaps,
            self.bytes as f64 / 1e6
        )
    }

    /// Describes the missing numbers: the first gaps of each kind.
    pub fn missing_words(&self) -> Vec<String> {
        let line = |(what, gaps): (&str, &Gaps)| {
            let first: Vec<String> = gaps.gaps().iter().take(GAPS_PRINTED).map(Gap::to_string).collect();
            let more = gaps.gaps().len().saturating_sub(GAPS_PRINTED);
            let more = if more > 0 {
                format!(", and {more} more")
            } else {
                String::new()
            };
            (!first.is_empty()).then(|| format!("missing {what}: {}{more}", first.join(", ")))
        };
        [
            ("ticks", &self.gaps),
            ("ticks of the second device", &self.second),
            ("events", &self.events),
        ]
        .into_iter()
        .filter_map(line)
        .collect()
    }

    fn metadata(&self) -> BTreeMap<String, String> {
        [
            ("ticks", self.gaps.records().to_string()),
            ("ticks_missing", self.gaps.missing().to_string()),
            ("gaps", self.gaps.gaps().len().to_string()),
            ("gaps_listed", listed_gaps(&self.gaps)),
            ("ticks_repeated", self.gaps.repeated().to_string()),
            ("records_lost_in_core", self.lost_in_core.to_string()),
            ("second_ticks", self.second.records().to_string()),
            ("second_ticks_missing", self.second.missing().to_string()),
            ("second_gaps_listed", listed_gaps(&self.second)),
            ("sessions", self.gaps.sessions().to_string()),
            ("events", self.events.records().to_string()),
            ("events_missing", self.events.missing().to_string()),
            ("event_gaps_listed", listed_gaps(&self.events)),
            ("snapshots", self.snapshots.to_string()),
            ("snapshots_left_out", self.snapshots_left_out.to_string()),
            ("snapshot_gaps", self.snapshot_gaps.to_string()),
            ("snapshot_gaps_s", format!("{:.3}", self.snapshot_gaps_s)),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into()
    }
}

fn listed_gaps(gaps: &Gaps) -> String {
    let listed = gaps.gaps().iter().take(GAPS_LISTED);
    let listed = listed.map(|g| format!("{:016x}:{}+{}", g.session_id, g.tick, g.missing));
    listed.collect::<Vec<_>>().join(" ")
}

/// Channels by index.
const CHANNELS: [&Channel; 11] = [
    &TICK,
    &EVENT,
    &TISSUE,
    &GLAND,
    &SCENE,
    &PLAN,
    &PARAMETERS_CHANNEL,
    &STATE,
    &FIELD,
    &SESSION,
    &SECOND,
];

struct Writer<W: Write + Seek> {
    file: mcap::Writer<W>,
    channels: [u16; CHANNELS.len()],
    sequences: [u32; CHANNELS.len()],
    /// `CLOCK_MONOTONIC` of the newest message with a time.
    newest_ns: u64,
    /// Offset from `CLOCK_MONOTONIC` to the time since 1970.
    epoch_ns: u64,
    totals: Totals,
}

/// Writes until all senders are gone; the file is complete then.
pub fn write_all(path: &Path, from: &mpsc::Receiver<Item>) -> Result<Totals, RecordError> {
    let failed = |e: mcap::McapError| RecordError::of_file(path, e);
    let file =
        File::create(path).map_err(|e| RecordError::of_file(path, format!("{e}; choose another file with --out")))?;
    let packed = mcap::WriteOptions::new()
        .compression(Some(mcap::Compression::Zstd))
        .chunk_size(Some(CHUNK_BYTES));
    let mut writer = Writer::new(packed, BufWriter::new(file)).map_err(failed)?;
    for item in from {
        writer.item(item).map_err(failed)?;
    }
    let mut totals = writer.finish().map_err(failed)?;
    totals.bytes = std::fs::metadata(path).map_or(0, |m| m.len());
    Ok(totals)
}

/// Writes likewise to a program that shows the messages one by one.
pub fn send_all(program: ChildStdin, from: &mpsc::Receiver<Item>) -> Result<Totals, RecordError> {
    let failed = |e: mcap::McapError| RecordError::Live(format!("it ended, or reads no more: {e}"));
    let plain = mcap::WriteOptions::new()
        .compression(None)
        .use_chunks(false)
        .disable_seeking(true);
    let mut writer = Writer::new(plain, NoSeek::new(BufWriter::new(program))).map_err(failed)?;
    for item in from {
        writer.item(item).map_err(failed)?;
        writer.file.flush().map_err(failed)?;
    }
    writer.finish().map_err(failed)
}

impl<W: Write + Seek> Writer<W> {
    fn new(options: mcap::WriteOptions, to: W) -> mcap::McapResult<Self> {
        let mut file = options
            .library(concat!("stylet ", env!("CARGO_PKG_VERSION")))
            .create(to)?;
        let mut channels = [0; CHANNELS.len()];
        for (id, channel) in channels.iter_mut().zip(CHANNELS) {
            let Channel { topic, schema, text } = channel;
            let schema = file.add_schema(schema, "jsonschema", text().to_string().as_bytes())?;
            *id = file.add_channel(schema, topic, "json", &BTreeMap::new())?;
        }
        Ok(Self {
            file,
            channels,
            sequences: [0; CHANNELS.len()],
            newest_ns: 0,
            epoch_ns: epoch_ns(),
            totals: Totals::default(),
        })
    }

    fn item(&mut self, item: Item) -> mcap::McapResult<()> {
        match item {
            Item::Session(session) => self.session(&session)?,
            Item::Records(records) => {
                for record in &records {
                    if self.totals.gaps.record(record.session_id, record.tick) {
                        let time_ns = record.due_ns + record.wake_latency_ns;
                        self.message(0, time_ns, &serde_json::to_vec(record).unwrap_or_default())?;
                    }
                }
            }
            Item::SecondRecords(records) => {
                for record in &records {
                    if self.totals.second.record(record.session_id, record.tick) {
                        self.message(
                            10,
                            record.due_ns + record.wake_latency_ns,
                            &serde_json::to_vec(record).unwrap_or_default(),
                        )?;
                    }
                }
            }
            Item::Event(event) => {
                if self.totals.events.record(event.session_id, event.sequence) {
                    self.message(1, event.time_ns, messages::event(&event).to_string().as_bytes())?;
                }
            }
            Item::Scene(model) => self.between(4, &scene::scene(&model))?,
            Item::Plan(plan) => self.between(5, &setting::plan(&plan))?,
            Item::Parameters(parameters) => self.between(6, &setting::parameters(&parameters))?,
            Item::State(state) => self.message(7, state.time_ns, setting::message(&*state).to_string().as_bytes())?,
            Item::Snapshot(snapshot) => {
                self.totals.snapshots += 1;
                let time_ns = snapshot.header.time_ns;
                self.message(2, time_ns, messages::tissue(&snapshot).to_string().as_bytes())?;
                let gland = messages::gland(&snapshot, time_ns + self.epoch_ns);
                self.message(3, time_ns, gland.to_string().as_bytes())?;
                self.message(8, time_ns, scene::field(&snapshot).to_string().as_bytes())?;
            }
            Item::SnapshotLeftOut => self.totals.snapshots_left_out += 1,
            Item::SnapshotsMissing(seconds) => {
                self.totals.snapshot_gaps += 1;
                self.totals.snapshot_gaps_s += seconds;
            }
            Item::LostInCore(count) => self.totals.lost_in_core = self.totals.lost_in_core.max(count),
        }
        Ok(())
    }

    /// Writes a message without a time at the time of the one before it.
    fn between(&mut self, channel: usize, message: &serde_json::Value) -> mcap::McapResult<()> {
        self.message(channel, self.newest_ns, message.to_string().as_bytes())
    }

    fn message(&mut self, channel: usize, time_ns: u64, data: &[u8]) -> mcap::McapResult<()> {
        self.newest_ns = self.newest_ns.max(time_ns);
        self.sequences[channel] = self.sequences[channel].wrapping_add(1);
        let log_time = time_ns + self.epoch_ns;
        let header = MessageHeader {
            channel_id: self.channels[channel],
            sequence: self.sequences[channel],
            log_time,
            publish_time: log_time,
        };
        self.file.write_to_known_channel(&header, data)
    }

    fn session(&mut self, session: &Session) -> mcap::McapResult<()> {
        self.newest_ns = self.newest_ns.max(session.time_ns);
        self.between(9, &setting::message(session))?;
        let metadata = [
            ("session_id", session.session_id.to_string()),
            ("version", session.version.read()),
            ("device", session.device.read()),
            ("second_device", session.second_device.read()),
            ("period_ns", session.period_ns.to_string()),
            ("tissue_period_ns", session.tissue_period_ns.to_string()),
            ("started_ns", session.started_ns.to_string()),
            ("epoch_from_monotonic_ns", self.epoch_ns.to_string()),
            ("advice", session.advice.read()),
        ];
        self.file.write_metadata(&Metadata {
            name: "stylet.session".to_owned(),
            metadata: metadata.map(|(key, value)| (key.to_owned(), value)).into(),
        })
    }

    fn finish(mut self) -> mcap::McapResult<Totals> {
        self.file.write_metadata(&Metadata {
            name: "stylet.totals".to_owned(),
            metadata: self.totals.metadata(),
        })?;
        self.file.finish()?;
        Ok(self.totals)
    }
}

/// Returns the time since 1970 minus `CLOCK_MONOTONIC`, once per recording: setting the clock meanwhile causes no step.
fn epoch_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writes; the clock always exists on Linux.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    let monotonic_ns = time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64;
    let since_1970 = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since_1970
        .map_or(0, |d| d.as_nanos() as u64)
        .saturating_sub(monotonic_ns)
}
