//! One record for every tick of the force loop.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Written by the haptic thread into a ring, sent by the bridge in batches.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct TickRecord {
    /// The run of the core.
    pub session_id: u64,
    /// Number of the tick.
    pub tick: u64,
    /// Deadline of the tick on the ideal grid, `CLOCK_MONOTONIC`.
    pub due_ns: u64,
    /// From the deadline until the thread ran.
    pub wake_latency_ns: u64,
    /// From wake-up until the force was written.
    pub force_written_ns: u64,
    /// From wake-up until the tick was done.
    pub work_ns: u64,
    /// Deadlines skipped just before this tick.
    pub missed: u32,
    /// [`crate::Phase`] by number.
    pub phase: u32,
    /// [`crate::Fault`] by number.
    pub fault: u32,
    /// Bits of [`crate::flags`].
    pub flags: u32,
    /// Tip, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Force on the operator, after the safety gate, N.
    pub force_on_hand_n: [f64; 3],
    /// Depth since the tip met the membrane (u_tip of paper eq. 6), m.
    pub depth_m: f64,
    /// Speed along the path, positive inwards (paper eq. 7), filtered.
    pub speed_m_per_s: f64,
    /// F_R, guide, damping, shaft friction, F_G before the gate.
    pub force_terms_n: [f64; 5],
    /// The tissue tick whose response was used.
    pub tissue_tick: u64,
    /// Quaternion i, j, k, w; with the tip, the full report of the device.
    pub world_from_tool: [f64; 4],
    /// Displacement of the tip from that of a rigid needle in the same hand, scene frame, m.
    #[serde(default)]
    pub tip_deflection_m: [f64; 3],
    /// Bits of the pressed buttons.
    pub buttons: u32,
    /// [`crate::HapticState::folded_from_m`] in micrometres, rounded up.
    #[serde(default)]
    pub folded_from_um: u32,
}
