//! What a test tells the fake, and what the fake tells a test: one block of atomics, in memory or in a file that both map.
//!
//! All zeros is a healthy, calibrated Premium 1.5 6DOF that nobody moves. SYNC: every value stands for itself; relaxed.

use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Ticks of which the force is kept.
pub const FORCES_KEPT: usize = 1 << 15;
/// Calls outside the servo thread of which the order is kept.
pub const CALLS_KEPT: usize = 4096;
/// Names the file of the block for a fake in another process.
pub const VARIABLE: &str = "FAKE_LIBHD_CONTROL";

#[repr(C)]
pub struct Control {
    // The test commands:
    /// By function: the error that its next `fail_times` calls give, instead of doing anything.
    pub fail: [AtomicU32; 36],
    pub fail_times: [AtomicU32; 36],
    pub unplugged: AtomicU32,
    /// Only this name is known: 0 any, 1 "Default PHANToM", 2 "Default Device", 3 none given.
    pub only_name: AtomicU32,
    /// 0 Premium 1.5 6DOF, 1 Premium 1.5, 2 Omni, 3 one that nobody knows.
    pub model: AtomicU32,
    /// 0 calibrated, 1 not.
    pub uncalibrated: AtomicU32,
    /// Bits as the interface has them; 0 is an encoder reset.
    pub calibration_style: AtomicU32,
    pub in_inkwell: AtomicU32,
    pub in_neutral_pose: AtomicU32,
    pub buttons: AtomicU32,
    /// The buttons show the number of the tick instead.
    pub buttons_count: AtomicU32,
    /// The scheduler runs and calls nobody.
    pub stalled: AtomicU32,
    /// Each tick is late by so much.
    pub late_us: AtomicU32,
    /// 1 the pose, 2 the velocity, 3 the gimbal angles are not numbers.
    pub nan: AtomicU32,
    pub warm_motors: AtomicU32,
    /// Share of what the motors bear, in thousandths.
    pub temperature_milli: AtomicU32,
    /// Raised once, by the end of the next frame.
    pub error_in_frame: AtomicU32,
    /// Force stays off whatever is enabled.
    pub no_force: AtomicU32,
    /// Changed by the test after it has written a goal (m, device frame) and a speed.
    pub goal_number: AtomicU32,
    pub goal_m: [AtomicU64; 3],
    pub goal_speed_m_per_s: AtomicU64,
    /// Gimbal: turn, lift, roll.
    pub gimbal_rad: [AtomicU64; 3],
    // The fake reports:
    pub calls: [AtomicU64; 36],
    pub ticks: AtomicU64,
    pub inits: AtomicU32,
    /// Calibrated in another pose than the neutral one.
    pub miscalibrated: AtomicU32,
    /// Of the last tick, N, as the driver was told.
    pub force_n: [AtomicU64; 3],
    pub torque_mnm: [AtomicU64; 3],
    /// Largest that was ever told, N.
    pub peak_force_n: AtomicU64,
    pub non_finite_forces: AtomicU64,
    /// When the scheduler was last stopped.
    pub force_at_stop_n: AtomicU64,
    /// Tip, m, device frame.
    pub tip_m: [AtomicU64; 3],
    pub call_count: AtomicU64,
    pub call_order: [AtomicU32; CALLS_KEPT],
    pub forces_n: [[AtomicU64; 3]; FORCES_KEPT],
}

pub fn put(cell: &AtomicU64, value: f64) {
    cell.store(value.to_bits(), Ordering::Relaxed);
}

pub fn get(cell: &AtomicU64) -> f64 {
    f64::from_bits(cell.load(Ordering::Relaxed))
}

impl Control {
    /// A block of zeros that lives until the process ends.
    pub fn in_memory() -> &'static Self {
        let memory = memmap2::MmapMut::map_anon(size_of::<Self>()).expect("memory for the block");
        Self::at(memory)
    }

    /// The block in `file`, which is made when it is not there.
    pub fn in_file(file: &Path) -> &'static Self {
        let mut options = std::fs::OpenOptions::new();
        let opened = options.read(true).write(true).create(true).truncate(false).open(file);
        let opened = opened.expect("the control file can be opened");
        opened
            .set_len(size_of::<Self>() as u64)
            .expect("the control file can grow");
        // SAFETY: both sides use the file through atomics alone.
        Self::at(unsafe { memmap2::MmapMut::map_mut(&opened) }.expect("the control file can be mapped"))
    }

    fn at(memory: memmap2::MmapMut) -> &'static Self {
        let start = Box::leak(Box::new(memory)).as_ptr();
        // SAFETY: the map is never dropped, has this size, begins on a page, and every bit pattern is valid.
        unsafe { &*start.cast::<Self>() }
    }

    /// All zeros: healthy, and nothing counted yet.
    pub fn reset(&self) {
        let start = core::ptr::from_ref(self).cast::<AtomicU32>();
        for word in 0..size_of::<Self>() / size_of::<AtomicU32>() {
            // SAFETY: the block is made of atomics, and this stays inside it.
            unsafe { &*start.add(word) }.store(0, Ordering::Relaxed);
        }
    }

    /// The next `times` calls of `function` fail.
    pub fn fail(&self, function: &str, code: u32, times: u32) {
        let index = index_of(function);
        self.fail[index].store(code, Ordering::Relaxed);
        self.fail_times[index].store(times, Ordering::Relaxed);
    }

    pub fn calls_of(&self, function: &str) -> u64 {
        self.calls[index_of(function)].load(Ordering::Relaxed)
    }

    /// Sends the hand to `goal_m` (device frame).
    pub fn send_hand(&self, goal_m: [f64; 3], speed_m_per_s: f64) {
        for (cell, value) in self.goal_m.iter().zip(goal_m) {
            put(cell, value);
        }
        put(&self.goal_speed_m_per_s, speed_m_per_s);
        // SYNC: release, so that the servo thread sees the whole goal.
        self.goal_number.fetch_add(1, Ordering::Release);
    }

    /// Of the last tick, N.
    pub fn force(&self) -> [f64; 3] {
        self.force_n.each_ref().map(get)
    }

    /// What the callback of `tick` told, N; kept for the last `FORCES_KEPT` ticks.
    pub fn force_at(&self, tick: u64) -> [f64; 3] {
        self.forces_n[tick as usize % FORCES_KEPT].each_ref().map(get)
    }

    /// Names of the calls that came from outside the servo thread.
    pub fn order(&self) -> Vec<&'static str> {
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
