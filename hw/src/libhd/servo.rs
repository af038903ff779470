//! The callback that the driver runs each servo tick: reads the pose, writes the force, drains the
//! errors.
//!
//! It runs in a thread that the driver makes. Once that thread is armed, it does not allocate, lock
//! or log, and it never unwinds into the driver.

use core::cell::UnsafeCell;
use core::ffi::c_void;
use core::sync::atomic::{AtomicBool, Ordering};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use nalgebra::Vector3;

use crate::convert::{millinewton_metres_from_newton_metres, pose_from_column_major_mm};
use crate::device::{DeviceFault, Sample, Wrench};
use crate::driver_thread::arm::{Arm, ArmError};
use crate::driver_thread::ends::ServoEnd;
use crate::driver_thread::hold::Hold;
use crate::driver_thread::shared::Shared;
use crate::libhd::errors::{self, Response};
use crate::libhd::exchange::{Exchange, Served};
use crate::libhd::ffi::{Api, CALLBACK_CONTINUE, CALLBACK_DONE, parameter};
use crate::libhd::frame::{gimbal_torque_nm, within_joint_limits};
use crate::libhd::model::GIMBAL_TORQUE_LIMITS_NM;
use crate::placement::Placement;

/// Share of the motors' temperature limit at which the force turns off, until they are below
/// `COOL`.
const HOT: f64 = 0.95;
const COOL: f64 = 0.80;
const TICKS_BETWEEN_TEMPERATURES: u64 = 100;
/// Most errors read in one tick; the others wait for the next.
const MAX_ERRORS_PER_TICK: usize = 16;

/// Callback and its state. Lives until the process ends, because a driver may call once more after
/// it was stopped.
pub struct Servo {
    pub exchange: Exchange,
    /// Result of arming the newest servo thread, until the connector takes it.
    pub armed: std::sync::Mutex<Option<Result<String, ArmError>>>,
    busy: AtomicBool,
    inner: UnsafeCell<Inner>,
}

// SAFETY: `inner`, which is `Send`, is used only by the one thread that has set `busy`; all other fields are `Sync`.
unsafe impl Sync for Servo {}

/// Ports and settings of a servo tick, and its state.
pub struct Inner {
    pub api: Api,
    pub placement: Placement,
    pub arm: Arm,
    pub end: ServoEnd,
    pub servo_hz: u32,
    pub state: State,
}

/// State carried from one servo tick to the next.
#[derive(Default)]
pub struct State {
    sequence: u64,
    hold: Hold,
    hot: bool,
}

impl Servo {
    pub fn new(inner: Inner, shared: Arc<Shared>) -> Self {
        Self {
            exchange: Exchange::new(shared),
            armed: std::sync::Mutex::new(None),
            busy: AtomicBool::new(false),
            inner: UnsafeCell::new(inner),
        }
    }

    /// Serves one tick of the scheduler; its context is a `&'static Servo`.
    ///
    /// # Safety
    ///
    /// `context` points to a [`Servo`] that is never freed.
    pub unsafe extern "system" fn callback(context: *mut c_void) -> u32 {
        // SAFETY: by the function's contract.
        let servo = unsafe { &*context.cast::<Self>() };
        // SYNC: acquire pairs with the release store at the end of this function: a callback sees what the last one
        // left, whichever thread ran it.
        if servo.busy.swap(true, Ordering::Acquire) {
            return CALLBACK_DONE;
        }
        // SAFETY: `busy` was clear, so no other thread is in here.
        let inner = unsafe { &mut *servo.inner.get() };
        let result = catch_unwind(AssertUnwindSafe(|| inner.tick(servo)));
        if let Err(payload) = result {
            // Dropping the payload could unwind once more.
            core::mem::forget(payload);
            inner.lose(&servo.exchange.shared, DeviceFault::Driver);
            inner.write_zero(&servo.exchange);
        }
        // SYNC: release pairs with the acquire swap above.
        servo.busy.store(false, Ordering::Release);
        CALLBACK_CONTINUE
    }
}

impl Inner {
    /// Runs one servo tick, in the order of the data.
    fn tick(&mut self, servo: &Servo) {
        let exchange = &servo.exchange;
        let shared = &*exchange.shared;
        let calls = shared.count_tick();
        // Checked before `take_arm`, so that only an armed thread serves, and again after arming,
        // which takes time.
        let may_serve = exchange.served().is_some();
        if exchange.take_arm() {
            self.begin(servo);
        }
        let Some(served) = exchange.served().filter(|_| may_serve) else {
            self.write_zero(exchange);
            self.discard_errors();
            exchange.count_released();
            return;
        };
        // SAFETY: the handle is the driver's own.
        unsafe { (self.api.hdBeginFrame)(served.handle) };
        let transform = self.read_pose();
        self.read_temperature(calls);
        let wrench = self.state.hold.wrench(self.end.commands.read(), self.servo_hz);
        self.exert(served, &wrench, &transform);
        // SAFETY: the handle is the driver's own.
        unsafe { (self.api.hdEndFrame)(served.handle) };
        self.drain_errors(shared);
        shared.fault.set(self.state.hold.end_tick(self.servo_hz));
    }

    /// Begins the first tick of a servo thread.
    fn begin(&mut self, servo: &Servo) {
        self.state = State {
            sequence: self.state.sequence,
            ..State::default()
        };
        // Before the thread is armed it may lock and allocate.
        let granted = (self.arm)();
        if granted.is_err() {
            // A thread without its rights exerts no force, until the connector stops it.
            self.lose(&servo.exchange.shared, DeviceFault::Driver);
        }
        *servo.armed.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(granted);
    }

    fn read_pose(&mut self) -> [f64; 16] {
        let (mut transform, mut velocity, mut buttons) = ([0.0; 16], [0.0; 3], 0);
        // SAFETY: each buffer has the size that the interface states for its parameter.
        unsafe {
            (self.api.hdGetDoublev)(parameter::TRANSFORM, transform.as_mut_ptr());
            (self.api.hdGetDoublev)(parameter::VELOCITY, velocity.as_mut_ptr());
            (self.api.hdGetIntegerv)(parameter::BUTTONS, &mut buttons);
        }
        match pose_from_column_major_mm(&transform) {
            Some((tip_in_device, device_from_stylus)) if velocity.iter().all(|v| v.is_finite()) => {
                let (tip_in_world, world_from_tool) = self.placement.pose(&tip_in_device, &device_from_stylus);
                self.state.sequence += 1;
                self.end.samples.write(Some(Sample {
                    tip_in_world,
                    world_from_tool,
                    buttons: buttons as u32,
                    sequence: self.state.sequence,
                }));
            }
            _ => self.state.hold.pause(DeviceFault::NonFiniteSample),
        }
        transform
    }

    fn read_temperature(&mut self, calls: u64) {
        if calls.is_multiple_of(TICKS_BETWEEN_TEMPERATURES) {
            let mut motors = [0.0; 6];
            // SAFETY: the driver writes three or six numbers.
            unsafe { (self.api.hdGetDoublev)(parameter::MOTOR_TEMPERATURE, motors.as_mut_ptr()) };
            let warmest = motors.iter().copied().fold(0.0, f64::max);
            self.state.hot = warmest >= if self.state.hot { COOL } else { HOT };
        }
        if self.state.hot {
            self.state.hold.pause(DeviceFault::Overheated);
        }
    }

    fn exert(&self, served: Served, wrench: &Wrench, transform: &[f64; 16]) {
        let force_n = self.placement.to_device(&wrench.force_n);
        // SAFETY: three numbers, as the interface states.
        unsafe { (self.api.hdSetDoublev)(parameter::FORCE, force_n.as_ptr()) };
        if served.torques {
            self.exert_torque(&self.placement.to_device(&wrench.torque_nm), transform);
        }
    }

    fn exert_torque(&self, torque_nm: &Vector3<f64>, transform: &[f64; 16]) {
        let mut joints_nm = [0.0; 3];
        if let Some((_, device_from_stylus)) = pose_from_column_major_mm(transform)
            && *torque_nm != Vector3::zeros()
        {
            let mut angles = [0.0; 3];
            // SAFETY: three numbers, as the interface states.
            unsafe { (self.api.hdGetDoublev)(parameter::GIMBAL_ANGLES, angles.as_mut_ptr()) };
            if angles.iter().all(|a| a.is_finite()) {
                joints_nm = gimbal_torque_nm(torque_nm, &device_from_stylus, angles);
            }
        }
        let joints_nm = within_joint_limits(joints_nm, &GIMBAL_TORQUE_LIMITS_NM);
        let joints_mnm = millinewton_metres_from_newton_metres(&Vector3::from(joints_nm));
        // SAFETY: three numbers, as the interface states.
        unsafe { (self.api.hdSetDoublev)(parameter::GIMBAL_TORQUE, joints_mnm.as_ptr()) };
    }

    fn drain_errors(&mut self, shared: &Shared) {
        for _ in 0..MAX_ERRORS_PER_TICK {
            // SAFETY: no preconditions.
            let error = unsafe { (self.api.hdGetError)() };
            if error.code == errors::SUCCESS {
                return;
            }
            shared.errors.note(error.code);
            let known = errors::known(error.code);
            match known.response {
                Response::Pause => self.state.hold.pause(known.fault),
                Response::Reconnect => self.lose(shared, known.fault),
            }
        }
    }

    /// Discards the errors of a released device.
    fn discard_errors(&self) {
        for _ in 0..MAX_ERRORS_PER_TICK {
            // SAFETY: no preconditions.
            if unsafe { (self.api.hdGetError)() }.code == errors::SUCCESS {
                return;
            }
        }
    }

    /// Declares the connection lost.
    fn lose(&mut self, shared: &Shared, fault: DeviceFault) {
        self.state.hold.lose(fault);
        shared.fault.set(Some(fault));
        shared.errors.set_lost();
    }

    /// Writes zero force and torque, whatever the state of the device.
    fn write_zero(&self, exchange: &Exchange) {
        let served = exchange.last_served();
        let zero = [0.0; 3];
        // SAFETY: the handle is the driver's own, three numbers each.
        unsafe {
            (self.api.hdBeginFrame)(served.handle);
            (self.api.hdSetDoublev)(parameter::FORCE, zero.as_ptr());
            if served.torques {
                (self.api.hdSetDoublev)(parameter::GIMBAL_TORQUE, zero.as_ptr());
            }
            (self.api.hdEndFrame)(served.handle);
        }
    }
}
