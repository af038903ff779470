//! Faults drawn at random, one after another: no newton of surprise, and each is named.

use fake_drd::Control;
use fake_drd::table::ERRORS;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;
use stylet_hw::drd::errors;
use stylet_hw::drd::ffi::{off_cause, status};
use stylet_runtime::rt::watchdog::{SILENT_SAMPLES, device_fault};
use stylet_shm_schema::Fault;
use stylet_sim::force::gate::{GateParameters, RAMP_OUT_TICKS};

use super::rig::Rig;

/// The device drops a force that is not renewed for this long.
const WATCHDOG_TICKS: usize = 20;
/// The state of the device is checked so often.
const CHECK_TICKS: usize = 10;

/// What goes wrong.
#[derive(Clone, Copy, Debug)]
enum Wrong {
    /// Calls of a function fail with an error of the interface.
    Fails(&'static str, u32),
    /// As many calls of it, and no more.
    FailsTimes(&'static str, u32, u32),
    /// The cable is unplugged; where it comes back, another program may have the device, or it may be another device.
    Unplugged { in_use: bool, other: bool },
    /// A number of the status array is this.
    Status(usize, i32),
    /// The firmware turns forces off, and they may stay off.
    TurnsOff { cause: u32, stays: bool },
    /// The pose is no number, no rotation, or far away.
    BadPose(u32),
    /// The SDK says yes, and does nothing.
    Frozen,
    /// A call does not return for so many ticks.
    Hangs(usize),
    /// Every pose is the one before.
    OldPose,
}

fn below(random: &mut ChaCha8Rng, count: usize) -> usize {
    (random.next_u64() % count as u64) as usize
}

fn draw(random: &mut ChaCha8Rng) -> Wrong {
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
        0 => Wrong::Fails(call, code),
        1 => Wrong::FailsTimes(call, code, 1 + below(random, 50) as u32),
        2 => Wrong::Unplugged {
            in_use: below(random, 2) == 0,
            other: below(random, 2) == 0,
        },
        3 => {
            let place = PLACES[below(random, PLACES.len())];
            let good = i32::from([status::POWER, status::CONNECTED, status::FORCE].contains(&place));
            let numbers = [1 - good, -1, 2, random.next_u64() as i32 | 4];
            Wrong::Status(place, numbers[below(random, numbers.len())])
        }
        4 => Wrong::TurnsOff {
            cause: 1 + below(random, 7) as u32,
            stays: below(random, 2) == 0,
        },
        5 => Wrong::BadPose(1 + below(random, 3) as u32),
        6 => Wrong::Frozen,
        7 => Wrong::Hangs(SILENT_SAMPLES as usize + 5 + below(random, 400)),
        _ => Wrong::OldPose,
    }
}

impl Wrong {
    fn begin(self, control: &Control) {
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

    /// What changes while the fault lasts.
    fn go_on(self, tick: usize, control: &Control) {
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

    fn end(self, control: &Control) {
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
        // The operator's own hand turns on again what it turned off.
        control.force_mode.store(1, Relaxed);
    }

    /// The names that the screen may give it, and the ticks until the motors are without force, at most.
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

    /// Ticks for which it stays, at least until it is named: the SDK's rate is known after two seconds.
    fn lasts(self) -> usize {
        if matches!(self, Self::Frozen) { 2500 } else { 800 }
    }

    fn kind(self) -> String {
        let text = format!("{self:?}");
        text.split(['(', ' ']).next().unwrap_or_default().to_owned()
    }
}

/// Ticks until the motors were without force and until the fault was named, at most, for one kind of fault.
#[derive(Default)]
struct Worst {
    count: usize,
    force_ticks: usize,
    named_ticks: usize,
}

fn one(rig: &mut Rig, random: &mut ChaCha8Rng, number: usize) -> (Wrong, usize, usize) {
    let wrong = draw(random);
    assert!(rig.press(), "{number}: before {wrong:?} the membrane resists");
    for _ in 0..below(random, 50) {
        rig.tick();
    }
    let limit_n = GateParameters::default().max_force_n * (1.0 + 1e-9);
    let before_n = rig.tick().motors_n;
    wrong.begin(rig.fake.control);
    let (names, bound) = wrong.bound();
    let (mut last_force, mut named) = (0, None);
    for tick in 1..=wrong.lasts() {
        wrong.go_on(tick, rig.fake.control);
        let seen = rig.tick();
        assert!(
            seen.motors_n <= limit_n.min(before_n + 0.05),
            "{number} {wrong:?}: {} N in tick {tick}",
            seen.motors_n
        );
        if seen.motors_n > 0.0 {
            last_force = tick;
        }
        if seen.fault() != Fault::None && named.is_none() {
            assert!(
                names.contains(&seen.fault()),
                "{number} {wrong:?} is called {:?}",
                seen.fault()
            );
            named = Some(tick);
        }
    }
    assert!(
        last_force <= bound,
        "{number} {wrong:?}: force until tick {last_force}, allowed are {bound}"
    );
    let named = named.unwrap_or_else(|| panic!("{number} {wrong:?} is not named"));
    wrong.end(rig.fake.control);
    (wrong, last_force, named)
}

fn faults(seed: u64, count: usize) {
    let mut rig = Rig::new();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut table = BTreeMap::<String, Worst>::new();
    for number in 0..count {
        let (wrong, force_ticks, named_ticks) = one(&mut rig, &mut random, number);
        let worst = table.entry(wrong.kind()).or_default();
        worst.count += 1;
        worst.force_ticks = worst.force_ticks.max(force_ticks);
        worst.named_ticks = worst.named_ticks.max(named_ticks);
    }
    assert_eq!(rig.fake.control.non_finite_forces.load(Relaxed), 0);
    println!(
        "{:12} {:>5} {:>22} {:>14}",
        "fault", "count", "ms until no force", "ms until named"
    );
    for (kind, worst) in &table {
        println!(
            "{kind:12} {:>5} {:>22} {:>14}",
            worst.count, worst.force_ticks, worst.named_ticks
        );
    }
    assert_eq!(table.len(), 9, "every kind was drawn");
}

#[test]
fn after_a_fault_drawn_at_random_the_force_is_zero_in_time_and_the_fault_is_named() {
    faults(1, 60);
}

/// `cargo test --release -p stylet-tests-devices -- --ignored --nocapture thousand`
#[test]
#[ignore = "a thousand of them: half a minute"]
fn a_thousand_faults_drawn_at_random() {
    faults(2026, 1000);
}
