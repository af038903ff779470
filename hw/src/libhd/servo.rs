//! The callback that the driver runs each servo tick: pose out, force in, errors drained.
//!
//! It runs in a thread that the driver makes. It allocates, locks and logs nothing once that thread is armed, and never
//! unwinds into the driver.

use core::cell::UnsafeCell;
use core::ffi::c_void;
use core::sync::atomic::{AtomicBool, Ordering};
use std::panic::{AssertUnwindSafe, catch_unwind};

use nalgebra::Vector3;

use crate::convert::{metres_from_millimetres, millinewton_metres_from_newton_metres, pose_from_column_major_mm};
use crate::device::{DeviceFault, Sample, Wrench};
use crate::libhd::errors::{self, Severity};
use crate::libhd::exchange::{Command, Shared};
use crate::libhd::ffi::{Api, CALLBACK_CONTINUE, CALLBACK_DONE, parameter};
use crate::libhd::frame::{Placement, gimbal_torque_nm, within_joint_limits};
use crate::libhd::model::GIMBAL_TORQUE_LIMITS_NM;

/// A force that nobody renewed for so long is let go: whoever wrote it has stopped.
pub const DEAD_TIME_S: f64 = 0.1;
/// After a fault the force stays off until all has gone well for so long.
pub const QUIET_TIME_S: f64 = 0.5;
/// Motors at this share of what they bear turn the force off, until they are back at the lower one.
pub const HOT: f64 = 0.95;
pub const COOL: f64 = 0.80;
const TEMPERATURE_EVERY: u64 = 100;
/// More errors than this in one tick are left for the next.
const ERRORS_A_TICK: usize = 16;

/// Arms the calling thread; says what the kernel granted, or why it would not.
pub type Arm = Box<dyn Fn() -> Result<String, String> + Send + Sync>;

/// The callback and all that it owns. Lives until the process ends: a driver that calls once more after it was told
/// to stop still finds it.
pub struct Servo {
    pub shared: Shared,
    pub armed: std::sync::Mutex<Option<Result<String, String>>>,
    busy: AtomicBool,
    inner: UnsafeCell<Inner>,
}

// SAFETY: `inner` is used only by the one thread that has set `busy`; all else is made for sharing.
unsafe impl Sync for Servo {}

/// What a servo tick works with.
pub struct Inner {
    pub api: Api,
    pub placement: Placement,
    pub arm: Arm,
    pub samples: triple_buffer::Input<Option<Sample>>,
    pub commands: triple_buffer::Output<Command>,
    pub servo_hz: u32,
    pub state: State,
}

/// What one servo tick leaves for the next.
#[derive(Default)]
pub struct State {
    sequence: u64,
    trouble: Option<DeviceFault>,
    quiet: u32,
    command_number: u64,
    unrenewed: u32,
    hot: bool,
}

impl Servo {
    pub fn new(inner: Inner) -> Self {
        Self {
            shared: Shared::default(),
            armed: std::sync::Mutex::new(None),
            busy: AtomicBool::new(false),
            inner: UnsafeCell::new(inner),
        }
    }

    /// For the scheduler; its context is a `&'static Servo`.
    ///
    /// # Safety
    ///
    /// `context` points to a [`Servo`] that is never freed.
    pub unsafe extern "system" fn callback(context: *mut c_void) -> u32 {
        // SAFETY: by the function's contract.
        let servo = unsafe { &*context.cast::<Self>() };
        // SYNC: acquire pairs with the release below: one callback sees what the last one left.
        if servo.busy.swap(true, Ordering::Acquire) {
            return CALLBACK_DONE;
        }
        // SAFETY: `busy` was clear, so no other thread is in here.
        let inner = unsafe { &mut *servo.inner.get() };
        let ended = catch_unwind(AssertUnwindSafe(|| inner.tick(servo)));
        if let Err(payload) = ended {
            // Dropping the payload could unwind once more.
            core::mem::forget(payload);
            inner.lose(&servo.shared, DeviceFault::Driver);
            inner.let_go(&servo.shared);
        }
        servo.busy.store(false, Ordering::Release);
        CALLBACK_CONTINUE
    }
}

impl Inner {
    /// One servo tick; in the order of the data.
    fn tick(&mut self, servo: &Servo) {
        let shared = &servo.shared;
        let handle = shared.handle.load(Ordering::Relaxed);
        let calls = shared.calls.fetch_add(1, Ordering::Relaxed);
        if shared.arm.swap(false, Ordering::Relaxed) {
            self.begin(servo);
        }
        if shared.release.load(Ordering::Relaxed) || shared.lost.load(Ordering::Relaxed) {
            self.let_go(shared);
            self.discard_errors();
            shared.released.fetch_add(1, Ordering::Relaxed);
            return;
        }
        // SAFETY: the handle is the driver's own.
        unsafe { (self.api.hdBeginFrame)(handle) };
        let transform = self.take_pose(shared);
        self.take_temperature(shared, calls);
        let wrench = self.wrench();
        self.exert(shared, &wrench, &transform);
        // SAFETY: as above.
        unsafe { (self.api.hdEndFrame)(handle) };
        self.drain_errors(shared);
        self.settle(shared);
        // SAFETY: no preconditions.
        shared.note_callback_s(unsafe { (self.api.hdGetSchedulerTimeStamp)() });
    }

    /// The first tick of a servo thread.
    fn begin(&mut self, servo: &Servo) {
        self.state = State {
            sequence: self.state.sequence,
            ..State::default()
        };
        // Before the thread is armed it may lock and allocate.
        let granted = (self.arm)();
        *servo.armed.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(granted);
    }

    fn take_pose(&mut self, shared: &Shared) -> [f64; 16] {
        let (mut transform, mut velocity, mut buttons) = ([0.0; 16], [0.0; 3], 0);
        // SAFETY: each buffer has the size that the interface states for its parameter.
        unsafe {
            (self.api.hdGetDoublev)(parameter::TRANSFORM, transform.as_mut_ptr());
            (self.api.hdGetDoublev)(parameter::VELOCITY, velocity.as_mut_ptr());
            (self.api.hdGetIntegerv)(parameter::BUTTONS, &mut buttons);
        }
        let speed = metres_from_millimetres(&Vector3::from(velocity)).norm();
        match self.placement.pose(&transform) {
            Some((tip_in_world, world_from_tool)) if speed.is_finite() => {
                self.state.sequence += 1;
                shared.set_speed_m_per_s(speed);
                self.samples.write(Some(Sample {
                    tip_in_world,
                    world_from_tool,
                    buttons: buttons as u32,
                    sequence: self.state.sequence,
                }));
            }
            _ => self.pause(DeviceFault::NonFiniteSample),
        }
        transform
    }

    fn take_temperature(&mut self, shared: &Shared, calls: u64) {
        if calls.is_multiple_of(TEMPERATURE_EVERY) {
            let mut motors = [0.0; 6];
            // SAFETY: the driver writes three or six.
            unsafe { (self.api.hdGetDoublev)(parameter::MOTOR_TEMPERATURE, motors.as_mut_ptr()) };
            let warmest = motors.iter().copied().fold(0.0, f64::max);
            shared.set_temperature(warmest);
            self.state.hot = warmest >= if self.state.hot { COOL } else { HOT };
        }
        if self.state.hot {
            self.pause(DeviceFault::Overheated);
        }
    }

    /// The newest command, as long as it is renewed and nothing is wrong.
    fn wrench(&mut self) -> Wrench {
        let command = *self.commands.read();
        let renewed = command.number != self.state.command_number;
        self.state.command_number = command.number;
        self.state.unrenewed = if renewed {
            0
        } else {
            self.state.unrenewed.saturating_add(1)
        };
        if self.lasts(self.state.unrenewed, DEAD_TIME_S) && command.wrench != Wrench::zero() {
            self.pause(DeviceFault::TimedOut);
        }
        if self.state.trouble.is_some() {
            Wrench::zero()
        } else {
            command.wrench
        }
    }

    fn exert(&self, shared: &Shared, wrench: &Wrench, transform: &[f64; 16]) {
        let force_n = self.placement.to_device(&wrench.force_n);
        // SAFETY: three numbers, as the interface states.
        unsafe { (self.api.hdSetDoublev)(parameter::FORCE, force_n.as_ptr()) };
        if shared.torques.load(Ordering::Relaxed) {
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
        for _ in 0..ERRORS_A_TICK {
            // SAFETY: no preconditions.
            let error = unsafe { (self.api.hdGetError)() };
            if error.code == errors::SUCCESS {
                return;
            }
            shared.error.store(error.code, Ordering::Relaxed);
            shared.errors.fetch_add(1, Ordering::Relaxed);
            let known = errors::known(error.code);
            match known.severity {
                Severity::Pause => self.pause(known.fault),
                Severity::Reconnect => self.lose(shared, known.fault),
            }
        }
    }

    /// Of a device that is let go: they say nothing new.
    fn discard_errors(&self) {
        for _ in 0..ERRORS_A_TICK {
            // SAFETY: no preconditions.
            if unsafe { (self.api.hdGetError)() }.code == errors::SUCCESS {
                return;
            }
        }
    }

    /// The first fault is the one that is told, until all has been quiet.
    fn pause(&mut self, fault: DeviceFault) {
        self.state.trouble.get_or_insert(fault);
        self.state.quiet = 0;
    }

    /// Before any other fault: without a connection the pose is no pose either.
    fn lose(&mut self, shared: &Shared, fault: DeviceFault) {
        self.state.trouble = Some(fault);
        self.state.quiet = 0;
        shared.set_fault(self.state.trouble);
        shared.lost.store(true, Ordering::Relaxed);
    }

    fn lasts(&self, ticks: u32, time_s: f64) -> bool {
        f64::from(ticks) >= time_s * f64::from(self.servo_hz)
    }

    fn settle(&mut self, shared: &Shared) {
        self.state.quiet = self.state.quiet.saturating_add(1);
        if self.lasts(self.state.quiet, QUIET_TIME_S) {
            self.state.trouble = None;
        }
        shared.set_fault(self.state.trouble);
    }

    /// Zero force and torque, whatever the state of the device.
    fn let_go(&self, shared: &Shared) {
        let handle = shared.handle.load(Ordering::Relaxed);
        let zero = [0.0; 3];
        // SAFETY: the handle is the driver's own, three numbers each.
        unsafe {
            (self.api.hdBeginFrame)(handle);
            (self.api.hdSetDoublev)(parameter::FORCE, zero.as_ptr());
            if shared.torques.load(Ordering::Relaxed) {
                (self.api.hdSetDoublev)(parameter::GIMBAL_TORQUE, zero.as_ptr());
            }
            (self.api.hdEndFrame)(handle);
        }
    }
}
