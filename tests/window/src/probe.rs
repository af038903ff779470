//! The probe's picture and fluoroscopy on a running core: pose, motion, held image and cost.

use crate::driven::{Driven, assert_drawn_by_changes, keep_for_docs, misplaced, real_time_option};
use crate::kept::{assert_like_kept, tolerant};
use egui::{Event, Key, Modifiers, Pos2};
use egui_kittest::kittest::Queryable;
use host_ui::app::App;
use nalgebra::{Quaternion, UnitQuaternion};
use std::time::Duration;
use stylet_imaging::ultrasound::{Pose, Probe, View};
use stylet_shm_schema::{Exercise, Request};
use stylet_tests::{Core, ask};

const SMALL: [f32; 2] = [1280.0, 800.0];

fn in_hand(app: &App) -> Option<Pose> {
    let second = app.link().second_state().filter(|s| s.tick > 0)?;
    let [i, j, k, w] = second.world_from_tool;
    let turn = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
    Some(Pose::of_tool(second.tip_in_scene_m.into(), &turn, &Probe::default()))
}

fn off(a: &Pose, b: &Pose) -> f64 {
    (a.middle_m - b.middle_m).norm() + 0.1 * ((a.up - b.up).norm() + (a.axis - b.axis).norm())
}

/// Returns the pose of the visible picture.
fn seen(app: &App) -> Option<Pose> {
    app.middle().probe_picture(View::Transverse).map(|p| p.plane.pose)
}

fn open(layout: &str, options: &[&str]) -> Driven {
    let options = [&[real_time_option(), "--scene", "pelvis"], options].concat();
    let mut driven = Driven::on(Core::start_with(&options), SMALL);
    driven.click(layout);
    driven
}

fn wait(driven: &mut Driven, frames: usize) {
    for _ in 0..frames {
        driven.window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Waits until the hand rests at a pose, and the picture shows it.
fn until_at(driven: &mut Driven, what: &str, goal: Pose) {
    driven.until(what, |app| in_hand(app).is_some_and(|pose| off(&pose, &goal) < 1e-3));
    wait(driven, 30);
    let app = driven.window.state();
    let (seen, held) = (seen(app).expect("a picture"), in_hand(app).expect("a hand"));
    assert!(off(&seen, &held) < 1e-4, "{what}: {seen:?}, {held:?}");
}

#[test]
fn stepper_and_pointer_move_the_probe_unless_braked() {
    let mut driven = open("Probe", &["--device-2", "simulated"]);
    driven.until("the probe", |app| in_hand(app).is_some() && seen(app).is_some());
    wait(&mut driven, 10);
    let start = in_hand(driven.window.state()).expect("a hand");
    until_at(&mut driven, "the start", start);
    // It begins outside, and moves in by steps of the stepper.
    let mut goal = start;
    for _ in 0..28 {
        driven.press(Key::PageUp);
        goal = goal.moved(5e-3, 0.0);
    }
    until_at(&mut driven, "140 mm in", goal);
    for _ in 0..4 {
        driven.press(Key::Home);
    }
    goal = goal.moved(0.0, 20_f64.to_radians());
    until_at(&mut driven, "a turn by 20 degrees", goal);
    // 40 points up are 10 mm in.
    let from = driven.window.get_by_label("Transverse ultrasound").rect().center();
    driven.window.drag_at(from);
    driven.window.run_steps(2);
    let to = Pos2::new(from.x, from.y - 40.0);
    driven.window.hover_at(to);
    driven.window.run_steps(2);
    driven.window.drop_at(to);
    driven.window.run_steps(2);
    goal = goal.moved(10e-3, 0.0);
    until_at(&mut driven, "10 mm by the pointer", goal);
    assert_eq!(misplaced(&driven.window), Vec::<String>::new());
    let picture = driven.picture("probe-in-hand");
    keep_for_docs(&picture, "probe");
    assert_drawn_by_changes(&mut driven.window, "the probe in the hand");
    // With the brake no hand moves it, but a step does.
    driven.press(Key::B);
    hold_alt_w(&driven, true);
    wait(&mut driven, 40);
    hold_alt_w(&driven, false);
    until_at(&mut driven, "the brake", goal);
    driven.window.get_by_label_contains("brake holds the probe");
    driven.press(Key::PageDown);
    goal = goal.moved(-5e-3, 0.0);
    until_at(&mut driven, "a step back", goal);
    driven.press(Key::B);
    hold_alt_w(&driven, true);
    // A busy machine moves it late.
    let is_farther =
        |app: &App| in_hand(app).is_some_and(|pose| (pose.middle_m - goal.middle_m).dot(&goal.axis) > 3e-3);
    driven.until("the hand to move it", is_farther);
    hold_alt_w(&driven, false);
    wait(&mut driven, 2);
}

/// Holds both keys; the harness would release Alt in the same frame.
fn hold_alt_w(driven: &Driven, pressed: bool) {
    let alt = |held| Event::ModifiersChanged(if held { Modifiers::ALT } else { Modifiers::NONE });
    let w = Event::Key {
        key: Key::W,
        physical_key: None,
        pressed,
        repeat: false,
        modifiers: Modifiers::ALT,
    };
    let events = if pressed { [alt(true), w] } else { [w, alt(false)] };
    events.into_iter().for_each(|event| driven.window.event(event));
}

/// Guards against marks of seeds that stayed at the scene's place of the body while the rest of the
/// picture moved.
#[test]
fn a_moved_patient_is_seen_by_a_fixed_probe() {
    let mut driven = open("Probe", &[]);
    driven.until("a picture", |app| seen(app).is_some());
    let before = seen(driven.window.state()).expect("a picture");
    let mut link = driven.core.host();
    ask(
        &mut link,
        &Request::BeginExercise(Exercise::BodyMoved { by_m: [4e-3, 0.0, 0.0] }),
    )
    .expect("put in");
    driven.until("the body where it goes", |app| {
        app.link()
            .snapshot()
            .is_some_and(|s| (s.header.body_moved_m[0] - 4e-3).abs() < 1e-6)
    });
    wait(&mut driven, 10);
    assert_eq!(seen(driven.window.state()), Some(before), "the stepper stands still");
    let snapshot = driven.window.state().link().snapshot().expect("live");
    let mean: f32 = snapshot.displacements_m.iter().map(|d| d[0]).sum::<f32>() / snapshot.displacements_m.len() as f32;
    assert!((mean - 4e-3).abs() < 1e-4, "{mean}");
}

#[test]
fn the_beam_follows_its_switch_and_the_dose_is_counted() {
    let mut driven = open("Fluoroscopy", &[]);
    let pulses = |app: &App| app.middle().spent().pulses;
    driven.until("a patient", |app| app.link().scene().is_some());
    driven.press(Key::E);
    wait(&mut driven, 20);
    assert_eq!(pulses(driven.window.state()), 0, "no beam that nobody asked for");
    driven.window.key_down(Key::X);
    driven.until("three pulses", |app| pulses(app) >= 3);
    driven.window.key_up(Key::X);
    wait(&mut driven, 40);
    let held = pulses(driven.window.state());
    wait(&mut driven, 40);
    assert_eq!(pulses(driven.window.state()), held, "the beam goes on");
    let spent = driven.window.state().middle().spent();
    assert!((spent.beam_s - 0.125 * spent.pulses as f64).abs() < 1e-9);
    assert!(
        (spent.air_kerma_gy / spent.pulses as f64 - 20.5e-6).abs() < 0.5e-6,
        "{spent:?}"
    );
    // The switch of the window, then another angle, which the held image does not have.
    driven.click("X-ray");
    driven.until("more pulses", |app| pulses(app) > held + 1);
    driven.click("X-ray");
    wait(&mut driven, 40);
    assert_eq!(misplaced(&driven.window), Vec::<String>::new());
    let picture = driven.picture("fluoroscopy");
    keep_for_docs(&picture, "fluoroscopy");
    assert_drawn_by_changes(&mut driven.window, "an image that is held");
    let rect = driven.window.get_by_label("C-arm screen").rect();
    let own = image::imageops::crop_imm(
        &picture,
        rect.left() as u32,
        rect.top() as u32,
        rect.width() as u32,
        rect.height() as u32,
    );
    // Age and dose may differ; displaced bones are thousands of pixels.
    let options = tolerant().max_failed_pixels(2500);
    assert_like_kept("fluoroscopy_held", &options, || own.to_image());
    driven.click("New case");
    wait(&mut driven, 3);
    assert_eq!(pulses(driven.window.state()), 0);
    // Leaving the layout ends the beam.
    driven.click("X-ray");
    driven.until("a pulse", |app| pulses(app) >= 1);
    driven.click("All views");
    wait(&mut driven, 40);
    let left = pulses(driven.window.state());
    wait(&mut driven, 40);
    assert_eq!(pulses(driven.window.state()), left);
}
