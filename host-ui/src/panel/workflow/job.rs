//! Work on a separate thread: its name, its progress if known, and a button to cancel it.

use crate::theme;

/// Room of the button behind a job.
const BUTTON: f32 = 80.0;

/// Draws a job; returns whether it was cancelled.
pub fn job_ui(ui: &mut egui::Ui, what: &str, share: Option<f32>) -> bool {
    let cancel = |ui: &mut egui::Ui| ui.button("Cancel").clicked();
    let Some(share) = share else {
        return ui
            .horizontal(|ui| {
                waiting_ui(ui, what);
                cancel(ui)
            })
            .inner;
    };
    ui.add(egui::Label::new(theme::small(what)).truncate());
    ui.horizontal(|ui| {
        let bar = egui::ProgressBar::new(share)
            .desired_width(ui.available_width() - BUTTON)
            .desired_height(12.0);
        ui.add(bar);
        cancel(ui)
    })
    .inner
}

/// Draws the name of work whose progress is unknown, in a row with room for a button.
pub fn waiting_ui(ui: &mut egui::Ui, what: &str) {
    ui.spinner();
    let room = ui.available_width() - BUTTON;
    ui.add_sized(
        [room, ui.spacing().interact_size.y],
        egui::Label::new(theme::small(what)).truncate(),
    );
}
