//! Encodes and writes messages, and counts what is lost.

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufWriter, Seek, Write};
use std::process::ChildStdin;
use stylet_recordings::channels::{CHANNELS, Kind};
use stylet_recordings::{Gap, Gaps, SceneModel, Snapshot, messages};
use stylet_shm_schema::affinity::now_ns;
use stylet_shm_schema::{Event, HapticState, ParametersInForce, PlanInForce, SecondRecord, Session, TickRecord};

/// Size of a chunk: a recording cut off by a crash lacks at most the last one, about two seconds.
const CHUNK_BYTES: u64 = 1 << 20;
/// Most gaps listed in the file; all are counted.
const GAPS_LISTED: usize = 1000;
/// Most gaps listed in the terminal.
const GAPS_PRINTED: usize = 10;

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

/// A recording that is being written.
pub struct Writer<W: Write + Seek> {
    file: mcap::Writer<W>,
    channels: [u16; CHANNELS.len()],
    sequences: [u32; CHANNELS.len()],
    /// `CLOCK_MONOTONIC` of the newest message with a time.
    newest_ns: u64,
    /// Offset from `CLOCK_MONOTONIC` to the time since 1970.
    epoch_ns: u64,
    /// True if the messages are read while they are written.
    is_live: bool,
    pub totals: Totals,
}

impl<W: Write + Seek> Writer<W> {
    /// Writes to a file.
    pub fn of_file(file: W) -> mcap::McapResult<Self> {
        let packed = mcap::WriteOptions::new()
            .compression(Some(mcap::Compression::Zstd))
            .chunk_size(Some(CHUNK_BYTES));
        Self::new(packed, file, false)
    }

    fn new(options: mcap::WriteOptions, to: W, is_live: bool) -> mcap::McapResult<Self> {
        let mut file = options
            .library(concat!("stylet ", env!("CARGO_PKG_VERSION")))
            .create(to)?;
        let mut channels = [0; CHANNELS.len()];
        for (id, channel) in channels.iter_mut().zip(CHANNELS) {
            let schema = file.add_schema(channel.2, "jsonschema", channel.text().as_bytes())?;
            *id = file.add_channel(schema, channel.1, "json", &BTreeMap::new())?;
        }
        Ok(Self {
            file,
            channels,
            sequences: [0; CHANNELS.len()],
            newest_ns: 0,
            epoch_ns: epoch_ns(),
            is_live,
            totals: Totals::default(),
        })
    }

    pub fn tick(&mut self, record: &TickRecord) -> mcap::McapResult<()> {
        match self.totals.gaps.record(record.session_id, record.tick) {
            true => self.record(Kind::Tick, record.due_ns + record.wake_latency_ns, record),
            false => Ok(()),
        }
    }

    pub fn second(&mut self, record: &SecondRecord) -> mcap::McapResult<()> {
        match self.totals.second.record(record.session_id, record.tick) {
            true => self.record(Kind::Second, record.due_ns + record.wake_latency_ns, record),
            false => Ok(()),
        }
    }

    pub fn event(&mut self, event: &Event) -> mcap::McapResult<()> {
        match self.totals.events.record(event.session_id, event.sequence) {
            true => self.message(Kind::Event, event.time_ns, &messages::event(event)),
            false => Ok(()),
        }
    }

    pub fn scene(&mut self, model: &SceneModel) -> mcap::McapResult<()> {
        self.message(Kind::Scene, self.newest_ns, &messages::scene(model))
    }

    pub fn plan(&mut self, plan: &PlanInForce) -> mcap::McapResult<()> {
        self.message(Kind::Plan, self.newest_ns, &messages::plan(plan))
    }

    pub fn parameters(&mut self, in_force: &ParametersInForce) -> mcap::McapResult<()> {
        self.message(Kind::Parameters, self.newest_ns, &messages::parameters(in_force))
    }

    /// Writes a snapshot, after the state when it was taken.
    pub fn snapshot(&mut self, state: Option<&HapticState>, snapshot: &Snapshot) -> mcap::McapResult<()> {
        if let Some(state) = state {
            self.message(Kind::State, state.time_ns, &messages::message(state))?;
        }
        self.totals.snapshots += 1;
        let time_ns = snapshot.header.time_ns;
        self.message(Kind::Tissue, time_ns, &messages::tissue(snapshot))?;
        let gland = messages::gland(snapshot, time_ns + self.epoch_ns);
        self.message(Kind::Gland, time_ns, &gland)?;
        self.message(Kind::Field, time_ns, &messages::field(snapshot))
    }

    fn message(&mut self, kind: Kind, time_ns: u64, message: &Value) -> mcap::McapResult<()> {
        self.bytes(kind, time_ns, message.to_string().as_bytes())
    }

    fn record(&mut self, kind: Kind, time_ns: u64, record: &impl Serialize) -> mcap::McapResult<()> {
        self.bytes(kind, time_ns, &serde_json::to_vec(record).unwrap_or_default())
    }

    fn bytes(&mut self, kind: Kind, time_ns: u64, data: &[u8]) -> mcap::McapResult<()> {
        let channel = kind as usize;
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

    /// Sends all that was written to whoever reads it now.
    pub fn flush(&mut self) -> mcap::McapResult<()> {
        match self.is_live {
            true => self.file.flush(),
            false => Ok(()),
        }
    }

    pub fn session(&mut self, session: &Session) -> mcap::McapResult<()> {
        self.newest_ns = self.newest_ns.max(session.time_ns);
        self.message(Kind::Session, self.newest_ns, &messages::message(session))?;
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

    /// Completes the file.
    pub fn finish(mut self) -> mcap::McapResult<Totals> {
        self.file.write_metadata(&Metadata {
            name: "stylet.totals".to_owned(),
            metadata: self.totals.metadata(),
        })?;
        self.file.finish()?;
        Ok(self.totals)
    }
}

impl Writer<NoSeek<BufWriter<ChildStdin>>> {
    /// Writes to a program that shows the messages one by one.
    pub fn of_program(program: ChildStdin) -> mcap::McapResult<Self> {
        let plain = mcap::WriteOptions::new()
            .compression(None)
            .use_chunks(false)
            .disable_seeking(true);
        Self::new(plain, NoSeek::new(BufWriter::new(program)), true)
    }
}

/// Returns the time since 1970 minus `CLOCK_MONOTONIC`, once per recording: setting the clock meanwhile causes no step.
fn epoch_ns() -> u64 {
    let since_1970 = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since_1970.map_or(0, |d| d.as_nanos() as u64).saturating_sub(now_ns())
}
