//! Totals of a loop: a reset and a re-arm used to clear values that the final report needs.

use super::*;

#[test]
fn a_reset_keeps_the_totals_and_arming_begins_one_of_them_anew() {
    let mut rig = Rig::new();
    rig.press();
    rig.set(Cause::Late);
    rig.run(50);
    rig.set(Cause::Nothing);
    rig.order(HapticOrder::Reset);
    rig.run(1);
    let state = rig.haptic.memory.state;
    assert_eq!((state.missed_deadlines, state.since_start.missed), (0, 50));
    assert_eq!(state.since_armed.missed, 50, "armed before they were missed");
    rig.order(HapticOrder::Engage);
    rig.run(1);
    let state = rig.haptic.memory.state;
    assert_eq!((state.since_start.missed, state.since_armed.missed), (50, 0));
}

#[test]
fn a_loop_that_stood_still_keeps_the_force_off_until_it_is_armed() {
    let mut rig = Rig::new();
    let mut record = rig.press();
    rig.order(HapticOrder::StoodStill);
    record.extend(rig.run(100));
    let last = record.last().expect("ticks");
    assert_eq!(
        (last.fault, last.flags & flags::ENGAGED),
        (Fault::LoopStopped as u32, 0)
    );
    assert_eq!(force_n(last), 0.0);
    assert_no_step(&record, "stood still");
    rig.order(to_depth(-0.01));
    rig.run(1000);
    rig.order(HapticOrder::Engage);
    assert_eq!(rig.run(10).last().map(|r| r.fault), Some(0));
}
