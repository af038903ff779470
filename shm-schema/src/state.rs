//! The latest state of the force loop, rewritten each millisecond on a wait-free blackboard.

use crate::DeadlineTotals;
use bytemuck::{Pod, Zeroable};
use num_enum::IntoPrimitive;
use serde::{Deserialize, Serialize};

/// One tick, as seen by the operator's program. Written only by the haptic thread.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct HapticState {
    /// Ticks since the loop began; 0 means that no tick has run.
    pub tick: u64,
    /// `CLOCK_MONOTONIC` at the wake-up of this tick.
    pub time_ns: u64,
    /// Tip, scene frame, m.
    pub tip_in_scene_m: [f64; 3],
    /// Unit vector from hub to tip.
    pub needle_direction: [f64; 3],
    /// Position at which the tip met the membrane; valid only while [`flags::IN_CONTACT`] is set.
    pub contact_in_scene_m: [f64; 3],
    /// Depth since the tip met the membrane (u_tip of paper eq. 6).
    pub depth_m: f64,
    /// Depth at which that membrane is punctured (u_cri of paper eq. 6); 0 outside and in tissue without a membrane.
    pub puncture_depth_m: f64,
    /// Speed along the path, positive inwards (paper eq. 7), filtered.
    pub speed_m_per_s: f64,
    /// Force on the operator, after the safety gate.
    pub force_on_hand_n: [f64; 3],
    /// Torque on the operator, after the safety gate, N m.
    pub torque_on_hand_nm: [f64; 3],
    /// Signed along the insertion direction, before the gate: F_R, guide (magnitude), damping, shaft friction, F_G.
    pub force_terms_n: [f64; 5],
    /// Largest magnitude written to the device since the last reset.
    pub peak_force_n: f64,
    /// The operator's factor on the force of the law.
    pub force_scale: f64,
    /// Peak force of the device, N.
    pub device_limit_n: f64,
    /// Missed deadlines of the force loop since the last reset.
    pub missed_deadlines: u64,
    /// Longest wake-up latency of the force loop since the last reset.
    pub worst_wake_ns: u64,
    /// Longest tick of the force loop since the last reset.
    pub worst_work_ns: u64,
    /// The tissue tick whose response was used.
    pub tissue_tick: u64,
    /// Missed deadlines of the tissue loop since the last reset.
    pub tissue_missed_deadlines: u64,
    /// Longest wake-up latency of the tissue loop since the last reset.
    pub tissue_worst_wake_ns: u64,
    /// Largest constraint violation left by any tissue tick since the last reset, in elements.
    pub worst_residual: f64,
    /// Longest tick of the tissue loop since the last reset.
    pub worst_tissue_work_ns: u64,
    /// Records for which the ring had no room because the bridge was late.
    pub records_lost: u64,
    /// Number of times the gate changed the force.
    pub gate_interventions: u64,
    /// Number of actions of each stage of the gate: not finite, passivity, slew, magnitude, continuous, device, torque,
    /// fault.
    pub gate_counts: [u64; 8],
    /// Energy taken from the hand minus energy returned, as booked by the passivity controller.
    pub energy_j: f64,
    /// Root mean square of the force over the thermal time constant of the motors.
    pub warmth_n: f64,
    /// Smallest corner volume of an element near the tip, relative to rest, where the tissue's answer is linear; 1
    /// elsewhere. At 0 and below a cell is folded.
    pub least_corner: f64,
    /// Displacement of the tissue at the tip when its linear answer folded, m; 0 if it has not since the insertion.
    pub folded_from_m: f64,
    /// Coupled mode: the tissue's answer along the insertion direction, before the gate.
    pub tissue_force_n: f64,
    /// [`crate::ParametersInForce::generation`] that the tick ran with.
    pub parameters_generation: u64,
    /// Displacement of the tip from that of a rigid needle in the same hand, scene frame, m; 0 for a needle that does
    /// not bend.
    pub tip_deflection_m: [f64; 3],
    /// In contact without a line: age of the pose that the tissue has answered within its tolerance. 0 on a line, which
    /// the force loop solves in the same tick.
    pub lag_ns: u64,
    /// Travel of the tip since that pose.
    pub lag_m: f64,
    /// Largest [`lag_ns`](Self::lag_ns) since the last reset.
    pub worst_lag_ns: u64,
    /// Largest [`lag_m`](Self::lag_m) since the last reset.
    pub worst_lag_m: f64,
    /// Totals of the force loop since it began.
    pub since_start: DeadlineTotals,
    /// Totals of the force loop since the force was last turned on.
    pub since_armed: DeadlineTotals,
    /// Totals of the tissue loop since it began.
    pub tissue_since_start: DeadlineTotals,
    /// Totals of the tissue loop since the force was last turned on.
    pub tissue_since_armed: DeadlineTotals,
    /// [`crate::Phase`] by number.
    pub phase: u32,
    /// [`Fault`] by number.
    pub fault: u32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Seeds in the tissue.
    pub seed_count: u32,
    /// Needles that stay in the tissue while another moves.
    pub left_count: u32,
    /// Zero.
    pub reserved: u32,
}

/// Bits of [`HapticState::flags`] and [`crate::TickRecord::flags`].
pub mod flags {
    /// Both threads run under `SCHED_FIFO`: it was requested, and the kernel confirmed it before the loops began.
    pub const REAL_TIME: u32 = 1;
    /// The operator has armed the force.
    pub const ENGAGED: u32 = 1 << 1;
    /// The tip is in contact with tissue.
    pub const IN_CONTACT: u32 = 1 << 2;
    /// The membrane has given way.
    pub const PUNCTURED: u32 = 1 << 3;
    /// The device is a simulation.
    pub const SIMULATED_DEVICE: u32 = 1 << 4;
    /// The hand has reached its last goal.
    pub const AT_GOAL: u32 = 1 << 5;
    /// The gate limited this tick's force.
    pub const GATE_ACTED: u32 = 1 << 6;
    /// Engaged, but the force is still too large to begin with: move the needle until it is small.
    pub const WAITING: u32 = 1 << 7;
    /// The tissue answers along lines that are prepared while the needle is outside: unless [`LINE_READY`] is set
    /// before it goes in, the insertion runs without a line.
    pub const LINE_NEEDED: u32 = 1 << 8;
    /// The needle is on a prepared line.
    pub const LINE_READY: u32 = 1 << 9;
    /// The linear answer of the tissue near the tip is folded in this tick: it is not physical.
    pub const FOLDED: u32 = 1 << 10;
    /// No needle in hand: it has left one in the tissue and is not out yet, or is on the path of one that stays in.
    /// Contact and force are disabled.
    pub const HAND_EMPTY: u32 = 1 << 11;
    /// The hand moves for a host, or waits for its renewal ([`crate::Request::KeepMoving`]).
    pub const IN_MOTION: u32 = 1 << 12;
}

coded!(
    /// Reason why the force is off, by stable number.
    #[derive(IntoPrimitive, Serialize, Deserialize)]
    #[serde(try_from = "u32", into = "u32")]
    Fault:

    /// The force may be on.
    None = 0, "no fault";
    /// The device does not answer.
    DeviceSilent = 1, "the device stopped answering; check its cable, then re-arm";
    /// The device reported an error.
    DeviceError = 2, "the device reported an error; check it, then re-arm";
    /// The device reported a position that is not a number.
    NonFiniteInput = 3, "the device sent a position that is not a number; re-arm to go on";
    /// The force law gave a value that is not a number.
    NonFiniteForce = 4, "the force law gave a value that is not a number; reset the parameters, then re-arm";
    /// No answer of the tissue loop for 100 ms.
    TissueStale = 5, "the tissue step is late by more than 100 ms; lower the load on its core, then re-arm";
    /// The tissue's constraints were not met.
    TissueUnsolved = 6, "the tissue constraints could not be met; draw needle or probe back, then re-arm";
    /// 20 deadlines missed in a row.
    OverrunStreak = 7, "the force loop missed 20 deadlines in a row; lower the load on its core, then re-arm";
    /// The force loop has stopped unasked.
    LoopStopped = 8, "the force loop stood still for too long; lower the load on its core, then re-arm";
    /// The device is disconnected.
    DeviceLost = 9, "the device is not connected; check power and cable, wait until it is found again, then re-arm";
    /// The device is not calibrated.
    DeviceNotCalibrated = 10,
        "the device is not calibrated: stylus into the inkwell, or arm in neutral pose and press its button; then \
         re-arm";
    /// The motors are too warm.
    DeviceWarm = 11, "the motors of the device are too warm; let them cool for some minutes, then re-arm";
    /// The device stopped at one of its limits.
    DeviceStopped = 12, "the device stopped itself at a limit of force or speed; move slower, then re-arm";
);
