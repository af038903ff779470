//! Random faults, one after another: none raises the force, and each is named.

use fake_haply::{IDLE_AFTER_MS, Service, Wrong};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use std::fmt;
use stylet_hw::haply::{Stepped, Wire};
use stylet_hw::{Axes, Placement};
use stylet_runtime::rt::watchdog::SILENT_SAMPLES;
use stylet_shm_schema::Fault as Named;

use crate::drawn::{RandomFault, below, campaign};
use crate::rig::{FakeDevice, Rig};

/// Ticks after which an answer is late.
const LATE_TICKS: usize = 20;
/// Ticks after which a service that does not answer is lost.
const LOST_TICKS: usize = 250;
/// Ticks after which a loaded device that does not move is frozen.
const FROZEN_TICKS: usize = 250;

/// Fault of the service, and its further course.
#[derive(Clone, Copy)]
struct Fault {
    wrong: Wrong,
    /// Ticks until a service that hangs continues, or variant of a device that is plugged in again.
    then: usize,
}

impl fmt::Debug for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.wrong.fmt(f)
    }
}

impl RandomFault for Fault {
    type Fake = Service;

    fn draw(random: &mut ChaCha8Rng) -> Self {
        let (kind, ticks) = (below(random, 30) as u32, below(random, 400));
        let wrong = match below(random, 16) {
            0 => Wrong::Late((LATE_TICKS + 2 + ticks) as u64),
            1 => Wrong::Hangs,
            2 => Wrong::Silent,
            3 => Wrong::Old,
            4 => Wrong::NoNumber(kind % 5),
            5 => Wrong::Far,
            6 => Wrong::Broken(kind % 6),
            7 => Wrong::Unplugged,
            8 => Wrong::NotCalibrated,
            9 => Wrong::NotReady,
            10 => Wrong::NoPower,
            11 => Wrong::Closes,
            12 => Wrong::Binary,
            13 => Wrong::Long,
            14 => Wrong::Scaled,
            _ => Wrong::BadGrip(kind % 3),
        };
        let then = if wrong == Wrong::Hangs {
            LATE_TICKS + 5 + ticks
        } else {
            ticks % 6
        };
        Self { wrong, then }
    }

    fn begin(self, fake: &Service) {
        fake.state().wrong = self.wrong;
    }

    fn advance(self, tick: usize, fake: &Service) {
        let mut state = fake.state();
        match self.wrong {
            Wrong::Hangs if tick == self.then => state.wrong = Wrong::Nothing,
            Wrong::Unplugged if tick == 400 => {
                state.wrong = if self.then == 0 { Wrong::Other } else { Wrong::Nothing };
                state.kind = if self.then == 1 { "minverse" } else { "inverse3" }.to_owned();
                state.in_use = self.then == 2;
                state.version = Some(if self.then == 3 { "3.4.1" } else { "3.5.0" }.to_owned());
                state.axes = (self.then == 4).then(|| "XZY".to_owned());
            }
            _ => {}
        }
    }

    fn end(self, fake: &Service) {
        fake.state().heal();
    }

    fn bound(self) -> (Vec<Named>, usize) {
        match self.wrong {
            // The service decides about a zero that it does not read: it drops a force that is not
            // renewed.
            Wrong::Hangs => (
                vec![Named::DeviceSilent, Named::DeviceError],
                IDLE_AFTER_MS as usize + 1,
            ),
            Wrong::Old => (vec![Named::DeviceError], IDLE_AFTER_MS as usize + 1),
            Wrong::Late(_) | Wrong::Silent => (vec![Named::DeviceSilent, Named::DeviceError], LATE_TICKS),
            Wrong::NoNumber(0) | Wrong::BadGrip(_) => (vec![Named::NonFiniteInput], 1),
            Wrong::Unplugged | Wrong::NoPower | Wrong::Closes | Wrong::Long => (vec![Named::DeviceLost], 1),
            Wrong::NotCalibrated => (vec![Named::DeviceNotCalibrated], 1),
            _ => (vec![Named::DeviceError], 1),
        }
    }

    fn lasts(self) -> usize {
        800 + if self.wrong == Wrong::Old {
            FROZEN_TICKS
        } else {
            LOST_TICKS
        }
    }
}

impl FakeDevice for Service {
    fn at(&self, now_ns: u64) {
        self.state().now_ms = Some(now_ns / 1_000_000);
    }

    fn hold(&self, depth_m: f64) {
        // World +z is away from the operator: +y of the device.
        self.state().tip_m[1] = depth_m;
    }

    fn motors_n(&self) -> f64 {
        Vector3::from(self.state().motors_n()).norm()
    }
}

fn faults(seed: u64, count: usize) {
    let rig = Rig::over(Service::default(), |service| {
        let service = service.clone();
        let open = move || {
            let wire: Box<dyn Wire> = Box::new(fake_haply::Stepped::open(&service)?);
            Some((wire, service.state().version.clone()))
        };
        let placement = Placement::facing_patient(Axes::HAPLY, Vector3::zeros());
        Box::new(Stepped::open(Box::new(open), placement, 1000).expect("a healthy device"))
    });
    let rig = campaign::<Fault>(rig, seed, count, 16);
    let state = rig.fake.state();
    assert_eq!(state.out_of_turn, 0, "a force was sent while an answer was owed");
    assert!(state.peak_n <= 2.0 * (1.0 + 1e-9), "{} N", state.peak_n);
}

#[test]
fn a_random_fault_zeroes_the_force_in_time_and_is_named() {
    const { assert!(LATE_TICKS == SILENT_SAMPLES as usize) };
    faults(1, 120);
}

/// Run with `cargo test --profile quick -p stylet-tests-devices -- --ignored --nocapture thousand`.
#[test]
#[ignore = "a thousand of them: a minute"]
fn a_thousand_faults_drawn_at_random() {
    faults(2026, 1000);
}
