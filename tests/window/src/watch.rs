//! A recording in the window: the example opens with one click if no core runs, and can be closed
//! again.

use crate::driven::{misplaced, options_of};
use crate::opened::{Harness, open_window};
use egui_kittest::kittest::Queryable;
use std::time::{Duration, Instant};
use stylet_shm_schema::Instance;
use stylet_tests::Alone;

fn until(window: &mut Harness, what: &str, mut holds: impl FnMut(&Harness) -> bool) {
    let begun = Instant::now();
    while !holds(window) {
        assert!(begun.elapsed() < Duration::from_secs(120), "waited in vain for {what}");
        window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn the_example_opens_with_one_click_without_a_core_and_shows_an_insertion() {
    let alone = Alone(Instance::new("ui-watch").expect("a valid name"));
    let mut window = open_window([1280.0, 800.0], options_of(alone.0.clone()));
    window.run_steps(5);
    window.get_by_label("example").click();
    until(&mut window, "the recording", |window| {
        window.query_by_label("RECORDING").is_some()
    });
    let seeds = |window: &Harness| window.state().link().snapshot().map_or(0, |s| s.header.seed_count);
    until(&mut window, "the first seed", |window| seeds(window) == 1);
    assert!(window.query_by_label("The simulator core is not running").is_none());
    assert_eq!(misplaced(&window), Vec::<String>::new());
    // It is paused, and keys move nothing.
    window.get_by_label("Pause").click();
    window.run_steps(3);
    let depth = |window: &Harness| window.state().link().state().map(|s| s.tip_in_scene_m);
    let before = depth(&window);
    window.key_press(egui::Key::Enter);
    for _ in 0..20 {
        window.run_steps(1);
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(depth(&window), before, "it went on");
    window.get_by_label_contains("This is a recording");
    window.get_by_label("Play").click();
    until(&mut window, "the debrief", |window| {
        window.query_by_label("Seed error, mm").is_some() && window.query_by_label("Again").is_some()
    });
    assert_eq!(seeds(&window), 5);
    assert_eq!(misplaced(&window), Vec::<String>::new());
    window.get_by_label("Again").click();
    until(&mut window, "its beginning", |window| seeds(window) == 0);
    window.get_all_by_label("Close").next().expect("a way back").click();
    until(&mut window, "no core", |window| {
        window.query_by_label("The simulator core is not running").is_some()
    });
    assert!(window.query_by_label("RECORDING").is_none());
    drop(window);
    drop(alone);
}
