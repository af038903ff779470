//! The window without a core: it names the command to type, and its dialogs open.

use crate::driven::{assert_drawn_by_changes, misplaced, options_of};
use crate::kept::tolerant;
use crate::opened::{Harness, open_window};
use egui_kittest::kittest::Queryable;
use std::ops::{Deref, DerefMut};
use stylet_shm_schema::Instance;
use stylet_shm_schema::PARAMETERS;
use stylet_tests::Alone;

/// Window that closes before its files are deleted.
struct Window {
    harness: Harness,
    _alone: Alone,
}

impl Deref for Window {
    type Target = Harness;

    fn deref(&self) -> &Self::Target {
        &self.harness
    }
}

impl DerefMut for Window {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.harness
    }
}

fn window(instance: &str) -> Window {
    window_of(instance, [1280.0, 800.0])
}

fn window_of(instance: &str, size: [f32; 2]) -> Window {
    let alone = Alone(Instance::new(instance).expect("a valid name"));
    Window {
        harness: open_window(size, options_of(alone.0.clone())),
        _alone: alone,
    }
}

/// Steps the window a few times; it requests frames forever, so `run` would never end.
fn settle(window: &mut Harness) {
    window.run_steps(5);
}

#[test]
fn without_a_core_the_window_offers_to_start_one() {
    let mut window = window("ui-window-absent");
    settle(&mut window);
    window.get_by_label("The simulator core is not running");
    window.get_by_label("Start it");
    assert!(
        window.query_by_label_contains("rt-core --instance").is_none(),
        "one remedy, not two"
    );
    assert!(
        window.query_by_label("The force is off").is_none(),
        "nothing is known of the force"
    );
    window.snapshot_options("window_absent", &tolerant());
}

#[test]
fn nothing_is_misplaced_without_a_core_in_any_theme_or_size() {
    for size in [[1280.0, 800.0], [1920.0, 1080.0]] {
        let mut window = window_of("ui-window-places", size);
        settle(&mut window);
        assert_eq!(misplaced(&window), Vec::<String>::new(), "dark, {size:?}");
        window.key_press(egui::Key::T);
        settle(&mut window);
        assert_eq!(misplaced(&window), Vec::<String>::new(), "light, {size:?}");
        if size[0] > 1900.0 {
            window.snapshot_options("window_absent_light_large", &tolerant());
        }
    }
}

/// Checks that redrawing only the changes gives the same window as drawing all of it.
#[test]
fn a_window_drawn_by_its_changes_is_the_window_drawn_at_once() {
    let mut window = window("ui-window-redraw");
    settle(&mut window);
    let mut pictures = 0;
    let mut same = |window: &mut Window, state: &str| {
        settle(window);
        assert_drawn_by_changes(window, state);
        pictures += 1;
    };
    same(&mut window, "at first");
    for key in [
        egui::Key::F1,
        egui::Key::Escape,
        egui::Key::T,
        egui::Key::V,
        egui::Key::V,
        egui::Key::T,
    ] {
        window.key_press(key);
        same(&mut window, &format!("after {key:?}"));
    }
    window.get_by_label("Parameters").click();
    same(&mut window, "a dialog over the pictures");
    window.get_by_label("Search").click();
    settle(&mut window);
    let field = window.get_by_role_and_label(egui::accesskit::Role::TextInput, "Search");
    field.focus();
    field.type_text("seed");
    same(&mut window, "words in a field");
    for size in [[1700.0, 900.0], [960.0, 600.0]] {
        window.set_size(size.into());
        same(&mut window, &format!("{size:?}"));
    }
    for scale in [1.5, 1.25] {
        window.ctx.set_zoom_factor(scale);
        same(&mut window, &format!("text of {scale}"));
    }
    assert_eq!(pictures, 13);
}

#[test]
fn help_lists_every_key() {
    let mut window = window("ui-window-help");
    settle(&mut window);
    window.key_press(egui::Key::F1);
    settle(&mut window);
    for (key, _) in host_ui::keyboard::KEYS {
        window.get_by_label(key);
    }
    window.snapshot_options("window_help", &tolerant());
}

#[test]
fn a_search_shows_only_matching_rows() {
    let mut window = window("ui-window-search");
    settle(&mut window);
    window.get_by_label("Parameters").click();
    settle(&mut window);
    window.get_by_label("Search").click();
    settle(&mut window);
    let field = window.get_by_role_and_label(egui::accesskit::Role::TextInput, "Search");
    field.focus();
    field.type_text("u_cri");
    settle(&mut window);
    window.get_by_label("Puncture depth u_cri");
    assert!(window.query_by_label("Smallest link").is_none(), "not asked for");
}

#[test]
fn parameters_dialog_opens_and_lists_every_parameter() {
    let mut window = window("ui-window-parameters");
    settle(&mut window);
    window.get_by_label("Parameters").click();
    settle(&mut window);
    for parameter in &PARAMETERS {
        assert!(
            window.query_all_by_label(parameter.label).next().is_some(),
            "{} is not listed",
            parameter.label
        );
    }
    window.snapshot_options("window_parameters", &tolerant());
}
