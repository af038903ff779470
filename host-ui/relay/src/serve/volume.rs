//! A volume that a member sends in parts: none is kept without the right to it, and there is one at a time.

use std::time::{Duration, Instant};
use stylet_shm_schema::UploadHeader;

/// One that does not go on for so long gives its place to another.
const PATIENCE: Duration = Duration::from_secs(2);

/// What has come of it.
pub(super) struct Volume {
    pub seat: u16,
    pub header: UploadHeader,
    pub cells: Vec<u8>,
    at: Instant,
}

impl Volume {
    /// Begun, without cells.
    pub fn begin(seat: u16, header: UploadHeader, now: Instant) -> Self {
        Self {
            seat,
            header,
            cells: Vec::new(),
            at: now,
        }
    }

    /// Of another seat, and still coming.
    pub fn keeps_out(&self, seat: u16, now: Instant) -> bool {
        self.seat != seat && now - self.at < PATIENCE
    }

    /// Whether these are the cells that come next; then they are taken.
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
