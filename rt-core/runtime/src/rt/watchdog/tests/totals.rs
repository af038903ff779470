//! Totals of a loop: a reset and a re-arm used to clear what a report at the end should know.

use super::*;

#[test]
fn a_reset_keeps_the_totals_and_arming_begins_one_of_them_anew() {
    let mut rig = Rig::new();
    rig.press();
    rig.set(Cause::Late);
    rig.run(50);
    rig.set(Cause::Nothing);
    rig.order(HapticOrder::Reset { ticket: 2 });
    rig.run(1);
    let state = rig.haptic.state;
    assert_eq!((state.missed_deadlines, state.since_start.missed), (0, 50));
    assert_eq!(state.since_armed.missed, 50, "armed before they were missed");
    rig.order(HapticOrder::Engage { ticket: 3 });
    rig.run(1);
    let state = rig.haptic.state;
    assert_eq!((state.since_start.missed, state.since_armed.missed), (50, 0));
}
