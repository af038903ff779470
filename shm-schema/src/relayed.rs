//! What a host on another machine knows of its line to the core.

use crate::Text;
use bytemuck::{Pod, Zeroable};

/// The relay's line, published by a relay in place of a core, five times a second; beside a core there is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Relayed {
    /// The run of the core, as it is announced here.
    pub session_id: u64,
    /// Round trip to the server.
    pub round_trip_ns: u64,
    /// Age of the newest snapshot that was handed to hosts, with half a round trip: the clocks of the machines are not compared.
    pub snapshot_age_ns: u64,
    /// Records lost for good.
    pub records_lost: u64,
    /// Snapshots that never came.
    pub snapshots_lost: u64,
    /// 1 where the server is heard.
    pub is_heard: u32,
    /// 1 where whoever sits here operates.
    pub operates: u32,
    /// Address and port of the server.
    pub server: Text<64>,
    /// Who sits here.
    pub name: Text<64>,
    /// Who operates; empty for nobody.
    pub operator: Text<64>,
    /// What whoever sits here may do, in one word.
    pub role: Text<16>,
}
