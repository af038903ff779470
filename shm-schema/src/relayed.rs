//! State of a remote host's connection to the core.

use crate::Text;
use bytemuck::{Pod, Zeroable};

/// The relay's connection, published five times a second by a relay that replaces a core; a relay next to a core has
/// none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Relayed {
    /// The run of the core, as announced here.
    pub session_id: u64,
    /// Round trip to the server.
    pub round_trip_ns: u64,
    /// Age of the newest snapshot handed to hosts, including half a round trip: the clocks of the machines are not
    /// compared.
    pub snapshot_age_ns: u64,
    /// Records lost for good.
    pub records_lost: u64,
    /// Snapshots that never arrived.
    pub snapshots_lost: u64,
    /// 1 if the server is heard.
    pub is_heard: u32,
    /// 1 if this member operates.
    pub operates: u32,
    /// Address and port of the server.
    pub server: Text<64>,
    /// Name of this member.
    pub name: Text<64>,
    /// Name of the operator; empty for none.
    pub operator: Text<64>,
    /// Role of this member, in one word.
    pub role: Text<16>,
}
