//! The overlay that lists every key.

use crate::{keyboard, theme};

pub fn help_ui(ctx: &egui::Context, open: &mut bool) {
    egui::Window::new("Keys and mouse")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
        .show(ctx, |ui| {
            egui::Grid::new("keys")
                .num_columns(2)
                .spacing([24.0, 6.0])
                .min_row_height(18.0)
                .show(ui, |ui| {
                    ui.spacing_mut().interact_size.y = 18.0;
                    for (keys, what) in keyboard::KEYS {
                        ui.label(theme::strong(keys));
                        ui.label(what);
                        ui.end_row();
                    }
                });
            ui.label(theme::small(
                "Keys move the needle unless a field has the focus; Esc gives them back.",
            ));
        });
}
