//! The first step: which body the needle goes into.

use super::WorkflowState;
use crate::panel::{Action, LoadState, Shown};
use crate::{format, theme};
use egui::{Button, RichText};
use std::path::PathBuf;
use stylet_shm_schema::{BUILTIN_SCENES, SceneHeader, role};

pub fn scene_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState, actions: &mut Vec<Action>) {
    let tokens = theme::of(ui);
    let name = match &shown.scene {
        None => "No scene yet".to_owned(),
        Some(s) => format!(
            "{}, {}, {} elements",
            s.name.read(),
            format::volume(s.volume_m3),
            format::count(u64::from(s.element_count))
        ),
    };
    let label = ui.add(egui::Label::new(name).truncate());
    let free = shown.is_live() && !shown.load.is_busy() && !shown.running;
    ui.horizontal(|ui| {
        ui.label(theme::small("Built in"));
        for (number, name) in BUILTIN_SCENES.into_iter().enumerate() {
            if ui.add_enabled(free, Button::new(name)).clicked() {
                actions.push(Action::LoadBuiltinScene(number));
            }
        }
    });
    ui.horizontal(|ui| {
        let edit = egui::TextEdit::singleline(&mut state.scene_path)
            .hint_text("file, or drop one here")
            .desired_width(ui.available_width() - 106.0);
        let field = ui.add(edit).labelled_by(label.id);
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        let path = state.scene_path.trim();
        let clicked = ui
            .add_enabled(free && !path.is_empty(), Button::new("Load scene…"))
            .clicked();
        if (clicked || entered) && free && !path.is_empty() {
            actions.push(Action::LoadScene(PathBuf::from(path)));
        }
    });
    match &shown.load {
        LoadState::Idle => {}
        LoadState::Reading(what) | LoadState::Sending(what) => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.add(egui::Label::new(theme::small(what)).truncate());
            });
            if ui.button("Cancel").clicked() {
                actions.push(Action::CancelLoad);
            }
        }
        LoadState::Loaded(what) => {
            ui.label(RichText::new(what).small().color(tokens.good));
        }
        LoadState::Refused(why) => {
            ui.label(RichText::new(why).small().color(tokens.bad));
        }
    }
    if let Some(scene) = shown.scene.as_ref().filter(|s| s.structures().len() > 1) {
        structures_ui(ui, scene);
    }
}

fn structures_ui(ui: &mut egui::Ui, scene: &SceneHeader) {
    let title = format!("{} structures", scene.structures().len());
    egui::CollapsingHeader::new(theme::small(title)).show(ui, |ui| {
        let grid = egui::Grid::new("structures").num_columns(3).striped(true);
        grid.spacing([10.0, 2.0]).show(ui, |ui| {
            for structure in scene.structures() {
                ui.label(theme::small(structure.name.read()));
                let volume_m3 = f64::from(structure.element_count) * scene.spacing_m.powi(3);
                ui.label(theme::small(format::volume(volume_m3)));
                ui.label(theme::small(role_name(structure.role)));
                ui.end_row();
            }
        });
    });
}

fn role_name(bits: u32) -> &'static str {
    match bits {
        b if b & role::TARGET != 0 => "target",
        b if b & role::FIXED != 0 => "fixed",
        b if b & role::SPARE != 0 => "spared",
        _ => "",
    }
}
