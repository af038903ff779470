//! The last records of a loop, kept for a bridge that is started anew, and sent in batches.

use super::outbox::Outbox;
use crate::rt::clock;
use std::collections::VecDeque;
use stylet_shm_schema::{BATCH_EVERY, MAX_BATCH, RECORD_BUFFER};
use stylet_wall::packet::Kind;

/// As many as the queue of a host holds: 12 s at 1 kHz in the smallest batches.
const KEPT: usize = RECORD_BUFFER * BATCH_EVERY.as_millis() as usize;

/// Of one loop.
pub struct Journal<T> {
    kind: Kind,
    records: VecDeque<T>,
    /// Number of the first that is kept.
    first: u64,
    /// Number of the next that is sent.
    next: u64,
    sent_ns: u64,
}

impl<T: bytemuck::Pod> Journal<T> {
    /// Empty, of records that are sent as `kind`.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            records: VecDeque::with_capacity(KEPT),
            first: 0,
            next: 0,
            sent_ns: 0,
        }
    }

    /// The newest record.
    pub fn newest(&self) -> Option<&T> {
        self.records.back()
    }

    /// Takes what the loop has made; whether it has made a tick.
    pub fn take(&mut self, records: &mut rtrb::Consumer<T>) -> bool {
        let mut any = false;
        while let Ok(record) = records.pop() {
            any = true;
            if self.records.len() == KEPT {
                self.records.pop_front();
                self.first += 1;
            }
            self.records.push_back(record);
        }
        any
    }

    /// Sends all that is kept again, to another bridge.
    pub fn rewind(&mut self) {
        self.next = self.first;
    }

    /// Sends full batches, and one that is not full where the last was sent long enough ago, or where `at_once`.
    pub fn send(&mut self, outbox: &mut Outbox, at_once: bool) {
        self.next = self.next.max(self.first);
        loop {
            let from = (self.next - self.first) as usize;
            let count = (self.records.len() - from).min(MAX_BATCH);
            let is_due = at_once || clock::now_ns() - self.sent_ns >= BATCH_EVERY.as_nanos() as u64;
            if count == 0 || !(count == MAX_BATCH || is_due) || outbox.is_waiting() {
                return;
            }
            let batch: Vec<T> = self.records.range(from..from + count).copied().collect();
            outbox.put(self.kind, bytemuck::cast_slice(&batch), None);
            self.next += count as u64;
            self.sent_ns = clock::now_ns();
        }
    }
}
