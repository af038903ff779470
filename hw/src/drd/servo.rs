//! One tick of the servo thread: write the newest force, read the pose, check the device.
//!
//! Every call may block for a while, so no other thread makes them. Once armed, the thread does not
//! allocate, lock or log. It writes the force in every tick, zero included, because that renews the
//! device's watchdog.

use core::ffi::c_int;

use nalgebra::{Matrix3, Vector3};

use crate::convert::orientation_from_matrix;
use crate::device::{DeviceFault, Sample, Wrench};
use crate::drd::errors::{self, Response};
use crate::drd::ffi::{Api, Id, STATUS_ROOM, TIMEGUARD};
use crate::drd::session::last_error;
use crate::drd::status::{Health, health};
use crate::driver_thread::arm::{Arm, ArmError};
use crate::driver_thread::ends::ServoEnd;
use crate::driver_thread::hold::Hold;
use crate::driver_thread::serving::{self, Serve};
use crate::driver_thread::shared::Shared;
use crate::placement::Placement;

/// Ticks between two checks of the device's state.
pub const TICKS_BETWEEN_CHECKS: u64 = 10;
/// Number of checks between two attempts to turn forces on again.
const CHECKS_BEFORE_ON: u32 = 25;
/// Lowest rate at which forces must reach the device; below it the device is frozen, whatever the
/// SDK returns.
const LOWEST_RATE_KHZ: f64 = 0.1;
/// Time that the SDK needs to measure its rate.
const RATE_KNOWN_AFTER_S: u64 = 2;
/// Farthest reach of any device of this maker from its origin.
const FARTHEST_M: f64 = 1.0;

/// Ports and settings of a servo tick, and its state.
pub struct Servo {
    api: Api,
    id: Id,
    torques: bool,
    placement: Placement,
    arm: Arm,
    end: ServoEnd,
    servo_hz: u32,
    sequence: u64,
    hold: Hold,
    /// Ticks since this connection began.
    ticks: u64,
    /// Checks in a row that found the forces off.
    checks_off: u32,
}

impl Servo {
    pub fn new(api: Api, placement: Placement, arm: Arm, end: ServoEnd, servo_hz: u32) -> Self {
        Self {
            api,
            id: 0,
            torques: false,
            placement,
            arm,
            end,
            servo_hz,
            sequence: 0,
            hold: Hold::default(),
            ticks: 0,
            checks_off: 0,
        }
    }

    /// Serves the device `id` from the next tick on. After an earlier connection the force stays
    /// off until no fault has occurred for a while.
    pub fn begin(&mut self, id: Id, torques: bool) {
        if self.ticks > 0 {
            self.hold.pause(DeviceFault::NotConnected);
        }
        (self.id, self.torques) = (id, torques);
        (self.ticks, self.checks_off) = (0, 0);
    }

    /// Runs one servo tick, in the order of the data.
    pub fn tick(&mut self, shared: &Shared) {
        shared.count_tick();
        let wrench = self.hold.wrench(self.end.commands.read(), self.servo_hz);
        let answer = self.send(&wrench);
        self.note_answer(shared, answer);
        self.read_pose(shared);
        if self.ticks.is_multiple_of(TICKS_BETWEEN_CHECKS) {
            self.check_state(shared);
            self.check_rate();
        }
        self.ticks += 1;
        // A fault found in this tick withdraws the force at once.
        if self.hold.fault().is_some() && wrench != Wrench::zero() {
            self.send(&Wrench::zero());
        }
        shared.fault.set(self.hold.end_tick(self.servo_hz));
    }

    fn send(&self, wrench: &Wrench) -> c_int {
        let force_n = self.placement.to_device(&wrench.force_n);
        let torque_nm = match self.torques {
            true => self.placement.to_device(&wrench.torque_nm),
            false => Vector3::zeros(),
        };
        let [fx, fy, fz]: [f64; 3] = force_n.into();
        let [tx, ty, tz]: [f64; 3] = torque_nm.into();
        // SAFETY: the number is the SDK's own.
        unsafe { (self.api.dhdSetForceAndTorqueAndGripperForce)(fx, fy, fz, tx, ty, tz, 0.0, self.id) }
    }

    fn read_pose(&mut self, shared: &Shared) {
        let ([mut x, mut y, mut z], mut rows) = ([0.0; 3], [[0.0; 3]; 3]);
        let get = self.api.dhdGetPositionAndOrientationFrame;
        // SAFETY: one number each and a matrix of three rows, as the interface states.
        let answer = unsafe { get(&mut x, &mut y, &mut z, rows.as_mut_ptr(), self.id) };
        if answer < 0 {
            self.note_answer(shared, answer);
            return;
        }
        if answer == TIMEGUARD {
            return;
        }
        let tip = Vector3::new(x, y, z);
        let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = rows;
        let orientation = orientation_from_matrix(&Matrix3::new(xx, xy, xz, yx, yy, yz, zx, zy, zz));
        let Some(device_from_handle) = orientation.filter(|_| tip.iter().all(|x| x.is_finite())) else {
            self.hold.pause(DeviceFault::NonFiniteSample);
            return;
        };
        if tip.amax() > FARTHEST_M {
            self.hold.pause(DeviceFault::Driver);
            return;
        }
        self.sequence += 1;
        let (tip_in_world, world_from_tool) = self.placement.pose(&tip, &device_from_handle);
        // SAFETY: the number is the SDK's own.
        let buttons = unsafe { (self.api.dhdGetButtonMask)(self.id) };
        self.end.samples.write(Some(Sample {
            tip_in_world,
            world_from_tool,
            buttons,
            sequence: self.sequence,
        }));
    }

    fn check_state(&mut self, shared: &Shared) {
        let mut numbers = [0; STATUS_ROOM];
        // SAFETY: the array has room for more numbers than any version writes.
        let answer = unsafe { (self.api.dhdGetStatus)(numbers.as_mut_ptr(), self.id) };
        if answer < 0 {
            self.note_answer(shared, answer);
            return;
        }
        match health(&numbers, true) {
            Health::Good => self.checks_off = 0,
            Health::Pause(fault) => self.hold.pause(fault),
            Health::Lost(fault) => {
                self.lose(shared, fault);
                shared.errors.set_lost_by_status();
            }
            Health::Off { fault, by_program } => {
                self.hold.pause(fault);
                self.checks_off += 1;
                // A device that refuses the zero holds an older force, which would return when
                // forces are turned on.
                let due = by_program && self.checks_off.is_multiple_of(CHECKS_BEFORE_ON);
                if due && self.send(&Wrench::zero()) >= 0 {
                    // SAFETY: the number is the SDK's own.
                    let answer = unsafe { (self.api.dhdEnableForce)(1, self.id) };
                    self.note_answer(shared, answer);
                }
            }
        }
    }

    fn check_rate(&mut self) {
        if self.ticks < RATE_KNOWN_AFTER_S * u64::from(self.servo_hz) {
            return;
        }
        // SAFETY: the number is the SDK's own.
        let rate_khz = self.api.dhdGetComFreq.map(|get| unsafe { get(self.id) });
        if rate_khz.is_some_and(|khz| khz < LOWEST_RATE_KHZ) {
            self.hold.pause(DeviceFault::TimedOut);
        }
    }

    /// Records the error behind a call that failed.
    fn note_answer(&mut self, shared: &Shared, answer: c_int) {
        if answer >= 0 {
            return;
        }
        let code = last_error(&self.api);
        shared.errors.note(code);
        let known = errors::known(code);
        match known.response {
            Response::Pause => self.hold.pause(known.fault),
            Response::Reconnect => self.lose(shared, known.fault),
        }
    }

    /// Declares the connection lost.
    fn lose(&mut self, shared: &Shared, fault: DeviceFault) {
        self.hold.lose(fault);
        shared.fault.set(Some(fault));
        shared.errors.set_lost();
    }
}

impl Serve for Servo {
    fn arm(&self) -> Result<String, ArmError> {
        (self.arm)()
    }

    fn run(&mut self, shared: &Shared) {
        if !serving::at_rate(shared, self.servo_hz, |_| self.tick(shared)) {
            self.lose(shared, DeviceFault::Driver);
        }
        self.send(&Wrench::zero());
    }
}
