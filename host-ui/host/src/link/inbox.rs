//! What the receiving thread has taken out of shared memory and the host has not taken yet, in bounded memory.
//!
//! Nothing here waits for the host: of what says how things are, the newest stays; of what happened once, the last ones stay
//! up to the limits below. What is dropped shows as a gap in the numbers of ticks and events, and is counted there.

use super::{SceneModel, Snapshot};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;
use stylet_shm_schema::{
    Class, Event, HapticState, ParametersInForce, PlanInForce, Rehearsal, Relayed, Reply, SecondRecord, SecondState,
    Session, TickRecord,
};

/// Records that wait for the host: five minutes at 1 kHz, 72 MB.
pub const RECORDS_KEPT: usize = 300_000;
/// Events that wait for the host: 1 MB.
const EVENTS_KEPT: usize = 4096;
/// Replies to this host that wait for it.
const REPLIES_KEPT: usize = 1024;
/// Results of rehearsals that wait for the host.
const REHEARSALS_KEPT: usize = 8;

/// What the receiving thread knows of the connection.
#[derive(Clone, Debug, Default)]
pub struct Pulse {
    /// When the heartbeat was last seen to move.
    pub moved: Option<Instant>,
    /// When it was last looked at: a host that stood still itself does not know how the core is.
    pub looked: Option<Instant>,
    /// Whether the heartbeat is that of the board, every tick, or that of the announcements.
    pub has_board: bool,
    /// Why there are no ports.
    pub trouble: Option<String>,
}

/// What was received since the host took the last.
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
    /// With when it came.
    pub class: Option<(Instant, Box<Class>)>,
    pub events: VecDeque<Event>,
    pub rehearsals: VecDeque<Box<Rehearsal>>,
    /// To this host.
    pub replies: VecDeque<Reply>,
    /// Commands and volumes that could not be sent, and why.
    pub unsent: VecDeque<(u64, String)>,
    pub records: VecDeque<TickRecord>,
    pub second_state: Option<SecondState>,
    pub second_records: VecDeque<SecondRecord>,
    pub invalid_dropped: u64,
}

impl Inbox {
    /// All of it; the connection stays known.
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

    /// Another run of the core: nothing of the last one is of use to anyone.
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
