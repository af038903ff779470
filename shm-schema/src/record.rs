//! One record for every tick of the force loop.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Written by the haptic thread into a ring, sent by the bridge in batches.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.TickRecord")]
pub struct TickRecord {
    pub session_id: u64,
    pub tick: u64,
    /// When the tick was due on the ideal grid, `CLOCK_MONOTONIC`.
    pub due_ns: u64,
    pub wake_latency_ns: u64,
    /// From wake-up until the force was written.
    pub force_written_ns: u64,
    /// From wake-up until the tick was done.
    pub work_ns: u64,
    /// Deadlines skipped just before this tick.
    pub missed: u32,
    pub phase: u32,
    pub fault: u32,
    pub flags: u32,
    pub tip_in_scene_m: [f64; 3],
    pub force_on_hand_n: [f64; 3],
    pub depth_m: f64,
    pub speed_m_per_s: f64,
    /// F_R, guide, damping, shaft friction, F_G before the gate.
    pub force_terms_n: [f64; 5],
    pub tissue_tick: u64,
    /// Quaternion i, j, k, w; with the tip all that the device said.
    pub world_from_tool: [f64; 4],
    pub buttons: u32,
    pub reserved: u32,
}
