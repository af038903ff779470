//! The Phantom over a misbehaving driver: input of the force loop, output to the motors, and the end.

use fake_hd::Block;
use fake_hd::control::{get, put};
use nalgebra::Vector3;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use stylet_heap as heap;
use stylet_hw::libhd::{Api, ConnectionError, OpenError, diagnose};
use stylet_hw::{Arm, ArmError, Device, DeviceFault, Phantom, PhantomConfig, Severity, Wrench, conformance};
use stylet_tests::phantom::{Fake, config, drive, library};
use stylet_tests::until;

const LONG: Duration = Duration::from_secs(10);

fn push() -> Wrench {
    Wrench::from_force(Vector3::new(0.0, 1.0, 0.0))
}

fn quiet_arm() -> Arm {
    Box::new(|| Ok("not armed".to_owned()))
}

fn open(config: PhantomConfig) -> Result<Phantom, OpenError> {
    Phantom::open(config, quiet_arm(), Box::new(|text| println!("reported: {text}")))
}

/// Opens a device; returns it with the messages that it has reported so far.
fn open_listening(config: PhantomConfig) -> (Phantom, Arc<Mutex<Vec<String>>>) {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let ear = Arc::clone(&heard);
    let device = Phantom::open(
        config,
        quiet_arm(),
        Box::new(move |text| ear.lock().unwrap().push(text.to_owned())),
    );
    (device.expect("a device"), heard)
}

fn feels(fake: &Fake, y_n: f64) -> impl Fn() -> bool {
    let control = fake.control;
    move || (control.force()[1] - y_n).abs() < 1e-9
}

#[test]
fn the_phantom_meets_the_contract() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &Wrench::zero(), LONG, Result::is_ok));
    conformance::check(&mut device);
    assert!(until(LONG, || fake.control.force() == [0.0; 3]));
    let far_too_much = Wrench::from_force(Vector3::repeat(1e300));
    let size = || Vector3::from(fake.control.force()).norm();
    assert!(drive(&mut device, &far_too_much, LONG, |_| (size() - 8.5).abs() < 1e-9));
    assert_eq!(fake.control.non_finite_forces.load(Relaxed), 0);
    assert!(
        get(&fake.control.peak_force_n) <= 8.5 * (1.0 + 1e-9),
        "saturated before the driver sees it"
    );
}

#[test]
fn pose_and_force_change_frames_and_units_as_stated() {
    let fake = Fake::new();
    let mut device = fake.open();
    // To the operator's right, up, and away.
    fake.control.send_hand([0.01, 0.02, -0.03], 0.1);
    let there = Vector3::new(-0.01, 0.02, 0.03);
    assert!(drive(&mut device, &Wrench::zero(), LONG, |s| {
        s.is_ok_and(|s| (s.tip_in_world - there).norm() < 1e-4 && (s.direction_in_world() - Vector3::z()).norm() < 1e-9)
    }));
    fake.control.buttons.store(0b101, Relaxed);
    assert!(drive(&mut device, &Wrench::zero(), LONG, |s| s
        .is_ok_and(|s| s.buttons == 0b101)));
    let wrench = Wrench::from_force(Vector3::new(1.0, 2.0, 3.0));
    let expected = [-1.0, 2.0, -3.0];
    assert!(drive(&mut device, &wrench, LONG, |_| {
        fake.control
            .force()
            .iter()
            .zip(expected)
            .all(|(sent, want)| (sent - want).abs() < 1e-12)
    }));
}

#[test]
fn torque_about_the_needle_turns_the_roll_joint_within_its_limits() {
    let fake = Fake::new();
    let mut device = fake.open();
    let about = |torque_nm: Vector3<f64>| Wrench {
        torque_nm,
        ..Wrench::zero()
    };
    let torque = || fake.control.torque_mnm.each_ref().map(get);
    let near = |want: [f64; 3]| move |torque: [f64; 3]| torque.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9);
    // World +z is away from the operator: clockwise for the operator, which the roll joint counts as positive.
    let roll = near([0.0, 0.0, 40.0]);
    assert!(
        drive(&mut device, &about(Vector3::z() * 0.04), LONG, |_| roll(torque())),
        "{:?}",
        torque()
    );
    // About world +x, the operator's left: the tip goes down, which the lift joint counts as positive.
    let lift = near([0.0, 100.0, 0.0]);
    assert!(
        drive(&mut device, &about(Vector3::x() * 0.1), LONG, |_| lift(torque())),
        "{:?}",
        torque()
    );
    let limited = near([0.0, 0.0, 48.0]);
    assert!(
        drive(&mut device, &about(Vector3::z() * 0.1), LONG, |_| limited(torque())),
        "{:?}",
        torque()
    );
    // With the stylus rolled by a quarter turn, the lift joint stays, since it lies below the roll.
    put(&fake.control.gimbal_rad[2], std::f64::consts::FRAC_PI_2);
    assert!(
        drive(&mut device, &about(Vector3::x() * 0.1), LONG, |_| lift(torque())),
        "{:?}",
        torque()
    );
    fake.control.nan.store(3, Relaxed);
    let none = near([0.0; 3]);
    assert!(
        drive(&mut device, &about(Vector3::x() * 0.1), LONG, |_| none(torque())),
        "angles that are not numbers"
    );
}

#[test]
fn a_device_without_torque_gets_none_and_its_smaller_limit_counts() {
    let fake = Fake::new();
    fake.control.model.store(2, Relaxed);
    let mut device = fake.open();
    let info = device.info();
    assert_eq!(
        (info.name, info.peak_force_n, info.continuous_force_n),
        ("Phantom Omni", 3.3, 0.88)
    );
    let wrench = Wrench {
        force_n: Vector3::y() * 100.0,
        torque_nm: Vector3::z(),
    };
    assert!(drive(&mut device, &wrench, LONG, |_| (fake.control.force()[1] - 3.3)
        .abs()
        < 1e-9));
    assert_eq!(fake.control.torque_mnm.each_ref().map(get), [0.0; 3]);
    assert_eq!(device.error_count(), 0, "the driver had nothing to complain of");
}

#[test]
fn the_names_are_tried_in_order_and_one_that_was_asked_for_alone() {
    let fake = Fake::new();
    for (only, asked, inits) in [(1, None, 1), (2, None, 2), (3, None, 3), (2, Some("Default Device"), 1)] {
        fake.control.reset();
        fake.control.only_name.store(only, Relaxed);
        let name = asked.map(str::to_owned);
        drop(open(PhantomConfig { name, ..config() }).expect("known by one of its names"));
        assert_eq!(fake.control.calls_of("hdInitDevice"), inits);
    }
    let name = Some("Left".to_owned());
    let Err(OpenError::Connection(ConnectionError::NoDevice(tried))) =
        open(PhantomConfig { name, ..config() }).map(drop)
    else {
        panic!("only the name that was asked for counts");
    };
    assert_eq!(tried, [("Left".to_owned(), 0x0300)]);
}

#[test]
fn what_is_missing_is_said_in_words_that_help() {
    let fake = Fake::new();
    let nowhere = Some("/nonexistent/libHD.so".into());
    let why = open(PhantomConfig {
        library: nowhere,
        ..config()
    })
    .map(drop)
    .unwrap_err()
    .to_string();
    assert!(
        why.contains("/nonexistent/libHD.so: cannot open shared object file"),
        "{why}"
    );
    let program = Some(stylet_tests::program("rt-core"));
    let why = open(PhantomConfig {
        library: program,
        ..config()
    })
    .map(drop)
    .unwrap_err()
    .to_string();
    assert!(why.contains("/rt-core: "), "{why}");

    fake.control.unplugged.store(1, Relaxed);
    let why = open(config()).map(drop).unwrap_err().to_string();
    assert!(
        why.contains("HD_DEVICE_FAULT") && why.contains("power and cable"),
        "{why}"
    );
    fake.control.reset();
    fake.control.model.store(3, Relaxed);
    let why = open(config()).map(drop).unwrap_err().to_string();
    assert!(
        why.contains("Novint Falcon") && why.contains("Phantom Premium 1.5 6DOF"),
        "{why}"
    );
    fake.control.reset();
    fake.control.no_force.store(1, Relaxed);
    let why = open(config()).map(drop).unwrap_err().to_string();
    assert!(why.contains("amplifiers"), "{why}");
    fake.control.reset();
    fake.control.stalled.store(1, Relaxed);
    let why = open(config()).map(drop).unwrap_err().to_string();
    assert!(why.contains("servo loop does not run"), "{why}");
    fake.control.reset();
    let refused = Phantom::open(config(), Box::new(|| Err(ArmError::new("no rights"))), Box::new(|_| ()));
    let why = refused.map(drop).unwrap_err().to_string();
    assert!(why.contains("no rights"), "{why}");
    fake.control.reset();
    drop(open(config()).expect("nothing of the failed tries was left open"));
}

#[test]
fn an_error_in_any_call_of_the_start_is_named_and_leaves_nothing_open() {
    let fake = Fake::new();
    for call in [
        "hdInitDevice",
        "hdMakeCurrentDevice",
        "hdGetString",
        "hdGetIntegerv",
        "hdGetDoublev",
        "hdCheckCalibration",
        "hdEnable",
        "hdIsEnabled",
        "hdScheduleAsynchronous",
        "hdSetSchedulerRate",
        "hdStartScheduler",
    ] {
        fake.control.reset();
        fake.control.fail(call, 0x0302, 3);
        let why = open(config()).map(drop).expect_err(call).to_string();
        println!("{call}: {why}");
        let names_the_cause =
            why.contains("HD_COMM_ERROR") || why.contains("\"unknown\"") || why.contains("amplifiers");
        assert!(names_the_cause, "{call}: {why}");
        fake.control.reset();
        drop(open(config()).unwrap_or_else(|e| panic!("after {call}: {e}")));
    }
}

#[test]
fn a_premium_is_calibrated_only_when_the_operator_presses_the_button() {
    let fake = Fake::new();
    fake.control.uncalibrated.store(1, Relaxed);
    let (mut device, heard) = open_listening(config());
    assert_eq!(device.read(1e-3), Err(DeviceFault::NotCalibrated));
    assert_eq!(device.write(&Wrench::zero()), Ok(()));
    assert!(until(LONG, || heard
        .lock()
        .unwrap()
        .iter()
        .any(|t| t.contains("neutral pose"))));
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(
        fake.control.calls_of("hdUpdateCalibration"),
        0,
        "the arm may be anywhere"
    );
    fake.control.in_neutral_pose.store(1, Relaxed);
    fake.control.buttons.store(1, Relaxed);
    assert!(drive(&mut device, &Wrench::zero(), LONG, Result::is_ok));
    assert_eq!(fake.control.miscalibrated.load(Relaxed), 0);
    assert_eq!(fake.control.calls_of("hdUpdateCalibration"), 1);
}

#[test]
fn inkwell_and_automatic_calibration_wait_for_the_driver() {
    for (style, word) in [(4, "inkwell"), (5, "inkwell"), (2, "")] {
        let fake = Fake::new();
        fake.control.uncalibrated.store(1, Relaxed);
        fake.control.calibration_style.store(style, Relaxed);
        let (mut device, heard) = open_listening(config());
        assert!(until(LONG, || heard.lock().unwrap().iter().any(|t| t.contains(word))));
        fake.control.in_inkwell.store(1, Relaxed);
        assert!(
            drive(&mut device, &Wrench::zero(), LONG, Result::is_ok),
            "style {style}"
        );
    }
}

#[test]
fn late_callbacks_repeat_a_sample_and_none_at_all_is_a_fault_that_heals() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    fake.control.late_us.store(20_000, Relaxed);
    let (mut last, mut repeated) = (0, 0);
    assert!(drive(&mut device, &push(), LONG, |s| {
        let sequence = s.map_or(last, |s| s.sequence);
        repeated += u32::from(sequence == last);
        assert!(sequence >= last, "the sequence goes back");
        last = sequence;
        repeated > 5
    }));
    fake.control.late_us.store(0, Relaxed);
    fake.control.stalled.store(1, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| *s == Err(DeviceFault::TimedOut)));
    fake.control.stalled.store(0, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| {
        let goes_on = s.is_err() || s.is_ok_and(|s| s.sequence > last);
        assert!(goes_on, "the sequence goes on from where it was");
        s.is_ok()
    }));
}

#[test]
fn a_pose_that_is_no_number_never_leaves_the_back_end() {
    let fake = Fake::new();
    let mut device = fake.open();
    for nan in [1, 2] {
        assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
        fake.control.nan.store(nan, Relaxed);
        assert!(drive(&mut device, &push(), LONG, |s| {
            assert!(s.is_err() || s.is_ok_and(|s| s.is_finite()));
            *s == Err(DeviceFault::NonFiniteSample)
        }));
        assert!(drive(&mut device, &push(), LONG, |_| fake.control.force() == [0.0; 3]));
        fake.control.nan.store(0, Relaxed);
    }
    assert!(drive(&mut device, &push(), LONG, Result::is_ok));
}

#[test]
fn warm_motors_turn_the_force_off_until_they_have_cooled() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    fake.control.temperature_milli.store(960, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| *s == Err(DeviceFault::Overheated)));
    assert!(drive(&mut device, &push(), LONG, |_| fake.control.force() == [0.0; 3]));
    // Below the limit, above the one for resuming.
    fake.control.temperature_milli.store(900, Relaxed);
    let back = drive(&mut device, &push(), Duration::from_millis(1200), Result::is_ok);
    assert!(!back, "they have hardly cooled");
    fake.control.temperature_milli.store(700, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    fake.control.warm_motors.store(1, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| *s == Err(DeviceFault::Overheated)));
}

#[test]
fn a_force_that_nobody_renews_is_released() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    assert!(
        until(LONG, || fake.control.force() == [0.0; 3]),
        "the force loop has stopped"
    );
    // The force is cut first; the fault is reported at the end of the same tick.
    assert!(until(LONG, || device.read(1e-3) == Err(DeviceFault::TimedOut)));
    assert!(
        drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()),
        "and goes on"
    );
}

#[test]
fn unplugged_and_plugged_in_again_without_loading_the_library_anew() {
    let fake = Fake::new();
    let (mut device, heard) = open_listening(config());
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    fake.control.unplugged.store(1, Relaxed);
    // Its pose is not a number either; the operator must be told about the cable.
    let mut first = None;
    assert!(drive(&mut device, &push(), LONG, |s| {
        first = s.err();
        first.is_some()
    }));
    assert_eq!(first, Some(DeviceFault::NotConnected));
    assert!(drive(&mut device, &push(), LONG, |_| fake.control.force() == [0.0; 3]));
    assert!(until(LONG, || heard
        .lock()
        .unwrap()
        .iter()
        .any(|t| t.contains("power and cable"))));
    assert!(
        until(LONG, || fake.control.calls_of("hdInitDevice") > 9),
        "it goes on looking"
    );
    assert_eq!(fake.control.inits.load(Relaxed), 1);
    fake.control.unplugged.store(0, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    assert_eq!(fake.control.inits.load(Relaxed), 2);
    // The hand feels it before the report.
    let is_reported = || {
        heard
            .lock()
            .unwrap()
            .last()
            .is_some_and(|t| t.contains("PHANTOM Premium"))
    };
    assert!(until(LONG, is_reported), "{:#?}", heard.lock().unwrap());
    let reported = heard.lock().unwrap().clone();
    assert!(
        reported.windows(2).all(|pair| pair[0] != pair[1]),
        "no message twice in a row: {reported:#?}"
    );
    assert!(
        reported.last().unwrap().contains("PHANTOM Premium 1.5 6DOF"),
        "{reported:#?}"
    );
}

#[test]
fn another_model_after_a_reconnect_is_refused() {
    let fake = Fake::new();
    let (mut device, heard) = open_listening(config());
    assert!(drive(&mut device, &push(), LONG, Result::is_ok));
    fake.control.unplugged.store(1, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| s.is_err()));
    fake.control.model.store(2, Relaxed);
    fake.control.unplugged.store(0, Relaxed);
    assert!(until(LONG, || heard
        .lock()
        .unwrap()
        .iter()
        .any(|t| t.contains("in place of"))));
    assert!(drive(&mut device, &push(), Duration::from_millis(100), |s| s.is_err()));
    assert_eq!(device.info().peak_force_n, 8.5);
}

#[test]
fn a_dropped_device_is_zeroed_stopped_unscheduled_then_disabled() {
    let fake = Fake::new();
    let mut device = fake.open();
    let strong = Wrench::from_force(Vector3::new(0.0, 8.0, 0.0));
    assert!(drive(&mut device, &strong, LONG, |_| feels(&fake, 8.0)()));
    drop(device);
    assert_eq!(
        get(&fake.control.force_at_stop_n),
        0.0,
        "zero before the scheduler stopped"
    );
    let order = fake.control.order();
    let last = |name| {
        order
            .iter()
            .rposition(|n| *n == name)
            .unwrap_or_else(|| panic!("{name} was not called"))
    };
    let ends = ["hdStopScheduler", "hdUnschedule", "hdDisableDevice"].map(last);
    assert!(ends.is_sorted(), "{order:?}");
}

#[test]
fn a_panic_in_the_callback_stays_in_it_and_leaves_zero_force() {
    let fake = Fake::new();
    // The panic hook prints; the unwinding ends inside the callback.
    let arm = Box::new(|| panic!("a fault of ours, on purpose"));
    let opened = Phantom::open(config(), arm, Box::new(|_| ()));
    assert!(opened.is_err());
    assert_eq!(fake.control.force(), [0.0; 3]);
    drop(fake.open());
}

/// The servo thread of a reconnected device used to exert the newest force until the connector saw that arming had
/// failed.
#[test]
fn a_servo_thread_that_could_not_be_armed_exerts_no_force() {
    let fake = Fake::new();
    let first = AtomicBool::new(true);
    let arm = move || match first.swap(false, Relaxed) {
        true => Ok("armed".to_owned()),
        false => Err(ArmError::new("no rights")),
    };
    let mut device = Phantom::open(config(), Box::new(arm), Box::new(|_| ())).expect("a device");
    assert!(drive(&mut device, &push(), LONG, |s| s.is_ok() && feels(&fake, 1.0)()));
    fake.control.unplugged.store(1, Relaxed);
    assert!(drive(&mut device, &push(), LONG, Result::is_err));
    assert!(drive(&mut device, &push(), LONG, |_| fake.control.force() == [0.0; 3]));
    let begin = fake.control.ticks.load(Relaxed);
    fake.control.unplugged.store(0, Relaxed);
    assert!(drive(&mut device, &push(), LONG, |s| {
        assert!(s.is_err());
        fake.control.inits.load(Relaxed) > 3
    }));
    let end = fake.control.ticks.load(Relaxed);
    assert!(end > begin, "the servo thread ran");
    for tick in begin..end {
        assert_eq!(fake.control.force_at(tick), [0.0; 3], "tick {tick} of {begin}..{end}");
    }
}

/// Heap calls of the servo thread at the last end of a frame, and the most between two of them.
static AT_LAST_FRAME: AtomicU64 = AtomicU64::new(0);
static FRAMES: AtomicU32 = AtomicU32::new(0);
static MOST: AtomicU64 = AtomicU64::new(0);
static END_FRAME: std::sync::OnceLock<unsafe extern "system" fn(u32)> = std::sync::OnceLock::new();

unsafe extern "system" fn counted_end_frame(handle: u32) {
    let calls = heap::calls_of_this_thread();
    // The first frame comes after arming, which may allocate.
    if FRAMES.fetch_add(1, Relaxed) > 0 {
        MOST.fetch_max(calls - AT_LAST_FRAME.load(Relaxed), Relaxed);
    }
    AT_LAST_FRAME.store(calls, Relaxed);
    // SAFETY: passed on unchanged.
    unsafe { END_FRAME.get().expect("set before")(handle) };
}

#[test]
fn the_callback_makes_no_heap_call() {
    let fake = Fake::new();
    let mut api = Api::load(Some(&library())).unwrap();
    let _ = END_FRAME.set(api.hdEndFrame);
    api.hdEndFrame = counted_end_frame;
    let mut device = Phantom::open_with(api, config(), quiet_arm(), Box::new(|_| ())).expect("a device");
    let wrench = Wrench {
        torque_nm: Vector3::z() * 0.02,
        ..push()
    };
    assert!(drive(&mut device, &wrench, LONG, |_| FRAMES.load(Relaxed) > 1000));
    // Also during faults and errors.
    fake.control.nan.store(1, Relaxed);
    fake.control.warm_motors.store(1, Relaxed);
    let before = FRAMES.load(Relaxed);
    assert!(drive(&mut device, &wrench, LONG, |_| FRAMES.load(Relaxed) > before + 200));
    assert_eq!(MOST.load(Relaxed), 0);
}

#[test]
fn a_force_reaches_the_motors_one_servo_tick_after_its_pose() {
    let fake = Fake::new();
    fake.control.buttons_count.store(1, Relaxed);
    let mut device = fake.open();
    assert!(drive(&mut device, &push(), LONG, Result::is_ok));
    // The answer to the pose of tick n carries n.
    let answer_n = |tick: u64| 1.0 + (tick % 4096) as f64 * 1e-3;
    let (mut ticks, mut last) = (Vec::new(), 0);
    assert!(until(LONG, || {
        let tick = u64::from(device.read(1e-3).map_or(0, |s| s.buttons));
        if tick > last {
            last = tick;
            ticks.push(tick);
            let _ = device.write(&Wrench::from_force(Vector3::new(0.0, answer_n(tick), 0.0)));
        }
        ticks.len() > 500
    }));
    let is_sent = |tick: u64, answer: f64| (fake.control.force_at(tick)[1] - answer).abs() < 1e-9;
    let answered = ticks.iter().filter_map(|&t| {
        (t..t + 50)
            .find(|&later| is_sent(later, answer_n(t)))
            .map(|later| later - t)
    });
    let mut delays: Vec<u64> = answered.collect();
    delays.sort_unstable();
    let (least, median) = (delays[0], delays[delays.len() / 2]);
    println!(
        "servo ticks from pose to force, {} answers: least {least}, median {median}",
        delays.len()
    );
    assert_eq!(least, 1, "what a loop beside the servo loop can do, and no more");
    assert!(delays.len() > 250, "most answers reach the motors");
}

#[test]
fn the_doctor_names_what_the_driver_says_of_the_device() {
    let fake = Fake::new();
    let api = Api::load(Some(&library())).unwrap();
    let worst = |word: &str| {
        let findings = diagnose::of_device(&api, None);
        let found = findings.iter().find(|f| f.what.contains(word));
        found.unwrap_or_else(|| panic!("{word}: {findings:#?}")).clone()
    };
    assert_eq!(worst("PHANTOM Premium 1.5 6DOF").severity, Severity::Good);
    assert_eq!(worst("is calibrated").severity, Severity::Good);
    fake.control.uncalibrated.store(1, Relaxed);
    assert!(worst("not calibrated").cure.contains("neutral pose"));
    fake.control.uncalibrated.store(0, Relaxed);
    fake.control.model.store(1, Relaxed);
    assert_eq!(worst("no torques").severity, Severity::Note);
    fake.control.model.store(3, Relaxed);
    assert_eq!(worst("Novint Falcon").severity, Severity::Problem);
    fake.control.unplugged.store(1, Relaxed);
    assert!(worst("no device").cure.contains("power and cable"));
    let mut held = Vec::new();
    fake.control.reset();
    held.push(fake.open());
    assert!(worst("HD_DEVICE_ALREADY_INITIATED").cure.contains("another program"));
}
