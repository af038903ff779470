//! Data that the receiving thread has taken out of shared memory, in bounded memory: the newest of each kind, and queues
//! of what the host has not taken yet.
//!
//! Nothing here waits for the host. Dropped data shows as a gap in the numbers of ticks and events, and is counted
//! there.

use super::{Answer, SceneModel, Snapshot};
use std::collections::VecDeque;
use std::mem::take;
use std::sync::Arc;
use stylet_shm_schema::{
    Class, Event, HapticState, ParametersInForce, PlanInForce, Rehearsal, Relayed, SecondRecord, SecondState, Session,
    TickRecord,
};
use web_time::Instant;

/// Most records queued for the host: five minutes at 1 kHz, 72 MB.
pub const RECORDS_KEPT: usize = 300_000;
const EVENTS_KEPT: usize = 256;
/// Most answers queued for the host.
const ANSWERS_KEPT: usize = 1024;
/// Most results of rehearsals queued for the host.
const REHEARSALS_KEPT: usize = 8;

/// State of the connection, as seen by the receiving thread.
#[derive(Clone, Debug, Default)]
pub struct Pulse {
    /// Time at which the heartbeat last moved.
    pub moved: Option<Instant>,
    /// Time of the last check: a host that was suspended itself does not know the core's state.
    pub looked: Option<Instant>,
    /// The heartbeat is that of the board, every tick, rather than that of the announcements.
    pub has_board: bool,
    /// Reason why there are no ports.
    pub trouble: Option<String>,
}

/// The newest data of each kind from one run of the core.
#[derive(Clone, Default)]
pub struct Run {
    pub session: Option<Session>,
    pub state: Option<HapticState>,
    pub second_state: Option<SecondState>,
    pub scene: Option<Arc<SceneModel>>,
    pub snapshot: Option<Arc<Snapshot>>,
    pub parameters: Option<ParametersInForce>,
    pub plan: Option<PlanInForce>,
    pub relayed: Option<Relayed>,
    /// The class, with its time of arrival.
    pub class: Option<(Instant, Arc<Class>)>,
    pub events: Arc<VecDeque<Event>>,
    /// Numbers missing among the events.
    pub events_unseen: u64,
}

impl Run {
    pub fn id(&self) -> Option<u64> {
        self.session.as_ref().map(|s| s.session_id)
    }

    /// Adds an event. History may be delivered twice when the ports are recreated.
    fn put_event(&mut self, event: Event) {
        let last = self.events.back().map(|last| last.sequence);
        if last.is_some_and(|last| last >= event.sequence) {
            return;
        }
        self.events_unseen += last.map_or(0, |last| event.sequence - last - 1);
        keep(Arc::make_mut(&mut self.events), event, EVENTS_KEPT);
    }
}

/// Data of the present run, with what the host has not taken yet.
#[derive(Default)]
pub struct Inbox {
    pub pulse: Pulse,
    pub run: Run,
    /// Data of a run that is not announced yet, with its session.
    next: (u64, Run),
    pub rehearsals: VecDeque<Box<Rehearsal>>,
    /// Answers to this host, by their commands.
    pub answers: VecDeque<(u64, Answer)>,
    pub records: VecDeque<TickRecord>,
    pub second_records: VecDeque<SecondRecord>,
    pub invalid_dropped: u64,
}

impl Inbox {
    /// Empties the queues; the newest data is kept.
    pub fn take(&mut self) -> Self {
        Self {
            pulse: self.pulse.clone(),
            run: self.run.clone(),
            next: Default::default(),
            rehearsals: take(&mut self.rehearsals),
            answers: take(&mut self.answers),
            records: take(&mut self.records),
            second_records: take(&mut self.second_records),
            invalid_dropped: self.invalid_dropped,
        }
    }

    /// Begins another run of the core: all data of the last one is dropped.
    pub fn begin(&mut self, session: Session) {
        let (id, early) = take(&mut self.next);
        let early = if id == session.session_id {
            early
        } else {
            Run::default()
        };
        *self = Self {
            pulse: take(&mut self.pulse),
            run: Run {
                session: Some(session),
                ..early
            },
            invalid_dropped: self.invalid_dropped,
            ..Self::default()
        };
    }

    /// Returns the data of a run; one that is not announced yet waits for its announcement.
    pub fn of(&mut self, session_id: u64) -> &mut Run {
        if self.run.id() == Some(session_id) {
            return &mut self.run;
        }
        if self.next.0 != session_id {
            self.next = (session_id, Run::default());
        }
        &mut self.next.1
    }

    pub fn put_record(&mut self, record: TickRecord) {
        keep(&mut self.records, record, RECORDS_KEPT);
    }

    pub fn put_second_record(&mut self, record: SecondRecord) {
        keep(&mut self.second_records, record, RECORDS_KEPT);
    }

    pub fn put_event(&mut self, event: Event) {
        self.of(event.session_id).put_event(event);
    }

    /// Takes a scene; `None` counts as invalid.
    pub fn put_scene(&mut self, scene: Option<SceneModel>) {
        match scene {
            Some(scene) => {
                let run = self.of(scene.header.session_id);
                run.scene = Some(Arc::new(scene));
            }
            None => self.invalid_dropped += 1,
        }
    }

    /// Takes a snapshot; `None` counts as invalid.
    pub fn put_snapshot(&mut self, snapshot: Option<Snapshot>) {
        match snapshot {
            Some(snapshot) => {
                let run = self.of(snapshot.header.session_id);
                run.snapshot = Some(Arc::new(snapshot));
            }
            None => self.invalid_dropped += 1,
        }
    }

    pub fn put_answer(&mut self, command_id: u64, answer: Answer) {
        keep(&mut self.answers, (command_id, answer), ANSWERS_KEPT);
    }

    pub fn put_rehearsal(&mut self, rehearsal: Rehearsal) {
        keep(&mut self.rehearsals, Box::new(rehearsal), REHEARSALS_KEPT);
    }
}

fn keep<T>(queue: &mut VecDeque<T>, value: T, most: usize) {
    if queue.len() >= most {
        queue.pop_front();
    }
    queue.push_back(value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn a_host_that_takes_nothing_costs_bounded_memory_and_keeps_the_newest() {
        let mut inbox = Inbox::default();
        for tick in 0..RECORDS_KEPT as u64 + 10 {
            let mut record = TickRecord::zeroed();
            record.tick = tick;
            inbox.put_record(record);
        }
        let taken = inbox.take();
        assert_eq!(taken.records.len(), RECORDS_KEPT);
        assert_eq!(taken.records.front().map(|r| r.tick), Some(10));
        assert!(size_of::<TickRecord>() * RECORDS_KEPT <= 72_000_000);
        assert!(inbox.take().records.is_empty(), "taken once");
    }
}
