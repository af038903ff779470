//! Records of a loop on their way to the hosts, in batches, each full or [`BATCH_EVERY`] after the last.

use crate::rt::clock;
use stylet_shm_schema::service::{BATCH_EVERY, MAX_BATCH, SlicePublisher};

/// Of one loop.
pub struct Batches<T> {
    batch: Vec<T>,
    newest: Option<T>,
    /// When records were sent last.
    sent_ns: u64,
}

impl<T> Default for Batches<T> {
    fn default() -> Self {
        Self {
            batch: Vec::with_capacity(MAX_BATCH),
            newest: None,
            sent_ns: 0,
        }
    }
}

impl<T: Copy> Batches<T> {
    /// The newest record.
    pub fn newest(&self) -> Option<&T> {
        self.newest.as_ref()
    }

    /// Takes what the loop has made and sends what is due. True when the loop has made a tick.
    pub fn pass(&mut self, records: &mut rtrb::Consumer<T>, port: &SlicePublisher<T, u64>, session_id: u64) -> bool {
        let mut any = false;
        while let Ok(record) = records.pop() {
            any = true;
            self.newest = Some(record);
            self.batch.push(record);
            if self.batch.len() == MAX_BATCH {
                self.send(port, session_id);
            }
        }
        if clock::now_ns() - self.sent_ns >= BATCH_EVERY.as_nanos() as u64 {
            self.send(port, session_id);
        }
        any
    }

    /// Whatever has not been sent yet.
    pub fn send(&mut self, port: &SlicePublisher<T, u64>, session_id: u64) {
        if self.batch.is_empty() {
            return;
        }
        self.sent_ns = clock::now_ns();
        let _ = port.send(&session_id, &self.batch);
        self.batch.clear();
    }
}
