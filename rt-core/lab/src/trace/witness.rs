//! The thread that watches a run's trace: waits for late ticks, freezes, reads, decodes.

use super::counters::{self, Counters};
use super::event::{self, Event};
use super::timeline::{self, Holder, Piece};
use super::words::{self, Below};
use super::{Counted, Instance, KEPT, Outlier, TracePiece, TraceSection, blame, tracefs};
use crate::collect::LateTick;
use crate::machine::Machine;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;
use stylet_runtime::rt::clock;

/// Threads and cores that are watched.
pub struct Watched<'a> {
    pub machine: &'a Machine,
    /// Core of the loop, its thread's name, and the `SCHED_FIFO` priority that it was given.
    pub core: usize,
    pub thread: &'static str,
    pub priority: Option<u32>,
    /// Lateness from which a tick counts.
    pub over_ns: u64,
}

/// Interval of counter readings between late ticks.
const LOOK: Duration = Duration::from_millis(250);
/// Length of events before a late tick that show the holder of the core at its deadline.
const BEFORE_NS: u64 = 200_000_000;
/// Margin of the listed intervals before and after the tick, as a fraction of its lateness, at least 50 µs.
const MARGIN: f64 = 0.4;
const LEAST_MARGIN_NS: u64 = 50_000;
/// Most intervals of one tick: the longest ones.
const PIECES: usize = 250;

struct Witness<'a> {
    instance: Instance,
    watched: &'a Watched<'a>,
    own_pid: Option<i32>,
    virtual_machine: bool,
    before: Counters,
    /// Spans from freezing to thawing.
    blind: Vec<(u64, u64)>,
    section: TraceSection,
}

/// Watches until no more late ticks can come.
pub fn watch(instance: Instance, watched: &Watched, late: &Receiver<LateTick>) -> TraceSection {
    let section = TraceSection {
        over_us: watched.over_ns as f64 / 1e3,
        buffer_kib_per_core: tracefs::BUFFER_KIB,
        events: instance.events.clone(),
        ..TraceSection::default()
    };
    let mut witness = Witness {
        instance,
        watched,
        own_pid: None,
        virtual_machine: watched.machine.hypervisor().is_some(),
        before: counters::read(watched.machine, watched.core, clock::now_ns()),
        blind: Vec::new(),
        section,
    };
    loop {
        match late.recv_timeout(LOOK) {
            Ok(tick) => {
                let all: Vec<LateTick> = std::iter::once(tick).chain(late.try_iter()).collect();
                witness.take(&all);
            }
            Err(RecvTimeoutError::Timeout) => witness.before = witness.count(),
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    witness.section.outliers.sort_by_key(|o| o.due_ns);
    witness.section.lost_events += witness.instance.dropped(watched.core);
    witness.section
}

impl Witness<'_> {
    fn count(&self) -> Counters {
        counters::read(self.watched.machine, self.watched.core, clock::now_ns())
    }

    fn wants(&self, tick: &LateTick) -> bool {
        let outliers = &self.section.outliers;
        let least = outliers.iter().map(|o| o.wake_us + o.work_us).fold(f64::MAX, f64::min);
        outliers.len() < KEPT || (tick.wake_ns + tick.work_ns) as f64 / 1e3 > least
    }

    fn take(&mut self, ticks: &[LateTick]) {
        self.section.late_ticks += ticks.len() as u64;
        self.own_pid = self
            .own_pid
            .or_else(|| Some(self.watched.machine.own_thread(self.watched.thread)? as i32));
        let Some(own_pid) = self.own_pid.filter(|_| ticks.iter().any(|t| self.wants(t))) else {
            return;
        };
        let now = self.count();
        let begin_ns = clock::now_ns();
        let text = self
            .instance
            .freeze()
            .and_then(|()| self.instance.read(self.watched.core));
        // A trace that cannot be thawed will fail to be read next time.
        let _ = self.instance.thaw();
        let end_ns = clock::now_ns();
        self.section.longest_read_ms = self.section.longest_read_ms.max((end_ns - begin_ns) as f64 / 1e6);
        let text = text.unwrap_or_default();
        self.section.lost_events += event::lost(&text);
        let first_ns = ticks.iter().map(|t| t.due_ns).min().unwrap_or(0);
        let events = event::events(&text, first_ns.saturating_sub(BEFORE_NS));
        for tick in ticks {
            match self.outlier(tick, own_pid, &events, &now) {
                Some(outlier) => self.keep(outlier),
                None => self.section.untraced += 1,
            }
        }
        self.blind.push((begin_ns, end_ns));
        self.before = now;
    }

    fn keep(&mut self, outlier: Outlier) {
        let outliers = &mut self.section.outliers;
        outliers.push(outlier);
        if outliers.len() > KEPT {
            let lateness = |o: &Outlier| o.wake_us + o.work_us;
            let least = (0..outliers.len()).min_by(|&a, &b| lateness(&outliers[a]).total_cmp(&lateness(&outliers[b])));
            outliers.swap_remove(least.unwrap_or(0));
        }
    }

    /// Returns the tick with its causes; `None` if the trace does not cover it.
    fn outlier(&self, tick: &LateTick, own_pid: i32, events: &[Event], now: &Counters) -> Option<Outlier> {
        let woke_ns = tick.due_ns + tick.wake_ns;
        // A tick that woke in time and worked too long is late because of events during its work.
        let end_ns = if tick.wake_ns >= self.watched.over_ns {
            woke_ns
        } else {
            woke_ns + tick.work_ns
        };
        let overlaps = |(from, to): &(u64, u64)| *from < end_ns && *to > tick.due_ns;
        if self.blind.iter().any(overlaps) {
            return None;
        }
        let priority = self.watched.priority.map_or(120, |p| 99 - p as i32);
        let margin_ns = ((MARGIN * (end_ns - tick.due_ns) as f64) as u64).max(LEAST_MARGIN_NS);
        let walk = |from_ns, to_ns| timeline::pieces(events, own_pid, priority, from_ns, to_ns);
        let causes = blame::causes(&walk(tick.due_ns, end_ns)?, woke_ns);
        let around = walk(tick.due_ns.saturating_sub(margin_ns), end_ns + margin_ns).unwrap_or_default();
        let smi = now.smi_since(&self.before);
        let below = Below {
            virtual_machine: self.virtual_machine,
            smi,
        };
        let counted = now
            .since(&self.before)
            .into_iter()
            .map(|(what, times)| Counted { what, times });
        Some(Outlier {
            due_ns: tick.due_ns,
            at_s: 0.0,
            wake_us: tick.wake_ns as f64 / 1e3,
            work_us: tick.work_ns as f64 / 1e3,
            cause: words::sentence(&causes, below),
            causes,
            counted: counted.collect(),
            counted_over_ms: now.at_ns.saturating_sub(self.before.at_ns) as f64 / 1e6,
            system_management_interrupts: smi,
            trace: holders(&around, tick.due_ns),
        })
    }
}

/// Returns the holders of the core; neighbours with one name are merged.
pub(super) fn holders(pieces: &[Piece], due_ns: u64) -> Vec<TracePiece> {
    let mut all: Vec<TracePiece> = Vec::new();
    for piece in pieces {
        let who = match &piece.holder {
            Holder::OwnLoop => "the loop".to_owned(),
            Holder::Idle(_) => "idle".to_owned(),
            Holder::Thread { task, .. } => task.name.clone(),
            Holder::Interruption(i) => i.to_string(),
        };
        let from_us = (piece.from_ns as f64 - due_ns as f64) / 1e3;
        let us = piece.length_ns() as f64 / 1e3;
        match all.last_mut() {
            Some(last) if last.who == who => last.us += us,
            _ => all.push(TracePiece { from_us, us, who }),
        }
    }
    if all.len() > PIECES {
        let mut longest: Vec<f64> = all.iter().map(|p| p.us).collect();
        longest.sort_by(|a, b| b.total_cmp(a));
        all.retain(|p| p.us > longest[PIECES]);
    }
    all
}
