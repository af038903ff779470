//! Parts that stay in place while others appear or disappear.

use super::fixture::{Drawn, live, many_needles, one_needle};
use crate::panel::workflow::Progress;
use crate::shown::{LoadState, Note, Shown};
use egui::Rect;
use stylet_shm_schema::{Fault, flags};

fn places(shown: Shown, names: &[&str]) -> Vec<Rect> {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    drawn.app.shown = shown;
    names.iter().map(|name| drawn.place(name)).collect()
}

/// Guards against a banner that moved everything down by 34 points, so that the second click hit
/// another button.
#[test]
fn a_banner_moves_nothing() {
    let names = ["Insert", "Engage force", "Follow tip", "Membrane tension", "Parameters"];
    let without = places(one_needle(0.0, 0), &names);
    let mut shown = one_needle(0.0, 0);
    if let Some(state) = &mut shown.state {
        (state.fault, state.flags) = (Fault::DeviceSilent as u32, flags::REAL_TIME);
    }
    shown.refusals = 3;
    assert_eq!(places(shown, &names), without);
}

/// Guards against buttons for the force that moved below the last answer.
#[test]
fn a_note_moves_nothing() {
    let names = ["Plan five seeds", "Engage force", "Disengage", "Reset"];
    let without = places(live(), &names);
    let mut shown = live();
    let text = "Debrief saved as /srv/lab/out/debrief-2026-11-23T02-00-00, with a page and figures ".repeat(4);
    shown.note = Some(Note { refused: true, text });
    assert_eq!(places(shown, &names), without);
}

/// Guards against steps that moved by a line while needles ran.
#[test]
fn a_run_of_needles_moves_no_step() {
    let names = ["1  Choose the scene", "7  Debrief", "Engage force"];
    let without = places(many_needles(19, 2), &names);
    let mut running = many_needles(19, 2);
    (running.running, running.run_needle) = (true, Some((1, 19)));
    assert_eq!(places(running, &names), without);
    let mut stopped = many_needles(19, 2);
    stopped.continues_at = Some((1, 19));
    assert_eq!(places(stopped, &names), without);
}

/// Guards against a button that left the core building the scene.
#[test]
fn only_the_reading_of_a_file_can_be_cancelled() {
    let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
    drawn.app.shown = live();
    drawn.frame();
    drawn.app.workflow.open_by_hand(Progress::Scene);
    for (load, can_cancel) in [
        (LoadState::Reading("case7.nrrd: reading voxels".to_owned(), 0.5), true),
        (LoadState::Sending("building pelvis".to_owned()), false),
    ] {
        drawn.app.shown.load = load;
        assert_eq!(drawn.frame().place("Cancel").is_some(), can_cancel);
    }
}
