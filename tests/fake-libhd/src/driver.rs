//! State of the faked driver and its device: a simulated Phantom in the frame and the units of the vendor.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use nalgebra::{UnitQuaternion, Vector3};
use stylet_hw::{Device, HandGoal, SimulatedPhantom, SimulatedPhantomConfig, Wrench};

use crate::control::{Block, Control, FORCES_KEPT, VARIABLE, get, put};
// SYNC: relaxed unless stated otherwise; see `Control`.
use std::sync::atomic::Ordering::{Acquire, Relaxed};

pub const HANDLE: u32 = 7;
const MAX_CALLBACKS: usize = 8;

pub struct Callback {
    pub id: u64,
    pub function: unsafe extern "C" fn(*mut core::ffi::c_void) -> u32,
    pub context: usize,
}

pub struct Driver {
    pub open: bool,
    /// The cable was unplugged; only disabling and initialising repairs it.
    pub broken: bool,
    pub in_frame: bool,
    pub errors: Vec<u32>,
    pub enabled: Vec<u32>,
    pub rate_hz: u64,
    pub callbacks: Vec<Callback>,
    pub next_id: u64,
    pub force_n: [f64; 3],
    pub torque_mnm: [f64; 3],
    hand: SimulatedPhantom,
    goal_number: u32,
    velocity_m_per_s: [f64; 3],
}

pub fn control() -> &'static Control {
    static CONTROL: OnceLock<&'static Control> = OnceLock::new();
    CONTROL.get_or_init(|| Control::of_environment(VARIABLE))
}

pub fn driver() -> MutexGuard<'static, Driver> {
    static DRIVER: OnceLock<Mutex<Driver>> = OnceLock::new();
    let driver = DRIVER.get_or_init(|| Mutex::new(Driver::new()));
    driver.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Driver {
    fn new() -> Self {
        Self {
            open: false,
            broken: false,
            in_frame: false,
            errors: Vec::new(),
            enabled: Vec::new(),
            rate_hz: 1000,
            callbacks: Vec::new(),
            next_id: 1,
            force_n: [0.0; 3],
            torque_mnm: [0.0; 3],
            hand: SimulatedPhantom::new(SimulatedPhantomConfig::default()),
            goal_number: 0,
            velocity_m_per_s: [0.0; 3],
        }
    }

    /// Pushes an error onto the stack; a full stack drops the oldest.
    pub fn raise(&mut self, code: u32) {
        if self.errors.len() == 32 {
            self.errors.remove(0);
        }
        self.errors.push(code);
    }

    pub fn schedule(&mut self, function: unsafe extern "C" fn(*mut core::ffi::c_void) -> u32, context: usize) -> u64 {
        if self.callbacks.len() == MAX_CALLBACKS {
            self.raise(0x0501);
            return 0;
        }
        let id = self.next_id;
        self.next_id += 1;
        self.callbacks.push(Callback { id, function, context });
        id
    }

    /// Moves the hand by one tick under the force of the previous tick.
    pub fn advance(&mut self) {
        let c = control();
        let tick = c.ticks.fetch_add(1, Relaxed);
        for axis in 0..3 {
            put(&c.force_n[axis], self.force_n[axis]);
            put(&c.torque_mnm[axis], self.torque_mnm[axis]);
            put(&c.forces_n[tick as usize % FORCES_KEPT][axis], self.force_n[axis]);
        }
        // SYNC: acquire pairs with the release in `send_hand`.
        let number = c.goal_number.load(Acquire);
        if number != self.goal_number {
            self.goal_number = number;
            self.hand.set_hand_goal(&HandGoal {
                tip_in_world: Vector3::from(c.goal_m.each_ref().map(get)),
                direction: -Vector3::z(),
                speed_m_per_s: get(&c.goal_speed_m_per_s),
                acceleration_m_per_s2: 2.0,
            });
        }
        let felt = if self.force_is_on() { self.force_n } else { [0.0; 3] };
        let _ = self.hand.write(&Wrench::from_force(Vector3::from(felt)));
        let period_s = 1.0 / self.rate_hz as f64;
        let before = *self.hand.true_tip_in_world();
        if let Ok(sample) = self.hand.read(period_s) {
            self.velocity_m_per_s = ((self.hand.true_tip_in_world() - before) / period_s).into();
            for axis in 0..3 {
                put(&c.tip_m[axis], sample.tip_in_world[axis]);
            }
        }
    }

    fn force_is_on(&self) -> bool {
        self.enabled.contains(&0x4000) && control().no_force.load(Relaxed) == 0
    }

    /// Raises the error of a force that the motors refuse, and records the largest force.
    pub fn check_force(&mut self) {
        let size = Vector3::from(self.force_n).norm();
        if size > get(&control().peak_force_n) {
            put(&control().peak_force_n, size);
        }
        if !size.is_finite() {
            control().non_finite_forces.fetch_add(1, Relaxed);
            self.raise(0x0204);
            self.force_n = [0.0; 3];
        } else if size > self.max_force_n() * (1.0 + 1e-9) {
            self.raise(0x0201);
            self.force_n = [0.0; 3];
        }
    }

    pub fn max_force_n(&self) -> f64 {
        if control().model.load(Relaxed) == 2 { 3.3 } else { 8.5 }
    }

    pub fn is_absent(&self) -> bool {
        self.broken || control().unplugged.load(Relaxed) != 0
    }

    fn orientation(&self) -> UnitQuaternion<f64> {
        let [turn, lift, roll] = control().gimbal_rad.each_ref().map(get);
        let about = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
        about(-Vector3::y(), turn) * about(-Vector3::x(), lift) * about(-Vector3::z(), roll)
    }

    /// Returns a parameter of real numbers, in the driver's units; `None` if it has none.
    pub fn reals(&self, parameter: u32) -> Option<Vec<f64>> {
        let c = control();
        let nan = c.nan.load(Relaxed);
        let tip_mm = c.tip_m.each_ref().map(|x| get(x) * 1000.0);
        let spoilt = |values: &[f64], by: u32| -> Vec<f64> {
            if nan == by {
                vec![f64::NAN; values.len()]
            } else {
                values.to_vec()
            }
        };
        Some(match parameter {
            0x2050 => spoilt(&tip_mm, 1),
            0x2051 => spoilt(&self.velocity_m_per_s.map(|v| v * 1000.0), 2),
            0x2052 if self.is_absent() || c.uncalibrated.load(Relaxed) != 0 => vec![0.0; 16],
            0x2052 => {
                let mut pose = self.orientation().to_homogeneous();
                for axis in 0..3 {
                    pose[(axis, 3)] = tip_mm[axis];
                }
                spoilt(pose.as_slice(), 1)
            }
            0x2053 | 0x2100 => vec![0.0; 3],
            0x2150 => spoilt(&c.gimbal_rad.each_ref().map(get), 3),
            0x2505 => vec![1.5],
            0x2550 | 0x2551 => vec![-190.0, -133.0, -95.0, 190.0, 133.0, 95.0],
            0x2601 => vec![self.rate_hz as f64],
            0x2602 => vec![0.5],
            0x2603 => vec![self.max_force_n()],
            0x2604 => vec![if c.model.load(Relaxed) == 2 { 0.88 } else { 1.4 }],
            0x2605 => vec![f64::from(c.temperature_milli.load(Relaxed)) / 1000.0; 6],
            0x2606 => vec![10_000.0],
            0x2700 => self.force_n.to_vec(),
            0x2703 => vec![0.0; 3],
            0x2704 => self.torque_mnm.to_vec(),
            _ => return None,
        })
    }

    pub fn ints(&self, parameter: u32) -> Option<Vec<i32>> {
        let c = control();
        Some(match parameter {
            0x2000 if c.buttons_count.load(Relaxed) != 0 => vec![c.ticks.load(Relaxed) as i32],
            0x2000 => vec![c.buttons.load(Relaxed) as i32],
            0x2553 => vec![6],
            0x2554 => vec![if c.model.load(Relaxed) == 0 { 6 } else { 3 }],
            0x2555 => vec![style() as i32],
            0x2600 => vec![self.rate_hz as i32],
            0x2900 => vec![0],
            _ => return None,
        })
    }
}

/// Calibration style of the device.
pub fn style() -> u32 {
    match control().calibration_style.load(Relaxed) {
        0 => 1,
        style => style,
    }
}
