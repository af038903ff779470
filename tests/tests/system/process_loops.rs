//! A loop that stops, alone or with the whole process: the force is removed, the operator gets a message, and the run
//! can continue.

use std::time::Duration;
use stylet_shm_schema::{EventKind, Fault, Request, flags};
use stylet_tests::hand::{Insertion, assert_smooth, force_n};
use stylet_tests::stopped::StoppedThread;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, ask, left_behind, until};

const LONG: Duration = Duration::from_secs(20);

/// True if the operator's window reports the fault.
fn is_reported(link: &stylet_host::link::Link, fault: Fault) -> bool {
    let kind = EventKind::FaultRaised as u32;
    link.events()
        .iter()
        .any(|e| e.kind == kind && e.code == fault as u32 && e.text.read() == fault.message())
}

#[test]
fn tissue_that_stops_takes_the_force_off_and_the_operator_rearms() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.005);
        hand.press();
        let stopped = StoppedThread::stop(core.id(), "tissue");
        let faulted = hand.watch_until(Duration::from_secs(3), |link| {
            link.state().is_some_and(|s| s.fault != 0)
        });
        assert!(faulted, "no fault without tissue");
        hand.watch(Duration::from_millis(100));
        assert!(
            is_reported(&hand.link, Fault::TissueStale),
            "the operator has no message"
        );
        let raised = hand
            .records
            .iter()
            .position(|r| r.fault == Fault::TissueStale as u32)
            .expect("in the record");
        let ramp = hand.records[raised..]
            .iter()
            .position(|r| force_n(r) == 0.0)
            .expect("zero at last");
        println!("{:.2} N to zero in {ramp} ticks", force_n(&hand.records[raised - 1]));
        assert!(ramp <= 20, "{ramp} ticks to zero");

        // Still stopped: re-arming ends in the same fault, not in a force.
        ask(&mut hand.link, &Request::Engage).expect("taken");
        hand.watch(Duration::from_millis(100));
        let state = hand.link.state().expect("live");
        assert_eq!(
            (state.fault, state.flags & flags::ENGAGED),
            (Fault::TissueStale as u32, 0)
        );

        drop(stopped);
        hand.watch(Duration::from_millis(200));
        ask(&mut hand.link, &Request::Engage).expect("re-armed");
        hand.watch(Duration::from_secs(1));
        let last = hand.records.last().expect("records");
        assert!(
            last.fault == 0 && last.flags & flags::ENGAGED != 0,
            "not re-armed: {last:?}"
        );
        assert_smooth(&hand.records);
        drop(hand);
        let instance = core.instance.clone();
        core.finish();
        assert_eq!(left_behind(&instance), [""; 0]);
    });
}

/// The core used to end, and lost the placed seeds; a simulation has no motors that would need that.
#[test]
fn a_stopped_simulated_force_loop_is_waited_for_with_the_force_off() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.005);
        hand.press();
        let stopped = StoppedThread::stop(core.id(), "haptic");
        let reported = hand.watch_until(LONG, |link| is_reported(link, Fault::LoopStopped));
        assert!(reported && core.is_running(), "reported {reported}");
        drop(stopped);
        let faulted = hand.watch_until(LONG, |link| {
            link.state().is_some_and(|s| s.fault == Fault::LoopStopped as u32)
        });
        assert!(faulted, "{:?}", hand.link.state());
        hand.watch(Duration::from_millis(200));
        let state = *hand.link.state().expect("live");
        assert_eq!((state.flags & flags::ENGAGED, state.force_on_hand_n), (0, [0.0; 3]));
        assert!(state.since_start.missed > 200, "{:?}", state.since_start);
        assert_smooth(&hand.records);
        ask(&mut hand.link, &Request::Engage).expect("re-armed");
        let armed = hand.watch_until(LONG, |link| link.state().is_some_and(|s| s.fault == 0));
        assert!(armed, "{:?}", hand.link.state());
        assert!(
            hand.link
                .state()
                .is_some_and(|s| s.since_armed.missed < s.since_start.missed)
        );
        drop(hand);
        let report = core.finish();
        let missed = |name: &str| report["haptic"][name].as_u64().expect("a count");
        assert!(missed("missed_deadlines") > 200, "{report}");
        assert!(
            missed("missed_deadlines_since_armed") < missed("missed_deadlines"),
            "{report}"
        );
    });
}

#[test]
fn a_core_that_is_stopped_whole_and_goes_on_turns_the_force_off_and_lives() {
    where_the_machine_runs(|| {
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.005);
        hand.press();
        let send = |signal| {
            // SAFETY: a child of ours that has not been waited for.
            assert_eq!(unsafe { libc::kill(core.id() as libc::pid_t, signal) }, 0);
        };
        send(libc::SIGSTOP);
        let silent = until(Duration::from_secs(3), || {
            hand.take();
            !matches!(hand.link.status(), stylet_host::link::LinkStatus::Live)
        });
        assert!(silent, "the operator does not see that the core is silent");
        std::thread::sleep(Duration::from_millis(700));
        send(libc::SIGCONT);
        let back = hand.watch_until(Duration::from_secs(3), |link| {
            link.status() == stylet_host::link::LinkStatus::Live
        });
        assert!(back && core.is_running(), "the core did not come back");
        hand.watch(Duration::from_millis(500));
        assert_smooth(&hand.records);
        // Whichever loop woke first: after such a gap either nothing was late any more, or the force was removed with a
        // named fault.
        let last = hand.records.last().expect("records");
        let off = last.fault == Fault::TissueStale as u32 && force_n(last) == 0.0;
        let on = last.fault == 0 && last.flags & flags::ENGAGED != 0;
        assert!(off || on, "{last:?}");
        drop(hand);
        core.finish();
    });
}
