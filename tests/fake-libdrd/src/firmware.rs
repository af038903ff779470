//! State of the faked SDK and of the device behind it.

// SYNC: relaxed throughout; see `Block`.
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Instant;

use crate::control::{Block, Control, VARIABLE, get, put};

pub const ID: i8 = 0;

#[derive(Default)]
pub struct Firmware {
    pub open: bool,
    /// The cable was unplugged; only closing and reopening repairs it.
    pub broken: bool,
    pub expert: bool,
    pub off_cause: i32,
    pub pose: ([f64; 3], [[f64; 3]; 3]),
    pub last_status: Vec<i32>,
}

pub fn control() -> &'static Control {
    static CONTROL: OnceLock<&'static Control> = OnceLock::new();
    CONTROL.get_or_init(|| Control::of_environment(VARIABLE))
}

pub fn firmware() -> MutexGuard<'static, Firmware> {
    static FIRMWARE: OnceLock<Mutex<Firmware>> = OnceLock::new();
    let firmware = FIRMWARE.get_or_init(Mutex::default);
    firmware.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Time of the firmware.
pub fn now_us() -> u64 {
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    match control().now_us.load(Relaxed) {
        0 => BEGUN.get_or_init(Instant::now).elapsed().as_micros() as u64 + 1,
        now => now,
    }
}

impl Firmware {
    /// Advances the firmware's own behaviour.
    pub fn advance(&mut self) {
        let c = control();
        match c.turn_off.swap(0, Relaxed) {
            0 => {}
            cause => self.turn_off(cause as i32),
        }
        if c.force_mode.load(Relaxed) != 0 && c.is_dropped(now_us()) {
            self.turn_off(3);
        }
        if c.unplugged.load(Relaxed) != 0 {
            self.broken = true;
        }
    }

    pub fn turn_off(&mut self, cause: i32) {
        control().force_mode.store(0, Relaxed);
        self.off_cause = cause;
    }

    /// Takes a force, and records it.
    pub fn command(&mut self, values: [f64; 6]) {
        let c = control();
        let [x, y, z, ..] = values;
        let size = (x * x + y * y + z * z).sqrt();
        if values.iter().any(|v| !v.is_finite()) {
            c.non_finite_forces.fetch_add(1, Relaxed);
            return;
        }
        if size > get(&c.peak_force_n) {
            put(&c.peak_force_n, size);
        }
        for (cell, value) in c.commanded.iter().zip(values) {
            put(cell, value);
        }
        c.commanded_us.store(now_us(), Relaxed);
    }

    /// Returns the pose of the device, or the one set by a command.
    pub fn read_pose(&mut self) -> ([f64; 3], [[f64; 3]; 3]) {
        let c = control();
        let (sin, cos) = get(&c.turn_rad).sin_cos();
        let about_y = [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]];
        let tip = c.tip_m.each_ref().map(get);
        let pose = match c.bad_pose.load(Relaxed) {
            1 => ([f64::NAN; 3], about_y),
            2 => (tip, [[0.3; 3]; 3]),
            3 => ([1e6; 3], about_y),
            _ => (tip, about_y),
        };
        if c.frozen.load(Relaxed) == 0 {
            self.pose = pose;
        }
        self.pose
    }

    /// Returns the state of the device as reported by the SDK.
    pub fn status(&mut self) -> Vec<i32> {
        if control().frozen.load(Relaxed) == 0 || self.last_status.is_empty() {
            self.last_status = self.read_status();
        }
        self.last_status.clone()
    }

    fn read_status(&self) -> Vec<i32> {
        let c = control();
        let count = match c.status_count.load(Relaxed) {
            0 => 17,
            count => count as usize,
        };
        let plugged = i32::from(!self.broken);
        let mut numbers = vec![0; count];
        let force = c.force_mode.load(Relaxed) as i32;
        let known = [
            plugged,
            plugged,
            1,
            0,
            0,
            force,
            1 - force,
            force,
            1,
            0,
            1,
            0,
            1,
            0,
            self.off_cause,
            0,
            0,
        ];
        for (place, number) in numbers.iter_mut().zip(known) {
            *place = number;
        }
        let place = c.status_place.load(Relaxed) as usize;
        if let Some(cell) = place.checked_sub(1).and_then(|place| numbers.get_mut(place)) {
            *cell = c.status_number.load(Relaxed);
        }
        numbers
    }
}
