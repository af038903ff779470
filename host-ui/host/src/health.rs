//! Watches how many ticks of a running core succeed: their force left within their period. For a person, and as a file
//! for a monitoring system.

mod metrics;
#[cfg(test)]
mod tests;

use crate::link::{Link, LinkError, LinkStatus};
use clap::Args;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stylet_base::interrupt::{Interrupt, InterruptError};
use stylet_base::{WriteError, write_whole};
use stylet_shm_schema::{Event, EventKind, HapticState, Instance, TickRecord};

/// Ticks of the short view.
const LAST: usize = 100;
const POLL_EVERY: Duration = Duration::from_millis(20);
const REPORT_EVERY: Duration = Duration::from_secs(1);
/// The surface of the tissue is not needed.
const SNAPSHOTS_EVERY: Duration = Duration::from_secs(1);

/// Options of `host-ui health`.
#[derive(Args, Debug)]
pub struct Options {
    /// Name under which rt-core was started
    #[arg(long, default_value = "main", value_parser = Instance::new)]
    pub instance: Instance,
    /// Write the figures each second to FILE in OpenMetrics text, whole or not at all, instead of printing them; for
    /// node_exporter's textfile collector its name ends with .prom
    #[arg(long, value_name = "FILE")]
    openmetrics: Option<PathBuf>,
    /// Seconds to watch [default: until interrupted]
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u64).range(1..))]
    duration: Option<u64>,
}

/// Failure to watch a core.
#[derive(Debug, thiserror::Error)]
pub enum HealthError {
    /// No core was seen.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The signals that end it cannot be handled.
    #[error(transparent)]
    Signals(#[from] InterruptError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Watches until the time is up or it is interrupted, also while no core runs.
///
/// # Errors
/// If no core ran in all that time, or the file cannot be written.
pub fn run(options: &Options) -> Result<(), HealthError> {
    let interrupted = Interrupt::on_signals()?;
    let mut link = Link::with_snapshots_every(options.instance.clone(), SNAPSHOTS_EVERY);
    let mut health = Health::default();
    let (begun, mut reported) = (Instant::now(), Instant::now());
    let is_over = || options.duration.is_some_and(|s| begun.elapsed().as_secs() >= s);
    loop {
        let last = interrupted.asked() || is_over();
        link.poll();
        health.look(&mut link);
        if last || reported.elapsed() >= REPORT_EVERY {
            reported = Instant::now();
            match &options.openmetrics {
                Some(path) => write_whole(path, metrics::text(&health, &options.instance).as_bytes())?,
                None => println!("{}", health.words(&link.status())),
            }
        }
        if last {
            break;
        }
        std::thread::sleep(POLL_EVERY);
    }
    match link.status() {
        LinkStatus::Absent { why } if health.session == 0 => Err(LinkError::Absent(why).into()),
        _ => Ok(()),
    }
}

/// Success of the ticks that were watched, over all runs of the core.
#[derive(Clone, Debug, Default)]
struct Health {
    /// The run of the core; 0 before the first.
    session: u64,
    answers: bool,
    state: Option<HapticState>,
    /// Deadline of the first tick that was watched.
    since_ns: Option<u64>,
    next_tick: Option<u64>,
    last_event: u64,
    /// Whether each of the last deadlines was met in time.
    last: VecDeque<bool>,
    /// Deadlines that were watched, with those that no tick served.
    deadlines: u64,
    succeeded: u64,
    /// Watched ticks whose force left after the next deadline.
    late: u64,
    missed: u64,
    /// Ticks whose records did not reach this host.
    unseen: u64,
    rearms: u64,
    faults: u64,
}

impl Health {
    fn look(&mut self, link: &mut Link) {
        self.answers = link.status() == LinkStatus::Live;
        let Some(session) = link.session() else { return };
        let (id, period_ns) = (session.session_id, session.period_ns);
        if id != self.session {
            // The counts go on over a new run of the core.
            (self.session, self.next_tick, self.last_event) = (id, None, 0);
        }
        self.state = link.state().copied();
        link.take_records()
            .iter()
            .for_each(|record| self.take(record, period_ns));
        link.events().iter().for_each(|event| self.count(event));
    }

    /// Takes one tick; without the one before it, the deadlines missed in between are unknown.
    fn take(&mut self, record: &TickRecord, period_ns: u64) {
        if let Some(next) = self.next_tick {
            self.unseen += record.tick.saturating_sub(next);
            self.missed += u64::from(record.missed);
            (0..record.missed).take(LAST).for_each(|_| self.note(false));
            self.deadlines += u64::from(record.missed);
        }
        self.next_tick = Some(record.tick + 1);
        self.since_ns = self.since_ns.or(Some(record.due_ns));
        let is_in_time = record.wake_latency_ns.saturating_add(record.force_written_ns) <= period_ns;
        self.deadlines += 1;
        self.succeeded += u64::from(is_in_time);
        self.late += u64::from(!is_in_time);
        self.note(is_in_time);
    }

    fn note(&mut self, is_in_time: bool) {
        if self.last.len() == LAST {
            self.last.pop_front();
        }
        self.last.push_back(is_in_time);
    }

    /// Counts an event once, if it is not older than the first tick that was watched.
    fn count(&mut self, event: &Event) {
        if event.sequence <= self.last_event || self.since_ns.is_none_or(|since_ns| event.time_ns < since_ns) {
            return;
        }
        self.last_event = event.sequence;
        match EventKind::from_number(event.kind) {
            Some(EventKind::Rearmed) => self.rearms += 1,
            Some(EventKind::FaultRaised) => self.faults += 1,
            _ => {}
        }
    }

    /// Returns the share of the last deadlines and of all watched ones that were met; `None` before the first.
    fn success(&self) -> Option<[f64; 2]> {
        let met = self.last.iter().filter(|met| **met).count();
        (self.deadlines > 0).then(|| {
            [
                met as f64 / self.last.len() as f64,
                self.succeeded as f64 / self.deadlines as f64,
            ]
        })
    }

    fn words(&self, status: &LinkStatus) -> String {
        if let LinkStatus::Absent { why } = status {
            return why.clone();
        }
        let Some([last, all]) = self.success() else {
            return "no tick yet".to_owned();
        };
        format!(
            "success {:.1} % of the last {}, {:.4} % of {} ticks; {} missed, {} late, {} faults, {} re-arms, {} not seen",
            100.0 * last,
            self.last.len(),
            100.0 * all,
            self.deadlines,
            self.missed,
            self.late,
            self.faults,
            self.rearms,
            self.unseen
        )
    }
}
