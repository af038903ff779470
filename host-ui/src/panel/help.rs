//! The overlay that lists every key, and the functions of gamepads and 3D mice.

use crate::IN_PAGE;
use crate::shown::Shown;
use crate::{keyboard, theme};
use stylet_controllers::Kind;

/// Height around the list, in points.
const TITLE_AND_EDGES: f32 = 70.0;
/// Width below which controllers stand under the keys.
const TWO_COLUMNS: f32 = 1100.0;
/// Width beyond which text wraps.
const LONGEST: f32 = 440.0;
/// Width of keys and edges.
const BESIDE_WORDS: f32 = 290.0;

pub fn help_ui(ctx: &egui::Context, shown: &Shown, open: &mut bool) {
    egui::Window::new("Keys, mouse and controllers")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
        .show(ctx, |ui| {
            let screen = ui.ctx().content_rect().size();
            let room = screen.y - TITLE_AND_EDGES;
            let scroll = egui::ScrollArea::vertical().max_height(room).min_scrolled_height(room);
            scroll.show(ui, |ui| {
                if IN_PAGE {
                    keys_ui(ui);
                    return;
                }
                if screen.x < TWO_COLUMNS {
                    ui.set_max_width(screen.x - TITLE_AND_EDGES);
                    keys_ui(ui);
                    ui.add_space(12.0);
                    controllers_ui(ui, shown);
                    return;
                }
                ui.horizontal_top(|ui| {
                    ui.vertical(keys_ui);
                    ui.add_space(12.0);
                    ui.vertical(|ui| controllers_ui(ui, shown));
                });
            });
        });
}

fn keys_ui(ui: &mut egui::Ui) {
    rows_ui(ui, "keys", keyboard::KEYS);
    ui.label(theme::small(
        "Keys move the needle unless a field has the focus; Esc returns them.",
    ));
}

fn controllers_ui(ui: &mut egui::Ui, shown: &Shown) {
    for (kind, title) in [(Kind::Gamepad, "Gamepad"), (Kind::Mouse3d, "3D mouse")] {
        ui.heading(title);
        rows_ui(ui, title, kind.uses());
        ui.add_space(8.0);
    }
    ui.heading("Controls the needle");
    let holder = shown.controllers.holder.as_ref();
    ui.label(holder.map_or("n/a", |device| device.name.as_str()));
    if let Some(device) = &shown.controllers.probe_holder {
        ui.heading("Controls the probe");
        ui.label(device.name.as_str());
    }
    for words in [
        "Devices may be plugged in at any time.",
        "The one that was moved last controls the needle.",
        "Release it once before it can move the needle.",
        "With a simulated --device-2, another one controls the probe.",
    ] {
        ui.label(theme::small(words));
    }
}

fn rows_ui<S: Into<String>>(ui: &mut egui::Ui, id: &str, rows: impl IntoIterator<Item = (&'static str, S)>) {
    let screen = ui.ctx().content_rect().size();
    let is_wide = screen.x >= TWO_COLUMNS;
    let longest = LONGEST.min(screen.x - BESIDE_WORDS);
    let grid = egui::Grid::new(id)
        .num_columns(2)
        .spacing([16.0, 6.0])
        .max_col_width(longest)
        .min_row_height(18.0);
    grid.show(ui, |ui| {
        ui.spacing_mut().interact_size.y = 18.0;
        for (what, does) in rows {
            ui.label(theme::strong(what));
            // Side by side, both columns are as wide as their text.
            let words = egui::Label::new(does.into());
            ui.add(if is_wide { words.extend() } else { words.wrap() });
            ui.end_row();
        }
    });
}
