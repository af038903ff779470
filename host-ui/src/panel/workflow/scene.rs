//! The first step: the scene.

use super::WorkflowState;
use super::job::{job_ui, waiting_ui};
use crate::IN_PAGE;
use crate::action::{Action, WatchAction};
use crate::dialog::Purpose;
use crate::panel::field::path_ui;
use crate::recent::Recent;
use crate::shown::{LoadState, Shown};
use crate::theme;
use crate::theme::Press;
use crate::words::Explained;
use egui::{Button, RichText};
use std::path::PathBuf;
use stylet_base::format;
use stylet_shm_schema::{BUILTIN_SCENES, MAX_LABEL_CELLS, SceneHeader, role};
use stylet_surfaces::bodies::has_every_label;

/// Width of the button next to the field.
const OPEN_WIDTH: f32 = 78.0;

/// Returns the remark on a scene whose tissue is solved in elements larger than its own.
pub fn solved_in(scene: &SceneHeader) -> Option<String> {
    (scene.body_edge > 1).then(|| format!("Tissue solved in elements of {:.1} mm", scene.body_spacing_m() * 1e3))
}

/// Returns the remark on the second hand's probe, and its explanation.
fn probe_solved_in(scene: &SceneHeader, edge_um: u32) -> Option<(String, String)> {
    let (edge_mm, cell_mm) = (f64::from(edge_um) * 1e-3, 1e3 * scene.spacing_m);
    (edge_um > 0).then(|| {
        let is_coarse = edge_mm > 1.01 * cell_mm;
        let solved = format!("Probe solved in {} of {edge_mm:.1} mm", if is_coarse { "elements" } else { "cells" });
        let why = if is_coarse {
            format!(
                "The pressure of the probe was solved in larger elements than the scene's cells of {cell_mm:.1} mm: in \"pelvis\" it is \
                 10 to 15 % too strong. Run \"rt-core probe\" once, which takes minutes: the next start of the core uses its result."
            )
        } else {
            "The pressure of the probe is solved in the scene's own cells.".to_owned()
        };
        (solved, why)
    })
}

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
    let label = ui
        .add(egui::Label::new(name).truncate())
        .explained("scene")
        .explained("element");
    if let Some(s) = &shown.scene
        && let Some(solved) = solved_in(s)
    {
        ui.label(theme::small(&solved)).on_hover_text(format!(
            "{} elements of {:.1} mm are too many for finite elements at 200 Hz. Layers and the needle's entry stay those of the \
             scene.",
            format::count(u64::from(s.element_count)),
            s.spacing_m * 1e3
        ))
        .explained("finite elements");
    }
    let edge_um = shown.second.map_or(0, |second| second.probe_edge_um);
    if let Some((solved, why)) = shown.scene.as_ref().and_then(|s| probe_solved_in(s, edge_um)) {
        ui.label(theme::small(&solved))
            .on_hover_text(why)
            .explained("finite elements");
    }
    if shown.scene.as_ref().is_some_and(|s| !has_every_label(s)) {
        ui.label(theme::small("Surfaces follow the lattice")).on_hover_text(format!(
            "The scene has more than {} cells, so the window has no labels of them: surfaces go through the middles of the \
             outermost elements, half an element inside the structures.",
            format::count(MAX_LABEL_CELLS as u64)
        ));
    }
    let free = shown.is_live() && !shown.load.is_busy() && !shown.running;
    ui.horizontal(|ui| {
        ui.label(theme::small("Built in"));
        for (number, name) in BUILTIN_SCENES.into_iter().enumerate() {
            if ui.add_enabled(free, Button::new(name)).clicked() {
                actions.push(Action::LoadBuiltinScene(number));
            }
        }
    });
    let can_watch = !shown.running && !shown.reads_recording;
    ui.horizontal(|ui| {
        ui.label(theme::small("Recorded"));
        let example = ui.add_enabled(can_watch, Button::new("example"));
        let example =
            example.on_hover_text("A recorded insertion: needle, force, tissue and seeds. It needs no rt-core.");
        if example.clicked() {
            actions.push(Action::Watch(WatchAction::Example));
        }
        if IN_PAGE {
            ui.label(theme::small("or drop a recording here"));
            return;
        }
        let other = Press(
            "recording…",
            "A recording made by \"host-ui record\", or drop one on the window",
        )
        .ui(ui, can_watch);
        actions.extend(other.then_some(Action::PickFile(Purpose::Recording)));
    });
    if !IN_PAGE {
        files_ui(ui, shown, state, (free, &label), actions);
    }
    let mut cancel = false;
    match &shown.load {
        LoadState::Idle => {}
        LoadState::Reading(what, share) => cancel = job_ui(ui, what, Some(*share)),
        // The core does not interrupt the building of a scene.
        LoadState::Sending(what) => drop(ui.horizontal(|ui| waiting_ui(ui, what))),
        LoadState::Loaded(what) => {
            ui.label(RichText::new(what).small().color(tokens.good));
        }
        LoadState::Refused(why) => {
            ui.label(RichText::new(why).small().color(tokens.bad));
        }
    }
    if cancel {
        actions.push(Action::CancelLoad);
    }
    if let Some(scene) = shown.scene.as_ref().filter(|s| s.structures().len() > 1) {
        structures_ui(ui, scene);
    }
}

/// Draws the field of a scene's or an image's file, and its buttons.
fn files_ui(
    ui: &mut egui::Ui,
    shown: &Shown,
    state: &mut WorkflowState,
    (free, label): (bool, &egui::Response),
    actions: &mut Vec<Action>,
) {
    let entered = ui.horizontal(|ui| {
        let width = ui.available_width() - OPEN_WIDTH;
        let field = path_ui(ui, "scene file", &mut state.scene_path, "file, or drop one here", width);
        let field = field.labelled_by(label.id);
        open_ui(ui, shown, state, free, actions);
        field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter))
    });
    let entered = entered.inner;
    ui.horizontal(|ui| {
        let path = state.scene_path.trim();
        let free = free && !path.is_empty();
        let scene = ui
            .add_enabled(free, Button::new("Load scene…"))
            .on_hover_text("A segmentation or a scene file: the body that the needle goes into");
        let image = ui
            .add_enabled(free && shown.scene.is_some(), Button::new("Load image…"))
            .on_hover_text(
                "Image of the same patient for the slices, instead of simulated ultrasound; it moves with the tissue",
            );
        if (scene.clicked() || entered) && free {
            actions.push(Action::LoadScene(PathBuf::from(path)));
        }
        if image.clicked() {
            actions.push(Action::LoadImage(PathBuf::from(path)));
        }
    });
}

/// Draws the dialogs, and the recent files.
fn open_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState, free: bool, actions: &mut Vec<Action>) {
    ui.add_enabled_ui(free, |ui| {
        ui.menu_button("Open…", |ui| {
            for purpose in [Purpose::Scene, Purpose::Image] {
                let can = purpose == Purpose::Scene || shown.scene.is_some();
                if ui
                    .add_enabled(can, Button::new(format!("{}…", purpose.title())))
                    .clicked()
                {
                    actions.push(Action::PickFile(purpose));
                }
            }
            ui.separator();
            if state.recent.is_empty() {
                ui.label(theme::small("No file was opened yet."));
            }
            for one in state.recent.clone() {
                recent_ui(ui, shown, state, &one, actions);
            }
        });
    });
}

fn recent_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState, one: &Recent, actions: &mut Vec<Action>) {
    let path = PathBuf::from(&one.path);
    let name = path
        .file_name()
        .map_or(one.path.clone(), |name| name.to_string_lossy().into_owned());
    let what = if one.is_image { " (image)" } else { "" };
    let can = !one.is_image || shown.scene.is_some();
    let button = ui.add_enabled(can, Button::new(format!("{name}{what}")).truncate());
    let button = button.on_hover_text(&one.path).on_disabled_hover_text(&one.path);
    if button.clicked() {
        actions.push(match one.is_image {
            true => Action::LoadImage(path),
            false => {
                state.scene_path.clone_from(&one.path);
                Action::LoadScene(path)
            }
        });
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
                let role = role_name(structure.role);
                ui.label(theme::small(role)).explained(role);
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
