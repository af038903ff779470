//! The last records of a loop, kept for a restarted bridge and sent in batches.

use super::outbox::Outbox;
use crate::rt::clock;
use std::collections::VecDeque;
use stylet_shm_schema::{BATCH_EVERY, MAX_BATCH, RECORD_BUFFER};
use stylet_wall::packet::Kind;

/// As many as a host's queue holds: 12 s at 1 kHz in the smallest batches.
const KEPT: usize = RECORD_BUFFER * BATCH_EVERY.as_millis() as usize;

/// Journal of one loop.
pub struct Journal<T> {
    kind: Kind,
    records: VecDeque<T>,
    /// Number of the oldest kept record.
    first: u64,
    /// Number of the next record to send.
    next: u64,
    sent_ns: u64,
}

impl<T: bytemuck::Pod> Journal<T> {
    /// Returns an empty journal of records sent as `kind`.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            records: VecDeque::with_capacity(KEPT),
            first: 0,
            next: 0,
            sent_ns: 0,
        }
    }

    /// Returns the newest record.
    pub fn newest(&self) -> Option<&T> {
        self.records.back()
    }

    /// Takes the loop's new records; returns whether it made a tick.
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

    /// Sends everything kept again, to a new bridge.
    pub fn rewind(&mut self) {
        self.next = self.first;
    }

    /// Sends full batches, and a partial one if the last is old enough or `at_once`.
    pub fn send(&mut self, outbox: &mut Outbox, at_once: bool) {
        self.next = self.next.max(self.first);
        loop {
            let from = (self.next - self.first) as usize;
            let count = (self.records.len() - from).min(MAX_BATCH);
            let is_due = at_once || clock::now_ns() - self.sent_ns >= BATCH_EVERY.as_nanos() as u64;
            if count == 0 || !(count == MAX_BATCH || is_due) || outbox.is_waiting() {
                return;
            }
            let batch = self.records.range(from..from + count).flat_map(bytemuck::bytes_of);
            outbox.put((self.kind, batch.copied().collect(), None));
            self.next += count as u64;
            self.sent_ns = clock::now_ns();
        }
    }
}
