//! Random faults, one after another: none raises the force, and each is named.

use fake_drd::control::put;
use fake_drd::table::ERRORS;
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use std::sync::atomic::Ordering::Relaxed;
use stylet_hw::drd::Stepped;
use stylet_hw::drd::errors;
use stylet_hw::drd::ffi::{off_cause, status};
use stylet_runtime::rt::watchdog::{SILENT_SAMPLES, device_fault};
use stylet_shm_schema::Fault;
use stylet_sim::force::gate::RAMP_OUT_TICKS;

use super::fake::{Fake, api, config};
use crate::drawn::{RandomFault, below, campaign};
use crate::rig::{FakeDevice, Rig};

/// Ticks after which the device drops a force that is not renewed.
const WATCHDOG_TICKS: usize = 20;
/// Ticks between two checks of the device's state.
const CHECK_TICKS: usize = 10;

/// Faults of the device.
#[derive(Clone, Copy, Debug)]
enum Misbehaviour {
    /// Calls of a function fail with an error of the interface.
    Fails(&'static str, u32),
    /// As many calls of a function fail, and no more.
    FailsTimes(&'static str, u32, u32),
    /// The cable is unplugged. When it returns, another program may have the device, or another
    /// device may answer.
    Unplugged { in_use: bool, other: bool },
    /// A number of the status array has this value.
    Status(usize, i32),
    /// The firmware turns forces off, and they may stay off.
    TurnsOff { cause: u32, stays: bool },
    /// The pose is not finite, not a rotation, or too far away.
    BadPose(u32),
    /// The SDK reports success and does nothing.
    Frozen,
    /// A call does not return for this number of ticks.
    Hangs(usize),
    /// Every pose repeats the one before.
    OldPose,
}

impl RandomFault for Misbehaviour {
    type Fake = Fake;

    fn draw(random: &mut ChaCha8Rng) -> Self {
        const CALLS: [&str; 3] = [
            "dhdSetForceAndTorqueAndGripperForce",
            "dhdGetPositionAndOrientationFrame",
            "dhdGetStatus",
        ];
        const PLACES: [usize; 5] = [
            status::POWER,
            status::CONNECTED,
            status::RESET,
            status::FORCE,
            status::ERROR,
        ];
        let call = CALLS[below(random, CALLS.len())];
        let code = below(random, ERRORS.len() + 3) as u32;
        match below(random, 9) {
            0 => Misbehaviour::Fails(call, code),
            1 => Misbehaviour::FailsTimes(call, code, 1 + below(random, 50) as u32),
            2 => Misbehaviour::Unplugged {
                in_use: below(random, 2) == 0,
                other: below(random, 2) == 0,
            },
            3 => {
                let place = PLACES[below(random, PLACES.len())];
                let good = i32::from([status::POWER, status::CONNECTED, status::FORCE].contains(&place));
                let numbers = [1 - good, -1, 2, random.next_u64() as i32 | 4];
                Misbehaviour::Status(place, numbers[below(random, numbers.len())])
            }
            4 => Misbehaviour::TurnsOff {
                cause: 1 + below(random, 7) as u32,
                stays: below(random, 2) == 0,
            },
            5 => Misbehaviour::BadPose(1 + below(random, 3) as u32),
            6 => Misbehaviour::Frozen,
            7 => Misbehaviour::Hangs(SILENT_SAMPLES as usize + 5 + below(random, 400)),
            _ => Misbehaviour::OldPose,
        }
    }

    fn begin(self, fake: &Fake) {
        let control = fake.control;
        match self {
            Self::Fails(call, code) => control.fail(call, code, u32::MAX),
            Self::FailsTimes(call, code, times) => control.fail(call, code, times),
            Self::Unplugged { .. } => control.unplugged.store(1, Relaxed),
            Self::Status(place, number) => control.status(place, number),
            Self::TurnsOff { cause, stays } => {
                control.stays_off.store(stays.into(), Relaxed);
                control.turn_off.store(cause, Relaxed);
            }
            Self::BadPose(kind) => control.bad_pose.store(kind, Relaxed),
            Self::Frozen => control.frozen.store(1, Relaxed),
            Self::Hangs(_) => control.hang.store(1, Relaxed),
            Self::OldPose => control.time_guard.store(1, Relaxed),
        }
    }

    fn advance(self, tick: usize, fake: &Fake) {
        let control = fake.control;
        match self {
            Self::Hangs(ticks) if tick == ticks => control.hang.store(0, Relaxed),
            Self::Unplugged { in_use, other } if tick == 600 => {
                control.in_use.store(in_use.into(), Relaxed);
                control.system_type.store(if other { 63 } else { 0 }, Relaxed);
                control.unplugged.store(0, Relaxed);
            }
            _ => {}
        }
    }

    fn end(self, fake: &Fake) {
        let control = fake.control;
        for (cell, left) in control.fail.iter().zip(&control.fail_times) {
            cell.store(0, Relaxed);
            left.store(0, Relaxed);
        }
        for cell in [
            &control.unplugged,
            &control.in_use,
            &control.status_place,
            &control.stays_off,
            &control.bad_pose,
            &control.frozen,
            &control.hang,
            &control.time_guard,
        ] {
            cell.store(0, Relaxed);
        }
        control.system_type.store(0, Relaxed);
        // The operator turns on again what the operator's own button turned off.
        control.force_mode.store(1, Relaxed);
    }

    fn bound(self) -> (Vec<Fault>, usize) {
        let silent = (SILENT_SAMPLES + RAMP_OUT_TICKS) as usize;
        match self {
            Self::Fails(call, code) | Self::FailsTimes(call, code, _) => {
                let known = errors::known(code.max(1));
                let ticks = match call {
                    "dhdGetStatus" => CHECK_TICKS,
                    "dhdGetPositionAndOrientationFrame" => 1,
                    _ => WATCHDOG_TICKS,
                };
                (vec![device_fault(known.fault)], ticks)
            }
            Self::Unplugged { .. } => (vec![Fault::DeviceLost], WATCHDOG_TICKS),
            Self::Status(status::RESET, _) => (vec![Fault::DeviceNotCalibrated], CHECK_TICKS),
            Self::Status(status::FORCE, _) => (vec![Fault::DeviceError, Fault::DeviceStopped], CHECK_TICKS),
            Self::Status(status::ERROR, _) => (vec![Fault::DeviceError], CHECK_TICKS),
            Self::Status(..) => (vec![Fault::DeviceLost], CHECK_TICKS),
            Self::TurnsOff { cause, .. } => {
                let fault = match cause as i32 {
                    off_cause::WATCHDOG | off_cause::SOFTWARE => Fault::DeviceError,
                    off_cause::USB => Fault::DeviceLost,
                    _ => Fault::DeviceStopped,
                };
                (vec![fault], 1)
            }
            Self::BadPose(3) => (vec![Fault::DeviceError], 1),
            Self::BadPose(_) => (vec![Fault::NonFiniteInput], 1),
            Self::Frozen => (vec![Fault::DeviceError], WATCHDOG_TICKS),
            Self::Hangs(_) => (vec![Fault::DeviceSilent], WATCHDOG_TICKS),
            Self::OldPose => (vec![Fault::DeviceSilent], silent),
        }
    }

    /// Returns the duration; the SDK's rate is known after two seconds.
    fn lasts(self) -> usize {
        if matches!(self, Self::Frozen) { 2500 } else { 800 }
    }
}

impl FakeDevice for Fake {
    fn at(&self, now_ns: u64) {
        self.control.now_us.store(now_ns / 1000, Relaxed);
    }

    fn hold(&self, depth_m: f64) {
        // World +z is away from the operator: -x of the device.
        put(&self.control.tip_m[0], -depth_m);
    }

    fn motors_n(&self) -> f64 {
        Vector3::from(self.control.motors_n(self.control.now_us.load(Relaxed))).norm()
    }
}

fn faults(seed: u64, count: usize) {
    let runs = |fake: &Fake| {
        let control = fake.control;
        Box::new(move || control.hang.load(Relaxed) == 0)
    };
    let rig = Rig::over(Fake::new(), |fake| {
        Box::new(Stepped::open(api(), &config(), runs(fake)).expect("a healthy device"))
    });
    let rig = campaign::<Misbehaviour>(rig, seed, count, 9);
    assert_eq!(rig.fake.control.non_finite_forces.load(Relaxed), 0);
}

#[test]
fn a_random_fault_zeroes_the_force_in_time_and_is_named() {
    faults(1, 60);
}

/// Run with `cargo test --profile quick -p stylet-tests-devices -- --ignored --nocapture thousand`.
#[test]
#[ignore = "a thousand of them: half a minute"]
fn a_thousand_faults_drawn_at_random() {
    faults(2026, 1000);
}
