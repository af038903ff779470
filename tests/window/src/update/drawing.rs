//! The operator's drawing on the live picture, by clicks, drags and keys.

use crate::driven::Driven;
use egui::{Key, Modifiers, Pos2};
use host_ui::view::probe::ProbePicture;
use nalgebra::Vector3;
use stylet_imaging::ultrasound::View;

/// Number of clicks in a plane.
pub(super) const CLICKS: usize = 6;

fn transverse(driven: &Driven) -> ProbePicture {
    *driven
        .window
        .state()
        .middle()
        .probe_picture(View::Transverse)
        .expect("a picture")
}

/// Takes a step of the stepper, and waits for the picture from there.
fn step(driven: &mut Driven, key: Key) {
    driven.press(key);
    driven.until("the picture", |app| {
        app.middle()
            .probe_picture(View::Transverse)
            .is_some_and(|picture| picture.is_live)
    });
}

fn click_at(driven: &mut Driven, at: Pos2) {
    driven.window.hover_at(at);
    driven.window.run_steps(1);
    driven.window.drag_at(at);
    driven.window.run_steps(1);
    driven.window.drop_at(at);
    driven.window.run_steps(2);
}

fn points(driven: &Driven) -> usize {
    driven.window.state().planner().planning().review.drawn.contour.points()
}

/// Returns the edge of the gland in the transverse plane, around the gland's middle.
fn edge(driven: &Driven) -> Vec<Pos2> {
    let picture = transverse(driven);
    let outlines = driven.window.state().planner().planning().outlines.expect("known");
    let target = &outlines.anatomy.target;
    let (low, high) = target.bounds_m();
    let middle = (Vector3::from(low) + Vector3::from(high)) / 2.0;
    let plane = picture.plane;
    let middle = middle - plane.normal() * plane.in_beams(middle).off_plane_m;
    let on_edge = |n: usize| {
        let (sine, cosine) = ((n as f64 + 0.25) / CLICKS as f64 * std::f64::consts::TAU).sin_cos();
        let out = plane.right() * cosine + plane.pose.up * sine;
        let steps = (1..400).map(|step| f64::from(step) * 0.1e-3);
        let inside = steps.take_while(|way_m| target.contains((middle + out * *way_m).into()));
        middle + out * inside.last().unwrap_or(0.0)
    };
    (0..CLICKS).map(|n| picture.at(on_edge(n))).collect()
}

/// Clicks the edge in five planes, from the middle 10 mm to either side.
pub(super) fn contour(driven: &mut Driven) {
    step(driven, Key::PageDown);
    step(driven, Key::PageDown);
    for plane in 1..=5 {
        for at in edge(driven) {
            click_at(driven, at);
        }
        assert_eq!(points(driven), plane * CLICKS);
        if plane < 5 {
            step(driven, Key::PageUp);
        }
    }
}

/// Tests a drag, the right button, Del and Ctrl+Z, each on a point of the visible plane.
pub(super) fn edits(driven: &mut Driven) {
    let drawn = |driven: &Driven| driven.window.state().planner().planning().review.drawn;
    let before = drawn(driven);
    let [first, second] = [0, 1].map(|n| edge(driven)[n]);
    driven.window.hover_at(first);
    driven.window.run_steps(1);
    driven.window.drag_at(first);
    driven.window.run_steps(1);
    for _ in 0..3 {
        driven.window.hover_at(first + egui::vec2(12.0, 3.0));
        driven.window.run_steps(1);
    }
    driven.window.drop_at(first + egui::vec2(12.0, 3.0));
    driven.window.run_steps(2);
    assert_ne!(drawn(driven), before, "the point was dragged");
    assert_eq!(points(driven), 5 * CLICKS);
    driven.window.key_press_modifiers(Modifiers::CTRL, Key::Z);
    driven.window.run_steps(2);
    assert_eq!(drawn(driven), before, "one step");
    driven.window.hover_at(second);
    driven.window.run_steps(1);
    for pressed in [true, false] {
        driven.window.event(egui::Event::PointerButton {
            pos: second,
            button: egui::PointerButton::Secondary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        driven.window.run_steps(1);
    }
    assert_eq!(points(driven), 5 * CLICKS - 1, "the right button");
    driven.window.key_press_modifiers(Modifiers::CTRL, Key::Z);
    driven.window.run_steps(2);
    driven.window.hover_at(second);
    driven.window.run_steps(2);
    driven.press(Key::Delete);
    assert_eq!(points(driven), 5 * CLICKS - 1, "Del");
    driven.window.key_press_modifiers(Modifiers::CTRL, Key::Z);
    driven.window.run_steps(2);
    assert_eq!(drawn(driven), before);
}

/// Marks every seed in the transverse plane nearest to it, once.
pub(super) fn mark(driven: &mut Driven) {
    for _ in 0..8 {
        step(driven, Key::PageDown);
    }
    let mut marked = Vec::new();
    for _ in 0..17 {
        let picture = transverse(driven);
        let header = driven.window.state().link().snapshot().expect("a snapshot").header;
        for (n, seed) in header.seeds[..header.seed_count as usize].iter().enumerate() {
            let place = Vector3::from(seed.position_m);
            if picture.distance_m(place).abs() <= 2.5e-3 && !marked.contains(&n) {
                marked.push(n);
                click_at(driven, picture.at(place));
            }
        }
        step(driven, Key::PageUp);
    }
}
