//! Every cause, checked against the force record of the whole loop: the force ramps out in time, stays out, and returns
//! after re-arming.

use super::*;
use crate::replay;
use crate::replay::file::{Flight, SecondFigures};
use crate::rt::capacities::Capacities;
use crate::rt::motion_lease::Promise;
use crate::rt::tests::{BreakingDevice, Cause};
use crate::rt::watchdog::{OVERRUN_STREAK, SILENT_SAMPLES, STALE_TISSUE_NS};
use nalgebra::SMatrix;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use stylet_hw::HandGoal;
use stylet_shm_schema::{SecondRecord, flags};
use stylet_sim::force::gate::RAMP_OUT_TICKS;

const TICK_NS: u64 = 1_000_000;
/// Stiffness of the contact.
const STIFFNESS_N_PER_M: f64 = 400.0;
/// Ticks of this loop per tissue tick.
const TISSUE_TICKS: u64 = 5;

/// The whole loop against a wall at z = 0, answered by a tissue loop at its own rate, ticked by hand.
struct Rig {
    second: SecondLoop,
    cause: Arc<AtomicU32>,
    tissue: SecondTissuePorts,
    control: SecondControlPorts,
    now_ns: u64,
    seen: Vec<Notice>,
}

impl Rig {
    fn new() -> Self {
        let (device, cause) = BreakingDevice::at(Vector3::new(0.0, 0.0, -0.005));
        let gate = gate_of(&GateParameters::default(), &device.info());
        let memory = SecondMemory::new(&device.info(), gate, false);
        let tape = Box::new(SecondTape::new(&memory));
        let (ports, tissue, control) = wire(Capacities::STEPPED, Some(tape));
        let mut rig = Self {
            second: SecondLoop::new(1, Box::new(device), ports, &memory, 1e-3),
            cause,
            tissue,
            control,
            now_ns: 1_000_000_000,
            seen: Vec::new(),
        };
        rig.answer();
        rig
    }

    fn has(&self, cause: Cause) -> bool {
        self.cause.load(Ordering::Relaxed) == cause as u32
    }

    fn set(&mut self, cause: Cause) {
        self.cause.store(cause as u32, Ordering::Relaxed);
    }

    fn order(&mut self, order: HapticOrder) {
        self.control.orders.push((1, order)).expect("room");
    }

    fn answer(&mut self) {
        let pose = *self.tissue.pose.read();
        let depth_m = pose.tip_in_scene.z;
        let mut stiffness = SMatrix::zeros();
        stiffness[(2, 2)] = STIFFNESS_N_PER_M;
        let size_n = STIFFNESS_N_PER_M
            * if self.has(Cause::ForceNotANumber) {
                f64::NAN
            } else {
                depth_m
            };
        self.tissue.response.write(ProbeResponse {
            edge_um: 0,
            time_ns: self.now_ns,
            tick: self.now_ns / (TISSUE_TICKS * TICK_NS),
            touches: depth_m > 0.0,
            unsolved: self.has(Cause::TissueUnsolved),
            tip_in_scene: pose.tip_in_scene,
            world_from_tool: pose.world_from_tool,
            wrench: Wrench::from_force(Vector3::z() * -size_n),
            stiffness,
        });
    }

    fn tick(&mut self) -> SecondRecord {
        self.now_ns += TICK_NS;
        if self.now_ns.is_multiple_of(TISSUE_TICKS * TICK_NS) && !self.has(Cause::TissueStops) {
            self.answer();
        }
        let late = u32::from(self.has(Cause::Late));
        self.second.tick(self.now_ns, self.now_ns, late);
        while let Ok(notice) = self.control.notices.pop() {
            self.seen.push(notice);
        }
        self.control.records.pop().expect("a record for each tick")
    }

    fn run(&mut self, ticks: usize) -> Vec<SecondRecord> {
        (0..ticks).map(|_| self.tick()).collect()
    }

    /// Presses 5 mm into the wall and holds.
    fn press(&mut self) -> f64 {
        self.order(HapticOrder::Engage);
        self.order(to_depth(0.005));
        self.run(1500).last().map_or(0.0, force_n)
    }

    fn faults(&self) -> Vec<Fault> {
        let fault = |notice: &Notice| match notice {
            Notice::Event {
                what: Happened::Fault(fault),
                ..
            } => Some(*fault),
            _ => None,
        };
        self.seen.iter().filter_map(fault).collect()
    }
}

fn to_depth(depth_m: f64) -> HapticOrder {
    HapticOrder::Hand {
        up: None,
        promise: None,
        goal: HandGoal {
            tip_in_world: Vector3::new(0.0, 0.0, depth_m),
            direction: Vector3::z(),
            speed_m_per_s: 0.02,
            acceleration_m_per_s2: 0.5,
        },
    }
}

fn force_n(record: &SecondRecord) -> f64 {
    Vector3::from(record.force_on_hand_n).norm()
}

#[test]
fn the_hand_feels_the_contact_smoothly_between_two_steps_of_the_tissue() {
    let mut rig = Rig::new();
    let force = rig.press();
    let record = rig.tick();
    let expected = 0.9 * STIFFNESS_N_PER_M * record.tip_in_scene_m[2];
    assert!(
        (1.0..3.0).contains(&force) && (force - expected).abs() < 0.02,
        "{force} N, {expected} N"
    );
    assert!(record.flags & flags::IN_CONTACT != 0 && record.flags & flags::ENGAGED != 0);
    assert!(rig.faults().is_empty(), "{:?}", rig.faults());
    // Withdrawal: every tick follows its own pose, not that of the last tissue step.
    rig.order(to_depth(-0.003));
    let out = rig.run(400);
    let jump = out
        .windows(2)
        .map(|w| (force_n(&w[1]) - force_n(&w[0])).abs())
        .fold(0.0, f64::max);
    // The gate may add its full damping where the contact has returned all the energy that it took.
    let damping = GateParameters::default().passivity.max_damping_n_s_per_m;
    let most = 0.02 * (damping + STIFFNESS_N_PER_M * 1e-3) + STIFFNESS_N_PER_M * rig.second.device.info.position_step_m;
    assert!(jump < most, "{jump} N in a tick, of {most} N");
    assert_eq!(out.last().map(force_n), Some(0.0), "nothing sticks");
}

#[test]
fn after_any_fault_the_force_is_zero_in_time_until_the_operator_rearms() {
    let stale = (STALE_TISSUE_NS / TICK_NS) as usize + TISSUE_TICKS as usize;
    for (cause, expected, ticks) in [
        (Cause::Silent, Fault::DeviceSilent, SILENT_SAMPLES as usize),
        (Cause::ReadFails, Fault::DeviceError, 1),
        (Cause::NotANumber, Fault::NonFiniteInput, 1),
        (Cause::WriteFails, Fault::DeviceError, 2),
        (Cause::TissueStops, Fault::TissueStale, stale),
        (Cause::TissueUnsolved, Fault::TissueUnsolved, TISSUE_TICKS as usize),
        (Cause::Late, Fault::OverrunStreak, OVERRUN_STREAK as usize),
        (Cause::ForceNotANumber, Fault::NonFiniteForce, TISSUE_TICKS as usize),
    ] {
        let mut rig = Rig::new();
        assert!(rig.press() > 1.0, "{cause:?}");
        rig.set(cause);
        let after = rig.run(ticks + RAMP_OUT_TICKS as usize + 1);
        let largest = after.iter().map(force_n).fold(0.0, f64::max);
        let last = after.last().expect("ticks");
        assert!(largest < 3.0, "{cause:?}: {largest} N");
        assert_eq!((force_n(last), last.fault), (0.0, expected as u32), "{cause:?}");
        assert_eq!(rig.faults(), [expected], "{cause:?}: said once");
        rig.set(Cause::Nothing);
        assert!(
            rig.run(300).iter().all(|r| force_n(r) == 0.0),
            "{cause:?}: nothing comes back by itself"
        );
        rig.order(to_depth(-0.003));
        rig.run(600);
        assert!(rig.press() > 1.0, "{cause:?}: felt again");
        assert_eq!(rig.second.state().fault, 0);
    }
}

/// The first ramp would differ if a field of the memory were forgotten.
#[test]
fn a_recorded_flight_repeats_bit_by_bit() {
    let mut rig = Rig::new();
    rig.press();
    rig.set(Cause::Silent);
    rig.run(60);
    rig.set(Cause::Nothing);
    rig.order(to_depth(-0.003));
    rig.run(400);
    rig.press();
    rig.order(HapticOrder::HandOverTape);
    rig.run(2);
    let flight = rig.control.tapes.taken.pop().expect("handed over").longest();
    let recorded = flight.expect("ticks");
    let info = rig.second.device.info;
    let file = Flight {
        version: String::new(),
        session_id: 1,
        reason: String::new(),
        device_name: String::new(),
        device: info,
        haptic_period_s: 1e-3,
        tissue_period_s: 5e-3,
        lines: Vec::new(),
        haptic: None,
        tissue: None,
        second_device: Some(SecondFigures {
            device_name: String::new(),
            device: info,
            period_s: 1e-3,
        }),
        second: None,
    };
    let mut again = replay::second::second(&file, &recorded);
    assert!(again.is_identical() && again.ticks > 3000, "{again:?}");
    let mut changed = recorded.clone();
    changed.ticks[1400].response.wrench.force_n.z -= 1e-9;
    again = replay::second::second(&file, &changed);
    assert!(!again.is_identical(), "another input is another force");
}

#[test]
fn a_tick_makes_no_heap_call() {
    let mut rig = Rig::new();
    rig.press();
    let before = stylet_heap::calls_of_this_thread();
    for _ in 0..600 {
        rig.now_ns += TICK_NS;
        rig.answer();
        rig.second.tick(rig.now_ns, rig.now_ns, 0);
        while rig.control.records.pop().is_ok() {}
    }
    assert_eq!(stylet_heap::calls_of_this_thread() - before, 0);
}

#[test]
fn a_device_that_gives_less_gets_less() {
    let mut weak = SIMULATED;
    weak.peak_force_n = 2.0;
    assert_eq!(gate_of(&GateParameters::default(), &weak).max_force_n, 2.0);
}

const SIMULATED: DeviceInfo = DeviceInfo {
    simulated: true,
    ..DeviceInfo::phantom_premium_1_5()
};

/// The probe continued to move and turn after its host had died.
#[test]
fn a_hand_stops_within_5_mm_of_host_silence_and_resumes_when_heard() {
    let promise = Promise::first(7);
    let mut rig = Rig::new();
    let mut move_on = to_depth(-0.3);
    if let HapticOrder::Hand { goal, up, promise: of } = &mut move_on {
        *up = Some(Vector3::x());
        (goal.speed_m_per_s, goal.acceleration_m_per_s2) = (0.123, 2.0);
        (goal.direction, *of) = (Vector3::new(0.0, 1.0, 1.0).normalize(), Some(promise));
    }
    rig.order(move_on);
    for _ in 0..30 {
        rig.order(HapticOrder::KeepMoving(promise));
        rig.run(5);
    }
    rig.order(HapticOrder::KeepMoving(promise));
    let silent = rig.run(300);
    let way_m = |from: &SecondRecord, to: &SecondRecord| {
        (Vector3::from(to.tip_in_scene_m) - Vector3::from(from.tip_in_scene_m)).norm()
    };
    let (first, last) = (&silent[0], &silent[299]);
    assert!((1e-3..5e-3).contains(&way_m(first, last)), "{} m", way_m(first, last));
    assert!(way_m(&silent[150], last) < 1.5e-4, "at rest");
    assert_eq!(silent[40].world_from_tool, last.world_from_tool, "turns no more");
    rig.order(HapticOrder::KeepMoving(promise));
    let on = rig.run(20);
    assert!(
        on[19].world_from_tool != last.world_from_tool && way_m(last, &on[19]) > 1e-5,
        "goes on"
    );
    rig.run(500);
    let given_up = |notice: &&Notice| {
        matches!(
            notice,
            Notice::Event {
                what: Happened::MotionGivenUp(Moved::SecondHand),
                ..
            }
        )
    };
    assert_eq!(rig.seen.iter().filter(given_up).count(), 1);
    rig.order(HapticOrder::KeepMoving(promise));
    let after = rig.run(100);
    assert!(way_m(&after[0], &after[99]) < 1.5e-4, "a new goal is needed");
}
