//! The receiving thread's side of the second device, in a run that has one.

use super::inbox::Inbox;
use stylet_ports::{self as service, Node, SliceSubscriber, StateReader};
use stylet_shm_schema::{SecondRecord, SecondState, Session, check};
use web_time::{Duration, Instant};

const OPEN_EVERY: Duration = Duration::from_millis(100);

/// Ports of the second device's services, while the run has one.
#[derive(Default)]
pub struct SecondEnds {
    board: Option<StateReader<SecondState>>,
    records: Option<SliceSubscriber<SecondRecord, u64>>,
    tried: Option<Instant>,
    /// The newest tick: a restarted bridge sends older ones again.
    tick: u64,
}

impl SecondEnds {
    /// Closes for another run, or none.
    pub fn close(&mut self) {
        *self = Self::default();
    }

    /// Closes the ports for another epoch of the same run.
    pub fn close_ports(&mut self) {
        (self.board, self.records, self.tried) = (None, None, None);
    }

    /// Opens the services of the run of `session`.
    pub fn open(&mut self, node: &Node, session: &Session) {
        let is_whole = self.board.is_some() && self.records.is_some();
        if !session.has_second() || is_whole || self.tried.is_some_and(|t| t.elapsed() < OPEN_EVERY) {
            return;
        }
        self.tried = Some(Instant::now());
        self.records = self
            .records
            .take()
            .or_else(|| service::second_records::subscriber(node).ok());
        self.board = StateReader::open(node, session.session_id).ok();
    }

    /// Takes all arrived data; returns how many messages were invalid.
    pub fn receive(&mut self, session_id: u64, inbox: &mut Inbox) -> u64 {
        let mut invalid = 0;
        while let Some(batch) = self.records.as_ref().and_then(SliceSubscriber::receive) {
            for record in batch.values() {
                match check::second_record(record) {
                    Ok(()) if record.session_id == session_id && record.tick > self.tick => {
                        self.tick = record.tick;
                        inbox.put_second_record(*record);
                    }
                    Ok(()) => {}
                    Err(_) => invalid += 1,
                }
            }
        }
        if let Some(state) = self.board.as_ref().map(StateReader::read) {
            match check::second_state(&state) {
                Ok(()) => inbox.run.second_state = Some(state),
                Err(_) => invalid += 1,
            }
        }
        invalid
    }
}
