//! The second device, which the other hand holds: its latest state, and one record for every tick of its loop.

use crate::DeadlineTotals;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// One tick, as hosts see it. Written by the second device's thread only, on a board that exists in a run with a second device.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SecondState {
    /// Ticks since the loop began; 0 means that no tick has run.
    pub tick: u64,
    /// `CLOCK_MONOTONIC` at the wake-up of this tick.
    pub time_ns: u64,
    /// Tip of what the hand holds, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Quaternion i, j, k, w; what the hand holds lies along +z of its own frame.
    pub world_from_tool: [f64; 4],
    /// Force on the hand, after the gate of this device, N.
    pub force_on_hand_n: [f64; 3],
    /// Torque on the hand, after the gate, N m.
    pub torque_on_hand_nm: [f64; 3],
    /// Largest magnitude written to the device since the last reset.
    pub peak_force_n: f64,
    /// Factor on the force of the contact, as the operator set it.
    pub force_scale: f64,
    /// Peak force of this device, N.
    pub device_limit_n: f64,
    /// Deadlines of this loop that were missed since the last reset.
    pub missed_deadlines: u64,
    /// Longest wake-up latency since the last reset.
    pub worst_wake_ns: u64,
    /// Longest tick since the last reset.
    pub worst_work_ns: u64,
    /// The tissue tick whose answer was used.
    pub tissue_tick: u64,
    /// Records that the ring could not take because the bridge was late.
    pub records_lost: u64,
    /// Times that the gate had to change the force.
    pub gate_interventions: u64,
    /// As [`crate::HapticState::gate_counts`].
    pub gate_counts: [u64; 8],
    /// Energy taken from the hand minus given to it, as the passivity controller books it.
    pub energy_j: f64,
    /// Root mean square of the force over the thermal time of the motors.
    pub warmth_n: f64,
    /// [`crate::ParametersInForce::generation`] that the tick ran with.
    pub parameters_generation: u64,
    /// Totals of this loop since it began.
    pub since_start: DeadlineTotals,
    /// Totals of this loop since the force was last turned on.
    pub since_armed: DeadlineTotals,
    /// [`crate::Fault`] of this device by number. The needle's device has its own.
    pub fault: u32,
    /// Bits of [`crate::flags`]: engaged, waiting, in contact, simulated device, at goal, gate acted, real time.
    pub flags: u32,
    /// Bits of the buttons that are pressed.
    pub buttons: u32,
    /// Edge of the elements that what the probe presses was solved for in, um; 0 before that is there.
    pub probe_edge_um: u32,
}

/// Written by the second device's thread into a ring, sent by the bridge in batches.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct SecondRecord {
    /// The run of the core.
    pub session_id: u64,
    /// Number of the tick.
    pub tick: u64,
    /// When the tick was due on the ideal grid, `CLOCK_MONOTONIC`.
    pub due_ns: u64,
    /// From the time at which the tick was due until the thread ran.
    pub wake_latency_ns: u64,
    /// From wake-up until the force was written.
    pub force_written_ns: u64,
    /// From wake-up until the tick was done.
    pub work_ns: u64,
    /// Deadlines skipped just before this tick.
    pub missed: u32,
    /// [`crate::Fault`] by number.
    pub fault: u32,
    /// Bits of [`crate::flags`].
    pub flags: u32,
    /// Bits of the buttons that are pressed.
    pub buttons: u32,
    /// Tip of what the hand holds, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Quaternion i, j, k, w; with the tip all that the device said.
    pub world_from_tool: [f64; 4],
    /// Force on the hand, after the gate, N.
    pub force_on_hand_n: [f64; 3],
    /// Torque on the hand, after the gate, N m.
    pub torque_on_hand_nm: [f64; 3],
    /// Size of the force that the contact asked for, before the gate, N.
    pub contact_force_n: f64,
    /// The tissue tick whose answer was used.
    pub tissue_tick: u64,
}
