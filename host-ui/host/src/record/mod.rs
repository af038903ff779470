//! Records a session in MCAP: every record of the force loop, the tissue's snapshots, and events. Also exports such
//! files.
//!
//! The link's thread takes what arrives in shared memory and keeps it while the disk stalls: five minutes of ticks
//! (72 MB, `link`), and 12 s of them while the program is suspended (`service::RECORD_BUFFER`). Any loss is counted and
//! listed for each kind of message.

mod error;
mod export;
mod live;
mod writer;

pub use error::RecordError;
pub use export::{Export, export};
pub use stylet_recordings::{FileProblem, Gap, Gaps, read};

use crate::link::{Link, LinkError, LinkStatus};
use clap::Args;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stylet_base::interrupt::Interrupt;
use stylet_shm_schema::Instance;
use stylet_shm_schema::Request;
use writer::{Totals, Writer};

const POLL_EVERY: Duration = Duration::from_millis(2);
const FIND_LIMIT: Duration = Duration::from_secs(3);
/// Time for a core that is being started at the same time to appear.
const APPEAR_LIMIT: Duration = Duration::from_secs(1);
/// Delay between two kept snapshots, beyond the expected interval, that counts as a gap, s.
const SNAPSHOT_LATE_S: f64 = 0.1;
const PRINT_EVERY: Duration = Duration::from_secs(10);

/// Options of `host-ui record`: a session to a file, or to viewers while it runs.
#[derive(Args, Debug)]
pub struct Options {
    /// Name under which rt-core was started
    #[arg(long, default_value = "main", value_parser = Instance::new)]
    pub instance: Instance,
    /// File to write
    #[arg(long, value_name = "FILE.mcap", required_unless_present = "live")]
    out: Option<PathBuf>,
    /// Serve the messages of a recording to Foxglove's app instead, on this address and port
    /// [default: 127.0.0.1:8765]; needs 'make live'
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765", conflicts_with = "out")]
    live: Option<String>,
    /// Seconds to record [default: until interrupted or until rt-core ends]
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Snapshots of the gland per second, 0 to 60; the core sends 67 while the needle moves, 33
    /// while it rests, and 17 while the gland is undisturbed
    #[arg(long, default_value_t = 20.0, value_name = "HZ")]
    snapshot_rate: f64,
}

/// Records until the time is up or it is interrupted; fails if a tick was lost on the way.
pub fn run(options: &Options) -> Result<(), RecordError> {
    let fits = options.duration.is_none_or(|s| s > 0.0 && s < 1e6) && (0.0..=60.0).contains(&options.snapshot_rate);
    if !fits {
        return Err(RecordError::Options);
    }
    let interrupted = Interrupt::on_signals()?;
    let stop = || interrupted.asked();
    let mut link = Link::with_snapshots_every(options.instance.clone(), Duration::ZERO);
    find_core(&mut link, stop)?;
    let (name, totals) = match (&options.out, &options.live) {
        (Some(path), _) => {
            let failed = |why: mcap::McapError| RecordError::of_file(path, why);
            let file = File::create(path).map_err(|e| RecordError::of_file(path, FileProblem::Create(e)))?;
            let writer = Writer::of_file(BufWriter::new(file)).map_err(failed)?;
            let mut totals = take(&mut link, options, stop, writer).map_err(failed)?;
            totals.bytes = std::fs::metadata(path).map_or(0, |m| m.len());
            (path.display().to_string(), totals)
        }
        (None, Some(address)) => {
            let mut server = live::start(address)?;
            let input = server.stdin.take().ok_or(RecordError::LiveInput)?;
            let totals = Writer::of_program(input).and_then(|writer| take(&mut link, options, stop, writer));
            let _ended = server.wait();
            (address.clone(), totals.map_err(RecordError::LiveEnded)?)
        }
        (None, None) => return Err(RecordError::NoDestination),
    };
    println!("{name}: {}", totals.words());
    totals.missing_words().iter().for_each(|line| println!("{line}"));
    totals.verdict()
}

fn find_core(link: &mut Link, stop: impl Fn() -> bool) -> Result<(), RecordError> {
    let begun = Instant::now();
    while begun.elapsed() < FIND_LIMIT && !stop() {
        link.poll();
        if link.status() == LinkStatus::Live && link.scene().is_some() {
            // Records from before the start are not part of the recording.
            link.take_records();
            link.take_second_records();
            return Ok(());
        }
        if begun.elapsed() > APPEAR_LIMIT && link.instance().epoch().is_none() {
            break;
        }
        std::thread::sleep(POLL_EVERY);
    }
    match link.status() {
        LinkStatus::Absent { why } => Err(LinkError::Absent(why).into()),
        _ => Err(RecordError::NoAnswer),
    }
}

/// State of the data handed to the writer.
#[derive(Default)]
struct Handed {
    session: Option<u64>,
    event: u64,
    tissue_tick: u64,
    snapshot_ns: u64,
    /// Due time of the next snapshot.
    due_ns: u64,
    /// Records lost in the core before the recording began.
    lost_before: Option<u64>,
    /// Generations of scene, plan and parameters.
    settings: [Option<u64>; 3],
}

/// Writes arriving data; while the writer lags, the link keeps the data.
fn take<W: Write + Seek>(
    link: &mut Link,
    options: &Options,
    stop: impl Fn() -> bool,
    mut to: Writer<W>,
) -> mcap::McapResult<Totals> {
    let begun = Instant::now();
    let mut printed = begun;
    let mut handed = Handed::default();
    while !stop() && options.duration.is_none_or(|s| begun.elapsed().as_secs_f64() < s) {
        link.poll();
        handed.hand_over(link, options.snapshot_rate, &mut to)?;
        to.flush()?;
        if matches!(link.status(), LinkStatus::Absent { .. }) && options.duration.is_none() {
            break;
        }
        if printed.elapsed() >= PRINT_EVERY {
            printed = Instant::now();
            println!(
                "{:5.0} s  {} ticks",
                begun.elapsed().as_secs_f64(),
                to.totals.gaps.records()
            );
        }
        std::thread::sleep(POLL_EVERY);
    }
    to.finish()
}

impl Handed {
    fn hand_over<W: Write + Seek>(
        &mut self,
        link: &mut Link,
        snapshots_hz: f64,
        to: &mut Writer<W>,
    ) -> mcap::McapResult<()> {
        if let Some(session) = link.session().filter(|s| self.session != Some(s.session_id)) {
            // A run that begins during the recording had lost nothing.
            let lost_before = link.state().map_or(0, |s| s.records_lost);
            *self = Self {
                session: Some(session.session_id),
                lost_before: Some(self.lost_before.map_or(lost_before, |_| 0)),
                ..Self::default()
            };
            to.session(session)?;
        }
        self.hand_over_settings(link, to)?;
        link.take_records().iter().try_for_each(|record| to.tick(record))?;
        link.take_second_records()
            .iter()
            .try_for_each(|record| to.second(record))?;
        for event in link.events().iter().filter(|e| e.sequence > self.event) {
            to.event(event)?;
        }
        self.event = link.events().back().map_or(self.event, |e| e.sequence);
        if let Some(snapshot) = link.snapshot().filter(|s| s.header.tissue_tick != self.tissue_tick) {
            self.tissue_tick = snapshot.header.tissue_tick;
            let now_ns = snapshot.header.time_ns;
            if snapshots_hz > 0.0 && now_ns >= self.due_ns {
                let since_s = now_ns.saturating_sub(self.snapshot_ns) as f64 * 1e-9;
                let period_ns = (1e9 / snapshots_hz) as u64;
                // Counted from the due time, so that the rate is the requested one whatever the core's is.
                self.due_ns = (self.due_ns + period_ns).max(now_ns + period_ns / 2);
                if self.snapshot_ns > 0 && since_s > 2.0 / snapshots_hz + SNAPSHOT_LATE_S {
                    to.totals.snapshot_gaps += 1;
                    to.totals.snapshot_gaps_s += since_s;
                }
                self.snapshot_ns = now_ns;
                to.snapshot(link.state(), snapshot)?;
            } else {
                to.totals.snapshots_left_out += 1;
            }
        }
        let lost = link.state().map_or(0, |state| state.records_lost);
        let lost = lost.saturating_sub(self.lost_before.unwrap_or(0));
        to.totals.lost_in_core = to.totals.lost_in_core.max(lost);
        Ok(())
    }

    /// Writes scene, plan and parameters that have changed.
    fn hand_over_settings<W: Write + Seek>(&mut self, link: &Link, to: &mut Writer<W>) -> mcap::McapResult<()> {
        let [scene, plan, parameters] = &mut self.settings;
        let is_new = |last: &mut Option<u64>, generation: u64| last.replace(generation) != Some(generation);
        if let Some(now) = link.scene().filter(|now| is_new(scene, now.header.generation)) {
            to.scene(now)?;
        }
        if let Some(now) = link.plan().filter(|now| is_new(plan, now.generation)) {
            to.plan(now)?;
        }
        if let Some(now) = link.parameters().filter(|now| is_new(parameters, now.generation)) {
            to.parameters(now)?;
        }
        Ok(())
    }
}

/// Asks the core to write its flight recording; returns the core's message about it.
pub fn save_flight(instance: &Instance) -> Result<String, RecordError> {
    let mut link = Link::new(instance.clone());
    find_core(&mut link, || false)?;
    let before = link.events().back().map_or(0, |e| e.sequence);
    let id = link.send(&Request::SaveFlight)?;
    let begun = Instant::now();
    let mut accepted = false;
    while begun.elapsed() < Duration::from_secs(10) {
        link.poll();
        if let Some(answer) = link.reply(id) {
            answer?;
            accepted = true;
        }
        let kind = stylet_shm_schema::EventKind::FlightSaved as u32;
        let saved = link.events().iter().find(|e| e.sequence > before && e.kind == kind);
        if let Some(event) = saved.filter(|_| accepted) {
            return Ok(event.text.read());
        }
        std::thread::sleep(POLL_EVERY);
    }
    Err(RecordError::NoFlight)
}

impl Totals {
    fn verdict(&self) -> Result<(), RecordError> {
        match (self.gaps.missing() + self.second.missing(), self.events.missing()) {
            (0, 0) => Ok(()),
            (ticks, events) => Err(RecordError::Missing {
                ticks,
                gaps: self.gaps.gaps().len() + self.second.gaps().len(),
                in_core: self.lost_in_core,
                events,
            }),
        }
    }
}

#[cfg(test)]
mod tests;
