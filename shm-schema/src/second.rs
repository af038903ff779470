//! The second device, held by the other hand: its latest state, and one record for every tick of its loop.

use crate::DeadlineTotals;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// One tick, as seen by hosts. Written only by the second device's thread, on a board that exists in a run with a
/// second device.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct SecondState {
    /// Ticks since the loop began; 0 means that no tick has run.
    pub tick: u64,
    /// `CLOCK_MONOTONIC` at the wake-up of this tick.
    pub time_ns: u64,
    /// Tip of the held tool, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Quaternion i, j, k, w; the held tool lies along +z of its frame.
    pub world_from_tool: [f64; 4],
    /// Force on the hand, after the gate of this device, N.
    pub force_on_hand_n: [f64; 3],
    /// Torque on the hand, after the gate, N m.
    pub torque_on_hand_nm: [f64; 3],
    /// Largest magnitude written to the device since the last reset.
    pub peak_force_n: f64,
    /// The operator's factor on the contact force.
    pub force_scale: f64,
    /// Peak force of this device, N.
    pub device_limit_n: f64,
    /// Missed deadlines of this loop since the last reset.
    pub missed_deadlines: u64,
    /// Longest wake-up latency since the last reset.
    pub worst_wake_ns: u64,
    /// Longest tick since the last reset.
    pub worst_work_ns: u64,
    /// The tissue tick whose response was used.
    pub tissue_tick: u64,
    /// Records for which the ring had no room because the bridge was late.
    pub records_lost: u64,
    /// Number of times the gate changed the force.
    pub gate_interventions: u64,
    /// As [`crate::HapticState::gate_counts`].
    pub gate_counts: [u64; 8],
    /// Energy taken from the hand minus energy returned, as booked by the passivity controller.
    pub energy_j: f64,
    /// Root mean square of the force over the thermal time constant of the motors.
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
    /// Bits of the pressed buttons.
    pub buttons: u32,
    /// Edge of the elements in which the probe's answers were solved, µm; 0 before they exist.
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
    /// [`crate::Fault`] by number.
    pub fault: u32,
    /// Bits of [`crate::flags`].
    pub flags: u32,
    /// Bits of the pressed buttons.
    pub buttons: u32,
    /// Tip of the held tool, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Quaternion i, j, k, w; with the tip, the full report of the device.
    pub world_from_tool: [f64; 4],
    /// Force on the hand, after the gate, N.
    pub force_on_hand_n: [f64; 3],
    /// Torque on the hand, after the gate, N m.
    pub torque_on_hand_nm: [f64; 3],
    /// Magnitude of the contact force before the gate, N.
    pub contact_force_n: f64,
    /// The tissue tick whose response was used.
    pub tissue_tick: u64,
}
