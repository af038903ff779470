//! Success of ticks in words and as a file.

use super::*;
use bytemuck::Zeroable;

const PERIOD_NS: u64 = 1_000_000;

/// Returns a tick whose force left so long after its deadline, with the deadlines missed before it.
fn tick(number: u64, left_us: u64, missed: u32) -> TickRecord {
    TickRecord {
        tick: number,
        due_ns: number * PERIOD_NS,
        wake_latency_ns: 400_000,
        force_written_ns: left_us * 1_000 - 400_000,
        missed,
        ..TickRecord::zeroed()
    }
}

fn event(sequence: u64, kind: EventKind, at_tick: u64) -> Event {
    let mut event = Event::zeroed();
    (event.sequence, event.kind, event.time_ns) = (sequence, kind as u32, at_tick * PERIOD_NS);
    event
}

/// 1,000 ticks: one late, five deadlines missed after it, ten records lost.
fn watched() -> Health {
    let mut health = Health::default();
    let before = event(1, EventKind::Rearmed, 10);
    health.count(&before);
    for number in 100..1_100 {
        let (left_us, missed) = match number {
            // Missed before the first tick that was watched.
            100 => (420, 9),
            1_050 => (1_001, 0),
            1_051 => (420, 5),
            _ => (420, 0),
        };
        if !(500..510).contains(&number) {
            health.take(&tick(number, left_us, missed), PERIOD_NS);
        }
    }
    health.count(&before);
    health
}

#[test]
fn success_counts_late_and_missed_ticks_of_the_last_100_and_of_all() {
    let health = watched();
    // 990 ticks were seen, one of them late, and five deadlines had none.
    assert_eq!((health.deadlines, health.succeeded), (995, 989));
    assert_eq!((health.late, health.missed, health.unseen), (1, 5, 10));
    assert_eq!(health.success(), Some([0.94, 989.0 / 995.0]));
    assert_eq!(
        health.words(&LinkStatus::Live),
        "success 94.0 % of the last 100, 99.3970 % of 995 ticks; 5 missed, 1 late, 0 faults, 0 re-arms, 10 not seen"
    );
    assert_eq!(Health::default().success(), None);
}

#[test]
fn counts_go_on_over_a_rearming_and_each_event_counts_once() {
    let mut health = watched();
    let events = [
        event(2, EventKind::FaultRaised, 1_100),
        event(3, EventKind::Rearmed, 1_101),
    ];
    for _ in 0..2 {
        events.iter().for_each(|event| health.count(event));
    }
    (1_100..1_200).for_each(|number| health.take(&tick(number, 420, 0), PERIOD_NS));
    assert_eq!((health.faults, health.rearms, health.deadlines), (1, 1, 1_095));
    assert_eq!(health.success(), Some([1.0, 1_089.0 / 1_095.0]));
}

#[test]
fn the_file_is_openmetrics_text() {
    let mut health = watched();
    let instance = Instance::new("left").expect("valid");
    assert!(metrics::text(&health, &instance).contains("stylet_up{core=\"left\"} 0\n"));
    let mut state = HapticState::default();
    (state.flags, state.since_start.worst_wake_ns) = (stylet_shm_schema::flags::ENGAGED, 612_000);
    (health.answers, health.state) = (true, Some(state));
    let text = metrics::text(&health, &instance);
    for line in [
        "stylet_up{core=\"left\"} 1",
        "stylet_force_engaged{core=\"left\"} 1",
        "# TYPE stylet_tick_success_ratio gauge",
        "# UNIT stylet_tick_success_ratio ratio",
        "stylet_tick_success_ratio{core=\"left\",over=\"last_100\"} 0.94",
        "# TYPE stylet_ticks counter",
        "stylet_ticks_total{core=\"left\"} 995",
        "stylet_missed_deadlines_total{core=\"left\"} 5",
        "stylet_worst_wake_seconds{core=\"left\"} 0.000612",
    ] {
        assert!(text.lines().any(|l| l == line), "{line}:\n{text}");
    }
    assert!(text.ends_with("\n# EOF\n"));
}
