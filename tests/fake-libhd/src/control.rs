//! Commands of a test to the fake, and reports of the fake to the test: one block of atomics.
//!
//! A block of zeros is a healthy, calibrated Premium 1.5 6DOF that does not move.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

pub use fake_control::{Block, get, put};

/// Number of ticks whose force is kept.
pub const FORCES_KEPT: usize = 1 << 15;
/// Number of calls outside the servo thread whose order is kept.
pub const CALLS_KEPT: usize = 4096;
/// Environment variable with the file of the block, for a fake in another process.
pub const VARIABLE: &str = "FAKE_LIBHD_CONTROL";

/// The block. Arrays `fail`, `fail_times` and `calls` are indexed as [`FUNCTIONS`](crate::table::FUNCTIONS).
// SYNC: every value is independent, so each access is relaxed; its partner is the other side's access of the same
// field. `goal_number` is the exception: see `send_hand`.
#[repr(C)]
pub struct Control {
    // Commands of the test:
    /// Error that the next `fail_times` calls of a function raise, instead of having an effect.
    pub fail: [AtomicU32; 36],
    /// Number of calls that fail, by function.
    pub fail_times: [AtomicU32; 36],
    /// 1: the cable is unplugged.
    pub unplugged: AtomicU32,
    /// Only this name is known: 0 any, 1 "Default PHANToM", 2 "Default Device", 3 none given.
    pub only_name: AtomicU32,
    /// 0 Premium 1.5 6DOF, 1 Premium 1.5, 2 Omni, 3 an unknown one.
    pub model: AtomicU32,
    /// 0 calibrated, 1 not.
    pub uncalibrated: AtomicU32,
    /// Bits as the interface has them; 0 is an encoder reset.
    pub calibration_style: AtomicU32,
    /// 1: the stylus is in the inkwell.
    pub in_inkwell: AtomicU32,
    /// 1: the arm is in its neutral pose.
    pub in_neutral_pose: AtomicU32,
    /// One bit per button.
    pub buttons: AtomicU32,
    /// 1: the buttons show the number of the tick instead.
    pub buttons_count: AtomicU32,
    /// 1: the scheduler runs without calling any callback.
    pub stalled: AtomicU32,
    /// Delay of each tick.
    pub late_us: AtomicU32,
    /// 1 the pose, 2 the velocity, 3 the gimbal angles are not numbers.
    pub nan: AtomicU32,
    /// 1: each frame raises the error for warm motors.
    pub warm_motors: AtomicU32,
    /// Temperature of the motors as a fraction of their limit, in thousandths.
    pub temperature_milli: AtomicU32,
    /// Error that the end of the next frame raises once.
    pub error_in_frame: AtomicU32,
    /// 1: the force stays off whatever is enabled.
    pub no_force: AtomicU32,
    /// Changed by the test after it has written a goal and a speed.
    pub goal_number: AtomicU32,
    /// Goal of the hand, m, device frame.
    pub goal_m: [AtomicU64; 3],
    /// Speed of the hand, as `f64` bits, like all 64-bit values that are not counts.
    pub goal_speed_m_per_s: AtomicU64,
    /// Angles of the gimbal: turn, lift, roll.
    pub gimbal_rad: [AtomicU64; 3],
    // Reports of the fake:
    /// Number of calls, by function.
    pub calls: [AtomicU64; 36],
    /// Number of servo ticks.
    pub ticks: AtomicU64,
    /// Number of successful initialisations.
    pub inits: AtomicU32,
    /// 1: calibrated in another pose than the neutral one.
    pub miscalibrated: AtomicU32,
    /// Force of the last tick, N, as the program set it.
    pub force_n: [AtomicU64; 3],
    /// Torques of the gimbal joints in the last tick, mN m.
    pub torque_mnm: [AtomicU64; 3],
    /// Largest force so far, N.
    pub peak_force_n: AtomicU64,
    /// Number of frames with a force that was not finite.
    pub non_finite_forces: AtomicU64,
    /// Force when the scheduler was last stopped, N.
    pub force_at_stop_n: AtomicU64,
    /// Position of the tip, m, device frame.
    pub tip_m: [AtomicU64; 3],
    /// Number of calls outside the servo thread.
    pub call_count: AtomicU64,
    /// The functions of those calls, in their order.
    pub call_order: [AtomicU32; CALLS_KEPT],
    /// Forces of the last ticks, N.
    pub forces_n: [[AtomicU64; 3]; FORCES_KEPT],
}

// SAFETY: atomics of 4 and 8 bytes, and arrays of them.
unsafe impl Block for Control {
    const EXPORT: &str = "fake_hd_control";
}

impl Control {
    /// Makes the next `times` calls of `function` fail.
    pub fn fail(&self, function: &str, code: u32, times: u32) {
        let index = index_of(function);
        // SYNC: relaxed; see `Control`. A test sets the failure before it makes the call.
        self.fail[index].store(code, Ordering::Relaxed);
        self.fail_times[index].store(times, Ordering::Relaxed);
    }

    /// Number of calls of `function`.
    pub fn calls_of(&self, function: &str) -> u64 {
        // SYNC: relaxed; see `Control`.
        self.calls[index_of(function)].load(Ordering::Relaxed)
    }

    /// Sends the hand to `goal_m` (m, device frame).
    pub fn send_hand(&self, goal_m: [f64; 3], speed_m_per_s: f64) {
        for (cell, value) in self.goal_m.iter().zip(goal_m) {
            put(cell, value);
        }
        put(&self.goal_speed_m_per_s, speed_m_per_s);
        // SYNC: release pairs with the acquire in `Driver::advance`: the servo thread sees the whole goal.
        self.goal_number.fetch_add(1, Ordering::Release);
    }

    /// Returns the force of the last tick, N.
    pub fn force(&self) -> [f64; 3] {
        self.force_n.each_ref().map(get)
    }

    /// Returns the force set by the callback of `tick`, N; kept for the last `FORCES_KEPT` ticks.
    pub fn force_at(&self, tick: u64) -> [f64; 3] {
        self.forces_n[tick as usize % FORCES_KEPT].each_ref().map(get)
    }

    /// Returns the names of the calls from outside the servo thread.
    pub fn order(&self) -> Vec<&'static str> {
        // SYNC: relaxed; see `Control`.
        let count = self.call_count.load(Ordering::Relaxed) as usize;
        let order = self.call_order.iter().take(count.min(CALLS_KEPT));
        order
            .map(|i| crate::table::FUNCTIONS[i.load(Ordering::Relaxed) as usize])
            .collect()
    }
}

pub(crate) fn index_of(function: &str) -> usize {
    let found = crate::table::FUNCTIONS.iter().position(|name| *name == function);
    found.expect("a function of the interface")
}
