//! A guide through the first insertion: instructions, observations, and the reasons why seeds
//! missed.
//!
//! The state machine of the procedure decides the next step; this module holds only the texts.

mod lesson;
mod membranes;

use crate::shown::Shown;
use crate::theme;
use egui::Stroke;
pub use lesson::lesson;
pub use membranes::MetMembranes;

/// State of the guide: open or not, and the membranes that the needle has met.
#[derive(Default)]
pub struct Guide {
    /// True while it is shown above the steps.
    pub open: bool,
    /// Membranes of the last insertion.
    pub membranes: MetMembranes,
}

/// Draws the guide above the steps, in the panel that scrolls: it covers nothing and can be closed
/// at any time.
pub fn guide_ui(ui: &mut egui::Ui, shown: &Shown, guide: &mut Guide) {
    if !guide.open {
        return;
    }
    let tokens = theme::of(ui);
    let lesson = lesson(shown, &guide.membranes);
    theme::card(ui).stroke(Stroke::new(1.0, tokens.accent)).show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        ui.horizontal(|ui| {
            ui.label(theme::strong("First insertion"));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let leave = ui.button("Leave the guide");
                guide.open = !leave.on_hover_text("Nothing else changes").clicked();
            });
        });
        ui.label(lesson.what);
        for line in lesson.notes {
            ui.label(theme::weak(line));
        }
    });
    ui.add_space(theme::GAP);
}

impl Guide {
    /// Draws the button that opens and closes it.
    pub fn toggle_ui(&mut self, ui: &mut egui::Ui) {
        let hint = "Through the first insertion: what to do, what to watch, and why the seeds missed";
        ui.toggle_value(&mut self.open, "Guide").on_hover_text(hint);
    }
}
