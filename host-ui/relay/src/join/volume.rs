//! Sends the volume of a host here to the server in parts, with greetings, promises and requests in between.

use super::Member;
use crate::wire::{Kind, PART_BYTES};
use stylet_shm_schema::UploadHeader;

/// Parts per pass.
const AT_ONCE: usize = 2;

/// Progress of the transfer.
pub(super) struct Volume {
    header: UploadHeader,
    cells: Vec<u8>,
    sent: usize,
}

impl Volume {
    /// Returns a volume of which nothing has been sent.
    pub fn new(header: UploadHeader, cells: &[u8]) -> Self {
        Self {
            header,
            cells: cells.to_vec(),
            sent: 0,
        }
    }

    /// Sends the next parts; false once all are sent.
    pub fn send_more(&mut self, member: &Member) -> bool {
        for part in self.cells[self.sent..].chunks(PART_BYTES).take(AT_ONCE) {
            let at = (self.sent as u64).to_le_bytes();
            member.ask(Kind::Upload, &[bytemuck::bytes_of(&self.header), &at, part]);
            self.sent += part.len();
        }
        self.sent < self.cells.len()
    }
}
