//! The overlay that lists every key, and what gamepads and 3D mice do.

use crate::shown::Shown;
use crate::{keyboard, theme};
use stylet_controllers::Kind;

pub fn help_ui(ctx: &egui::Context, shown: &Shown, open: &mut bool) {
    egui::Window::new("Keys, mouse and controllers")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
        .show(ctx, |ui| {
            ui.horizontal_top(|ui| {
                ui.vertical(|ui| {
                    rows_ui(ui, "keys", keyboard::KEYS);
                    ui.label(theme::small(
                        "Keys move the needle unless a field has the focus; Esc returns them.",
                    ));
                });
                ui.add_space(12.0);
                ui.vertical(|ui| controllers_ui(ui, shown));
            });
        });
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
    for words in [
        "Devices may be plugged in at any time.",
        "The one that was moved last controls the needle.",
        "It must be released once before the needle follows it.",
    ] {
        ui.label(theme::small(words));
    }
}

fn rows_ui<S: Into<String>>(ui: &mut egui::Ui, id: &str, rows: impl IntoIterator<Item = (&'static str, S)>) {
    let grid = egui::Grid::new(id)
        .num_columns(2)
        .spacing([16.0, 6.0])
        .min_row_height(18.0);
    grid.show(ui, |ui| {
        ui.spacing_mut().interact_size.y = 18.0;
        for (what, does) in rows {
            ui.label(theme::strong(what));
            ui.label(does.into());
            ui.end_row();
        }
    });
}
