//! Work on a separate thread: its name, its progress if known, and a button to cancel it.

use crate::theme;

/// Draws a job; returns whether it was cancelled.
pub fn job_ui(ui: &mut egui::Ui, what: &str, share: Option<f32>) -> bool {
    let cancel = |ui: &mut egui::Ui| ui.button("Cancel").clicked();
    let Some(share) = share else {
        return ui
            .horizontal(|ui| {
                ui.spinner();
                let room = ui.available_width() - 80.0;
                ui.add_sized(
                    [room, ui.spacing().interact_size.y],
                    egui::Label::new(theme::small(what)).truncate(),
                );
                cancel(ui)
            })
            .inner;
    };
    ui.add(egui::Label::new(theme::small(what)).truncate());
    ui.horizontal(|ui| {
        let bar = egui::ProgressBar::new(share)
            .desired_width(ui.available_width() - 80.0)
            .desired_height(12.0);
        ui.add(bar);
        cancel(ui)
    })
    .inner
}
