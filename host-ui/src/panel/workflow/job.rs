//! Work on a thread of its own: what it is, how far it is where that is known, and its end at a click.

use crate::theme;

/// Whether it is to be cancelled.
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
