//! Gamepad and 3D mouse in the window on a running core: what they move, and that releasing or
//! unplugging them stops it.

use crate::driven::{Driven, is_at_rest, misplaced};
use crate::plugged::Table;
use egui_kittest::kittest::Queryable;
use evdev::{AbsoluteAxisCode, KeyCode};
use host_ui::app::App;
use std::time::Duration;
use stylet_controllers::{Controllers, Kind};
use stylet_shm_schema::flags;

fn tip(app: &App) -> [f64; 3] {
    app.link().state().map_or([0.0; 3], |s| s.tip_in_scene_m)
}

fn with(kind: Kind) -> (Driven, Table) {
    let mut driven = Driven::open_plain([1280.0, 800.0]);
    let table = Table::default();
    driven
        .window
        .state_mut()
        .use_controllers(Controllers::start(table.clone()));
    driven.plan_and_place();
    table.plug(kind);
    let name = format!("Test {}", kind.name());
    while driven.window.query_by_label(&name).is_none() {
        wait(&mut driven, 10);
    }
    (driven, table)
}

fn wait(driven: &mut Driven, frames: usize) {
    for _ in 0..frames {
        driven.window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Waits for rest. A hand that outran slow frames rests at its last goal too, so the window must
/// have seen the release first.
fn rest(driven: &mut Driven) {
    wait(driven, 20);
    driven.until("rest", is_at_rest);
}

fn assert_stays(driven: &mut Driven, what: &str) {
    rest(driven);
    let stopped = tip(driven.window.state());
    wait(driven, 50);
    let after = tip(driven.window.state());
    let way = (0..3).map(|a| (after[a] - stopped[a]).powi(2)).sum::<f64>().sqrt();
    assert!(
        way < 1e-3,
        "{what}: the needle went on by {way} m: {stopped:?} to {after:?}"
    );
}

#[test]
fn a_stick_moves_the_needle_only_while_held() {
    let (mut driven, pad) = with(Kind::Gamepad);
    driven.window.get_by_label_contains("left stick");
    let start = tip(driven.window.state())[2];
    pad.axis(AbsoluteAxisCode::ABS_Y, -1.0);
    driven.until("the needle to go in", |app| tip(app)[2] > start + 5e-3);
    pad.axis(AbsoluteAxisCode::ABS_Y, 0.0);
    assert_stays(&mut driven, "released");
    let deep = tip(driven.window.state())[2];
    pad.axis(AbsoluteAxisCode::ABS_Y, 0.7);
    driven.until("the needle to come out", |app| tip(app)[2] < deep - 3e-3);
    // The stop button holds although the stick is still drawn.
    pad.press(KeyCode::BTN_EAST);
    wait(&mut driven, 5);
    assert_stays(&mut driven, "stopped");
    pad.press(KeyCode::BTN_START);
    driven.until("force", |app| {
        app.link().state().is_some_and(|s| s.flags & flags::ENGAGED != 0)
    });
}

#[test]
fn an_unplugged_stick_leaves_the_needle_in_place() {
    let (mut driven, pad) = with(Kind::Gamepad);
    let start = tip(driven.window.state())[2];
    pad.axis(AbsoluteAxisCode::ABS_Y, -1.0);
    driven.until("the needle to go in", |app| tip(app)[2] > start + 5e-3);
    pad.unplug();
    wait(&mut driven, 10);
    driven.window.get_by_label("Unplugged");
    assert_stays(&mut driven, "unplugged");
    assert_eq!(misplaced(&driven.window), Vec::<String>::new());
    driven.picture("unplugged");
    driven.click("Dismiss");
    assert!(driven.window.query_by_label("Unplugged").is_none());
}

#[test]
fn a_cap_moves_the_needle_across_only_outside_tissue() {
    let (mut driven, cap) = with(Kind::Mouse3d);
    let start = tip(driven.window.state());
    let side = |app: &App| (0..2).map(|a| (tip(app)[a] - start[a]).powi(2)).sum::<f64>().sqrt();
    cap.axis(AbsoluteAxisCode::ABS_X, 1.0);
    driven.until("the needle to go across", |app| side(app) > 4e-3);
    cap.axis(AbsoluteAxisCode::ABS_X, 0.0);
    assert_stays(&mut driven, "released");
    let beside = side(driven.window.state());
    assert!((tip(driven.window.state())[2] - start[2]).abs() < 1e-3, "along as well");
    cap.axis(AbsoluteAxisCode::ABS_Z, 1.0);
    driven.until("puncture", |app| {
        app.link().state().is_some_and(|s| s.flags & flags::PUNCTURED != 0)
    });
    cap.axis(AbsoluteAxisCode::ABS_Z, 0.0);
    rest(&mut driven);
    // Inside tissue: sliding does nothing, and the keys keep to the line.
    cap.axis(AbsoluteAxisCode::ABS_X, -1.0);
    assert_stays(&mut driven, "slid inside");
    cap.axis(AbsoluteAxisCode::ABS_X, 0.0);
    let deep = tip(driven.window.state())[2];
    driven.window.key_down(egui::Key::W);
    driven.until("the keys to go on", |app| tip(app)[2] > deep + 3e-3);
    driven.window.key_up(egui::Key::W);
    let released = tip(driven.window.state())[2];
    rest(&mut driven);
    let rests = tip(driven.window.state())[2];
    assert!(
        // The hand's spring yields this much as it comes to rest.
        rests > released - 0.2e-3,
        "released at {released} m, it went back to {rests} m"
    );
    let after = side(driven.window.state());
    assert!((after - beside).abs() < 1.5e-3, "{after} m beside, {beside} m before");
    cap.press(KeyCode::BTN_0);
    driven.until("a seed", |app| {
        app.link().snapshot().is_some_and(|s| s.header.seed_count == 1)
    });
}
