//! What a host sends to its core.

use stylet_shm_schema::{Command, LeaseOrder, UploadHeader};
use web_time::Instant;

/// A message of the host to the core.
pub enum Outgoing {
    Command(Box<Command>),
    /// This host's motions continue until then, as long as this process runs.
    Promise(Instant),
    Upload(Box<UploadHeader>, Vec<u8>),
    /// For a relay, which no page has.
    #[cfg_attr(target_family = "wasm", expect(dead_code))]
    Lease(LeaseOrder),
}
