//! The whole procedure with a Phantom: the fake driver in the core's process, its hand moved by the test.

use fake_hd::control::{VARIABLE, get};
use fake_hd::{Block, Control};
use nalgebra::Vector3;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use stylet_host::link::Link;
use stylet_implant::workflow::{Pace, Run, RunStatus, Step, default_plan};
use stylet_shm_schema::{Event, EventKind, Fault, PlannedNeedle, Request, SEED_LENGTH_M, TickRecord, flags};
use stylet_tests::phantom::library;
use stylet_tests::stopped::{StoppedThread, is_dead};
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, left_behind, scratch, until};

const LONG: Duration = Duration::from_secs(20);

/// The host is dropped before its core.
struct Rig {
    link: Link,
    core: Core,
    control: &'static Control,
    /// Origin of the device in the scene.
    origin_m: Vector3<f64>,
}

impl Rig {
    /// Selects the driver by the variable or by the option, as an operator would.
    fn start(name: &str, by_variable: bool) -> Self {
        let file = scratch(name).join("control");
        let control = Control::in_file(&file);
        let path = library();
        let path = path.to_str().expect("a path in UTF-8");
        let variables = [
            (VARIABLE, file.to_str().expect("a path in UTF-8")),
            ("STYLET_LIBHD", path),
        ];
        let mut options = vec!["--rt-if-allowed", "--device", "phantom"];
        let given = if by_variable {
            &variables[..]
        } else {
            options.extend(["--libhd", path]);
            &variables[..1]
        };
        let mut core = Core::start_in(&options, given);
        let mut link = core.host();
        assert!(until(LONG, || {
            link.poll();
            link.state().is_some_and(|s| s.tick > 10)
        }));
        let state = *link.state().expect("live");
        assert_eq!(state.fault, 0, "{:?}", Fault::from_number(state.fault));
        let origin_m = Vector3::from(state.tip_in_scene_m);
        Self {
            link,
            core,
            control,
            origin_m,
        }
    }

    /// Moves the hand there: scene z is away from the operator, scene x to the left.
    fn lead(&self, to_m: [f64; 3], speed_m_per_s: f64) {
        let from_origin = Vector3::from(to_m) - self.origin_m;
        self.control
            .send_hand([-from_origin.x, from_origin.y, -from_origin.z], speed_m_per_s);
    }

    fn fault(&self) -> Fault {
        Fault::from_number(self.link.state().expect("live").fault).expect("a known fault")
    }

    fn felt_n(&self) -> f64 {
        Vector3::from(self.control.force()).norm()
    }
}

/// Returns the goal of the operator's hand for the script's present step.
fn goal(run: &Run, plan: &PlannedNeedle, seeds_dropped: usize) -> Option<[f64; 3]> {
    // A seed leaves with its deeper end at the tip.
    let tip_m = |seed_m: &[f64; 3]| [0, 1, 2].map(|a| seed_m[a] + plan.direction[a] * 0.5 * SEED_LENGTH_M);
    match run.step() {
        Step::Plan | Step::Done => None,
        Step::Place => Some(plan.entry_m),
        Step::Insert => plan.seeds_m.first().map(tip_m),
        Step::Drop => plan.seeds_m.get(seeds_dropped).map(tip_m),
        Step::Retract | Step::Settle => Some(plan.entry_m),
    }
}

/// With real motors the core ends, since only its end releases them; a recording is then needed.
#[test]
fn a_stopped_force_loop_over_a_phantom_ends_the_core_with_a_recording() {
    where_the_machine_runs(|| {
        let mut rig = Rig::start("phantom-stopped", true);
        let stopped = StoppedThread::stop(rig.core.id(), "haptic");
        let id = rig.core.id();
        assert!(
            until(LONG, || is_dead(id)),
            "a core whose force loop stands still must end"
        );
        drop(stopped);
        let status = rig.core.ended(LONG).expect("dead");
        assert_eq!(status.code(), Some(1), "it ends with an error, not by a signal");
        rig.link.poll();
        let is_why = |e: &Event| e.code == Fault::LoopStopped as u32 && e.text.read().contains("rt-core ended");
        assert!(rig.link.events().iter().any(is_why), "{:?}", rig.link.events().back());
        let flights = rig.core.flights();
        assert_eq!(flights.len(), 1, "{flights:?}");
        let (instance, Rig { link, core, .. }) = (rig.core.instance.clone(), rig);
        drop(link);
        drop(core);
        assert_eq!(left_behind(&instance), [""; 0]);
    });
}

#[test]
fn the_whole_procedure_runs_with_a_phantom_and_its_motors_get_the_force() {
    where_the_machine_runs(|| {
        let mut rig = Rig::start("phantom-procedure", true);
        assert!(
            rig.link
                .session()
                .expect("live")
                .device
                .read()
                .contains("Phantom Premium 1.5 6DOF")
        );
        assert_eq!(rig.link.state().expect("live").flags & flags::SIMULATED_DEVICE, 0);
        let plan = default_plan(&rig.link.scene().expect("live").header);
        let mut run = Run::new(plan.clone(), Pace::default());
        let (mut status, mut led, mut records) = (RunStatus::Working, None, Vec::<TickRecord>::new());
        let ended = until(Duration::from_secs(120), || {
            rig.link.poll();
            records.append(&mut rig.link.take_records());
            let dropped = rig.link.state().map_or(0, |s| s.seed_count as usize);
            let goal = goal(&run, &plan, dropped);
            if goal != led
                && let Some(to_m) = goal
            {
                rig.lead(to_m, 0.05);
                led = goal;
            }
            status = run.advance(&mut rig.link);
            status != RunStatus::Working
        });
        assert!(ended && status == RunStatus::Done, "{status:?}");
        let largest = records
            .iter()
            .map(|r| Vector3::from(r.force_on_hand_n).norm())
            .fold(0.0, f64::max);
        let commanded = get(&rig.control.peak_force_n);
        println!("largest force: {largest:.3} N in the records, {commanded:.3} N commanded to the driver");
        assert!(
            records.iter().any(|r| r.flags & flags::PUNCTURED != 0),
            "the membrane gave way"
        );
        assert!(largest > 3.0, "{largest} N");
        // Two grids of 1 kHz: the tick of the peak itself may be skipped.
        assert!(
            (commanded - largest).abs() < 0.1 * largest,
            "{commanded} N commanded, {largest} N meant"
        );
        assert_eq!(rig.control.non_finite_forces.load(Relaxed), 0);
        assert_eq!(rig.link.snapshot().expect("live").header.seed_count, 5);
        let control = rig.control;
        drop(rig.link);
        rig.core.finish();
        assert_eq!(get(&control.force_at_stop_n), 0.0);
        let order = control.order();
        assert_eq!(
            order.iter().rfind(|call| **call != "hdGetError"),
            Some(&"hdDisableDevice"),
            "released at the end"
        );
    });
}

#[test]
fn unplugging_turns_the_force_off_with_a_message_until_replugged() {
    where_the_machine_runs(|| {
        let mut rig = Rig::start("phantom-unplugged", false);
        let plan = default_plan(&rig.link.scene().expect("live").header);
        ask(&mut rig.link, &Request::Engage).expect("engages");
        rig.lead(plan.entry_m, 0.1);
        let entry = Vector3::from(plan.entry_m);
        let tip = |link: &Link| Vector3::from(link.state().expect("live").tip_in_scene_m);
        assert!(until(LONG, || {
            rig.link.poll();
            (tip(&rig.link) - entry).norm() < 2e-3
        }));
        rig.lead(plan.seeds_m[0], 0.02);
        assert!(
            until(LONG, || {
                rig.link.poll();
                rig.felt_n() > 1.0
            }),
            "in the membrane"
        );
        rig.link.take_records();

        rig.control.unplugged.store(1, Relaxed);
        assert!(
            until(LONG, || {
                rig.link.poll();
                rig.fault() == Fault::DeviceLost
            }),
            "{:?}",
            rig.fault()
        );
        assert!(
            until(LONG, || {
                rig.link.poll();
                rig.felt_n() == 0.0
            }),
            "the motors are released"
        );
        let at_zero = |link: &Link| {
            link.state()
                .is_some_and(|s| s.force_on_hand_n == [0.0; 3] && s.flags & flags::ENGAGED == 0)
        };
        assert!(
            until(LONG, || {
                rig.link.poll();
                at_zero(&rig.link)
            }),
            "zero in the loop's own state"
        );
        let said = |link: &Link| {
            link.events()
                .iter()
                .rev()
                .find(|e| e.kind == EventKind::FaultRaised as u32)
                .map(|e| e.text.read())
        };
        assert!(until(LONG, || {
            rig.link.poll();
            said(&rig.link).is_some_and(|t| t.contains("power and cable"))
        }));
        // The force of the loop ramps to zero and stays there. Records come in batches, after the event.
        let (mut records, mut lost) = (Vec::<TickRecord>::new(), None);
        assert!(
            until(LONG, || {
                rig.link.poll();
                records.append(&mut rig.link.take_records());
                lost = records.iter().position(|r| r.fault == Fault::DeviceLost as u32);
                lost.is_some_and(|lost| records.len() > lost + 100)
            }),
            "in the records"
        );
        let lost = lost.expect("seen");
        let late = records.iter().skip(lost + 21).find(|r| r.force_on_hand_n != [0.0; 3]);
        assert!(late.is_none(), "{late:?}");
        // Re-arming without a device has no effect.
        ask(&mut rig.link, &Request::Engage).expect("answered");
        assert!(until(LONG, || {
            rig.link.poll();
            rig.fault() == Fault::DeviceLost && at_zero(&rig.link)
        }));

        rig.control.unplugged.store(0, Relaxed);
        assert!(until(LONG, || rig.control.inits.load(Relaxed) == 2), "initialised anew");
        let moving = |link: &Link, from: Vector3<f64>| (tip(link) - from).norm() > 1e-3;
        let before = tip(&rig.link);
        rig.lead(plan.entry_m, 0.05);
        assert!(
            until(LONG, || {
                rig.link.poll();
                moving(&rig.link, before)
            }),
            "the pose comes again"
        );
        // Inside the membrane the gate would wait for a small force.
        assert!(until(LONG, || {
            rig.link.poll();
            (tip(&rig.link) - entry).norm() < 2e-3
        }));
        assert_eq!(rig.felt_n(), 0.0, "no force before it is armed again");
        let mut armed = false;
        assert!(
            until(LONG, || {
                armed |= ask(&mut rig.link, &Request::Engage).is_ok();
                rig.link.poll();
                rig.fault() == Fault::None
            }),
            "{armed} {:?}",
            rig.fault()
        );
        rig.lead(plan.seeds_m[0], 0.02);
        assert!(
            until(LONG, || {
                rig.link.poll();
                rig.felt_n() > 0.5
            }),
            "felt again"
        );
        drop(rig.link);
        rig.core.finish();
    });
}

#[test]
fn without_a_driver_the_core_says_so_and_does_not_run() {
    let output = std::process::Command::new(stylet_tests::program("rt-core"))
        .args([
            "--instance",
            stylet_tests::fresh_instance().name(),
            "--rt-if-allowed",
            "--device",
            "phantom",
        ])
        .args(["--libhd", "/nonexistent/libHD.so"])
        .output()
        .expect("rt-core starts");
    assert!(!output.status.success());
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(
        text.contains("cannot open shared object file") && text.contains("--device simulated"),
        "{text}"
    );
}
