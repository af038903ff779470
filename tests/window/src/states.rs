//! The main states of the window in both themes and sizes: nothing clipped, nothing overlapping,
//! and equal to the kept pictures.

use crate::driven::{Driven, assert_drawn_by_changes, is_at_rest, keep_for_docs, misplaced, resize};
use egui::Key;
use egui_kittest::kittest::{NodeT, Queryable};
use host_ui::app::App;
use std::time::{Duration, Instant};
use stylet_shm_schema::flags;
use stylet_tests::Core;

const SMALL: [f32; 2] = [1280.0, 800.0];
const LARGE: [f32; 2] = [1920.0, 1080.0];
/// Tolerated pixels for a depth that differs by a tenth of a millimetre.
const INSERTING_PIXELS: usize = 800;
/// Tolerated pixels for figures in the table and the histogram, and for seeds that rest less than a
/// millimetre away.
const DEBRIEF_PIXELS: usize = 4_000;

fn seeds(app: &App) -> u32 {
    app.link().snapshot().map_or(0, |s| s.header.seed_count)
}

fn assert_in_place(driven: &mut Driven, state: &str) {
    driven.window.run_steps(4);
    let problems = misplaced(&driven.window);
    assert!(problems.is_empty(), "{state}:\n{}", problems.join("\n"));
}

/// Runs the procedure with only the key for the next action.
fn procedure_by_enter(driven: &mut Driven) {
    let start = Instant::now();
    while driven.window.query_by_label("Seed error, mm").is_none() || seeds(driven.window.state()) < 5 {
        assert!(start.elapsed() < Duration::from_secs(90), "the procedure does not end");
        driven.press(Key::Enter);
        for _ in 0..40 {
            driven.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(10));
        }
        driven.until("rest", is_at_rest);
    }
    driven.press(Key::Enter);
    driven.until("the needle outside", |app| {
        let (Some(state), Some(plan)) = (app.link().state(), app.link().plan()) else {
            return false;
        };
        let depth: f64 = (0..3)
            .map(|a| (state.tip_in_scene_m[a] - plan.entry_m[a]) * plan.direction[a])
            .sum();
        depth < 1e-3
    });
    driven.window.run_steps(30);
}

#[test]
fn a_planned_state_matches_its_pictures() {
    for (size, name) in [(SMALL, "small"), (LARGE, "large")] {
        let mut driven = Driven::open_plain(size);
        assert_in_place(&mut driven, &format!("scene, {name}"));
        driven.plan_and_place();
        assert_in_place(&mut driven, &format!("planned, dark, {name}"));
        driven.picture(&format!("planned-dark-{name}"));
        if name == "small" {
            driven.compare("planned_dark_small");
        }
        driven.press(Key::T);
        assert_in_place(&mut driven, &format!("planned, light, {name}"));
        let light = driven.picture(&format!("planned-light-{name}"));
        if name == "small" {
            keep_for_docs(&light, "light");
        }
        // The three-dimensional picture alone.
        driven.press(Key::V);
        assert_in_place(&mut driven, &format!("solid, light, {name}"));
        driven.picture(&format!("solid-light-{name}"));
        if name == "large" {
            driven.compare("planned_light_large");
        }
        driven.press(Key::V);
        assert_in_place(&mut driven, &format!("slices, light, {name}"));
        driven.picture(&format!("slices-light-{name}"));
        driven.press(Key::V);
        assert_in_place(&mut driven, &format!("probe, light, {name}"));
        driven.picture(&format!("probe-light-{name}"));
        driven.press(Key::V);
        assert_in_place(&mut driven, &format!("fluoroscopy, light, {name}"));
    }
}

/// Checks an insertion, in which the membrane is pressed in and gives way a little farther on.
#[test]
fn an_insertion_matches_its_pictures() {
    for (size, theme) in [(SMALL, "dark_small"), (LARGE, "light_large")] {
        let mut driven = Driven::open_plain(size);
        driven.press(Key::E);
        driven.until("force", |app| {
            app.link().state().is_some_and(|s| s.flags & flags::ENGAGED != 0)
        });
        if theme.starts_with("light") {
            driven.press(Key::T);
        }
        driven.plan_and_place();
        driven.pull_tip(0.016);
        let state = driven.window.state().link().state().expect("live");
        assert_eq!(
            state.flags & flags::IN_CONTACT,
            flags::IN_CONTACT,
            "it touches the gland"
        );
        assert_eq!(state.flags & flags::PUNCTURED, 0, "it has not passed through");
        assert_in_place(&mut driven, &format!("inserting, {theme}"));
        driven.picture(&format!("inserting-{theme}"));
        driven.compare_live(&format!("inserting_{theme}"), INSERTING_PIXELS);
    }
}

#[test]
fn an_insertion_drawn_by_its_changes_is_the_insertion_drawn_at_once() {
    let mut driven = Driven::open_plain(SMALL);
    driven.press(Key::E);
    driven.plan_and_place();
    App::draw_changes_only(&driven.window.ctx, true);
    for round in 0..3 {
        driven.pull_tip(0.006);
        assert_drawn_by_changes(&mut driven.window, &format!("round {round}"));
        for _ in 0..5 {
            driven.press(Key::V);
            assert_drawn_by_changes(&mut driven.window, &format!("round {round}, other pictures"));
        }
    }
}

#[test]
fn the_whole_procedure_by_one_key_ends_in_a_debrief() {
    let mut driven = Driven::open_plain(SMALL);
    driven.press(Key::E);
    driven.until("force", |app| {
        app.link().state().is_some_and(|s| s.flags & flags::ENGAGED != 0)
    });
    procedure_by_enter(&mut driven);
    driven.window.get_by_label_contains("One needle is not an implant");
    driven.window.get_by_label_contains("seeds of I-125 6711");
    assert_in_place(&mut driven, "debrief, dark");
    let picture = driven.picture("debrief");
    keep_for_docs(&picture, "debrief");
    driven.compare_live("debrief_dark_small", DEBRIEF_PIXELS);
    driven.window.get_by_label_contains("Whole procedure: force");
    driven.press(Key::V);
    driven.press(Key::Num2);
    driven.picture("perineum");
    driven.press(Key::Num1);
    let picture = driven.picture("dose");
    keep_for_docs(&picture, "dose");
    debrief_is_saved(&mut driven);
    driven.press(Key::T);
    assert_in_place(&mut driven, "debrief, light");
    driven.picture("debrief-light");
    for _ in 0..4 {
        driven.press(Key::V);
    }
    resize(&mut driven.window, LARGE);
    assert_in_place(&mut driven, "debrief, light, large");
    driven.picture("debrief-light-large");
    driven.compare_live("debrief_light_large", DEBRIEF_PIXELS);
    // Back to no seed, one by one, then no plan.
    for left in (0..5).rev() {
        driven.window.key_press_modifiers(egui::Modifiers::CTRL, Key::Z);
        driven.until("a seed less", |app| seeds(app) == left);
        driven.window.run_steps(2);
    }
    driven.window.key_press_modifiers(egui::Modifiers::CTRL, Key::Z);
    driven.until("no plan", |app| app.link().plan().is_some_and(|p| p.seed_count == 0));
}

/// Checks the saved page and figures; they have the same seeds as the table.
fn debrief_is_saved(driven: &mut Driven) {
    driven.click("Save the debrief");
    let start = Instant::now();
    let said = loop {
        assert!(start.elapsed() < Duration::from_secs(30), "no debrief was saved");
        driven.window.run_steps(1);
        if let Some(node) = driven.window.query_by_label_contains("Debrief saved as") {
            let inner = node.accesskit_node();
            break inner.label().or(inner.value()).expect("words");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let folder = std::path::PathBuf::from(said.trim_start_matches("Debrief saved as "));
    let text = std::fs::read_to_string(folder.join("debrief.html")).expect("a page");
    assert!(text.contains("Scene paper") && text.matches("<svg").count() == 3);
    let json = std::fs::read_to_string(folder.join("score.json")).expect("figures");
    let score: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(score["seeds"].as_array().map(Vec::len), Some(5));
    let worst_mm = score["worst_error_mm"].as_f64().expect("a number");
    driven.window.get_by_label_contains(&format!("worst {worst_mm:.2}"));
    assert!(
        score["motion"]["peak_force_n"].as_f64().is_some_and(|n| n > 1.0),
        "{json}"
    );
    assert_eq!(score["motion"]["insertions"], 1);
    std::fs::remove_dir_all(folder).expect("ours");
}

#[test]
fn a_hand_on_the_tip_in_a_slice_draws_the_needle() {
    let mut driven = Driven::open_plain(SMALL);
    driven.plan_and_place();
    driven.press(Key::V);
    driven.press(Key::V);
    let z = |app: &App| app.link().state().map_or(0.0, |s| s.tip_in_scene_m[2]);
    let start = z(driven.window.state());
    driven.pull_tip(0.008);
    let went = z(driven.window.state()) - start;
    assert!((went - 0.008).abs() < 1e-3, "drawn by 8 mm, went {went} m");
}

#[test]
fn text_can_be_enlarged() {
    let mut driven = Driven::open_plain(LARGE);
    driven.plan_and_place();
    driven.window.key_press_modifiers(egui::Modifiers::COMMAND, Key::Plus);
    driven.window.key_press_modifiers(egui::Modifiers::COMMAND, Key::Plus);
    driven.window.run_steps(4);
    assert!(
        driven.window.ctx.zoom_factor() > 1.15,
        "{}",
        driven.window.ctx.zoom_factor()
    );
    driven.picture("larger");
}

/// Run with `cargo test --profile quick -p stylet-tests-window states -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn cost_of_a_frame() {
    for scene in ["paper", "pelvis", "full"] {
        let mut driven = Driven::on(Core::start_with(&["--scene", scene]), SMALL);
        driven.plan_and_place();
        // As many ticks as the window ever keeps.
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(62) {
            driven.window.run_steps(1);
            std::thread::sleep(Duration::from_millis(12));
        }
        measure(&mut driven, &format!("{scene}, at rest"), 400);
        driven.window.key_down(Key::W);
        measure(&mut driven, &format!("{scene}, inserting"), 400);
        driven.window.key_up(Key::W);
    }
}

fn measure(driven: &mut Driven, what: &str, frames: usize) {
    let [mut frame_us, mut driver_us, mut kib] = [(); 3].map(|()| Vec::new());
    for _ in 0..frames {
        driven.window.run_steps(1);
        let cost = driven.window.state().cost();
        frame_us.push(cost.cpu_us);
        driver_us.push(cost.driver_us);
        kib.push(cost.uploaded_bytes as f64 / 1024.0);
        std::thread::sleep(Duration::from_millis(12));
    }
    let of = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        [0.5, 0.99, 1.0].map(|share| values[((values.len() - 1) as f64 * share) as usize])
    };
    let ms = |values: &mut Vec<f64>| of(values).map(|us| format!("{:.2}", us * 1e-3)).join(" ");
    println!(
        "{what}, {frames} frames, p50 p99 max: ours {} ms; driver {} ms; to the card {} KiB",
        ms(&mut frame_us),
        ms(&mut driver_us),
        of(&mut kib).map(|kib| format!("{kib:.0}")).join(" "),
    );
}
