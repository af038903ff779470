//! Faults drawn at random, one after another: no newton of surprise, and each is named.

use fake_haply::{IDLE_AFTER_MS, Service, Wrong as Fault};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use stylet_hw::haply::{Stepped, Wire};
use stylet_hw::{Axes, Placement};
use stylet_runtime::rt::watchdog::SILENT_SAMPLES;
use stylet_shm_schema::Fault as Named;

use crate::drawn::{Drawn, below, campaign};
use crate::rig::{Led, Rig};

/// An answer is late after so many ticks.
const LATE_TICKS: usize = 20;
/// A service that does not answer for so many is lost.
const LOST_TICKS: usize = 250;
/// A device that is pushed and does not move is frozen after so many.
const FROZEN_TICKS: usize = 250;

#[derive(Clone, Copy, Debug)]
enum Wrong {
    Late(u64),
    /// Stops after so many ticks.
    Hangs(usize),
    Silent,
    Old,
    NoNumber(u32),
    Far,
    Broken(u32),
    /// Plugged in again; it may then be another device, in use elsewhere, or behind a service of another version.
    Gone(u32),
    NotCalibrated,
    NotReady,
    NoPower,
    Closes,
    Binary,
    Long,
    Scaled,
    BadGrip(u32),
}

impl Wrong {
    fn of_service(self) -> Fault {
        match self {
            Self::Late(ms) => Fault::Late(ms),
            Self::Hangs(_) => Fault::Hangs,
            Self::Silent => Fault::Silent,
            Self::Old => Fault::Old,
            Self::NoNumber(kind) => Fault::NoNumber(kind),
            Self::Far => Fault::Far,
            Self::Broken(kind) => Fault::Broken(kind),
            Self::Gone(_) => Fault::Gone,
            Self::NotCalibrated => Fault::NotCalibrated,
            Self::NotReady => Fault::NotReady,
            Self::NoPower => Fault::NoPower,
            Self::Closes => Fault::Closes,
            Self::Binary => Fault::Binary,
            Self::Long => Fault::Long,
            Self::Scaled => Fault::Scaled,
            Self::BadGrip(kind) => Fault::BadGrip(kind),
        }
    }
}

impl Drawn for Wrong {
    type Fake = Service;

    fn draw(random: &mut ChaCha8Rng) -> Self {
        let kind = below(random, 6) as u32;
        match below(random, 16) {
            0 => Self::Late((LATE_TICKS + 2 + below(random, 400)) as u64),
            1 => Self::Hangs(LATE_TICKS + 5 + below(random, 400)),
            2 => Self::Silent,
            3 => Self::Old,
            4 => Self::NoNumber(kind % 5),
            5 => Self::Far,
            6 => Self::Broken(kind),
            7 => Self::Gone(kind),
            8 => Self::NotCalibrated,
            9 => Self::NotReady,
            10 => Self::NoPower,
            11 => Self::Closes,
            12 => Self::Binary,
            13 => Self::Long,
            14 => Self::Scaled,
            _ => Self::BadGrip(kind % 3),
        }
    }

    fn begin(self, fake: &Service) {
        fake.state().wrong = self.of_service();
    }

    fn go_on(self, tick: usize, fake: &Service) {
        let mut state = fake.state();
        match self {
            Self::Hangs(ticks) if tick == ticks => state.wrong = Fault::Nothing,
            Self::Gone(kind) if tick == 400 => {
                state.wrong = if kind == 0 { Fault::Other } else { Fault::Nothing };
                state.kind = if kind == 1 { "minverse" } else { "inverse3" }.to_owned();
                state.in_use = kind == 2;
                state.version = Some(if kind == 3 { "3.4.1" } else { "3.5.0" }.to_owned());
                state.axes = (kind == 4).then(|| "XZY".to_owned());
            }
            _ => {}
        }
    }

    fn end(self, fake: &Service) {
        let mut state = fake.state();
        (state.wrong, state.in_use, state.axes) = (Fault::Nothing, false, None);
        state.kind = "inverse3".to_owned();
        state.version = Some("3.5.0".to_owned());
    }

    fn bound(self) -> (Vec<Named>, usize) {
        match self {
            // What the service does with the zero that it does not read is its own: it drops a force that is not renewed.
            Self::Hangs(_) => (
                vec![Named::DeviceSilent, Named::DeviceError],
                IDLE_AFTER_MS as usize + 1,
            ),
            // The zero of the late tick is carried out when it arrives.
            Self::Late(_) | Self::Silent => (vec![Named::DeviceSilent, Named::DeviceError], LATE_TICKS),
            Self::Old => (vec![Named::DeviceError], IDLE_AFTER_MS as usize + 1),
            Self::NoNumber(0) => (vec![Named::NonFiniteInput], 1),
            Self::NoNumber(_) | Self::Far | Self::Broken(_) | Self::Binary | Self::NotReady | Self::Scaled => {
                (vec![Named::DeviceError], 1)
            }
            Self::Gone(_) | Self::NoPower | Self::Closes | Self::Long => (vec![Named::DeviceLost], 1),
            Self::NotCalibrated => (vec![Named::DeviceNotCalibrated], 1),
            Self::BadGrip(_) => (vec![Named::NonFiniteInput], 1),
        }
    }

    fn lasts(self) -> usize {
        if matches!(self, Self::Old) {
            800 + FROZEN_TICKS
        } else {
            800 + LOST_TICKS
        }
    }
}

impl Led for Service {
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
    let rig = campaign::<Wrong>(rig, seed, count, 16);
    let state = rig.fake.state();
    assert_eq!(state.out_of_turn, 0, "a force was sent while an answer was owed");
    assert!(state.peak_n <= 2.0 * (1.0 + 1e-9), "{} N", state.peak_n);
}

#[test]
fn after_a_fault_drawn_at_random_the_force_is_zero_in_time_and_the_fault_is_named() {
    const { assert!(LATE_TICKS == SILENT_SAMPLES as usize) };
    faults(1, 120);
}

/// `cargo test --release -p stylet-tests-devices -- --ignored --nocapture thousand`
#[test]
#[ignore = "a thousand of them: half a minute"]
fn a_thousand_faults_drawn_at_random() {
    faults(2026, 1000);
}
