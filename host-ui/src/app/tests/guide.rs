//! The guide against the state machine of the procedure, and its figures against their state.

use super::fixture::{live, one_needle};
use crate::panel::workflow::{MetMembranes, lesson};
use crate::shown::Shown;
use bytemuck::Zeroable;
use stylet_shm_schema::{TickRecord, flags};

fn what(shown: &Shown, membranes: &MetMembranes) -> String {
    lesson(shown, membranes).what
}

#[test]
fn the_guide_follows_the_state_machine() {
    let membranes = MetMembranes::default();
    assert!(what(&Shown::empty("lab"), &membranes).contains("rt-core"));
    for (shown, word) in [
        (live(), "Plan five seeds"),
        (one_needle(-0.05, 0), "Bring the tip to the entry"),
        (one_needle(0.03, 0), "Push the needle in"),
        (one_needle(0.07, 0), "Press Space"),
        (one_needle(0.07, 1), "Draw the needle back by 10.0 mm"),
        (one_needle(0.03, 5), "Take the needle out"),
    ] {
        let mut shown = shown;
        if let Some(state) = &mut shown.state {
            // No line is needed, and the speed is that of a needle at rest.
            state.flags &= !flags::LINE_NEEDED;
            state.speed_m_per_s = 0.0;
        }
        let what = what(&shown, &membranes);
        assert!(what.contains(word), "{word:?} is not in {what:?}");
    }
}

/// Guards against a guide that never turned the force on for keys, so that a membrane gave way at
/// 0.00 N.
#[test]
fn the_force_is_turned_on_before_the_needle_moves() {
    let mut shown = one_needle(-0.05, 0);
    if let Some(state) = &mut shown.state {
        state.flags &= !(flags::ENGAGED | flags::LINE_NEEDED);
        state.speed_m_per_s = 0.0;
    }
    let membranes = MetMembranes::default();
    assert!(
        what(&shown, &membranes).contains("Press E"),
        "{}",
        what(&shown, &membranes)
    );
    let mut membranes = MetMembranes::default();
    let tick = |flags| {
        let mut record = TickRecord::zeroed();
        (record.depth_m, record.flags) = (8e-3, flags);
        record
    };
    membranes.take(&[tick(flags::IN_CONTACT), tick(flags::IN_CONTACT | flags::PUNCTURED)]);
    let notes = lesson(&one_needle(0.0, 5), &membranes).notes.join("\n");
    assert!(
        notes.contains("The force was off") && !notes.contains("0.00 N"),
        "{notes}"
    );
}

#[test]
fn the_debrief_has_the_figures_of_the_seeds_and_of_the_membrane() {
    let mut membranes = MetMembranes::default();
    let tick = |depth_m, force_n, flags| {
        let mut record = TickRecord::zeroed();
        (record.depth_m, record.flags, record.force_on_hand_n[2]) = (depth_m, flags, force_n);
        record
    };
    let through = flags::IN_CONTACT | flags::PUNCTURED;
    membranes.take(&[
        tick(0.0, 0.0, 0),
        tick(4e-3, -1.0, flags::IN_CONTACT),
        tick(8e-3, -2.5, flags::IN_CONTACT),
        tick(9e-3, -0.5, through),
        tick(0.0, 0.0, 0),
    ]);
    assert_eq!(membranes.punctures().len(), 1);
    // Seeds left in place that rest 2 mm deeper and 1 mm aside.
    let lesson = lesson(&one_needle(0.0, 5), &membranes);
    assert!(lesson.what.contains("+2.00 mm"), "{}", lesson.what);
    let notes = lesson.notes.join("\n");
    for word in [
        "pressed in by 8.0 mm",
        "2.50 N",
        "planned 70.0 mm deep",
        "dropped at 70.0 mm",
        "came to rest at 72.0 mm",
        "1.0 mm off axis",
    ] {
        assert!(notes.contains(word), "{word:?} is not in {notes}");
    }
    assert!(notes.contains("Most of it is the tissue"));
    // The next insertion starts from zero.
    membranes.take(&[tick(1e-3, 0.0, flags::IN_CONTACT)]);
    assert!(membranes.punctures().is_empty());
}
