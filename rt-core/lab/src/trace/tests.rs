//! Causes decoded from saved texts of the kernel's trace. The thread of the loop is `haptic-500`, `SCHED_FIFO` 80.

use super::blame::{self, Cause, Kind};
use super::{event, timeline};

const LOOP: i32 = 500;
const PRIORITY: i32 = 19;

/// Causes of a tick due at 10.001000 s that woke at `woke_us` microseconds after 10 s.
fn causes(text: &str, woke_us: u64) -> Vec<Cause> {
    let ns = |us: u64| 10_000_000_000 + us * 1_000;
    let events = event::events(text, 0);
    let pieces = timeline::pieces(&events, LOOP, PRIORITY, ns(1_000), ns(woke_us)).expect("covered");
    blame::causes(&pieces, ns(woke_us))
}

/// Returns a trace in which the loop went to sleep at 10.000020 and `lines` follow.
fn after_sleep(to: &str, lines: &[&str]) -> String {
    let mut text = format!(
        "          haptic-500     [001] d..2.  10.000020: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=S ==> {to}\n"
    );
    // An interrupt is listed under the interrupted thread: that of the line before.
    let mut thread = "<idle>-0";
    for line in lines {
        let (of, rest) = line.split_once(' ').expect("a thread and an event");
        thread = if of == "x-9" { thread } else { of };
        text += &format!("  {thread} {rest}\n");
    }
    text
}

const TO_IDLE: &str = "next_comm=swapper/1 next_pid=0 next_prio=120";
const WAKES: &str = "x-9 [001] dNh1. 10.001005: sched_waking: comm=haptic pid=500 prio=19 target_cpu=001";

fn first(text: &str, woke_us: u64) -> Cause {
    let all = causes(text, woke_us);
    all.into_iter().next().unwrap_or_else(|| panic!("no cause in\n{text}"))
}

#[test]
fn a_wake_up_in_time_has_no_cause() {
    let text = after_sleep(
        TO_IDLE,
        &[
            "<idle>-0 [001] d.h1. 10.001002: local_timer_entry: vector=236",
            "<idle>-0 [001] d.h2. 10.001003: hrtimer_expire_entry: hrtimer=0001 function=hrtimer_wakeup now=10001000000",
            WAKES,
            "<idle>-0 [001] d.h1. 10.001006: hrtimer_expire_exit: hrtimer=0001",
            "<idle>-0 [001] d.h1. 10.001007: local_timer_exit: vector=236",
            "<idle>-0 [001] d..2. 10.001009: sched_switch: prev_comm=swapper/1 prev_pid=0 prev_prio=120 prev_state=R ==> next_comm=haptic next_pid=500 next_prio=19",
            "haptic-500 [001] d..2. 10.001040: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=S ==> next_comm=swapper/1 next_pid=0 next_prio=120",
        ],
    );
    assert_eq!(causes(&text, 1_012), []);
}

/// Some kernels record no switch away from the idle thread; the name before each event then shows the thread on the
/// core.
#[test]
fn a_rival_is_named_where_the_kernel_records_no_switch_from_idle() {
    let text = after_sleep(
        TO_IDLE,
        &[
            "<idle>-0 [001] d.h1. 10.000900: local_timer_entry: vector=236",
            "<idle>-0 [001] d.h3. 10.000901: sched_waking: comm=rival pid=600 prio=9 target_cpu=001",
            "<idle>-0 [001] d.h1. 10.000903: local_timer_exit: vector=236",
            "rival-600 [001] d.h.. 10.001002: local_timer_entry: vector=236",
            WAKES,
            "rival-600 [001] d.h1. 10.001007: local_timer_exit: vector=236",
            "rival-600 [001] d.h.. 10.001407: local_timer_entry: vector=236",
            "rival-600 [001] d.h1. 10.001408: local_timer_exit: vector=236",
            "rival-600 [001] d..2. 10.001507: sched_switch: prev_comm=rival prev_pid=600 prev_prio=9 prev_state=S ==> next_comm=haptic next_pid=500 next_prio=19",
        ],
    );
    let cause = first(&text, 1_510);
    assert_eq!(
        (cause.kind, cause.who.as_str(), cause.priority),
        (Kind::HigherPriority, "rival", Some(90))
    );
    assert!((cause.us - 499.0).abs() < 2.0, "{cause:?}");
    // The loop itself, taken from the idle core without a switch: its long work is its own.
    let text = after_sleep(
        TO_IDLE,
        &[
            "<idle>-0 [001] d.h1. 10.001002: local_timer_entry: vector=236",
            WAKES,
            "<idle>-0 [001] d.h1. 10.001007: local_timer_exit: vector=236",
            "haptic-500 [001] d..2. 10.001900: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=S ==> next_comm=swapper/1 next_pid=0 next_prio=120",
        ],
    );
    let ns = |us: u64| 10_000_000_000 + us * 1_000;
    let pieces = timeline::pieces(&event::events(&text, 0), LOOP, PRIORITY, ns(1_000), ns(1_900)).expect("covered");
    let all = blame::causes(&pieces, ns(1_010));
    assert_eq!(
        all.iter().map(|c| c.kind).collect::<Vec<_>>(),
        [Kind::SlowWork],
        "{all:?}"
    );
}

#[test]
fn rivals_are_named_with_their_priority_and_waker() {
    let rival = |prio: i32| {
        after_sleep(
            TO_IDLE,
            &[
                "net-77 [001] d..2. 10.000100: sched_waking: comm=rival pid=600 prio=9 target_cpu=001",
                &format!(
                    "<idle>-0 [001] d..2. 10.000101: sched_switch: prev_comm=swapper/1 prev_pid=0 prev_prio=120 prev_state=R ==> next_comm=rival next_pid=600 next_prio={prio}"
                ),
                "rival-600 [001] d.h1. 10.001002: local_timer_entry: vector=236",
                WAKES,
                "rival-600 [001] d.h1. 10.001007: local_timer_exit: vector=236",
                &format!(
                    "rival-600 [001] d..2. 10.001507: sched_switch: prev_comm=rival prev_pid=600 prev_prio={prio} prev_state=S ==> next_comm=haptic next_pid=500 next_prio=19"
                ),
            ],
        )
    };
    let higher = first(&rival(9), 1_510);
    assert_eq!(
        (higher.kind, higher.who.as_str(), higher.priority),
        (Kind::HigherPriority, "rival", Some(90))
    );
    assert!(
        (higher.us - 500.0).abs() < 5.0 && higher.woken_by.as_deref() == Some("net"),
        "{higher:?}"
    );
    assert_eq!(first(&rival(19), 1_510).kind, Kind::SamePriority);
    // A normal thread that runs on after the wake-up is inside the kernel.
    assert_eq!(first(&rival(120), 1_510).kind, Kind::KernelWork);
}

#[test]
fn interrupts_softirqs_and_system_calls_are_named() {
    let text = after_sleep(
        "next_comm=writer next_pid=700 next_prio=120",
        &[
            "writer-700 [001] ..... 10.000030: sys_fsync(fd: 3)",
            "writer-700 [001] d.h1. 10.000990: irq_handler_entry: irq=28 name=nvme0q1",
            "writer-700 [001] d.h1. 10.001302: irq_handler_exit: irq=28 ret=handled",
            "writer-700 [001] d.h1. 10.001303: local_timer_entry: vector=236",
            "x-9 [001] dNh1. 10.001305: sched_waking: comm=haptic pid=500 prio=19 target_cpu=001",
            "writer-700 [001] d.h1. 10.001306: local_timer_exit: vector=236",
            "writer-700 [001] ..s1. 10.001307: softirq_entry: vec=3 [action=NET_RX]",
            "writer-700 [001] ..s1. 10.001507: softirq_exit: vec=3 [action=NET_RX]",
            "writer-700 [001] d..2. 10.001607: sched_switch: prev_comm=writer prev_pid=700 prev_prio=120 prev_state=R+ ==> next_comm=haptic next_pid=500 next_prio=19",
        ],
    );
    let all = causes(&text, 1_610);
    let said: Vec<(Kind, &str)> = all.iter().map(|c| (c.kind, c.who.as_str())).collect();
    let expected = [
        (Kind::Interrupt, "IRQ 28 (nvme0q1)"),
        (Kind::SoftInterrupt, "NET_RX"),
        (Kind::KernelWork, "writer"),
    ];
    assert_eq!(said, expected);
    assert!(
        (all[0].us - 302.0).abs() < 1.0 && all[2].inside.as_deref() == Some("fsync"),
        "{all:?}"
    );
}

#[test]
fn a_core_on_which_nothing_ran_was_taken_from_below() {
    let text = after_sleep(
        TO_IDLE,
        &[
            "<idle>-0 [001] d..1. 10.000022: cpu_idle: state=1 cpu_id=1",
            "<idle>-0 [001] d..1. 10.003100: cpu_idle: state=4294967295 cpu_id=1",
            "<idle>-0 [001] d.h1. 10.003102: local_timer_entry: vector=236",
            "x-9 [001] dNh1. 10.003105: sched_waking: comm=haptic pid=500 prio=19 target_cpu=001",
            "<idle>-0 [001] d.h1. 10.003107: local_timer_exit: vector=236",
            "<idle>-0 [001] d..2. 10.003109: sched_switch: prev_comm=swapper/1 prev_pid=0 prev_prio=120 prev_state=R ==> next_comm=haptic next_pid=500 next_prio=19",
        ],
    );
    let cause = first(&text, 3_112);
    assert_eq!(
        (cause.kind, cause.who.as_str()),
        (Kind::NothingRan, "the core in sleep state 1")
    );
    assert!((cause.us - 2_100.0).abs() < 3.0, "{cause:?}");
}

#[test]
fn a_loop_that_could_run_and_does_not_is_throttled() {
    // It was interrupted in the middle of a tick, and the idle thread got the core.
    let text = "  haptic-500 [001] d..2. 10.000900: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=R ==> next_comm=swapper/1 next_pid=0 next_prio=120\n  \
                <idle>-0 [001] d..1. 10.000902: cpu_idle: state=0 cpu_id=1\n  \
                <idle>-0 [001] d..2. 10.005000: sched_switch: prev_comm=swapper/1 prev_pid=0 prev_prio=120 prev_state=R ==> next_comm=haptic next_pid=500 next_prio=19\n  \
                haptic-500 [001] d..2. 10.005100: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=S ==> next_comm=swapper/1 next_pid=0 next_prio=120\n";
    let cause = first(text, 5_003);
    assert_eq!(cause.kind, Kind::Throttled);
    assert!((cause.us - 4_000.0).abs() < 3.0);
}

#[test]
fn a_loop_that_was_stopped_or_lost_its_priority_is_said_to() {
    let text = "  haptic-500 [001] d..2. 10.000500: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=T ==> next_comm=swapper/1 next_pid=0 next_prio=120\n  \
                <idle>-0 [001] d..2. 10.004000: sched_waking: comm=haptic pid=500 prio=19 target_cpu=001\n  \
                <idle>-0 [001] d..2. 10.004003: sched_switch: prev_comm=swapper/1 prev_pid=0 prev_prio=120 prev_state=R ==> next_comm=haptic next_pid=500 next_prio=19\n";
    assert_eq!(first(text, 4_010).kind, Kind::Stopped);
    let text = after_sleep(
        "next_comm=cc1 next_pid=800 next_prio=120",
        &[
            "cc1-800 [001] dNh1. 10.001005: sched_waking: comm=haptic pid=500 prio=120 target_cpu=001",
            "cc1-800 [001] d..2. 10.003000: sched_switch: prev_comm=cc1 prev_pid=800 prev_prio=120 prev_state=R ==> next_comm=haptic next_pid=500 next_prio=120",
        ],
    );
    let cause = first(&text, 3_004);
    assert_eq!((cause.kind, cause.who.as_str()), (Kind::LostPriority, "cc1"));
}

#[test]
fn long_work_differs_from_an_unfinished_earlier_tick() {
    let busy = "  haptic-500 [001] d..2. 10.000900: sched_waking: comm=other pid=3 prio=120 target_cpu=000\n  \
                haptic-500 [001] d..2. 10.001400: sched_switch: prev_comm=haptic prev_pid=500 prev_prio=19 prev_state=S ==> next_comm=swapper/1 next_pid=0 next_prio=120\n";
    assert_eq!(first(busy, 1_390).kind, Kind::OwnWork);
    let events = event::events(busy, 0);
    let ns = |us: u64| 10_000_000_000 + us * 1_000;
    // The same events, with a clock that was read as soon as the tick was due: the work itself took long.
    let pieces = timeline::pieces(&events, LOOP, PRIORITY, ns(1_000), ns(1_390)).expect("covered");
    assert_eq!(blame::causes(&pieces, ns(1_000))[0].kind, Kind::SlowWork);
}

#[test]
fn a_trace_that_begins_after_the_tick_says_nothing() {
    let events = event::events(
        "  haptic-500 [001] d..2. 10.002000: sched_waking: comm=o pid=3 prio=1 target_cpu=000\n",
        0,
    );
    assert!(timeline::pieces(&events, LOOP, PRIORITY, 10_001_000_000, 10_003_000_000).is_none());
}

/// Half a millisecond of a busy core, as written by the kernel. Every microsecond has one holder.
#[test]
fn pieces_of_a_kept_trace_cover_every_microsecond_once() {
    let events = event::events(include_str!("tests/busy_core.txt"), 0);
    assert!(events.len() > 60, "{}", events.len());
    let (from_ns, to_ns) = (events[5].at_ns, events[events.len() - 5].at_ns);
    let pieces = timeline::pieces(&events, 22_917, 120, from_ns, to_ns).expect("covered");
    assert_eq!(
        pieces.iter().map(timeline::Piece::length_ns).sum::<u64>(),
        to_ns - from_ns
    );
    assert!(pieces.windows(2).all(|w| w[0].to_ns == w[1].from_ns));
    let names = super::witness::holders(&pieces, from_ns);
    assert!(names.iter().any(|p| p.who == "IRQ 36 (virtio1-req.0)"), "{names:?}");
}
