//! A volume that a member sends in parts: kept only with the right to it, and one at a time.

use std::time::{Duration, Instant};
use stylet_shm_schema::UploadHeader;

/// Silence after which a volume gives way to another.
const PATIENCE: Duration = Duration::from_secs(2);

/// Progress of the volume.
pub(super) struct Volume {
    pub seat: u16,
    pub header: UploadHeader,
    pub cells: Vec<u8>,
    at: Instant,
}

impl Volume {
    /// Begins a volume without cells.
    pub fn begin(seat: u16, header: UploadHeader, now: Instant) -> Self {
        Self {
            seat,
            header,
            cells: Vec::new(),
            at: now,
        }
    }

    /// True if it is of another seat, and still arriving.
    pub fn keeps_out(&self, seat: u16, now: Instant) -> bool {
        self.seat != seat && now - self.at < PATIENCE
    }

    /// Takes the cells if they are the next ones; returns whether they are.
    pub fn goes_on(&mut self, seat: u16, header: &UploadHeader, at: usize, cells: &[u8], now: Instant) -> bool {
        let goes_on = self.seat == seat
            && bytemuck::bytes_of(&self.header) == bytemuck::bytes_of(header)
            && self.cells.len() == at;
        if goes_on {
            self.cells.extend_from_slice(cells);
            self.at = now;
        }
        goes_on
    }
}
