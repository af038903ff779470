//! Data that the receiving thread has taken out of shared memory and the host has not taken yet, in bounded memory.
//!
//! Nothing here waits for the host. State keeps the latest value; events keep a bounded queue. Dropped data shows as a
//! gap in the numbers of ticks and events, and is counted there.

use super::{SceneModel, Snapshot};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;
use stylet_shm_schema::{
    Class, Event, HapticState, ParametersInForce, PlanInForce, Rehearsal, Relayed, Reply, SecondRecord, SecondState,
    Session, TickRecord,
};

/// Most records queued for the host: five minutes at 1 kHz, 72 MB.
pub const RECORDS_KEPT: usize = 300_000;
/// Most events queued for the host: 1 MB.
const EVENTS_KEPT: usize = 4096;
/// Most replies queued for the host.
const REPLIES_KEPT: usize = 1024;
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

/// Data received since the host last took it.
#[derive(Default)]
pub struct Inbox {
    pub pulse: Pulse,
    pub session: Option<Session>,
    pub state: Option<HapticState>,
    pub scene: Option<(u64, Arc<SceneModel>)>,
    pub snapshot: Option<Snapshot>,
    pub parameters: Option<ParametersInForce>,
    pub plan: Option<PlanInForce>,
    pub relayed: Option<Relayed>,
    /// The class, with its time of arrival.
    pub class: Option<(Instant, Box<Class>)>,
    pub events: VecDeque<Event>,
    pub rehearsals: VecDeque<Box<Rehearsal>>,
    /// Replies to this host.
    pub replies: VecDeque<Reply>,
    /// Commands and volumes that could not be sent, with the reason.
    pub unsent: VecDeque<(u64, String)>,
    pub records: VecDeque<TickRecord>,
    pub second_state: Option<SecondState>,
    pub second_records: VecDeque<SecondRecord>,
    pub invalid_dropped: u64,
}

impl Inbox {
    /// Takes all data; the connection's state is kept.
    pub fn take(&mut self) -> Self {
        let pulse = self.pulse.clone();
        std::mem::replace(
            self,
            Self {
                pulse,
                ..Self::default()
            },
        )
    }

    /// Begins another run of the core: all data of the last one is dropped.
    pub fn begin(&mut self, session: Session) {
        self.session = Some(session);
        self.state = None;
        self.rehearsals.clear();
        self.replies.clear();
        self.unsent.clear();
        self.records.clear();
        self.second_state = None;
        self.second_records.clear();
    }

    pub fn put_record(&mut self, record: TickRecord) {
        keep(&mut self.records, record, RECORDS_KEPT);
    }

    pub fn put_second_record(&mut self, record: SecondRecord) {
        keep(&mut self.second_records, record, RECORDS_KEPT);
    }

    pub fn put_event(&mut self, event: Event) {
        keep(&mut self.events, event, EVENTS_KEPT);
    }

    pub fn put_reply(&mut self, reply: Reply) {
        keep(&mut self.replies, reply, REPLIES_KEPT);
    }

    pub fn put_rehearsal(&mut self, rehearsal: Rehearsal) {
        keep(&mut self.rehearsals, Box::new(rehearsal), REHEARSALS_KEPT);
    }

    pub fn put_unsent(&mut self, command_id: u64, why: String) {
        keep(&mut self.unsent, (command_id, why), REPLIES_KEPT);
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
